//! Which zoom and which part are read, and what stands for what is missing.

use crate::import_support::collect;
use crate::make::{HALF_M, Pm, Tiles, degrees, folder, hills, mapbox, pmtiles, tiles};
use crate::{read, refusal};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, PictureOptions, TileOptions, open_images, open_with};

const SIDE: u32 = 32;

/// A plane: a tenth of a metre a texel of zoom 8 east, and two of them south.
fn plane(zoom: u8, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> Tiles {
    let scale = f64::from(1u32 << (8 - zoom));
    tiles(zoom, columns, rows, SIDE, |col, row| {
        let [x, y] = [col, row].map(|at| (at as f64 + 0.5) * scale - 0.5);
        // The middle of a coarse texel lies between fine ones.
        mapbox(((x + 2.0 * y) - 10_000.0).round() as i64)
    })
}

fn zoom(zoom: u8) -> TileOptions {
    TileOptions { zoom: Some(zoom), ..TileOptions::default() }
}

#[test]
fn the_deepest_complete_zoom_is_read_and_said() {
    let folder_of = tempdir().unwrap();
    let mut made = plane(6, 32..34, 20..22);
    made.extend(plane(7, 64..68, 40..44));
    let path = folder_of.path().join("all.pmtiles");
    pmtiles(&path, &made, "{}", [-180.0, -85.0, 180.0, 85.0], Pm::PLAIN);
    let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [128, 128]);
    let said = |grid: &crate::Grid| {
        let origins = &grid.info.about.origins;
        origins.iter().find(|(what, _)| what == "tiles").map(|(_, words)| words.clone()).unwrap()
    };
    assert_eq!(said(&grid), "zoom 7 of 6 to 7: 16 tiles of 32 x 32 texels, 128 x 128 of which are read");
    let typed = read(&path, Some("mapbox"), zoom(6)).unwrap();
    assert_eq!(typed.info.samples_wide, 64);
    assert!(said(&typed).contains("as typed"), "{}", said(&typed));
    let words = refusal(&path, Some("mapbox"), zoom(9));
    assert!(words.contains("no tiles of zoom 9 here; it has 6, 7"), "{words}");

    // A town in finer tiles does not decide for the country.
    made.extend(plane(8, 130..132, 81..83));
    pmtiles(&path, &made, "{}", [-180.0, -85.0, 180.0, 85.0], Pm::PLAIN);
    let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    assert_eq!(grid.info.samples_wide, 128);
    assert!(said(&grid).contains("zoom 7 of 6 to 8, the deepest that covers the ground"), "{}", said(&grid));
    // But where only the town is asked for it does.
    let [west, south, east, north] = degrees(8, 130..132, 81..83);
    let town = TileOptions { bounds_deg: Some([west, south, east, north]), ..TileOptions::default() };
    let grid = read(&path, Some("mapbox"), town).unwrap();
    assert!(said(&grid).starts_with("zoom 8 of 6 to 8: 4 tiles"), "{}", said(&grid));
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [64, 64]);
}

