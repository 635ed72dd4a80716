//! Text from files, names and the command line, as the program shows it: nothing that a terminal would obey, no line that is not ours.

use super::support::{Bench, text};
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use terrasoar_layout::testing::{Counts, reseal};

/// Clears the screen, renames the window, turns colours on by C0 and C1, turns writing round, hides, rings, and begins a line of its own.
const HOSTILE: &str = "\x1b[2J\x1b]0;owned\x07\u{9b}31m\u{202e}gnp\u{2066}\u{200b}\x7f\u{feff}\nsound";

/// Whether a terminal would show it as it is.
fn is_harmless(bytes: &[u8]) -> bool {
    let hidden = ['\u{200b}', '\u{202e}', '\u{2066}', '\u{feff}'];
    text(bytes).chars().all(|c| c == '\n' || !(c.is_control() || hidden.contains(&c)))
}

/// Puts a text field of a header or journal page, and makes the checksums right.
fn with_text(path: &Path, fields: &[(usize, &str)]) {
    let mut bytes = fs::read(path).unwrap();
    for (at, text) in fields {
        bytes[*at..at + 2].copy_from_slice(&(text.len() as u16).to_le_bytes());
        bytes[at + 2..at + 2 + text.len()].copy_from_slice(text.as_bytes());
    }
    reseal(&mut bytes, Counts::Keep);
    fs::write(path, bytes).unwrap();
}

/// Runs the program and looks at all it says; gives both streams together.
fn shown(bench: &Bench, args: &[&str]) -> String {
    let output = bench.run(args);
    assert!(is_harmless(&output.stdout), "{args:?}: {:?}", text(&output.stdout));
    assert!(is_harmless(&output.stderr), "{args:?}: {:?}", text(&output.stderr));
    let both = text(&output.stdout) + &text(&output.stderr);
    assert!(!both.lines().any(|line| line.trim() == "sound"), "{args:?}: {both}");
    both
}

