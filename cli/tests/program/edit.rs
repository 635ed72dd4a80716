//! Edits by the real program: what it says and leaves, what it refuses, undoing, overlays.

use crate::support::{Bench, text};
use serde_json::json;
use terrasoar_layout::read::terrain::Terrain;

const HEAD: &str = "terrasoar-edits 1\nunits metres degrees\n";

pub fn with_script(lines: &str) -> Bench {
    let bench = Bench::with_terrain();
    write(&bench, "a.edits", lines);
    bench
}

pub fn write(bench: &Bench, name: &str, lines: &str) {
    std::fs::write(bench.path(name), format!("{HEAD}{lines}")).unwrap();
}

pub fn read(bench: &Bench, name: &str) -> Vec<u8> {
    std::fs::read(bench.path(name)).unwrap()
}

/// Heights in metres at all samples.
pub fn heights(terrain: &Terrain) -> Vec<f64> {
    let [dx, dy] = terrain.grid().spacing_m();
    let [wide, high] = terrain.grid().samples();
    let samples = (0..high).flat_map(|y| (0..wide).map(move |x| [f64::from(x) * dx, f64::from(y) * dy]));
    samples.map(|[x, y]| terrain.height_m(x, y).unwrap().unwrap_or(f64::NAN)).collect()
}

fn heights_of(bench: &Bench, name: &str) -> Vec<f64> {
    heights(&Terrain::open(&bench.path(name)).unwrap())
}

#[test]
fn a_script_is_applied_told_undone_and_done_again() {
    let bench = with_script(
        "batch a dam\nset rect 10,10,20,20 to 100\nraise at 900,900 radius 80 by 10\nend\n\
         crater at 2400,2400 radius 60 depth 5\n\nlower at 1290,1290 radius 5 by 1\nrestore rect 10,10,20,20\n",
    );
    let built = heights_of(&bench, "land.iqt");
    let told = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--json"]);
    for (field, value) in [
        ("file", json!("land.iqt")),
        ("overlay", json!(null)),
        ("dry_run", json!(false)),
        ("batches", json!(3)),
        ("edits", json!(5)),
        ("edits_outside", json!(1)),
        ("voids_passed", json!(0)),
        ("needs_widening", json!(false)),
    ] {
        assert_eq!(told[field], value, "{field}: {told}");
    }
    let edited = heights_of(&bench, "land.iqt");
    assert!(edited != built);
    assert!((told["bytes_appended"].as_u64().unwrap()) > 0 && told["pages_written"].as_u64().unwrap() > 0);
    assert!(told["records_changed"].as_u64() > Some(200) && told["samples"].as_u64() > Some(121));
    bench.good(&["verify", "land.iqt"]);

    let past = bench.json(&["history", "land.iqt", "--json"]);
    assert_eq!(past["commit"], 3);
    assert_eq!(past["commits"][0], json!({ "commit": 1, "edits": 2, "label": "a dam", "undone": false }));
    assert_eq!(past["commits"][2]["label"], "2 edits");
    let info = bench.json(&["info", "land.iqt", "--json"]);
    assert_eq!((&info["commits"], &info["commit"]), (&json!(3), &json!(3)));

    let said = bench.good(&["undo", "land.iqt"]);
    assert!(said.contains("undone: 2 edits") && said.contains("as after commit 2"), "{said}");
    assert_eq!(bench.good(&["height", "land.iqt", "--at", "300,300"]), "100 m\n");
    let undone = bench.json(&["undo", "land.iqt", "99", "--json"]);
    assert_eq!(undone["labels"], json!(["crater", "a dam"]));
    assert!(heights_of(&bench, "land.iqt") == built);
    let said = bench.good(&["history", "land.iqt"]);
    assert!(said.matches("undone").count() == 4 && said.contains("as it was built"), "{said}");
    assert!(bench.bad(1, &["undo", "land.iqt"]).contains("nothing to undo"));
    let again = bench.json(&["redo", "land.iqt", "3", "--json"]);
    assert_eq!(again["labels"], json!(["a dam", "crater", "2 edits"]));
    assert!(heights_of(&bench, "land.iqt") == edited);
    assert!(bench.bad(1, &["redo", "land.iqt"]).contains("nothing to redo"));

    // Compacted: smaller, the same ground, no past.
    let before = bench.json(&["info", "land.iqt", "--json"]);
    let said = bench.good(&["compact", "land.iqt", "-o", "small.iqt"]);
    assert!(said.contains("bytes instead of"), "{said}");
    assert!(heights_of(&bench, "small.iqt") == edited);
    bench.good(&["compact", "land.iqt"]);
    assert!(read(&bench, "land.iqt") == read(&bench, "small.iqt"));
    let after = bench.json(&["info", "land.iqt", "--json"]);
    assert!(after["file_bytes"].as_u64() < before["file_bytes"].as_u64());
    assert_eq!((&after["unused_bytes"], &after["commits"]), (&json!(0), &json!(0)));
    assert!(bench.good(&["history", "land.iqt"]).contains("no edits"));
    bench.good(&["verify", "land.iqt"]);
    assert_eq!(bench.names(), ["a.edits", "land.iqt", "land.tif", "small.iqt"]);
}

