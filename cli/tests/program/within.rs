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
    assert!(notes.contains("\n# terrain-extent-m: 2560 2560\n# terrain-heights: "), "{notes}");
    // Another terrain of the same size, and this one with edits.
    bench.good(&["synth", "--size", "129", "--seed", "2", "-o", "other.tif"]);
    bench.good(&["build", "other.tif", "-o", "other.iqt"]);
    let said = text(&bench.run(&["replay", "other.iqt", "--flight", "land.flight"]).stderr);
    assert!(
        said.contains("over another terrain (land.iqt), of the same size but with other heights"),
        "{said}"
    );
    write(&bench, "e.edits", "set rect 1,1,5,5 to 90\n");
    bench.good(&["edit", "land.iqt", "--script", "e.edits"]);
    assert!(replay("land.flight").stderr.is_empty(), "edits make no other terrain");
    // Nothing of the terrain is ever in view.
    fly(&bench, "far.flight", "", &[[1e6, 2e6, 500.0], [1e6, 2.1e6, 500.0]]);
    for verb in [
        &["replay", "land.iqt", "--flight", "far.flight"][..],
        &["compare", "land.iqt", "--flight", "far.flight", "--no-sweeps", "-o", "r"],
        &["mesh", "land.iqt", "--flight", "far.flight", "--frame", "0", "-o", "a.ply"],
        &["iobench", "land.iqt", "--flight", "far.flight"],
        #[cfg(feature = "view")]
        &["view", "land.iqt", "--flight", "far.flight"],
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

#[test]
fn a_build_counts_voids_and_fills_small_ones() {
    let bench = Bench::new();
    // Two holes, of one sample and of 3 x 2, and a strip along the border.
    let grid = "ncols 8\nnrows 6\nxllcorner 500000\nyllcorner 4000000\ncellsize 30\nNODATA_value -9999\n\
        10 10 10 10 10 10 10 -9999\n10 -9999 10 10 10 10 10 -9999\n10 10 10 10 10 10 10 -9999\n\
        10 10 20 20 20 10 10 -9999\n10 20 -9999 -9999 -9999 20 10 -9999\n10 20 20 20 20 10 10 -9999\n";
    std::fs::write(bench.path("g.asc"), grid).unwrap();
    let build = |out: &str, more: &[&str]| bench.good(&[&["build", "g.asc", "-o", out][..], more].concat());
    let told = build("plain.iqt", &[]);
    assert!(told.contains("10 voids (20.833 %)"), "{told}");
    assert_eq!(bench.json(&["info", "plain.iqt", "--json"])["nodata_samples"], 10);
    let told = build("one.iqt", &["--fill-voids", "1"]);
    assert!(
        told.contains("9 voids") && told.contains("1 of 10 void samples were filled, 1 holes of up to 1 x 1"),
        "{told}"
    );
    let told = build("three.iqt", &["--fill-voids", "3"]);
    assert!(told.contains("6 voids") && told.contains("4 of 10 void samples were filled, 2 holes"), "{told}");
    assert!(bench.good(&["info", "three.iqt"]).contains("voids: 4 of 10 void samples"));
    for (at, height) in [("30,120", "10 m"), ("60,30", "20 m"), ("90,30", "20 m"), ("210,30", "no data")] {
        assert_eq!(bench.good(&["height", "three.iqt", "--at", at]).trim(), height, "{at}");
    }
    assert_eq!(bench.good(&["height", "plain.iqt", "--at", "30,120"]).trim(), "no data");
    build("all.iqt", &["--fill-voids", "6"]);
    assert_eq!(bench.json(&["info", "all.iqt", "--json"])["nodata_samples"], 0);
    bench.bad(2, &["build", "g.asc", "-o", "x.iqt", "--fill-voids", "257"]);
}

#[test]
fn info_says_what_the_numbers_mean() {
    let bench = Bench::new();
    let grid = |values: &str| {
        format!("ncols 3\nnrows 2\nxllcorner 500000\nyllcorner 4000000\ncellsize 30\n{values}\n")
    };
    std::fs::write(bench.path("g.asc"), grid("1 2 3\n4 5 6")).unwrap();
    std::fs::write(bench.path("f.asc"), grid("1.12345 2.7182818 3.1415\n4.9 5.5 6.66667")).unwrap();
    for name in ["g", "f"] {
        bench.good(&["build", &format!("{name}.asc"), "-o", &format!("{name}.iqt")]);
    }
    let told = bench.good(&["info", "g.iqt"]);
    // Corners of cells in the file, samples in the middle of them.
    assert!(told.contains("500015,4000015 to 500075,4000045 (x,y of the outermost samples)"), "{told}");
    assert!(told.contains("x = 500015 + 30 * column, y = 4000015 + 30 * row"), "{told}");
    assert!(told.contains("height step       1 m"), "{told}");
    let floats = bench.good(&["info", "f.iqt"]);
    assert!(floats.contains("none, heights are kept as the data has them, in"), "{floats}");
    assert!(bench.json(&["info", "f.iqt", "--json"])["height_step_m"].is_null());

    let bench = with_script("set rect 10,10,20,20 to 60\n");
    bench.good(&["edit", "land.iqt", "--script", "a.edits"]);
    bench.good(&["undo", "land.iqt"]);
    let info = bench.json(&["info", "land.iqt", "--json"]);
    assert!(info["unused_bytes"] == 0 && info["history_bytes"].as_u64() > Some(4096), "{info}");
    let told = bench.good(&["info", "land.iqt"]);
    assert!(told.contains("bytes for undo and redo") && !told.contains("unused"), "{told}");
}

#[test]
fn a_flight_says_for_which_pictures_its_speed_was_found() {
    let bench = Bench::with_terrain();
    let find = ["flight", "straight", "land.iqt", "-o", "s.flight", "--frames", "12", "--incoherence", "2"];
    bench.good(&[&find[..], &["--tolerance-px", "0.5", "--viewport", "640x480"]].concat());
    let notes = std::fs::read_to_string(bench.path("s.flight")).unwrap();
    for note in [
        "solved-tolerance-px: 0.5",
        "solved-metric: ball",
        "solved-viewport: 640x480",
        "solved-exaggeration: 1",
        "solved-culling: vertices",
    ] {
        assert!(notes.contains(&format!("# {note}\n")), "{notes}");
    }
    let replay = |more: &[&str]| {
        let args = [&["replay", "land.iqt", "--flight", "s.flight"][..], more].concat();
        text(&bench.run(&args).stderr)
    };
    assert_eq!(replay(&["--tolerance-px", "0.5", "--viewport", "640x480"]), "");
    let said = replay(&["--viewport", "640x480"]);
    assert!(
        said.contains("found at a tolerance of 0.5 px, here it is 1 px: the incoherence is not "),
        "{said}"
    );
    let clusters = ["--tolerance-px", "0.5", "--viewport", "640x480", "--culling", "clusters"];
    assert!(replay(&clusters).contains("at culling by vertices, here it is by clusters: the incoherence"));
    assert!(replay(&["--tolerance-px", "0.5"]).contains("a picture of 640x480, here it is 800x600"));
}

#[test]
fn a_report_says_how_it_was_made_and_what_does_not_apply() {
    let bench = Bench::with_flight();
    let compare = [
        "compare",
        "land.iqt",
        "--flight",
        "land.flight",
        "--no-sweeps",
        "-o",
        "r",
        "--engines",
        "soar,kinetic",
    ];
    bench.good(&compare);
    let summary = std::fs::read_to_string(bench.path("r/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let made = &summary["made"];
    assert_eq!(made["program"], concat!("terrasoar ", env!("CARGO_PKG_VERSION")));
    assert!(made["command"].as_str().unwrap().ends_with(&compare.join(" ")), "{made}");
    assert!(made["machine"].as_str().unwrap().contains(std::env::consts::ARCH), "{made}");
    assert_eq!(made["date"].as_str().map(str::len), Some(20));
    let engines = summary["comparison"]["engines"].as_array().unwrap();
    for field in ["expired_total", "slots_written_total", "patch_bytes_total", "scan_us_p50", "apply_us_p50"]
    {
        assert!(engines[0][field].is_null() && engines[1][field].is_number(), "{field}");
    }
    for (engine, figures) in ["soar", "kinetic"].into_iter().zip(engines) {
        let (_, table) = bench.table(&format!("r/frames-{engine}.csv"));
        let mut rows = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let names = rows.next().unwrap();
        let rows: Vec<_> = rows.collect();
        for column in ["vertex_tests", "splits", "merges", "pages_touched", "expired", "patch_bytes", "late"]
        {
            let at = names.iter().position(|name| *name == column).unwrap();
            let known: Vec<u64> = rows.iter().filter_map(|row| row[at].parse().ok()).collect();
            match figures[format!("{column}_total")].as_u64() {
                Some(total) => assert_eq!((known.len(), known.iter().sum()), (rows.len(), total), "{column}"),
                None => assert!(known.is_empty() && rows.iter().all(|row| row[at].is_empty()), "{column}"),
            }
        }
    }
}
