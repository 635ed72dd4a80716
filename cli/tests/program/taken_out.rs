//! Ground taken out again: export, mesh without a flight, compare-ground; each against what the others say, and against what makes no sense.

use crate::edit::write as write_script;
use crate::support::{Bench, fields, text};
use std::fs;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;

/// 200 x 150 samples 10 m apart from 500000,4998510 in UTM: hills in decimetres, with voids.
fn hills(bench: &Bench, name: &str) {
    let mut dem = MemoryDem::from_fn([200, 150], SampleType::I16, |x, y| {
        let is_void = (30..50).contains(&x) && (60..80).contains(&y);
        let height = 5000.0 + 900.0 * (f64::from(x) / 23.0).sin() * (f64::from(y) / 17.0).cos();
        if is_void { f64::NAN } else { height.round() }
    });
    let info = dem.info_mut();
    info.height_scale = 0.1;
    info.georeference.epsg = Some(32632);
    info.georeference.pixel_to_crs = Some([500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0]);
    build(&dem, &bench.path(name), &BuildOptions::default(), &Silent).unwrap();
}

fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn edits_come_out_and_back_without_a_difference() {
    let bench = Bench::new();
    hills(&bench, "hills.iqt");
    write_script(
        &bench,
        "a.edits",
        "raise at 900,900 radius 200 by 10\n\ncrater at 600,400 radius 90 depth 5\n",
    );
    bench.good(&["edit", "hills.iqt", "--script", "a.edits", "--overlay", "a.iqo"]);
    let said = bench.good(&["export", "hills.iqt", "--overlay", "a.iqo", "-o", "edited.tif"]);
    assert!(said.contains("200 x 150 samples") && said.contains("400 of them without data"), "{said}");
    bench.good(&["build", "edited.tif", "-o", "back.iqt"]);
    let compared = bench.json(&["compare-ground", "back.iqt", "hills.iqt", "--overlay", "a.iqo", "--json"]);
    assert_eq!((&compared["changed_samples"], &compared["interpolated"]), (&0.into(), &false.into()));
    assert_eq!((&compared["compared_samples"], number(&compared["rms_m"])), (&29_600.into(), 0.0));
    assert!(
        bench
            .good(&["compare-ground", "back.iqt", "hills.iqt", "--overlay", "a.iqo"])
            .contains("difference     none\n")
    );

    // Elevation data may be compared as it is.
    let direct = bench.json(&["compare-ground", "edited.tif", "back.iqt", "--json"]);
    assert_eq!(direct["changed_samples"], 0);
    // The same file whatever the threads.
    let twice = bench
        .command(&["export", "back.iqt", "-o", "one.tif"])
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .unwrap();
    assert!(twice.status.success());
    bench.good(&["export", "back.iqt", "-o", "many.tif"]);
    assert!(fs::read(bench.path("one.tif")).unwrap() == fs::read(bench.path("many.tif")).unwrap());
}

