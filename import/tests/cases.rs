//! Files that are easily misread, each with its true heights and distances: fixtures/cases. All true values are arithmetic: 41 x 31 samples, height = 100 + 3 east + 7 north of
//! the south-west sample, in the file's own unit.

mod cases_support;

use cases_support::{Built, built, case, refused};
use terrasoar_import::OpenOptions;
use terrasoar_import::export::{Numbers, export_heights};
use terrasoar_layout::Remedy;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::window::SampleWindow;

const US_FOOT_M: f64 = 1200.0 / 3937.0;

fn plain(name: &str) -> Built {
    built(&case(name), &OpenOptions::default(), None).unwrap()
}

fn spacing_is(name: &str, metres: [f64; 2]) {
    let found = plain(name).spacing_m();
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 5e-4;
    assert!(near(found[0], metres[0]) && near(found[1], metres[1]), "{name}: {found:?}, {metres:?} wanted");
}

/// The plane at some samples, a raw unit being so many metres.
fn plane_is(name: &str, unit_m: f64) {
    let built = plain(name);
    for [x, y] in [[0, 0], [40, 0], [0, 30], [40, 30], [13, 7]] {
        let wanted = unit_m * (100.0 + 3.0 * f64::from(x) + 7.0 * f64::from(y));
        let found = built.height_m([x, y]).unwrap();
        assert!(
            (found - wanted).abs() <= 1e-4 * wanted.abs(),
            "{name} at {x}, {y}: {found}, {wanted} wanted"
        );
    }
}

#[test]
fn rows_from_the_south_lie_where_they_belong() {
    for name in ["01-northup.tif", "01-southup.tif"] {
        plane_is(name, 1.0);
        spacing_is(name, [10.0, 10.0]);
    }
    let [north_up, south_up] = ["01-northup.tif", "01-southup.tif"].map(plain);
    assert_eq!(north_up.terrain.header().sample_to_crs, south_up.terrain.header().sample_to_crs);
}

#[test]
fn a_turned_grid_is_north_up_and_says_so() {
    let built = plain("02-rotated.tif");
    assert!(
        built.warnings.iter().any(|w| w.words.contains("turned by 30.00 degrees")),
        "{:?}",
        built.warnings
    );
    let header = built.terrain.header();
    let map = header.sample_to_crs.unwrap();
    assert!(map[2].abs() < 1e-9 && map[4].abs() < 1e-9 && map[1] > 0.0 && map[5] > 0.0, "{map:?}");
    let (sin, cos) = 30f64.to_radians().sin_cos();
    let (mut seen, mut voids) = (0, 0);
    for y in 0..header.grid.samples()[1] {
        for x in 0..header.grid.samples()[0] {
            let (cx, cy) =
                (map[0] + map[1] * f64::from(x) - 500_000.0, map[3] + map[5] * f64::from(y) - 5_000_310.0);
            // Column and row of the file, from the corner of its first sample.
            let (col, row) = ((cos * cx + sin * cy) / 10.0 - 0.5, (sin * cx - cos * cy) / 10.0 - 0.5);
            let Some(height) = built.height_m([x, y]) else {
                voids += 1;
                assert!(!(0.5..39.5).contains(&col) || !(0.5..29.5).contains(&row), "void at {col}, {row}");
                continue;
            };
            if (0.0..=40.0).contains(&col) && (0.0..=30.0).contains(&row) {
                let wanted = 100.0 + 3.0 * col + 7.0 * (30.0 - row);
                assert!((height - wanted).abs() < 0.01, "{height} at {col}, {row}: {wanted}");
                seen += 1;
            }
        }
    }
    assert!(seen > 1100 && voids > 500, "{seen} {voids}");
    // 200 m north of the file's south-west sample: 100 + 30 + 7 * 17.32.
    let south_west =
        [500_000.0 + 10.0 * (0.5 * cos + 30.5 * sin), 5_000_310.0 + 10.0 * (0.5 * sin - 30.5 * cos)];
    let at = [(south_west[0] - map[0]) / map[1], (south_west[1] + 200.0 - map[3]) / map[5]];
    assert!((built.between(at) - 251.24).abs() < 0.05, "{}", built.between(at));
}

#[test]
fn units_of_coordinates_come_from_codes_keys_and_sizes() {
    let foot = [10.0 * US_FOOT_M; 2];
    for name in ["03-ftus-code-only.tif", "03-ftus-gdal.tif", "04-user-unit-ft.tif", "06-ftus-ftus-gdal.tif"]
    {
        spacing_is(name, foot);
    }
    for name in ["32-compound-0.tif", "32-compound-1.tif", "32-compound-5.tif"] {
        spacing_is(name, foot);
    }
    spacing_is("05-km.tif", [30.0; 2]);
    spacing_is("33-unit-0.tif", [3.047_972_654; 2]);
    spacing_is("33-unit-2.tif", [201.167_56; 2]);
    for name in ["11-local-1cm.tif", "11-local-1cm-gdal.tif", "11-local-1cm-localcs.tif"] {
        spacing_is(name, [0.01; 2]);
    }
    spacing_is("13-tfw.tif", [10.0; 2]);
    spacing_is("15-arcsec.tif", [21.9003, 30.87]);
    spacing_is("15-grads.tif", [70.983, 100.017]);
}

