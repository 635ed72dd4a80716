//! GeoTIFF stored in ways that writers other than GDAL choose: lengths that are not stated, bits the other way round, bands one after the other, samples of odd widths,
//! directories that point at others.

mod import_support;
#[path = "import_support/packing.rs"]
mod packing;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use import_support::{Grid, collect, refusal};
use packing::packed;
use terrasoar_import::{OpenOptions, open_with};
use terrasoar_layout::error::LayoutError;
use tiff::{DATA_AT, DEFLATE, LZW, PACK_BITS, RAW, Tag, ZSTD, heights, longs, shorts, tiff};

const SIDE: [u32; 2] = [40, 30];
/// Rows of a strip.
const ROWS: u32 = 8;

/// The height at a column and row.
fn height(col: u32, row: u32) -> f64 {
    f64::from(1000 + 3 * col + 7 * row)
}

/// The rows `rows` as 16-bit numbers.
fn bytes(rows: std::ops::Range<u32>) -> Vec<u8> {
    rows.flat_map(|row| (0..SIDE[0]).map(move |col| height(col, row) as u16))
        .flat_map(u16::to_le_bytes)
        .collect()
}

fn opened(bytes: &[u8]) -> Result<Grid, LayoutError> {
    with(bytes, &OpenOptions::default())
}

fn with(bytes: &[u8], options: &OpenOptions) -> Result<Grid, LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dem.tif");
    std::fs::write(&path, bytes).unwrap();
    collect(&*open_with(&[path], options)?)
}

fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dem.tif");
    std::fs::write(&path, bytes).unwrap();
    refusal(&[path])
}

fn is_sound(grid: &Grid, what: &str) {
    for row in 0..SIDE[1] {
        for col in 0..SIDE[0] {
            assert_eq!(grid.at(col, row), height(col, row), "{what}: {col}, {row}");
        }
    }
}

