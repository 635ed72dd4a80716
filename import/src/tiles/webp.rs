//! WebP pictures, by crate `image-webp`, from bytes in memory.
//!
//! Sizes are read before anything is decoded, and those of the stream inside must be those of the canvas, because memory is taken for both. Cost: 4 bytes a texel beside the bytes,
//! and as much again while it is decoded.

use image_webp::WebPDecoder;
use std::io::Cursor;

/// The head of a WebP file.
pub(super) const HEAD_BYTES: usize = 12;

/// Whether bytes begin as WebP does.
pub(super) fn is_webp(head: &[u8]) -> bool {
    head.len() >= HEAD_BYTES && head.starts_with(b"RIFF") && head[8..12] == *b"WEBP"
}

/// A WebP picture whose head was read.
pub(super) struct Webp<'b> {
    decoder: WebPDecoder<Cursor<&'b [u8]>>,
    /// Width and height in texels.
    pub(super) size: [u32; 2],
    /// 3 or 4.
    pub(super) channels: usize,
    /// Whether colours were changed to take less room.
    pub(super) is_lossy: bool,
}

impl<'b> Webp<'b> {
    /// Reads the head.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(super) fn new(bytes: &'b [u8]) -> Result<Self, &'static str> {
        const DAMAGED: &str = "the WebP picture is damaged; fetch it again";
        let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(|_| DAMAGED)?;
        if decoder.is_animated() {
            return Err("the WebP picture moves, and pictures that stand still are read");
        }
        let (wide, high) = decoder.dimensions();
        if frames(bytes).any(|size| size != [wide, high]) {
            return Err(DAMAGED);
        }
        let channels = if decoder.has_alpha() { 4 } else { 3 };
        let is_lossy = decoder.is_lossy();
        Ok(Self { decoder, size: [wide, high], channels, is_lossy })
    }

    /// Its texels, as many bytes each as it has channels, row by row.
    ///
    /// # Errors
    /// Damage, in words.
    pub(super) fn texels(mut self) -> Result<Vec<u8>, &'static str> {
        let count = self.size.iter().map(|side| *side as usize).product::<usize>() * self.channels;
        let mut texels = vec![0; count];
        self.decoder
            .read_image(&mut texels)
            .map_err(|_| "the WebP picture is damaged or cut short; fetch it again")?;
        Ok(texels)
    }
}

/// Sizes that the streams in the file declare (RFC 9649, sections 2.5 and 2.6; RFC 6386, section 9.1).
fn frames(bytes: &[u8]) -> impl Iterator<Item = [u32; 2]> {
    let mut rest = bytes.get(HEAD_BYTES..).unwrap_or_default();
    std::iter::from_fn(move || {
        loop {
            let (head, data) = rest.split_first_chunk::<8>()?;
            let length = u32::from_le_bytes([head[4], head[5], head[6], head[7]]) as usize;
            rest = data.get(length.checked_add(length % 2)?..).unwrap_or_default();
            match (&head[..4], data) {
                (b"VP8 ", [_, _, _, _, _, _, a, b, c, d, ..]) => {
                    let side = |low: u8, high: u8| u32::from(u16::from_le_bytes([low, high]) & 0x3fff);
                    return Some([side(*a, *b), side(*c, *d)]);
                }
                (b"VP8L", [_, a, b, c, d, ..]) => {
                    let bits = u32::from_le_bytes([*a, *b, *c, *d]);
                    return Some([(bits & 0x3fff) + 1, ((bits >> 14) & 0x3fff) + 1]);
                }
                _ => {}
            }
        }
    })
}
