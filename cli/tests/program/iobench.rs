//! The verb iobench: counts that repeat and agree with replay, fields, refusals, the cap.

use crate::support::{Bench, fields, text};
use serde_json::Value;

const RUN_FIELDS: [&str; 39] = [
    "engine",
    "layout",
    "source",
    "prefetch",
    "frames",
    "record_bytes",
    "file_mb",
    "reads_per_frame_mean",
    "record_bytes_per_frame_mean",
    "distinct_pages_per_frame_mean",
    "distinct_lines_per_frame_mean",
    "distinct_units_per_frame_mean",
    "needed_mb",
    "packed_needed_mb",
    "packed_tiles_per_frame_mean",
    "realtime_mb",
    "preloaded_mb",
    "realtime_mb_max",
    "first_frame_mb",
    "late_pages",
    "late_frames",
    "pages_touched_total",
    "record_bytes_touched_total",
    "update_ms",
    "was_cold",
    "update_ms_cold",
    "update_ms_p99",
    "update_ms_p99_cold",
    "io_ms_p99",
    "first_frame_io_ms",
    "frame_thread_major_faults",
    "frame_thread_minor_faults",
    "first_frame_major_faults",
    "disk_read_mb_total",
    "peak_rss_mb",
    "resident_mb",
    "stream",
    "scratch_map",
    "scratch_pread",
];

const PLAIN: [&str; 5] = ["iobench", "land.iqt", "--flight", "land.flight", "--json"];

fn with<'a>(flags: &[&'a str]) -> Vec<&'a str> {
    [&PLAIN[..], flags].concat()
}

fn runs(value: &Value) -> &Vec<Value> {
    value["runs"].as_array().unwrap()
}

fn find<'v>(value: &'v Value, engine: &str, layout: &str, prefetch: &str) -> &'v Value {
    let is = |r: &&Value| {
        r["engine"] == engine && r["layout"] == layout && r["prefetch"] == prefetch && r["source"] == "map"
    };
    runs(value).iter().find(is).unwrap()
}

#[test]
fn every_engine_and_layout_has_a_run_with_every_field() {
    let bench = Bench::with_flight();
    let value = bench.json(&PLAIN);
    assert_eq!(
        runs(&value).len(),
        4 * 4 + 2,
        "three engines and the mesh, four layouts; two flights over a pool"
    );
    for run in runs(&value) {
        let names = fields(run);
        assert!(RUN_FIELDS.iter().all(|field| names.contains(field)), "{names:?}");
        assert!(names.iter().all(|name| RUN_FIELDS.contains(name)), "{names:?}");
        let measured = run["layout"] == "ours" && run["engine"] != "mesh";
        assert_eq!(run["update_ms"].is_number(), measured);
        assert!(run["scratch_map"].is_null());
        assert!(run["needed_mb"].as_f64() >= run["realtime_mb"].as_f64());
        assert_eq!(run["stream"].is_object(), run["source"] == "pool");
    }
    for field in [
        "terrain",
        "flight",
        "tolerance_px",
        "metric",
        "viewport_px",
        "cache_mib",
        "page_bytes",
        "kernel_known",
    ] {
        assert!(!value[field].is_null(), "{field}");
    }
    assert!(value["cap"].is_null() && value["cap_note"].is_null());
    if cfg!(target_os = "linux") {
        let run = find(&value, "soar", "ours", "none");
        for field in ["frame_thread_major_faults", "disk_read_mb_total", "io_ms_p99"] {
            assert!(run[field].is_number(), "{field}");
        }
    }
}

/// All figures but the measured ones, of runs that are counted.
fn counts(value: &Value) -> Vec<Value> {
    let mut runs: Vec<Value> = runs(value).iter().filter(|run| run["source"] == "map").cloned().collect();
    for run in &mut runs {
        let run = run.as_object_mut().unwrap();
        run.retain(|name, _| {
            !["_ms", "ms_", "faults", "disk_read", "rss"].iter().any(|part| name.contains(part))
        });
    }
    runs
}

#[test]
fn counts_repeat_and_are_replays() {
    let bench = Bench::with_flight();
    let flags = with(&["--prefetch", "none,frustum", "--cache", "1", "--fps", "0"]);
    let value = bench.json(&flags);
    assert_eq!(counts(&value), counts(&bench.json(&flags)));
    for engine in ["soar", "smart", "kinetic"] {
        let replay =
            bench.json(&["replay", "land.iqt", "--flight", "land.flight", "--engine", engine, "--json"]);
        for prefetch in ["none", "frustum"] {
            let run = find(&value, engine, "ours", prefetch);
            for sum in ["pages_touched_total", "record_bytes_touched_total"] {
                assert_eq!(run[sum], replay[sum], "{engine} {sum}");
            }
        }
    }
    let [soar, mesh] = ["soar", "mesh"].map(|engine| find(&value, engine, "row", "none"));
    assert_eq!(soar["pages_touched_total"], mesh["pages_touched_total"]);
}

