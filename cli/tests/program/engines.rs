//! The verbs that fly: flight, replay, compare, mesh.

use crate::support::{Bench, fields, text};
use serde_json::Value;

const REPLAY_FIELDS: [&str; 26] = [
    "pages_read_total",
    "tiles_unpacked_total",
    "tile_bytes_read_total",
    "read_ms_total",
    "unpack_ms_total",
    "engine",
    "frames",
    "triangles_mean",
    "incoherence_percent",
    "vertex_tests_total",
    "splits_total",
    "merges_total",
    "update_ms",
    "mesh_hash",
    "pages_touched_total",
    "record_bytes_touched_total",
    "expired_total",
    "slots_written_total",
    "patch_bytes_total",
    "late_total",
    "late_error_px_max",
    "scan_us_p50",
    "test_us_p50",
    "apply_us_p50",
    "edit_ms_max",
    "edited_records_total",
];

/// What says where figures come from.
const ORIGIN_FIELDS: [&str; 10] = [
    "cache_mib",
    "terrain",
    "flight",
    "tolerance_px",
    "metric",
    "viewport_px",
    "exaggeration",
    "culling",
    "made",
    "processor_percent",
];

fn sorted(mut names: Vec<&str>) -> Vec<&str> {
    names.sort_unstable();
    names
}

#[test]
fn every_kind_of_flight_is_made_and_repeats() {
    let bench = Bench::with_terrain();
    for kind in ["straight", "orbit", "terrain", "turn"] {
        let make = |out: &str| {
            bench.good(&["flight", kind, "land.iqt", "-o", out, "--frames", "12", "--speed", "8.5"]);
            std::fs::read_to_string(bench.path(out)).unwrap()
        };
        let flight = make("a.flight");
        assert!(flight.starts_with("terrasoar-flight 1\nunits metres degrees seconds\n"), "{flight}");
        assert_eq!(flight.lines().filter(|l| l.starts_with(|c: char| c.is_ascii_digit())).count(), 12);
        assert_eq!(flight, make("b.flight"));
    }
    // 19,980 m do not fit over 2,560: three quarters of them are flown there and back.
    let long = ["flight", "straight", "land.iqt", "-o", "l.flight", "--frames", "1000", "--speed", "20"];
    let said = text(&bench.run(&long).stderr);
    assert!(said.contains("the way is 19,980 m long, and a straight flight has three quarters of the terrain's longer side, 1,920 m"), "{said}");
    assert!(said.contains("of 999 steps the eye flies backwards"), "{said}");
    // A circle of 11 km.
    let wide = ["flight", "turn", "land.iqt", "-o", "w.flight", "--frames", "100", "--speed", "100"];
    let said = text(&bench.run(&wide).stderr);
    assert!(said.contains("the circle does not fit over the terrain of 2,560 x 2,560 m"), "{said}");
    let short = ["flight", "straight", "land.iqt", "-o", "l.flight", "--frames", "96", "--speed", "20"];
    assert_eq!(text(&bench.run(&short).stderr), "");
    let turn = [
        "flight",
        "turn",
        "land.iqt",
        "-o",
        "c.flight",
        "--frames",
        "4",
        "--speed",
        "0",
        "--turn-rate",
        "-2",
    ];
    bench.good(&turn);
    assert!(
        bench
            .bad(1, &["flight", "orbit", "land.iqt", "-o", "land.iqt", "--frames", "4", "--speed", "1"])
            .contains("input")
    );
}

#[test]
fn a_speed_is_found_for_an_incoherence() {
    let bench = Bench::with_terrain();
    let args = ["flight", "straight", "land.iqt", "-o", "a.flight", "--frames", "60", "--incoherence", "4"];
    let said = bench.good(&args);
    assert!(said.contains("m a frame"), "{said}");
    let replay = bench.json(&["replay", "land.iqt", "--flight", "a.flight", "--engine", "smart", "--json"]);
    let percent = replay["incoherence_percent"].as_f64().unwrap();
    assert!((2.0..8.0).contains(&percent), "{percent}");
    let message = bench.bad(
        1,
        &["flight", "straight", "land.iqt", "-o", "b.flight", "--frames", "60", "--incoherence", "100"],
    );
    assert!(message.contains("no speed"), "{message}");
    assert!(!bench.path("b.flight").exists());
}

