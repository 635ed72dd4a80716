//! A rectangle of a terrain's samples, all of them or every n-th.
//!
//! **Every n-th sample is counted from the terrain's south-west one,** whatever the window: windows beside each other fit together, and where n is a power of two the samples are
//! those of coarser levels, so that their pages alone are read. Invariant: [`SampleWindow::of`] and [`SampleWindow::within`] give windows that lie in the grid.

use crate::error::LayoutError;
use crate::grid::{Grid, GridPoint};

/// Sides so little off a sample, in samples, that the sample is meant: roundings of projections.
const SNAP: f64 = 1e-6;

/// A rectangle of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleWindow {
    /// Column and row of its south-west sample, counted from the terrain's.
    pub from: [u32; 2],
    /// Samples east and north, at least 1 each.
    pub size: [u32; 2],
    /// Samples of the terrain from one to the next: 1 for all of them.
    pub step: u32,
}

impl SampleWindow {
    /// All samples of a terrain.
    pub fn of(grid: &Grid) -> Self {
        Self { from: [0; 2], size: grid.samples(), step: 1 }
    }

    /// Every `step`-th sample within `sides` (west, south, east, north, in samples from the south-west one), those on the sides included. `None` if there is none.
    pub fn within(grid: &Grid, sides: [f64; 4], step: u32) -> Option<Self> {
        if step == 0 || !sides.iter().all(|side| side.is_finite()) {
            return None;
        }
        let mut window = Self { from: [0; 2], size: [0; 2], step };
        for axis in 0..2 {
            let last = f64::from(grid.samples()[axis] - 1);
            let low = ((sides[axis] - SNAP).max(0.0) / f64::from(step)).ceil();
            let high = ((sides[axis + 2] + SNAP).min(last) / f64::from(step)).floor();
            if low > high {
                return None;
            }
            // Both are whole, and at most 65,536.
            window.from[axis] = low as u32 * step;
            window.size[axis] = (high - low) as u32 + 1;
        }
        Some(window)
    }

    /// The grid point of the sample at a column and row of the window, counted from its south-west one.
    pub fn point(&self, column: u32, row: u32) -> GridPoint {
        GridPoint::new(self.from[0] + column * self.step, self.from[1] + row * self.step)
    }

    /// Column and row of its north-east sample, counted from the terrain's south-west one.
    pub fn last(&self) -> [u32; 2] {
        [0, 1].map(|axis| self.from[axis] + (self.size[axis] - 1) * self.step)
    }

    /// A part of it: `size` samples from a column and row of its own on.
    pub fn part(&self, from: [u32; 2], size: [u32; 2]) -> Self {
        Self { from: [0, 1].map(|axis| self.from[axis] + from[axis] * self.step), size, step: self.step }
    }

    /// Samples in it.
    pub fn samples(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Whether it lies in the grid.
    pub(crate) fn check(&self, grid: &Grid) -> Result<(), LayoutError> {
        let is_inside = |axis: usize| {
            let reach = u64::from(self.size[axis]).saturating_sub(1) * u64::from(self.step);
            self.size[axis] > 0 && u64::from(self.from[axis]) + reach < u64::from(grid.samples()[axis])
        };
        if self.step > 0 && is_inside(0) && is_inside(1) {
            return Ok(());
        }
        Err(LayoutError::Usage(format!(
            "a window of {} x {} samples, each {}th, from column {}, row {} does not lie in the terrain of {} x {}",
            self.size[0],
            self.size[1],
            self.step,
            self.from[0],
            self.from[1],
            grid.samples()[0],
            grid.samples()[1]
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::new([100, 70], [10.0, 20.0]).unwrap()
    }

    /// What is within is what a look at every sample finds.
    #[test]
    fn a_window_has_the_samples_within_its_sides() {
        for step in [1u32, 2, 4, 8, 64] {
            for sides in [
                [0.0, 0.0, 99.0, 69.0],
                [-5.0, -5.0, 500.0, 500.0],
                [3.5, 7.0, 20.0, 9.0],
                [63.999_999_9, 0.0, 64.000_000_1, 64.0],
                [98.2, 68.2, 98.9, 68.9],
                [200.0, 0.0, 300.0, 9.0],
                [5.0, -9.0, 7.0, -1.0],
            ] {
                let is_in = |at: u32, axis: usize| {
                    at.is_multiple_of(step)
                        && (sides[axis] - 1e-6..=sides[axis + 2] + 1e-6).contains(&f64::from(at))
                };
                let columns: Vec<u32> = (0..100).filter(|x| is_in(*x, 0)).collect();
                let rows: Vec<u32> = (0..70).filter(|y| is_in(*y, 1)).collect();
                let wanted = (!columns.is_empty() && !rows.is_empty()).then(|| SampleWindow {
                    from: [columns[0], rows[0]],
                    size: [columns.len() as u32, rows.len() as u32],
                    step,
                });
                let found = SampleWindow::within(&grid(), sides, step);
                assert_eq!(found, wanted, "{sides:?} {step}");
                if let Some(window) = found {
                    assert_eq!(window.last(), [*columns.last().unwrap(), *rows.last().unwrap()]);
                    window.check(&grid()).unwrap();
                }
            }
        }
        assert_eq!(SampleWindow::within(&grid(), [f64::NAN, 0.0, 9.0, 9.0], 1), None);
        assert_eq!(SampleWindow::within(&grid(), [0.0, 0.0, 9.0, 9.0], 0), None);
    }

    #[test]
    fn what_does_not_lie_in_the_grid_is_refused() {
        let whole = SampleWindow::of(&grid());
        whole.check(&grid()).unwrap();
        for window in [
            SampleWindow { size: [101, 70], ..whole },
            SampleWindow { from: [1, 0], ..whole },
            SampleWindow { step: 2, ..whole },
            SampleWindow { size: [0, 70], ..whole },
            SampleWindow { step: 0, ..whole },
            SampleWindow { size: [u32::MAX; 2], step: u32::MAX, ..whole },
        ] {
            assert!(window.check(&grid()).is_err(), "{window:?}");
        }
        let part = SampleWindow { size: [50, 35], step: 2, ..whole }.part([3, 4], [5, 6]);
        assert_eq!((part.from, part.size, part.step), ([6, 8], [5, 6], 2));
        assert_eq!(part.point(1, 2), GridPoint::new(8, 12));
    }
}