/// A block of 5 x 3 samples set to a height over flat ground: volumes, extremes and outputs follow from arithmetic.
#[test]
fn what_edits_changed_is_told() {
    let bench = Bench::new();
    let mut dem = MemoryDem::from_fn([100, 80], SampleType::I16, |x, _| if x == 0 { 0.0 } else { 100.0 });
    dem.info_mut().georeference.pixel_to_crs = Some([500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0]);
    dem.info_mut().georeference.epsg = Some(32632);
    build(&dem, &bench.path("flat.iqt"), &BuildOptions::default(), &Silent).unwrap();
    let nothing = bench.bad(1, &["compare-ground", "flat.iqt"]);
    assert!(nothing.contains("flat.iqt") && nothing.contains("holds no edits"), "{nothing}");
    write_script(&bench, "a.edits", "set rect 20,30,24,32 to 90\n\nset rect 50,50,50,50 to 60\n");
    bench.good(&["edit", "flat.iqt", "--script", "a.edits", "--overlay", "a.iqo"]);
    let args = ["compare-ground", "flat.iqt", "--overlay", "a.iqo", "-o", "d.tif", "--picture", "d.png"];
    let told = bench.json(&[&args[..], &["--json"]].concat());
    assert_eq!(
        fields(&told),
        [
            "first",
            "second",
            "interpolated",
            "compared_samples",
            "changed_samples",
            "only_first_samples",
            "only_second_samples",
            "mean_m",
            "rms_m",
            "lowest",
            "highest",
            "cut_m3",
            "fill_m3",
            "net_m3",
            "changed_m2",
            "picture_samples",
            "picture_range_m"
        ]
        .iter()
        .copied()
        .collect::<std::collections::BTreeSet<_>>()
        .into_iter()
        .collect::<Vec<_>>()
    );
    assert_eq!((&told["changed_samples"], &told["compared_samples"]), (&16.into(), &8000.into()));
    let cut = 15.0 * 10.0 * 100.0 + 40.0 * 100.0;
    assert_eq!(
        [number(&told["cut_m3"]), number(&told["fill_m3"]), number(&told["net_m3"])],
        [cut, 0.0, -cut]
    );
    assert!((number(&told["mean_m"]) + cut / 100.0 / 8000.0).abs() < 1e-12);
    assert_eq!(told["lowest"]["sample"], serde_json::json!([50, 50]));
    assert_eq!(told["lowest"]["at_m"], serde_json::json!([500.0, 500.0]));
    assert_eq!(told["lowest"]["at"], serde_json::json!([500_500.0, 4_999_710.0]));
    assert_eq!(number(&told["lowest"]["difference_m"]), -40.0);
    assert_eq!(number(&told["highest"]["difference_m"]), 0.0);
    let picture = image::open(bench.path("d.png")).unwrap().to_rgb8();
    assert_eq!((picture.width(), picture.height()), (100, 80));
    // Rows from the north: the deepest red, a lighter one, and nothing.
    let at = |x: u32, y: u32| picture.get_pixel(x, 79 - y).0;
    assert_eq!([at(50, 50), at(60, 60)], [[0x67, 0, 0x1f], [0xf7; 3]]);
    assert!(at(22, 31)[0] > at(22, 31)[2] && at(22, 31) != at(50, 50));
    assert_eq!(fs::read(bench.path("d.tif")).unwrap()[..4], *b"II*\0");
    let d = bench.json(&["compare-ground", "d.tif", "d.tif", "--json"]);
    assert_eq!(d["compared_samples"], 8000);

    // Edits in the file are compared with what was there before them.
    bench.good(&["edit", "flat.iqt", "--script", "a.edits"]);
    let own = bench.json(&["compare-ground", "flat.iqt", "--json"]);
    assert_eq!((&own["cut_m3"], &own["changed_samples"]), (&told["cut_m3"], &told["changed_samples"]));
    let part = ["compare-ground", "flat.iqt", "--window", "49,49,60,60", "--crs", "samples", "--json"];
    assert_eq!(number(&bench.json(&part)["cut_m3"]), 4000.0);
    let human = bench.good(&["compare-ground", "flat.iqt"]);
    assert!(human.contains("cut            19000 m3\n") && human.contains("-40 m at 500,500 m"), "{human}");
}

#[test]
fn windows_in_every_system_hold_the_same_samples() {
    let bench = Bench::new();
    hills(&bench, "hills.iqt");
    let export = |window: &str, crs: &[&str], name: &str| {
        let window = format!("--window={window}");
        bench.good(&[&["export", "hills.iqt", &window, "-o", name][..], crs].concat());
        fs::read(bench.path(name)).unwrap()
    };
    let metres = export("200,300,900,800", &[], "a.tif");
    assert!(metres == export("20,30,90,80", &["--crs", "samples"], "b.tif"));
    assert!(metres == export("500200,4998810,500900,4999310", &["--crs", "dem"], "c.tif"));
    assert!(metres == export("500200,4998810,500900,4999310", &["--crs", "EPSG:32632"], "d.tif"));
    let step = bench.good(&["export", "hills.iqt", "--step", "8", "-o", "s.tif"]);
    assert!(step.contains("25 x 19 samples 80 x 80 m apart"), "{step}");
    // A window partly beyond is told, and what lies in both is taken.
    let output = bench.run(&["export", "hills.iqt", "--window", "-500,-500,100,100", "-o", "e.tif"]);
    assert!(
        text(&output.stderr).contains(
            "note: the window reaches beyond the terrain, which extends from 0,0 to 1990,1490 metres"
        )
    );
    assert!(text(&output.stdout).contains("11 x 11 samples"), "{}", text(&output.stdout));
    for (window, crs, words) in [
        ("5000,0,6000,100", None, "lies outside the terrain, which extends from 0,0 to 1990,1490 metres"),
        (
            "300,0,400,9",
            Some("samples"),
            "lies outside the terrain, which extends from 0,0 to 199,149 samples",
        ),
        ("0,0,1,1", Some("dem"), "which extends from 500000,4998510 to 501990,5000000 in"),
        ("100,10,101,11", Some("EPSG:4326"), "lies outside the terrain, which extends from 9,45.1"),
        ("12,12,18,18", None, "there are 0 x 0 samples in it, and at least 2 x 2 are needed"),
        ("0,0,9,9", Some("EPSG:1"), "no reference system that is known here"),
    ] {
        let mut args = vec!["export", "hills.iqt", "--window", window, "-o", "x.tif"];
        args.extend(crs.iter().flat_map(|crs| ["--crs", *crs]));
        let message = bench.bad(1, &args);
        assert!(message.contains("hills.iqt") && message.contains(words), "{args:?}: {message}");
    }
    assert!(!bench.path("x.tif").exists());
}

