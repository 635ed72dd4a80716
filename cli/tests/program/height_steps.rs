//! Heights rounded to steps: what the program says, and heights that come out again.

use crate::support::{Bench, text};

/// Heights of 60 x 40 samples that no step divides; one of them is void.
fn height(x: u32, y: u32) -> Option<f64> {
    let (u, v) = (f64::from(x), f64::from(y));
    ((x, y) != (9, 30)).then(|| 250.0 + 20.0 * (u * 0.17).sin() + 4.9 * (v * 0.3).cos() + 0.003_7 * u)
}

/// With `lidar.asc` in it.
fn bench() -> Bench {
    let bench = Bench::new();
    let rows = (0..40).rev().map(|y| {
        let row = (0..60).map(|x| height(x, y).map_or("-9999".into(), |h| format!("{h:.5}")));
        row.collect::<Vec<_>>().join(" ")
    });
    let head = "ncols 60\nnrows 40\nxllcorner 500000\nyllcorner 5100000\ncellsize 2\nNODATA_value -9999\n";
    std::fs::write(bench.path("lidar.asc"), head.to_owned() + &rows.collect::<Vec<_>>().join("\n")).unwrap();
    bench
}

#[test]
fn exact_builds_say_which_step_would_fit() {
    let bench = bench();
    let output = bench.run(&["build", "lidar.asc", "-o", "exact.iqt", "--json", "--spacing", "2"]);
    let (said, noted) = (text(&output.stdout), text(&output.stderr));
    let built: serde_json::Value = serde_json::from_str(&said).unwrap();
    let step_m = built["compact_step_m"].as_f64().unwrap();
    assert_eq!(built["record"], "exact");
    assert!(noted.contains(&format!("--height-step {step_m} ")), "{noted}");
    // What was named is taken, and a little less is not.
    let step = step_m.to_string();
    let flags = ["build", "lidar.asc", "-o", "rounded.iqt", "--spacing", "2", "--json", "--height-step"];
    let built = bench.json(&[&flags[..], &[&step]].concat());
    assert_eq!((&built["heights_rounded"], &built["record_bytes"]), (&true.into(), &4.into()));
    assert!(built["compact_step_m"].is_null());
    let less = (step_m * 0.85).to_string();
    let output = bench.run(&[&flags[..], &[&less, "--force"]].concat());
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(said.contains(&format!("is {step} m")) && said.contains("--height-step M"), "{said}");
    // Who asks for exact records knows.
    let output = bench.run(&["build", "lidar.asc", "-o", "e.iqt", "--spacing", "2", "--record", "exact"]);
    assert!(!text(&output.stderr).contains("--height-step"));
}

#[test]
fn steps_that_are_none_are_refused() {
    let bench = bench();
    for step in ["0", "-0.1", "nan", "inf", "x"] {
        let output = bench.run(&["build", "lidar.asc", "-o", "a.iqt", &format!("--height-step={step}")]);
        assert_eq!(output.status.code(), Some(2), "{step}");
    }
    let output = bench.run(&["build", "lidar.asc", "-o", "a.iqt", "--height-step", "1", "--record", "exact"]);
    assert!(!output.status.success());
    assert!(text(&output.stderr).contains("exact records"), "{}", text(&output.stderr));
    assert_eq!(bench.names(), ["lidar.asc"]);
}

/// By `height` and by `export`, of the file and of the packed one, and with a crater.
#[test]
fn heights_come_out_as_they_were_rounded() {
    let bench = bench();
    let flags = ["--spacing", "2", "--height-step", "0.05"];
    bench.good(&[&["build", "lidar.asc", "-o", "a.iqt"][..], &flags].concat());
    bench.good(&[&["build", "lidar.asc", "-o", "p.iqt", "--packed"][..], &flags].concat());
    for file in ["a.iqt", "p.iqt"] {
        for (x, y) in [(0u32, 0u32), (59, 39), (17, 5), (40, 22)] {
            let at = format!("{},{}", 2 * x, 2 * y);
            let found = bench.json(&["height", file, "--at", &at, "--json"]);
            let (found, sample) = (found["height_m"].as_f64().unwrap(), height(x, y).unwrap());
            assert!((found - sample).abs() <= 0.025 + 1e-5, "{file} {x} {y}: {found} {sample}");
            assert!((found / 0.05 - (found / 0.05).round()).abs() < 1e-6, "{found}");
        }
        bench.good(&["export", file, "-o", "out.tif", "--force"]);
        bench.good(&["build", "out.tif", "-o", "again.iqt", "--force", "--record", "exact"]);
        let found =
            bench.json(&["height", "again.iqt", "--at", "34,10", "--json"])["height_m"].as_f64().unwrap();
        assert!((found - height(17, 5).unwrap()).abs() <= 0.025 + 1e-4, "{found}");
        bench.good(&["crater", file, "--at", "40,40", "--radius", "12", "--depth", "4"]);
        bench.good(&["verify", file]);
        let found = bench.json(&["height", file, "--at", "40,40", "--json"])["height_m"].as_f64().unwrap();
        assert!(found < height(20, 20).unwrap() - 1.0, "{found}");
        assert!((found / 0.05 - (found / 0.05).round()).abs() < 1e-6, "{found}");
    }
}
