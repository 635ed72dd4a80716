//! Builds that succeed, fail, run out of room and are killed.

use crate::support::{Bench, text};
use std::process::Stdio;
use std::time::Instant;
use terrasoar_layout::testing::{is_thorough, one_in};

#[test]
fn the_same_input_gives_the_same_bytes() {
    let bench = Bench::new();
    bench.good(&["synth", "--size", "1025", "--seed", "3", "-o", "land.tif"]);
    let mut files = Vec::new();
    for (threads, memory) in [("1", "64"), ("2", "64"), ("1", "2048"), ("2", "2048")] {
        bench.good(&["build", "land.tif", "-o", "a.iqt", "--threads", threads, "--memory", memory]);
        files.push(std::fs::read(bench.path("a.iqt")).unwrap());
    }
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn the_summary_says_size_record_and_spacing() {
    let bench = Bench::with_terrain();
    let said = bench.good(&["build", "land.tif", "-o", "a.iqt"]);
    for words in [
        "129 x 129",
        "samples/s",
        "compact records of 4 bytes",
        "bounded",
        "20 m",
        "from the elevation model",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let flags = ["--spacing", "10,30", "--z-scale", "2", "--record", "exact", "--error", "step"];
    let said = bench.good(&[&["build", "land.tif", "-o", "b.iqt"][..], &flags].concat());
    for words in ["exact records of 8 bytes", "step", "10 x 30 m", "stated"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let said = bench.good(&["build", "land.tif", "-o", "c.iqt", "--record", "fine", "--packed"]);
    assert!(said.contains("fine records of 4 bytes"), "{said}");
    let info = bench.json(&["info", "c.iqt", "--json"]);
    assert!(info["record"] == "fine" && info["height_step_m"].is_number(), "{info}");
    let ranges = ["a.iqt", "b.iqt"].map(|f| bench.json(&["info", f, "--json"])["height_range_m"].clone());
    assert!((ranges[1][1].as_f64().unwrap() - 2.0 * ranges[0][1].as_f64().unwrap()).abs() < 1e-6);
}

#[test]
fn a_spacing_that_nobody_stated_is_warned_of() {
    let bench = Bench::new();
    // A PNG of other programs says nothing about spacing.
    std::fs::copy(
        concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/data/puget_sound_1025.png"),
        bench.path("puget.png"),
    )
    .unwrap();
    let output = bench.run(&["build", "puget.png", "-o", "a.iqt"]);
    assert_eq!(output.status.code(), Some(0));
    let warning = text(&output.stderr);
    assert!(warning.starts_with("warning: ") && warning.contains("--spacing"), "{warning}");
    assert!(text(&output.stdout).contains("assumed"));
    let output = bench.run(&["build", "puget.png", "-o", "a.iqt", "--spacing", "160", "--z-scale", "0.1"]);
    assert_eq!(text(&output.stderr), "");
}

#[test]
fn degrees_become_metres_and_info_says_so() {
    let bench = Bench::new();
    // An SRTM tile: 1201 x 1201 big-endian 16-bit samples over one degree, one of them void.
    let mut tile = Vec::with_capacity(1201 * 1201 * 2);
    for i in 0..1201 * 1201u32 {
        let height = if i == 600 * 1201 + 600 { i16::MIN } else { (i % 1201 / 4) as i16 };
        tile.extend(height.to_be_bytes());
    }
    std::fs::write(bench.path("N46E007.hgt"), tile).unwrap();
    let output = bench.run(&["build", "N46E007.hgt", "-o", "a.iqt"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("degrees"), "{}", text(&output.stderr));
    let info = bench.json(&["info", "a.iqt", "--json"]);
    assert!(info["spacing_origin"].as_str().unwrap().contains("latitude 46.5"), "{info}");
    let spacing = [0, 1].map(|i| info["spacing_m"][i].as_f64().unwrap());
    assert!((spacing[0] - 64.0).abs() < 1.0 && (spacing[1] - 92.6).abs() < 1.0, "{spacing:?}");
    assert_eq!(info["nodata_samples"], 1);
    assert!(info["crs"].as_str().unwrap().contains("4326"), "{info}");
    bench.good(&["verify", "a.iqt"]);
    let at = format!("{},{}", 600.0 * spacing[0], 600.0 * spacing[1]);
    assert_eq!(bench.good(&["height", "a.iqt", "--at", &at]), "no data\n");
}

#[test]
fn nodata_masks_a_value() {
    let bench = Bench::with_terrain();
    bench.good(&["build", "land.tif", "-o", "a.iqt", "--nodata", "0"]);
    let info = bench.json(&["info", "a.iqt", "--json"]);
    assert!(info["height_range_m"][0].as_f64().unwrap() > 0.0);
    bench.good(&["verify", "a.iqt"]);
}

#[test]
fn inputs_that_cannot_be_read_are_named() {
    let bench = Bench::with_terrain();
    std::fs::write(bench.path("text"), "not elevation").unwrap();
    std::fs::write(bench.path("empty"), "").unwrap();
    std::fs::create_dir(bench.path("bare")).unwrap();
    std::fs::write(bench.path("bare/notes.md"), "words").unwrap();
    for input in ["missing.tif", "text", "empty", "land.iqt", "bare"] {
        let message = bench.bad(1, &["build", input, "-o", "x.iqt"]);
        assert!(message.contains(input), "{message}");
    }
    let message = bench.bad(1, &["build", "text", "empty", "-o", "x.iqt"]);
    assert!(message.contains("none of the files can be read") && message.contains("empty"), "{message}");
    assert!(!bench.path("x.iqt").exists());
}

#[test]
fn outputs_that_cannot_be_are_refused_and_nothing_is_lost() {
    let bench = Bench::with_terrain();
    let before = std::fs::read(bench.path("land.tif")).unwrap();
    let message = bench.bad(1, &["build", "land.tif", "-o", "land.tif"]);
    assert!(message.contains("the output is the input"), "{message}");
    assert_eq!(std::fs::read(bench.path("land.tif")).unwrap(), before);
    bench.bad(1, &["build", "land.tif", "-o", "missing/x.iqt"]);
    assert!(bench.bad(1, &["build", "land.tif", "-o", "."]).contains("folder"));
    #[cfg(unix)]
    assert!(bench.bad(1, &["build", "land.tif", "-o", "/dev/null"]).contains("device"));
    assert_eq!(bench.names(), ["land.iqt", "land.tif"]);
}

/// A limit on the size of files fails as a full disk does (`cli/tests/full_disk.rs`), and its signal ends nothing.
#[cfg(unix)]
#[test]
fn a_limit_on_the_size_of_files_is_an_error_and_leaves_nothing() {
    let bench = Bench::with_terrain();
    let program = env!("CARGO_BIN_EXE_terrasoar");
    // In blocks of 512 or 1024 bytes, as the shell has it; the file takes some 90 KiB.
    for (blocks, verb) in [(0, "build land.tif"), (20, "build land.tif"), (20, "synth --size 257 --seed 1")] {
        let script = format!("ulimit -f {blocks}; exec '{program}' {verb} -o x.tif");
        let output = std::process::Command::new("sh")
            .args(["-c", &script])
            .current_dir(bench.folder())
            .output()
            .unwrap();
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.starts_with("error: x.tif: cannot write"), "{said}");
        assert!(verb.starts_with("synth") || said.contains("make"), "{said}");
        assert_eq!(bench.names(), ["land.iqt", "land.tif"]);
    }
}

/// Whether the folder's file system has files without a name, as nearly all on Linux have.
#[cfg(target_os = "linux")]
fn has_nameless_files(bench: &Bench) -> bool {
    use std::os::unix::fs::OpenOptionsExt;
    const O_TMPFILE: i32 = 0o20_200_000;
    std::fs::OpenOptions::new().write(true).custom_flags(O_TMPFILE).open(bench.folder()).is_ok()
}

/// Killed at twenty moments from start to end, with the samples in a temporary file; then built as if nothing had been.
#[cfg(target_os = "linux")]
#[test]
fn a_killed_build_leaves_nothing_and_the_next_starts_afresh() {
    let bench = Bench::new();
    bench.good(&["synth", "--size", "2049", "--seed", "3", "-o", "land.tif"]);
    let build = ["build", "land.tif", "-o", "x.iqt", "--memory", "48", "--force"];
    // The first of several is often the slowest.
    let once = |_| {
        let start = Instant::now();
        bench.good(&build);
        start.elapsed()
    };
    let whole = (0..3).map(once).min().unwrap();
    let built = std::fs::read(bench.path("x.iqt")).unwrap();
    let mut killed = 0;
    for moment in one_in(2, 0..20) {
        std::fs::write(bench.path("x.iqt"), "what was there").unwrap();
        let mut child = bench.command(&build).stdout(Stdio::null()).spawn().unwrap();
        std::thread::sleep(whole * moment / 20);
        child.kill().unwrap();
        let was_killed = child.wait().unwrap().code().is_none();
        let there = std::fs::read(bench.path("x.iqt")).unwrap();
        assert!(there == b"what was there" || there == built, "half a file, {moment}");
        assert!(there == built || was_killed);
        killed += u32::from(there != built);
        if has_nameless_files(&bench) {
            // Killed between its two last calls it leaves a complete file, which a later build takes away.
            let mut names = bench.names();
            names.retain(|name| !name.ends_with(".terrasoar-new"));
            assert_eq!(names, ["land.tif", "x.iqt"], "{moment} twentieths through");
        }
    }
    assert!(killed >= if is_thorough() { 5 } else { 3 }, "{killed}");
    bench.good(&build);
    assert!(std::fs::read(bench.path("x.iqt")).unwrap() == built);
}
