//! Places of the ground in every system: height, info, and what meshes say; against arithmetic always, against GDAL where that is asked for.

use crate::support::{Bench, text};
use serde_json::json;
use std::io::Write;
use std::process::{Command, Stdio};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemSource, Georeference, HorizontalUnit, MemoryDem, SampleType, UnitOf};
use terrasoar_layout::progress::Silent;

/// `utm.iqt`: 101 x 51 samples 10 x 20 m apart from 500000,5000000 on in EPSG:32632, height 2 x + 3 y in samples, with a void square.
fn utm(bench: &Bench) {
    let mut dem = MemoryDem::from_fn([101, 51], SampleType::F32, |x, y| {
        if (40..45).contains(&x) && (20..25).contains(&y) { f64::NAN } else { f64::from(2 * x + 3 * y) }
    });
    let info = dem.info_mut();
    info.georeference = Georeference {
        epsg: Some(32632),
        crs_name: "WGS 84 / UTM zone 32N".into(),
        unit: HorizontalUnit::Metre,
        pixel_to_crs: Some([500_000.0, 10.0, 0.0, 5_001_000.0, 0.0, -20.0]),
        ..Georeference::default()
    };
    info.about.vertical_name = "EGM96 height".into();
    info.about.vertical_epsg = Some(5773);
    info.about.vertical_unit = Some(UnitOf { name: "metre".into(), size: 1.0, is_angle: false });
    make(bench, &dem, "utm.iqt");
}

fn make(bench: &Bench, dem: &dyn DemSource, name: &str) {
    build(dem, &bench.path(name), &BuildOptions::default(), &Silent).unwrap();
}

