//! Exported heights against every record of the terrain, and the file against what a cloud-optimised GeoTIFF is.

#[path = "import_support/cog.rs"]
mod cog;
mod import_support;

use cog::{directories, image};
use import_support::{collect, data, read};
use std::path::Path;
use tempfile::tempdir;
use terrasoar_import::export::{Named, Numbers, Written, export_heights, is_exported};
use terrasoar_import::places::Frame;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{About, HorizontalUnit, MemoryDem, SampleType, UnitOf};
use terrasoar_layout::edit::{Crater, Edit, EditSession};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;
use terrasoar_layout::with_records;

/// Rugged ground with a lake of voids and some single ones.
fn ground(x: u32, y: u32) -> f64 {
    let noise = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35) >> 20;
    if (600..820).contains(&x) && (300..600).contains(&y) || noise == 77 {
        return f64::NAN;
    }
    900.0 + 300.0 * (f64::from(x) / 97.0).sin() * (f64::from(y) / 61.0).cos() + f64::from(noise) / 64.0
}

fn built(folder: &Path, dem: &MemoryDem, options: &BuildOptions) -> Terrain {
    let path = folder.join("t.iqt");
    build(dem, &path, options, &Silent).unwrap();
    Terrain::open(&path).unwrap()
}

/// The heights that a file should have, rows from the north.
fn heights(terrain: &Terrain, window: &SampleWindow) -> Vec<f64> {
    let rows = (0..window.size[1]).rev();
    let points = rows.flat_map(|row| (0..window.size[0]).map(move |column| (column, row)));
    with_records!(terrain.records().unwrap(), records => {
        let height = |(column, row): (u32, u32)| {
            let vertex = records.vertex_at(window.point(column, row));
            if vertex.class.is_void() { f64::NAN } else { vertex.height_m }
        };
        points.map(height).collect()
    })
}

fn stored(numbers: Numbers, value: f64) -> f64 {
    if numbers == Numbers::Float32 { f64::from(value as f32) } else { value }
}

fn is_same(a: f64, b: f64) -> bool {
    a == b || (a.is_nan() && b.is_nan())
}

fn export(terrain: &Terrain, window: &SampleWindow, out: &Path) -> Written {
    export_heights(terrain, window, None, out, &Silent).unwrap()
}

/// Every pixel of every level is what it should be, and the file is in the order that makes it cloud-optimised.
fn check(terrain: &Terrain, window: &SampleWindow, numbers: Numbers, path: &Path) {
    let written = export(terrain, window, path);
    let file = std::fs::read(path).unwrap();
    assert_eq!((written.numbers, written.size, written.bytes), (numbers, window.size, file.len() as u64));
    assert!(is_exported(&file[..300]) && !is_exported(&file[1..301]));
    let levels = directories(&file);
    let [wide, high] = window.size;
    let mut expected = heights(terrain, window);
    assert_eq!(written.voids, expected.iter().filter(|v| v.is_nan()).count() as u64);
    let (mut size, mut next_data) = ([wide as usize, high as usize], file.len() as u64);
    for (i, level) in levels.iter().enumerate() {
        assert_eq!([level.number(256), level.number(257)], size.map(|side| side as u64));
        assert_eq!(level.numbers(254), if i == 0 { vec![] } else { vec![1] });
        let found = image(&file, level);
        for (at, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let expected = match numbers {
                Numbers::Int16 => expected.round(),
                _ => stored(numbers, *expected),
            };
            assert!(is_same(*found, expected), "level {i}, pixel {at}: {found}, not {expected}");
        }
        // Tiles lie one behind the other, with their length before and their end again behind, coarser levels before finer ones.
        let tiles: Vec<(u64, u64)> = level.numbers(324).into_iter().zip(level.numbers(325)).collect();
        for ((offset, length), after) in
            tiles.iter().zip(tiles.iter().skip(1).map(|tile| tile.0 - 4).chain([next_data]))
        {
            let at = *offset as usize;
            assert_eq!(file[at - 4..at], (*length as u32).to_le_bytes());
            let end = at + *length as usize;
            assert_eq!(file[end - 4..end], file[end..end + 4]);
            assert_eq!(end as u64 + 4, after);
        }
        next_data = tiles[0].0 - 4;
        // The next level's pixels are means of four.
        let half = size.map(|side| side.div_ceil(2));
        let mut coarser = Vec::new();
        for y in 0..half[1] {
            for x in 0..half[0] {
                let near = |side: usize, at: usize| (2 * at..(2 * at + 2).min(side)).collect::<Vec<_>>();
                let (mut sum, mut count) = (0.0, 0.0);
                for row in near(size[1], y) {
                    for column in near(size[0], x) {
                        let value = expected[row * size[0] + column];
                        if !value.is_nan() {
                            (sum, count) = (sum + value, count + 1.0);
                        }
                    }
                }
                coarser.push(sum / count);
            }
        }
        (expected, size) = (coarser, half);
    }
    assert!(levels.iter().all(|level| level.at < next_data), "directories come before data");
    let last = levels.last().unwrap();
    assert!(last.number(256).max(last.number(257)) <= 512);
    assert!(levels.windows(2).all(|pair| pair[0].at < pair[1].at));
}

