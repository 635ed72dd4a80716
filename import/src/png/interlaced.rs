//! Interlaced PNG (Adam7), whose pixels come in seven passes over the whole picture.
//!
//! A strip of rows is held as bytes. The stream is decoded once for each strip, and pixels of other rows are ignored. So memory is bounded, whatever the picture's size.
//! The price is that a large picture is decoded several times.

use super::PngDem;
use super::pixels::Pixels;
use crate::WINDOW_SAMPLES;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Bytes of a strip.
const STRIP_BYTES: u64 = 64 << 20;

/// First column, step between columns, first row, step between rows of each pass (PNG specification, section 8.2).
const PASSES: [[u32; 4]; 7] =
    [[0, 8, 0, 8], [4, 8, 0, 8], [0, 4, 4, 8], [2, 4, 0, 4], [0, 2, 2, 4], [1, 2, 0, 2], [0, 1, 1, 2]];

/// Memory of the pass.
pub(super) fn memory_bytes([wide, high]: [u32; 2], pixels: Pixels) -> u64 {
    let row = u64::from(wide) * pixels.bytes() as u64;
    STRIP_BYTES.max(row).min(row * u64::from(high))
}

/// Pushes every sample once.
pub(super) fn stream(dem: &PngDem, sink: &dyn SampleSink) -> Result<(), LayoutError> {
    let [width, high] = dem.declared.samples;
    let row_bytes = width as usize * dem.pixels.bytes();
    let rows = (STRIP_BYTES / row_bytes as u64).clamp(1, u64::from(high)) as u32;
    let mut strip = Vec::new();
    for first in (0..high).step_by(rows as usize) {
        let height = rows.min(high - first);
        strip.clear();
        strip.resize(row_bytes * height as usize, 0);
        fill(dem, first, &mut strip)?;
        hand_on(dem, sink, first, &strip)?;
    }
    Ok(())
}

/// Decodes the whole picture and keeps the rows of the strip that begins with row `first`.
fn fill(dem: &PngDem, first: u32, strip: &mut [u8]) -> Result<(), LayoutError> {
    let [wide, high] = dem.declared.samples;
    let size = dem.pixels.bytes();
    let row_bytes = wide as usize * size;
    let mut reader = dem.rows()?;
    for [left, across, top, down] in PASSES {
        let columns = wide.saturating_sub(left).div_ceil(across);
        // A pass without columns has no rows either.
        for row in (top..high).step_by(down as usize).take_while(|_| columns > 0) {
            let decoded = dem.next_row(&mut reader, row, columns)?;
            let Some(line) =
                row.checked_sub(first).and_then(|line| strip.chunks_exact_mut(row_bytes).nth(line as usize))
            else {
                continue;
            };
            let places = line.chunks_exact_mut(size).skip(left as usize).step_by(across as usize);
            places.zip(decoded.chunks_exact(size)).for_each(|(to, from)| to.copy_from_slice(from));
        }
    }
    Ok(())
}

fn hand_on(dem: &PngDem, sink: &dyn SampleSink, first: u32, strip: &[u8]) -> Result<(), LayoutError> {
    let width = dem.declared.samples[0];
    let row_bytes = width as usize * dem.pixels.bytes();
    let rows_at_once = (WINDOW_SAMPLES / u64::from(width)).max(1) as usize;
    let mut samples = Vec::new();
    let mut row = first;
    for part in strip.chunks(rows_at_once * row_bytes) {
        samples.clear();
        let begins = row;
        for line in part.chunks_exact(row_bytes) {
            dem.pixels.append(&dem.path, row, line, &mut samples)?;
            row += 1;
        }
        sink.put(Window { col: 0, row: begins, width, height: row - begins }, &samples)?;
    }
    Ok(())
}
