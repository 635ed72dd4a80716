//! A compressed chunk on its way out of the file, some rows at a time.
//!
//! Most codecs unpack piece by piece. Three work on a whole chunk: LERC, JPEG XL, and ZSTD where its window is larger than the chunk. Rows come out as they would lie in a
//! file without compression and predictor.

use super::chunks::{Chunks, Compression, Lerc, Predictor};
use super::codec::Unpacker;
use super::failure::Failure;
use super::span::{LARGEST_WHOLE, Span};
use super::{lerc, predictor, zstd_frame};
use crate::jxl::{self, Depth, Trouble};
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read};
use terrasoar_layout::dem::SampleType;

/// Packed bytes read at once.
pub(super) const INPUT_BYTES: u64 = 1 << 16;

/// A chunk, from its first row on.
pub(super) struct Rows<'f> {
    chunks: &'f Chunks,
    unpacker: Unpacker<Box<dyn BufRead + 'f>>,
    /// A row of a predictor.
    scratch: Vec<u8>,
}

impl<'f> Rows<'f> {
    /// The chunk that lies at `at` of `file` and is `length` bytes long.
    pub(super) fn open(
        file: &'f File,
        chunks: &'f Chunks,
        chunk: u64,
        (at, length): (u64, u64),
    ) -> Result<Self, Failure> {
        let mut span = Span { file, at, left: length, is_reversed: chunks.is_reversed };
        let whole = match chunks.compression {
            Compression::Lerc(packing) => Some(unpack_lerc(span, packing, chunks, chunk)?),
            Compression::JpegXl => Some(unpack_jpeg_xl(span, chunks, chunk)?),
            Compression::Zstd if chunks.whole_is_needed(span)? => {
                Some(unpack_zstd(&mut span, chunks, chunk)?)
            }
            _ => None,
        };
        let (compression, packed): (_, Box<dyn BufRead>) = match whole {
            Some(whole) => (Compression::None, Box::new(Cursor::new(whole))),
            None => {
                let input = BufReader::with_capacity(INPUT_BYTES.min(length) as usize, span);
                (chunks.compression, Box::new(input))
            }
        };
        let unpacker = Unpacker::new(compression, packed, chunks.window_allowed())?;
        Ok(Self { chunks, unpacker, scratch: Vec::new() })
    }

    /// Fills `bytes` with the next rows, whole ones of the chunk.
    pub(super) fn fill(&mut self, bytes: &mut [u8]) -> Result<(), Failure> {
        self.unpacker.fill(bytes)?;
        let chunks = self.chunks;
        let (stride, bands) = (chunks.stride() as usize, chunks.side_by_side() as usize);
        let size = chunks.stored.bytes().unwrap_or(1);
        match chunks.predictor {
            Predictor::None => {}
            Predictor::Horizontal => predictor::horizontal(bytes, stride, bands, size, chunks.big_endian),
            Predictor::Floating => {
                predictor::floating(bytes, stride, bands, size, chunks.big_endian, &mut self.scratch);
            }
        }
        Ok(())
    }
}

impl Chunks {
    /// Whether the chunk's window is larger than it may be, and the chunk short.
    fn whole_is_needed(&self, mut span: Span<'_>) -> Result<bool, Failure> {
        let mut head = [0; zstd_frame::HEAD_BYTES];
        let length = span.read(&mut head)?;
        let window = zstd_frame::window(&head[..length]).unwrap_or(0);
        Ok(window > self.window_allowed() && self.decoded_bytes() <= LARGEST_WHOLE)
    }

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

/// Reads a chunk that becomes `unpacked` bytes.
fn packed(span: &mut Span<'_>, unpacked: u64) -> Result<Vec<u8>, Failure> {
    // Nothing that is worth packing becomes longer by it, but for its head.
    if span.left > unpacked.saturating_mul(2).saturating_add(1 << 10) {
        return Err(Failure::Damaged("it is much longer packed than unpacked".into()));
    }
    let mut packed = vec![0; span.left as usize];
    span.read_exact(&mut packed)?;
    Ok(packed)
}

/// Unpacks a chunk of ZSTD as a whole.
fn unpack_zstd(span: &mut Span<'_>, chunks: &Chunks, chunk: u64) -> Result<Vec<u8>, Failure> {
    let unpacked = chunks.decoded_bytes();
    let packed = packed(span, unpacked)?;
    let mut whole = vec![0; unpacked as usize];
    zstd_frame::unpack_whole(&packed, &mut whole, chunks.stored_bytes(chunk) as usize)
        .map_err(Failure::Damaged)?;
    Ok(whole)
}

/// Unpacks a chunk of LERC.
fn unpack_lerc(mut span: Span<'_>, packing: Lerc, chunks: &Chunks, chunk: u64) -> Result<Vec<u8>, Failure> {
    let unpacked = chunks.decoded_bytes();
    let mut blob = packed(&mut span, unpacked)?;
    let compression = match packing {
        Lerc::Plain => Compression::None,
        Lerc::Deflate => Compression::Deflate,
        Lerc::Zstd => Compression::Zstd,
    };
    if compression != Compression::None {
        // The blob tells its own length; it is no longer than raw samples, a mask of a byte each and a head.
        let most = unpacked.saturating_mul(2).saturating_add(1 << 16);
        let mut unpacker = Unpacker::new(compression, &blob[..], most.next_power_of_two().max(1 << 17))?;
        blob = unpacker.rest(most as usize)?;
    }
    lerc::unpack(chunks, &blob, chunks.grid.window(chunk).height)
}

/// Unpacks a chunk of JPEG XL. As of LERC the bytes of a big-endian file were packed as if they were little-endian, so they come out in the file's order.
fn unpack_jpeg_xl(mut span: Span<'_>, chunks: &Chunks, chunk: u64) -> Result<Vec<u8>, Failure> {
    let packed = packed(&mut span, chunks.decoded_bytes())?;
    let grid = &chunks.grid;
    let depth = match chunks.sample_type {
        SampleType::U8 => Depth::Whole(8),
        SampleType::U16 => Depth::Whole(16),
        SampleType::F32 => Depth::Real(32),
        _ => return Err(Failure::Damaged("its samples are of a type that JPEG XL does not have".into())),
    };
    let size = [grid.chunk_width, grid.chunk_height, grid.window(chunk).height];
    jxl::chunk(&packed, size, chunks.side_by_side() as usize, depth).map_err(|trouble| match trouble {
        Trouble::Io(error) => Failure::Io(error),
        Trouble::Damaged(problem) | Trouble::Unsupported(problem) => Failure::Damaged(problem.into()),
    })
}