#[test]
fn every_height_of_every_level_is_the_terrains() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("out.tif");
    for (kind, numbers, round) in [
        (SampleType::I16, Numbers::Int16, 1.0),
        (SampleType::F32, Numbers::Float32, 0.1),
        (SampleType::F32, Numbers::Float32, 0.0),
        (SampleType::F64, Numbers::Float64, 0.0),
    ] {
        let dem = MemoryDem::from_fn([1100, 700], kind, |x, y| {
            let height = ground(x, y);
            let height = if round > 0.0 { (height / round).round() * round } else { height };
            if kind == SampleType::F32 { f64::from(height as f32) } else { height }
        });
        let terrain = built(folder.path(), &dem, &BuildOptions::default().spacing_m([10.0, 12.0]));
        check(&terrain, &SampleWindow::of(terrain.grid()), numbers, &out);
        for (sides, step) in [
            ([100.0, 50.0, 800.0, 650.0], 1),
            ([3.0, 5.0, 1099.0, 699.0], 2),
            ([0.0, 0.0, 1099.0, 699.0], 64),
        ] {
            let window = SampleWindow::within(terrain.grid(), sides, step).unwrap();
            check(&terrain, &window, numbers, &out);
        }
    }
}

/// What a terrain of voids alone cannot be, a window can.
#[test]
fn a_window_of_voids_is_written() {
    let folder = tempdir().unwrap();
    let dem = MemoryDem::from_fn([1100, 700], SampleType::I16, |x, y| ground(x, y).round());
    let terrain = built(folder.path(), &dem, &BuildOptions::default());
    let window = SampleWindow::within(terrain.grid(), [610.0, 310.0, 700.0, 500.0], 1).unwrap();
    let written = export(&terrain, &window, &folder.path().join("v.tif"));
    assert_eq!(written.voids, window.samples());
}

/// Exported, built and compared: the same heights, edits included, the same place, and the next export has the same bytes.
#[test]
fn what_is_exported_comes_back() {
    let crater = Edit::Crater(Crater {
        centre_m: [9000.0, 6000.0],
        direction_deg: 20.0,
        radius_m: 400.0,
        depth_m: 60.0,
    });
    for dem in ["puget_sound_1025.png", "crater_lake_1025.bt"] {
        let folder = tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let source = terrasoar_import::open_file(&data(dem)).unwrap();
        let options = BuildOptions::default().z_scale(if dem.ends_with("png") { 0.1 } else { 1.0 });
        build(&*source, &at("a.iqt"), &options, &Silent).unwrap();
        let mut session = EditSession::open_overlay(&at("a.iqt"), &at("a.iqo")).unwrap();
        session.apply(std::slice::from_ref(&crater)).unwrap();
        session.commit("a crater").unwrap();
        drop(session);
        let edited = Terrain::open_with_overlay(&at("a.iqt"), &at("a.iqo")).unwrap();
        let whole = SampleWindow::of(edited.grid());
        let written = export(&edited, &whole, &at("a.tif"));
        let again = terrasoar_import::open_file(&at("a.tif")).unwrap();
        build(&*again, &at("b.iqt"), &BuildOptions::default(), &Silent).unwrap();
        let back = Terrain::open(&at("b.iqt")).unwrap();
        for (i, (a, b)) in heights(&edited, &whole).iter().zip(heights(&back, &whole)).enumerate() {
            assert!(is_same(*a, b) || (a - b).abs() < 1e-9, "{dem}, sample {i}: {a}, then {b}");
        }
        assert_eq!(edited.header().sample_to_crs.is_some(), written.named != Named::Nothing);
        export(&back, &whole, &at("b.tif"));
        let bits = |name: &str| {
            let read = collect(&*terrasoar_import::open_file(&at(name)).unwrap()).unwrap();
            read.samples.iter().map(|height| height.to_bits()).collect::<Vec<_>>()
        };
        assert!(bits("a.tif") == bits("b.tif"), "{dem}: the next export differs");
    }
}

