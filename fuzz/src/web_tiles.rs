//! Pyramids of map tiles: PMTiles and MBTiles as they are, and single tiles of every format in a folder; as elevation data and as pictures.

use crate::image::{brings, reads_and_drapes};
use crate::import::read;
use crate::seeds::{self, Inputs, with_png_sums};
use crate::words::told;
use std::io::Write;
use std::path::Path;
use terrasoar_import::{OpenOptions, TileOptions, open_image};

fn named<const N: usize>(inputs: [(&str, Vec<u8>); N]) -> Inputs {
    inputs.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect()
}

/// A tile of 8 x 8 texels of packed heights: its PNG, nothing packed.
fn tile(height: u8) -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8; 4], data: &[u8]| {
        png.extend((data.len() as u32).to_be_bytes());
        png.extend(name);
        png.extend(data);
        png.extend([0; 4]);
    };
    let rows: Vec<u8> = (0..8u8)
        .flat_map(|y| std::iter::once(0).chain((0..8u8).flat_map(move |x| [1, 134, x * 9 + y + height, 255])))
        .collect();
    let mut packer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    let packed = packer.write_all(&rows).and_then(|()| packer.finish()).unwrap_or_default();
    chunk(b"IHDR", &[0, 0, 0, 8, 0, 0, 0, 8, 8, 6, 0, 0, 0]);
    chunk(b"IDAT", &packed);
    chunk(b"IEND", &[]);
    with_png_sums(&png)
}

fn heights(path: &Path, bytes: &[u8]) {
    let options = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    read(&[(&name, bytes)], &options);
    // All but a strip, from both sides of 180 degrees.
    let tiles = TileOptions { bounds_deg: Some([10.0, -80.0, 5.0, 80.0]), ..TileOptions::default() };
    read(&[(&name, bytes)], &OpenOptions { tiles, ..options });
}

/// Reads bytes as an archive of that name: heights, a picture by itself, a picture on a terrain.
fn archive(name: &str, bytes: &[u8]) {
    heights(Path::new(name), bytes);
    let folder = crate::scratch::folder();
    let path = folder.path().join(name);
    seeds::write(&path, bytes);
    if let Some(image) = told(open_image(&path)) {
        reads_and_drapes(image, folder.path());
    }
    brings(&path);
}

/// PMTiles.
pub(crate) mod pmtiles {
    use super::*;

    fn varint(mut value: u64, into: &mut Vec<u8>) {
        while value >= 0x80 {
            into.push(value as u8 | 0x80);
            value >>= 7;
        }
        into.push(value as u8);
    }

    /// A directory of entries: number, run, place, length.
    fn directory(entries: &[[u64; 4]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        varint(entries.len() as u64, &mut bytes);
        let before = std::iter::once(0).chain(entries.iter().map(|entry| entry[0]));
        entries.iter().zip(before).for_each(|(entry, before)| varint(entry[0] - before, &mut bytes));
        for column in [1, 3] {
            entries.iter().for_each(|entry| varint(entry[column], &mut bytes));
        }
        entries.iter().for_each(|entry| varint(entry[2] + 1, &mut bytes));
        bytes
    }

    fn file(packing: u8, root: &[u8], leaves: &[u8], data: &[u8]) -> Vec<u8> {
        let pack = |bytes: &[u8]| {
            if packing == 1 {
                return bytes.to_vec();
            }
            let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
            packer.write_all(bytes).and_then(|()| packer.finish()).unwrap_or_default()
        };
        let (root, metadata) = (pack(root), pack(b"{\"encoding\":\"mapbox\",\"bounds\":[-180,-85,180,85]}"));
        let mut header = b"PMTiles\x03".to_vec();
        let mut at = 127u64;
        for part in [root.len(), metadata.len(), leaves.len(), data.len()] {
            header.extend(at.to_le_bytes());
            header.extend((part as u64).to_le_bytes());
            at += part as u64;
        }
        header.extend([0; 24]);
        header.extend([1, packing, 1, 2, 0, 3]);
        header.resize(127, 0);
        [&header, &root[..], &metadata, leaves, data].concat()
    }

    pub(crate) fn seeds() -> Inputs {
        let (a, b) = (tile(3), tile(90));
        let data = [&a[..], &b].concat();
        let (first, second) = (a.len() as u64, b.len() as u64);
        let all = [[1, 1, 0, first], [2, 2, first, second], [4, 1, 0, first], [5, 16, 0, first]];
        let leaf = directory(&all[1..]);
        let root = directory(&[all[0], [2, 0, 0, leaf.len() as u64]]);
        named([
            ("plain", file(1, &directory(&all), b"", &data)),
            ("gzip", file(2, &directory(&all), b"", &data)),
            ("leaf", file(1, &root, &leaf, &data)),
            ("missing", file(1, &directory(&[all[0], [7, 1, 0, first], [9, 3, first, second]]), b"", &data)),
            ("bomb", file(2, &vec![0; 8 << 20], b"", b"")),
            ("one", file(1, &directory(&[[0, 1, 0, first]]), b"", &data)),
        ])
    }

    pub(crate) fn body(data: &[u8]) {
        archive("map.pmtiles", data);
    }
}

/// MBTiles.
pub(crate) mod mbtiles {
    use super::*;
    use rusqlite::{Connection, params};

