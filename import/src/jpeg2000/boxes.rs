//! The boxes of a JP2 file (ISO/IEC 15444-1, annex I): where the stream lies, the headers in front of it, and what is said of the ground.
//!
//! Cost: a read of 16 bytes a box; held are the box of headers and those of the ground.

use super::header::Header;
use super::part;
use super::place::{self, Ground};
use super::{Source, Stream, Trouble, damaged, stream};

/// A JP2 file begins so.
pub(super) const SIGNATURE: &[u8] = b"\0\0\0\x0cjP  \r\n\x87\n";
const FILE_TYPE: &[u8] = b"\0\0\0\x14ftypjp2 \0\0\0\0jp2 ";
/// Boxes of a file, at most.
const MAX_BOXES: usize = 4096;
/// Longest box of headers: a palette, or a colour profile.
const MAX_HEADER_BYTES: u64 = 8 << 20;
/// GeoJP2: a GeoTIFF without a picture, in a box of this number.
const GEO_TIFF: [u8; 16] =
    [0xb1, 0x4b, 0xf8, 0xbd, 0x08, 0x3d, 0x4b, 0x43, 0xa5, 0xae, 0x8c, 0xd7, 0xd5, 0xa6, 0xce, 0x03];

/// A JP2 file, or a bare stream.
#[derive(Debug)]
pub(crate) struct Jp2 {
    pub(crate) stream: Stream,
    pub(crate) header: Header,
    pub(crate) ground: Ground,
}

impl Jp2 {
    /// Reads the boxes of a file of `length` bytes.
    pub(crate) fn read(source: Source<'_>, length: u64) -> Result<Self, Trouble> {
        let mut this = None;
        let (mut header, mut ground) = (Vec::new(), Ground::default());
        if source.array::<4>(0)? == *stream::START {
            this = Some(Stream::read(source, 0, length)?);
        }
        let mut at = if this.is_some() { length } else { 0 };
        for _ in 0..MAX_BOXES {
            if at.saturating_add(8) > length {
                break;
            }
            // What stands behind the stream may be anything.
            let found = match part::next(source, at, length) {
                Ok(found) => found,
                Err(_) if this.is_some() => break,
                Err(trouble) => return Err(trouble),
            };
            let size = found.end - found.at;
            match &found.kind {
                b"jp2h" if header.is_empty() => {
                    if size > MAX_HEADER_BYTES {
                        return Err(damaged("its headers are longer than 8 MiB"));
                    }
                    header = source.vec(found.at, size as usize)?;
                }
                b"jp2c" if this.is_none() => this = Some(Stream::read(source, found.at, size)?),
                b"uuid"
                    if size > 16 && size <= place::MAX_BYTES && source.array::<16>(found.at)? == GEO_TIFF =>
                {
                    ground.tiff = Some(source.vec(found.at + 16, size as usize - 16)?);
                }
                b"asoc" if size <= place::MAX_BYTES && ground.gml.is_none() => {
                    ground.gml = place::gml_in(&source.vec(found.at, size as usize)?);
                }
                _ => {}
            }
            at = found.end;
        }
        let stream = this.ok_or_else(|| damaged("there is no picture in it"))?;
        let header = if header.is_empty() { Header::default() } else { Header::read(&header, &stream)? };
        Ok(Self { stream, header, ground })
    }

    /// Channels of a texel.
    pub(crate) fn channels(&self) -> usize {
        self.header.palette.unwrap_or(self.stream.channels())
    }

    /// Memory that decoding the largest tile takes at most.
    pub(crate) fn tile_bytes(&self) -> u64 {
        self.stream.tile_bytes_of(self.channels()).saturating_add(self.header.bytes())
    }
}

/// A JP2 file of a stream and a box of headers.
pub(super) fn wrap(header: &[u8], stream: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(SIGNATURE.len() + FILE_TYPE.len() + header.len() + 8 + stream.len());
    [SIGNATURE, FILE_TYPE, header].into_iter().for_each(|part| bytes.extend(part));
    // Its length is what is left.
    bytes.extend(b"\0\0\0\0jp2c");
    bytes.extend(stream);
    bytes
}
