//! Pyramids of web-map tiles as elevation data and as pictures: every kind of archive gives the same heights and colours, where arithmetic says.

#[cfg(feature = "mbtiles")]
mod databases;
mod hostile;
#[path = "../import_support/mod.rs"]
mod import_support;
mod make;
mod pictures;
mod scattered;
mod zooms;

use import_support::{Grid, collect};
use make::{HALF_M, Pm, Tiles, degrees, folder, hills, mapbox, pmtiles, terrarium, tiles};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, TileOptions, open_with};
use terrasoar_layout::error::LayoutError;

/// Opens a pyramid and streams it.
pub(crate) fn read(path: &Path, decode: Option<&str>, tiles: TileOptions) -> Result<Grid, LayoutError> {
    let options = OpenOptions { decode: decode.map(str::to_owned), tiles, ..OpenOptions::default() };
    collect(&*open_with(&[path.to_owned()], &options)?)
}

/// The message with which opening or streaming fails.
pub(crate) fn refusal(path: &Path, decode: Option<&str>, tiles: TileOptions) -> String {
    match read(path, decode, tiles) {
        Ok(_) => panic!("{} was read", path.display()),
        Err(error) => error.to_string(),
    }
}

/// Columns 530 to 533 and rows 360 to 362 of zoom 10: in the Alps.
const COLUMNS: std::ops::Range<u32> = 530..533;
const ROWS: std::ops::Range<u32> = 360..362;

fn alps(side: u32) -> Tiles {
    tiles(10, COLUMNS, ROWS, side, |col, row| mapbox(hills(col, row)))
}

/// Holds all heights and the place against arithmetic.
fn is_alps(grid: &Grid, side: u32, shown: &str) {
    let first = [COLUMNS.start, ROWS.start].map(|tile| u64::from(tile) * u64::from(side));
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [3 * side, 2 * side], "{shown}");
    for row in 0..2 * side {
        for col in 0..3 * side {
            let wanted = hills(first[0] + u64::from(col), first[1] + u64::from(row)) as f64 / 10.0;
            assert_eq!(grid.at(col, row), wanted, "{shown}: ({col}, {row})");
        }
    }
    let step = 2.0 * HALF_M / (1024.0 * f64::from(side));
    let corner = [first[0] as f64 * step - HALF_M, HALF_M - first[1] as f64 * step];
    let wanted = [corner[0] + step / 2.0, step, 0.0, corner[1] - step / 2.0, 0.0, -step];
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    for (got, wanted) in map.iter().zip(wanted) {
        assert!((got - wanted).abs() < 1e-6, "{shown}: {map:?}, not {wanted:?}");
    }
    assert_eq!(grid.info.georeference.epsg, Some(3857), "{shown}");
    // On the ground a step is shorter by the cosine of the latitude, a little more along meridians: the ellipsoid's radii.
    let [_, south, _, north] = degrees(10, COLUMNS, ROWS);
    let shorter = ((south + north) / 2.0).to_radians().cos();
    for metres in grid.info.georeference.spacing_m.unwrap() {
        assert!((metres / (step * shorter) - 1.0).abs() < 0.004, "{shown}: {metres} m of {step}");
    }
}

