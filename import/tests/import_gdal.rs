//! A thousand samples of each format against a live `gdallocationinfo`.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal -- --ignored`.

mod import_support;
#[path = "import_support/tools.rs"]
mod tools;

use std::path::{Path, PathBuf};

use import_support::{Random, data, fixtures, read, write_hgt};
use tempfile::tempdir;
use terrasoar_import::synth;
use terrasoar_import::synth::SynthOptions;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use tools::values;

/// Compares random samples of `path`.
fn agrees(path: &Path) {
    let grid = read(&[path.to_owned()]).unwrap();
    let mut random = Random(path.as_os_str().len() as u64);
    let places: Vec<(u32, u32)> = (0..1000)
        .map(|_| {
            (
                random.below(grid.info.samples_wide.into()) as u32,
                random.below(grid.info.samples_high.into()) as u32,
            )
        })
        .collect();
    let answers = values(path, &places);
    file_agrees(path, &places, &answers);
    for ((col, row), wanted) in places.into_iter().zip(answers) {
        let got = grid.at(col, row);
        let void =
            got.is_nan() && (wanted.is_nan() || wanted == -32768.0 || wanted < -3e38 || is_masked(path));
        assert!(got == wanted || void, "{}: ({col}, {row}) is {got}, GDAL says {wanted}", path.display());
    }
}

/// gdallocationinfo answers masked samples with the band's value.
fn is_masked(path: &Path) -> bool {
    path.to_string_lossy().contains("mask")
}

/// Compares the heights of a terrain file built from `path`: equal, for every record kind chosen by itself is exact.
fn file_agrees(path: &Path, places: &[(u32, u32)], answers: &[f64]) {
    let folder = tempdir().unwrap();
    let out = folder.path().join("t.iqt");
    let options = OpenOptions { as_stored: true, ..OpenOptions::default() };
    let dem = open_with(&[path.to_owned()], &options).unwrap();
    let info = dem.info().clone();
    match build(&*dem, &out, &BuildOptions::default(), &Silent) {
        Err(e) if e.to_string().contains("every sample is void") => return,
        built => assert!(!built.unwrap().heights_rounded),
    }
    let terrain = Terrain::open(&out).unwrap();
    for ((col, row), wanted) in places.iter().zip(answers) {
        let vertex = terrain.checked_vertex(GridPoint::new(*col, info.samples_high - 1 - row)).unwrap();
        let wanted_m = wanted * info.height_scale + info.height_offset_m;
        let is_mark = wanted.is_nan() || *wanted == -32768.0 || wanted.abs() > 3e38;
        let void = vertex.class.is_void() && (is_mark || is_masked(path));
        let near =
            (vertex.height_m - wanted_m).abs() <= 1e-12 * wanted_m.abs().max(info.height_offset_m.abs());
        let shown = path.display();
        assert!(near || void, "{shown}: ({col}, {row}) is {} m, GDAL says {wanted_m} m", vertex.height_m);
    }
}

#[test]
#[ignore = "needs gdallocationinfo"]
fn png_bt_and_hgt() {
    let folder = tempdir().unwrap();
    let tile = folder.path().join("N29E080.hgt");
    write_hgt(
        &tile,
        1201,
        |col, row| if (col + row) % 97 == 0 { -32768 } else { (col * 3 + row) as i16 - 500 },
    );
    for path in [data("puget_sound_1025.png"), data("crater_lake_1025.bt"), tile] {
        agrees(&path);
    }
}

#[test]
#[ignore = "needs gdallocationinfo"]
fn synthetic_terrain() {
    let folder = tempdir().unwrap();
    for name in ["t.tif", "t.png"] {
        let path = folder.path().join(name);
        synth::write(&SynthOptions::default().size(1025), &path, &|_| ()).unwrap();
        agrees(&path);
    }
}

#[test]
#[ignore = "needs gdallocationinfo"]
fn geotiff_fixtures() {
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(fixtures()).unwrap().map(|entry| entry.unwrap().path()).collect();
    // What is refused is not compared.
    paths.retain(|path| {
        let is_read =
            path.extension().is_some_and(|e| e == "tif") && !path.to_string_lossy().contains("refused-");
        is_read && tools::unpacks(path)
    });
    assert!(paths.len() > 50);
    paths.iter().for_each(|path| agrees(path));
}