/// A packed file has the pages of the one it was made of, and is told by tiles besides.
#[test]
fn packed_files_are_counted_by_tiles_too() {
    let bench = Bench::with_flight();
    bench.good(&["pack", "land.iqt", "-o", "packed.iqt"]);
    let flags = ["--engines", "kinetic", "--layouts", "row,ours", "--prefetch", "none", "--fps", "0"];
    let plain = bench.json(&with(&flags));
    let mut packed = flags.to_vec();
    packed.splice(0..0, ["iobench", "packed.iqt", "--flight", "land.flight"]);
    let value = bench.json(&[&packed[..], &["--json", "--frames", "f.csv"]].concat());
    // Whatever the memory: what is counted with it is another cache's misses, and no more.
    let small = bench.json(&[&packed[..], &["--json", "--cache", "1"]].concat());
    for run in runs(&value).iter().filter(|run| run["source"] == "map") {
        let [engine, layout] = ["engine", "layout"].map(|name| run[name].as_str().unwrap());
        let small = find(&small, engine, layout, "none");
        for name in ["pages_touched_total", "record_bytes_touched_total", "needed_mb", "packed_needed_mb"] {
            assert_eq!(run[name], small[name], "{engine} {layout} {name}");
        }
    }
    for engine in ["kinetic", "mesh"] {
        let [plain, packed] = [&plain, &value].map(|v| find(v, engine, "ours", "none"));
        assert_eq!(plain["pages_touched_total"], packed["pages_touched_total"]);
        assert!(plain["packed_needed_mb"].is_null(), "{plain}");
        let needed = packed["packed_needed_mb"].as_f64().unwrap();
        assert!(needed > 0.0, "{packed}");
        assert!(packed["packed_tiles_per_frame_mean"].as_f64().unwrap() > 0.0);
        assert!(find(&value, engine, "row", "none")["packed_needed_mb"].is_null());
    }
    let pool = runs(&value).iter().find(|run| run["source"] == "pool").unwrap();
    for field in ["tiles_unpacked", "tiles_mb", "unpack_ms_mean"] {
        assert!(pool["stream"][field].as_f64().unwrap() > 0.0, "{pool}");
        assert!(runs(&plain).iter().all(|run| run["stream"][field].is_null()), "{plain}");
    }
    let (_, csv) = bench.table("f.csv");
    assert!(csv.lines().next().unwrap().contains(",preloaded_pages,tiles,tile_bytes,"), "{csv}");
    let table = bench.good(&packed);
    assert!(table.contains("the file is packed\n  kinetic needs "), "{table}");
}