#[test]
fn mercator_is_as_long_as_the_ground() {
    // 20 cos 60, times the radii of the ellipsoid there over that of the map's sphere, which differ east and north.
    spacing_is("08-3857-60n.tif", [10.025_199, 10.008_336]);
    let said = plain("08-3857-60n.tif").terrain.header().about.origins.clone();
    assert!(
        said.iter().any(|(what, words)| what == "spacing" && words.contains("20.0000 x 20.0000")),
        "{said:?}"
    );
}

#[test]
fn units_of_heights_come_from_bands_and_vertical_systems() {
    plane_is("06-ftus-ftus-gdal.tif", US_FOOT_M);
    plane_is("06-vert-6360-gdal.tif", US_FOOT_M);
    plane_is("06-vert-6360-nounit.tif", US_FOOT_M);
    plane_is("06-vert-8228-nounit.tif", 0.3048);
    plane_is("07-unit-11.tif", 0.3048);
    plane_is("07-unit-13.tif", 0.001);
    for name in ["32-compound-0.tif", "32-compound-1.tif", "32-compound-5.tif"] {
        plane_is(name, US_FOOT_M);
    }
    plane_is("32-compound-6.tif", 1.0);
    plane_is("03-ftus-gdal.tif", 1.0);
    let warned = plain("03-ftus-gdal.tif").warnings;
    assert!(warned.iter().any(|w| w.mended_by == Some((Remedy::HeightUnit, "ftUS".into()))), "{warned:?}");
    let about = plain("06-ftus-ftus-gdal.tif").terrain.header().about.clone();
    assert_eq!((about.vertical_name.as_str(), about.vertical_epsg), ("NAVD88 height (ftUS)", Some(6360)));
    assert!(
        about.crs_text.starts_with("PROJCS[\"NAD83(2011) / New Mexico Central (ftUS)\""),
        "{}",
        about.crs_text
    );
    assert_eq!(about.horizontal_unit.unwrap().name, "US survey foot");
}

#[test]
fn masks_make_voids() {
    for name in ["09-internal-mask.tif", "09-external-msk.tif"] {
        let built = plain(name);
        assert_eq!(built.terrain.header().nodata_samples, 620, "{name}");
        assert_eq!(built.height_m([5, 15]), None, "{name}");
        assert_eq!(built.height_m([25, 15]), Some(280.0), "{name}");
    }
}

#[test]
fn what_stands_beside_a_file_counts() {
    let built = plain("10-auxxml.tif");
    assert_eq!(built.height_m([0, 0]), Some(510.0));
    assert_eq!(built.terrain.header().nodata_samples, 25);
    assert!(built.warnings.is_empty(), "{:?}", built.warnings);
}

#[test]
fn degrees_or_metres_is_asked_where_it_is_not_plain() {
    for (name, spacing) in
        [("12-quarter-degree-nocrs.tif", [19_280.0, 27_784.0]), ("34-era5-nocrs.tif", [19_280.0, 27_784.0])]
    {
        let (words, remedy) = refused(&case(name), &OpenOptions::default());
        assert!(words.contains("degrees as well as metres") && words.contains("EPSG:4326"), "{words}");
        assert_eq!(remedy, Some(Remedy::ReferenceSystem));
        let typed = OpenOptions { crs: Some("EPSG:4326".into()), ..OpenOptions::default() };
        let found = built(&case(name), &typed, None).unwrap().spacing_m();
        assert!(
            (found[0] / spacing[0] - 1.0).abs() < 0.01 && (found[1] / spacing[1] - 1.0).abs() < 0.01,
            "{found:?}"
        );
        let local = OpenOptions { crs: Some("local".into()), ..OpenOptions::default() };
        assert_eq!(built(&case(name), &local, None).unwrap().spacing_m(), [0.25; 2]);
        // Who states the spacing is not asked.
        assert_eq!(
            built(&case(name), &OpenOptions::default(), Some([7.0; 2])).unwrap().spacing_m(),
            [7.0; 2]
        );
    }
    let warned = plain("11-local-1cm.tif").warnings;
    assert!(
        warned.iter().any(|w| w.mended_by == Some((Remedy::ReferenceSystem, "EPSG:4326".into()))),
        "{warned:?}"
    );
}

#[test]
fn a_scale_of_heights_in_the_place_is_told() {
    let built = plain("16-scalez.tif");
    assert_eq!(built.height_m([0, 0]), Some(10_000.0));
    assert!(
        built.warnings.iter().any(|w| w.mended_by == Some((Remedy::HeightFactor, "0.01".into()))),
        "{:?}",
        built.warnings
    );
}

#[test]
fn lengths_of_strips_that_are_missing_do_no_harm() {
    plane_is("17-sbc-zero.tif", 1.0);
    plane_is("17-sbc-missing.tif", 1.0);
}