/// The last columns of the world and the first ones are one grid, of which the eastern half has a row less.
#[test]
fn bounds_across_180_degrees_join_both_sides() {
    let folder_of = tempdir().unwrap();
    let texel = |col: u64, row: u64| mapbox(hills(col, row));
    let west = tiles(6, 62..64, 25..27, 16, texel);
    let east = tiles(6, 0..2, 25..26, 16, texel);
    let all: Tiles = west.clone().into_iter().chain(east).collect();
    let path = folder(&folder_of.path().join("both"), &all, ".png", false);
    let [_, south, _, north] = degrees(6, 0..2, 25..27);
    let bounds = |west: f64, east: f64| TileOptions {
        bounds_deg: Some([west, south, east, north]),
        ..TileOptions::default()
    };
    // From the first texel of column 62 to the last of column 1, and some less.
    for (options, skipped, wide) in [(bounds(168.75, -168.75), 0, 64), (bounds(174.375, -174.375), 16, 32)] {
        let grid = read(&path, Some("mapbox"), options).unwrap();
        assert_eq!([grid.info.samples_wide, grid.info.samples_high], [wide, 32]);
        for (col, row) in (0..wide).flat_map(|col| (0..32).map(move |row| (col, row))) {
            let of_world = (62 * 16 + skipped + u64::from(col)) % 1024;
            let wanted = hills(of_world, 25 * 16 + u64::from(row)) as f64 / 10.0;
            let is_void = of_world < 512 && row >= 16;
            let found = grid.at(col, row);
            assert!(found == wanted || is_void && found.is_nan(), "{col}, {row}: {found} {wanted}");
            assert_eq!(found.is_nan(), is_void);
        }
        let map = grid.info.georeference.pixel_to_crs.unwrap();
        let step = 2.0 * HALF_M / 1024.0;
        assert!((map[0] - (HALF_M - f64::from(wide / 2) * step + step / 2.0)).abs() < 1e-6, "{map:?}");
    }
    // Brought into a zone that both lie in; and where there are tiles on one side only.
    let options = OpenOptions {
        decode: Some("mapbox".into()),
        tiles: bounds(168.75, -168.75),
        reproject: Some("utm".into()),
        ..OpenOptions::default()
    };
    let grid = collect(&*open_with(std::slice::from_ref(&path), &options).unwrap()).unwrap();
    assert!(grid.info.samples_wide < 90 && grid.samples.len() - grid.voids() > 1000);
    let path = folder(&folder_of.path().join("west"), &west, ".png", false);
    let options = OpenOptions { reproject: None, ..options };
    let dem = open_with(std::slice::from_ref(&path), &options).unwrap();
    assert_eq!(collect(&*dem).unwrap().info.samples_wide, 32);
    let said: Vec<String> = dem.warnings().into_iter().map(|warning| warning.words).collect();
    assert!(said.iter().any(|words| words.contains("one side of 180 degrees")), "{said:?}");
    // Neither here nor there.
    let nothing = refusal(
        &path,
        Some("mapbox"),
        TileOptions { bounds_deg: Some([20.0, 0.0, -20.0, 10.0]), ..TileOptions::default() },
    );
    assert!(nothing.contains("none of its tiles"), "{nothing}");
}

#[test]
fn bounds_cut_to_the_texel() {
    let folder_of = tempdir().unwrap();
    let path = folder(&folder_of.path().join("tiles"), &plane(8, 100..104, 60..63), ".png", false);
    // From a texel and a half in: the texel that is cut is read as a whole.
    let all = f64::from(256 * SIDE);
    let degree = |texel: f64| texel / all * 360.0 - 180.0;
    let north_of = |texel: f64| (std::f64::consts::PI * (1.0 - 2.0 * texel / all)).sinh().atan().to_degrees();
    let [left, top] = [100 * SIDE, 60 * SIDE].map(f64::from);
    let bounds = [degree(left + 1.5), north_of(top + 50.0), degree(left + 40.0), north_of(top + 3.25)];
    let cut = TileOptions { bounds_deg: Some(bounds), ..TileOptions::default() };
    let grid = read(&path, Some("mapbox"), cut).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [39, 47]);
    let whole = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    for (col, row) in [(0, 0), (38, 46), (20, 30)] {
        assert_eq!(grid.at(col, row), whole.at(col + 1, row + 3));
    }
    let [a, b] = [&grid, &whole].map(|grid| grid.info.georeference.pixel_to_crs.unwrap());
    assert!((a[0] - b[0] - b[1]).abs() < 1e-6 && (a[3] - b[3] - 3.0 * b[5]).abs() < 1e-6);

    let beside = TileOptions { bounds_deg: Some([0.0, 0.0, 1.0, 1.0]), ..TileOptions::default() };
    let words = refusal(&path, Some("mapbox"), beside);
    assert!(words.contains("none of its tiles lies in these bounds"), "{words}");
    let turned = TileOptions { bounds_deg: Some([0.0, 2.0, 1.0, 1.0]), ..TileOptions::default() };
    let words = refusal(&path, Some("mapbox"), turned);
    assert!(words.contains("the second less than the fourth"), "{words}");
}