#[test]
fn meshes_without_a_flight_are_written_in_every_format() {
    let bench = Bench::new();
    hills(&bench, "hills.iqt");
    let count = |said: &str| {
        let words = said.split(": ").nth(1).unwrap().split(' ').next().unwrap();
        words.replace(',', "").parse::<usize>().unwrap()
    };
    let mesh = |name: &str, more: &[&str]| {
        bench.good(&[&["mesh", "hills.iqt", "--max-error", "1.5", "-o", name], more].concat())
    };
    let triangles = count(&mesh("m.ply", &[]));
    assert!((500..30_000).contains(&triangles), "{triangles}");
    for (name, more) in [
        ("m.obj", &[][..]),
        ("m.stl", &[]),
        ("m.glb", &[]),
        ("m.bin", &["--format", "stl"]),
        ("t.ply", &["--ascii"]),
    ] {
        assert_eq!(count(&mesh(name, more)), triangles, "{name}");
    }
    let read = |name: &str| fs::read(bench.path(name)).unwrap();
    assert_eq!(read("m.stl").len(), 84 + 50 * triangles);
    assert!(read("m.bin") == read("m.stl"));
    assert!(read("m.glb").starts_with(b"glTF"));
    assert_eq!(text(&read("m.obj")).lines().filter(|line| line.starts_with("f ")).count(), triangles);
    let fewer = count(&bench.good(&["mesh", "hills.iqt", "--max-error", "20", "-o", "few.ply"]));
    assert!(fewer < triangles / 2, "{fewer} of {triangles}");

    // Coordinates of the elevation model: whole in PLY and OBJ, less an origin in the others.
    mesh("dem.obj", &["--coordinates", "dem", "--window", "0,0,500,500"]);
    let obj = text(&read("dem.obj"));
    assert!(obj.starts_with("# terrain in the coordinates of its elevation model\n"), "{obj:.200}");
    let first = obj.lines().find(|line| line.starts_with("v ")).unwrap();
    let x: f64 = first.split(' ').nth(1).unwrap().parse().unwrap();
    assert!((500_000.0..=500_500.0).contains(&x), "{first}");
    let output =
        bench.run(&["mesh", "hills.iqt", "--max-error", "3", "--coordinates", "dem", "-o", "dem.glb"]);
    assert!(
        text(&output.stderr).contains("the file holds them less 500000,4998510; its node adds it again"),
        "{}",
        text(&output.stderr)
    );

    let many =
        bench.bad(1, &["mesh", "hills.iqt", "--max-error", "0", "--max-triangles", "99", "-o", "x.ply"]);
    assert!(many.contains("more than 99 triangles"), "{many}");
    let void = bench.bad(
        1,
        &[
            "mesh",
            "hills.iqt",
            "--max-error",
            "1",
            "--window",
            "31,61,48,78",
            "--crs",
            "samples",
            "-o",
            "x.ply",
        ],
    );
    assert!(void.contains("no three samples beside each other have heights"), "{void}");
    assert!(!bench.path("x.ply").exists());
}

#[test]
fn inputs_are_never_replaced_and_what_is_unplaced_is_said() {
    let bench = Bench::with_terrain();
    fs::copy(bench.path("land.iqt"), bench.path("land2.tif")).unwrap();
    fs::copy(bench.path("land.iqt"), bench.path("land2.ply")).unwrap();
    for args in [
        &["export", "land2.tif", "-o", "land2.tif", "--force"][..],
        &["mesh", "land2.ply", "--max-error", "1", "-o", "land2.ply", "--force"],
        &["compare-ground", "land.iqt", "land2.tif", "-o", "land2.tif", "--force"],
    ] {
        let message = bench.bad(1, args);
        assert!(message.contains("the output is the input"), "{args:?}: {message}");
    }
    let dem = MemoryDem::from_fn([65, 65], SampleType::I16, |x, y| f64::from(x * y % 13));
    build(&dem, &bench.path("nowhere.iqt"), &BuildOptions::default(), &Silent).unwrap();
    let refused =
        bench.bad(1, &["mesh", "nowhere.iqt", "--max-error", "1", "--coordinates", "dem", "-o", "x.ply"]);
    assert!(refused.contains("does not know where on the ground it lies"), "{refused}");
    let refused = bench.bad(1, &["compare-ground", "land.iqt", "nowhere.iqt"]);
    assert!(refused.contains("nowhere.iqt") && refused.contains("different samples"), "{refused}");
    let output = bench.run(&["export", "nowhere.iqt", "-o", "local.tif"]);
    assert!(text(&output.stderr).contains("the file is in metres from its south-west sample"));
    bench.good(&["build", "local.tif", "-o", "local.iqt"]);
    assert_eq!(bench.json(&["compare-ground", "local.iqt", "nowhere.iqt", "--json"])["changed_samples"], 0);
}
