//! GeoTIFF stored in ways that writers other than GDAL choose: lengths that are not stated.

mod import_support;
#[path = "import_support/packing.rs"]
mod packing;
#[path = "../../layout/tests/import_support/tiff.rs"]
mod tiff;

use import_support::{Grid, read, refusal};
use packing::packed;
use terrasoar_layout::error::LayoutError;
use tiff::{DATA_AT, DEFLATE, LZW, PACK_BITS, RAW, Tag, ZSTD, heights, tiff};

const SIDE: [u32; 2] = [40, 30];
/// Rows of a strip.
const ROWS: u32 = 8;

/// The height at a column and row.
fn height(col: u32, row: u32) -> f64 {
    f64::from(1000 + 3 * col + 7 * row)
}

/// The rows `rows` as 16-bit numbers.
fn bytes(rows: std::ops::Range<u32>) -> Vec<u8> {
    rows.flat_map(|row| (0..SIDE[0]).map(move |col| height(col, row) as u16)).flat_map(u16::to_le_bytes).collect()
}

fn opened(bytes: &[u8]) -> Result<Grid, LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dem.tif");
    std::fs::write(&path, bytes).unwrap();
    read(&[path])
}

fn refused(bytes: &[u8]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dem.tif");
    std::fs::write(&path, bytes).unwrap();
    refusal(&[path])
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
        let some: Vec<u32> = lengths.iter().enumerate().map(|(i, length)| if i == 1 { 0 } else { *length }).collect();
        let all = [
            tags.iter().cloned().chain([tiff::longs(279, &zeros)]).collect(),
            tags.iter().cloned().chain([tiff::longs(279, &some)]).collect(),
            tags.iter().filter(|tag| tag.number() != 279).cloned().collect::<Vec<Tag>>(),
        ];
        for tags in all {
            let grid = opened(&tiff(false, tags, &data)).unwrap();
            for row in 0..SIDE[1] {
                for col in 0..SIDE[0] {
                    assert_eq!(grid.at(col, row), height(col, row), "{compression}: {col}, {row}");
                }
            }
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