/// Where a terrain lies in these words, and what the built export makes of it.
fn placed(text: &str, code: Option<u32>, unit: UnitOf, map: [f64; 6]) -> (Terrain, Terrain, Written) {
    let folder = tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut dem = MemoryDem::from_fn([20, 30], SampleType::I16, |x, y| f64::from(x * y));
    let info = dem.info_mut();
    info.georeference.epsg = code;
    info.georeference.pixel_to_crs = Some(map);
    info.georeference.unit = if unit.is_angle { HorizontalUnit::Degree } else { HorizontalUnit::Unknown };
    info.about = About { crs_text: text.into(), horizontal_unit: Some(unit), ..About::default() };
    build(&dem, &at("a.iqt"), &BuildOptions::default().spacing_m([10.0, 10.0]), &Silent).unwrap();
    let terrain = Terrain::open(&at("a.iqt")).unwrap();
    let written = export(&terrain, &SampleWindow::of(terrain.grid()), &at("a.tif"));
    let again = terrasoar_import::open_file(&at("a.tif")).unwrap();
    build(&*again, &at("b.iqt"), &BuildOptions::default().spacing_m([10.0, 10.0]), &Silent).unwrap();
    let bytes = std::fs::read(at("b.iqt")).unwrap();
    let source = terrasoar_layout::file::source::MemorySource::new("memory", bytes);
    (terrain, Terrain::from_source(Box::new(source)).unwrap(), written)
}

fn unit(name: &str, size: f64, is_angle: bool) -> UnitOf {
    UnitOf { name: name.into(), size, is_angle }
}