    /// A database of small pages, made by some statements, with tiles of zoom 2 put into `table`.
    fn database(statements: &str, table: &str) -> Option<Vec<u8>> {
        let folder = crate::scratch::folder();
        let path = folder.path().join("seed");
        let made = Connection::open(&path).ok()?;
        made.execute_batch("PRAGMA page_size = 512; PRAGMA journal_mode = MEMORY;").ok()?;
        made.execute_batch(statements).ok()?;
        for (column, row) in [(1, 1), (1, 2), (2, 1), (2, 2)] {
            let put = format!("INSERT INTO {table} VALUES (2, ?1, ?2, ?3)");
            made.execute(&put, params![column, row, tile(column * 9 + row)]).ok()?;
        }
        made.close().ok()?;
        std::fs::read(&path).ok()
    }

    pub(crate) fn seeds() -> Inputs {
        let columns = "(zoom_level integer, tile_column integer, tile_row integer, tile_data blob)";
        let metadata = "CREATE TABLE metadata (name text, value text); INSERT INTO metadata VALUES ('encoding', 'mapbox'), ('bounds', '-180,-85,180,85');";
        let index = "CREATE UNIQUE INDEX i ON tiles (zoom_level, tile_column, tile_row);";
        let all = [
            ("table", format!("{metadata} CREATE TABLE tiles {columns}; {index}"), "tiles"),
            ("no index", format!("CREATE TABLE tiles {columns};"), "tiles"),
            ("view", format!("CREATE TABLE t {columns}; CREATE VIEW tiles AS SELECT * FROM t;"), "t"),
            (
                "product",
                format!("CREATE TABLE t {columns}; CREATE VIEW tiles AS SELECT a.* FROM t a, t b, t c, t d, t e, t f;"),
                "t",
            ),
            (
                "without rowid",
                "CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob, PRIMARY KEY (zoom_level, tile_column, tile_row)) WITHOUT ROWID;".into(),
                "tiles",
            ),
        ];
        all.into_iter()
            .map(|(name, statements, table)| {
                (name.to_owned(), database(&statements, table).unwrap_or_default())
            })
            .collect()
    }

    pub(crate) fn body(data: &[u8]) {
        archive("map.mbtiles", data);
    }
}

/// A tile in a folder of tiles, as heights and as a picture.
pub(crate) mod map_tile {
    use super::*;

    pub(crate) fn seeds() -> Inputs {
        let webp = |channels: usize, color: image_webp::ColorType| {
            let texels: Vec<u8> =
                (0..64 * channels).map(|i| if i % channels == 0 { 1 } else { (i * 3) as u8 }).collect();
            let mut bytes = Vec::new();
            let made = image_webp::WebPEncoder::new(&mut bytes).encode(&texels, 8, 8, color);
            made.map(|()| bytes).unwrap_or_default()
        };
        let mut seeds = named([
            ("low", tile(3)),
            ("high", tile(120)),
            ("webp", webp(3, image_webp::ColorType::Rgb8)),
            ("webp with alpha", webp(4, image_webp::ColorType::Rgba8)),
        ]);
        seeds.extend(seeds::folder("import/tests/image_fixtures", &["jpg"]));
        seeds
    }

    pub(crate) fn body(data: &[u8]) {
        let folder = crate::scratch::folder();
        let tiles = folder.path().join("tiles");
        let put = |row: u8, bytes: &[u8]| {
            let column = tiles.join("1/0");
            let made = std::fs::create_dir_all(&column);
            made.unwrap_or_else(|error| panic!("{error}"));
            seeds::write(&column.join(format!("{row}.png")), bytes);
        };
        put(0, &with_png_sums(data));
        put(1, &tile(9));
        let options = OpenOptions { decode: Some("mapbox".into()), ..OpenOptions::default() };
        if let Some(dem) = told(terrasoar_import::open_with(std::slice::from_ref(&tiles), &options)) {
            crate::import::streams(&*dem);
        }
        if let Some(image) = told(open_image(&tiles)) {
            reads_and_drapes(image, folder.path());
        }
    }
}