/// A terrain of 129 x 129 samples that was edited twice, once under that name.
fn edited(bench: &Bench) {
    fs::write(
        bench.path("e.edits"),
        "terrasoar-edits 1\nunits metres degrees\nset rect 0,0,100,100 to 50\n\nset rect 0,0,60,60 to 51\n",
    )
    .unwrap();
    let output = bench.run(&["edit", "land.iqt", "--script", "e.edits"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn what_a_file_says_of_itself_is_spelt_out() {
    let bench = Bench::with_terrain();
    with_text(&bench.path("land.iqt"), &[(0x200, HOSTILE), (0x300, HOSTILE)]);
    let told = shown(&bench, &["info", "land.iqt"]);
    assert_eq!(told.matches(r"\u{1b}[2J").count(), 2, "{told}");
    assert_eq!(told.matches(r"\u{feff}\nsound").count(), 2, "{told}");
    let output = bench.run(&["info", "land.iqt", "--json"]);
    assert!(is_harmless(&output.stdout), "{}", text(&output.stdout));
    // The value stays what it is.
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(value["source"], HOSTILE);
    assert_eq!(value["crs"], HOSTILE);
}

#[test]
fn labels_of_a_history_are_spelt_out() {
    let bench = Bench::with_terrain();
    edited(&bench);
    let path = bench.path("land.iqt");
    let bytes = fs::read(&path).unwrap();
    let journal: Vec<usize> =
        (0..bytes.len()).step_by(4096).filter(|at| bytes[*at..].starts_with(b"IQTCOMIT")).collect();
    assert!(!journal.is_empty());
    let fields: Vec<(usize, &str)> = journal.iter().map(|at| (at + 0x200, HOSTILE)).collect();
    with_text(&path, &fields);
    for args in
        [&["history", "land.iqt"][..], &["undo", "land.iqt"], &["redo", "land.iqt"], &["verify", "land.iqt"]]
    {
        let told = shown(&bench, args);
        assert_eq!(args[0] != "verify", told.contains(r"\u{1b}[2J"), "{told}");
        assert!(!told.contains("error"), "{told}");
    }
    shown(&bench, &["undo", "land.iqt", "--json"]);
    shown(&bench, &["history", "land.iqt", "--json"]);
}

#[test]
fn overlays_flights_and_scripts_are_spelt_out() {
    let bench = Bench::with_flight();
    fs::write(bench.path("o.edits"), "terrasoar-edits 1\nunits metres degrees\nset rect 3,3,9,9 to 50\n")
        .unwrap();
    bench.good(&["edit", "land.iqt", "--script", "o.edits", "--overlay", "o.iqo"]);
    let mut overlay = fs::read(bench.path("o.iqo")).unwrap();
    for slot in [0, 4096] {
        overlay[slot + 0x400..slot + 0x402].copy_from_slice(&(HOSTILE.len() as u16).to_le_bytes());
        overlay[slot + 0x402..slot + 0x402 + HOSTILE.len()].copy_from_slice(HOSTILE.as_bytes());
        let sum = crc32(&overlay[slot..slot + 0xffc]);
        overlay[slot + 0xffc..slot + 0x1000].copy_from_slice(&sum.to_le_bytes());
    }
    fs::write(bench.path("o.iqo"), overlay).unwrap();
    // Of another terrain: its name of it is told.
    bench.good(&["synth", "--size", "65", "--seed", "3", "-o", "hills.tif"]);
    bench.good(&["build", "hills.tif", "-o", "hills.iqt"]);
    let told = shown(&bench, &["info", "hills.iqt", "--overlay", "o.iqo"]);
    assert!(told.contains(r"which was called \u{1b}[2J"), "{told}");
    let flight = fs::read_to_string(bench.path("land.flight")).unwrap();
    fs::write(bench.path("h.flight"), format!("{flight}{HOSTILE}\n")).unwrap();
    shown(&bench, &["replay", "land.iqt", "--flight", "h.flight"]);
    fs::write(bench.path("h.edits"), format!("terrasoar-edits 1\nunits metres degrees\n{HOSTILE}\n"))
        .unwrap();
    shown(&bench, &["edit", "land.iqt", "--script", "h.edits"]);
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |sum: u32, byte: &u8| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| sum >> 1 ^ (0xedb8_8320 & (sum & 1).wrapping_neg()))
    };
    !bytes.iter().fold(u32::MAX, step)
}

#[test]
fn names_and_what_is_typed_are_spelt_out() {
    let bench = Bench::with_terrain();
    let name = "a\x1b[31m\u{202e}b\nsound.iqt";
    fs::copy(bench.path("land.iqt"), bench.path(name)).unwrap();
    shown(&bench, &["info", name]);
    shown(&bench, &["info", name, "--json"]);
    shown(&bench, &["verify", name]);
    // Damaged, missing, and nonsense on the command line, in words of the program and of its parser of arguments.
    let mut bytes = fs::read(bench.path(name)).unwrap();
    bytes[5 * 4096 + 77] ^= 4;
    fs::write(bench.path(name), bytes).unwrap();
    let told = shown(&bench, &["verify", name]);
    assert!(told.contains(r"a\u{1b}[31m\u{202e}b\nsound.iqt: not sound"), "{told}");
    for (args, words) in [
        (&["info", "missing\x1b[31m\n.iqt"][..], r"missing\u{1b}[31m\n.iqt"),
        (&["replay", name, "--flight", "\x1b[31m"], r"\u{1b}[31m"),
        (&["height", name, "--at", "\x1b[31m\u{9b}m"], r"invalid value"),
        (&["height", name, "--\u{9b}m"], r"unexpected argument '--\u{9b}m'"),
        (&["\u{202e}\x1b[31m"], r"unrecognized subcommand '\u{202e}"),
    ] {
        let told = shown(&bench, args);
        assert!(told.contains(words) && told.starts_with("error: "), "{told}");
    }
}

/// Names are bytes on this system, and need be no text.
#[cfg(target_os = "linux")]
#[test]
fn outputs_need_no_names_that_are_text() {
    use std::os::unix::ffi::{OsStrExt, OsStringExt};
    let bench = Bench::with_flight();
    let name = |extension: &str| {
        let mut name = b"caf\xe9-\xff.".to_vec();
        name.extend_from_slice(extension.as_bytes());
        OsString::from_vec(name)
    };
    let made = |args: &[&str], extension: &str| {
        let out = name(extension);
        let output = bench.command(args).arg("-o").arg(&out).output().unwrap();
        assert!(output.status.success(), "{args:?}: {}", text(&output.stderr));
        assert!(is_harmless(&output.stdout) && is_harmless(&output.stderr));
        let path = bench.folder().join(&out);
        assert!(path.as_os_str().as_bytes().ends_with(out.as_bytes()) && path.exists(), "{args:?}");
        out
    };
    made(&["synth", "--size", "65", "--seed", "1"], "tif");
    made(&["synth", "--size", "65", "--seed", "1"], "png");
    let terrain = made(&["build", "land.tif"], "iqt");
    made(&["flight", "straight", "land.iqt", "--frames", "3", "--speed", "5"], "flight");
    made(&["mesh", "land.iqt", "--flight", "land.flight", "--frame", "1"], "ply");
    made(&["mesh", "land.iqt", "--flight", "land.flight", "--frame", "1"], "obj");
    made(&["mesh", "land.iqt", "--max-error", "5"], "glb");
    made(&["export", "land.iqt"], "tiff");
    made(&["compact", "land.iqt"], "iqt");
    let output = bench.command(&["info", "--json"]).arg(&terrain).output().unwrap();
    assert!(serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["path"].is_string());
    // Without anything to draw with the verb fails, and not for the name.
    for json in [&[][..], &["--json"]] {
        let out = name("picture.png");
        let args = ["snapshot", "land.iqt", "--size", "64x48"];
        let output = bench.command(&[&args[..], json].concat()).arg("-o").arg(&out).output().unwrap();
        let told = text(&output.stderr);
        assert!(output.status.success() || told.contains("adapter") || told.contains("graphics"), "{told}");
        let wrong = bench.command(&args).arg("-o").arg(name("jpg")).output().unwrap();
        assert_eq!(wrong.status.code(), Some(2), "{}", text(&wrong.stderr));
        assert!(text(&wrong.stderr).contains("must end in .png"));
    }
}
