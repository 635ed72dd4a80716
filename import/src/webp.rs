//! WebP: what a file says of its picture, and the picture, decoded by image-webp as a whole.
//!
//! The decoder takes memory for the frame that its data declare before it compares that with the size of the picture; so both are compared here first. A picture has at most
//! 16,383 texels on a side. Cost: 4 bytes a texel, and as much again for planes or the last picture while it is decoded ([`Frame::memory_bytes`]).

use image_webp::{DecodingError, WebPDecoder};
use std::io::{BufRead, Seek, SeekFrom};

/// Longest side that the format has.
const MAX_SIDE: u32 = 16_384;
/// Chunks of a file looked at, at most.
const MAX_CHUNKS: usize = 256;
/// Longest block of EXIF that is looked at.
const MAX_EXIF_BYTES: usize = 1 << 20;

/// What is said of a picture before it is decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Frame {
    pub(crate) size: [u32; 2],
    pub(crate) has_alpha: bool,
    pub(crate) is_lossy: bool,
    pub(crate) is_animated: bool,
}

/// Why there is no picture.
#[derive(Debug)]
pub(crate) enum Trouble {
    Io(std::io::Error),
    Damaged(&'static str),
    Unsupported(&'static str),
}

impl From<std::io::Error> for Trouble {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => Self::Damaged("it is cut short"),
            _ => Self::Io(error),
        }
    }
}

impl From<DecodingError> for Trouble {
    fn from(error: DecodingError) -> Self {
        match error {
            DecodingError::IoError(error) => error.into(),
            DecodingError::UnsupportedFeature(_) => Self::Unsupported("it is of an unusual kind"),
            _ => Self::Damaged("its WebP stream is damaged"),
        }
    }
}

/// Whether a file of these first bytes is WebP.
pub(crate) fn is_webp(head: &[u8]) -> bool {
    head.starts_with(b"RIFF") && head.get(8..12) == Some(b"WEBP")
}

/// The size of a frame of lossy or lossless data, by its first ten bytes.
fn coded_size(kind: [u8; 4], data: [u8; 10]) -> Option<[u32; 2]> {
    match &kind {
        b"VP8 " => {
            let side = |at: usize| u32::from(u16::from_le_bytes([data[at], data[at + 1]]) & 0x3fff);
            (data[3..6] == [0x9d, 0x01, 0x2a]).then(|| [side(6), side(8)])
        }
        b"VP8L" => {
            let bits = u32::from_le_bytes([data[1], data[2], data[3], data[4]]);
            (data[0] == 0x2f).then_some([(bits & 0x3fff) + 1, (bits >> 14 & 0x3fff) + 1])
        }
        _ => None,
    }
}

impl Frame {
    /// Reads what the file says.
    pub(crate) fn read(mut input: impl BufRead + Seek) -> Result<Self, Trouble> {
        check_coded(&mut input)?;
        input.seek(SeekFrom::Start(0))?;
        Self::of(&mut WebPDecoder::new(input)?)
    }

    fn of<R: BufRead + Seek>(decoder: &mut WebPDecoder<R>) -> Result<Self, Trouble> {
        let (wide, high) = decoder.dimensions();
        if wide == 0 || high == 0 || wide.max(high) > MAX_SIDE {
            return Err(Trouble::Damaged("it declares a size that the format does not have"));
        }
        Ok(Self {
            size: [wide, high],
            has_alpha: decoder.has_alpha(),
            is_lossy: decoder.is_lossy(),
            is_animated: decoder.is_animated(),
        })
    }

    /// Memory that decoding takes: the texels, planes of a lossy picture, and a copy of a lossless one.
    pub(crate) fn memory_bytes(&self) -> u64 {
        let texels = (u64::from(self.size[0]) + 16) * (u64::from(self.size[1]) + 16);
        texels * 8 + (8 << 20)
    }

    /// Channels of a decoded texel.
    pub(crate) fn channels(&self) -> usize {
        if self.has_alpha { 4 } else { 3 }
    }
}

/// That every frame that the file holds is as large as it may be: of the picture's own size, unless it is one of several.
fn check_coded(input: &mut (impl BufRead + Seek)) -> Result<(), Trouble> {
    input.seek(SeekFrom::Start(12))?;
    let mut canvas = None;
    for _ in 0..MAX_CHUNKS {
        let mut head = [0; 8];
        if input.read_exact(&mut head).is_err() {
            return Ok(());
        }
        let kind = [head[0], head[1], head[2], head[3]];
        let length = u32::from_le_bytes([head[4], head[5], head[6], head[7]]);
        let at = input.stream_position()?;
        if matches!(&kind, b"VP8X" | b"VP8 " | b"VP8L") {
            let mut data = [0; 10];
            let read = usize::try_from(length).unwrap_or(10).min(10);
            input.read_exact(&mut data[..read])?;
            if &kind == b"VP8X" {
                let side = |at: usize| u32::from_le_bytes([data[at], data[at + 1], data[at + 2], 0]) + 1;
                canvas = Some([side(4), side(7)]);
            } else {
                let size = coded_size(kind, data).ok_or(Trouble::Damaged("its WebP stream is damaged"))?;
                return match canvas {
                    Some(canvas) if canvas != size => {
                        Err(Trouble::Damaged("its data are of another size than it says"))
                    }
                    _ => Ok(()),
                };
            }
        }
        input.seek(SeekFrom::Start(at + u64::from(length) + u64::from(length & 1)))?;
    }
    Err(Trouble::Unsupported("its picture comes behind too much else"))
}

/// Decodes a picture of `wanted`'s size and channels.
pub(crate) fn decode(mut input: impl BufRead + Seek, wanted: &Frame) -> Result<Vec<u8>, Trouble> {
    check_coded(&mut input)?;
    input.seek(SeekFrom::Start(0))?;
    let mut decoder = WebPDecoder::new(input)?;
    let frame = Frame::of(&mut decoder)?;
    if frame.size != wanted.size || frame.has_alpha != wanted.has_alpha || frame.is_animated {
        return Err(Trouble::Damaged("it is of another size or kind than it says"));
    }
    let mut texels = vec![0; frame.size[0] as usize * frame.size[1] as usize * frame.channels()];
    decoder.read_image(&mut texels)?;
    Ok(texels)
}

/// The block of EXIF, if there is a short one.
pub(crate) fn exif(input: impl BufRead + Seek) -> Option<Vec<u8>> {
    let mut decoder = WebPDecoder::new(input).ok()?;
    decoder.set_memory_limit(MAX_EXIF_BYTES);
    decoder.exif_metadata().ok().flatten()
}
