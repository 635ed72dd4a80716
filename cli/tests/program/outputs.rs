//! What verbs may replace: nothing that they could not have made, no terrain that holds edits or a picture, never an input, a folder or a device.

use crate::edit::write as write_script;
use crate::support::Bench;
use std::fs;

/// Verbs with an output, but for its name, which comes last, and what they make.
const WRITERS: &[(&[&str], &str)] = &[
    (&["build", "land.tif", "-o"], "terrain"),
    (&["compact", "land.iqt", "-o"], "terrain"),
    (&["synth", "--size", "33", "--seed", "1", "-o"], "synth"),
    (&["synth", "--colour", "land.iqt", "-o"], "synth"),
    (&["flight", "orbit", "land.iqt", "--frames", "9", "--speed", "5", "-o"], "flight"),
    (&["crater", "land.iqt", "--rain", "9", "--seed", "1", "-o"], "script"),
    (&["mesh", "land.iqt", "--flight", "land.flight", "--frame", "3", "-o"], "mesh"),
    (&["mesh", "land.iqt", "--max-error", "9", "--format", "glb", "-o"], "mesh"),
    (&["export", "land.iqt", "-o"], "elevation"),
    (&["replay", "land.iqt", "--flight", "land.flight", "--stats"], "frames"),
    (
        &[
            "iobench",
            "land.iqt",
            "--flight",
            "land.flight",
            "--engines",
            "soar",
            "--layouts",
            "row",
            "--frames",
        ],
        "io-frames",
    ),
];

/// A name that the verb accepts.
fn name_for(verb: &[&str]) -> &'static str {
    match verb[0] {
        "synth" | "export" => "out.tif",
        "mesh" => "out.ply",
        _ => "out",
    }
}

fn read(bench: &Bench, name: &str) -> Vec<u8> {
    fs::read(bench.path(name)).unwrap()
}