#[test]
fn stated_bounds_cut_as_well_and_wrong_ones_do_not_lose_everything() {
    let folder_of = tempdir().unwrap();
    let made = plane(8, 100..104, 60..63);
    let path = folder_of.path().join("cut.pmtiles");
    pmtiles(&path, &made, "{}", degrees(8, 101..103, 60..62), Pm::PLAIN);
    let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [2 * SIDE, 2 * SIDE]);
    pmtiles(&path, &made, "{}", [10.0, 10.0, 11.0, 11.0], Pm::PLAIN);
    let words = refusal(&path, Some("mapbox"), TileOptions::default());
    assert!(words.contains("the bounds that it states; state them yourself"), "{words}");
    let typed = TileOptions { bounds_deg: Some(degrees(8, 100..104, 60..63)), ..TileOptions::default() };
    assert_eq!(read(&path, Some("mapbox"), typed).unwrap().info.samples_wide, 4 * SIDE);
}

#[test]
fn a_missing_tile_is_made_of_the_one_above() {
    let folder_of = tempdir().unwrap();
    let mut made = plane(8, 100..104, 60..64);
    made.remove(&(8, 101, 61));
    made.remove(&(8, 102, 63));
    made.remove(&(8, 103, 63));
    made.extend(plane(7, 50..51, 30..31));
    made.extend(plane(5, 12..13, 7..8));
    made.remove(&(7, 51, 31));
    let path = folder(&folder_of.path().join("gaps"), &made, ".png", false);
    let options = OpenOptions { decode: Some("mapbox".into()), tiles: zoom(8), ..OpenOptions::default() };
    let dem = open_with(&[path], &options).unwrap();
    let grid = super::collect(&*dem).unwrap();
    let warned: Vec<String> = dem.warnings().into_iter().map(|warning| warning.words).collect();
    assert!(
        warned.contains(
            &"3 of 16 tiles are missing: they are made of coarser tiles, of zoom 5 at least".to_owned()
        ),
        "{warned:?}"
    );
    let wanted =
        |col: u32, row: u32| f64::from(100 * SIDE + col) / 10.0 + f64::from(60 * SIDE + row) / 5.0 - 1000.0;
    for (col, row) in (0..4 * SIDE).flat_map(|col| (0..4 * SIDE).map(move |row| (col, row))) {
        let [x, y] = [col / SIDE, row / SIDE];
        let off = (grid.at(col, row) - wanted(col, row)).abs();
        // A coarse height is rounded to a tenth; within half a coarse texel of its rim it is that of the rim.
        let (steps, rim) = match (x, y) {
            (1, 1) => (2.0, true),
            (2 | 3, 3) => (8.0, true),
            _ => (0.0, false),
        };
        let most = if rim { 0.11 + steps / 2.0 * 0.3 } else { 1e-9 };
        assert!(off <= most, "({col}, {row}): {} is {off} off", grid.at(col, row));
        let inner = col % SIDE >= 8 && col % SIDE < SIDE - 8 && row % SIDE >= 8 && row % SIDE < SIDE - 8;
        assert!(!inner || off <= 0.11, "({col}, {row}): {off} off far from a rim");
    }
}

/// What is asked of a pyramid is not dropped without a word where there is none.
#[test]
fn what_is_for_pyramids_is_refused_of_other_files() {
    let folder = tempdir().unwrap();
    let [grid, other, picture] = ["a.asc", "b.asc", "c.png"].map(|name| folder.path().join(name));
    let ascii = |x: u32| format!("ncols 3\nnrows 2\nxllcorner {x}\nyllcorner 0\ncellsize 1\n1 2 3\n4 5 6\n");
    std::fs::write(&grid, ascii(0)).unwrap();
    std::fs::write(&other, ascii(3)).unwrap();
    let asked = [
        TileOptions { zoom: Some(3), ..TileOptions::default() },
        TileOptions { bounds_deg: Some([0.0, 0.0, 1.0, 1.0]), ..TileOptions::default() },
        TileOptions { from_south: true, ..TileOptions::default() },
    ];
    for tiles in asked {
        for paths in [vec![grid.clone()], vec![grid.clone(), other.clone()]] {
            let options = OpenOptions { tiles: tiles.clone(), ..OpenOptions::default() };
            let error = open_with(&paths, &options).err().expect("refused").to_string();
            assert!(error.contains("pyramids of map tiles"), "{error}");
            assert!(open_with(&paths, &OpenOptions::default()).is_ok());
        }
        let options = PictureOptions { tiles, ..PictureOptions::default() };
        let error =
            open_images(std::slice::from_ref(&picture), None, &options).err().expect("refused").to_string();
        assert!(error.contains("pyramids of map tiles"), "{error}");
    }
}
