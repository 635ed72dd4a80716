//! Reads compressed chunks: unpacked whole, one a worker, and pushed in windows of a few rows.
//!
//! The number of workers is limited so that the chunks in memory stay below a gibibyte together.

use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use super::super::guard::guard;
use super::super::parallel::each_task;
use super::chunks::{Chunks, Predictor};
use super::codec::unpack;
use super::convert::Void;
use super::{parts, predictor, put_constant, rows_at_once};
use crate::dem::SampleSink;
use crate::error::LayoutError;

/// Memory for unpacked chunks, all workers together; a single chunk may be larger, for it is unpacked whole.
const BUDGET_BYTES: u64 = 16 << 20;

struct Worker {
    file: File,
    packed: Vec<u8>,
    bytes: Vec<u8>,
    row: Vec<u8>,
    samples: Vec<f64>,
}

/// Pushes every sample of the image once.
pub(super) fn stream(
    path: &Path,
    chunks: &Chunks,
    void: &Void,
    sink: &dyn SampleSink,
) -> Result<(), LayoutError> {
    let workers = usize::try_from(BUDGET_BYTES / chunks.decoded_bytes().max(1)).unwrap_or(usize::MAX).max(1);
    let open = || {
        let file =
            File::open(path).map_err(|source| LayoutError::io(path, "cannot open the TIFF file", source))?;
        Ok(Worker { file, packed: Vec::new(), bytes: Vec::new(), row: Vec::new(), samples: Vec::new() })
    };
    each_task(chunks.grid.count(), workers, open, |worker, chunk| {
        let window = chunks.grid.window(chunk);
        let Some((at, length)) = chunks.grid.place(chunk) else {
            return put_constant(sink, window, void.absent());
        };
        let stride = (u64::from(chunks.grid.chunk_width) * chunks.sample_bytes()) as usize;
        worker.read(path, chunks, chunk, at, length)?;
        // The table's check has shown that this is at most 512 MiB, and no more than the packed bytes can become.
        worker.bytes.resize(stride * window.height as usize, 0);
        // The codecs are others' work: a panic in one is damage in this chunk.
        guard(
            path,
            || chunks.grid.name(chunk),
            || {
                unpack(chunks.compression, &worker.packed, &mut worker.bytes).map_err(|problem| {
                    LayoutError::damaged(
                        path,
                        chunks.grid.name(chunk),
                        format!("{problem}; fetch or write the file again"),
                    )
                })
            },
        )?;
        let (size, big_endian) = (chunks.sample_bytes(), chunks.big_endian);
        match chunks.predictor {
            Predictor::None => {}
            Predictor::Horizontal => predictor::horizontal(&mut worker.bytes, stride, size, big_endian),
            Predictor::Floating => {
                predictor::floating(&mut worker.bytes, stride, size, big_endian, &mut worker.row)
            }
        }
        let row_bytes = (u64::from(window.width) * size) as usize;
        let mut rows = worker.bytes.chunks_exact(stride);
        for part in parts(window, rows_at_once(window.width)) {
            worker.samples.clear();
            for row in rows.by_ref().take(part.height as usize) {
                void.append(chunks.sample_type, big_endian, &row[..row_bytes], &mut worker.samples);
            }
            sink.put(part, &worker.samples)?;
        }
        Ok(())
    })
}

impl Worker {
    /// Reads the packed bytes of a chunk.
    fn read(
        &mut self,
        path: &Path,
        chunks: &Chunks,
        chunk: u64,
        at: u64,
        length: u64,
    ) -> Result<(), LayoutError> {
        // The table's check has shown that the file is this long; a chunk of more is not read to its end.
        let length = usize::try_from(length.min(BUDGET_BYTES)).unwrap_or(usize::MAX);
        self.packed.resize(length, 0);
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut self.packed));
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                path,
                chunks.grid.name(chunk),
                "the file was cut short while it was read; start again",
            ),
            _ => LayoutError::io(path, "cannot read the TIFF file", source),
        })
    }
}
