//! Pyramids of tiles, written as their specifications say, by other code than that which reads them.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Tiles by zoom, column and row from the north.
pub(crate) type Tiles = BTreeMap<(u8, u32, u32), Vec<u8>>;

/// Half the side of the world on the map.
pub(crate) const HALF_M: f64 = 20_037_508.342_789_244;

/// A PNG of `side` texels each way.
pub(crate) fn png(side: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    png_of([side, side], texel)
}

/// A PNG of any size.
pub(crate) fn png_of([wide, high]: [u32; 2], texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, wide, high);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().unwrap();
    let texels: Vec<u8> = (0..wide * high).flat_map(|i| texel(i % wide, i / wide)).collect();
    writer.write_image_data(&texels).unwrap();
    writer.finish().unwrap();
    bytes
}

/// A WebP that keeps every bit.
pub(crate) fn webp(side: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Vec<u8> {
    let texels: Vec<u8> = (0..side * side).flat_map(|i| texel(i % side, i / side)).collect();
    let mut bytes = Vec::new();
    image_webp::WebPEncoder::new(&mut bytes)
        .encode(&texels, side, side, image_webp::ColorType::Rgba8)
        .unwrap();
    bytes
}

/// Tiles of columns and rows of a zoom; `texel` is asked by columns and rows of the whole world.
pub(crate) fn tiles(
    zoom: u8,
    columns: std::ops::Range<u32>,
    rows: std::ops::Range<u32>,
    side: u32,
    texel: impl Fn(u64, u64) -> [u8; 4],
) -> Tiles {
    let mut tiles = Tiles::new();
    for (x, y) in columns.flat_map(|x| rows.clone().map(move |y| (x, y))) {
        let of_world = |at: u32, tile: u32| u64::from(tile) * u64::from(side) + u64::from(at);
        tiles.insert((zoom, x, y), png(side, |col, row| texel(of_world(col, x), of_world(row, y))));
    }
    tiles
}

/// Heights packed as Mapbox does: tenths of metres above -10000 m.
pub(crate) fn mapbox(tenths: i64) -> [u8; 4] {
    let number = (tenths + 100_000) as u32;
    [(number >> 16) as u8, (number >> 8) as u8, number as u8, 255]
}

/// Heights packed as Terrarium does: 256ths of metres above -32768 m.
pub(crate) fn terrarium(parts: i64) -> [u8; 4] {
    let number = (parts + 32_768 * 256) as u32;
    [(number >> 16) as u8, (number >> 8) as u8, number as u8, 255]
}

/// Tenths of metres of a hilly ground, by columns and rows of texels.
pub(crate) fn hills(col: u64, row: u64) -> i64 {
    let [x, y] = [col % 4096, row % 4096].map(|at| at as f64);
    (9000.0 + 4000.0 * (x / 41.0).sin() * (y / 53.0).cos() + 3.0 * x).round() as i64
}

/// Writes a folder of `zoom/column/row` and an ending; rows from the south where `tms`.
pub(crate) fn folder(root: &Path, tiles: &Tiles, ending: &str, tms: bool) -> PathBuf {
    for ((zoom, x, y), bytes) in tiles {
        let row = if tms { (1u32 << zoom) - 1 - y } else { *y };
        let column = root.join(format!("{zoom}/{x}"));
        std::fs::create_dir_all(&column).unwrap();
        std::fs::write(column.join(format!("{row}{ending}")), bytes).unwrap();
    }
    root.to_owned()
}

/// Writes MBTiles 1.3; with a view over two tables, as makers do who keep equal tiles once, where `is_view`.
#[cfg(feature = "mbtiles")]
pub(crate) fn mbtiles(path: &Path, tiles: &Tiles, metadata: &[(&str, &str)], is_view: bool) -> PathBuf {
    let database = rusqlite::Connection::open(path).unwrap();
    database.execute_batch("CREATE TABLE metadata (name text, value text);").unwrap();
    for (name, value) in metadata {
        database.execute("INSERT INTO metadata VALUES (?1, ?2)", [name, value]).unwrap();
    }
    database
        .execute_batch(if is_view {
            "CREATE TABLE map (zoom_level integer, tile_column integer, tile_row integer, tile_id text);
             CREATE TABLE images (tile_data blob, tile_id text);
             CREATE UNIQUE INDEX map_index ON map (zoom_level, tile_column, tile_row);
             CREATE UNIQUE INDEX images_id ON images (tile_id);
             CREATE VIEW tiles AS SELECT map.zoom_level AS zoom_level, map.tile_column AS tile_column, map.tile_row AS tile_row,
             images.tile_data AS tile_data FROM map JOIN images ON images.tile_id = map.tile_id;"
        } else {
            "CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer, tile_data blob);
             CREATE UNIQUE INDEX tile_index ON tiles (zoom_level, tile_column, tile_row);"
        })
        .unwrap();
    for ((zoom, x, y), bytes) in tiles {
        let row = (1u32 << zoom) - 1 - y;
        if is_view {
            let id = format!("{:08x}", crc32fast::hash(bytes));
            database
                .execute("INSERT INTO map VALUES (?1, ?2, ?3, ?4)", rusqlite::params![zoom, x, row, id])
                .unwrap();
            database
                .execute("INSERT OR IGNORE INTO images VALUES (?1, ?2)", rusqlite::params![bytes, id])
                .unwrap();
        } else {
            database
                .execute("INSERT INTO tiles VALUES (?1, ?2, ?3, ?4)", rusqlite::params![zoom, x, row, bytes])
                .unwrap();
        }
    }
    database.close().unwrap();
    path.to_owned()
}

/// How PMTiles are written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pm {
    /// 1 none, 2 gzip, 4 Zstandard.
    pub(crate) packing: u8,
    /// Entries of a leaf; without leaves where 0.
    pub(crate) leaf: usize,
    /// Whether tiles lie in the order of their numbers.
    pub(crate) clustered: bool,
}

