//! GeoTIFFs of which next to nothing is stored: what was left out is what GDAL reads there, and what is void by it is passed over.

#[path = "../import_support/mod.rs"]
mod import_support;
mod make;
mod out;
#[path = "../import_support/tools.rs"]
mod tools;

use import_support::read;
use make::{Image, write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tempfile::{TempDir, tempdir};
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// The largest square there is.
const SIDE: u32 = 1_048_577;

fn height(x: u32, y: u32) -> i16 {
    ((x * 31 + y * 57) % 601) as i16
}

/// Heights of 16 bits in tiles of `tile`, of which those are there that hold the places told.
fn heights(size: u32, tile: u32, places: &[[u32; 2]]) -> Image {
    let mut image = Image { size: [size; 2], chunk: [tile; 2], bits: 16, bands: 1, ..Image::default() };
    image.fill(places, |x, y, _| height(x, y));
    image
}

/// A mask of bytes: shown where `is_shown`, in those tiles.
fn mask(size: u32, tile: u32, places: &[[u32; 2]], is_shown: impl Fn(u32, u32) -> bool) -> Image {
    let mut image =
        Image { size: [size; 2], chunk: [tile; 2], bits: 8, bands: 1, kind: 4, ..Image::default() };
    image.fill(places, |x, y, _| if is_shown(x, y) { 255 } else { 0 });
    image
}

fn file(folder: &TempDir, name: &str, images: &[Image]) -> PathBuf {
    let path = folder.path().join(name);
    write(&path, images);
    path
}

/// What a file of 70 by 70 samples in tiles of 16 holds, and what GDAL's rules make of it: one tile is there but for what `None` says.
fn check(path: &Path, wanted: impl Fn(u32, u32) -> Option<i16>) {
    let grid = read(&[path.to_owned()]).unwrap();
    for (x, y) in (0..70).flat_map(|y| (0..70).map(move |x| (x, y))) {
        let found = grid.at(x, y);
        match wanted(x, y) {
            Some(value) => assert_eq!(found, f64::from(value), "{} {x} {y}", path.display()),
            None => assert!(found.is_nan(), "{} {x} {y}: {found}", path.display()),
        }
    }
}

/// The tiles of places 20, 20 and 69, 69.
fn is_there(x: u32, y: u32) -> bool {
    [1, 4].contains(&(x / 16)) && x / 16 == y / 16
}

const THERE: [[u32; 2]; 2] = [[20, 20], [69, 69]];

/// What the sample of a column and row is.
type Wanted = Box<dyn Fn(u32, u32) -> Option<i16>>;

/// All kinds of small files, with what their samples are.
fn small(folder: &TempDir) -> Vec<(PathBuf, Wanted)> {
    let image = heights(70, 16, &THERE);
    let said = |x, y| is_there(x, y).then(|| height(x, y));
    let or_zero = move |x, y| Some(said(x, y).unwrap_or(0));
    let mut files: Vec<(PathBuf, Wanted)> = Vec::new();
    let nodata = Image { nodata: Some("-9999"), ..image.clone() };
    files.push((file(folder, "nodata.tif", std::slice::from_ref(&nodata)), Box::new(said)));
    files.push((file(folder, "plain.tif", std::slice::from_ref(&image)), Box::new(or_zero)));
    // Smaller images behind it change nothing.
    let smaller = Image { kind: 1, ..heights(35, 16, &[]) };
    files.push((file(folder, "overviews.tif", &[nodata, smaller.clone()]), Box::new(said)));
    // A mask shows a part of a tile that is there, and a part of one that is not, which is 0.
    let shown = |x: u32, y: u32| (17..40).contains(&x) && (18..30).contains(&y);
    let of_mask = [[20, 20], [35, 20]];
    let masked = [image.clone(), mask(70, 16, &of_mask, shown), smaller];
    files.push((
        file(folder, "mask.tif", &masked),
        Box::new(move |x, y| shown(x, y).then(|| or_zero(x, y)).flatten()),
    ));
    files.push((
        file(folder, "mask-only.tif", &[heights(70, 16, &[]), mask(70, 16, &of_mask, shown)]),
        Box::new(move |x, y| shown(x, y).then_some(0)),
    ));
    files.push((
        file(folder, "no-mask.tif", &[image.clone(), mask(70, 16, &[], shown)]),
        Box::new(|_, _| None),
    ));
    let beside = file(folder, "beside.tif", &[image]);
    file(folder, "beside.tif.msk", &[Image { kind: 0, is_mask_file: true, ..mask(70, 16, &of_mask, shown) }]);
    files.push((beside, Box::new(move |x, y| shown(x, y).then(|| or_zero(x, y)).flatten())));
    // Alpha, in both orders, of which 0 hides.
    for (is_planar, name) in [(false, "alpha.tif"), (true, "alpha-planar.tif")] {
        let mut image =
            Image { bands: 2, has_alpha: true, is_unsigned: true, is_planar, ..heights(70, 16, &[]) };
        image.fill(&THERE, |x, y, band| if band == 0 { height(x, y) } else { i16::from(x % 5 > 0) });
        files.push((
            file(folder, name, std::slice::from_ref(&image)),
            Box::new(move |x, y| said(x, y).filter(|_| x % 5 > 0)),
        ));
        if is_planar {
            // One band's tile is there, and the other's is not.
            let count = image.chunks.len() as u64;
            assert_eq!(count, 4);
            let last = *image.chunks.keys().next_back().unwrap();
            image.chunks.remove(&last);
            let first = *image.chunks.keys().next().unwrap();
            image.chunks.remove(&first);
            files.push((
                file(folder, "alpha-parts.tif", &[image]),
                Box::new(|x, y| (x / 16 == 1 && y / 16 == 1 && x % 5 > 0).then_some(0)),
            ));
        }
    }
    // Strips.
    let mut strips = Image { chunk: [0, 8], nodata: Some("-9999"), ..heights(70, 16, &[]) };
    strips.fill(&[[0, 20], [0, 69]], |x, y, _| height(x, y));
    files.push((
        file(folder, "strips.tif", &[strips]),
        Box::new(|x, y| [2, 8].contains(&(y / 8)).then(|| height(x, y))),
    ));
    files
}

#[test]
fn what_a_file_left_out_is_what_gdal_reads_there() {
    let folder = tempdir().unwrap();
    for (path, wanted) in small(&folder) {
        check(&path, wanted);
    }
}

/// Tiles of packed colours that were left out are of colour 0.
#[test]
fn colours_that_are_left_out_are_black() {
    let folder = tempdir().unwrap();
    for is_planar in [false, true] {
        let mut image =
            Image { size: [70; 2], chunk: [16; 2], bits: 8, bands: 3, is_planar, ..Image::default() };
        image.fill(&THERE, |x, _, band| if band == 1 { x as i16 } else { 1 });
        let path = file(&folder, "colours.tif", &[image]);
        let options =
            OpenOptions { decode: Some("mapbox".into()), as_stored: true, ..OpenOptions::default() };
        let grid = import_support::collect(&*open_with(&[path], &options).unwrap()).unwrap();
        assert_eq!(grid.at(0, 0), -10_000.0);
        assert_eq!(grid.at(20, 20), (65_536.0 + 256.0 * 20.0 + 1.0 - 100_000.0) / 10.0);
    }
}

/// What GDAL reads at places of the small files, and what its mask says of them.
#[test]
#[ignore = "needs gdal-bin"]
fn gdal_reads_the_same_in_small_files() {
    let folder = tempdir().unwrap();
    let places: Vec<(u32, u32)> =
        (0..70).step_by(3).flat_map(|y| (0..70).step_by(3).map(move |x| (x, y))).collect();
    for (path, wanted) in small(&folder) {
        let values = tools::values(&path, &places);
        let shown = folder.path().join("shown.tif");
        let [from, to] = [&path, &shown].map(|path| path.to_str().unwrap());
        tools::run(folder.path(), "gdal_translate", &["-q", "-b", "mask", from, to]);
        let shown = tools::values(&shown, &places);
        for (at, (x, y)) in places.iter().enumerate() {
            let found = (shown[at] != 0.0).then_some(values[at]);
            assert_eq!(found, wanted(*x, *y).map(f64::from), "{} {x} {y}", path.display());
        }
    }
}

/// Counts what comes.
#[derive(Default)]
struct Counting(Mutex<Counts>);

#[derive(Default, Clone, Copy)]
struct Counts {
    samples: u64,
    made: u64,
    heights: u64,
}

impl SampleSink for Counting {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        self.put_void(window)?;
        let mut counts = self.0.lock().unwrap();
        counts.made += samples.len() as u64;
        counts.heights += samples.iter().map(|v| u64::from(!v.is_nan())).sum::<u64>();
        Ok(())
    }

    fn put_void(&self, window: Window) -> Result<(), LayoutError> {
        self.0.lock().unwrap().samples += u64::from(window.width) * u64::from(window.height);
        Ok(())
    }
}

