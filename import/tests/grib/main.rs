//! GRIB 2 against arithmetic: the files of `data-scripts/make-grib-fixtures.py`, which ecCodes packed.

#[path = "../import_support/mod.rs"]
mod import_support;

mod damage;

use import_support::{Grid, collect};
use std::path::{Path, PathBuf};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::dem::{SampleType, Warning};
use terrasoar_layout::error::LayoutError;

const WIDE: u32 = 37;
const HIGH: u32 = 23;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/grib_fixtures").join(name)
}

fn with(path: &Path, options: &OpenOptions) -> Result<(Grid, Vec<Warning>), LayoutError> {
    let dem = open_with(&[path.to_owned()], options)?;
    let grid = collect(&*dem)?;
    Ok((grid, dem.warnings()))
}

fn opened(name: &str) -> Grid {
    with(&fixture(name), &OpenOptions::default()).unwrap_or_else(|error| panic!("{name}: {error}")).0
}

fn band(word: &str) -> OpenOptions {
    OpenOptions { band: Some(word.into()), ..OpenOptions::default() }
}

fn refused(name: &str, options: &OpenOptions) -> String {
    let read = with(&fixture(name), options);
    read.err().map(|error| error.to_string()).unwrap_or_else(|| panic!("{name} was read"))
}

/// The heights of the fixtures, rows from the north.
fn height(col: u32, row: u32) -> f64 {
    f64::from(1000 + 13 * col + 29 * row + (7 * col + 11 * row) % 17 * 4)
}

fn is_void(col: u32, row: u32) -> bool {
    (5 * col + 3 * row).is_multiple_of(23)
}

/// Checks every sample, to a part of its size, and where voids are.
fn is_usual(name: &str, grid: &Grid, more: f64, off: f64, has_voids: bool) {
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [WIDE, HIGH], "{name}");
    for (col, row) in (0..WIDE).flat_map(|col| (0..HIGH).map(move |row| (col, row))) {
        let found = grid.at(col, row) * grid.info.height_scale + grid.info.height_offset_m;
        let wanted = height(col, row) + more;
        let is_right = match has_voids && is_void(col, row) {
            true => found.is_nan(),
            false => (found - wanted).abs() <= off * wanted,
        };
        assert!(is_right, "{name}: {found} at {col}, {row}, and not {wanted}");
    }
}

fn is_at(name: &str, grid: &Grid, wanted: [f64; 4], off: f64) {
    let [x, dx, b, y, d, dy] = grid.info.georeference.pixel_to_crs.unwrap();
    assert_eq!([b, d], [0.0; 2], "{name}");
    for (found, wanted) in [x, dx, y, dy].iter().zip(wanted) {
        assert!((found - wanted).abs() <= off, "{name}: {:?}", [x, dx, y, dy]);
    }
}

fn notes(grid: &Grid) -> String {
    grid.info.about.origins.iter().map(|(what, words)| format!("{what}: {words}\n")).collect()
}

#[test]
fn every_packing_gives_back_what_was_packed() {
    for (name, format, kind) in [
        ("simple", "simple packing", SampleType::U16),
        ("complex", "complex packing)", SampleType::I32),
        ("differences-1", "complex packing with differences", SampleType::I32),
        ("differences-2", "complex packing with differences", SampleType::I32),
        ("jpeg", "JPEG 2000", SampleType::U16),
        ("png", "PNG", SampleType::U16),
        ("ccsds", "CCSDS", SampleType::U16),
        ("reals", "reals", SampleType::F32),
    ] {
        for (name, has_voids) in [(name.to_owned(), false), (format!("{name}-voids"), true)] {
            let grid = opened(&format!("{name}.grib2"));
            assert!(grid.info.format.contains(format), "{name}: {}", grid.info.format);
            assert_eq!(grid.info.sample_type, kind, "{name}");
            is_usual(&name, &grid, 0.0, 0.0, has_voids);
            is_at(&name, &grid, [10.0, 0.25, 50.0, -0.25], 1e-9);
        }
    }
    let flat = opened("constant.grib2");
    let is_flat = |raw: &f64| *raw * flat.info.height_scale + flat.info.height_offset_m == 77.0;
    assert!(flat.samples.len() == (WIDE * HIGH) as usize && flat.samples.iter().all(is_flat));
}

