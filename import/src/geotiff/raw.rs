//! Reads uncompressed chunks a few rows at a time, so a file stored as one huge strip needs no more
//! memory than a tiled one.
//!
//! Every chunk is cut into bands of rows; the bands are the tasks, read in file order by all workers. Of tiles much wider than the image only what
//! lies in it is read.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

use super::super::input;
use super::super::parallel::each_task;
use super::chunks::Chunks;
use super::convert::Convert;
use super::listing::Places;
use super::{put_constant, rows_at_once};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;

/// Bytes read at once, unless a row of the image has more.
const LARGEST_READ: u64 = 4 << 20;

struct Worker<'a> {
    file: &'a File,
    places: Places<'a>,
    bytes: Vec<u8>,
    samples: Vec<f64>,
}

/// Pushes every sample of the image once.
pub(super) fn stream(
    path: &Path,
    chunks: &Chunks,
    convert: &Convert,
    sink: &dyn SampleSink,
) -> Result<(), LayoutError> {
    let file = input::open(path, "cannot open the TIFF file")?;
    let grid = &chunks.grid;
    let band_rows = rows_at_once(grid.chunk_width.min(grid.width)).min(grid.chunk_height);
    let bands = u64::from(grid.chunk_height.min(grid.height).div_ceil(band_rows));
    let open = || {
        Ok(Worker { file: &file, places: grid.places(path, &file), bytes: Vec::new(), samples: Vec::new() })
    };
    each_task(grid.count() * bands, usize::MAX, open, |worker, task| {
        let (chunk, band) = (task / bands, task % bands);
        let whole = grid.window(chunk);
        // Less than the chunk's height.
        let first = band as u32 * band_rows;
        if first >= whole.height {
            return Ok(());
        }
        let window = Window { row: whole.row + first, height: band_rows.min(whole.height - first), ..whole };
        let Some((at, _)) = grid.place(chunk, &mut worker.places)? else {
            return put_constant(sink, window, convert.absent);
        };
        worker.read(chunks, at + u64::from(first) * chunks.stride(), window).map_err(
            |source| match source.kind() {
                ErrorKind::UnexpectedEof => LayoutError::damaged(
                    path,
                    grid.name(chunk),
                    "the file was cut short while it was read; start again",
                ),
                _ => LayoutError::io(path, "cannot read the TIFF file", source),
            },
        )?;
        worker.samples.clear();
        let row_bytes = (u64::from(window.width) * chunks.pixel_bytes()) as usize;
        let pitch = worker.bytes.len() / window.height as usize;
        for row in worker.bytes.chunks_exact(pitch) {
            convert.append(&row[..row_bytes], &mut worker.samples);
        }
        sink.put(window, &worker.samples)
    })
}

impl Worker<'_> {
    /// Reads the rows of `window`, the first of which lies at `at`: as they lie in the file, or only what is in the image where much is not.
    fn read(&mut self, chunks: &Chunks, at: u64, window: Window) -> std::io::Result<()> {
        let stride = chunks.stride();
        let row_bytes = u64::from(window.width) * chunks.pixel_bytes();
        let rows = u64::from(window.height);
        if stride == row_bytes || stride * rows <= LARGEST_READ {
            self.bytes.resize((stride * rows) as usize, 0);
            return read_at(self.file, &mut self.bytes, at);
        }
        self.bytes.resize((row_bytes * rows) as usize, 0);
        let rows = self.bytes.chunks_exact_mut(row_bytes as usize);
        (0u64..).zip(rows).try_for_each(|(row, bytes)| read_at(self.file, bytes, at + row * stride))
    }
}
