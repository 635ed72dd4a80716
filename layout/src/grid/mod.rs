//! The square grid under the terrain: 2^k + 1 samples a side, vertex levels, and the fold, which
//! moves padding back onto the data.
//!
//! Column x runs east, row y runs north, sample (0, 0) is the south-west corner of the data. A DEM of
//! any rectangle lies in the south-west of the square; a padding sample has the whole position
//! (x, y and height) of the nearest data sample. Triangles wholly beyond the data thereby lose their
//! area, and what remains covers the data exactly.
//!
//! Invariant: only [`Grid::new`] makes a grid, so `k` is 1..=20 and both sample counts fit the square.

pub(crate) mod octave;
pub mod order;
pub mod record;

use crate::error::LayoutError;
use crate::portable::hypot;
use crate::remedy::Remedy;
use crate::words::number;

/// Largest supported `k`: a square of 1,048,577 samples a side.
pub(crate) const MAX_K: u32 = 20;

/// Most samples a side of a terrain: 2^20 + 1.
pub const MOST_SAMPLES: u32 = (1 << MAX_K) + 1;

/// Most vertex levels of a terrain, corners left out.
pub const MOST_LEVELS: usize = 2 * MAX_K as usize;

/// [`MOST_SAMPLES`] as messages say it.
pub const MOST_SAMPLES_WORDS: &str = "1,048,577";

/// A grid coordinate: column x (east) and row y (north), each at most 2^20.
///
/// Packed into one word, x in the low half, so that a midpoint is one addition and one shift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct GridPoint(u64);

impl GridPoint {
    /// The point at column `x` and row `y`.
    #[inline(always)]
    pub const fn new(x: u32, y: u32) -> Self {
        Self(x as u64 | (y as u64) << 32)
    }

    /// Column, counted east.
    #[inline(always)]
    pub const fn x(self) -> u32 {
        self.0 as u32
    }

    /// Row, counted north.
    #[inline(always)]
    pub const fn y(self) -> u32 {
        (self.0 >> 32) as u32
    }

    /// The point half-way to `other`. Both coordinates must differ by even amounts, which holds for
    /// the two ends of every longest edge above the finest level.
    #[inline(always)]
    pub const fn midpoint(self, other: Self) -> Self {
        // Both sums are even and below 2^22, so no bit crosses from one half into the other.
        Self((self.0 + other.0) >> 1)
    }

    /// Both coordinates in one word, x in the low 32 bits: a unique identifier of the vertex.
    #[inline(always)]
    pub const fn packed(self) -> u64 {
        self.0
    }
}

/// Shape and spacing of a terrain's grid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    k: u32,
    samples: [u32; 2],
    spacing_m: [f64; 2],
}

impl Grid {
    /// The smallest grid that holds `samples` (wide, high) at `spacing_m` (east, north).
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if a side has fewer than 2 or more than [`MOST_SAMPLES`], or a spacing is
    /// not a positive finite number between 1e-3 and 1e6 metres.
    pub fn new(samples: [u32; 2], spacing_m: [f64; 2]) -> Result<Self, LayoutError> {
        let longest = samples[0].max(samples[1]);
        if samples[0].min(samples[1]) < 2 || longest > MOST_SAMPLES {
            return Err(LayoutError::Usage(format!(
                "a terrain has 2 to {MOST_SAMPLES_WORDS} samples a side, not {} x {}; cut the DEM into smaller ones",
                samples[0], samples[1]
            )));
        }
        if !spacing_m.iter().all(|s| (1e-3..=1e6).contains(s)) {
            return Err(LayoutError::Usage(format!(
                "a sample spacing lies between 0.001 and 1,000,000 metres, not {} x {}; state the spacing in metres",
                number(spacing_m[0]),
                number(spacing_m[1])
            ))
            .mended_by(Remedy::Spacing));
        }
        let k = (longest - 1).next_power_of_two().trailing_zeros().max(1);
        Ok(Self { k, samples, spacing_m })
    }

    /// Binary logarithm of the square's side in steps; 1..=20.
    pub fn k(&self) -> u32 {
        self.k
    }

