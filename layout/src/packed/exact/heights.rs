//! Heights predicted in double precision, and the classes in whose contexts residuals are coded.

use crate::packed::plane::{Lattices, Plane};

/// Classes of heights.
pub(super) const CLASSES: i64 = 32;

impl Lattices<f64> {
    /// Continues the coarse lattice in straight lines over the border.
    pub(super) fn ring_coarse_values(&mut self, m: usize) {
        let (e, m) = (&mut self.coarse, m as isize);
        for y in 0..=m {
            e.set(-1, y, 2.0 * e.at(0, y) - e.at(1, y));
            e.set(m + 1, y, 2.0 * e.at(m, y) - e.at(m - 1, y));
        }
        for x in -1..=m + 1 {
            e.set(x, -1, 2.0 * e.at(x, 0) - e.at(x, 1));
            e.set(x, m + 1, 2.0 * e.at(x, m) - e.at(x, m - 1));
        }
    }

    /// Continues the whites over the border, so that the border's edges have the mean of either side.
    pub(super) fn ring_white_values(&mut self, m: usize) {
        let (e, w, m) = (&self.coarse, &mut self.whites, m as isize);
        for y in 0..m {
            w.set(-1, y, e.at(0, y) + e.at(0, y + 1) - w.at(0, y));
            w.set(m, y, e.at(m, y) + e.at(m, y + 1) - w.at(m - 1, y));
        }
        for x in -1..=m {
            w.set(x, -1, e.at(x, 0) + e.at(x + 1, 0) - w.at(x, 0));
            w.set(x, m, e.at(x, m) + e.at(x + 1, m) - w.at(x, m - 1));
        }
    }

    /// Predicted heights and how uneven the ground around is, of all whites.
    pub(super) fn predict_white_values(&self, m: usize, predicted: &mut [f64], uneven: &mut [f64]) {
        let rows = predicted.chunks_exact_mut(m).zip(uneven.chunks_exact_mut(m));
        for (j, (predicted, uneven)) in rows.enumerate() {
            let e = of_row(&self.coarse, j, m);
            let far = [e(-1, 0), e(-1, 1), e(2, 0), e(2, 1), e(0, -1), e(1, -1), e(0, 2), e(1, 2)];
            predict([e(0, 0), e(1, 1), e(1, 0), e(0, 1)], far, predicted, uneven);
        }
    }

    /// The same of all blacks: those on edges that run east, then the others.
    pub(super) fn predict_black_values(&self, m: usize, predicted: &mut [f64], uneven: &mut [f64]) {
        let (east, north) = predicted.split_at_mut(m * (m + 1));
        let (east_uneven, north_uneven) = uneven.split_at_mut(m * (m + 1));
        let rows = east.chunks_exact_mut(m).zip(east_uneven.chunks_exact_mut(m));
        for (j, (predicted, uneven)) in rows.enumerate() {
            let (e, w) = (of_row(&self.coarse, j, m), of_row(&self.whites, j, m));
            let far = [w(-1, -1), w(-1, 0), w(1, -1), w(1, 0), e(0, -1), e(1, -1), e(0, 1), e(1, 1)];
            predict([e(0, 0), e(1, 0), w(0, -1), w(0, 0)], far, predicted, uneven);
        }
        let rows = north.chunks_exact_mut(m + 1).zip(north_uneven.chunks_exact_mut(m + 1));
        for (j, (predicted, uneven)) in rows.enumerate() {
            let (e, w) = (of_row(&self.coarse, j, m + 1), of_row(&self.whites, j, m + 1));
            let far = [w(-1, -1), w(0, -1), w(-1, 1), w(0, 1), e(-1, 0), e(-1, 1), e(1, 0), e(1, 1)];
            predict([e(0, 0), e(0, 1), w(-1, 0), w(0, 0)], far, predicted, uneven);
        }
    }
}

/// Rows of `count` cells near row `j`, by the steps from it.
fn of_row<'p>(plane: &'p Plane<f64>, j: usize, count: usize) -> impl Fn(isize, isize) -> &'p [f64] {
    move |dx, dy| plane.row(dx, j as isize + dy, count)
}

/// Predictions of a row from the corners of diamonds and the eight vertices around, in the order in which they are given.
#[inline(always)]
fn predict(near: [&[f64]; 4], far: [&[f64]; 8], predicted: &mut [f64], uneven: &mut [f64]) {
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

/// Twice the binary logarithm of a number that is not negative, rounded down by and large: its exponent and the bit behind the leading one.
#[inline(always)]
pub(super) fn half_octaves(value: f64) -> i64 {
    (value.abs().to_bits() >> 51) as i64
}

/// The class of a height whose surroundings are `uneven`, predicted to be `predicted`, of whose numbers `shift` low bits stand as they are. `mantissa` is how many bits a height has behind its leading one.
#[inline(always)]
pub(super) fn class_of(uneven: f64, predicted: f64, mantissa: i64, shift: u32) -> u8 {
    // What a height's last bit is worth, in half octaves.
    let last = half_octaves(predicted) / 2 * 2 - 2 * mantissa;
    (half_octaves(uneven) - last - 2 * i64::from(shift) - 4).clamp(0, CLASSES - 1) as u8
}
