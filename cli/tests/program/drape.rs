//! Images draped by the real program: what it says, what info and verify say after it, two writers, kills.

use crate::support::{Bench, text};
use std::time::Duration;
use terrasoar_layout::testing::one_in;

fn with_picture() -> Bench {
    let bench = Bench::with_terrain();
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "8", "--seed", "2", "-o", "photo.tif"]);
    bench
}

#[test]
fn a_picture_is_made_draped_shown_and_verified() {
    let bench = with_picture();
    assert!(bench.json(&["info", "land.iqt", "--json"])["imagery"].is_null());
    let said = bench.good(&["drape", "land.iqt", "--image", "photo.tif"]);
    for words in ["1,024 x 1,024 texels of 2.5 x 2.5 m", "B of RGB/s", "3 levels", "bc1", "of raw RGB"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let info = bench.json(&["info", "land.iqt", "--json"]);
    assert_eq!(info["unused_bytes"], 0);
    let imagery = &info["imagery"];
    assert_eq!(imagery["texels"], serde_json::json!([1024, 1024]));
    assert_eq!(imagery["tiles"], 9 + 4 + 1);
    assert!(imagery["raw_ratio"].as_f64().unwrap() < 0.25);
    let shown = bench.good(&["info", "land.iqt"]);
    assert!(shown.contains("1,024 x 1,024 texels") && !shown.contains("unused"), "{shown}");
    assert!(bench.good(&["verify", "land.iqt"]).contains("14 tiles of imagery"));
    assert_eq!(bench.names(), ["land.iqt", "land.tif", "photo.tif"]);

    // Another picture takes the place of the first, whose space is told.
    bench.good(&[
        "drape",
        "land.iqt",
        "--image",
        "photo.tif",
        "--format",
        "raw",
        "--extent",
        "-10,0,500,400.5",
    ]);
    let info = bench.json(&["info", "land.iqt", "--json"]);
    assert_eq!(info["unused_bytes"], imagery["bytes"]);
    assert_eq!(info["imagery"]["origin_m"], serde_json::json!([-10.0, 0.0]));
    assert_eq!(info["generation"], 3);
    assert!(bench.good(&["info", "land.iqt"]).contains("that nothing leads to"));
    bench.good(&["verify", "land.iqt"]);
}

#[test]
fn the_same_picture_gives_the_same_bytes() {
    let bench = with_picture();
    let mut files = Vec::new();
    for (threads, memory) in [("1", "64"), ("2", "512"), ("3", "64")] {
        std::fs::copy(bench.path("land.iqt"), bench.path("a.iqt")).unwrap();
        bench.good(&["drape", "a.iqt", "--image", "photo.tif", "--threads", threads, "--memory", memory]);
        files.push(std::fs::read(bench.path("a.iqt")).unwrap());
    }
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn refusals_change_nothing_and_say_what_to_do() {
    let bench = with_picture();
    let before = std::fs::read(bench.path("land.iqt")).unwrap();
    for (args, code, words) in [
        (&["drape", "land.iqt", "--image", "land.iqt"][..], 1, "or TIFF; if GDAL knows it"),
        (&["drape", "land.tif", "--image", "photo.tif"], 1, "terrasoar build"),
        (
            &["drape", "land.iqt", "--image", "photo.tif", "--extent", "1,2,3"],
            2,
            "west, south, east and north",
        ),
        (&["drape", "land.iqt", "--image", "photo.tif", "--extent", "9e6,0,9.1e6,1"], 1, "do not meet"),
        (&["drape", "land.iqt", "--image", "photo.tif", "photo.tif", "--extent", "0,0,1,1"], 1, "one image"),
        (&["drape", "land.iqt"], 2, "--image"),
        (&["synth", "--colour", "land.iqt", "-o", "x.png"], 2, ".tif"),
        (&["synth", "--colour", "land.iqt", "--size", "129", "-o", "x.tif"], 2, "--size"),
        (&["synth", "-o", "x.tif"], 2, "--size"),
    ] {
        let output = bench.run(args);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", text(&output.stderr));
        assert!(text(&output.stderr).contains(words), "{words}: {}", text(&output.stderr));
    }
    assert!(std::fs::read(bench.path("land.iqt")).unwrap() == before);
    // A picture that says nothing about its place is laid over everything, aloud.
    let fixture = concat!(env!("CARGO_MANIFEST_DIR"), "/../import/tests/image_fixtures/baseline.jpg");
    let output = bench.run(&["drape", "land.iqt", "--image", fixture]);
    assert!(output.status.success() && text(&output.stderr).contains("laid over the whole terrain"));
}

/// Killed after more and more time, until it gets through: before it does, the file is as it was.
#[test]
fn a_killed_drape_leaves_the_terrain_as_it_was() {
    let bench = Bench::with_terrain();
    bench.good(&["synth", "--colour", "land.iqt", "--texels", "16", "-o", "photo.tif"]);
    let heights = |bench: &Bench| bench.good(&["height", "land.iqt", "--at", "1000,1000"]);
    let before = heights(&bench);
    let mut kills = 0;
    for wait_ms in one_in(4, 1..).map(|i| i * 5) {
        let mut child =
            bench.command(&["drape", "land.iqt", "--image", "photo.tif", "--threads", "1"]).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        let is_done = child.try_wait().unwrap().is_some();
        let _ = child.kill();
        let status = child.wait().unwrap();
        assert_eq!(heights(&bench), before);
        let imagery = &bench.json(&["info", "land.iqt", "--json"])["imagery"];
        if is_done {
            assert!(status.success() && imagery["tiles"] == 25 + 9 + 4 + 1, "{imagery}");
            break;
        }
        kills += 1;
    }
    assert!(kills > 0);
    bench.good(&["verify", "land.iqt"]);
    // A killed writer's lock ended with it.
    assert_eq!(bench.names(), ["land.iqt", "land.tif", "photo.tif"]);
}

#[test]
fn a_second_writer_is_told() {
    let bench = with_picture();
    let writer = terrasoar_layout::edit::EditSession::open(&bench.path("land.iqt")).unwrap();
    let output = bench.run(&["drape", "land.iqt", "--image", "photo.tif"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("another program is writing"), "{}", text(&output.stderr));
    drop(writer);
    bench.good(&["drape", "land.iqt", "--image", "photo.tif"]);
}

/// A terrain in UTM and pictures of it in degrees: one that lies elsewhere is refused in its own system, one that reaches beyond is told.
#[test]
fn where_a_picture_lies_is_told() {
    use terrasoar_layout::build::{BuildOptions, build};
    use terrasoar_layout::dem::{MemoryDem, SampleType};
    let bench = Bench::new();
    let mut dem = MemoryDem::from_fn([101, 101], SampleType::I16, |x, _| f64::from(x));
    dem.info_mut().georeference.pixel_to_crs = Some([563_000.0, 30.0, 0.0, 3_303_000.0, 0.0, -30.0]);
    dem.info_mut().georeference.epsg = Some(32644);
    build(&dem, &bench.path("land.iqt"), &BuildOptions::default(), &terrasoar_layout::progress::Silent)
        .unwrap();
    let bounds = bench.json(&["info", "land.iqt", "--json"])["bounds_wgs84"].clone();
    let [west, south, east, north] = [0, 1, 2, 3].map(|i| bounds[i].as_f64().unwrap());
    let picture = |name: &str, [w, s, e, n]: [f64; 4]| {
        image::RgbImage::from_pixel(64, 64, image::Rgb([200, 100, 50])).save(bench.path(name)).unwrap();
        let [dx, dy] = [(e - w) / 64.0, (n - s) / 64.0];
        let world = format!("{dx}\n0\n0\n{}\n{}\n{}\n", -dy, w + 0.5 * dx, n - 0.5 * dy);
        std::fs::write(bench.path(name).with_extension("pgw"), world).unwrap();
        let wgs84 = r#"GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]"#;
        std::fs::write(bench.path(name).with_extension("prj"), wgs84).unwrap();
    };
    picture("off.png", [west - 1.0, south, east - 1.0, north]);
    let said = bench.bad(1, &["drape", "land.iqt", "--image", "off.png"]);
    assert!(said.contains("they do not meet") && said.contains("(EPSG:4326)"), "{said}");
    assert!(!said.contains("gdalwarp") && said.contains("and the terrain from 81.6"), "{said}");
    let middle = 0.5 * (west + east);
    picture("half.png", [middle, south, 2.0 * east - middle, north]);
    let output = bench.run(&["drape", "land.iqt", "--image", "half.png"]);
    let (out, said) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success() && said.contains("what lies outside is left out"), "{said}");
    assert!(out.contains("covers 5644") && out.contains("% of the terrain"), "{out}");
    let share: f64 = out.split(", ").find_map(|word| word.split_once(" % of")?.0.parse().ok()).unwrap();
    assert!((48.0..53.0).contains(&share), "{out}");
    assert!(bench.good(&["info", "land.iqt"]).contains("% of the terrain"));
}