#[test]
fn voids_are_those_of_gdal_and_what_looks_like_one_is_told() {
    assert_eq!(plain("18-nd-h.tif").terrain.header().nodata_samples, 0);
    // Near the declared value and not at it: a sample of 1e38 m, which is refused with the way out.
    let (words, remedy) = refused(&case("18-nd-c.tif"), &OpenOptions::default());
    assert!(words.contains("is a no-data value not declared"), "{words}");
    assert_eq!(remedy, Some(Remedy::Nodata));
    let typed = OpenOptions { nodata: vec!["1.7014118346046923e38".into()], ..OpenOptions::default() };
    assert_eq!(built(&case("18-nd-c.tif"), &typed, None).unwrap().terrain.header().nodata_samples, 25);
    for text in ["-3.4028234663852886e+38", "-3.4028235e38"] {
        let typed = OpenOptions { nodata: vec![text.into()], ..OpenOptions::default() };
        assert_eq!(
            built(&case("18-nd-f.tif"), &typed, None).unwrap().terrain.header().nodata_samples,
            25,
            "{text}"
        );
    }
    let marked = plain("18-nd-q.tif");
    assert_eq!(marked.terrain.header().nodata_samples, 0);
    let told = marked.warnings.iter().find(|w| w.mended_by == Some((Remedy::Nodata, "-32768".into())));
    assert!(told.is_some_and(|w| w.words.contains("25 samples are -32768")), "{:?}", marked.warnings);
    assert!(marked.terrain.header().about.warnings.iter().any(|words| words.contains("-32768")));
    // The advice, followed.
    let typed = OpenOptions { nodata: vec!["-32768".into()], ..OpenOptions::default() };
    let mended = built(&case("18-nd-q.tif"), &typed, None).unwrap();
    assert_eq!((mended.terrain.header().nodata_samples, mended.warnings.len()), (25, 0));
    let typed = OpenOptions { nodata: vec!["-1234".into()], ..OpenOptions::default() };
    let idle = built(&case("01-northup.tif"), &typed, None).unwrap();
    assert!(idle.warnings.iter().any(|w| w.words.starts_with("no sample is -1234")), "{:?}", idle.warnings);
}

#[test]
fn heights_packed_into_colours_are_read_by_name() {
    let (words, remedy) = refused(&case("26-terrainrgb.tif"), &OpenOptions::default());
    assert!(words.contains("mapbox"), "{words}");
    assert_eq!(remedy, Some(Remedy::Decode));
    let typed = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
    let built = built(&case("26-terrainrgb.tif"), &typed, None).unwrap();
    assert_eq!(built.height_m([0, 0]), Some(100.0));
    assert_eq!(built.height_m([40, 30]), Some(430.0));
    for (name, packing) in [("26-terrainrgb.png", "mapbox"), ("26-terrarium.png", "terrarium")] {
        let typed = OpenOptions { decode: Some(packing.into()), ..OpenOptions::default() };
        let built = cases_support::built(&case(name), &typed, None).unwrap();
        assert_eq!((built.height_m([0, 0]), built.height_m([40, 30])), (Some(100.0), Some(430.0)), "{name}");
    }
}

#[test]
fn depths_are_negated_and_bands_are_named() {
    use terrasoar_import::Direction;
    let typed = OpenOptions { positive: Some(Direction::Down), ..OpenOptions::default() };
    let depths = built(&case("01-northup.tif"), &typed, None).unwrap();
    assert_eq!((depths.height_m([0, 0]), depths.height_m([40, 30])), (Some(-100.0), Some(-430.0)));
    let scaled =
        cases_support::built_with(&case("01-northup.tif"), &OpenOptions::default(), None, -2.0).unwrap();
    assert_eq!((scaled.height_m([0, 0]), scaled.height_m([40, 30])), (Some(-200.0), Some(-860.0)));
    let wrong = OpenOptions { band: Some("depth".into()), ..OpenOptions::default() };
    assert!(refused(&case("01-northup.tif"), &wrong).0.contains("there is no band \"depth\""));
    let green = OpenOptions { band: Some("2".into()), ..OpenOptions::default() };
    assert!(built(&case("26-terrainrgb.tif"), &green, None).unwrap().height_m([0, 0]) == Some(138.0));
}

/// Ground that is exported and built again has its samples as far apart as before, and as high, whatever was known of its system: also where that is a unit alone.
#[test]
fn what_is_exported_is_as_large_and_as_high_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let mut seen = 0;
    for entry in std::fs::read_dir(case("")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.extension().is_none_or(|ending| ending != "tif") || name.starts_with('d') {
            continue;
        }
        let Ok(first) = built(&path, &OpenOptions::default(), None) else { continue };
        let window = SampleWindow::of(first.terrain.grid());
        let out = folder.path().join(&name);
        export_heights(&first.terrain, &window, Some(Numbers::Float64), &out, &Silent).unwrap();
        let again = built(&out, &OpenOptions::default(), None).unwrap();
        let [a, b] = [&first, &again].map(Built::spacing_m);
        assert!((0..2).all(|axis| (a[axis] / b[axis] - 1.0).abs() < 1e-9), "{name}: {a:?} {b:?}");
        assert_eq!(first.heights_m(), again.heights_m(), "{name}");
        seen += 1;
    }
    assert!(seen > 25, "{seen}");
}
