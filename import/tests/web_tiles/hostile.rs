//! Pyramids that are damaged or made to do harm end in words, soon and in little memory.

use crate::make::{
    Pm, Tiles, directory, folder, mapbox, packed, pm_file, pmtiles, png, png_of, tiles, varint,
};
use crate::{read, refusal};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::tempdir;
use terrasoar_import::TileOptions;

const WORLD: [f64; 4] = [-180.0, -85.0, 180.0, 85.0];

/// A lossy WebP of 16 x 16 texels, by GDAL.
const LOSSY: [u8; 134] = [
    82, 73, 70, 70, 126, 0, 0, 0, 87, 69, 66, 80, 86, 80, 56, 32, 114, 0, 0, 0, 48, 2, 0, 157, 1, 42, 16, 0,
    16, 0, 1, 64, 38, 37, 176, 2, 116, 186, 0, 2, 84, 36, 53, 222, 60, 128, 0, 254, 254, 170, 118, 15, 153,
    35, 82, 168, 232, 72, 253, 225, 212, 153, 201, 56, 126, 246, 235, 127, 229, 87, 173, 73, 183, 70, 227,
    223, 139, 231, 241, 244, 191, 234, 208, 116, 126, 202, 81, 77, 239, 15, 231, 254, 165, 249, 132, 24, 106,
    77, 152, 3, 8, 90, 83, 117, 255, 200, 174, 135, 175, 253, 227, 99, 154, 255, 210, 14, 181, 63, 243, 127,
    178, 183, 253, 127, 219, 204, 25, 255, 115, 255, 0, 0, 0, 0,
];

/// What a pyramid of packed heights is refused with; it must not take long.
pub(crate) fn refused(path: &Path) -> String {
    let begun = Instant::now();
    let words = refusal(path, Some("mapbox"), TileOptions::default());
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}: {words}", begun.elapsed());
    words
}

fn flat() -> Tiles {
    tiles(5, 10..13, 8..10, 16, |col, row| mapbox((col + row) as i64))
}

/// A folder of good tiles with one other in its middle.
fn with(folder_of: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let mut made = flat();
    made.insert((5, 11, 9), bytes.to_vec());
    folder(&folder_of.join(name), &made, ".png", false)
}

#[test]
fn a_tile_that_is_none_is_named() {
    let folder_of = tempdir().unwrap();
    let good = png(16, |_, _| mapbox(5));
    let mut flipped = good.clone();
    let middle = flipped.len() - 20;
    flipped[middle] ^= 0x55;
    for (name, bytes, wanted) in [
        ("cut", &good[..good.len() / 2], "damaged or cut short"),
        ("flipped", &flipped, "damaged or cut short"),
        ("empty", b"", "it is empty"),
        ("text", b"<html>404</html>", "a web page or another text"),
        ("vector", b"\x1f\x8b\x08", "vector tiles"),
        ("noise", &[7; 300], "of an unknown format"),
        ("other size", &png(32, |_, _| mapbox(5)), "32 x 32 texels, and others of zoom 5 have 16 x 16"),
        ("no square", &png_of([16, 8], |_, _| mapbox(5)), "16 x 8 texels, and tiles are squares"),
        ("lossy", &LOSSY, "lossy WebP, which changes colours"),
        ("webp", &LOSSY[..60], "WebP picture is damaged"),
    ] {
        let words = refused(&with(folder_of.path(), name, bytes));
        assert!(words.contains(wanted) && words.contains("5/11/9.png"), "{name}: {words}");
    }
}

