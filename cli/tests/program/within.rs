//! What lies outside the terrain or below its ground, by the real program: what is refused, what is said, and with which extent.

use crate::edit::{heights, read, with_script, write};
use crate::support::{Bench, text};
use terrasoar_layout::read::terrain::Terrain;

const EXTENT: &str = "which extends from 0,0 to 2560,2560 metres";

/// A flight of level frames whose eyes are at these places, looking north.
fn fly(bench: &Bench, name: &str, notes: &str, eyes: &[[f64; 3]]) {
    let mut lines = format!("terrasoar-flight 1\nunits metres degrees seconds\n{notes}");
    for (i, [east, north, up]) in eyes.iter().enumerate() {
        lines.push_str(&format!("{i} {east} {north} {up} 0 0 0 45\n"));
    }
    std::fs::write(bench.path(name), lines).unwrap();
}

#[test]
fn an_edit_outside_is_refused_and_one_partly_outside_is_said() {
    let bench =
        with_script("set rect 5,5,9,9 to 70\n\nbatch far away\nraise at 9000,100 radius 50 by 3\nend\n");
    let before = read(&bench, "land.iqt");
    let edit = ["edit", "land.iqt", "--script", "a.edits"];
    for more in [&["--dry-run"][..], &[], &["--overlay", "o.iqo"]] {
        let said = bench.bad(1, &[&edit[..], more].concat());
        assert!(said.contains("a.edits: batch 2 (far away), raise: it covers 8950,50 to 9050,150"), "{said}");
        assert!(said.contains(EXTENT) && said.contains("wholly outside"), "{said}");
    }
    assert!(read(&bench, "land.iqt") == before, "the batch before it was not applied");
    let replay = ["replay", "land.iqt", "--flight", "f.flight", "--edits", "a.edits"];
    fly(&bench, "f.flight", "", &[[1280.0, 1280.0, 3000.0]]);
    assert!(bench.bad(1, &replay).contains(EXTENT));

    // Every kind of edit, a metre beyond each border and a metre within it.
    let outside = [
        "crater at -101,500 radius 50 depth 3",
        "smooth at 500,2661 radius 100",
        "restore disc 2661,500 radius 100",
        "set rect 129,0,140,9 to 3",
        "stamp land.tif sample 0,-130",
    ];
    for line in outside {
        write(&bench, "a.edits", line);
        assert!(bench.bad(1, &edit).contains(EXTENT), "{line}");
    }
    let partly = [
        "crater at -99,500 radius 50 depth 3",
        "smooth at 500,2659 radius 100",
        "restore disc 2659,500 radius 100",
        "set rect 128,0,140,9 to 60",
        "stamp land.tif sample 0,-128",
    ];
    write(&bench, "a.edits", &partly.join("\n"));
    let output = bench.run(&[&edit[..], &["--dry-run"]].concat());
    let said = text(&output.stderr);
    assert!(output.status.success() && said.starts_with("warning: a.edits: 5 edits reach beyond"), "{said}");
    assert!(said.contains("The first: batch 1 (5 edits), crater covers -199,400 to 1,600"), "{said}");

    write(&bench, "a.edits", "set rect 0,0,128,128 to 60\n");
    assert!(bench.run(&edit).stderr.is_empty(), "the whole terrain is within it");
    let crater = bench.run(&["crater", "land.iqt", "--at", "0,500", "--radius", "30", "--depth", "2"]);
    assert!(text(&crater.stderr).contains("the crater covers -60,440 to 60,560, beyond the terrain"));
    let rain = bench.run(&["crater", "land.iqt", "--rain", "50", "--seed", "1", "--dry-run"]);
    assert!(rain.status.success() && rain.stderr.is_empty(), "{}", text(&rain.stderr));
}