/// Opens a file, and counts what it gives.
fn count(path: &Path, options: OpenOptions) -> Counts {
    let dem = open_with(&[path.to_owned()], &options).unwrap();
    let counting = Counting::default();
    dem.stream(&counting).unwrap();
    let counts = counting.0.into_inner().unwrap();
    let [wide, high] = [dem.info().samples_wide, dem.info().samples_high].map(u64::from);
    assert_eq!(counts.samples, wide * high);
    counts
}

/// Two tiles far apart in the largest square: nothing is made but these, whatever it is that makes the rest void.
#[test]
fn what_is_void_in_the_largest_square_is_passed_over() {
    let folder = tempdir().unwrap();
    let options = || OpenOptions { scratch: Some(folder.path().to_owned()), ..OpenOptions::default() };
    const TILE: u32 = 512;
    let places = [[3 * TILE, 5 * TILE], [700 * TILE, 800 * TILE]];
    let stored = 2 * u64::from(TILE) * u64::from(TILE);
    let image = heights(SIDE, TILE, &places);
    let nodata = file(&folder, "nodata.tif", &[Image { nodata: Some("-9999"), ..image.clone() }]);
    let counts = count(&nodata, options());
    assert_eq!([counts.made, counts.heights], [stored; 2]);

    // Without a void value all the rest would be heights.
    let plain = file(&folder, "plain.tif", std::slice::from_ref(&image));
    let refused = open_with(&[plain], &options()).err().unwrap().to_string();
    assert!(refused.contains("would all be heights of 0"), "{refused}");

    // But not where a mask hides it; where the mask shows what is not stored it is 0.
    let shown = |x: u32, _: u32| x.is_multiple_of(2);
    let of_mask = [places[0], places[1], [300 * TILE, 300 * TILE]];
    let masked = file(&folder, "mask.tif", &[image, mask(SIDE, TILE, &of_mask, shown)]);
    let counts = count(&masked, options());
    assert_eq!(counts.heights, 3 * stored / 4);
    // Of each square of 2,048 that the mask shows something of, what is not stored is zeros.
    assert!(counts.made <= 3 << 22, "{}", counts.made);

    // Nor where alpha is 0.
    for is_planar in [false, true] {
        let mut image =
            Image { bands: 2, has_alpha: true, is_unsigned: true, is_planar, ..heights(SIDE, TILE, &[]) };
        image.fill(&places, |x, y, band| if band == 0 { height(x, y) } else { 9 });
        let counts = count(&file(&folder, "alpha.tif", &[image]), options());
        assert_eq!([counts.made, counts.heights], [stored; 2]);
    }

    // And what is built of it is what was there.
    let target = folder.path().join("t.iqt");
    let dem = open_with(&[masked], &options()).unwrap();
    build(&*dem, &target, &BuildOptions::default(), &Silent).unwrap();
    let terrain = Terrain::open(&target).unwrap();
    let spacing_m = terrain.grid().spacing_m();
    for (x, y) in [
        (3 * TILE, 5 * TILE),
        (700 * TILE + 500, 800 * TILE + 31),
        (300 * TILE, 300 * TILE + 1),
        (700 * TILE + 501, 800 * TILE),
        (0, 0),
    ] {
        let from_south = [f64::from(x) * spacing_m[0], f64::from(SIDE - 1 - y) * spacing_m[1]];
        let found = terrain.height_m(from_south[0], from_south[1]).unwrap();
        let is_stored = places.iter().any(|at| at[0] / TILE == x / TILE && at[1] / TILE == y / TILE);
        let wanted = (shown(x, y) && x > 0).then(|| if is_stored { f64::from(height(x, y)) } else { 0.0 });
        assert_eq!(found, wanted, "{x} {y}");
    }
}