fn feed(bench: &Bench, args: &[&str], input: &str) -> (Option<i32>, String, String) {
    let mut command = bench.command(args);
    let mut child =
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (mut stdin, input) = (child.stdin.take().unwrap(), input.to_owned());
    // A program that refuses its input stops listening.
    let writer = std::thread::spawn(move || stdin.write_all(input.as_bytes()));
    let output = child.wait_with_output().unwrap();
    let _ = writer.join().unwrap();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn a_height_is_asked_for_in_any_system() {
    let bench = Bench::new();
    utm(&bench);
    for (at, crs) in [
        ("70,400", None),
        ("500070,5000400", Some("dem")),
        ("500070,5000400", Some("EPSG:32632")),
        ("500.070,5000.400", Some("+proj=utm +zone=32 +datum=WGS84 +units=km")),
        // By gdaltransform (PROJ 9.1), as are those below.
        ("9.000890589,45.157077852", Some("EPSG:4326")),
        ("-350.999109411,45.157077852", Some("EPSG:4326")),
    ] {
        let mut args = vec!["height", "utm.iqt", "--json", "--at", at];
        args.extend(crs.map(|crs| ["--crs", crs]).iter().flatten());
        let answer = bench.json(&args);
        let height_m = answer["height_m"].as_f64().unwrap();
        assert!((height_m - 74.0).abs() < 2e-3, "{at} in {crs:?}: {answer}");
        assert!((answer["at_m"][0].as_f64().unwrap() - 70.0).abs() < 2e-3, "{answer}");
        assert_eq!(answer["crs"].is_null(), crs.is_none(), "{answer}");
    }
    for (at, crs, words) in [
        ("499999,5000000", "dem", "500000,5000000 to 501000,5001000 in WGS 84 / UTM zone 32N"),
        ("9,45", "EPSG:4326", "from 9,45.1534"),
        ("9,95", "EPSG:4326", "lies outside"),
        ("1,1", "EPSG:1", "\"EPSG:1\" is no reference system"),
        ("1,1", "local", "no place on the ground"),
        ("1,1", "+proj=longlat +R=1737400", "another body"),
    ] {
        let message = bench.bad(1, &["height", "utm.iqt", "--at", at, "--crs", crs]);
        assert!(message.contains(words), "{at} in {crs}: {message}");
    }
    make(&bench, &MemoryDem::from_fn([9, 9], SampleType::I16, |_, _| 1.0), "nowhere.iqt");
    for crs in ["dem", "EPSG:4326"] {
        let message = bench.bad(1, &["height", "nowhere.iqt", "--at", "1,1", "--crs", crs]);
        assert!(message.contains("does not know where"), "{message}");
    }
    bench.bad(2, &["height", "utm.iqt"]);
    bench.bad(2, &["height", "utm.iqt", "--at", "1,1", "--points", "-"]);
}

#[test]
fn a_table_gets_its_heights() {
    let bench = Bench::new();
    utm(&bench);
    for (input, crs, wanted) in [
        ("10,20\n0,1000\n", None, "10,20,5\n0,1000,150\n"),
        ("name;Y;X\n\"a;b\";20;10\nc;40,5;5\n", None, "name;Y;X;height_m\n\"a;b\";20;10;5\nc;40,5;5;7.075\n"),
        ("x\ty\r\n500010\t5000020\r\n", Some("dem"), "x\ty\theight_m\n500010\t5000020\t5\n"),
        ("  10   20\n 0 0\n", None, "10 20 5\n0 0 0\n"),
        ("lat,lon,id\n45.153477183356,9,1\n", None, "lat,lon,id,height_m\n45.153477183356,9,1,0\n"),
        ("", None, ""),
        ("x,y\n", None, "x,y,height_m\n"),
    ] {
        let mut args = vec!["height", "utm.iqt", "--points", "-"];
        args.extend(crs.map(|crs| ["--crs", crs]).iter().flatten());
        let (code, out, words) = feed(&bench, &args, input);
        assert_eq!((code, out.as_str(), words.as_str()), (Some(0), wanted, ""), "{input:?}");
    }
    std::fs::write(bench.path("p.csv"), "x,y\n10,20\n-1,0\n420,440\n1e9,1e9\n").unwrap();
    let output = bench.run(&["height", "utm.iqt", "--points", "p.csv"]);
    assert_eq!(text(&output.stdout), "x,y,height_m\n10,20,5\n-1,0,\n420,440,\n1e9,1e9,\n");
    let words = text(&output.stderr);
    assert!(output.status.success(), "{words}");
    assert!(words.contains("of 4 places 2 lie outside the terrain and 1 where it has no data"), "{words}");
    let (code, out, words) =
        feed(&bench, &["height", "utm.iqt", "--points", "-"], "x,y\n10,20\n7,abc\n1,1\n");
    assert_eq!((code, out.as_str()), (Some(1), "x,y,height_m\n10,20,5\n"));
    assert!(words.starts_with("error: standard input, line 3: `abc`"), "{words}");
    assert!(bench.bad(1, &["height", "utm.iqt", "--points", "none.csv"]).contains("none.csv"));
}

/// As many rows as two batches, each with the height of its place alone.
#[test]
fn a_long_table_is_answered_row_by_row() {
    let bench = Bench::new();
    utm(&bench);
    let mut input = String::new();
    let place = |i: u32| {
        let spread = |factor: u64, range: u64| (u64::from(i) * factor % range) as f64 * 0.01;
        [spread(7919, 39_000), spread(104_729, 38_000)]
    };
    for i in 0..1_100_000u32 {
        let [x, y] = place(i % 100_000);
        input.push_str(&format!("{x},{y}\n"));
    }
    let (code, out, words) = feed(&bench, &["height", "utm.iqt", "--points", "-"], &input);
    assert_eq!((code, words.as_str()), (Some(0), ""));
    let mut rows = 0;
    for (row, given) in out.lines().zip(input.lines()) {
        let (kept, height_m) = row.rsplit_once(',').unwrap();
        let [x, y] = place(rows % 100_000);
        assert_eq!(kept, given);
        assert!((height_m.parse::<f64>().unwrap() - (0.2 * x + 0.15 * y)).abs() < 1e-5, "{row}");
        rows += 1;
    }
    assert_eq!(rows, 1_100_000);
}

#[test]
fn info_tells_where_the_terrain_is() {
    let bench = Bench::new();
    utm(&bench);
    let info = bench.json(&["info", "utm.iqt", "--json"]);
    assert!(info["crs_wkt"].as_str().unwrap().contains("UTM zone 32N"), "{info}");
    assert_eq!(info["placement"]["words"], json!(["north-up"]));
    assert_eq!(info["placement"]["sample_to_crs"], info["sample_to_crs"]);
    assert_eq!(info["bounds"], json!([500_000.0, 5_000_000.0, 501_000.0, 5_001_000.0]));
    let wgs84: Vec<f64> =
        info["bounds_wgs84"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    // Of the corners, by gdaltransform.
    for (found, wanted) in wgs84.iter().zip([9.0, 45.153_476_5, 9.012_726, 45.162_478]) {
        assert!((found - wanted).abs() < 2e-5, "{wgs84:?}");
    }
    assert_eq!(info["vertical_epsg"], 5773);
    assert_eq!(info["warnings"], json!([]));
    let told = bench.good(&["info", "utm.iqt"]);
    assert!(told.contains("north-up") && told.contains("500000,5000000 to 501000,5001000"), "{told}");
    make(&bench, &MemoryDem::from_fn([9, 9], SampleType::I16, |_, _| 1.0), "nowhere.iqt");
    let info = bench.json(&["info", "nowhere.iqt", "--json"]);
    assert!(info["bounds"].is_null() && info["bounds_wgs84"].is_null() && info["crs_wkt"].is_null());
    assert_eq!(info["placement"]["words"], json!(["unknown"]));
}

#[test]
fn a_mesh_says_what_system_it_is_in() {
    let bench = Bench::new();
    utm(&bench);
    bench.good(&["flight", "orbit", "utm.iqt", "-o", "f", "--frames", "2", "--speed", "10"]);
    let lines = [
        "Reference system: WGS 84 / UTM zone 32N (EPSG:32632)",
        "Coordinates: x = 500000 + 1 * east; y = 5000000 + 1 * north",
        "Heights: metres, EGM96 height (EPSG:5773)",
    ];
    for (name, prefix) in [("m.obj", "# "), ("m.ply", "comment ")] {
        for _ in 0..2 {
            // The second time it replaces the first.
            bench.good(&["mesh", "utm.iqt", "--flight", "f", "--frame", "0", "-o", name]);
        }
        let bytes = std::fs::read(bench.path(name)).unwrap();
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(2000)]).into_owned();
        for line in lines {
            assert!(start.contains(&format!("\n{prefix}{line}\n")), "{start}");
        }
    }
}

