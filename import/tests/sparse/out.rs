//! Exports of the largest square, of which next to nothing is there: they hold what is there, and GDAL reads the rest as void.

use super::{SIDE, count, file, height, heights, tools};
use crate::make::Image;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::{TempDir, tempdir};
use terrasoar_import::difference::Difference;
use terrasoar_import::export::{Numbers, export_heights};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

const TILE: u32 = 512;
const PLACES: [[u32; 2]; 3] = [[3 * TILE, 5 * TILE], [700 * TILE, 800 * TILE], [SIDE - 1, SIDE - 1]];
/// Samples of the three tiles; of the last one there is a corner.
const STORED: u64 = 2 * (TILE as u64).pow(2) + 1;

/// Builds `path`, in a folder.
fn built(folder: &TempDir, path: &Path, name: &str) -> Terrain {
    let options = OpenOptions { scratch: Some(folder.path().to_owned()), ..OpenOptions::default() };
    let target = folder.path().join(name);
    let dem = open_with(&[path.to_owned()], &options).unwrap();
    build(&*dem, &target, &BuildOptions::default(), &Silent).unwrap();
    Terrain::open(&target).unwrap()
}

/// Exports the terrain of three tiles, and its differences from itself.
fn exported(folder: &TempDir) -> (Terrain, [PathBuf; 2]) {
    let image = Image { nodata: Some("-9999"), ..heights(SIDE, TILE, &PLACES) };
    let terrain = built(folder, &file(folder, "in.tif", &[image]), "in.iqt");
    let outs = ["heights.tif", "differences.tif"].map(|name| folder.path().join(name));
    let begun = Instant::now();
    let whole = SampleWindow::of(terrain.grid());
    let written = export_heights(&terrain, &whole, Some(Numbers::Int16), &outs[0], &Silent).unwrap();
    let other = Terrain::open(terrain.path()).unwrap();
    let difference = Difference::new(&terrain, &other, &whole).unwrap();
    let compared = difference.export(&outs[1], &Silent).unwrap();
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
    for written in [written, compared] {
        assert_eq!(written.voids, u64::from(SIDE).pow(2) - STORED);
        // Of a tile that is not there, 8 bytes in the tables; of levels a third more.
        assert!(written.bytes < 60 << 20, "{}", written.bytes);
    }
    (terrain, outs)
}

/// Columns and rows on the three tiles and around them.
fn places() -> Vec<(u32, u32)> {
    let around = |[x, y]: [u32; 2]| {
        let near = move |v: u32, i: u32| (v + i).saturating_sub(40).min(SIDE - 1);
        (0..40).map(move |i| (near(x, 17 * i % 601), near(y, 29 * i % 607)))
    };
    PLACES.into_iter().flat_map(around).chain([(0, 0), (SIDE - 1, SIDE - 1), (SIDE / 2, 7)]).collect()
}

fn wanted((x, y): (u32, u32)) -> Option<f64> {
    let is_there = PLACES.iter().any(|at| at[0] / TILE == x / TILE && at[1] / TILE == y / TILE);
    is_there.then(|| f64::from(height(x, y)))
}

#[test]
fn what_is_void_is_not_written() {
    let folder = tempdir().unwrap();
    let (terrain, outs) = exported(&folder);
    let options = || OpenOptions { scratch: Some(folder.path().to_owned()), ..OpenOptions::default() };
    for out in &outs {
        let counts = count(out, options());
        assert_eq!(counts.heights, STORED);
        assert!(counts.made <= 3 * u64::from(TILE).pow(2), "{}", counts.made);
    }
    // What is built of it is what it was made of.
    let again = built(&folder, &outs[0], "again.iqt");
    let spacing_m = terrain.grid().spacing_m();
    for (x, y) in places() {
        let at = [f64::from(x) * spacing_m[0], f64::from(SIDE - 1 - y) * spacing_m[1]];
        assert_eq!(terrain.height_m(at[0], at[1]).unwrap(), wanted((x, y)), "{x} {y}");
        assert_eq!(again.height_m(at[0], at[1]).unwrap(), wanted((x, y)), "{x} {y}");
    }
}

#[test]
#[ignore = "needs gdal-bin"]
fn gdal_reads_what_is_not_written_as_void() {
    let folder = tempdir().unwrap();
    let (_, [heights, differences]) = exported(&folder);
    let places = places();
    let [found, apart] = [&heights, &differences].map(|path| tools::values(path, &places));
    for ((place, found), apart) in places.iter().zip(found).zip(apart) {
        assert_eq!(found, wanted(*place).unwrap_or(-32768.0), "{place:?}");
        assert!(wanted(*place).map_or(apart.is_nan(), |_| apart == 0.0), "{place:?} {apart}");
    }
    let said = tools::run(folder.path(), "gdalinfo", &["heights.tif"]);
    assert!(said.contains("LAYOUT=COG") && said.contains("NoData Value=-32768"), "{said}");
    // The overviews, too: the coarsest is one tile.
    let small = ["-q", "-outsize", "300", "0", "-r", "near", "heights.tif", "small.tif"];
    tools::run(folder.path(), "gdal_translate", &small);
    let said = tools::run(folder.path(), "gdalinfo", &["-stats", "small.tif"]);
    assert!(said.contains("STATISTICS_MAXIMUM"), "{said}");
}
