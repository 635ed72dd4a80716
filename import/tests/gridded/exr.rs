//! OpenEXR of every kind of samples, packing and layout, as OpenEXR's own library writes it (`data-scripts/make-openexr-fixtures.py`), against arithmetic.

use super::{band, fixture, opened, refused, with};
use crate::import_support::Grid;
use terrasoar_import::OpenOptions;
use terrasoar_layout::dem::SampleType;

const WIDE: u32 = 43;
const HIGH: u32 = 37;

fn is_right(name: &str, grid: &Grid, has_voids: bool, height: impl Fn(f64, f64) -> f64) {
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [WIDE, HIGH], "{name}");
    // Rows of the grid run from the south, if they were turned.
    for (col, row) in (0..WIDE).flat_map(|col| (0..HIGH).map(move |row| (col, row))) {
        let found = grid.at(col, row);
        let wanted = height(f64::from(col), f64::from(row));
        let is_void = has_voids && (col + row) % 11 == 0;
        assert!(
            if is_void { found.is_nan() } else { found == wanted },
            "{name}: {found} at {col}, {row}, not {wanted}"
        );
    }
}

fn height(x: f64, y: f64) -> f64 {
    100.5 + 3.0 * x - 2.0 * y
}

#[test]
fn every_packing_and_layout() {
    for (name, has_voids, sample_type) in [
        ("float-zip", true, SampleType::F32),
        ("float-raw", false, SampleType::F32),
        ("float-falling", false, SampleType::F32),
        ("float-pxr24", false, SampleType::F32),
        ("half-piz", false, SampleType::F16),
        ("with-alpha", false, SampleType::F32),
        ("data-window", true, SampleType::F32),
        ("tiles", true, SampleType::F32),
    ] {
        let grid = opened(&format!("{name}.exr"));
        assert_eq!(grid.info.sample_type, sample_type, "{name}");
        is_right(name, &grid, has_voids, height);
    }
    is_right("uint-rle", &opened("uint-rle.exr"), false, |x, y| 3e9 + 1e5 * x + 7.0 * y);
    is_right("half-b44", &opened("half-b44.exr"), false, |_, _| 12.5);
    let words = refused(&fixture("half-dwaa.exr"), &OpenOptions::default());
    assert!(words.contains("DWAA") && words.contains("oiiotool"), "{words}");
}

#[test]
fn channels_are_chosen_by_name() {
    let asked = refused(&fixture("channels.exr"), &OpenOptions::default());
    assert!(asked.contains("5 channels") && asked.contains("\"terrain.Z\""), "{asked}");
    is_right("channels", &with(&fixture("channels.exr"), &band("terrain.Z")).unwrap(), true, height);
    is_right("channels", &with(&fixture("channels.exr"), &band("G")).unwrap(), false, |_, _| 0.0);
    let none = refused(&fixture("channels.exr"), &band("Q"));
    assert!(none.contains("no band \"Q\""), "{none}");
    let asked = refused(&fixture("parts.exr"), &OpenOptions::default());
    assert!(asked.contains("\"colour.R\"") && asked.contains("\"ground.Z\""), "{asked}");
    is_right("parts", &with(&fixture("parts.exr"), &band("ground.Z")).unwrap(), false, height);
}

#[test]
fn the_data_window_is_told_and_deep_data_refused() {
    let grid = opened("data-window.exr");
    let told = &grid.info.about.origins;
    assert!(told.iter().any(|(_, words)| words.contains("from -5, 7 on")), "{told:?}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep.exr");
    let mut deep = std::fs::read(fixture("float-zip.exr")).unwrap();
    deep[5] |= 8;
    std::fs::write(&path, deep).unwrap();
    let words = refused(&path, &OpenOptions::default());
    assert!(words.contains("deep data") && words.contains("oiiotool"), "{words}");
}

#[test]
fn damage_anywhere_is_answered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    for name in ["float-raw", "float-zip", "half-piz", "uint-rle", "tiles", "half-b44", "float-pxr24"] {
        let bytes = std::fs::read(fixture(&format!("{name}.exr"))).unwrap();
        let mut wrong = 0;
        for at in (0..bytes.len()).step_by((bytes.len() / 150).max(1)) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x5a;
            for damaged in [&changed[..], &bytes[..at]] {
                std::fs::write(&path, damaged).unwrap();
                wrong += u32::from(with(&path, &OpenOptions::default()).is_err());
            }
        }
        assert!(wrong > 150, "{name}: {wrong}");
    }
}