/// Brought into another system, what no sample reaches is passed over, and what is made is what is made of the part alone.
#[test]
fn what_is_void_is_passed_over_on_the_way_into_another_system() {
    let folder = tempdir().unwrap();
    let options = || OpenOptions {
        scratch: Some(folder.path().to_owned()),
        reproject: Some("EPSG:32634".into()),
        resolution: Some(10.0),
        ..OpenOptions::default()
    };
    const TILE: u32 = 256;
    let places = [[90 * TILE, 70 * TILE], [200 * TILE, 300 * TILE]];
    let large = Image { nodata: Some("-9999"), ..heights(100_000, TILE, &places) };
    let counts = count(&file(&folder, "large.tif", &[large]), options());
    // Blocks that reach the cells of 2048 squared around both tiles.
    assert!(counts.made <= 4 << 22, "{}", counts.made);
    let stored = 2 * u64::from(TILE) * u64::from(TILE);
    assert!(counts.heights.abs_diff(stored) < stored / 20, "{}", counts.heights);
}

/// Five islands in tiles of 512, of which the table has four million places: within a minute and 512 MiB.
#[test]
#[ignore = "takes long"]
fn five_islands_are_built_within_a_minute() {
    let folder = tempdir().unwrap();
    const TILE: u32 = 512;
    let [low, middle, high] = [0, SIDE / 2 / TILE * TILE, (SIDE - 1024) / TILE * TILE];
    let corners = [[low, low], [high, low], [low, high], [high, high], [middle, middle]];
    let places: Vec<[u32; 2]> =
        corners.iter().flat_map(|[x, y]| (0..4).map(move |i| [x + i % 2 * TILE, y + i / 2 * TILE])).collect();
    let image = Image { nodata: Some("-9999"), ..heights(SIDE, TILE, &places) };
    let path = file(&folder, "five.tif", &[image]);
    let target = folder.path().join("t.iqt");
    let begun = Instant::now();
    let dem = open_with(std::slice::from_ref(&path), &OpenOptions::default()).unwrap();
    build(&*dem, &target, &BuildOptions::default().memory_mib(512), &Silent).unwrap();
    assert!(begun.elapsed() < Duration::from_secs(60), "{:?}", begun.elapsed());
    let terrain = Terrain::open(&target).unwrap();
    let spacing_m = terrain.grid().spacing_m();
    let mut places = Vec::new();
    for i in 0..120u32 {
        let [x, y] = corners[i as usize % 5];
        // On the islands, and around them.
        places.push(((x + i * 97 % 1500).min(SIDE - 1), (y + i * 61 % 1300).min(SIDE - 1)));
    }
    let values = tools::values(&path, &places);
    let mut voids = 0;
    for ((x, y), value) in places.into_iter().zip(values) {
        let at = [f64::from(x) * spacing_m[0], f64::from(SIDE - 1 - y) * spacing_m[1]];
        let wanted = (value != -9999.0).then_some(value);
        voids += u32::from(wanted.is_none());
        assert_eq!(terrain.height_m(at[0], at[1]).unwrap(), wanted, "{x} {y}");
    }
    assert!((10..110).contains(&voids), "{voids}");
}