#[test]
fn frames_report_and_table_are_written() {
    let bench = Bench::with_flight();
    let args =
        ["iobench", "land.iqt", "--flight", "land.flight", "--engines", "kinetic", "--layouts", "row,ours"];
    let table = bench.good(&[&args[..], &["--frames", "f.csv", "-o", "report"]].concat());
    assert!(table.contains("kinetic") && table.contains("mesh") && table.contains("report.html"), "{table}");
    assert!(
        table.contains("late pages, sum") && table.contains("fits into the cache (row, ours)"),
        "{table}"
    );
    let (remarks, csv) = bench.table("f.csv");
    assert!(remarks.contains("# terrain: land.iqt\n# flight: land.flight\n"), "{remarks}");
    assert_eq!(csv.lines().count(), 1 + 6 * 40);
    assert!(csv.starts_with("engine,layout,source,prefetch,frame,reads,"));
    for file in ["report.html", "summary.json", "frames.csv"] {
        assert!(bench.path("report").join(file).is_file(), "{file}");
    }
    let summary = std::fs::read_to_string(bench.path("report/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    assert_eq!(runs(&summary).len(), 6);
}

#[test]
#[cfg(target_os = "linux")]
fn scratch_files_are_read_and_gone() {
    let bench = Bench::with_flight();
    let before = bench.names();
    let value = bench.json(&with(&["--engines", "soar", "--layouts", "row,ours", "--scratch", "."]));
    assert_eq!(bench.names(), before);
    for layout in ["row", "ours"] {
        let run = find(&value, "soar", layout, "none");
        for how in ["scratch_map", "scratch_pread"] {
            assert!(run[how]["frame_ms"].as_f64() >= Some(0.0), "{run}");
            assert!(run[how]["major_faults"].is_number() && run[how]["disk_read_mb_total"].is_number());
        }
    }
    assert!(find(&value, "mesh", "row", "none")["scratch_map"].is_null());
}

#[test]
fn a_cap_holds_or_is_said_not_to() {
    let bench = Bench::with_flight();
    let value = bench.json(&with(&["--engines", "kinetic", "--layouts", "ours", "--cap", "256"]));
    assert_eq!(runs(&value).len(), 4);
    let capped = value["cap"].is_object();
    assert_eq!(value["cap_note"].is_string(), !capped, "one of both: {value}");
    let command = value["made"]["command"].as_str().unwrap();
    assert!(command.contains("--cap 256") && !command.contains("--cap-group"), "{command}");
    if capped {
        assert_eq!(value["cap"]["mib"], 256);
        assert!([1, 2].map(Value::from).contains(&value["cap"]["control_group_version"]));
    }
    let output =
        bench.run(&["iobench", "land.iqt", "--flight", "land.flight", "--layouts", "ours", "--cap", "256"]);
    let table = text(&output.stdout);
    assert!(
        table.contains(if capped { "memory capped at 256 MiB" } else { "memory not capped: " }),
        "{table}"
    );
    // What fails in the copy fails as it does without.
    assert!(
        bench
            .bad(1, &["iobench", "none.iqt", "--flight", "land.flight", "--cap", "256"])
            .contains("none.iqt")
    );
}

#[test]
fn what_makes_no_sense_is_refused() {
    let bench = Bench::with_flight();
    let wrong: [&[&str]; 17] = [
        &["--engines", "roam"],
        &["--engines", "naive"],
        &["--engines", "soar,soar"],
        &["--layouts", "column"],
        &["--layouts", "row,row"],
        &["--prefetch", "all"],
        &["--prefetch", "none,none"],
        &["--cache", "0"],
        &["--cap", "0"],
        &["--cap-group", "."],
        &["--cap", "64", "--cap-group", "."],
        &["--disk-pages", "0"],
        &["--block", "-1"],
        &["--fps", "1e-320"],
        &["--fps", "inf"],
        &["--reads", "by-hand"],
        &["--tolerance-px", "0"],
    ];
    for flags in wrong {
        bench.bad(2, &with(flags));
    }
    for flags in [["--engines", "soar,smart"], ["--layouts", "row"]] {
        let message = bench.bad(2, &with(&[&["--prefetch", "deadline"], &flags[..]].concat()));
        assert!(message.contains("kinetic") && message.contains("ours"), "{message}");
    }
    let cases: [(&[&str], &str); 4] = [
        (&["--scratch", "none"], "none"),
        (&["-o", "land.tif"], "folder"),
        (&["--frames", "land.flight"], "input"),
        (&["--frames", "no/f.csv"], "no/f.csv"),
    ];
    for (flags, word) in cases {
        let message = bench.bad(1, &with(flags));
        assert!(message.contains(word), "{message}");
    }
    assert!(bench.bad(1, &["iobench", "none.iqt", "--flight", "land.flight"]).contains("none.iqt"));
    assert!(bench.bad(1, &["iobench", "land.iqt", "--flight", "none.flight"]).contains("none.flight"));
    assert!(bench.bad(1, &["iobench", "land.tif", "--flight", "land.flight"]).contains("land.tif"));
}

#[test]
fn flights_over_a_pool_load_what_the_mesh_needs() {
    let bench = Bench::with_flight();
    for reads in ["threads", "ring"] {
        let flags = [
            "--engines",
            "kinetic",
            "--layouts",
            "ours",
            "--prefetch",
            "none,frustum,deadline",
            "--fps",
            "500",
            "--reads",
            reads,
        ];
        let output = bench.run(&with(&flags));
        if reads == "ring" && text(&output.stderr).contains("io_uring") {
            println!("not tried: {}", text(&output.stderr));
            continue;
        }
        let value: Value = serde_json::from_str(&text(&output.stdout)).unwrap();
        let pooled: Vec<&Value> = runs(&value).iter().filter(|r| r["source"] == "pool").collect();
        let names: Vec<&str> = pooled.iter().filter_map(|r| r["prefetch"].as_str()).collect();
        assert_eq!(names, ["none", "frustum", "deadline"]);
        for run in pooled {
            assert!(run["stream"]["reads"].as_u64().unwrap() > 0, "{run}");
            assert_eq!(run["stream"]["failures"], 0);
            assert!(run["update_ms"].is_number());
        }
        assert_eq!(value["reads"], reads);
    }
}