impl Pm {
    pub(crate) const PLAIN: Self = Self { packing: 2, leaf: 0, clustered: true };
}

/// The number of a tile: by the recursion that defines the curve, quarter by quarter.
pub(crate) fn number(zoom: u8, x: u32, y: u32) -> u64 {
    fn along(zoom: u8, x: u32, y: u32) -> u64 {
        if zoom == 0 {
            return 0;
        }
        let half = 1 << (zoom - 1);
        let quarter = 1u64 << (2 * (zoom - 1));
        match (x >= half, y >= half) {
            (false, false) => along(zoom - 1, y, x),
            (false, true) => quarter + along(zoom - 1, x, y - half),
            (true, true) => 2 * quarter + along(zoom - 1, x - half, y - half),
            (true, false) => 3 * quarter + along(zoom - 1, half - 1 - y, 2 * half - 1 - x),
        }
    }
    (0..zoom).map(|zoom| 1u64 << (2 * zoom)).sum::<u64>() + along(zoom, x, y)
}

/// A number of variable length.
pub(crate) fn varint(mut value: u64, into: &mut Vec<u8>) {
    while value >= 0x80 {
        into.push(value as u8 | 0x80);
        value >>= 7;
    }
    into.push(value as u8);
}

/// Number of the first tile, length of the run, place, length.
pub(crate) type PmEntry = [u64; 4];

pub(crate) fn directory(entries: &[PmEntry]) -> Vec<u8> {
    let mut bytes = Vec::new();
    varint(entries.len() as u64, &mut bytes);
    let mut last = 0;
    for entry in entries {
        varint(entry[0] - last, &mut bytes);
        last = entry[0];
    }
    entries.iter().for_each(|entry| varint(entry[1], &mut bytes));
    entries.iter().for_each(|entry| varint(entry[3], &mut bytes));
    let mut follows = None;
    for entry in entries {
        varint(if follows == Some(entry[2]) { 0 } else { entry[2] + 1 }, &mut bytes);
        follows = Some(entry[2] + entry[3]);
    }
    bytes
}

