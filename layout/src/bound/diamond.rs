//! The largest distance of all samples from the two triangles that a vertex splits, by looking at every one.
//!
//! Samples on the triangles' legs are left to the children that split these legs. A triangle with a corner that is void or outside does not count.

use super::{Plane, larger};
use crate::grid::GridPoint;

/// Height codes of a rectangle of samples, by column and row within it.
pub(crate) trait Samples {
    /// The grid point at a column and row, and its height code; NaN for voids and outside the rectangle.
    fn corner(&self, x: u32, y: u32) -> (GridPoint, f64);

    /// Largest distance from `plane` over columns `from..=to` of row `y`, all in the rectangle.
    fn row(&self, plane: &Plane, from: u32, to: u32, y: u32) -> f64;
}

/// The plane of a triangle with apex `a`, if its corners are there; `ends` are those of its base.
#[inline(always)]
fn plane_of(samples: &impl Samples, a: [u32; 2], ends: [(GridPoint, f64); 2]) -> Option<Plane> {
    let a = samples.corner(a[0], a[1]);
    let is_whole = !(a.1.is_nan() || ends[0].1.is_nan() || ends[1].1.is_nan());
    is_whole.then(|| Plane::of([a, ends[0], ends[1]]))
}

/// For the vertex at (`x`, `y`) of an edge of length 2 `s` that runs north; apexes lie to the west and the east.
#[inline(always)]
pub(crate) fn farthest_upright(samples: &impl Samples, x: u32, y: u32, s: u32) -> f64 {
    let ends = [samples.corner(x, y - s), samples.corner(x, y + s)];
    let mut farthest = 0.0f64;
    if let Some(plane) = x.checked_sub(s).and_then(|west| plane_of(samples, [west, y], ends)) {
        for row in y - s + 1..y + s {
            let reach = s - 1 - row.abs_diff(y);
            farthest = larger(farthest, samples.row(&plane, x - reach, x, row));
        }
    }
    if let Some(plane) = plane_of(samples, [x + s, y], ends) {
        for row in y - s + 1..y + s {
            let reach = s - 1 - row.abs_diff(y);
            farthest = larger(farthest, samples.row(&plane, x, x + reach, row));
        }
    }
    farthest
}

/// For the vertex at (`x`, `y`) of an edge of length 2 `s` that runs east; apexes lie to the south and the north.
#[inline(always)]
pub(crate) fn farthest_level(samples: &impl Samples, x: u32, y: u32, s: u32) -> f64 {
    let ends = [samples.corner(x - s, y), samples.corner(x + s, y)];
    let mut farthest = 0.0f64;
    if let Some(plane) = y.checked_sub(s).and_then(|south| plane_of(samples, [x, south], ends)) {
        for row in y - s + 1..=y {
            let reach = s - 1 - (y - row);
            farthest = larger(farthest, samples.row(&plane, x - reach, x + reach, row));
        }
    }
    if let Some(plane) = plane_of(samples, [x, y + s], ends) {
        for row in y..y + s {
            let reach = s - 1 - (row - y);
            farthest = larger(farthest, samples.row(&plane, x - reach, x + reach, row));
        }
    }
    farthest
}

/// For the centre (`x`, `y`) of a square of side 2 `s` whose diagonal rises from south-west to north-east, or falls.
#[inline(always)]
pub(crate) fn farthest_diagonal(samples: &impl Samples, x: u32, y: u32, s: u32, rising: bool) -> f64 {
    let ends = if rising {
        [samples.corner(x - s, y - s), samples.corner(x + s, y + s)]
    } else {
        [samples.corner(x + s, y - s), samples.corner(x - s, y + s)]
    };
    let mut farthest = 0.0f64;
    for apex_south in [true, false] {
        let apex_east = rising == apex_south;
        let apex = [if apex_east { x + s } else { x - s }, if apex_south { y - s } else { y + s }];
        let Some(plane) = plane_of(samples, apex, ends) else { continue };
        for row in y - s + 1..y + s {
            let along = row + s - y; // 1..2s from the south
            let diagonal = if rising { x - s + along } else { x + s - along };
            let (from, to) = if apex_east { (diagonal, x + s - 1) } else { (x - s + 1, diagonal) };
            farthest = larger(farthest, samples.row(&plane, from, to, row));
        }
    }
    farthest
}