#[test]
fn samples_in_every_order_are_the_same_ground() {
    for mode in 0..16 {
        let name = format!("order-{mode:04b}.grib2");
        let grid = opened(&name);
        is_usual(&name, &grid, 0.0, 0.0, false);
        is_at(&name, &grid, [10.0, 0.25, 50.0, -0.25], 1e-9);
    }
}

/// Long runs of nothing, and differences of one: codes that other ground has no use for.
#[test]
fn runs_of_zeros_and_pairs_of_small_numbers_are_unpacked() {
    for (name, wanted) in [
        (
            "ccsds-zeros",
            (|col, row| if col * row % 97 == 3 { f64::from(5 + col) } else { 0.0 }) as fn(u32, u32) -> f64,
        ),
        ("ccsds-pairs", |col, row| f64::from((col / 3 + row / 2) % 2)),
    ] {
        let grid = opened(&format!("{name}.grib2"));
        for (col, row) in (0..WIDE).flat_map(|col| (0..HIGH).map(move |row| (col, row))) {
            let found = grid.at(col, row) * grid.info.height_scale + grid.info.height_offset_m;
            assert_eq!(found, wanted(col, row), "{name}: {col}, {row}");
        }
    }
}

/// Places by gdaltransform (PROJ 9.1) of the first sample.
#[test]
fn maps_lie_where_their_first_sample_does() {
    for (name, words, first) in [
        ("lambert", "lcc", FIRST[0]),
        ("albers", "aea", FIRST[1]),
        ("polar", "stere", FIRST[2]),
        ("polar-south", "stere", FIRST[3]),
        ("mercator", "merc", FIRST[4]),
        ("equal-area", "laea", FIRST[5]),
    ] {
        let grid = opened(&format!("{name}.grib2"));
        is_usual(name, &grid, 0.0, 0.0, false);
        let said = &grid.info.about.crs_text;
        assert!(said.contains(words), "{name}: {said}");
        is_at(name, &grid, [first[0], 5000.0, first[1], -5000.0], 0.01);
    }
}

const FIRST: [[f64; 2]; 6] = [
    [-75_812.284, 56_061.045],
    [-75_812.148, 56_097.634],
    [55_596.639, -3_185_129.315],
    [28_480.199, 1_631_629.502],
    // It crosses 180 degrees, so its map is cut elsewhere: at its own west.
    [0.0, 2_193_201.300],
    [-76_118.582, -555_433.349],
];

#[test]
fn one_field_of_several_is_the_ground_or_is_asked_for() {
    // The only heights at the ground, or of the model's terrain.
    is_usual("several", &opened("several.grib2"), 0.0, 0.0, false);
    is_usual("terrain", &opened("terrain.grib2"), 0.0, 0.0, false);
    for (word, more) in [("2", 5000.0), ("3", 0.0), ("4", 5000.0), ("hgt", 0.0), ("GH", 0.0)] {
        let (grid, _) = with(&fixture("several.grib2"), &band(word)).unwrap();
        is_usual(word, &grid, more, 0.0, false);
        let notes = notes(&grid);
        assert!(notes.contains("of 4: HGT, geopotential height"), "{notes}");
    }
    let several = refused("levels.grib2", &OpenOptions::default());
    assert!(
        several.contains("1: HGT, geopotential height, at 500 hPa; 2: HGT, geopotential height, at 850 hPa"),
        "{several}"
    );
    for (name, word, words) in [
        ("levels.grib2", "HGT", "several fields are called \"HGT\""),
        ("levels.grib2", "3", "there is no field 3 in it; there are 2"),
        ("levels.grib2", "depth", "there is no field \"depth\" in it; there are 1: HGT"),
    ] {
        let said = refused(name, &band(word));
        assert!(said.contains(words), "{said}");
    }
    // What is no height is read and told; it may be asked for by its numbers.
    let (_, said) = with(&fixture("kelvin.grib2"), &OpenOptions::default()).unwrap();
    assert!(said.iter().any(|warning| warning.words.contains("product 0.0.0")), "{said:?}");
    assert!(with(&fixture("several.grib2"), &band("0.0.0")).is_ok());
}