    /// Side of the square in steps, 2^k.
    #[inline(always)]
    pub fn side_steps(&self) -> u32 {
        1 << self.k
    }

    /// Samples of the DEM (wide, high), padding not counted.
    pub fn samples(&self) -> [u32; 2] {
        self.samples
    }

    /// Metres between neighbouring samples (east, north).
    pub fn spacing_m(&self) -> [f64; 2] {
        self.spacing_m
    }

    /// Metres from the south-west to the north-east sample (east, north).
    pub fn extent_m(&self) -> [f64; 2] {
        [0, 1].map(|i| f64::from(self.samples[i] - 1) * self.spacing_m[i])
    }

    /// The data sample whose position a grid point has: itself, or the nearest one for padding.
    #[inline(always)]
    pub fn fold(&self, p: GridPoint) -> GridPoint {
        GridPoint::new(p.x().min(self.samples[0] - 1), p.y().min(self.samples[1] - 1))
    }

    /// Whether the point is padding, outside the data.
    #[inline(always)]
    pub fn is_padding(&self, p: GridPoint) -> bool {
        p.x() >= self.samples[0] || p.y() >= self.samples[1]
    }

    /// Whether any padding exists at all.
    pub fn has_padding(&self) -> bool {
        self.samples != [self.side_steps() + 1; 2]
    }

    /// Horizontal position in metres east and north of the south-west sample, padding folded.
    #[inline(always)]
    pub fn position_m(&self, p: GridPoint) -> [f64; 2] {
        let q = self.fold(p);
        [f64::from(q.x()) * self.spacing_m[0], f64::from(q.y()) * self.spacing_m[1]]
    }

    /// Number of vertex levels below the corners, 2k; the centre has level 2k - 1, the finest level is 0.
    pub fn levels(&self) -> u32 {
        2 * self.k
    }

    /// Level of a vertex other than the four corners: 2t for edge midpoints ("black"), 2t + 1 for cell
    /// centres ("white"), with 2^t the spacing of the vertex from its nearest ancestors in steps.
    #[inline]
    pub fn level(&self, p: GridPoint) -> u32 {
        let tx = p.x().trailing_zeros().min(self.k);
        let ty = p.y().trailing_zeros().min(self.k);
        2 * tx.min(ty) + u32::from(tx == ty)
    }

    /// Whether the point is one of the square's four corners, which have no level.
    pub fn is_corner(&self, p: GridPoint) -> bool {
        let n = self.side_steps();
        p.x().is_multiple_of(n) && p.y().is_multiple_of(n)
    }

    /// Metres of the longest edge that a vertex of `level` splits.
    pub fn edge_m(&self, level: u32) -> f64 {
        let step = f64::from(1u32 << (level / 2));
        let [dx, dy] = self.spacing_m;
        2.0 * step * if level & 1 == 1 { hypot(dx, dy) } else { dx.max(dy) }
    }

    /// Metres from a vertex of `level` to its farthest child over flat ground; 0 at level 0.
    pub(crate) fn child_distance_m(&self, level: u32) -> f64 {
        let step = f64::from(1u32 << (level / 2));
        let [dx, dy] = self.spacing_m;
        match level {
            0 => 0.0,
            white if white & 1 == 1 => step * dx.max(dy),
            _ => 0.5 * step * hypot(dx, dy),
        }
    }

    /// Nested-sphere radius in metres of a vertex of `level` over flat ground.
    pub(crate) fn flat_radius_m(&self, level: u32) -> f64 {
        (0..=level).map(|l| self.child_distance_m(l)).sum()
    }

    /// How far, in steps along either axis, the diamonds of a vertex of `level` and of all its
    /// descendants reach.
    pub fn reach_steps(&self, level: u32) -> u32 {
        (0..=level).fold(0, |below, level| Self::reach_above(level, below))
    }

    /// [`Grid::reach_steps`] of a level, `below` being that of the level below it, or 0.
    pub(crate) fn reach_above(level: u32, below: u32) -> u32 {
        let step = 1u32 << (level / 2);
        let to_child = if level & 1 == 1 { step } else { step / 2 };
        step.max(to_child + below)
    }

