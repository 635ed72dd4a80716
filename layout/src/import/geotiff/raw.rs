//! Reads uncompressed chunks a few rows at a time, so a file stored as one huge strip needs no more
//! memory than a tiled one.
//!
//! Every chunk is cut into bands of rows; the bands are the tasks, read in file order by all workers.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use super::super::parallel::each_task;
use super::chunks::Chunks;
use super::convert::Void;
use super::{put_constant, rows_at_once};
use crate::dem::{SampleSink, Window};
use crate::error::LayoutError;

struct Worker {
    file: File,
    bytes: Vec<u8>,
    samples: Vec<f64>,
}

/// Pushes every sample of the image once.
pub(super) fn stream(
    path: &Path,
    chunks: &Chunks,
    void: &Void,
    sink: &dyn SampleSink,
) -> Result<(), LayoutError> {
    let band_rows = rows_at_once(chunks.grid.chunk_width).min(chunks.grid.chunk_height);
    let bands = u64::from(chunks.grid.chunk_height.min(chunks.grid.height).div_ceil(band_rows));
    let open = || {
        let file =
            File::open(path).map_err(|source| LayoutError::io(path, "cannot open the TIFF file", source))?;
        Ok(Worker { file, bytes: Vec::new(), samples: Vec::new() })
    };
    each_task(chunks.grid.count() * bands, usize::MAX, open, |worker, task| {
        let (chunk, band) = (task / bands, task % bands);
        let whole = chunks.grid.window(chunk);
        // Less than the chunk's height.
        let first = band as u32 * band_rows;
        if first >= whole.height {
            return Ok(());
        }
        let window = Window { row: whole.row + first, height: band_rows.min(whole.height - first), ..whole };
        let Some((at, _)) = chunks.grid.place(chunk) else {
            return put_constant(sink, window, void.absent());
        };
        let stride = u64::from(chunks.grid.chunk_width) * chunks.sample_bytes();
        // The table's check has shown that the file is this long.
        worker.bytes.resize((stride * u64::from(window.height)) as usize, 0);
        let read = worker
            .file
            .seek(SeekFrom::Start(at + u64::from(first) * stride))
            .and_then(|_| worker.file.read_exact(&mut worker.bytes));
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                path,
                chunks.grid.name(chunk),
                "the file was cut short while it was read; start again",
            ),
            _ => LayoutError::io(path, "cannot read the TIFF file", source),
        })?;
        worker.samples.clear();
        let row_bytes = (u64::from(window.width) * chunks.sample_bytes()) as usize;
        for row in worker.bytes.chunks_exact(stride as usize) {
            void.append(chunks.sample_type, chunks.big_endian, &row[..row_bytes], &mut worker.samples);
        }
        sink.put(window, &worker.samples)
    })
}