#[test]
fn a_picture_that_unpacks_to_a_world_is_refused_by_its_size() {
    let folder_of = tempdir().unwrap();
    // A head of 60000 x 60000 texels, and a stream of nothing.
    let mut bomb = png(16, |_, _| mapbox(5));
    for (at, byte) in 60_000u32.to_be_bytes().into_iter().cycle().take(8).enumerate() {
        bomb[16 + at] = byte;
    }
    let sum = crc32fast::hash(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&sum.to_be_bytes());
    let words = refused(&with(folder_of.path(), "bomb", &bomb));
    assert!(words.contains("60000 x 60000 texels"), "{words}");
    // The same in the stream inside a WebP, whose canvas is small.
    let mut webp = b"RIFF\0\0\0\0WEBPVP8X\x0a\0\0\0\0\0\0\0\x0f\0\0\x0f\0\0".to_vec();
    let mut inner = LOSSY[12..].to_vec();
    inner[14..18].copy_from_slice(&[0xff, 0x3f, 0xff, 0x3f]);
    webp.extend(inner);
    let length = (webp.len() as u32 - 8).to_le_bytes();
    webp[4..8].copy_from_slice(&length);
    let words = refused(&with(folder_of.path(), "canvas", &webp));
    assert!(words.contains("WebP picture is damaged"), "{words}");
}

/// Attributes of one element are compared with each other where a tree is made of the text.
#[test]
fn a_tile_map_of_attributes_without_end_says_nothing() {
    let folder_of = tempdir().unwrap();
    let path = folder(&folder_of.path().join("crowd"), &flat(), ".png", false);
    let plain = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    let crowd: String = (0..300_000).map(|i| format!(" a{i}=\"\"")).collect();
    for text in [format!("<TileMap{crowd}/>"), format!("<TileMap>{}", "<a>".repeat(1 << 20))] {
        std::fs::write(path.join("tilemapresource.xml"), text).unwrap();
        let begun = Instant::now();
        let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
        assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
        assert_eq!(grid.samples, plain.samples);
    }
}

#[cfg(unix)]
#[test]
fn links_in_a_ring_are_not_followed() {
    let folder_of = tempdir().unwrap();
    let path = folder(&folder_of.path().join("ring"), &flat(), ".png", false);
    std::os::unix::fs::symlink(&path, path.join("6")).unwrap();
    std::os::unix::fs::symlink(path.join("5"), path.join("5/3")).unwrap();
    std::os::unix::fs::symlink("7", path.join("7")).unwrap();
    let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [48, 32]);
}

fn pm(folder_of: &Path, name: &str, how: Pm, root: &[u8], leaves: &[u8], data: &[u8]) -> PathBuf {
    let path = folder_of.join(format!("{name}.pmtiles"));
    std::fs::write(&path, pm_file(how, root, "{}", leaves, data, 2, WORLD)).unwrap();
    path
}

#[test]
fn directories_that_lead_round_or_overflow_are_damage() {
    let folder_of = tempdir().unwrap();
    let plain = Pm { packing: 1, leaf: 0, clustered: true };
    let tile = png(16, |_, _| mapbox(5));
    let length = tile.len() as u64;
    let is = |name: &str, root: &[u8], leaves: &[u8], wanted: &str| {
        let words = refused(&pm(folder_of.path(), name, plain, root, leaves, &tile));
        assert!(words.contains(wanted), "{name}: {words}");
    };
    // A leaf whose only entry is the leaf itself.
    let ring = directory(&[[5, 0, 0, 5]]);
    assert_eq!(ring.len(), 5);
    is("ring", &ring, &ring, "more than 4 deep");
    // Two entries that share a leaf: the second one's numbers are not in it.
    let leaf = directory(&[[5, 1, 0, length]]);
    let shared = directory(&[[5, 0, 0, leaf.len() as u64], [6, 0, 0, leaf.len() as u64]]);
    is("shared", &shared, &leaf, "its tiles are not those that it is for");
    is("beyond", &directory(&[[5, 0, 3, 100]]), &leaf, "beyond the leaf directories");
    is("far", &directory(&[[5, 0, u64::MAX - 2, 2]]), &leaf, "beyond the leaf directories");
    is("run", &directory(&[[5, u64::MAX, 0, length]]), b"", "beyond the deepest zoom");
    is("number", &directory(&[[u64::MAX, 1, 0, length]]), b"", "beyond the deepest zoom");
    is("data", &directory(&[[5, 1, 7, length]]), b"", "lie beyond the end of the file");
    is("none", &directory(&[]), b"", "there are no tiles in it");
    // A leaf of nothing, and bytes that no entry is made of.
    let nothing = directory(&[]);
    let leads = directory(&[[5, 0, 0, nothing.len() as u64]]);
    is("empty leaf", &leads, &nothing, "leaf directory of tile number 5: it leads to no tile");
    let spare = [leaf.clone(), vec![0]].concat();
    is("spare", &directory(&[[5, 0, 0, spare.len() as u64]]), &spare, "behind its last entry");
    is("spare root", &[directory(&[[5, 1, 0, length]]), vec![0]].concat(), b"", "behind its last entry");
    let mut many = Vec::new();
    varint(u64::MAX, &mut many);
    is("many", &many, b"", "cut short or damaged");
    // A run over the whole world of a deep zoom is as many tiles as there are, and one tile's bytes.
    let world = directory(&[[(4u64.pow(20) - 1) / 3, 4u64.pow(20), 0, length]]);
    is("world", &world, b"", "16777216 x 16722258 samples here, and a terrain has 1,048,577 at most");
}