#[test]
fn every_archive_has_the_same_heights() {
    let folder_of = tempdir().unwrap();
    let made = alps(64);
    let bounds = degrees(10, COLUMNS, ROWS);
    let mut archives: Vec<(String, PathBuf)> = Vec::new();
    for (name, tms) in [("xyz", false), ("tms", true)] {
        let path = folder(&folder_of.path().join(name), &made, ".png", tms);
        if tms {
            std::fs::write(path.join("tilemapresource.xml"), "<TileMap><SRS>EPSG:3857</SRS></TileMap>")
                .unwrap();
        }
        archives.push((name.into(), path));
    }
    let stated = folder(&folder_of.path().join("stated"), &made, ".png", true);
    std::fs::write(stated.join("metadata.json"), r#"{"scheme": "tms", "encoding": "mapbox"}"#).unwrap();
    archives.push(("stated".into(), stated));
    for packing in [1, 2, 4] {
        for (leaf, clustered) in [(0, true), (2, true), (1, false)] {
            let how = Pm { packing, leaf, clustered };
            let path = folder_of.path().join(format!("{packing}-{leaf}.pmtiles"));
            archives.push((format!("{how:?}"), pmtiles(&path, &made, "{}", bounds, how)));
        }
    }
    #[cfg(feature = "mbtiles")]
    for is_view in [false, true] {
        let path = folder_of.path().join(format!("{is_view}.mbtiles"));
        archives
            .push((format!("view: {is_view}"), make::mbtiles(&path, &made, &[("format", "png")], is_view)));
    }
    for (name, path) in &archives {
        let grid =
            read(path, Some("mapbox"), TileOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        is_alps(&grid, 64, name);
        assert_eq!(grid.voids(), 0);
    }
    // Rows that nothing says run north, said by a person.
    let silent = folder(&folder_of.path().join("silent"), &made, ".png", true);
    let from_south = TileOptions { from_south: true, ..TileOptions::default() };
    let origins =
        |path: &Path, tiles| format!("{:?}", read(path, Some("mapbox"), tiles).unwrap().info.about.origins);
    assert!(origins(&silent, TileOptions::default()).contains("nothing says from where rows"));
    for (path, tiles) in [(&silent, from_south.clone()), (&archives[2].1, TileOptions::default())] {
        assert!(!origins(path, tiles).contains("nothing says from where rows"));
    }
    is_alps(&read(&silent, Some("mapbox"), from_south.clone()).unwrap(), 64, "by flag");
    let words = refusal(&archives[3].1, Some("mapbox"), from_south);
    assert!(words.contains("only rows of a folder"), "{words}");
}

#[test]
fn tiles_of_twice_the_texels_and_webp() {
    let folder_of = tempdir().unwrap();
    let fine = folder(&folder_of.path().join("fine"), &alps(128), "@2x.png", false);
    is_alps(&read(&fine, Some("mapbox"), TileOptions::default()).unwrap(), 128, "@2x");
    // Beside tiles of half the texels the finer ones count.
    folder(&fine, &alps(64), ".png", false);
    is_alps(&read(&fine, Some("mapbox"), TileOptions::default()).unwrap(), 128, "both");

    let mut packed = Tiles::new();
    for (x, y) in COLUMNS.flat_map(|x| ROWS.map(move |y| (x, y))) {
        let at = |part: u32, tile: u32| u64::from(tile) * 64 + u64::from(part);
        packed.insert((10, x, y), make::webp(64, |col, row| mapbox(hills(at(col, x), at(row, y)))));
    }
    let webp = folder(&folder_of.path().join("webp"), &packed, ".webp", false);
    is_alps(&read(&webp, Some("mapbox"), TileOptions::default()).unwrap(), 64, "WebP");
}

#[test]
fn how_heights_are_packed_is_typed_stated_told_or_asked_for() {
    let folder_of = tempdir().unwrap();
    let parts = |col: u64, row: u64| hills(col, row) * 25 + 7;
    let made = tiles(10, COLUMNS, ROWS, 64, |col, row| terrarium(parts(col, row)));
    let wanted = |col: u32, row: u32| {
        parts(u64::from(COLUMNS.start * 64 + col), u64::from(ROWS.start * 64 + row)) as f64 / 256.0
    };
    let holds = |grid: &Grid, shown: &str| {
        for (col, row) in [(0, 0), (191, 127), (64, 63), (100, 20)] {
            assert_eq!(grid.at(col, row), wanted(col, row), "{shown}: ({col}, {row})");
        }
    };
    let plain = folder(&folder_of.path().join("plain"), &made, ".png", false);
    holds(&read(&plain, Some("terrarium"), TileOptions::default()).unwrap(), "typed");
    holds(&read(&plain, Some("256,1,0.00390625,-32768"), TileOptions::default()).unwrap(), "factors");

    // Colours that only Terrarium can have, said aloud.
    let dem = open_with(std::slice::from_ref(&plain), &OpenOptions::default()).unwrap();
    holds(&collect(&*dem).unwrap(), "told by the colours");
    let warnings = dem.warnings();
    assert!(warnings.iter().any(|warning| warning.words.contains("can only be terrarium's")), "{warnings:?}");

    for (name, text, says) in [
        (
            "tiles.json",
            r#"{"encoding": "terrarium", "bounds": [0, 40, 20, 60]}"#,
            "terrarium from tiles.json",
        ),
        (
            "metadata.json",
            r#"{"encoding": "custom", "redFactor": 256, "greenFactor": 1, "blueFactor": 0.00390625, "baseShift": 32768}"#,
            "from metadata.json",
        ),
    ] {
        let path = folder(&folder_of.path().join(name), &made, ".png", false);
        std::fs::write(path.join(name), text).unwrap();
        let dem = open_with(&[path], &OpenOptions::default()).unwrap();
        holds(&collect(&*dem).unwrap(), name);
        let origins = &dem.info().about.origins;
        assert!(origins.iter().any(|(_, words)| words.contains(says)), "{origins:?}");
        assert!(!dem.warnings().iter().any(|w| w.words.contains("packed")), "{:?}", dem.warnings());
    }
    #[cfg(feature = "mbtiles")]
    {
        let path = folder_of.path().join("said.mbtiles");
        make::mbtiles(&path, &made, &[("encoding", "terrarium")], false);
        holds(&read(&path, None, TileOptions::default()).unwrap(), "MBTiles");
    }
    let path = folder_of.path().join("said.pmtiles");
    pmtiles(&path, &made, r#"{"encoding": "terrarium"}"#, degrees(10, COLUMNS, ROWS), Pm::PLAIN);
    holds(&read(&path, None, TileOptions::default()).unwrap(), "PMTiles");

    // A picture is no heights, and nobody says so.
    let picture = tiles(3, 2..4, 2..3, 64, |col, row| [(col * 3) as u8, (row * 5) as u8, 90, 255]);
    let picture = folder(&folder_of.path().join("picture"), &picture, ".png", false);
    let words = refusal(&picture, None, TileOptions::default());
    assert!(words.contains("leave a doubt"), "{words}");
    std::fs::write(picture.join("tiles.json"), r#"{"encoding": "gsi"}"#).unwrap();
    let words = refusal(&picture, None, TileOptions::default());
    assert!(words.contains("\"gsi\", which is not known"), "{words}");
}

#[test]
fn transparent_texels_are_voids_and_so_are_missing_tiles() {
    let folder_of = tempdir().unwrap();
    let mut made =
        tiles(
            10,
            COLUMNS,
            ROWS,
            64,
            |col, row| {
                if (col + row) % 5 == 0 { [0; 4] } else { mapbox(hills(col, row)) }
            },
        );
    made.remove(&(10, 531, 360));
    let path = folder(&folder_of.path().join("holes"), &made, ".png", false);
    let options = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
    let dem = open_with(&[path], &options).unwrap();
    let grid = collect(&*dem).unwrap();
    for (col, row) in (0..192).flat_map(|col| (0..128).map(move |row| (col, row))) {
        let is_missing = (64..128).contains(&col) && row < 64;
        let is_void = is_missing || (530 * 64 + 360 * 64 + col + row) % 5 == 0;
        assert_eq!(grid.at(col, row).is_nan(), is_void, "({col}, {row})");
    }
    let warnings = dem.warnings();
    assert!(
        warnings.iter().any(|warning| warning.words == "1 of 6 tiles are missing: they are void"),
        "{warnings:?}"
    );
}

/// Black is -10,000 m as Mapbox packs heights: it stands where a picture has nothing, and no land is as low.
#[test]
fn black_texels_are_told_and_can_be_named() {
    let folder_of = tempdir().unwrap();
    let black = |col: u64, row: u64| (col + row).is_multiple_of(7);
    let made =
        tiles(
            10,
            COLUMNS,
            ROWS,
            16,
            |col, row| {
                if black(col, row) { [0, 0, 0, 255] } else { mapbox(hills(col, row)) }
            },
        );
    let path = folder(&folder_of.path().join("black"), &made, ".png", false);
    let opened = |nodata: Vec<String>| {
        let options = OpenOptions { decode: Some("mapbox".into()), nodata, ..OpenOptions::default() };
        let dem = open_with(std::slice::from_ref(&path), &options).unwrap();
        let grid = collect(&*dem).unwrap();
        (grid, dem.warnings())
    };
    let (grid, said) = opened(Vec::new());
    let told = said.iter().find(|warning| warning.words.contains("samples are -10000"));
    let told = told.unwrap_or_else(|| panic!("{said:?}"));
    let value = told.mended_by.as_ref().unwrap().1.clone();
    assert_eq!((value.as_str(), grid.voids()), ("-10000", 0));
    let (grid, said) = opened(vec![value]);
    assert!(said.is_empty(), "{said:?}");
    let first = [COLUMNS.start, ROWS.start].map(|tile| u64::from(tile) * 16);
    for row in 0..grid.info.samples_high {
        for col in 0..grid.info.samples_wide {
            let is_black = black(first[0] + u64::from(col), first[1] + u64::from(row));
            assert_eq!(grid.at(col, row).is_nan(), is_black, "{col} {row}");
        }
    }
}