#[test]
fn a_dry_run_changes_nothing_and_says_the_same() {
    let bench = with_script(
        "raise at 900,900 radius 200 by 10\n\nsmooth at 900,900 radius 300\n\nrestore disc 900,900 radius 100\n",
    );
    let before = read(&bench, "land.iqt");
    let tried = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--dry-run", "--json"]);
    assert!(read(&bench, "land.iqt") == before);
    assert!(
        bench.good(&["edit", "land.iqt", "--script", "a.edits", "--dry-run"]).contains("nothing was written")
    );
    // Over an overlay that does not exist it is not made.
    bench.good(&["edit", "land.iqt", "--script", "a.edits", "--dry-run", "--overlay", "o.iqo"]);
    assert_eq!(bench.names(), ["a.edits", "land.iqt", "land.tif"]);
    let done = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--json"]);
    for field in ["batches", "edits", "samples", "records_changed", "voids_passed"] {
        assert_eq!(tried[field], done[field], "{field}");
    }
    // And over edits: what is restored is what was built.
    let tried = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--dry-run", "--json"]);
    let done = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--json"]);
    assert_eq!(tried["records_changed"], done["records_changed"]);
}

#[test]
fn an_overlay_keeps_edits_apart() {
    let bench = with_script("set rect 10,10,20,20 to 100\n\nset rect 30,30,40,40 to 90\n");
    let before = read(&bench, "land.iqt");
    let said = bench.good(&["edit", "land.iqt", "--script", "a.edits", "--overlay", "o.iqo"]);
    assert!(said.starts_with("o.iqo: 2 edits in 2 batches"), "{said}");
    assert!(read(&bench, "land.iqt") == before);
    let at = ["height", "land.iqt", "--at", "300,300"];
    let over = [&at[..], &["--overlay", "o.iqo"]].concat();
    assert_eq!(bench.good(&over), "100 m\n");
    assert_ne!(bench.good(&at), "100 m\n");
    for verb in [&["verify"][..], &["info"], &["history"]] {
        bench.good(&[verb, &["land.iqt", "--overlay", "o.iqo"]].concat());
    }
    let info = bench.json(&["info", "land.iqt", "--overlay", "o.iqo", "--json"]);
    assert_eq!(
        (&info["path"], &info["overlay"], &info["commit"]),
        (&json!("land.iqt"), &json!("o.iqo"), &json!(2))
    );
    assert_eq!(bench.json(&["info", "land.iqt", "--json"])["commits"], 0);

    // Verbs that fly see it too.
    let flight = ["flight", "straight", "land.iqt", "-o", "f", "--frames", "5", "--speed", "50"];
    bench.good(&flight);
    let hash = |overlay: &[&str]| {
        let args = [&["replay", "land.iqt", "--flight", "f", "--tolerance-px", "0.5", "--json"][..], overlay]
            .concat();
        bench.json(&args)["mesh_hash"].clone()
    };
    assert_ne!(hash(&[]), hash(&["--overlay", "o.iqo"]));
    bench.good(&["mesh", "land.iqt", "--overlay", "o.iqo", "--flight", "f", "--frame", "1", "-o", "m.ply"]);
    bench.good(&[
        "compare",
        "land.iqt",
        "--overlay",
        "o.iqo",
        "--flight",
        "f",
        "--no-sweeps",
        "-o",
        "report",
    ]);

    bench.good(&["undo", "land.iqt", "2", "--overlay", "o.iqo"]);
    assert_eq!(bench.good(&over), bench.good(&at));
    bench.good(&["redo", "land.iqt", "--overlay", "o.iqo"]);
    assert_eq!(bench.good(&over), "100 m\n");
    assert!(bench.bad(2, &["compact", "land.iqt", "--overlay", "o.iqo"]).contains("-o"));
    bench.good(&["compact", "land.iqt", "--overlay", "o.iqo", "-o", "both.iqt"]);
    assert_eq!(bench.good(&["height", "both.iqt", "--at", "300,300"]), "100 m\n");
    bench.good(&["verify", "both.iqt"]);

    // Another terrain is not what it belongs to.
    bench.good(&["synth", "--size", "65", "--seed", "3", "-o", "hills.tif"]);
    bench.good(&["build", "hills.tif", "-o", "hills.iqt"]);
    let message = bench.bad(1, &["height", "hills.iqt", "--at", "1,1", "--overlay", "o.iqo"]);
    assert!(
        message.contains("o.iqo") && message.contains("another terrain, which was called land.iqt"),
        "{message}"
    );
    assert!(bench.bad(1, &["undo", "land.iqt", "--overlay", "none.iqo"]).contains("no such overlay"));
    assert!(bench.bad(1, &["verify", "land.iqt", "--overlay", "land.tif"]).contains("no overlay"));
    assert!(!bench.path("none.iqo").exists());
}

