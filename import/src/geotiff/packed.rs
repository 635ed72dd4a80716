//! Reads compressed chunks, each by one worker, some rows at a time.
//!
//! What a worker holds is a window of rows, not the chunk: a file of one huge strip takes no more memory than a tiled one. So many workers read as find room in
//! [`BUDGET_BYTES`]; only rows of more than a megabyte and large windows of ZSTD take more, which [`Chunks::memory_bytes`] tells.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

use super::super::guard::guard;
use super::super::parallel::each_task;
use super::super::{WINDOW_SAMPLES, input};
use super::chunks::{Chunks, Compression, Predictor};
use super::codec::{Failure, Unpacker};
use super::convert::Convert;
use super::span::{LARGEST_WHOLE, Span};
use super::zstd_frame;
use super::{parts, predictor, put_constant};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Memory that all workers together take, unless one takes more.
pub(super) const BUDGET_BYTES: u64 = 16 << 20;
/// Bytes unpacked at once, unless a row has more.
const PART_BYTES: u64 = 1 << 18;
/// Packed bytes read at once.
const INPUT_BYTES: u64 = 1 << 16;
/// State of a codec, without ZSTD's window.
const CODEC_BYTES: u64 = 1 << 18;
impl Chunks {
    /// Memory that a worker takes.
    fn worker_bytes(&self) -> u64 {
        let stride = self.stride();
        let samples = WINDOW_SAMPLES.max(u64::from(self.grid.width.min(self.grid.chunk_width)));
        let zstd = match self.compression {
            // As long packed as unpacked, or a window of at most twice the length.
            Compression::Zstd if self.decoded_bytes() <= LARGEST_WHOLE => 3 * self.decoded_bytes(),
            Compression::Zstd => self.largest_window,
            _ => 0,
        };
        let rows = PART_BYTES.max(stride) + if self.predictor == Predictor::Floating { stride } else { 0 };
        rows + 8 * samples + INPUT_BYTES + CODEC_BYTES + zstd
    }

    /// Memory that reading takes beyond [`BUDGET_BYTES`].
    pub(super) fn memory_bytes(&self) -> u64 {
        if self.is_raw() { 0 } else { self.worker_bytes().saturating_sub(BUDGET_BYTES) }
    }
}

/// Pushes every sample of the image once.
pub(super) fn stream(
    path: &Path,
    chunks: &Chunks,
    convert: &Convert,
    sink: &dyn SampleSink,
) -> Result<(), LayoutError> {
    let file = input::open(path, "cannot open the TIFF file")?;
    let workers = usize::try_from(BUDGET_BYTES / chunks.worker_bytes()).unwrap_or(usize::MAX).max(1);
    let open = || {
        Ok(Worker {
            path,
            chunks,
            file: &file,
            places: chunks.grid.places(path, &file),
            whole: Vec::new(),
            bytes: Vec::new(),
            row: Vec::new(),
            samples: Vec::new(),
        })
    };
    each_task(chunks.grid.count(), workers, open, |worker, chunk| {
        let window = chunks.grid.window(chunk);
        match chunks.grid.place(chunk, &mut worker.places)? {
            Some(place) => worker.push(chunk, window, place, convert, sink),
            None => put_constant(sink, window, convert.absent),
        }
    })
}

struct Worker<'a> {
    path: &'a Path,
    chunks: &'a Chunks,
    file: &'a File,
    places: super::listing::Places<'a>,
    /// A chunk unpacked as a whole.
    whole: Vec<u8>,
    bytes: Vec<u8>,
    row: Vec<u8>,
    samples: Vec<f64>,
}

