//! Pyramids as pictures, by themselves and laid over a terrain.

use crate::make::{Pm, Tiles, degrees, folder, mapbox, pmtiles, tiles, webp};
use std::path::Path;
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, PictureOptions, TileOptions, open_image, open_images, open_with};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::imagery::ImageSource;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

const SIDE: u32 = 64;

fn colour(col: u64, row: u64) -> [u8; 4] {
    [(col % 251) as u8, (row % 241) as u8, (col / 64 * 7 % 256) as u8, 255]
}

fn texels(image: &dyn ImageSource) -> Vec<[u8; 4]> {
    let [wide, high] = image.info().texels.map(|side| side as usize);
    let mut all = vec![0; wide * high * 4];
    let mut rows = image.rows().unwrap();
    // Some rows at a time, across the rims of tiles.
    for part in all.chunks_mut(wide * 4 * 25) {
        rows.read(part).unwrap();
    }
    all.as_chunks::<4>().0.to_vec()
}

#[test]
fn every_archive_has_the_same_colours() {
    let folder_of = tempdir().unwrap();
    let made = tiles(9, 260..263, 170..172, SIDE, colour);
    let mut packed = Tiles::new();
    for (zoom, x, y) in made.keys() {
        let of_world = |at: u32, tile: u32| u64::from(tile) * u64::from(SIDE) + u64::from(at);
        packed.insert((*zoom, *x, *y), webp(SIDE, |col, row| colour(of_world(col, *x), of_world(row, *y))));
    }
    let bounds = degrees(9, 260..263, 170..172);
    let mut archives = vec![
        folder(&folder_of.path().join("png"), &made, ".png", false),
        folder(&folder_of.path().join("webp"), &packed, ".webp", false),
        pmtiles(&folder_of.path().join("a.pmtiles"), &packed, "{}", bounds, Pm::PLAIN),
    ];
    #[cfg(feature = "mbtiles")]
    archives.push(crate::make::mbtiles(
        &folder_of.path().join("a.mbtiles"),
        &made,
        &[("format", "png")],
        true,
    ));
    archives.push(folder(&folder_of.path().join("mixed"), &made, ".PNG", false));
    for path in archives {
        let image = open_image(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(image.info().texels, [3 * SIDE, 2 * SIDE], "{}", path.display());
        assert_eq!(image.info().georeference.epsg, Some(3857));
        for (i, texel) in texels(&*image).iter().enumerate() {
            let [col, row] = [i as u32 % (3 * SIDE), i as u32 / (3 * SIDE)];
            let wanted = colour(u64::from(260 * SIDE + col), u64::from(170 * SIDE + row));
            assert_eq!(*texel, wanted, "{}: ({col}, {row})", path.display());
        }
    }
}

#[test]
fn missing_tiles_are_coarser_ones_or_transparent() {
    let folder_of = tempdir().unwrap();
    let mut made = tiles(9, 260..264, 170..172, SIDE, colour);
    for x in [261, 263] {
        made.remove(&(9, x, 171));
    }
    made.extend(tiles(8, 130..131, 85..86, SIDE, colour));
    let path = folder(&folder_of.path().join("gaps"), &made, ".png", false);
    let image = open_image(&path).unwrap();
    let notes = &image.info().notes;
    let words =
        "2 of 8 tiles are missing: 1 are made of coarser tiles, of zoom 8 at least, the other 1 are void";
    assert!(notes.iter().any(|note| note == words), "{notes:?}");
    let all = texels(&*image);
    let at = |col: u32, row: u32| all[(row * 4 * SIDE + col) as usize];
    for (col, row) in (0..SIDE).flat_map(|col| (0..SIDE).map(move |row| (col, row))) {
        let coarse = colour(u64::from((261 * SIDE + col) / 2), u64::from((171 * SIDE + row) / 2));
        assert_eq!(at(SIDE + col, SIDE + row), coarse);
        assert_eq!(at(3 * SIDE + col, SIDE + row), [0; 4]);
        assert_eq!(
            at(2 * SIDE + col, SIDE + row),
            colour(u64::from(262 * SIDE + col), u64::from(171 * SIDE + row))
        );
    }
}

/// A terrain of tiles of its own, of zoom 9.
fn terrain(folder_of: &Path) -> Terrain {
    let made = tiles(9, 260..262, 170..172, SIDE, |col, row| mapbox((col % 500 + 2 * (row % 500)) as i64));
    let path = folder(&folder_of.join("land"), &made, ".png", false);
    let options = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
    let dem = open_with(&[path], &options).unwrap();
    let file = folder_of.join("land.iqt");
    build(&*dem, &file, &BuildOptions::default(), &Silent).unwrap();
    Terrain::open(&file).unwrap()
}

#[test]
fn of_a_world_only_what_lies_on_the_terrain_is_read() {
    let folder_of = tempdir().unwrap();
    let terrain = terrain(folder_of.path());
    // A world of zoom 4, and finer tiles around the terrain, of which one at the far end is no picture at all.
    let mut made = tiles(4, 0..16, 0..16, SIDE, colour);
    made.extend(tiles(10, 518..526, 338..346, SIDE, colour));
    made.insert((10, 3, 3), b"<html>not found</html>".to_vec());
    let path = pmtiles(
        &folder_of.path().join("world.pmtiles"),
        &made,
        "{}",
        [-180.0, -85.0, 180.0, 85.0],
        Pm::PLAIN,
    );
    let open = |options: TileOptions| {
        let options = PictureOptions { tiles: options, ..PictureOptions::default() };
        open_images(std::slice::from_ref(&path), Some(terrain.header()), &options).unwrap().remove(0)
    };
    let image = open(TileOptions::default());
    // The terrain's samples reach from the middle of its first texel to that of its last: 128 of zoom 9 without half a texel at each side.
    assert_eq!(image.info().texels, [254, 254]);
    let all = texels(&*image);
    for (col, row) in [(0, 0), (253, 253), (100, 7)] {
        let wanted = colour(u64::from(520 * SIDE + 1 + col), u64::from(340 * SIDE + 1 + row));
        assert_eq!(all[(row * 254 + col) as usize], wanted, "({col}, {row})");
    }
    let coarse = open(TileOptions { zoom: Some(4), ..TileOptions::default() });
    assert!(coarse.info().texels.iter().all(|side| (4..8).contains(side)), "{:?}", coarse.info().texels);

    let elsewhere = tiles(9, 100..102, 100..102, SIDE, colour);
    let elsewhere = folder(&folder_of.path().join("elsewhere"), &elsewhere, ".png", false);
    let refused =
        open_images(&[elsewhere], Some(terrain.header()), &PictureOptions::default()).err().unwrap();
    assert!(refused.to_string().contains("none of its tiles lies on the terrain"), "{refused}");
}
