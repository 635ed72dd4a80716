//! Heights predicted in double precision, and the classes in whose contexts residuals are coded.

use crate::packed::plane::Prediction;

/// Classes of heights.
pub(super) const CLASSES: i64 = 32;

/// Heights in double precision, and how uneven the ground around is. Sums are in the order in which they are written.
pub(super) struct Real;

impl Prediction<f64> for Real {
    type Around = f64;

    #[inline(always)]
    fn row(near: [&[f64]; 4], far: [&[f64]; 8], predicted: &mut [f64], uneven: &mut [f64]) {
        let count = predicted.len();
        let ([a, b, c, d], far) = (near.map(|row| &row[..count]), far.map(|row| &row[..count]));
        let uneven = &mut uneven[..count];
        for i in 0..count {
            let corners = a[i] + b[i] + c[i] + d[i];
            let around =
                far[0][i] + far[1][i] + far[2][i] + far[3][i] + far[4][i] + far[5][i] + far[6][i] + far[7][i];
            predicted[i] = (10.0 * corners - around) / 32.0;
            let twist = (a[i] + b[i] - c[i] - d[i]).abs();
            let curve = (2.0 * corners - around).abs();
            let range = a[i].max(b[i]).max(c[i].max(d[i])) - a[i].min(b[i]).min(c[i].min(d[i]));
            uneven[i] = 8.0 * twist + curve + 2.0 * range;
        }
    }
}

/// Twice the binary logarithm of a number that is not negative, rounded down by and large: its exponent and the bit behind the leading one.
#[inline(always)]
pub(super) fn half_octaves(value: f64) -> i64 {
    (value.abs().to_bits() >> 51) as i64
}

/// The class of a height whose surroundings are `uneven`, predicted to be `predicted`, of whose numbers `shift` low bits stand as they are. `mantissa` is how many bits a height has behind its leading one;
/// whole numbers have none.
#[inline(always)]
pub(super) fn class_of(uneven: f64, predicted: f64, mantissa: Option<i64>, shift: u32) -> u8 {
    // What a height's last bit is worth, in half octaves.
    let last = mantissa.map_or(half_octaves(1.0), |mantissa| half_octaves(predicted) / 2 * 2 - 2 * mantissa);
    (half_octaves(uneven) - last - 2 * i64::from(shift) - 4).clamp(0, CLASSES - 1) as u8
}