/// Strips of the compression, each begun at `offsets`, and the tags of the file.
fn strips(compression: u16) -> (Vec<u8>, Vec<Tag>, Vec<u32>) {
    let (mut data, mut offsets, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
    for row in (0..SIDE[1]).step_by(ROWS as usize) {
        let strip = packed(compression, &bytes(row..(row + ROWS).min(SIDE[1])));
        offsets.push(DATA_AT + data.len() as u32);
        lengths.push(strip.len() as u32);
        data.extend(strip);
    }
    (data, heights(SIDE, compression, ROWS, &offsets, &lengths), lengths)
}

#[test]
fn lengths_that_are_0_or_missing_hide_no_heights() {
    for compression in [RAW, DEFLATE, LZW, ZSTD, PACK_BITS] {
        let (data, tags, lengths) = strips(compression);
        let zeros: Vec<u32> = vec![0; lengths.len()];
        let some: Vec<u32> =
            lengths.iter().enumerate().map(|(i, length)| if i == 1 { 0 } else { *length }).collect();
        let all = [
            tags.iter().cloned().chain([longs(279, &zeros)]).collect(),
            tags.iter().cloned().chain([longs(279, &some)]).collect(),
            tags.iter().filter(|tag| tag.number() != 279).cloned().collect::<Vec<Tag>>(),
        ];
        for tags in all {
            let grid = opened(&tiff(false, tags, &data)).unwrap();
            is_sound(&grid, &format!("{compression}"));
        }
    }
}

#[test]
fn a_strip_without_a_length_that_is_cut_short_is_damage() {
    for compression in [RAW, DEFLATE, LZW, ZSTD, PACK_BITS] {
        let strip = packed(compression, &bytes(0..SIDE[1]));
        // The directory lies before the data, so that the file can end within them.
        let tags = |at| heights(SIDE, compression, SIDE[1], &[at], &[0]);
        let at = tiff(false, tags(0), &[]).len() as u32;
        let mut file = tiff(false, tags(at), &[]);
        assert_eq!(file.len() as u32, at);
        file.extend(&strip);
        assert_eq!(opened(&file).unwrap().at(9, 9), height(9, 9), "{compression}");
        file.truncate(file.len() - strip.len() / 2);
        let said = refused(&file);
        assert!(said.contains("strip 0 of 1"), "{said}");
    }
}

#[test]
fn bits_may_stand_the_other_way_round() {
    for compression in [RAW, DEFLATE, LZW, ZSTD, PACK_BITS] {
        let (mut data, tags, _) = strips(compression);
        data.iter_mut().for_each(|byte| *byte = byte.reverse_bits());
        let tags = tags.into_iter().chain([shorts(266, &[2])]).collect();
        is_sound(&opened(&tiff(false, tags, &data)).unwrap(), &format!("{compression}"));
    }
}

/// Three bands one after the other, of heights, of heights and 1000, and of 0 and 1.
fn planes(compression: u16, extra: &[u16]) -> Vec<u8> {
    let (mut data, mut offsets, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
    for plane in 0..3u32 {
        for first in (0..SIDE[1]).step_by(ROWS as usize) {
            let rows = first..(first + ROWS).min(SIDE[1]);
            let values = rows.flat_map(|row| (0..SIDE[0]).map(move |col| (col, row)));
            let values = values.map(|(col, row)| match plane {
                0 => height(col, row) as u16,
                1 => height(col, row) as u16 + 1000,
                _ => u16::from(col != 5),
            });
            let strip = packed(compression, &values.flat_map(u16::to_le_bytes).collect::<Vec<u8>>());
            offsets.push(DATA_AT + data.len() as u32);
            lengths.push(strip.len() as u32);
            data.extend(strip);
        }
    }
    let mut tags = heights(SIDE, compression, ROWS, &offsets, &lengths);
    tags.extend([shorts(258, &[16; 3]), shorts(277, &[3]), shorts(284, &[2]), shorts(339, &[1; 3])]);
    tags.extend((!extra.is_empty()).then(|| shorts(338, extra)));
    tiff(false, tags, &data)
}

#[test]
fn bands_that_lie_one_after_the_other_are_read_by_number() {
    let band = |number: &str| OpenOptions { band: Some(number.into()), ..OpenOptions::default() };
    for compression in [RAW, DEFLATE, LZW, ZSTD] {
        let file = planes(compression, &[0, 0]);
        is_sound(&with(&file, &band("1")).unwrap(), "first");
        let second = with(&file, &band("2")).unwrap();
        assert_eq!([second.at(0, 0), second.at(39, 29)], [2000.0, height(39, 29) + 1000.0]);
        let said = opened(&file).err().unwrap().to_string();
        assert!(said.contains("3 bands"), "{said}");
        // The last one says where there is something.
        let file = planes(compression, &[0, 2]);
        let seen = with(&file, &band("1")).unwrap();
        assert_eq!((seen.voids(), seen.at(4, 7), seen.at(5, 7).is_nan()), (30, height(4, 7), true));
    }
}

#[test]
fn samples_of_any_width_are_read() {
    // Width, format, and how a height is written.
    for (width, format) in [
        (1u16, 1u16),
        (4, 1),
        (11, 1),
        (12, 1),
        (12, 2),
        (17, 2),
        (31, 1),
        (40, 1),
        (64, 1),
        (64, 2),
        (8, 2),
        (16, 3),
        (64, 3),
    ] {
        let most = if width < 11 { 1u64 << width } else { 2000 };
        let value = |col: u32, row: u32| {
            let plain = height(col, row) as u64 % most;
            if format == 2 {
                plain as f64 - if width < 11 { (most / 2) as f64 } else { 100.0 }
            } else {
                plain as f64
            }
        };
        let bits = |value: f64| match (format, width) {
            (3, 16) => u64::from(half(value)),
            (3, _) => value.to_bits(),
            _ => value as i64 as u64,
        };
        let mut data = Vec::new();
        for row in 0..SIDE[1] {
            let mut line = vec![0u8; (SIDE[0] as usize * usize::from(width)).div_ceil(8)];
            for col in 0..SIDE[0] {
                let stored = bits(value(col, row));
                for bit in 0..u32::from(width) {
                    // Whole bytes stand in the file's order, all else without gaps from the top.
                    let from = if width.is_multiple_of(8) && width != 40 {
                        (bit / 8) * 8 + 7 - bit % 8
                    } else {
                        u32::from(width) - 1 - bit
                    };
                    let at = (col * u32::from(width) + bit) as usize;
                    line[at / 8] |= ((stored >> from & 1) as u8) << (7 - at % 8);
                }
            }
            data.extend(line);
        }
        for compression in [RAW, DEFLATE] {
            let strip = packed(compression, &data);
            let mut tags = heights(SIDE, compression, SIDE[1], &[DATA_AT], &[strip.len() as u32]);
            tags.extend([shorts(258, &[width]), shorts(339, &[format])]);
            let grid = opened(&tiff(false, tags, &strip)).unwrap();
            for (col, row) in [(0, 0), (1, 0), (39, 0), (0, 29), (39, 29), (17, 13), (18, 13)] {
                assert_eq!(grid.at(col, row), value(col, row), "{width} bits of kind {format}: {col}, {row}");
            }
        }
    }
}

/// A whole number below 2048 in half precision.
fn half(value: f64) -> u16 {
    if value == 0.0 {
        return 0;
    }
    let exponent = value.log2().floor();
    ((exponent as u16 + 15) << 10) + ((value / exponent.exp2() - 1.0) * 1024.0) as u16
}

/// A file of three directories: what is told, first, then another that may point back, and the heights.
fn directories(first: &[Tag], next: [u32; 3], branch: bool) -> Vec<u8> {
    let data = bytes(0..SIDE[1]);
    let mut file = b"II\x2a\0\0\0\0\0\0\0\0\0\0\0\0\0".to_vec();
    file.extend(&data);
    let thumbnail: Vec<Tag> =
        heights([4, 4], RAW, 4, &[DATA_AT], &[32]).into_iter().chain(first.iter().cloned()).collect();
    let whole = heights(SIDE, RAW, SIDE[1], &[DATA_AT], &[data.len() as u32]);
    let third = tiff::append(&mut file, &whole, next[2]);
    let second = tiff::append(&mut file, &thumbnail, if next[1] == 1 { third } else { next[1] });
    let mut tags = thumbnail.clone();
    tags.extend(branch.then(|| longs(330, &[second, third, second, 0])));
    let begin = tiff::append(&mut file, &tags, if next[0] == 1 { second } else { next[0] });
    file[4..8].copy_from_slice(&begin.to_le_bytes());
    file
}

#[test]
fn the_terrain_is_found_among_thumbnails() {
    let reduced = [longs(254, &[1])];
    let old = [shorts(255, &[2])];
    is_sound(&opened(&directories(&reduced, [1, 1, 0], false)).unwrap(), "in the chain");
    is_sound(&opened(&directories(&old, [1, 1, 0], false)).unwrap(), "marked as before 1992");
    is_sound(&opened(&directories(&reduced, [0, 0, 0], true)).unwrap(), "pointed at");
    // What comes back to itself ends.
    let mut file = directories(&reduced, [1, 0, 0], false);
    let begin = u32::from_le_bytes(file[4..8].try_into().unwrap());
    let at = file.len() - 4;
    file[at..].copy_from_slice(&begin.to_le_bytes());
    let said = refused(&file);
    assert!(said.contains("no full-resolution image"), "{said}");
}

/// Chunks of JPEG XL, which libjxl packed: see `data-scripts/make-jpegxl-fixtures.py`.
#[test]
fn chunks_of_jpeg_xl_give_every_height() {
    type Height = fn(u32, u32) -> f64;
    let cases: [(&str, Height); 3] = [
        ("jpegxl-byte.tif", |col, row| f64::from(20 + 3 * col + 2 * row)),
        ("jpegxl-uint16.tif", |col, row| f64::from(1000 + 300 * col + 1100 * row)),
        ("jpegxl-float32.tif", |col, row| match (col + row) % 13 {
            0 => f64::NAN,
            _ => -420.125 + 0.375 * f64::from(col) + 33.5 * f64::from(row),
        }),
    ];
    for (name, height) in cases {
        let bytes = std::fs::read(import_support::fixtures().join(name)).unwrap();
        let grid = opened(&bytes).unwrap();
        assert_eq!([grid.info.samples_wide, grid.info.samples_high], [50, 40], "{name}");
        assert_eq!(
            grid.info.georeference.pixel_to_crs,
            Some([1001.0, 2.0, 0.0, 4999.0, 0.0, -2.0]),
            "{name}"
        );
        for (col, row) in (0..50).flat_map(|col| (0..40).map(move |row| (col, row))) {
            let (found, wanted) = (grid.at(col, row), height(col, row));
            assert!(
                found == wanted || (found.is_nan() && wanted.is_nan()),
                "{name}: {found}, not {wanted} at {col}, {row}"
            );
        }
        // Damage anywhere is answered.
        let mut wrong = 0;
        for at in (0..bytes.len()).step_by((bytes.len() / 200).max(1)) {
            let mut changed = bytes.clone();
            changed[at] ^= 0x5a;
            wrong += u32::from(opened(&changed).is_err());
            wrong += u32::from(opened(&bytes[..at]).is_err());
        }
        assert!(wrong > 200, "{name}: {wrong}");
    }
    let both = import_support::fixtures().join("../image_fixtures/jpegxl-both-signs.tif");
    let refused = refusal(&[both]);
    assert!(refused.contains("positive and negative") && refused.contains("libjxl"), "{refused}");
}