#[test]
fn refusals_change_nothing_and_say_what_to_do() {
    let bench = with_script("set rect 10,10,20,20 to 100\n\nstamp none.tif sample 1,1\n");
    write(&bench, "wrong.edits", "set rect 10,10,20,20 to 100\n\ncrater at 1,2 radius 3\n");
    write(&bench, "large.edits", "set rect 10,10,20,20 to 100\n\nstamp land.tif sample 9999999,0\n");
    let before = read(&bench, "land.iqt");
    for (args, code, words) in [
        (&["edit", "land.iqt", "--script", "a.edits"][..], 1, "a.edits:5: stamp: "),
        (
            &["edit", "land.iqt", "--script", "wrong.edits"],
            1,
            "wrong.edits:5: `depth` is missing; write `crater at X,Y",
        ),
        (&["edit", "land.iqt", "--script", "large.edits"], 1, "batch 2 (stamp): stamp: the column"),
        (&["edit", "land.iqt", "--script", "land.tif"], 1, "not a script of edits"),
        (&["edit", "land.iqt", "--script", "missing.edits"], 1, "cannot read script missing.edits"),
        (&["edit", "land.tif", "--script", "a.edits"], 1, "none.tif"),
        (&["crater", "land.tif", "--at", "1,1", "--radius", "50", "--depth", "5"], 1, "not a terrain file"),
        (&["crater", "missing.iqt", "--at", "1,1", "--radius", "50", "--depth", "5"], 1, "missing.iqt"),
        (&["crater", "land.iqt", "--at", "9e5,1", "--radius", "50", "--depth", "5"], 1, "2560,2560"),
        (
            &["crater", "land.iqt", "--at", "10,10", "--radius", "0.5", "--depth", "5"],
            1,
            "no sample lies within 1 metres",
        ),
        (&["crater", "land.iqt", "--at", "1,1", "--radius", "1e9", "--depth", "5"], 1, "crater: the radius"),
        (
            &["crater", "land.iqt", "--rain", "9", "--seed", "1", "-o", "land.iqt"],
            1,
            "the output is the input",
        ),
        (&["undo", "land.iqt"], 1, "nothing to undo"),
        (&["redo", "land.iqt"], 1, "nothing to redo"),
        (&["undo", "land.tif"], 1, "not a terrain file"),
        (&["compact", "land.iqt", "-o", "land.iqt"], 1, "the output is the input"),
        (&["compact", "land.tif"], 1, "not a terrain file"),
        (&["history", "land.tif"], 1, "not a terrain file"),
    ] {
        let message = bench.bad(code, args);
        assert!(message.contains(words), "{args:?}: {message}\nshould say: {words}");
    }
    assert!(read(&bench, "land.iqt") == before);
    assert_eq!(bench.names(), ["a.edits", "land.iqt", "land.tif", "large.edits", "wrong.edits"]);
}

