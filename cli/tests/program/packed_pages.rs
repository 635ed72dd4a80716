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
