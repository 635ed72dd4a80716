//! The verbs that look at one file: info, verify, height, synth.

use crate::support::{Bench, fields};

#[test]
fn info_has_the_fields_that_programs_read() {
    let bench = Bench::with_terrain();
    let info = bench.json(&["info", "land.iqt", "--json"]);
    for field in [
        "samples",
        "k",
        "spacing_m",
        "height_range_m",
        "nodata_samples",
        "crs",
        "record",
        "error",
        "pages",
        "file_bytes",
        "bytes_per_sample",
    ] {
        assert!(fields(&info).contains(&field), "{field}");
    }
    assert_eq!(info["samples"], serde_json::json!([129, 129]));
    assert_eq!((info["k"].as_u64(), info["record"].as_str()), (Some(7), Some("compact")));
    assert_eq!(info["spacing_m"], serde_json::json!([20.0, 20.0]));
    assert_eq!(info["error"], "bounded");
    let length = std::fs::metadata(bench.path("land.iqt")).unwrap().len();
    assert_eq!(info["file_bytes"], length);
    assert!((info["bytes_per_sample"].as_f64().unwrap() - length as f64 / (129.0 * 129.0)).abs() < 1e-9);
    let human = bench.good(&["info", "land.iqt"]);
    assert!(human.contains("129 x 129") && human.contains("from the elevation model"), "{human}");
}

#[test]
fn every_verb_refuses_what_is_no_terrain() {
    let bench = Bench::with_flight();
    std::fs::write(bench.path("text"), "hello").unwrap();
    let verbs: [&[&str]; 11] = [
        &["info"],
        &["verify"],
        &["height", "--at", "1,1"],
        &["flight", "straight", "-o", "x", "--frames", "9", "--speed", "1"],
        &["replay", "--flight", "land.flight", "--engine", "soar"],
        &["compare", "--flight", "land.flight", "-o", "x"],
        &["mesh", "--flight", "land.flight", "--frame", "0", "--engine", "soar", "-o", "x.ply"],
        &["mesh", "--max-error", "1", "-o", "x.ply"],
        &["export", "-o", "x.tif"],
        &["compare-ground"],
        &["compare-ground", "land.iqt"],
    ];
    for verb in verbs {
        for (file, words) in
            [("missing.iqt", "cannot open"), ("text", "not a terrain file"), (".", "not a regular file")]
        {
            let message = bench.bad(1, &[verb, &[file]].concat());
            assert!(message.contains(file) && message.contains(words), "{verb:?} {file}: {message}");
        }
    }
    // What could be built is not what is to be verified.
    assert!(bench.bad(1, &["verify", "land.tif"]).contains("not a terrain file"));
    assert!(["x", "x.ply", "x.tif"].iter().all(|name| !bench.path(name).exists()));
}

#[test]
fn verify_names_the_page() {
    let bench = Bench::with_terrain();
    assert!(bench.good(&["verify", "land.iqt"]).contains("sound"));
    let sound = std::fs::read(bench.path("land.iqt")).unwrap();
    // File page 5 holds records.
    let mut bytes = sound.clone();
    bytes[5 * 4096 + 77] ^= 4;
    std::fs::write(bench.path("bad.iqt"), &bytes).unwrap();
    let message = bench.bad(1, &["verify", "bad.iqt"]);
    assert!(message.contains("file page 5") && message.contains("checksum"), "{message}");
    bytes[7 * 4096..8 * 4096].fill(0);
    std::fs::write(bench.path("bad.iqt"), &bytes).unwrap();
    let message = bench.bad(1, &["verify", "bad.iqt"]);
    assert!(message.contains("2 problems") && message.contains("file page 7"), "{message}");
    // A damaged header or a cut file does not open.
    let mut bytes = sound.clone();
    bytes[0x30] ^= 1;
    std::fs::write(bench.path("bad.iqt"), &bytes).unwrap();
    assert!(bench.bad(1, &["verify", "bad.iqt"]).contains("header"));
    std::fs::write(bench.path("bad.iqt"), &sound[..sound.len() - 1]).unwrap();
    assert!(bench.bad(1, &["verify", "bad.iqt"]).contains("cut short"));
}

#[test]
fn heights_inside_outside_and_between() {
    let bench = Bench::with_terrain();
    let height =
        |at: &str| bench.json(&["height", "land.iqt", "--at", at, "--json"])["height_m"].as_f64().unwrap();
    let (west, east) = (height("400,600"), height("420,600"));
    assert!((height("410,600") - 0.5 * (west + east)).abs() < 1e-9);
    let printed = bench.good(&["height", "land.iqt", "--at", "400,600"]);
    let number: f64 = printed.strip_suffix(" m\n").unwrap().parse().unwrap();
    assert!((number - west).abs() < 1e-6);
    // The far corner belongs to the terrain, a step further does not.
    height("2560,2560");
    for at in ["-1,0", "0,2560.1", "1e9,5"] {
        let message = bench.bad(1, &["height", "land.iqt", "--at", at]);
        assert!(message.contains("2560,2560"), "{message}");
    }
}

#[test]
fn synthetic_terrain_repeats_and_says_its_scale() {
    let bench = Bench::new();
    for (name, seed) in [("a.tif", "1"), ("b.tif", "1"), ("c.tif", "2")] {
        bench.good(&["synth", "--size", "65", "--seed", seed, "--spacing", "30", "-o", name]);
    }
    let [a, b, c] = ["a.tif", "b.tif", "c.tif"].map(|name| std::fs::read(bench.path(name)).unwrap());
    assert!(a == b && a != c);
    bench.good(&["synth", "--size", "65", "--seed", "1", "--spacing", "30", "-o", "a.png"]);
    let [tif, png] = ["a.tif", "a.png"].map(|input| {
        bench.good(&["build", input, "-o", "x.iqt"]);
        let info = bench.json(&["info", "x.iqt", "--json"]);
        (
            info["spacing_m"].clone(),
            info["height_range_m"].clone(),
            bench.good(&["height", "x.iqt", "--at", "300,900"]),
        )
    });
    assert_eq!(tif.0, serde_json::json!([30.0, 30.0]));
    assert_eq!(tif, png);
    bench.bad(1, &["synth", "--size", "65", "--seed", "1", "-o", "missing/a.tif"]);
}
