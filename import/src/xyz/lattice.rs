//! The grid that coordinates lie on, found from the coordinates that occur.
//!
//! Along each axis the distinct coordinates must be whole steps apart, the step being the same all along. Coordinates are printed with few digits, so a step is the mean
//! over all steps and a coordinate may be a fifth of a step off its place. Steps without a coordinate are gaps. Cost: the distinct coordinates of an axis, sorted.

use std::collections::HashSet;

/// Most samples along a side, those of the largest terrain: beyond that it is no grid.
pub(super) const MOST_SAMPLES: usize = terrasoar_layout::grid::MOST_SAMPLES as usize;
/// Coordinates closer than this share of the usual distance are one, printed differently.
const SAME: f64 = 1e-3;
/// How far a coordinate may be from its place, in steps.
const OFF: f64 = 0.2;

/// Distinct coordinates, by their bits.
pub(super) type Distinct = HashSet<u64>;

/// The samples along one axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub(super) first: f64,
    pub(super) step: f64,
    pub(super) count: u32,
    /// Samples that some coordinate is of.
    pub(super) occupied: u32,
}

/// Why coordinates are no axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum NoAxis {
    /// All are one.
    Line,
    /// They are not whole steps apart.
    Scattered,
}

impl Axis {
    /// The axis on which all of `coordinates` lie.
    pub(super) fn of(coordinates: &Distinct) -> Result<Self, NoAxis> {
        let mut sorted: Vec<f64> = coordinates.iter().map(|bits| f64::from_bits(*bits)).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let mut distances: Vec<f64> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
        distances.sort_unstable_by(f64::total_cmp);
        let usual = *distances.get(distances.len() / 2).ok_or(NoAxis::Line)?;
        sorted.dedup_by(|b, a| *b - *a < SAME * usual);
        let smallest = sorted.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
        let (first, last) = (sorted.first().copied().unwrap_or(0.0), sorted.last().copied().unwrap_or(0.0));
        if !smallest.is_finite() || smallest <= 0.0 || !(last - first).is_finite() {
            return Err(NoAxis::Line);
        }
        // A distance is a few steps, so its own rounding error does not matter; that of the sum of all would.
        let steps: f64 = sorted.windows(2).map(|pair| ((pair[1] - pair[0]) / smallest).round()).sum();
        if steps >= MOST_SAMPLES as f64 {
            return Err(NoAxis::Scattered);
        }
        let step = (last - first) / steps;
        // Both are at most MOST_SAMPLES.
        let axis = Self { first, step, count: steps as u32 + 1, occupied: sorted.len() as u32 };
        match sorted.iter().all(|coordinate| axis.place(*coordinate).is_some()) {
            true => Ok(axis),
            false => Err(NoAxis::Scattered),
        }
    }

    /// Which sample a coordinate is of.
    pub(super) fn place(&self, coordinate: f64) -> Option<u32> {
        let steps = (coordinate - self.first) / self.step;
        let nearest = steps.round();
        let is_near = (steps - nearest).abs() <= OFF && (0.0..f64::from(self.count)).contains(&nearest);
        // Below the number of samples.
        is_near.then_some(nearest as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(coordinates: impl IntoIterator<Item = f64>) -> Result<Axis, NoAxis> {
        Axis::of(&coordinates.into_iter().map(f64::to_bits).collect())
    }

    #[test]
    fn axes_with_gaps_and_few_digits() {
        let plain = axis((0..9).map(|i| 100.0 + 10.0 * f64::from(i))).unwrap();
        assert_eq!(plain, Axis { first: 100.0, step: 10.0, count: 9, occupied: 9 });
        let gaps = axis([0.0, 1.0, 2.0, 5.0, 6.0, 99.0]).unwrap();
        assert_eq!((gaps.step, gaps.count, gaps.occupied, gaps.place(5.0)), (1.0, 100, 6, Some(5)));
        // Three arc-seconds and one, with six decimals.
        for (count, per_degree) in [(1201u32, 1200.0), (3601, 3600.0)] {
            let printed = (0..count).map(|i| {
                let exact = 7.0 + f64::from(i) / per_degree;
                format!("{exact:.6}").parse::<f64>().unwrap()
            });
            let axis = axis(printed).unwrap();
            assert_eq!(axis.count, count);
            assert!((axis.step * per_degree - 1.0).abs() < 1e-9, "{axis:?}");
        }
        // The same coordinate, printed in two ways.
        let noisy = axis([0.0, 1.0, 1.0 + 1e-9, 2.0, 3.0, 4.0 - 1e-9, 4.0]).unwrap();
        assert_eq!((noisy.count, noisy.occupied, noisy.place(4.0)), (5, 5, Some(4)));
        assert_eq!(noisy.place(5.0), None);
        assert_eq!(noisy.place(2.4), None);
    }

    #[test]
    fn what_is_no_axis() {
        assert_eq!(axis([5.0]), Err(NoAxis::Line));
        assert_eq!(axis([0.0, 1.0, 2.5, 3.5, 4.7]), Err(NoAxis::Scattered));
        assert_eq!(axis([0.0, 1.0, 2.0, 1e9]), Err(NoAxis::Scattered));
        assert_eq!(axis([-1e308, 0.0, 1e308]), Err(NoAxis::Line));
        let mut state = 1u64;
        let random = (0..1000).map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64
        });
        assert_eq!(axis(random), Err(NoAxis::Scattered));
    }
}
