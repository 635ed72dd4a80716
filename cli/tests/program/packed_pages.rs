//! Packed terrain, and any with `--cache`, is flown page by page: the same meshes and counts, and what was read besides.

use super::support::Bench;
use serde_json::Value;

fn replay(bench: &Bench, file: &str, engine: &str, cache: Option<&str>) -> Value {
    let mut args = vec!["replay", file, "--flight", "land.flight", "--engine", engine, "--json"];
    cache.iter().for_each(|mib| args.extend(["--cache", mib]));
    bench.json(&args)
}

#[test]
fn packed_terrain_is_replayed_page_by_page() {
    let bench = Bench::with_flight();
    bench.good(&["pack", "land.iqt", "-o", "packed.iqt"]);
    for engine in ["naive", "soar", "smart", "kinetic"] {
        let mapped = replay(&bench, "land.iqt", engine, None);
        assert!(mapped["cache_mib"].is_null() && mapped["pages_read_total"].is_null(), "{mapped}");
        for (file, cache, mib) in
            [("packed.iqt", None, 128), ("packed.iqt", Some("1"), 1), ("land.iqt", Some("1"), 1)]
        {
            let found = replay(&bench, file, engine, cache);
            assert_eq!(found["cache_mib"], mib);
            let totals = ["vertex_tests", "splits", "merges", "pages_touched", "record_bytes_touched"];
            for name in totals.map(|name| format!("{name}_total")).iter().chain([&"mesh_hash".into()]) {
                assert_eq!(found[name], mapped[name], "{engine}, {file}: {name}");
            }
            assert!(found["pages_read_total"].as_u64().unwrap() > 0);
            let is_packed = file == "packed.iqt";
            for name in ["tiles_unpacked_total", "tile_bytes_read_total", "unpack_ms_total"] {
                assert_eq!(!found[name].is_null(), is_packed, "{file}: {name}");
            }
            let again = replay(&bench, file, engine, cache);
            for name in ["pages_read_total", "tiles_unpacked_total", "tile_bytes_read_total"] {
                assert_eq!(found[name], again[name], "{engine}, {file}: {name} repeats");
            }
        }
    }
    let said = bench.good(&["replay", "packed.iqt", "--flight", "land.flight"]);
    assert!(said.contains("pages read") && said.contains("of it for unpacking"), "{said}");
}

#[test]
fn meshes_and_comparisons_take_packed_terrain() {
    let bench = Bench::with_flight();
    bench.good(&["pack", "land.iqt", "-o", "packed.iqt"]);
    for (name, words) in
        [("flown", &["--flight", "land.flight", "--frame", "9"][..]), ("plain", &["--max-error", "2"])]
    {
        let make = |file: &str, to: &str, more: &[&str]| {
            bench.good(&[&["mesh", file, "-o", to], words, more].concat());
            std::fs::read(bench.path(to)).unwrap()
        };
        let mapped = make("land.iqt", &format!("{name}-1.stl"), &[]);
        assert!(make("packed.iqt", &format!("{name}-2.stl"), &[]) == mapped, "{name}");
        assert!(make("packed.iqt", &format!("{name}-3.stl"), &["--cache", "1"]) == mapped, "{name}");
    }
    let args = ["compare", "packed.iqt", "--flight", "land.flight", "--no-sweeps", "-o", "report", "--json"];
    let value = bench.json(&args);
    assert_eq!((value["same_mesh"].as_bool(), value["cache_mib"].as_u64()), (Some(true), Some(128)));
}

#[test]
fn a_mesh_tells_what_was_read_for_it() {
    let bench = Bench::with_flight();
    bench.good(&["pack", "land.iqt", "-o", "packed.iqt"]);
    for words in [&["--flight", "land.flight", "--frame", "9"][..], &["--max-error", "2"]] {
        let make = |file: &'static str, more: &[&'static str]| {
            [&["mesh", file, "-o", "a.ply", "--force"], words, more].concat()
        };
        let told = |file: &'static str, more: &[&'static str]| {
            bench.json(&[&make(file, more)[..], &["--json"]].concat())
        };
        let mapped = told("land.iqt", &[]);
        let fields = ["pages_read", "tiles_unpacked", "tile_bytes_read", "read_ms", "unpack_ms"];
        assert!(
            mapped["cache_mib"].is_null() && fields.iter().all(|name| mapped[name].is_null()),
            "{mapped}"
        );
        let paged = told("land.iqt", &["--cache", "2"]);
        assert!(paged["cache_mib"] == 2 && paged["read_ms"].as_f64() > Some(0.0), "{paged}");
        assert!(paged["pages_read"].as_u64() > Some(10) && paged["tiles_unpacked"].is_null(), "{paged}");
        let packed = told("packed.iqt", &["--cache", "2"]);
        assert!(fields.iter().all(|name| packed[name].as_f64() > Some(0.0)), "{packed}");
        for name in ["format", "triangles", "vertices", "origin"] {
            assert!(packed[name] == mapped[name] && paged[name] == mapped[name], "{name}");
        }
        assert!(!bench.good(&make("land.iqt", &[])).contains("read"));
        let said = bench.good(&make("packed.iqt", &[]));
        assert!(
            said.contains(" pages read as needed, from ") && said.contains(" of it for unpacking"),
            "{said}"
        );
    }
}