    /// Whether a vertex lies so far beyond the data that neither its diamond nor any descendant's
    /// touches the data's interior. Such a vertex is never refined and needs no record.
    #[inline]
    pub fn is_beyond(&self, p: GridPoint, level: u32) -> bool {
        let reach = self.reach_steps(level);
        p.x() >= self.samples[0] - 1 + reach || p.y() >= self.samples[1] - 1 + reach
    }

    /// The children of a vertex in the refinement DAG that lie inside the square, at most four
    /// (Lindstrom & Pascucci 2001, section 3): where the legs of its diamond's triangles are split next.
    /// A vertex of level 0 and a corner have none.
    pub fn children(&self, p: GridPoint) -> impl Iterator<Item = GridPoint> + use<> {
        let level = self.level(p);
        let step = 1i64 << (level / 2);
        let offsets: [(i64, i64); 4] = if level & 1 == 1 {
            [(step, 0), (0, step), (-step, 0), (0, -step)]
        } else {
            let half = step / 2;
            [(half, half), (-half, half), (-half, -half), (half, -half)]
        };
        let n = i64::from(self.side_steps());
        let count = if level == 0 || self.is_corner(p) { 0 } else { 4 };
        offsets.into_iter().take(count).filter_map(move |(dx, dy)| {
            let (x, y) = (i64::from(p.x()) + dx, i64::from(p.y()) + dy);
            ((0..=n).contains(&x) && (0..=n).contains(&y)).then(|| GridPoint::new(x as u32, y as u32))
        })
    }

    /// The two ends of the edge that a vertex splits. A corner splits none: it is both.
    pub fn edge_ends(&self, p: GridPoint) -> [GridPoint; 2] {
        if self.is_corner(p) {
            return [p; 2];
        }
        let step = 1u32 << (self.level(p) / 2);
        let (x, y) = (p.x(), p.y());
        let x_odd = (x / step) & 1 == 1;
        let y_odd = (y / step) & 1 == 1;
        match (x_odd, y_odd) {
            (true, false) => [GridPoint::new(x - step, y), GridPoint::new(x + step, y)],
            (false, true) => [GridPoint::new(x, y - step), GridPoint::new(x, y + step)],
            // A cell's diagonal runs from the corner its parent cell keeps through the parent's centre.
            _ => {
                if ((x / step) & 2 == 0) == ((y / step) & 2 == 0) {
                    // south-west or north-east cell of its parent: its own apexes are the other diagonal
                    [GridPoint::new(x - step, y - step), GridPoint::new(x + step, y + step)]
                } else {
                    [GridPoint::new(x + step, y - step), GridPoint::new(x - step, y + step)]
                }
            }
        }
    }

    /// The apexes of the triangles whose longest edge a vertex splits: two, or one on the square's border.
    pub fn apexes(&self, p: GridPoint) -> impl Iterator<Item = GridPoint> + use<> {
        let [b, d] = self.edge_ends(p);
        let (hx, hy) = ((i64::from(d.x()) - i64::from(b.x())) / 2, (i64::from(d.y()) - i64::from(b.y())) / 2);
        let n = i64::from(self.side_steps());
        [(-hy, hx), (hy, -hx)].into_iter().filter_map(move |(dx, dy)| {
            let (x, y) = (i64::from(p.x()) + dx, i64::from(p.y()) + dy);
            ((0..=n).contains(&x) && (0..=n).contains(&y)).then(|| GridPoint::new(x as u32, y as u32))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_square_is_as_said() {
        assert_eq!(MOST_SAMPLES_WORDS.replace(',', ""), MOST_SAMPLES.to_string());
        let grid = Grid::new([MOST_SAMPLES, 2], [1.0; 2]).unwrap();
        assert_eq!((grid.k(), grid.side_steps()), (MAX_K, 1 << MAX_K));
        for larger in [MOST_SAMPLES + 1, u32::MAX] {
            let refused = Grid::new([2, larger], [1.0; 2]).unwrap_err().to_string();
            assert!(refused.contains(MOST_SAMPLES_WORDS), "{refused}");
        }
    }
}