#[test]
fn directories_that_unpack_without_end_are_refused() {
    let folder_of = tempdir().unwrap();
    let zeros = vec![0; 64 << 20];
    for packing in [2, 4] {
        let how = Pm { packing, leaf: 0, clustered: true };
        let path = pm(folder_of.path(), &format!("bomb-{packing}"), how, &zeros, b"", b"");
        assert!(path.metadata().unwrap().len() < 100_000);
        let words = refused(&path);
        assert!(words.contains("root directory") && words.contains("fetch the file again"), "{words}");
        let leaf = packed(packing, &zeros);
        let root = directory(&[[5, 0, 0, leaf.len() as u64]]);
        let words = refused(&pm(folder_of.path(), &format!("leaf-{packing}"), how, &root, &leaf, b""));
        assert!(words.contains("leaf directory of tile number 5"), "{words}");
        // Thousands of entries that each lead to zeros of which all could be unpacked.
        let leaf = packed(packing, &zeros[..16 << 20]);
        let entries: Vec<_> = (0..1 << 12).map(|i| [5 + i, 0, 0, leaf.len() as u64 + i]).collect();
        let leaves: Vec<u8> = leaf.iter().copied().chain([0; 1 << 12]).collect();
        let words = refused(&pm(
            folder_of.path(),
            &format!("many-{packing}"),
            how,
            &directory(&entries),
            &leaves,
            b"",
        ));
        assert!(words.contains("leaf directory of tile number 5"), "{words}");
    }
}

#[test]
fn headers_that_are_wrong_are_told() {
    let folder_of = tempdir().unwrap();
    let path = folder_of.path().join("a.pmtiles");
    pmtiles(&path, &flat(), "{}", WORLD, Pm::PLAIN);
    let sound = std::fs::read(&path).unwrap();
    let changed = |at: usize, bytes: &[u8]| {
        let mut all = sound.clone();
        all[at..at + bytes.len()].copy_from_slice(bytes);
        std::fs::write(&path, all).unwrap();
        refused(&path)
    };
    for (at, bytes, wanted) in [
        (7, &[2][..], "PMTiles of version 2"),
        (97, &[3], "packed by Brotli"),
        (97, &[0], "in an unknown way (0)"),
        (98, &[9], "in an unknown way (9)"),
        (99, &[1], "its tiles are vector tiles"),
        (99, &[5], "its tiles are AVIF"),
        (16, &[255; 8], "root directory lie beyond"),
        (56, &[255; 8], "tiles lie beyond"),
    ] {
        let words = changed(at, bytes);
        assert!(words.contains(wanted), "{at}: {words}");
    }
    std::fs::write(&path, &sound[..100]).unwrap();
    let words = refused(&path);
    assert!(words.contains("cut short"), "{words}");
}