impl Worker<'_> {
    /// Pushes the samples of a chunk that lies at `at` and is `length` bytes long.
    fn push(
        &mut self,
        chunk: u64,
        window: Window,
        (at, length): (u64, u64),
        convert: &Convert,
        sink: &dyn SampleSink,
    ) -> Result<(), LayoutError> {
        let (path, chunks) = (self.path, self.chunks);
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
        // The codecs are others' work: a panic in one is damage in this chunk.
        let guarded = |decode: &mut dyn FnMut() -> Result<(), Failure>| {
            guard(path, || chunks.grid.name(chunk), || decode().map_err(failed))
        };
        let (size, stride, bands) = (chunks.sample_bytes(), chunks.stride() as usize, chunks.bands as usize);
        let mut span = Span { file: self.file, at, left: length };
        let is_whole =
            chunks.compression == Compression::Zstd && self.whole_is_needed(span).map_err(failed)?;
        if is_whole {
            guarded(&mut || unpack_whole(&mut span, chunks, chunk, &mut self.whole))?;
        }
        let (compression, packed): (_, Box<dyn BufRead + '_>) = if is_whole {
            (Compression::None, Box::new(&self.whole[..]))
        } else {
            (chunks.compression, Box::new(BufReader::with_capacity(INPUT_BYTES.min(length) as usize, span)))
        };
        let mut unpacker = Unpacker::new(compression, packed, chunks.window_allowed()).map_err(failed)?;
        for part in parts(window, part_rows(window.width, stride as u64)) {
            self.bytes.resize(stride * part.height as usize, 0);
            guarded(&mut || unpacker.fill(&mut self.bytes))?;
            match chunks.predictor {
                Predictor::None => {}
                Predictor::Horizontal => {
                    predictor::horizontal(&mut self.bytes, stride, bands, size, chunks.big_endian);
                }
                Predictor::Floating => {
                    predictor::floating(
                        &mut self.bytes,
                        stride,
                        bands,
                        size,
                        chunks.big_endian,
                        &mut self.row,
                    );
                }
            }
            self.samples.clear();
            let row_bytes = (u64::from(window.width) * chunks.pixel_bytes()) as usize;
            for row in self.bytes.chunks_exact(stride) {
                convert.append(&row[..row_bytes], &mut self.samples);
            }
            sink.put(part, &self.samples)?;
        }
        Ok(())
    }

    /// Whether the chunk's window is larger than it may be, and the chunk short.
    fn whole_is_needed(&self, mut span: Span<'_>) -> Result<bool, Failure> {
        let mut head = [0; zstd_frame::HEAD_BYTES];
        let length = span.read(&mut head)?;
        let window = zstd_frame::window(&head[..length]).unwrap_or(0);
        Ok(window > self.chunks.window_allowed() && self.chunks.decoded_bytes() <= LARGEST_WHOLE)
    }
}

impl Chunks {
    /// Largest window that a stream may ask for.
    fn window_allowed(&self) -> u64 {
        let unpacked = self.decoded_bytes();
        if unpacked <= LARGEST_WHOLE {
            unpacked.next_power_of_two().max(1 << 17)
        } else {
            self.largest_window
        }
    }
}

/// Unpacks a chunk of ZSTD into `whole`.
fn unpack_whole(
    span: &mut Span<'_>,
    chunks: &Chunks,
    chunk: u64,
    whole: &mut Vec<u8>,
) -> Result<(), Failure> {
    let unpacked = chunks.decoded_bytes();
    // Nothing that is worth packing becomes longer by it.
    if span.left > 2 * unpacked {
        return Err(Failure::Damaged("it is much longer packed than unpacked".into()));
    }
    let mut packed = vec![0; span.left as usize];
    span.read_exact(&mut packed)?;
    whole.resize(unpacked as usize, 0);
    zstd_frame::unpack_whole(&packed, whole, chunks.stored_bytes(chunk) as usize).map_err(Failure::Damaged)
}

/// Rows of a chunk that are unpacked at once, at least 1.
fn part_rows(width: u32, stride: u64) -> u32 {
    let rows = (PART_BYTES / stride.max(1)).min(WINDOW_SAMPLES / u64::from(width.max(1)));
    u32::try_from(rows).unwrap_or(u32::MAX).max(1)
}
