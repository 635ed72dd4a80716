//! Help that teaches, command lines that make no sense, readers that leave.

use crate::support::{Bench, text};

const VERBS: [&str; 21] = [
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
    "completions",
    "man",
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
fn every_verb_has_a_page_of_the_manual_with_its_flags() {
    let bench = Bench::new();
    let listed = bench.good(&["man", "--list"]);
    let verbs: Vec<&str> = listed.lines().collect();
    for verb in VERBS.iter().chain(DRAWING) {
        assert!(verbs.contains(verb), "{verb}: {listed}");
    }
    let program = bench.good(&["man"]);
    for verb in verbs {
        let page = bench.good(&["man", verb]);
        let name = verb.replace('-', "\\-");
        let title = format!(".TH terrasoar-{verb} 1  \"terrasoar {}\"", env!("CARGO_PKG_VERSION"));
        assert!(page.contains(&title), "{page}");
        assert!(program.contains(&format!("terrasoar\\-{name}(1)")), "{verb}");
        // The names of its flags in its help stand in the page too.
        let help = bench.good(&[verb, "--help"]);
        // What a flag does is indented further, and what is said of the verb is not.
        let words = help
            .lines()
            .filter(|line| line.starts_with("  ") && !line.starts_with("       "))
            .filter_map(|line| {
                let flag = line.trim_start();
                let flag = flag
                    .strip_prefix("-")
                    .filter(|f| f.as_bytes().get(1) == Some(&b','))
                    .map_or(flag, |f| &f[3..]);
                flag.strip_prefix("--")?.split_whitespace().next()
            });
        for flag in words {
            assert!(page.contains(&format!("\\fB\\-\\-{}\\fR", flag.replace('-', "\\-"))), "{verb}: {flag}");
        }
    }
    assert!(bench.bad(2, &["man", "fly"]).contains("no verb \"fly\""));
}

#[test]
fn completions_know_verbs_and_flags_and_are_sound() {
    let bench = Bench::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = bench.good(&["completions", shell]);
        for word in ["compare-ground", "tolerance-px", "fill-voids"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    assert!(bench.bad(2, &["completions", "csh"]).contains("zsh"));
    // Bash itself completes a verb, a flag and a value.
    std::fs::write(bench.path("c.bash"), bench.good(&["completions", "bash"])).unwrap();
    let complete = |words: &str, at: usize| {
        let script = format!(
            "source c.bash; COMP_WORDS=({words}); COMP_CWORD={at}; _terrasoar terrasoar \"${{COMP_WORDS[{at}]}}\" \"${{COMP_WORDS[{at}-1]}}\"; echo \"${{COMPREPLY[@]}}\""
        );
        let run =
            std::process::Command::new("bash").args(["-c", &script]).current_dir(bench.folder()).output();
        run.ok().map(|output| text(&output.stdout).trim().to_owned())
    };
    let Some(verbs) = complete("terrasoar ver", 1) else { return };
    assert_eq!(verbs, "verify");
    assert_eq!(complete("terrasoar replay --tol", 2).unwrap(), "--tolerance-px");
    assert_eq!(complete("terrasoar replay --engine ki", 3).unwrap(), "kinetic");
}

#[test]
fn wrong_command_lines_end_with_2() {
    let bench = Bench::with_terrain();
    let wrong: [&[&str]; 62] = [
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
        &["mesh", "land.iqt", "--flight", "f", "--frame", "0", "-o", "x.ply", "--crs", "dem"],
        &["mesh", "land.iqt", "--flight", "f", "--frame", "0", "-o", "x.ply", "--window", "0,0,9,9"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--frame", "0"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--engine", "soar"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--tolerance-px", "2"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--metric", "sight"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--viewport", "80x60"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--exaggeration", "2"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.ply", "--culling", "clusters"],
        &["mesh", "land.iqt", "--engine", "soar", "-o", "x.ply"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.stl", "--ascii"],
        &["mesh", "land.iqt", "--max-error", "1", "-o", "x.obj", "--texture", "64"],
        &["height", "land.iqt", "--at", "1,1", "-o", "x.csv"],
        &["height", "land.iqt", "--at", "1,1", "--json", "-o", "x.csv"],
        &["synth", "--size", "129", "--seed", "1", "--texels", "2", "-o", "x.tif"],
        &["synth", "--colour", "land.iqt", "--texels", "2", "--spacing", "1", "-o", "x.tif"],
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
    let wrong: [&[&str]; 31] = [
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
        &["snapshot", "land.iqt", "-o", "a.png", "--flight", "f", "--frame", "1", "--look", "1,2"],
        &["snapshot", "land.iqt", "-o", "a.png", "--flight", "f", "--frame", "1", "--window", "0,0,9,9"],
        &["snapshot", "land.iqt", "-o", "a.png", "--flight", "f", "--frame", "1", "--world-file"],
        &["snapshot", "land.iqt", "-o", "a.png", "--flight", "f", "--frame", "1", "--crs", "dem"],
        &["snapshot", "land.iqt", "-o", "a.png", "--at", "1,2,3000", "--window", "0,0,9,9"],
        &["snapshot", "land.iqt", "-o", "a.png", "--at", "1,2,3000", "--world-file"],
        &["snapshot", "land.iqt", "-o", "a.png", "--at", "1,2,3000", "--frame", "1"],
        &["snapshot", "land.iqt", "-o", "a.png", "--window", "0,0,9,9", "--look", "1,2"],
        &["snapshot", "land.iqt", "-o", "a.png", "--window", "0,0,9,9", "--fov", "30"],
        &["snapshot", "land.iqt", "-o", "a.png", "--world-file", "--fov", "30"],
        &["snapshot", "land.iqt", "-o", "a.png", "--ortho", "--frame", "1"],
        &["snapshot", "land.iqt", "-o", "a.png", "--fov", "30", "--frame", "1"],
        &["snapshot", "land.iqt", "-o", "a.png", "--frame", "1"],
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