/// Corners lie where they lay, in the own coordinates and in longitude and latitude.
#[test]
fn places_survive_in_every_way_that_a_system_is_known() {
    let metre = || unit("metre", 1.0, false);
    let north_up = [500_000.0, 10.0, 0.0, 5_000_000.0, 0.0, -10.0];
    let moon = "GEOGCS[\"GCS_Moon_2000\",DATUM[\"D_Moon_2000\",SPHEROID[\"Moon_2000_IAU_IAG\",1737400.0,0.0]],PRIMEM[\"Reference_Meridian\",0.0],UNIT[\"Degree\",0.0174532925199433]]";
    let cases: Vec<(&str, Option<u32>, UnitOf, [f64; 6], Named)> = vec![
        ("EPSG:32632", Some(32632), metre(), north_up, Named::Code),
        (
            "EPSG:4326",
            Some(4326),
            unit("degree", 1f64.to_radians(), true),
            [7.0, 0.001, 0.0, 46.0, 0.0, -0.001],
            Named::Code,
        ),
        (
            "EPSG:2263",
            Some(2263),
            unit("US survey foot", 1200.0 / 3937.0, false),
            [980_000.0, 30.0, 0.0, 200_000.0, 0.0, -30.0],
            Named::Code,
        ),
        ("+proj=utm +zone=33 +south +datum=WGS84 +units=m", None, metre(), north_up, Named::Parameters),
        (
            "+proj=tmerc +lat_0=40 +lon_0=9 +k=0.9999 +x_0=3000 +y_0=7000 +ellps=bessel",
            None,
            metre(),
            [5000.0, 10.0, 0.0, 9000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=tmerc +lat_0=40 +lon_0=9 +k=0.9999 +x_0=3000 +y_0=7000 +ellps=GRS80 +to_meter=0.3048",
            None,
            unit("foot", 0.3048, false),
            [5000.0, 10.0, 0.0, 9000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=700000 +y_0=6600000 +ellps=GRS80",
            None,
            metre(),
            [600_000.0, 10.0, 0.0, 6_500_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=lcc +lat_0=46.8 +lat_1=46.8 +lon_0=2 +k_0=0.99987742 +x_0=600000 +y_0=2200000 +a=6378249.2 +b=6356515",
            None,
            metre(),
            [600_000.0, 10.0, 0.0, 2_300_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +x_0=0 +y_0=0 +datum=NAD83",
            None,
            metre(),
            [100_000.0, 10.0, 0.0, 2_000_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=laea +lat_0=52 +lon_0=10 +x_0=4321000 +y_0=3210000 +ellps=GRS80",
            None,
            metre(),
            [4_300_000.0, 10.0, 0.0, 3_200_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=stere +lat_0=90 +lat_ts=70 +lon_0=-45 +datum=WGS84",
            None,
            metre(),
            [100_000.0, 10.0, 0.0, -2_000_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=stere +lat_0=-90 +k=0.994 +lon_0=0 +x_0=2000000 +y_0=2000000 +datum=WGS84",
            None,
            metre(),
            [2_100_000.0, 10.0, 0.0, 2_000_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=merc +lat_ts=20 +lon_0=5 +datum=WGS84",
            None,
            metre(),
            [100_000.0, 10.0, 0.0, 2_000_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=merc +k=0.997 +lon_0=110 +x_0=3900000 +y_0=900000 +ellps=bessel",
            None,
            metre(),
            [3_900_000.0, 10.0, 0.0, 900_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=sterea +lat_0=52.15616055555555 +lon_0=5.38763888888889 +k=0.9999079 +x_0=155000 +y_0=463000 +ellps=bessel",
            None,
            metre(),
            [155_000.0, 10.0, 0.0, 463_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=aeqd +lat_0=40 +lon_0=-100 +datum=WGS84",
            None,
            metre(),
            [1000.0, 10.0, 0.0, 2000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=eqc +lat_ts=30 +lon_0=10 +datum=WGS84",
            None,
            metre(),
            [1000.0, 10.0, 0.0, 2_000_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            "+proj=sinu +lon_0=10 +a=6371007.181 +b=6371007.181",
            None,
            metre(),
            [1000.0, 10.0, 0.0, 2_000_000.0, 0.0, -10.0],
            Named::Parameters,
        ),
        (
            moon,
            None,
            unit("degree", 1f64.to_radians(), true),
            [7.0, 0.001, 0.0, 46.0, 0.0, -0.001],
            Named::Parameters,
        ),
    ];
    for (text, code, unit, map, named) in cases {
        let (before, after, written) = placed(text, code, unit, map);
        let [a, b] = [&before, &after].map(|terrain| terrain.header());
        assert_eq!(written.named, named, "{text}");
        for corner in [[0.0, 0.0], [190.0, 290.0], [57.0, 290.0]] {
            let [own_a, own_b] =
                [a, b].map(|header| Frame::own(header).unwrap().coordinates(corner).unwrap());
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-11 * a.abs().max(1.0);
            assert!(near(own_a[0], own_b[0]) && near(own_a[1], own_b[1]), "{text}: {own_a:?} {own_b:?}");
            let earth =
                [a, b].map(|header| Frame::wgs84(header).map(|frame| frame.coordinates(corner).unwrap()));
            match earth {
                [Some(a), Some(b)] => {
                    assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9, "{text}: {a:?} {b:?}");
                }
                [a, b] => assert!(a.is_none() && b.is_none() && text == moon, "{text}: {a:?} {b:?}"),
            }
        }
        if text == moon {
            assert_eq!(b.body_radius_m, Some(1_737_400.0));
        }
        assert_eq!(
            a.about.horizontal_unit.as_ref().map(|u| u.is_angle),
            b.about.horizontal_unit.as_ref().map(|u| u.is_angle)
        );
    }
}

/// Rows and columns that do not run north and east go into a matrix.
#[test]
fn turned_grids_lie_where_they_lay() {
    let folder = tempdir().unwrap();
    for map in
        [[500_000.0, 9.0, 2.0, 5_000_000.0, 2.0, -9.0], [500_000.0, -10.0, 0.0, 5_000_000.0, 0.0, 10.0]]
    {
        let mut dem = MemoryDem::from_fn([20, 30], SampleType::I16, |x, y| f64::from(x * y));
        dem.info_mut().georeference.pixel_to_crs = Some(map);
        let terrain = built(folder.path(), &dem, &BuildOptions::default().spacing_m([10.0, 10.0]));
        let out = folder.path().join("a.tif");
        let window = SampleWindow::within(terrain.grid(), [2.0, 4.0, 18.0, 21.0], 2).unwrap();
        export(&terrain, &window, &out);
        let found = read(&[out]).unwrap().info.georeference.pixel_to_crs.unwrap();
        let [x, a, b, y, d, e] = map;
        // The window's first pixel is column 2 of row 9 from the north; row 20 is the northernmost even one from the south.
        let wanted = [x + 2.0 * a + 9.0 * b, 2.0 * a, 2.0 * b, y + 2.0 * d + 9.0 * e, 2.0 * d, 2.0 * e];
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}, not {wanted:?}");
    }
}

/// Heights are metres in the file, whatever they were measured in, and its vertical system is the one in metres.
#[test]
fn heights_in_feet_become_metres_above_the_same_surface() {
    let folder = tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut dem = MemoryDem::from_fn([20, 30], SampleType::I16, |x, y| f64::from(x * y));
    let info = dem.info_mut();
    info.height_scale = 1200.0 / 3937.0;
    info.georeference.epsg = Some(26918);
    info.georeference.pixel_to_crs = Some([500_000.0, 10.0, 0.0, 4_500_000.0, 0.0, -10.0]);
    info.about = About {
        vertical_name: "NAVD88 height (ftUS)".into(),
        vertical_epsg: Some(6360),
        vertical_unit: Some(unit("US survey foot", 1200.0 / 3937.0, false)),
        ..About::default()
    };
    build(&dem, &at("a.iqt"), &BuildOptions::default(), &Silent).unwrap();
    let terrain = Terrain::open(&at("a.iqt")).unwrap();
    export(&terrain, &SampleWindow::of(terrain.grid()), &at("a.tif"));
    let again = collect(&*terrasoar_import::open_file(&at("a.tif")).unwrap()).unwrap();
    let about = &again.info.about;
    assert_eq!((about.vertical_epsg, about.vertical_name.as_str()), (Some(5703), "NAVD88 height"));
    assert_eq!(again.info.height_scale, 1.0);
    let wanted = f64::from(19 * 29) * 1200.0 / 3937.0;
    assert!((again.at(19, 0) - wanted).abs() < 1e-4);
}

/// A window outside, a name in no folder: nothing is left behind.
#[test]
fn what_cannot_be_written_leaves_nothing() {
    let folder = tempdir().unwrap();
    let dem = MemoryDem::from_fn([20, 30], SampleType::I16, |x, y| f64::from(x * y));
    let terrain = built(folder.path(), &dem, &BuildOptions::default());
    let whole = SampleWindow::of(terrain.grid());
    let outside = SampleWindow { from: [15, 0], ..whole };
    let failed = export_heights(&terrain, &outside, None, &folder.path().join("a.tif"), &Silent).unwrap_err();
    assert!(failed.to_string().contains("does not lie in the terrain"), "{failed}");
    let nowhere = folder.path().join("none").join("a.tif");
    assert!(export_heights(&terrain, &whole, None, &nowhere, &Silent).is_err());
    let names: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, ["t.iqt"]);
}