pub(crate) fn packed(packing: u8, bytes: &[u8]) -> Vec<u8> {
    match packing {
        2 => {
            let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
            packer.write_all(bytes).unwrap();
            packer.finish().unwrap()
        }
        4 => zstd::encode_all(bytes, 3).unwrap(),
        _ => bytes.to_vec(),
    }
}

/// PMTiles of parts as they are: header, root, metadata, leaves, tiles.
pub(crate) fn pm_file(
    how: Pm,
    root: &[u8],
    metadata: &str,
    leaves: &[u8],
    data: &[u8],
    kind: u8,
    degrees: [f64; 4],
) -> Vec<u8> {
    let (root, metadata) = (packed(how.packing, root), packed(how.packing, metadata.as_bytes()));
    let mut header = b"PMTiles\x03".to_vec();
    let mut at = 127u64;
    for part in [root.len(), metadata.len(), leaves.len(), data.len()] {
        header.extend(at.to_le_bytes());
        header.extend((part as u64).to_le_bytes());
        at += part as u64;
    }
    header.extend([0; 24]);
    header.extend([u8::from(how.clustered), how.packing, 1, kind, 0, 30]);
    header.extend(degrees.iter().flat_map(|degree| ((degree * 1e7).round() as i32).to_le_bytes()));
    header.resize(127, 0);
    [&header, &root[..], &metadata, leaves, data].concat()
}

/// Writes PMTiles version 3, with equal tiles kept once and runs of them as one entry.
pub(crate) fn pmtiles(path: &Path, tiles: &Tiles, metadata: &str, degrees: [f64; 4], how: Pm) -> PathBuf {
    let mut numbered: Vec<(u64, &Vec<u8>)> =
        tiles.iter().map(|((zoom, x, y), bytes)| (number(*zoom, *x, *y), bytes)).collect();
    numbered.sort_by_key(|(number, _)| *number);
    let mut contents: Vec<&Vec<u8>> = Vec::new();
    for (_, bytes) in &numbered {
        if !contents.contains(bytes) {
            contents.push(bytes);
        }
    }
    if !how.clustered {
        contents.reverse();
    }
    let mut data = Vec::new();
    let mut places: BTreeMap<&[u8], [u64; 2]> = BTreeMap::new();
    for bytes in contents {
        places.insert(bytes, [data.len() as u64, bytes.len() as u64]);
        data.extend(bytes);
    }
    let mut entries: Vec<PmEntry> = Vec::new();
    for (number, bytes) in numbered {
        let [at, length] = places[&bytes[..]];
        match entries.last_mut() {
            Some(last) if last[0] + last[1] == number && last[2] == at => last[1] += 1,
            _ => entries.push([number, 1, at, length]),
        }
    }
    let mut leaves = Vec::new();
    if how.leaf > 0 {
        let mut root = Vec::new();
        for part in entries.chunks(how.leaf) {
            let leaf = packed(how.packing, &directory(part));
            root.push([part[0][0], 0, leaves.len() as u64, leaf.len() as u64]);
            leaves.extend(leaf);
        }
        entries = root;
    }
    std::fs::write(path, pm_file(how, &directory(&entries), metadata, &leaves, &data, 2, degrees)).unwrap();
    path.to_owned()
}

/// West, south, east and north in degrees of columns and rows of a zoom.
pub(crate) fn degrees(zoom: u8, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> [f64; 4] {
    let all = f64::from(1u32 << zoom);
    let x = |column: u32| f64::from(column) / all * 360.0 - 180.0;
    let y = |row: u32| {
        let mercator = std::f64::consts::PI * (1.0 - 2.0 * f64::from(row) / all);
        mercator.sinh().atan().to_degrees()
    };
    [x(columns.start), y(rows.end), x(columns.end), y(rows.start)]
}
