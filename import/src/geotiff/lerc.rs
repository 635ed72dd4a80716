//! LERC chunks (Esri's Limited Error Raster Compression, version 2), plain or packed once more by DEFLATE or ZSTD.
//!
//! A chunk is one blob, which `lerc-reader` unpacks as a whole; so its size is compared with that of the chunk before that, and chunks of more than
//! 64 MiB are refused when the file is opened. What a blob's mask leaves out is NaN among reals; among whole numbers it has no value, and stays 0 as
//! libtiff has it. libtiff packs the bytes of a big-endian file as if they were little-endian numbers, so what comes out stands in the file's order either way.

use super::chunks::Chunks;
use super::failure::Failure;
use lerc_reader::Decoded;
use terrasoar_layout::dem::SampleType;

fn damaged(words: &str) -> Failure {
    Failure::Damaged(words.to_owned())
}

/// Columns, rows and samples a pixel that the blob's head declares.
fn declared(blob: &[u8]) -> Option<[u32; 3]> {
    let rest = blob.strip_prefix(b"Lerc2 ")?;
    let number = |at: usize| Some(u32::from_le_bytes(rest.get(at..at + 4)?.try_into().ok()?));
    let version = number(0)?;
    // A sum stands before the sizes from version 3 on.
    let at = if version >= 3 { 8 } else { 4 };
    let depth = if version >= 4 { number(at + 8)? } else { 1 };
    Some([number(at + 4)?, number(at)?, depth])
}

/// Unpacks the blob of a chunk of which `rows` rows are wanted, into bytes as the file would have them without compression.
pub(super) fn unpack(chunks: &Chunks, blob: &[u8], rows: u32) -> Result<Vec<u8>, Failure> {
    let [width, height, depth] = declared(blob).ok_or_else(|| damaged("it holds no LERC"))?;
    let grid = &chunks.grid;
    let bands = chunks.side_by_side();
    let is_alike = width == grid.chunk_width && (rows..=grid.chunk_height).contains(&height);
    // Where the last band is alpha it may be the mask of the others.
    let mask_is_band = u64::from(depth) + 1 == bands;
    if !is_alike || !(mask_is_band || u64::from(depth) == bands) {
        return Err(Failure::Damaged(format!(
            "its LERC is of {width} x {height} samples, and it should not be"
        )));
    }
    let decoded = lerc_reader::decode_first(blob).map_err(|_| damaged("its LERC is damaged"))?;
    let depth = depth as usize;
    let bytes =
        samples(&decoded, depth, chunks).ok_or_else(|| damaged("its LERC is of another type of samples"))?;
    if !mask_is_band {
        return Ok(bytes);
    }
    let size = chunks.stored.bytes().unwrap_or(1) as usize;
    let mask = |pixel: usize| decoded.mask.as_ref().is_none_or(|mask| mask.get(pixel) != Some(&0));
    let pixels = bytes.chunks_exact(size * depth).enumerate();
    Ok(pixels
        .flat_map(|(number, pixel)| {
            let alpha = if mask(number) { u8::MAX } else { 0 };
            pixel.iter().copied().chain(std::iter::repeat_n(alpha, size))
        })
        .collect())
}

macro_rules! bytes {
    ($values:expr) => {
        $values.iter().flat_map(|value| value.to_le_bytes()).collect()
    };
}

/// The samples as bytes in the file's order, if they are of the type that the file declares.
fn samples(decoded: &Decoded, depth: usize, chunks: &Chunks) -> Option<Vec<u8>> {
    use lerc_core::PixelData;
    // A NaN whichever way its bytes are read.
    let (nan_32, nan_64) = (f32::from_bits(u32::MAX), f64::from_bits(u64::MAX));
    let hidden = |at: usize| decoded.mask.as_ref().is_some_and(|mask| mask.get(at / depth) == Some(&0));
    Some(match (&decoded.pixels, chunks.sample_type) {
        (PixelData::I8(values), SampleType::I8) => bytes!(values),
        (PixelData::U8(values), SampleType::U8) => bytes!(values),
        (PixelData::I16(values), SampleType::I16) => bytes!(values),
        (PixelData::U16(values), SampleType::U16) => bytes!(values),
        (PixelData::I32(values), SampleType::I32) => bytes!(values),
        (PixelData::U32(values), SampleType::U32) => bytes!(values),
        (PixelData::F32(values), SampleType::F32) => {
            let seen = values.iter().enumerate().map(|(at, value)| if hidden(at) { nan_32 } else { *value });
            bytes!(seen.collect::<Vec<_>>())
        }
        (PixelData::F64(values), SampleType::F64) => {
            let seen = values.iter().enumerate().map(|(at, value)| if hidden(at) { nan_64 } else { *value });
            bytes!(seen.collect::<Vec<_>>())
        }
        _ => return None,
    })
}
