//! Elevation data that is easily misread: what is said of it, and that what is said to type helps.

use crate::support::{Bench, text};

const CASES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../import/tests/fixtures/cases/");

fn bench(name: &str) -> Bench {
    let bench = Bench::new();
    std::fs::copy(format!("{CASES}{name}"), bench.path("a.tif")).unwrap();
    bench
}

/// What a build says on the way, and the flag in brackets at the end of its first warning.
fn warned(bench: &Bench, args: &[&str]) -> (String, Vec<String>) {
    let output = bench.run(&[&["build", "a.tif", "-o", "a.iqt"], args].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stderr);
    let advice =
        said.lines().next().and_then(|line| line.rsplit_once('(')?.1.strip_suffix(')').map(str::to_owned));
    let words = advice.unwrap_or_default().split(' ').map(str::to_owned).collect();
    (said, words)
}

/// Builds, takes the advice, and expects to hear no more of it.
fn advice_helps(name: &str, flag: &str) -> Bench {
    let bench = bench(name);
    let (said, words) = warned(&bench, &[]);
    assert!(said.contains(flag), "{name}: {said}");
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let (said, _) = warned(&bench, &words);
    assert!(!said.contains("warning"), "{name} with {words:?}: {said}");
    bench
}

/// The height of the south-west sample.
fn corner_m(bench: &Bench) -> f64 {
    bench.json(&["height", "a.iqt", "--at", "0,0", "--json"])["height_m"].as_f64().unwrap()
}

#[test]
fn what_is_said_to_type_helps() {
    let bench = advice_helps("18-nd-q.tif", "--nodata -32768");
    assert_eq!(bench.json(&["info", "a.iqt", "--json"])["nodata_samples"], 25);
    let bench = advice_helps("03-ftus-code-only.tif", "--height-unit ftUS");
    assert!((corner_m(&bench) - 30.480_061).abs() < 1e-5);
    advice_helps("11-local-1cm.tif", "--crs EPSG:4326");
    let bench = advice_helps("16-scalez.tif", "--z-scale 0.01");
    assert!((corner_m(&bench) - 100.0).abs() < 1e-9);
}

#[test]
fn questions_name_the_flag_that_answers_them() {
    let bench = bench("12-quarter-degree-nocrs.tif");
    let message = bench.bad(1, &["build", "a.tif", "-o", "a.iqt"]);
    assert!(message.contains("EPSG:4326") && message.contains("--crs SYSTEM"), "{message}");
    bench.good(&["build", "a.tif", "-o", "a.iqt", "--crs", "EPSG:4326"]);
    let info = bench.json(&["info", "a.iqt", "--json"]);
    assert!((info["spacing_m"][0].as_f64().unwrap() - 19_280.0).abs() < 200.0, "{info}");
    let bounds = [0, 1, 2, 3].map(|i| info["bounds_wgs84"][i].as_f64().unwrap());
    assert!((bounds[0] - 5.125).abs() < 1e-6 && (bounds[3] - 49.875).abs() < 1e-6, "{bounds:?}");
    bench.good(&[
        "build",
        "a.tif",
        "-o",
        "a.iqt",
        "--crs",
        "EPSG:4326",
        "--reproject",
        "utm",
        "--resolution",
        "30000",
    ]);
    assert!(bench.json(&["info", "a.iqt", "--json"])["crs"].as_str().unwrap().contains("UTM zone 32N"));
    let message = bench.bad(1, &["build", "a.tif", "-o", "a.iqt", "--crs", "EPSG:99999"]);
    assert!(message.contains("no reference system"), "{message}");
}

#[test]
fn numbers_below_zero_are_values_of_flags() {
    let bench = bench("18-nd-f.tif");
    for value in ["-3.4028234663852886e+38", "-3.4028235e38"] {
        bench.good(&["build", "a.tif", "-o", "a.iqt", "--nodata", value]);
        assert_eq!(bench.json(&["info", "a.iqt", "--json"])["nodata_samples"], 25, "{value}");
    }
    bench.good(&["build", "a.tif", "-o", "a.iqt", "--nodata", "-3.4028235e38,-9999", "--z-scale", "-1"]);
    let info = bench.json(&["info", "a.iqt", "--json"]);
    assert!(info["height_range_m"][1].as_f64().unwrap() <= -100.0, "{info}");
    bench.good(&["verify", "a.iqt"]);
    bench.bad(2, &["build", "a.tif", "-o", "a.iqt", "--nodata", "none"]);
    bench.bad(2, &["build", "a.tif", "-o", "a.iqt", "--z-scale", "0"]);
    bench.bad(2, &["build", "a.tif", "-o", "a.iqt", "--resolution", "3"]);
}

#[test]
fn info_names_units_and_where_they_came_from() {
    let bench = bench("06-ftus-ftus-gdal.tif");
    bench.good(&["build", "a.tif", "-o", "a.iqt"]);
    let said = bench.good(&["info", "a.iqt"]);
    for words in [
        "NAD83(2011) / New Mexico Central (ftUS) (EPSG:6529)",
        "US survey foot (0.30480061 m)",
        "NAVD88 height (ftUS) (EPSG:6360)",
        "from key ProjectedCSType",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let info = bench.json(&["info", "a.iqt", "--json"]);
    assert_eq!(info["vertical_unit"], "US survey foot (0.30480061 m)");
    assert!(info["crs_wkt"].as_str().unwrap().starts_with("PROJCS["), "{info}");
}