#[test]
fn a_geopotential_is_divided_by_gravity() {
    let grid = opened("geopotential.grib2");
    // Singles of about 10,000.
    is_usual("geopotential", &grid, 0.0, 1e-7, false);
    assert!(notes(&grid).contains("9.80665"), "{}", notes(&grid));
}

#[test]
fn longitudes_beyond_180_lie_together() {
    for (name, west) in [("pacific", 176.0), ("west", -125.0), ("greenwich", -4.0)] {
        let grid = opened(&format!("{name}.grib2"));
        is_usual(name, &grid, 0.0, 0.0, false);
        is_at(name, &grid, [west, 0.25, 50.0, -0.25], 1e-9);
    }
    let globe = opened("globe.grib2");
    is_at("globe", &globe, [0.0, 5.0, 90.0, -5.0], 1e-9);
    assert_eq!([globe.info.samples_wide, globe.info.samples_high], [72, 37]);
    // A step of a third of a degree is told in millionths, and by the corners more exactly.
    is_at("third", &opened("third.grib2"), [10.0, 1.0 / 3.0, 50.0, -1.0 / 3.0], 3e-8);
}

/// Files as they came over the wire, and headers that do not go together.
#[test]
fn bulletins_and_contradictions() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let sound = std::fs::read(fixture("simple.grib2")).unwrap();
    let bulletin =
        put("a.grb2", &[b"\x01\r\r\n123\r\r\nHTXX01 KWBC 260000\r\r\n", &sound[..], b"\r\r\n\x03"].concat());
    is_usual("bulletin", &with(&bulletin, &OpenOptions::default()).unwrap().0, 0.0, 0.0, false);
    let grid = sound.windows(4).position(|four| four == [0, 0, 0, 72]).unwrap();
    let changed = |octet: usize, number: u32| {
        let mut bytes = sound.clone();
        bytes[grid + octet - 1..grid + octet + 3].copy_from_slice(&number.to_be_bytes());
        put("b.grib2", &bytes)
    };
    // The last longitude says another step than the step does.
    let (grid, said) = with(&changed(60, 28_000_000), &OpenOptions::default()).unwrap();
    assert!(
        said.iter().any(|warning| warning.words.contains("0.25 degrees, and 0.5 by its corners")),
        "{said:?}"
    );
    is_at("contradiction", &grid, [10.0, 0.25, 50.0, -0.25], 1e-9);
    for (octet, number, words) in [
        (47, 95_000_000, "no globe"),
        (68, 10_000_000, "beyond a pole"),
        (31, 38, "number of points"),
        (11, 1 << 24, "unlike lengths"),
    ] {
        let path = changed(octet, number);
        let said = with(&path, &OpenOptions::default()).err().unwrap().to_string();
        assert!(said.contains(words), "{octet}: {said}");
    }
}

#[test]
#[cfg_attr(feature = "gdal", ignore = "GDAL's library reads these")]
fn what_is_not_read_is_refused_with_the_command() {
    for (name, words) in [
        ("edition-1.grib", "gdal_translate -b N"),
        ("gaussian.grib2", "Gaussian grid"),
        ("reduced.grib2", "-setgridtype,regular"),
        ("waves.grib2", "spherical harmonics"),
        ("rotated.grib2", "rotated longitudes"),
    ] {
        let said = refused(name, &OpenOptions::default());
        assert!(said.contains(words), "{name}: {said}");
    }
}