#[test]
fn command_lines_that_make_no_sense_end_with_2() {
    let bench = Bench::with_terrain();
    let wrong: [&[&str]; 17] = [
        &["edit", "land.iqt"],
        &["edit", "--script", "a.edits"],
        &["crater", "land.iqt"],
        &["crater", "land.iqt", "--at", "1,1"],
        &["crater", "land.iqt", "--at", "1,1", "--radius", "5"],
        &["crater", "land.iqt", "--at", "1,1", "--radius", "5", "--depth", "0"],
        &["crater", "land.iqt", "--at", "1,1", "--radius", "-5", "--depth", "1"],
        &["crater", "land.iqt", "--at", "1,1", "--radius", "5,6", "--depth", "1"],
        &["crater", "land.iqt", "--at", "1", "--radius", "5", "--depth", "1"],
        &["crater", "land.iqt", "--at", "1,1", "--radius", "5", "--depth", "1", "--seed", "1"],
        &["crater", "land.iqt", "--rain", "5"],
        &["crater", "land.iqt", "--rain", "0", "--seed", "1"],
        &["crater", "land.iqt", "--rain", "5", "--seed", "1", "--radius", "6,5"],
        &["crater", "land.iqt", "--rain", "5", "--seed", "1", "--at", "1,1"],
        &["crater", "land.iqt", "--rain", "5", "--seed", "1", "-o", "x.edits", "--dry-run"],
        &["undo", "land.iqt", "0"],
        &["undo", "land.iqt", "x"],
    ];
    for args in wrong {
        bench.bad(2, args);
    }
    assert_eq!(bench.names(), ["land.iqt", "land.tif"]);
}

#[test]
fn craters_are_blasted_and_rain() {
    let bench = Bench::with_terrain();
    let at = ["height", "land.iqt", "--at", "1500,1500"];
    // Ground that is deep enough.
    write(&bench, "flat.edits", "set rect 0,0,128,128 to 80\n");
    bench.good(&["edit", "land.iqt", "--script", "flat.edits"]);
    bench.good(&[
        "crater",
        "land.iqt",
        "--at",
        "1500,1500",
        "--radius",
        "100",
        "--depth",
        "12",
        "--direction",
        "90",
    ]);
    assert_eq!(bench.good(&at), "68 m\n");
    let height = |place: &str| {
        bench.json(&["height", "land.iqt", "--at", place, "--json"])["height_m"].as_f64().unwrap()
    };
    assert!(height("1640,1500") > height("1500,1640") && height("1500,1640") > height("1360,1500"));
    assert!(height("1360,1500") > 80.0);

    // A rain written and applied is the rain applied.
    let rain = ["crater", "land.iqt", "--rain", "30", "--seed", "4"];
    let said = bench.good(&[&rain[..], &["--batch", "20", "-o", "rain.edits"]].concat());
    assert_eq!(said, "rain.edits: 30 craters in 2 batches\n");
    std::fs::copy(bench.path("land.iqt"), bench.path("b.iqt")).unwrap();
    bench.good(&["edit", "b.iqt", "--script", "rain.edits"]);
    let told = bench.json(&[&rain[..], &["--json"]].concat());
    assert_eq!((&told["batches"], &told["edits"]), (&json!(1), &json!(30)));
    assert!(heights_of(&bench, "b.iqt") == heights_of(&bench, "land.iqt"));
    assert_eq!(bench.json(&["history", "b.iqt", "--json"])["commit"], 4);
    assert_eq!(bench.json(&["history", "land.iqt", "--json"])["commits"][2]["label"], "30 x crater");
    let piped = bench.run(&[&rain[..], &["-o", "/dev/stdout"]].concat());
    let lines = text(&piped.stdout);
    assert!(lines.starts_with(HEAD) && lines.matches("crater at").count() == 30, "{lines}");
    assert!(text(&piped.stderr).contains("30 craters in 1 batch"));
    bench.good(&["verify", "land.iqt"]);
}