/// Flights whose speed is found, and pictures where there is a graphics driver, are the same whatever the memory.
#[test]
fn flights_and_pictures_take_a_cache() {
    let bench = Bench::with_flight();
    bench.good(&["pack", "land.iqt", "-o", "packed.iqt"]);
    let out = |name: &str| std::fs::read(bench.path(name)).unwrap();
    let places: [(&str, &[&str]); 4] = [
        ("land.iqt", &[]),
        ("land.iqt", &["--cache", "1"]),
        ("packed.iqt", &[]),
        ("packed.iqt", &["--cache", "1"]),
    ];
    let fly = |(file, cache): (&str, &[&str])| {
        let words =
            ["flight", "straight", file, "-o", "a.flight", "--frames", "20", "--incoherence", "2", "--force"];
        bench.good(&[&words[..], cache].concat());
        String::from_utf8(out("a.flight")).unwrap().replace("packed.iqt", "land.iqt")
    };
    let expected = fly(places[0]);
    assert!(places.iter().all(|place| fly(*place) == expected));
    let draws = bench.run(&["snapshot", "land.iqt", "-o", "a.png", "--size", "160x90", "--force"]);
    if draws.status.code() == Some(0) {
        let size = ["--size", "160x90", "--force"];
        for words in [
            &["-o", "a.png"][..],
            &["-o", "a.png", "--flight", "land.flight", "--frame", "9", "--engine", "soar"],
        ] {
            let draw = |(file, cache): (&str, &[&str])| {
                bench.good(&[&["snapshot", file], words, &size, cache].concat());
                out("a.png")
            };
            let expected = draw(places[0]);
            assert!(places.iter().all(|place| draw(*place) == expected), "{words:?}");
        }
        let draw = |(file, cache): (&str, &[&str])| {
            let words = ["movie", file, "--flight", "land.flight", "--every", "20", "-o", "a.gif"];
            bench.good(&[&words[..], &size, cache].concat());
            out("a.gif")
        };
        let expected = draw(places[0]);
        assert!(places.iter().all(|place| draw(*place) == expected));
    }
    let verbs: [&[&str]; 5] = [
        &["flight", "straight", "land.iqt", "-o", "b.flight", "--frames", "2", "--speed", "2"],
        &["snapshot", "land.iqt", "-o", "b.png"],
        &["movie", "land.iqt", "--flight", "land.flight", "-o", "b.gif"],
        &["mesh", "land.iqt", "--max-error", "2", "-o", "b.ply"],
        &["iobench", "land.iqt", "--flight", "land.flight"],
    ];
    for (verb, value) in verbs.into_iter().flat_map(|verb| ["0", "-1", "some", "16777217"].map(|v| (verb, v)))
    {
        let said = bench.bad(2, &[verb, &[&*format!("--cache={value}")]].concat());
        assert!(said.contains(value) && said.contains("--cache"), "{said}");
    }
    for name in ["b.flight", "b.png", "b.gif", "b.ply"] {
        assert!(!bench.path(name).exists());
    }
}

#[test]
fn a_damaged_tile_is_told_in_words() {
    let bench = Bench::with_flight();
    bench.good(&["pack", "land.iqt", "-o", "packed.iqt"]);
    let mut bytes = std::fs::read(bench.path("packed.iqt")).unwrap();
    let from = bytes.len() / 2;
    bytes[from..].iter_mut().step_by(97).for_each(|byte| *byte ^= 0x40);
    std::fs::write(bench.path("packed.iqt"), bytes).unwrap();
    for words in [
        &["replay", "packed.iqt", "--flight", "land.flight"][..],
        &["mesh", "packed.iqt", "--max-error", "0.5", "-o", "a.stl"],
    ] {
        let said = bench.bad(1, words);
        assert!(said.contains("packed.iqt: ") && said.contains("checksum"), "{said}");
    }
    assert!(!bench.path("a.stl").exists());
}