#[test]
fn engines_replay_the_same_mesh() {
    let bench = Bench::with_flight();
    let replay = |engine: &str| -> Value {
        let args = ["replay", "land.iqt", "--flight", "land.flight", "--engine", engine, "--json"];
        let value = bench.json(&args);
        assert_eq!(sorted(fields(&value)), sorted([&REPLAY_FIELDS[..], &ORIGIN_FIELDS].concat()));
        assert_eq!(
            (value["terrain"].as_str(), value["culling"].as_str()),
            (Some("land.iqt"), Some("vertices"))
        );
        assert!(value["made"]["command"].as_str().unwrap().ends_with(&args.join(" ")));
        assert_eq!(sorted(fields(&value["update_ms"])), ["max", "mean", "p50", "p95", "p99"]);
        assert_eq!((value["engine"].as_str(), value["frames"].as_u64()), (Some(engine), Some(40)));
        value
    };
    let [naive, soar, smart, kinetic] = ["naive", "soar", "smart", "kinetic"].map(replay);
    for other in [&soar, &smart, &kinetic, &replay("smart"), &replay("kinetic")] {
        for field in ["mesh_hash", "triangles_mean", "incoherence_percent", "splits_total", "merges_total"] {
            assert_eq!(other[field], naive[field], "{field}");
        }
    }
    assert_eq!(naive["mesh_hash"].as_str().unwrap().len(), 16);
    let tests = |v: &Value| v["vertex_tests_total"].as_u64().unwrap();
    assert!(tests(&smart) < tests(&soar));
    assert!(tests(&kinetic) < tests(&smart));
    let human = bench.good(&[
        "replay",
        "land.iqt",
        "--flight",
        "land.flight",
        "--engine",
        "smart",
        "--stats",
        "frames.csv",
    ]);
    assert!(human.contains("vertex tests"), "{human}");
    let (remarks, table) = bench.table("frames.csv");
    assert_eq!(table.lines().count(), 41);
    for remark in [
        "# terrain: land.iqt",
        "# flight: land.flight",
        "# engine: smart",
        "# tolerance_px: 1",
        "# metric: ball",
        "# viewport_px: 800x600",
        "# exaggeration: 1",
        "# culling: vertices",
    ] {
        assert!(remarks.lines().any(|line| line == remark), "{remark}: {remarks}");
    }
    assert!(remarks.contains("--engine smart --stats frames.csv"), "{remarks}");
}

#[test]
fn tolerance_and_viewport_change_the_mesh() {
    let bench = Bench::with_flight();
    let triangles = |flags: &[&str]| {
        let args = ["replay", "land.iqt", "--flight", "land.flight", "--engine", "soar", "--json"];
        bench.json(&[&args[..], flags].concat())["triangles_mean"].as_f64().unwrap()
    };
    let base = triangles(&[]);
    assert!(triangles(&["--tolerance-px", "8"]) < base);
    assert_eq!(triangles(&["--metric", "ball"]), base);
    assert!(triangles(&["--metric", "sight"]) < base);
    assert!(triangles(&["--viewport", "1600x1200"]) > base);
}

#[test]
fn a_budget_leaves_detail_out_and_says_so() {
    let bench = Bench::with_flight();
    let args = ["replay", "land.iqt", "--flight", "land.flight", "--json"];
    let [all, bounded] =
        [&[][..], &["--budget-tests", "50"]].map(|flags: &[&str]| bench.json(&[&args[..], flags].concat()));
    assert_eq!((all["engine"].as_str(), all["late_total"].as_u64()), (Some("kinetic"), Some(0)));
    assert!(bounded["late_total"].as_u64() > Some(0));
    assert!(bounded["late_error_px_max"].as_f64() > Some(1.0));
    assert!(bounded["triangles_mean"].as_f64() < all["triangles_mean"].as_f64());
    let message = bench.bad(2, &[&args[..], &["--budget-tests", "50", "--engine", "soar"]].concat());
    assert!(message.contains("kinetic"), "{message}");
}