#[test]
fn a_stamp_comes_from_the_scripts_folder() {
    let bench = Bench::with_terrain();
    bench.good(&["synth", "--size", "17", "--seed", "9", "-o", "small.tif"]);
    std::fs::create_dir(bench.path("scripts")).unwrap();
    write(&bench, "scripts/a.edits", "stamp ../small.tif sample 30,40 mode set\n");
    bench.good(&["edit", "land.iqt", "--script", "scripts/a.edits"]);
    bench.good(&["build", "small.tif", "-o", "small.iqt"]);
    let [land, small] = ["land.iqt", "small.iqt"].map(|name| Terrain::open(&bench.path(name)).unwrap());
    for (x, y) in (0..17).flat_map(|x| (0..17).map(move |y| (x, y))) {
        let height = |terrain: &Terrain, x: u32, y: u32| {
            terrain.height_m(f64::from(x) * 20.0, f64::from(y) * 20.0).unwrap().unwrap()
        };
        assert!((height(&land, x + 30, y + 40) - height(&small, x, y)).abs() < 0.06);
    }
}

#[test]
fn heights_beyond_the_files_range_make_it_rewrite_itself_aloud() {
    let bench = with_script(
        "set rect 60,60,61,61 to 50\n\nset rect 5,5,9,9 to 3000\n\nset rect 20,20,22,22 to -500\n",
    );
    bench.good(&["crater", "land.iqt", "--at", "300,2300", "--radius", "50", "--depth", "0.5"]);
    let before = heights_of(&bench, "land.iqt");
    let tried = bench.run(&["edit", "land.iqt", "--script", "a.edits", "--dry-run", "--json"]);
    assert!(text(&tried.stdout).contains("\"needs_widening\": true") && tried.status.success());
    assert!(text(&tried.stderr).contains("batch 2 (set)"), "{}", text(&tried.stderr));
    assert!(heights_of(&bench, "land.iqt") == before);
    // An overlay cannot be widened; nothing is left of it.
    let message = bench.bad(1, &["edit", "land.iqt", "--script", "a.edits", "--overlay", "o.iqo"]);
    assert!(
        message.contains("from -500 to 3000 m") && message.contains("terrasoar compact land.iqt -o NEW.iqt"),
        "{message}"
    );
    assert!(!bench.path("o.iqo").exists());

    let output = bench.run(&["edit", "land.iqt", "--script", "a.edits", "--json"]);
    let said = text(&output.stderr);
    assert!(
        output.status.success()
            && said.contains("rewriting it with room")
            && said.contains("no longer be undone"),
        "{said}"
    );
    assert_eq!(said.matches("rewriting").count(), 1, "once for the whole script: {said}");
    assert!(text(&output.stdout).contains("\"widenings\": 1"));
    let mut wanted = before;
    for (square, height) in [((60, 61), 50.0), ((5, 9), 3000.0), ((20, 22), -500.0)] {
        for (x, y) in (square.0..=square.1).flat_map(|x| (square.0..=square.1).map(move |y| (x, y))) {
            wanted[y * 129 + x] = height;
        }
    }
    let step = Terrain::open(&bench.path("land.iqt")).unwrap().header().scale.height_step_m;
    let found = heights_of(&bench, "land.iqt");
    assert!(found.iter().zip(&wanted).all(|(a, b)| (a - b).abs() <= step));
    bench.good(&["verify", "land.iqt"]);
    // All batches of the script can be undone, for the file was rewritten before the first.
    assert_eq!(bench.json(&["undo", "land.iqt", "9", "--json"])["batches"], 3);
    assert_eq!(bench.names(), ["a.edits", "land.iqt", "land.tif"]);
}

