//! The bytes of a tile as texels: PNG, WebP or JPEG, told by how they begin.
//!
//! A tile is a square whose size is read before anything is decoded. Whatever it holds comes as red, green, blue, alpha of 8 bits. Cost: 4 bytes a texel, and the decoder's own.

use crate::guard::guard;
use crate::jpeg_frame::JpegFrame;
use crate::webp::{self, Frame, Trouble, is_webp};
use jpeg_decoder::{Decoder as JpegDecoder, PixelFormat};
use png::{BitDepth, Decoder as PngDecoder, Limits, Transformations};
use std::io::Cursor;
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Sides of tiles in texels.
const SIDES: std::ops::RangeInclusive<u32> = 2..=2048;
/// Memory for chunks of a PNG beside its picture.
const CHUNK_BYTES: usize = 1 << 20;

/// Bytes that a tile of a side takes at most: those of its texels at 16 bits a channel, and something beside.
pub(super) fn most_bytes(side: u32) -> u64 {
    u64::from(side) * u64::from(side) * 8 + (1 << 20)
}

/// Bytes of the largest tile.
pub(super) fn most_of_all() -> u64 {
    most_bytes(*SIDES.end())
}

/// How texels were stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stored {
    /// As they were, of so many bits a channel.
    Exactly { bits: u8 },
    /// By a packing that changes colours: "JPEG".
    About(&'static str),
}

/// A decoded tile.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Texels {
    pub(super) side: u32,
    /// Red, green, blue, alpha of each texel, row by row from the north.
    pub(super) rgba: Vec<[u8; 4]>,
    pub(super) stored: Stored,
}

/// Decodes a tile; `place` names it.
///
/// # Errors
/// Damage; a format or size that is not read.
pub(super) fn decode(path: &Path, place: impl Fn() -> String, bytes: &[u8]) -> Result<Texels, LayoutError> {
    let problem = |words: &str| LayoutError::damaged(path, place(), words);
    guard(path, &place, || {
        if bytes.starts_with(b"\x89PNG\r\n\x1a\n") {
            of_png(bytes).map_err(|words| problem(&words))
        } else if bytes.starts_with(b"\xff\xd8\xff") {
            of_jpeg(bytes).map_err(|words| problem(&words))
        } else if is_webp(bytes) {
            of_webp(bytes).map_err(|words| problem(&words))
        } else {
            Err(other(path, &place(), bytes))
        }
    })
}

/// What is no tile of pictures.
fn other(path: &Path, place: &str, bytes: &[u8]) -> LayoutError {
    if bytes.is_empty() {
        return LayoutError::damaged(
            path,
            place,
            "it is empty; fetch it again, or delete it, and it counts as missing",
        );
    }
    let what = match bytes {
        [0x1f, 0x8b, ..] => "vector tiles, or packed ones",
        [b'I', b'I', 42 | 43, ..] | [b'M', b'M', 0, ..] => "TIFF",
        [_, _, _, _, b'f', b't', b'y', b'p', ..] => "AVIF",
        [b'<', ..] => "a web page or another text, such as what a server says instead of a tile",
        _ => "of an unknown format",
    };
    LayoutError::unsupported(path, format!("{place} is {what}; read are tiles of PNG, WebP and JPEG"))
}

fn check([wide, high]: [u32; 2]) -> Result<u32, String> {
    if wide == high && SIDES.contains(&wide) {
        return Ok(wide);
    }
    Err(format!(
        "it has {wide} x {high} texels, and tiles are squares of {} to {}",
        SIDES.start(),
        SIDES.end()
    ))
}

fn square(side: u32, texels: &[u8], channels: usize, stored: Stored) -> Texels {
    let spread = |texel: &[u8]| match *texel {
        [grey] => [grey, grey, grey, 255],
        [grey, alpha] => [grey, grey, grey, alpha],
        [red, green, blue] => [red, green, blue, 255],
        [red, green, blue, alpha, ..] => [red, green, blue, alpha],
        [] => [0; 4],
    };
    Texels { side, rgba: texels.chunks_exact(channels).map(spread).collect(), stored }
}

fn of_png(bytes: &[u8]) -> Result<Texels, String> {
    const DAMAGED: &str = "its PNG stream is damaged or cut short; fetch it again";
    let mut decoder = PngDecoder::new(Cursor::new(bytes));
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_ignore_text_chunk(true);
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let header = decoder.read_header_info().map_err(|_| DAMAGED)?;
    let side = check([header.width, header.height])?;
    let bits = if header.bit_depth == BitDepth::Sixteen { 16 } else { 8 };
    decoder.set_limits(Limits { bytes: CHUNK_BYTES + side as usize * side as usize * 8 });
    let mut reader = decoder.read_info().map_err(|_| DAMAGED)?;
    let length = reader.output_buffer_size().ok_or(DAMAGED)?;
    let mut texels = vec![0; length];
    let frame = reader.next_frame(&mut texels).map_err(|_| DAMAGED)?;
    // A file of moving pictures may have frames of other sizes.
    if [frame.width, frame.height] != [side; 2] {
        return Err(DAMAGED.to_owned());
    }
    Ok(square(side, &texels[..frame.buffer_size()], frame.color_type.samples(), Stored::Exactly { bits }))
}

fn of_jpeg(bytes: &[u8]) -> Result<Texels, String> {
    const DAMAGED: &str = "its JPEG stream is damaged or cut short; fetch it again";
    JpegFrame::read(bytes).map_err(|_| DAMAGED.to_owned()).and_then(|frame| frame.check())?;
    let mut decoder = JpegDecoder::new(bytes);
    decoder.read_info().map_err(|_| DAMAGED)?;
    let header = decoder.info().ok_or(DAMAGED)?;
    let side = check([header.width, header.height].map(u32::from))?;
    let channels = match header.pixel_format {
        PixelFormat::L8 => 1,
        PixelFormat::RGB24 => 3,
        PixelFormat::CMYK32 | PixelFormat::L16 => {
            return Err("it is a JPEG of inks or of more than 8 bits, which is not read".to_owned());
        }
    };
    let texels = decoder.decode().map_err(|_| DAMAGED)?;
    if texels.len() != side as usize * side as usize * channels {
        return Err(DAMAGED.to_owned());
    }
    Ok(square(side, &texels, channels, Stored::About("JPEG")))
}

fn of_webp(bytes: &[u8]) -> Result<Texels, String> {
    let words = |trouble| match trouble {
        Trouble::Io(_) => "the WebP picture cannot be read; fetch it again".to_owned(),
        Trouble::Damaged(what) => format!("the WebP picture is damaged: {what}; fetch it again"),
        Trouble::Unsupported(what) => format!("the WebP picture is not read: {what}; write it again"),
    };
    let frame = Frame::read(Cursor::new(bytes)).map_err(words)?;
    if frame.is_animated {
        return Err("the WebP picture moves, and pictures that stand still are read".to_owned());
    }
    let side = check(frame.size)?;
    let texels = webp::decode(Cursor::new(bytes), &frame).map_err(words)?;
    let stored = if frame.is_lossy { Stored::About("lossy WebP") } else { Stored::Exactly { bits: 8 } };
    Ok(square(side, &texels, frame.channels(), stored))
}
