//! Undoes the predictors of TIFF on rows, in place.
//!
//! 2 stores the difference to the sample on the left, as an integer of the sample's width even for reals
//! (TIFF 6.0, section 14). 3 stores the bytes of a row's reals by significance, most significant
//! first, and of these the difference to the byte on the left (Adobe Photoshop TIFF Technical Note 3, 2005).
//! Rows stay in the file's byte order. Cost: one pass, two for 3.

/// Undoes predictor 2 on rows of `stride` bytes of `bands` samples a pixel.
pub(super) fn horizontal(bytes: &mut [u8], stride: usize, bands: usize, sample_bytes: u64, big_endian: bool) {
    for row in bytes.chunks_exact_mut(stride) {
        match (sample_bytes, big_endian) {
            (1, _) => accumulate(row, bands),
            (2, false) => sum::<2>(row, bands, |a, b| {
                u16::from_le_bytes(a).wrapping_add(u16::from_le_bytes(b)).to_le_bytes()
            }),
            (2, true) => sum::<2>(row, bands, |a, b| {
                u16::from_be_bytes(a).wrapping_add(u16::from_be_bytes(b)).to_be_bytes()
            }),
            (4, false) => sum::<4>(row, bands, |a, b| {
                u32::from_le_bytes(a).wrapping_add(u32::from_le_bytes(b)).to_le_bytes()
            }),
            (4, true) => sum::<4>(row, bands, |a, b| {
                u32::from_be_bytes(a).wrapping_add(u32::from_be_bytes(b)).to_be_bytes()
            }),
            (_, false) => sum::<8>(row, bands, |a, b| {
                u64::from_le_bytes(a).wrapping_add(u64::from_le_bytes(b)).to_le_bytes()
            }),
            (_, true) => sum::<8>(row, bands, |a, b| {
                u64::from_be_bytes(a).wrapping_add(u64::from_be_bytes(b)).to_be_bytes()
            }),
        }
    }
}

/// Undoes predictor 3 on rows of `stride` bytes of `bands` samples a pixel, with `scratch` for a row.
pub(super) fn floating(
    bytes: &mut [u8],
    stride: usize,
    bands: usize,
    sample_bytes: u64,
    big_endian: bool,
    scratch: &mut Vec<u8>,
) {
    let size = sample_bytes as usize;
    let width = stride / size;
    for row in bytes.chunks_exact_mut(stride) {
        accumulate(row, bands);
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

/// Replaces each byte by the sum of itself, the one `lag` before, the one `lag` before that, and so on.
fn accumulate(row: &mut [u8], lag: usize) {
    if lag == 1 {
        let mut total = 0u8;
        for byte in row {
            total = total.wrapping_add(*byte);
            *byte = total;
        }
        return;
    }
    for at in lag..row.len() {
        row[at] = row[at].wrapping_add(row[at - lag]);
    }
}

/// As [`accumulate`], of samples.
fn sum<const N: usize>(row: &mut [u8], lag: usize, add: impl Fn([u8; N], [u8; N]) -> [u8; N]) {
    let samples = row.as_chunks_mut::<N>().0;
    if lag == 1 {
        let mut total = [0; N];
        for sample in samples {
            total = add(total, *sample);
            *sample = total;
        }
        return;
    }
    for at in lag..samples.len() {
        samples[at] = add(samples[at], samples[at - lag]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reals_come_back_in_either_byte_order() {
        let reals = [1521.5f32, 1522.25, -3.0e-7, f32::MAX];
        let mut stored: Vec<u8> =
            (0..4).flat_map(|byte| reals.map(|real| real.to_be_bytes()[byte])).collect();
        for at in (1..stored.len()).rev() {
            stored[at] = stored[at].wrapping_sub(stored[at - 1]);
        }
        for (big_endian, bytes) in [(true, reals.map(f32::to_be_bytes)), (false, reals.map(f32::to_le_bytes))]
        {
            let mut row = stored.clone();
            floating(&mut row, 16, 1, 4, big_endian, &mut Vec::new());
            assert_eq!(row, bytes.concat());
        }
    }

    #[test]
    fn differences_wrap_in_either_byte_order() {
        let mut row = [0xff, 0xff, 0x02, 0x00];
        horizontal(&mut row, 4, 1, 2, false);
        assert_eq!(row, [0xff, 0xff, 0x01, 0x00]);
        let mut row = [0xff, 0xff, 0x00, 0x02];
        horizontal(&mut row, 4, 1, 2, true);
        assert_eq!(row, [0xff, 0xff, 0x00, 0x01]);
    }
}
