//! Undoes the predictors of TIFF on rows of one sample a pixel, in place.
//!
//! 2 stores the difference to the sample on the left, as an integer of the sample's width even for reals
//! (TIFF 6.0, section 14). 3 stores the bytes of a row's reals by significance, most significant
//! first, and of these the difference to the byte on the left (Adobe Photoshop TIFF Technical Note 3, 2005).
//! Rows stay in the file's byte order. Cost: one pass, two for 3.

/// Undoes predictor 2 on rows of `stride` bytes.
pub(super) fn horizontal(bytes: &mut [u8], stride: usize, sample_bytes: u64, big_endian: bool) {
    for row in bytes.chunks_exact_mut(stride) {
        match (sample_bytes, big_endian) {
            (1, _) => accumulate(row),
            (2, false) => {
                sum::<2>(row, |a, b| u16::from_le_bytes(a).wrapping_add(u16::from_le_bytes(b)).to_le_bytes())
            }
            (2, true) => {
                sum::<2>(row, |a, b| u16::from_be_bytes(a).wrapping_add(u16::from_be_bytes(b)).to_be_bytes())
            }
            (4, false) => {
                sum::<4>(row, |a, b| u32::from_le_bytes(a).wrapping_add(u32::from_le_bytes(b)).to_le_bytes())
            }
            (4, true) => {
                sum::<4>(row, |a, b| u32::from_be_bytes(a).wrapping_add(u32::from_be_bytes(b)).to_be_bytes())
            }
            (_, false) => {
                sum::<8>(row, |a, b| u64::from_le_bytes(a).wrapping_add(u64::from_le_bytes(b)).to_le_bytes())
            }
            (_, true) => {
                sum::<8>(row, |a, b| u64::from_be_bytes(a).wrapping_add(u64::from_be_bytes(b)).to_be_bytes())
            }
        }
    }
}

/// Undoes predictor 3 on rows of `stride` bytes, with `scratch` for a row.
pub(super) fn floating(
    bytes: &mut [u8],
    stride: usize,
    sample_bytes: u64,
    big_endian: bool,
    scratch: &mut Vec<u8>,
) {
    let size = sample_bytes as usize;
    let width = stride / size;
    for row in bytes.chunks_exact_mut(stride) {
        accumulate(row);
        scratch.clear();
        scratch.extend_from_slice(row);
        for (significance, plane) in scratch.chunks_exact(width).enumerate() {
            let at = if big_endian { significance } else { size - 1 - significance };
            for (sample, byte) in row.chunks_exact_mut(size).zip(plane) {
                sample[at] = *byte;
            }
        }
    }
}

/// Replaces each byte by the sum of all up to it.
fn accumulate(row: &mut [u8]) {
    let mut total = 0u8;
    for byte in row {
        total = total.wrapping_add(*byte);
        *byte = total;
    }
}

/// Replaces each sample by the sum of all up to it.
fn sum<const N: usize>(row: &mut [u8], add: impl Fn([u8; N], [u8; N]) -> [u8; N]) {
    let mut total = [0; N];
    for sample in row.as_chunks_mut::<N>().0 {
        total = add(total, *sample);
        *sample = total;
    }
}
