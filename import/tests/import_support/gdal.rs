//! GDAL's tools as the truth that this package is held against.

#![allow(dead_code, reason = "each test binary uses a part of this")]

#[path = "tools.rs"]
pub(crate) mod tools;

use super::import_support::{Grid, Random, collect, read};
use std::path::Path;
pub(crate) use tools::{run, values};

/// Compares random samples and the place of `path` with what GDAL says; what has no data for GDAL must be void here, and nothing else. Our row 0 must be GDAL's.
pub(crate) fn agrees(path: &Path) {
    agrees_with(path, &read(&[path.to_owned()]).unwrap_or_else(|error| panic!("{error}")));
}

/// As [`agrees`] of files whose rows may run north, which GDAL turns as we do.
pub(crate) fn agrees_north_up(path: &Path) {
    let opened = terrasoar_import::open(&[path.to_owned()]).and_then(|dem| collect(&*dem));
    agrees_with(path, &opened.unwrap_or_else(|error| panic!("{error}")));
}

fn agrees_with(path: &Path, grid: &Grid) {
    let [wide, high] = [grid.info.samples_wide, grid.info.samples_high];
    let said = run(Path::new("."), "gdalinfo", &[path.to_str().unwrap()]);
    let marked = said.lines().find_map(|line| line.trim().strip_prefix("NoData Value="));
    let void = marked.map_or(f64::NAN, |text| text.parse().unwrap());
    // GDAL compares samples of singles with the mark rounded to one. Labels give marks in few digits, and here they are compared so whatever the samples are.
    let are_singles =
        ["Type=Float32", "Driver: ENVI/", "Driver: EHdr/"].iter().any(|word| said.contains(word));
    let mut random = Random(path.as_os_str().len() as u64);
    let mut places: Vec<(u32, u32)> =
        (0..500).map(|_| (random.below(wide.into()) as u32, random.below(high.into()) as u32)).collect();
    places.extend([(0, 0), (wide - 1, 0), (0, high - 1), (wide - 1, high - 1)]);
    for ((col, row), wanted) in places.iter().zip(values(path, &places)) {
        let got = grid.at(*col, *row);
        let is_mark = wanted == void || (are_singles && wanted as f32 == void as f32);
        let is_void = got.is_nan() && (wanted.is_nan() || is_mark);
        // gdallocationinfo prints singles with nine digits or more.
        let is_near = (got - wanted).abs() <= 1e-6 * wanted.abs() && wanted != void;
        assert!(is_near || is_void, "{}: ({col}, {row}) is {got}, GDAL says {wanted}", path.display());
    }
    assert!(
        said.contains(&format!("Size is {wide}, {high}")),
        "{}: {wide} x {high}, GDAL says {said}",
        path.display()
    );
    let pair = |key: &str| {
        let line = said.lines().find(|line| line.starts_with(key))?;
        let inside = line.split('(').nth(1)?.split(')').next()?;
        let (a, b) = inside.split_once(',')?;
        Some([a.parse::<f64>().ok()?, b.parse::<f64>().ok()?])
    };
    if let (Some(origin), Some(size)) = (pair("Origin = "), pair("Pixel Size = ")) {
        let map =
            grid.info.georeference.pixel_to_crs.unwrap_or_else(|| panic!("{}: no place", path.display()));
        // Of sample centres, where GDAL counts from the corner.
        let wanted = [origin[0] + size[0] / 2.0, size[0], 0.0, origin[1] + size[1] / 2.0, 0.0, size[1]];
        for (got, wanted) in map.iter().zip(wanted) {
            let near = 1e-9 * wanted.abs() + 1e-12;
            assert!((got - wanted).abs() <= near, "{}: {map:?}, GDAL says {wanted:?}", path.display());
        }
    }
}