/// A rewritten file no longer knows the ground of before its edits, so a script that restores some of it is not begun there.
#[test]
fn nothing_is_restored_to_ground_that_a_rewriting_would_lose() {
    let bench = with_script("restore rect 5,5,9,9\n\nset rect 20,20,22,22 to 3000\n");
    let built = heights_of(&bench, "land.iqt");
    bench.good(&["crater", "land.iqt", "--at", "140,140", "--radius", "90", "--depth", "9"]);
    let dug = heights_of(&bench, "land.iqt");
    let message = bench.bad(1, &["edit", "land.iqt", "--script", "a.edits"]);
    assert!(message.contains("restore first") && message.contains("--force"), "{message}");
    assert!(heights_of(&bench, "land.iqt") == dug);
    // Without an edit before there is nothing to lose, and both are done.
    bench.good(&["undo", "land.iqt"]);
    bench.good(&["compact", "land.iqt"]);
    bench.good(&["edit", "land.iqt", "--script", "a.edits"]);
    let step = Terrain::open(&bench.path("land.iqt")).unwrap().header().scale.height_step_m;
    let found = heights_of(&bench, "land.iqt");
    let is_set = |at: usize| (20..=22).contains(&(at % 129)) && (20..=22).contains(&(at / 129));
    let wanted = |at: usize| if is_set(at) { 3000.0 } else { built[at] };
    assert!((0..found.len()).all(|at| (found[at] - wanted(at)).abs() <= step));
}

/// Craters scorch the picture over the ground, in the same commit; undoing brings both back.
#[test]
fn craters_scorch_the_picture() {
    use terrasoar_layout::imagery::Imagery;
    let bench = with_script("crater at 1200,1200 radius 60 depth 5\n");
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "4", "--seed", "2", "-o", "photo.tif"]);
    bench.good(&["drape", "land.iqt", "--image", "photo.tif"]);
    let tiles = || {
        let terrain = Terrain::open(&bench.path("land.iqt")).unwrap();
        let imagery = Imagery::open(&terrain).unwrap().unwrap();
        let tile = |id| {
            let mut bytes = Vec::new();
            imagery.read_tile(&terrain, id, &mut bytes).unwrap();
            bytes
        };
        imagery.shape().ids().map(tile).collect::<Vec<_>>()
    };
    let (ground, picture) = (heights_of(&bench, "land.iqt"), tiles());
    let told = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--no-scorch", "--json"]);
    assert_eq!(told["tiles_painted"], 0);
    assert!(tiles() == picture && heights_of(&bench, "land.iqt") != ground);
    bench.good(&["undo", "land.iqt"]);
    let told = bench.json(&["edit", "land.iqt", "--script", "a.edits", "--json"]);
    assert!(told["tiles_painted"].as_u64() > Some(1), "{told}");
    assert!(tiles() != picture && heights_of(&bench, "land.iqt") != ground);
    bench.good(&["verify", "land.iqt"]);
    write(&bench, "back.edits", "restore disc 1200,1200 radius 200\n");
    bench.good(&["edit", "land.iqt", "--script", "back.edits"]);
    // A file that was rewritten with room counts its heights from elsewhere.
    let is_ground = || {
        let now = heights_of(&bench, "land.iqt");
        now.iter().zip(&ground).all(|(now, then)| (now - then).abs() < 1e-9)
    };
    assert!(is_ground());
    let differing: Vec<usize> = (0..picture.len()).filter(|i| tiles()[*i] != picture[*i]).collect();
    assert!(differing.is_empty(), "{differing:?} of {}", picture.len());
    bench.good(&["undo", "land.iqt", "2"]);
    assert!(tiles() == picture && is_ground());
    bench.good(&["verify", "land.iqt"]);
}
