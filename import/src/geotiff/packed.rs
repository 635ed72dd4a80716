//! Reads compressed chunks, each by one worker, some rows at a time.
//!
//! What a worker holds is a window of rows, not the chunk: a file of one huge strip takes no more memory than a tiled one. As many workers read as fit into
//! [`BUDGET_BYTES`]. Only rows of more than a megabyte, large windows of ZSTD and chunks of LERC and JPEG XL take more, which [`Chunks::memory_bytes`] tells. Bands that lie one after the other
//! are read in step.

use std::fs::File;
use std::io::ErrorKind;
use std::path::Path;

use super::super::guard::guard;
use super::super::parallel::each_task;
use super::super::{WINDOW_SAMPLES, input, jxl};
use super::chunks::{Chunks, Compression, Predictor};
use super::convert::Convert;
use super::failure::Failure;
use super::listing::Places;
use super::planes::Planes;
use super::rows::{INPUT_BYTES, Rows};
use super::span::LARGEST_WHOLE;
use super::{parts, put_constant};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Memory that all workers together take, unless one takes more.
pub(super) const BUDGET_BYTES: u64 = 16 << 20;
/// Bytes unpacked at once, unless a row has more.
const PART_BYTES: u64 = 1 << 18;
/// State of a codec, without ZSTD's window.
const CODEC_BYTES: u64 = 1 << 18;

impl Chunks {
    /// Memory that a worker takes.
    fn worker_bytes(&self, planes: &Planes) -> u64 {
        let stride = self.stride();
        let samples = WINDOW_SAMPLES.max(u64::from(self.grid.width.min(self.grid.chunk_width)));
        let codec = match self.compression {
            // As long packed as unpacked, or a window of at most twice the length.
            Compression::Zstd if self.decoded_bytes() <= LARGEST_WHOLE => 3 * self.decoded_bytes(),
            Compression::Zstd => self.largest_window,
            // The blob, its samples and mask, and their bytes.
            Compression::Lerc(_) => 6 * self.decoded_bytes(),
            Compression::JpegXl => {
                let texels = u64::from(self.grid.chunk_width) * u64::from(self.grid.chunk_height);
                let packed = 2 * self.decoded_bytes() + (1 << 10);
                packed + jxl::chunk_bytes(texels, self.side_by_side(), packed)
            }
            _ => 0,
        };
        let scratch = if self.predictor == Predictor::Floating { stride } else { 0 };
        let plane = scratch + 8 * samples + INPUT_BYTES + CODEC_BYTES + codec;
        let count = planes.numbers.len() as u64;
        // What is made of several planes is kept beside them.
        let joined = if count > 1 { 8 * samples } else { 0 };
        PART_BYTES.max(stride) + joined + plane.saturating_mul(count)
    }

    /// Memory that reading takes beyond [`BUDGET_BYTES`].
    pub(super) fn memory_bytes(&self, planes: &Planes) -> u64 {
        if self.is_raw() { 0 } else { self.worker_bytes(planes).saturating_sub(BUDGET_BYTES) }
    }
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
    let workers = usize::try_from(BUDGET_BYTES / chunks.worker_bytes(planes)).unwrap_or(usize::MAX).max(1);
    let open = || {
        Ok(Worker {
            path,
            chunks,
            planes,
            convert,
            file: &file,
            places: planes.numbers.iter().map(|_| chunks.grid.places(path, &file)).collect(),
            bytes: Vec::new(),
            apart: vec![Vec::new(); planes.numbers.len()],
            samples: Vec::new(),
        })
    };
    each_task(chunks.grid.count(), workers, open, |worker, chunk| worker.push(chunk, sink))
}

struct Worker<'a> {
    path: &'a Path,
    chunks: &'a Chunks,
    planes: &'a Planes,
    convert: &'a Convert,
    file: &'a File,
    /// Of each plane, for all of them are read side by side.
    places: Vec<Places<'a>>,
    bytes: Vec<u8>,
    /// Samples of each plane.
    apart: Vec<Vec<f64>>,
    samples: Vec<f64>,
}

impl<'a> Worker<'a> {
    /// Pushes the samples of a chunk.
    fn push(&mut self, chunk: u64, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let (chunks, planes) = (self.chunks, self.planes);
        let window = chunks.grid.window(chunk);
        let mut open = Vec::with_capacity(planes.numbers.len());
        for (plane, places) in planes.numbers.iter().zip(&mut self.places) {
            let number = plane * chunks.grid.count() + chunk;
            let place = chunks.grid.place_of(*plane, chunk, places)?;
            let file = self.file;
            let rows = place
                .map(|place| guarded(self.path, chunks, number, || Rows::open(file, chunks, number, place)));
            open.push((number, rows.transpose()?));
        }
        if open.iter().all(|(_, rows)| rows.is_none()) {
            return put_constant(sink, window, self.convert.left_out);
        }
        let stride = chunks.stride();
        for part in parts(window, part_rows(window.width, stride)) {
            for (at, (number, rows)) in open.iter_mut().enumerate() {
                self.read(at, *number, rows.as_mut(), part)?;
            }
            if let [only] = &self.apart[..] {
                sink.put(part, only)?;
            } else {
                planes.join(&self.apart, &mut self.samples);
                sink.put(part, &self.samples)?;
            }
        }
        Ok(())
    }

    /// Reads the next rows of a plane, those of `part`.
    fn read(
        &mut self,
        plane: usize,
        chunk: u64,
        rows: Option<&mut Rows<'a>>,
        part: Window,
    ) -> Result<(), LayoutError> {
        let (chunks, pixels) = (self.chunks, part.width as usize);
        let samples = &mut self.apart[plane];
        samples.clear();
        let Some(rows) = rows else {
            samples.resize(pixels * part.height as usize, self.convert.absent);
            return Ok(());
        };
        let stride = chunks.stride() as usize;
        self.bytes.resize(stride * part.height as usize, 0);
        guarded(self.path, chunks, chunk, || rows.fill(&mut self.bytes))?;
        let row_bytes = chunks.row_bytes(part.width) as usize;
        for row in self.bytes.chunks_exact(stride) {
            self.convert.append_row(&row[..row_bytes], pixels, samples);
        }
        Ok(())
    }
}

/// Does what may fail in a chunk. The codecs are others' work: a panic in one is damage in this chunk.
fn guarded<T>(
    path: &Path,
    chunks: &Chunks,
    chunk: u64,
    decode: impl FnOnce() -> Result<T, Failure>,
) -> Result<T, LayoutError> {
    let failed = |failure| match failure {
        Failure::Damaged(problem) => LayoutError::damaged(
            path,
            chunks.grid.name(chunk),
            format!("{problem}; fetch or write the file again"),
        ),
        Failure::Io(source) if source.kind() == ErrorKind::UnexpectedEof => LayoutError::damaged(
            path,
            chunks.grid.name(chunk),
            "the file was cut short while it was read; start again",
        ),
        Failure::Io(source) => LayoutError::io(path, "cannot read the TIFF file", source),
    };
    guard(path, || chunks.grid.name(chunk), || decode().map_err(failed))
}

/// Rows of a chunk that are unpacked at once, at least 1.
fn part_rows(width: u32, stride: u64) -> u32 {
    let rows = (PART_BYTES / stride.max(1)).min(WINDOW_SAMPLES / u64::from(width.max(1)));
    u32::try_from(rows).unwrap_or(u32::MAX).max(1)
}