#[test]
fn rectangles_of_the_second_version_are_metres() {
    let bench = Bench::with_terrain();
    let script = |version: u32, line: &str| {
        let text = format!("terrasoar-edits {version}\nunits metres degrees\n{line}\n");
        std::fs::write(bench.path("a.edits"), text).unwrap();
        std::fs::copy(bench.path("land.iqt"), bench.path("copy.iqt")).unwrap();
        bench.good(&["edit", "copy.iqt", "--script", "a.edits"]);
        heights(&Terrain::open(&bench.path("copy.iqt")).unwrap())
    };
    // 20 m from sample to sample.
    let samples = script(1, "set rect 10,20,30,40 to 60");
    assert!(script(2, "set samples 10,20,30,40 to 60") == samples);
    assert!(script(2, "set rect 200,400,600,800 to 60") == samples);
    assert!(script(2, "set rect 181,390,619.5,800.0001 to 60") == samples);
    for (i, height) in samples.iter().enumerate() {
        let (x, y) = (i % 129, i / 129);
        let is_in = (10..=30).contains(&x) && (20..=40).contains(&y);
        assert!(!is_in || (height - 60.0).abs() < 1e-6, "{x},{y}: {height}");
    }
}

#[test]
fn a_flight_of_another_terrain_is_said() {
    let bench = Bench::with_flight();
    let replay = |name: &str| bench.run(&["replay", "land.iqt", "--flight", name]);
    assert!(replay("land.flight").stderr.is_empty(), "its own flight is nothing to speak of");
    let notes = std::fs::read_to_string(bench.path("land.flight")).unwrap();
    assert!(notes.contains("\n# terrain-extent-m: 2560 2560\n"), "{notes}");
    // Nothing of the terrain is ever in view.
    fly(&bench, "far.flight", "", &[[1e6, 2e6, 500.0], [1e6, 2.1e6, 500.0]]);
    for verb in [
        &["replay", "land.iqt", "--flight", "far.flight"][..],
        &["compare", "land.iqt", "--flight", "far.flight", "--no-sweeps", "-o", "r"],
        &["mesh", "land.iqt", "--flight", "far.flight", "--frame", "0", "-o", "a.ply"],
    ] {
        let said = bench.bad(1, verb);
        assert!(
            said.contains("far.flight: the flight lies wholly outside") && said.contains(EXTENT),
            "{said}"
        );
    }
    // From outside, looking at it, is no mistake, but said.
    fly(
        &bench,
        "near.flight",
        "",
        &[[1280.0, -500.0, 900.0], [1280.0, -400.0, 900.0], [1280.0, 10.0, 900.0]],
    );
    let output = replay("near.flight");
    let said = text(&output.stderr);
    assert!(output.status.success() && said.contains("outside the terrain, which extends"), "{said}");
    assert!(said.contains("in 2 of 3 frames"), "{said}");
    fly(
        &bench,
        "other.flight",
        "# terrain: alps.iqt\n# terrain-extent-m: 90000 70000.5\n",
        &[[900.0, 900.0, 2e3]],
    );
    let said = text(&replay("other.flight").stderr);
    assert!(said.contains("made over another terrain (alps.iqt), of 90000 x 70000.5 metres"), "{said}");
}

#[test]
fn an_eye_below_the_ground_is_said() {
    let bench = Bench::with_terrain();
    let ground = heights(&Terrain::open(&bench.path("land.iqt")).unwrap())[64 * 129 + 64];
    let at = |up: f64| [1280.0, 1280.0, up];
    fly(&bench, "low.flight", "", &[at(ground + 1.0), at(ground - 1.0), at(ground - 7.26), at(ground + 9.0)]);
    let replay = ["replay", "land.iqt", "--flight", "low.flight"];
    let said = text(&bench.run(&replay).stderr);
    assert!(said.contains("below the ground in 2 of 4 frames, first in frame 1, by up to 7.3 m"), "{said}");
    // Twice as high, the ground is above one more of them.
    let said = text(&bench.run(&[&replay[..], &["--exaggeration", "2"]].concat()).stderr);
    assert!(said.contains("in 3 of 4 frames, first in frame 0"), "{said}");
}