fn fixture(name: &str) -> Vec<u8> {
    fs::read(format!("{}/../import/tests/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

/// Files that people have, and what each is called: some of them a verb could have made, and no other.
fn treasures(bench: &Bench) -> Vec<(&'static str, Vec<u8>, &'static str)> {
    for (verb, makes) in WRITERS {
        let name = match name_for(verb) {
            "out.tif" if verb[1] == "--size" => "synth.tif".to_owned(),
            "out.tif" if verb[0] == "synth" => "colour.tif".to_owned(),
            "out.tif" => format!("{makes}.tif"),
            "out.ply" if verb.contains(&"glb") => "mesh.glb".to_owned(),
            "out.ply" => "mesh.ply".to_owned(),
            _ => (*makes).to_owned(),
        };
        bench.good(&[verb, &[name.as_str()][..]].concat());
    }
    write_script(bench, "by-hand", "set rect 1,1,5,5 to 90\n");
    fs::copy(bench.path("land.iqt"), bench.path("edited")).unwrap();
    bench.good(&["edit", "edited", "--script", "by-hand"]);
    bench.good(&["edit", "land.iqt", "--script", "by-hand", "--overlay", "overlay"]);
    fs::copy(bench.path("land.iqt"), bench.path("draped")).unwrap();
    bench.good(&["drape", "draped", "--image", "colour.tif"]);
    let mut damaged = read(bench, "land.iqt");
    damaged[0x30] ^= 1;
    damaged.truncate(5000);
    let recorded = text_of_a_recorded_flight();
    let rgb = {
        let path = bench.path("photo.png");
        image::RgbImage::new(40, 30).save(&path).unwrap();
        fs::read(path).unwrap()
    };
    vec![
        ("text", b"dear diary\n".to_vec(), "a text file"),
        ("numbers", vec![7, 0, 1, 2], "a file of another kind"),
        ("terrain", read(bench, "terrain"), "a terrain"),
        ("edited", read(bench, "edited"), "a terrain that holds 1 commit of edits"),
        ("draped", read(bench, "draped"), "a terrain that holds a picture of 1 tile"),
        ("overlay", read(bench, "overlay"), "an overlay of edits"),
        ("damaged", damaged, "a terrain file that cannot be opened"),
        ("dem.tif", fixture("fixtures/int16-tiles-lzw-p2.tif"), "a TIFF file"),
        ("photo.png", rgb, "a PNG picture"),
        ("photo.jpg", fixture("image_fixtures/baseline.jpg"), "a JPEG picture"),
        ("synth", read(bench, "synth.tif"), "a TIFF file"),
        ("synth", read(bench, "colour.tif"), "a TIFF file"),
        ("flight", read(bench, "flight"), "a flight"),
        ("recorded", recorded, "a flight"),
        ("script", read(bench, "script"), "a script of edits"),
        ("by-hand", read(bench, "by-hand"), "a script of edits"),
        ("mesh", read(bench, "mesh.ply"), "a PLY mesh"),
        ("mesh", read(bench, "mesh.glb"), "a glTF scene"),
        ("elevation", read(bench, "elevation.tif"), "a TIFF file"),
        ("frames", read(bench, "frames"), "a text file"),
        ("io-frames", read(bench, "io-frames"), "a text file"),
    ]
}

fn text_of_a_recorded_flight() -> Vec<u8> {
    b"terrasoar-flight 1\nunits metres degrees seconds\n# recorded-with: terrasoar view\n0 1 2 300 0 0 0 45\n"
        .to_vec()
}

#[test]
fn no_verb_replaces_a_file_that_it_could_not_have_made() {
    let bench = Bench::with_flight();
    let treasures = treasures(&bench);
    let there = bench.names();
    for (verb, makes) in WRITERS {
        let out = name_for(verb);
        let args = [verb, &[out][..]].concat();
        for (kind, bytes, called) in &treasures {
            fs::write(bench.path(out), bytes).unwrap();
            // Figures are replaced by those of the same command only.
            let is_table = matches!(*makes, "frames" | "io-frames");
            if kind == makes && !is_table {
                bench.good(&args);
            } else {
                let called = if kind == makes { &"the figures of another run (" } else { called };
                let message = bench.bad(1, &args);
                for words in [out, "this would replace ", called, "--force"] {
                    assert!(message.contains(words), "{args:?} over {kind}: {message}");
                }
                assert!(read(&bench, out) == *bytes, "{args:?} over {kind}");
            }
        }
        // What is nobody's, and what was made a moment ago.
        fs::write(bench.path(out), "").unwrap();
        bench.good(&args);
        let made = read(&bench, out);
        bench.good(&args);
        if !matches!(*makes, "frames" | "io-frames") {
            assert!(read(&bench, out) == made, "{args:?}");
        }
        // Whoever says so may lose anything.
        fs::write(bench.path(out), "dear diary\n").unwrap();
        bench.good(&[&args[..], &["--force"]].concat());
        assert!(read(&bench, out).len() > 100);
        fs::remove_file(bench.path(out)).unwrap();
        assert_eq!(bench.names(), there, "{args:?}");
    }
}

#[test]
fn a_terrain_with_edits_or_a_picture_is_kept_and_the_message_says_what_it_holds() {
    let bench = Bench::with_terrain();
    write_script(
        &bench,
        "a.edits",
        "set rect 1,1,5,5 to 90\n\nset rect 9,9,9,9 to 80\n\nset rect 20,20,30,30 to 1\n",
    );
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "8", "-o", "photo.tif"]);
    bench.good(&["build", "land.tif", "-o", "other.iqt"]);
    bench.good(&["drape", "land.iqt", "--image", "photo.tif"]);
    bench.good(&["edit", "land.iqt", "--script", "a.edits"]);
    // What was undone can be done again, and would be lost too.
    bench.good(&["undo", "land.iqt", "9"]);
    let before = read(&bench, "land.iqt");
    for args in [&["build", "land.tif", "-o", "land.iqt"][..], &["compact", "other.iqt", "-o", "land.iqt"]] {
        let message = bench.bad(1, args);
        let words =
            "land.iqt: this would replace a terrain that holds 3 commits of edits and a picture of 14 tiles";
        assert!(message.contains(words) && message.contains("--force"), "{message}");
        assert!(read(&bench, "land.iqt") == before);
    }
    bench.good(&["build", "land.tif", "-o", "land.iqt", "--force"]);
    assert!(read(&bench, "land.iqt") == read(&bench, "other.iqt"));
}

/// Compacting in place is asked for what it does.
#[test]
fn compacting_in_place_says_that_the_history_ends() {
    let bench = Bench::with_terrain();
    write_script(&bench, "a.edits", "set rect 1,1,5,5 to 90\n");
    assert!(!bench.good(&["compact", "land.iqt"]).contains("undone"));
    bench.good(&["edit", "land.iqt", "--script", "a.edits"]);
    let said = bench.good(&["compact", "land.iqt"]);
    assert!(said.contains("the history ends: 1 commit of edits can no longer be undone"), "{said}");
    assert!(!bench.good(&["compact", "land.iqt"]).contains("undone"));
}

#[test]
#[cfg(unix)]
fn an_input_is_an_input_under_every_name() {
    let bench = Bench::with_flight();
    fs::hard_link(bench.path("land.tif"), bench.path("hard.iqt")).unwrap();
    std::os::unix::fs::symlink("land.tif", bench.path("soft.iqt")).unwrap();
    fs::hard_link(bench.path("land.iqt"), bench.path("land2.iqt")).unwrap();
    write_script(&bench, "a.edits", "set rect 1,1,5,5 to 90\n");
    fs::hard_link(bench.path("a.edits"), bench.path("a.ply")).unwrap();
    fs::hard_link(bench.path("land.flight"), bench.path("flight.csv")).unwrap();
    let there = bench.names();
    let mesh =
        ["mesh", "land.iqt", "--flight", "land.flight", "--frame", "1", "--edits", "a.edits", "-o", "a.ply"];
    for args in [
        &["build", "land.tif", "-o", "hard.iqt"][..],
        &["build", "land.tif", "-o", "soft.iqt"],
        &["build", "soft.iqt", "-o", "land.tif"],
        &["compact", "land.iqt", "-o", "land2.iqt"],
        &["synth", "--colour", "land.iqt", "-o", "./land.iqt.tif"],
        &["replay", "land.iqt", "--flight", "land.flight", "--stats", "flight.csv"],
        &mesh,
    ] {
        let args = [args, &["--force"]].concat();
        if args[0] == "synth" {
            fs::hard_link(bench.path("land.iqt"), bench.path("land.iqt.tif")).unwrap();
        }
        let message = bench.bad(1, &args);
        assert!(message.contains("the output is the input"), "{args:?}: {message}");
    }
    fs::remove_file(bench.path("land.iqt.tif")).unwrap();
    assert_eq!(bench.names(), there);
    bench.good(&["verify", "land.iqt"]);
}

#[test]
fn a_report_keeps_what_is_not_its_own() {
    let bench = Bench::with_flight();
    let compare =
        ["compare", "land.iqt", "--flight", "land.flight", "--engines", "soar", "--no-sweeps", "-o", "r"];
    let iobench = [
        "iobench",
        "land.iqt",
        "--flight",
        "land.flight",
        "--engines",
        "soar",
        "--layouts",
        "row",
        "-o",
        "r",
    ];
    for (args, taken) in
        [(&compare[..], ["frames-soar.csv", "summary.json"]), (&iobench, ["frames.csv", "report.html"])]
    {
        fs::create_dir(bench.path("r")).unwrap();
        fs::write(bench.path("r/notes.txt"), "mine").unwrap();
        for name in taken {
            let path = bench.path("r").join(name);
            fs::write(&path, "mine,too\n1,2\n").unwrap();
            let message = bench.bad(1, args);
            assert!(message.contains(name) && message.contains("--force"), "{message}");
            assert_eq!(fs::read_dir(bench.path("r")).unwrap().count(), 2, "nothing was begun");
            fs::remove_file(path).unwrap();
        }
        bench.good(args);
        // What another run of ours left goes, what is anybody else's stays.
        if args[0] == "compare" {
            fs::copy(bench.path("r/frames-soar.csv"), bench.path("r/frames-kinetic.csv")).unwrap();
        }
        bench.good(args);
        assert!(!bench.path("r/frames-kinetic.csv").exists());
        assert_eq!(fs::read(bench.path("r/notes.txt")).unwrap(), b"mine");
        fs::write(bench.path("r").join(taken[0]), "mine\n").unwrap();
        bench.good(&[args, &["--force"]].concat());
        assert!(fs::read(bench.path("r").join(taken[0])).unwrap().len() > 100);
        fs::remove_dir_all(bench.path("r")).unwrap();
    }
}

/// Text goes on to whoever reads it; nothing takes the place of a pipe or a device.
#[test]
#[cfg(target_os = "linux")]
fn devices_pipes_and_descriptors_stay_and_text_streams_into_them() {
    let bench = Bench::with_flight();
    let fifo = bench.path("fifo");
    let made = std::process::Command::new("mkfifo").arg(&fifo).status().unwrap();
    assert!(made.success());
    std::os::unix::fs::symlink("/dev/null", bench.path("null")).unwrap();
    let flight = ["flight", "orbit", "land.iqt", "--frames", "9", "--speed", "5", "-o"];
    bench.good(&[&flight[..], &["plain"]].concat());
    let text = read(&bench, "plain");
    for force in [&[][..], &["--force"]] {
        for out in ["fifo", "null", "/dev/null", "/dev/stdout"] {
            let message = bench.bad(1, &[&["build", "land.tif", "-o", out][..], force].concat());
            assert!(message.contains("device or pipe"), "{message}");
        }
        bench.good(&[&flight[..], &["null"], force].concat());
        bench.good(&[&flight[..], &["/dev/null"], force].concat());
        assert_eq!(bench.run(&[&flight[..], &["/dev/stdout"], force].concat()).stdout, text);
        let mut writer = bench.command(&[&flight[..], &["fifo"], force].concat()).spawn().unwrap();
        assert_eq!(fs::read(&fifo).unwrap(), text);
        assert!(writer.wait().unwrap().success());
    }
    let is_link = |name: &str| fs::symlink_metadata(bench.path(name)).unwrap().is_symlink();
    use std::os::unix::fs::FileTypeExt;
    assert!(is_link("null") && fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo());

    // A file behind standard output belongs to the shell, which goes on writing to it.
    let program = env!("CARGO_BIN_EXE_terrasoar");
    for redirection in [">", ">>"] {
        fs::write(bench.path("log"), "old\n").unwrap();
        let run = format!("'{program}' {} /dev/stdout 2>&-", flight.join(" "));
        let script = format!("{{ echo first; {run}; echo last; }} {redirection} log");
        let status =
            std::process::Command::new("sh").args(["-c", &script]).current_dir(bench.folder()).status();
        assert!(status.unwrap().success());
        let old = if redirection == ">" { "" } else { "old\n" };
        let expected = [old.as_bytes(), b"first\n", &text, b"last\n"].concat();
        assert!(
            read(&bench, "log") == expected,
            "{redirection}: {}",
            String::from_utf8_lossy(&read(&bench, "log"))
        );
    }
}

/// Names of outputs are whatever the system has.
#[test]
#[cfg(target_os = "linux")]
fn names_need_not_be_unicode() {
    use std::ffi::{OsStr, OsString};
    use std::os::unix::ffi::OsStrExt;
    let bench = Bench::with_flight();
    let report = ["compare", "land.iqt", "--flight", "land.flight", "--engines", "soar", "--no-sweeps", "-o"];
    for verb in WRITERS.iter().map(|(verb, _)| *verb).chain([&report[..]]) {
        let mut name = OsString::from(OsStr::from_bytes(b"\xff\xfe-"));
        name.push(name_for(verb));
        let mut command = bench.command(verb);
        let output = command.arg(&name).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{verb:?}: {}", String::from_utf8_lossy(&output.stderr));
        let path = bench.folder().join(&name);
        assert!(path.exists(), "{verb:?}");
        let again = bench.command(verb).arg(&name).output().unwrap();
        assert_eq!(again.status.code(), Some(0), "{verb:?}: {}", String::from_utf8_lossy(&again.stderr));
        if path.is_dir() {
            fs::remove_dir_all(path).unwrap()
        } else {
            fs::remove_file(path).unwrap()
        }
        assert_eq!(bench.names(), ["land.flight", "land.iqt", "land.tif"]);
    }
}