#[test]
fn culling_by_clusters_and_exaggeration_keep_the_engines_together() {
    let bench = Bench::with_flight();
    let args = ["compare", "land.iqt", "--flight", "land.flight", "--no-sweeps", "--json"];
    let triangles = |flags: &[&str], out: &str| {
        let value = bench.json(&[&args[..], flags, &["-o", out]].concat());
        assert_eq!(value["same_mesh"], true);
        value["engines"][2]["triangles_mean"].as_f64()
    };
    let plain = triangles(&[], "a");
    assert!(triangles(&["--culling", "clusters"], "b") > plain);
    assert!(triangles(&["--exaggeration", "3"], "c") > plain);
    assert!(bench.bad(2, &[&args[..], &["--exaggeration", "0", "-o", "d"]].concat()).contains("0.01 to 100"));
}

#[test]
fn compare_writes_a_report_and_one_object() {
    let bench = Bench::with_flight();
    let args = [
        "compare",
        "land.iqt",
        "--flight",
        "land.flight",
        "--engines",
        "soar,smart,kinetic",
        "-o",
        "report",
        "--no-sweeps",
    ];
    let value = bench.json(&[&args[..], &["--json"]].concat());
    assert_eq!(sorted(fields(&value)), sorted([&["engines", "same_mesh"][..], &ORIGIN_FIELDS].concat()));
    assert_eq!(value["same_mesh"], true);
    let engines = value["engines"].as_array().unwrap();
    assert_eq!(engines.len(), 3);
    for engine in engines {
        let names = fields(engine);
        let more = ["vertex_tests_ratio", "vertex_tests_ratio_worst_frame", "speedup_median"];
        for field in REPLAY_FIELDS.iter().chain(&more) {
            assert!(names.contains(field), "{field}");
        }
    }
    assert_eq!(engines[0]["vertex_tests_ratio"], 1.0);
    assert!(engines[1]["vertex_tests_ratio"].as_f64().unwrap() < 0.5);
    for file in ["report.html", "summary.json", "frames-soar.csv", "frames-smart.csv", "frames-kinetic.csv"] {
        assert!(bench.path("report").join(file).is_file(), "{file}");
    }
    let output = bench.run(&args);
    let told = text(&output.stdout);
    assert!(told.contains("same mesh: yes") && told.contains("\nprocessor time "), "{told}");
    assert!(told.contains("speed-up  by medians"), "{told}");
    let page = std::fs::read_to_string(bench.path("report/report.html")).unwrap();
    assert!(page.contains("Made by terrasoar ") && page.contains("culling by vertices"));
    assert_eq!(text(&output.stderr), "");
    assert!(bench.bad(1, &[&args[..7], &["land.tif"], &args[8..]].concat()).contains("folder"));
}

#[test]
fn sweeps_are_in_the_summary() {
    let bench = Bench::with_flight();
    let output =
        bench.run(&["compare", "land.iqt", "--flight", "land.flight", "-o", "r", "--viewport", "200x150"]);
    assert!(output.status.success());
    // Three engines fly five times 40 frames and three times 120, each twice.
    let said = text(&output.stderr);
    assert!(said.contains("sweeps fly about 3,360 more frames; --no-sweeps leaves them out"), "{said}");
    let summary = std::fs::read_to_string(bench.path("r/summary.json")).unwrap();
    let summary: Value = serde_json::from_str(&summary).unwrap();
    let xs = |sweep: &str| -> Vec<f64> {
        let points = summary[sweep].as_array().unwrap();
        points.iter().filter(|p| p["engine"] == "smart").map(|p| p["x"].as_f64().unwrap()).collect()
    };
    assert_eq!(xs("tolerance_sweep"), [0.5, 1.0, 2.0, 4.0, 8.0]);
    for (sweep, frames, is_solved) in [("tolerance_sweep", 40, false), ("incoherence_sweep", 120, true)] {
        for point in summary[sweep].as_array().unwrap() {
            assert_eq!(
                (point["frames"].as_u64(), point["speed_m_per_frame"].is_f64()),
                (Some(frames), is_solved)
            );
            assert!(point["triangles_mean"].as_f64() > Some(0.0), "{point}");
            assert!(point["incoherence_percent"].as_f64() > Some(0.0), "{point}");
        }
    }
    // What this small terrain cannot reach is left out with a note.
    assert!(xs("incoherence_sweep").iter().all(|x| [0.6, 1.4, 5.3].contains(x)));
}

