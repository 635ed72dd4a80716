//! Help that teaches, command lines that make no sense, readers that leave.

use crate::support::{Bench, text};

const VERBS: [&str; 19] = [
    "build",
    "drape",
    "edit",
    "crater",
    "undo",
    "redo",
    "history",
    "compact",
    "info",
    "verify",
    "height",
    "export",
    "compare-ground",
    "synth",
    "flight",
    "replay",
    "compare",
    "iobench",
    "mesh",
];
/// Verbs of the feature `pictures`.
const DRAWING: &[&str] = if cfg!(feature = "pictures") { &["snapshot", "movie"] } else { &[] };

#[test]
fn every_verb_has_help_with_an_example() {
    let bench = Bench::new();
    let all = bench.good(&["--help"]);
    for verb in VERBS.iter().chain(DRAWING).copied() {
        assert!(all.contains(&format!("\n  {verb} ")), "{verb}");
        for flag in ["--help", "-h"] {
            let help = bench.good(&[verb, flag]);
            assert!(help.contains("Example") && help.contains(&format!("terrasoar {verb} ")), "{help}");
        }
    }
    assert!(bench.good(&["--version"]).starts_with("terrasoar "));
}

#[test]
fn wrong_command_lines_end_with_2() {
    let bench = Bench::with_terrain();
    let wrong: [&[&str]; 46] = [
        &["fly"],
        &["info"],
        &["info", "a.iqt", "b.iqt"],
        &["info", "a.iqt", "--jsn"],
        &["build", "land.tif"],
        &["build", "-o", "x.iqt"],
        &["build", "land.tif", "-o", "x.iqt", "--spacing", "0"],
        &["build", "land.tif", "-o", "x.iqt", "--spacing", "1,2,3"],
        &["build", "land.tif", "-o", "x.iqt", "--z-scale", "nan"],
        &["build", "land.tif", "-o", "x.iqt", "--memory", "7"],
        &["build", "land.tif", "-o", "x.iqt", "--record", "exactly"],
        &["build", "land.tif", "-o", "x.iqt", "--threads", "0"],
        &["height", "land.iqt", "--at", "5"],
        &["height", "land.iqt"],
        &["synth", "--size", "1000", "--seed", "1", "-o", "x.tif"],
        &["synth", "--size", "129", "--seed", "1", "-o", "x.jpg"],
        &["flight", "zigzag", "land.iqt", "-o", "x.flight", "--frames", "9", "--speed", "1"],
        &["flight", "straight", "land.iqt", "-o", "x.flight", "--frames", "9"],
        &["flight", "straight", "land.iqt", "-o", "x", "--frames", "9", "--speed", "1", "--incoherence", "1"],
        &["flight", "straight", "land.iqt", "-o", "x", "--frames", "0", "--speed", "1"],
        &["flight", "straight", "land.iqt", "-o", "x", "--frames", "9", "--speed", "1", "--turn-rate", "1"],
        &["flight", "turn", "land.iqt", "-o", "x", "--frames", "9", "--speed", "1", "--turn-rate", "0"],
        &["flight", "orbit", "land.iqt", "-o", "x", "--frames", "1", "--incoherence", "1"],
        &["replay", "land.iqt", "--flight", "f", "--engine", "roam"],
        &["replay", "land.iqt", "--flight", "f", "--engine", "soar", "--viewport", "800"],
        &["compare", "land.iqt", "--flight", "f", "--engines", "soar,soar", "-o", "r"],
        &["mesh", "land.iqt", "--flight", "f", "--frame", "0", "--engine", "soar", "-o", "x.3ds"],
        &["mesh", "land.iqt", "-o", "x.ply"],
        &["mesh", "land.iqt", "--max-error", "nan", "-o", "x.ply"],
        &["mesh", "land.iqt", "--max-error", "-1", "-o", "x.ply"],
        &["mesh", "land.iqt", "--max-error", "1", "--flight", "f", "--frame", "0", "-o", "x.ply"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--format", "dwg"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--coordinates", "utm"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--max-triangles", "0"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--edits", "e"],
        &["export", "land.iqt"],
        &["export", "land.iqt", "-o", "x.png"],
        &["export", "land.iqt", "-o", "x.tif", "--step", "3"],
        &["export", "land.iqt", "-o", "x.tif", "--window", "0,0,nan,9"],
        &["export", "land.iqt", "-o", "x.tif", "--window", "9,9,0,0"],
        &["export", "land.iqt", "-o", "x.tif", "--crs", "dem"],
        &["export", "land.iqt", "-o", "x.tif", "--type", "int8"],
        &["compare-ground"],
        &["compare-ground", "land.iqt", "land.iqt", "--range", "5"],
        &["compare-ground", "land.iqt", "land.iqt", "--picture", "x.jpg"],
    ];
    for args in wrong {
        bench.bad(2, args);
    }
    assert_eq!(bench.names(), ["land.iqt", "land.tif"], "nothing is written for a wrong command line");
}

#[test]
#[cfg(feature = "pictures")]
fn pictures_that_make_no_sense_end_with_2() {
    let bench = Bench::with_terrain();
    let wrong: [&[&str]; 18] = [
        &["snapshot", "land.iqt"],
        &["snapshot", "land.iqt", "-o", "a.jpg"],
        &["snapshot", "land.iqt", "-o", "a.png", "--style", "cubist"],
        &["snapshot", "land.iqt", "-o", "a.png", "--ramp", "rainbow"],
        &["snapshot", "land.iqt", "-o", "a.png", "--size", "0x9"],
        &["snapshot", "land.iqt", "-o", "a.png", "--sun", "90"],
        &["snapshot", "land.iqt", "-o", "a.png", "--sun", "90,91"],
        &["snapshot", "land.iqt", "-o", "a.png", "--contours", "0"],
        &["snapshot", "land.iqt", "-o", "a.png", "--morph", "yes"],
        &["snapshot", "land.iqt", "-o", "a.png", "--engine", "smart"],
        &["snapshot", "land.iqt", "-o", "a.png", "--flight", "f"],
        &["snapshot", "land.iqt", "-o", "a.png", "--flight", "f", "--frame", "1", "--at", "1,2,3"],
        &["snapshot", "land.iqt", "-o", "a.png", "--at", "1,2"],
        &["snapshot", "land.iqt", "-o", "a.png", "--look", "1,2"],
        &["movie", "land.iqt", "-o", "a.gif"],
        &["movie", "land.iqt", "--flight", "f", "-o", "a.avi"],
        &["movie", "land.iqt", "--flight", "f", "-o", "a.gif", "--every", "0"],
        &["movie", "land.iqt", "--flight", "f", "-o", "a.gif", "--fps", "0"],
    ];
    for args in wrong {
        bench.bad(2, args);
    }
    assert_eq!(bench.names(), ["land.iqt", "land.tif"], "nothing is written for a wrong command line");
}

#[test]
fn a_reader_that_leaves_ends_the_program_quietly() {
    let bench = Bench::with_terrain();
    for args in [&["info", "land.iqt"][..], &["info", "land.iqt", "--json"], &["verify", "land.iqt"]] {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let output = bench.command(args).stdout(writer).output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        assert_eq!(text(&output.stderr), "");
    }
}

#[test]
fn no_progress_where_there_is_no_terminal() {
    let bench = Bench::new();
    let output = bench.run(&["synth", "--size", "257", "--seed", "1", "-o", "a.tif"]);
    assert_eq!(text(&output.stderr), "");
    let output = bench.run(&["build", "a.tif", "-o", "a.iqt"]);
    assert_eq!(text(&output.stderr), "");
}