/// Random places of several systems, by gdaltransform into the terrain's own and by arithmetic from there.
#[test]
#[ignore = "needs gdaltransform"]
fn heights_are_where_gdal_says() {
    let bench = Bench::new();
    utm(&bench);
    let own: Vec<[f64; 2]> = (0..200u32)
        .map(|i| {
            [
                500_000.0 + f64::from(i * 7919 % 39_000) * 0.01,
                5_000_000.0 + f64::from(i * 104_729 % 38_000) * 0.01,
            ]
        })
        .collect();
    for crs in ["EPSG:4326", "EPSG:3857", "EPSG:3035", "EPSG:25833", "EPSG:2154"] {
        let mut child = Command::new("gdaltransform")
            .args(["-s_srs", "EPSG:32632", "-t_srs", crs, "-output_xy"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("gdaltransform is needed: install gdal-bin");
        let asked: String = own.iter().map(|[x, y]| format!("{x} {y}\n")).collect();
        child.stdin.take().unwrap().write_all(asked.as_bytes()).unwrap();
        let table = text(&child.wait_with_output().unwrap().stdout);
        let (code, out, words) = feed(&bench, &["height", "utm.iqt", "--points", "-", "--crs", crs], &table);
        assert_eq!((code, words.as_str()), (Some(0), ""), "{crs}");
        for (row, [x, y]) in out.lines().zip(&own) {
            let height_m: f64 = row.rsplit_once(' ').unwrap().1.parse().unwrap();
            let wanted = 0.2 * (x - 500_000.0) + 0.15 * (y - 5_000_000.0);
            assert!((height_m - wanted).abs() < 1e-4, "{crs}: {row}, {wanted} m");
        }
        assert_eq!(out.lines().count(), own.len());
    }
}

/// `wide.iqt`: 1001 x 801 samples 30 m apart from 563000,3300000 on in EPSG:32644, so 30 x 24 km; height is the sample's column.
fn wide(bench: &Bench) {
    let mut dem = MemoryDem::from_fn([1001, 801], SampleType::I16, |x, _| f64::from(x));
    dem.info_mut().georeference = Georeference {
        epsg: Some(32644),
        crs_name: "WGS 84 / UTM zone 44N".into(),
        unit: HorizontalUnit::Metre,
        pixel_to_crs: Some([563_000.0, 30.0, 0.0, 3_324_000.0, 0.0, -30.0]),
        ..Georeference::default()
    };
    make(bench, &dem, "wide.iqt");
}

/// 81.75,29.9 by `gdaltransform -s_srs EPSG:4326 -t_srs EPSG:32644` is 572409.2,3307940.9.
const LON_LAT: &str = "81.75,29.9";

#[test]
fn degrees_read_as_metres_are_told() {
    let bench = Bench::new();
    wide(&bench);
    let at = |place: &str, more: &[&str]| {
        let output = bench.run(&[&["height", "wide.iqt", "--at", place][..], more].concat());
        (text(&output.stdout), text(&output.stderr))
    };
    for (place, flag) in [
        (LON_LAT, "--crs EPSG:4326) it lies inside too"),
        ("29.9,81.75", "swapped"),
        ("7.65861,45.97634", "it looks like degrees; type --crs EPSG:4326"),
    ] {
        let (out, words) = at(place, &[]);
        assert!(out.ends_with(" m\n") && words.starts_with("note: the place was read as metres"), "{words}");
        assert!(words.contains(flag), "{place}: {words}");
    }
    for place in ["9428.43,7914.87", "50,60", "100,29000"] {
        assert!(!at(place, &[]).1.contains("note"), "{place}");
    }
    let (out, words) = at(LON_LAT, &["--crs", "EPSG:4326"]);
    assert_eq!((out.as_str(), words.as_str()), ("313.641 m\n", ""));
    assert_eq!(bench.json(&["height", "wide.iqt", "--at", LON_LAT, "--json"])["likely_crs"], "EPSG:4326");
    assert!(bench.json(&["height", "wide.iqt", "--at", "5,5", "--json"])["likely_crs"].is_null());

    let table = "name,X,Y\nhut,81.75,29.9\ncol,81.8,29.95\n";
    let (code, out, words) = feed(&bench, &["height", "wide.iqt", "--points", "-"], table);
    assert_eq!((code, out.lines().count()), (Some(0), 3));
    assert!(words.contains("note: the places were read as metres"), "{words}");
    assert!(words.contains("(--crs EPSG:4326) they lie inside too"), "{words}");
    let table = "10,20\n1000,2000\n";
    assert_eq!(feed(&bench, &["height", "wide.iqt", "--points", "-"], table).2, "");
}

#[test]
fn places_outside_are_tried_in_other_systems() {
    let bench = Bench::new();
    wide(&bench);
    for (place, crs, words) in [
        ("572428,3307915", None, "; in the elevation model's coordinates (--crs dem) it would lie inside"),
        ("3307915,572428", None, "(--crs dem), with the two numbers swapped"),
        ("29.9,81.75", Some("EPSG:4326"), "; with the two numbers swapped"),
        (LON_LAT, Some("dem"), "(--crs EPSG:4326) it would lie inside"),
        ("5000,5000", Some("dem"), "in metres from the terrain's south-west sample (without --crs)"),
    ] {
        let mut args = vec!["height", "wide.iqt", "--at", place];
        args.extend(crs.map(|crs| ["--crs", crs]).iter().flatten());
        let said = bench.bad(1, &args);
        assert!(said.contains(words) && said.contains("which extends from"), "{place} in {crs:?}: {said}");
        let table = format!("hut;x;y\na;{0}\nb;{0}\n", place.replace(',', ";"));
        let mut args = vec!["height", "wide.iqt", "--points", "-"];
        args.extend(crs.map(|crs| ["--crs", crs]).iter().flatten());
        let (code, _, said) = feed(&bench, &args, &table);
        assert!(code == Some(0) && said.contains("of 2 places 2 lie outside"), "{said}");
        assert!(said.contains(&words.replace("it would", "they would")), "{place} in {crs:?}: {said}");
    }
    let far = bench.bad(1, &["height", "wide.iqt", "--at", "9e7,9e7"]);
    assert!(!far.contains("would lie inside"), "{far}");
    for (window, words) in [
        ("81.7,29.85,81.8,29.95", "samples in it, and at least 2 x 2 are needed"),
        ("81.7,29.85,81.8,29.95", "(--crs EPSG:4326) it would lie inside"),
        ("570000,3305000,575000,3310000", "(--crs dem) it would lie inside"),
    ] {
        let said = bench.bad(1, &["export", "wide.iqt", "--window", window, "-o", "a.tif"]);
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn tables_without_names_of_columns_and_tables_to_files() {
    let bench = Bench::new();
    utm(&bench);
    let points = ["height", "utm.iqt", "--points", "-"];
    let (code, out, said) = feed(&bench, &points, "hut1,10,20\nhut2,11,21\n");
    assert_eq!((code, out.as_str()), (Some(1), ""));
    assert!(said.contains("line 1") && said.contains("`hut1`") && said.contains("name,lon,lat"), "{said}");
    let to_file = [&points[..], &["-o", "t.csv"]].concat();
    for _ in 0..2 {
        // The second time it replaces its own.
        let (code, out, said) = feed(&bench, &to_file, "x,y\n10,20\n");
        assert_eq!((code, out.as_str(), said.as_str()), (Some(0), "", ""));
        assert_eq!(std::fs::read_to_string(bench.path("t.csv")).unwrap(), "x,y,height_m\n10,20,5\n");
    }
    // A wrong row leaves what was there.
    let (code, _, said) = feed(&bench, &to_file, "x,y\n0,20\n7,abc\n");
    assert!(code == Some(1) && said.contains("no table was written") && said.contains("line 3"), "{said}");
    assert_eq!(std::fs::read_to_string(bench.path("t.csv")).unwrap(), "x,y,height_m\n10,20,5\n");
    std::fs::write(bench.path("mine.csv"), "x,y\n1,2\n").unwrap();
    let points = ["height", "utm.iqt", "--points", "mine.csv", "-o"];
    assert!(bench.bad(1, &[&points[..], &["mine.csv"]].concat()).contains("the output is the input"));
    std::fs::write(bench.path("theirs.csv"), "a,b\n1,2\n").unwrap();
    assert!(bench.bad(1, &[&points[..], &["theirs.csv"]].concat()).contains("--force"));
    let said = bench.bad(1, &[&points[..], &["none/a.csv"]].concat());
    assert!(said.contains("the folder none does not exist"), "{said}");
    let said = bench.bad(1, &["export", "utm.iqt", "-o", "none/a.tif"]);
    assert!(said.contains("the folder none does not exist"), "{said}");
    assert!(bench.bad(2, &["height", "utm.iqt"]).contains("--points"));
    let said = bench.bad(2, &["height", "utm.iqt", "--at", "10", "20"]);
    assert!(said.contains("joined by commas") || said.contains("two numbers"), "{said}");
    let said = bench.bad(2, &["height", "utm.iqt", "--at", "10,", "20"]);
    assert!(said.contains("commas") || said.contains("number"), "{said}");
    let said = bench.bad(2, &["height", "utm.iqt", "--at", "10,20", "--window", "1,2,3,4"]);
    assert!(said.contains("--window") && !said.contains("as a value"), "{said}");
}