#[test]
fn meshes_are_the_frames_triangles() {
    let bench = Bench::with_flight();
    let mesh = |engine: &str, out: &str, flags: &[&str]| {
        let args =
            ["mesh", "land.iqt", "--flight", "land.flight", "--frame", "39", "--engine", engine, "-o", out];
        bench.good(&[&args[..], flags].concat());
        std::fs::read(bench.path(out)).unwrap()
    };
    let obj = text(&mesh("smart", "a.obj", &[]));
    let (vertices, faces) = (obj.matches("\nv ").count(), obj.matches("\nf ").count());
    assert!(vertices > 100 && faces > 100);
    let header = |ply: &[u8]| {
        let end = b"end_header\n";
        let at = ply.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        (text(&ply[..at]), ply.len() - at)
    };
    for engine in ["naive", "soar", "smart", "kinetic"] {
        let (head, body) = header(&mesh(engine, "a.ply", &[]));
        assert!(head.contains(&format!("element vertex {vertices}\n")), "{head}");
        assert!(head.contains(&format!("element face {faces}\n")), "{head}");
        assert_eq!(body, 24 * vertices + 13 * faces);
    }
    let ascii = text(&mesh("soar", "b.ply", &["--ascii"]));
    assert_eq!(ascii.split("end_header\n").nth(1).unwrap().lines().count(), vertices + faces);
    let beyond =
        ["mesh", "land.iqt", "--flight", "land.flight", "--frame", "40", "--engine", "soar", "-o", "c.ply"];
    assert!(bench.bad(1, &beyond).contains("0 to 39"));
    assert!(!bench.path("c.ply").exists());
}

#[test]
fn wrong_flights_are_refused_with_their_line() {
    let bench = Bench::with_flight();
    let flight = std::fs::read_to_string(bench.path("land.flight")).unwrap();
    std::fs::write(bench.path("bad.flight"), flight.replace("0.1 ", "x ")).unwrap();
    for (file, words) in
        [("missing.flight", "cannot read"), ("land.tif", "not a flight"), ("bad.flight", "bad.flight:")]
    {
        let message = bench.bad(1, &["replay", "land.iqt", "--flight", file, "--engine", "soar"]);
        assert!(message.contains(words), "{message}");
    }
    assert!(
        bench
            .bad(
                1,
                &["replay", "land.iqt", "--flight", "land.flight", "--engine", "soar", "--stats", "no/x.csv"]
            )
            .contains("no/x.csv")
    );
}

/// A mapped file that is cut short under a replay ends it with words, not with a signal.
#[cfg(unix)]
#[test]
fn a_file_cut_short_under_a_replay() {
    use std::time::Duration;
    let bench = Bench::new();
    bench.good(&["synth", "--size", "513", "--seed", "5", "-o", "land.tif"]);
    bench.good(&["build", "land.tif", "-o", "land.iqt"]);
    bench.good(&[
        "flight",
        "straight",
        "land.iqt",
        "-o",
        "long.flight",
        "--frames",
        "20000",
        "--speed",
        "0.2",
    ]);
    let mut replay = bench.command(&[
        "replay",
        "land.iqt",
        "--flight",
        "long.flight",
        "--engine",
        "soar",
        "--tolerance-px",
        "0.2",
    ]);
    let mut running =
        replay.stderr(std::process::Stdio::piped()).stdout(std::process::Stdio::null()).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(500));
    assert!(running.try_wait().unwrap().is_none(), "over before anything could be done to it");
    std::fs::OpenOptions::new().write(true).open(bench.path("land.iqt")).unwrap().set_len(4096).unwrap();
    let ended = running.wait_with_output().unwrap();
    let words = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(1), "{words}");
    assert!(words.contains("cut short") && words.contains("build it again"), "{words}");
}
