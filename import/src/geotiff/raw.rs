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
use super::planes::Planes;
use super::span::turn_bits;
use super::{put_constant, rows_at_once};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::read_at;

/// Bytes read at once, unless a row of the image has more.
const LARGEST_READ: u64 = 4 << 20;

struct Worker<'a> {
    path: &'a Path,
    chunks: &'a Chunks,
    file: &'a File,
    /// Of each plane, for all of them are read side by side.
    places: Vec<Places<'a>>,
    bytes: Vec<u8>,
    /// Samples of each plane.
    apart: Vec<Vec<f64>>,
    samples: Vec<f64>,
}

/// Pushes every sample of the image once.
pub(super) fn stream(
    path: &Path,
    chunks: &Chunks,
    planes: &Planes,
    convert: &Convert,
    sink: &dyn SampleSink,
) -> Result<(), LayoutError> {
    let file = input::open(path, "cannot open the TIFF file")?;
    let grid = &chunks.grid;
    let width = grid.chunk_width.min(grid.width);
    let rows = u32::try_from(LARGEST_READ / chunks.row_bytes(width).max(1)).unwrap_or(u32::MAX).max(1);
    let band_rows = rows_at_once(width).min(grid.chunk_height).min(rows);
    let bands = u64::from(grid.chunk_height.min(grid.height).div_ceil(band_rows));
    let open = || {
        Ok(Worker {
            path,
            chunks,
            file: &file,
            places: planes.numbers.iter().map(|_| grid.places(path, &file)).collect(),
            bytes: Vec::new(),
            apart: vec![Vec::new(); planes.numbers.len()],
            samples: Vec::new(),
        })
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
        let mut is_there = false;
        for (at, plane) in planes.numbers.iter().enumerate() {
            is_there |= worker.read(at, [*plane, chunk], first, window, convert)?;
        }
        if !is_there {
            return put_constant(sink, window, convert.left_out);
        }
        if let [only] = &worker.apart[..] {
            return sink.put(window, only);
        }
        planes.join(&worker.apart, &mut worker.samples);
        sink.put(window, &worker.samples)
    })
}

impl Worker<'_> {
    /// Reads the rows of `window`, which begin at row `first` of a chunk, of a plane. Gives whether the file has the chunk.
    fn read(
        &mut self,
        at: usize,
        [plane, chunk]: [u64; 2],
        first: u32,
        window: Window,
        convert: &Convert,
    ) -> Result<bool, LayoutError> {
        let (chunks, pixels) = (self.chunks, window.width as usize);
        let place = chunks.grid.place_of(plane, chunk, &mut self.places[at])?;
        let samples = &mut self.apart[at];
        samples.clear();
        let Some((place, _)) = place else {
            // Nobody looks at the samples of the only plane.
            if self.apart.len() > 1 {
                self.apart[at].resize(pixels * window.height as usize, convert.absent);
            }
            return Ok(false);
        };
        let from = place + u64::from(first) * chunks.stride();
        self.read_bytes(from, window).map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                self.path,
                chunks.grid.name(plane * chunks.grid.count() + chunk),
                "the file was cut short while it was read; start again",
            ),
            _ => LayoutError::io(self.path, "cannot read the TIFF file", source),
        })?;
        turn_bits(&mut self.bytes, chunks.is_reversed);
        let row_bytes = chunks.row_bytes(window.width) as usize;
        let pitch = self.bytes.len() / window.height as usize;
        for row in self.bytes.chunks_exact(pitch) {
            convert.append_row(&row[..row_bytes], pixels, &mut self.apart[at]);
        }
        Ok(true)
    }

    /// Reads the rows of `window`, the first of which lies at `at`: as they lie in the file, or only what is in the image where much is not.
    fn read_bytes(&mut self, at: u64, window: Window) -> std::io::Result<()> {
        let stride = self.chunks.stride();
        let row_bytes = self.chunks.row_bytes(window.width);
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
