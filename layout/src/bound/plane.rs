//! The plane of a bin-tree triangle over the sample grid, and the largest distance of samples from it.
//!
//! Every sample's distance is computed from the triangle's own numbers in one fixed order of operations, whatever the tile.
//! So tile size, memory budget and threads cannot change a bit of the result. On whole height codes all of
//! it is exact.

use super::larger;
use crate::grid::GridPoint;

/// `z = (zv + gy * (y - yv)) + gx * (x - xv)` in height codes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plane {
    xv: f64,
    yv: f64,
    zv: f64,
    gx: f64,
    gy: f64,
}

impl Plane {
    /// The plane through apex `a` and base `b`, `d` of a bin-tree triangle, each with its height code.
    pub(crate) fn of([a, b, d]: [(GridPoint, f64); 3]) -> Self {
        let x = |p: (GridPoint, f64)| f64::from(p.0.x());
        let y = |p: (GridPoint, f64)| f64::from(p.0.y());
        let (xv, yv, zv) = (0.5 * (x(b) + x(d)), 0.5 * (y(b) + y(d)), 0.5 * (b.1 + d.1));
        // Corners lie powers of two apart: a product with the inverse is the quotient.
        let per = |steps: f64| inverse_of_power_of_two(steps);
        let (gx, gy) = if y(b) == y(d) {
            ((d.1 - b.1) * per(x(d) - x(b)), (a.1 - zv) * per(y(a) - yv))
        } else if x(b) == x(d) {
            ((a.1 - zv) * per(x(a) - xv), (d.1 - b.1) * per(y(d) - y(b)))
        } else if y(a) == y(b) {
            ((a.1 - b.1) * per(x(a) - x(b)), (d.1 - a.1) * per(y(d) - y(a)))
        } else {
            ((d.1 - a.1) * per(x(d) - x(a)), (a.1 - b.1) * per(y(a) - y(b)))
        };
        Self { xv, yv, zv, gx, gy }
    }

    /// Largest distance in codes of the samples `row` from the plane; the first lies at (`x`, `y`). Void samples are NaN and do not count.
    #[inline(always)]
    pub(crate) fn farthest_in_row(&self, x: u32, y: u32, row: &[f64]) -> f64 {
        let base = self.zv + self.gy * (f64::from(y) - self.yv);
        // A whole number, as are its sums with the lanes: no rounding depends on how the row is cut.
        let mut offset = f64::from(x) - self.xv;
        let distance = |value: f64, offset: f64| (value - (base + self.gx * offset)).abs();
        let (mut farthest, mut rest) = (0.0, row);
        // Eight lanes, so that the compiler can vectorise; most triangles are small, and most rows shorter than that.
        if row.len() >= 8 {
            let chunks;
            (chunks, rest) = row.as_chunks::<8>();
            let mut lanes = [0.0f64; 8];
            for chunk in chunks {
                for (lane, (value, best)) in chunk.iter().zip(&mut lanes).enumerate() {
                    *best = larger(*best, distance(*value, offset + lane as f64));
                }
                offset += 8.0;
            }
            farthest = lanes.into_iter().fold(0.0, larger);
        }
        for value in rest {
            farthest = larger(farthest, distance(*value, offset));
            offset += 1.0;
        }
        farthest
    }

    /// Codes that a sample with height code `value` at `p` lies above the plane: the same operations as in a row.
    #[inline(always)]
    pub(crate) fn above(&self, p: GridPoint, value: f64) -> f64 {
        let base = self.zv + self.gy * (f64::from(p.y()) - self.yv);
        value - (base + self.gx * (f64::from(p.x()) - self.xv))
    }

    /// Codes by which rounding may move a sample's distance, up to `reach` steps from the middle of the base; 0 for a level plane, which is exact.
    pub(crate) fn slack(&self, reach: f64) -> f64 {
        if self.gx == 0.0 && self.gy == 0.0 {
            return 0.0;
        }
        1e-14 * (self.zv.abs() + reach * (self.gx.abs() + self.gy.abs()))
    }

    /// Lowest and highest code of the plane over the samples from (`west`, `south`) to (`east`, `north`).
    pub(crate) fn range(&self, [west, south]: [u32; 2], [east, north]: [u32; 2]) -> [f64; 2] {
        let at = |x: u32, y: u32| -self.above(GridPoint::new(x, y), 0.0);
        let corners = [at(west, south), at(east, south), at(west, north), at(east, north)];
        [
            corners.into_iter().fold(f64::INFINITY, f64::min),
            corners.into_iter().fold(f64::NEG_INFINITY, f64::max),
        ]
    }
}

/// The inverse of a power of two, or of its negative, from 2^-1022 to 2^1022.
#[inline(always)]
fn inverse_of_power_of_two(power: f64) -> f64 {
    const SIGN: u64 = 1 << 63;
    let bits = power.to_bits();
    f64::from_bits((bits & SIGN) | ((2046 << 52) - (bits & !SIGN)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverses_are_those_of_a_division() {
        for exponent in -20..=20 {
            for power in [2.0f64.powi(exponent), -(2.0f64.powi(exponent))] {
                assert_eq!(inverse_of_power_of_two(power), 1.0 / power);
                for value in [0.0, 1.0, -0.3, 65_535.0, 1e-9, 123.456] {
                    assert_eq!((value * inverse_of_power_of_two(power)).to_bits(), (value / power).to_bits());
                }
            }
        }
    }
}
