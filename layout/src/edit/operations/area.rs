//! Places on the ground: rectangles of samples and discs in metres, and the samples that lie in them.
//!
//! **A sample lies in a disc if its own position does**, computed from its column and row alone. So the answer is the same through every window. `samples` is exactly
//! tight: each side of the rectangle is a row or column that the disc's extent holds. Cost: the squared distance for each sample.

use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::numbers::{checked_centre, checked_radius};

/// A part of the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Area {
    /// A rectangle of samples, which may reach beyond the data north and east.
    Rect(SampleRect),
    /// All samples not farther from a place than a radius.
    Disc {
        /// Metres east and north of the south-west sample.
        centre_m: [f64; 2],
        /// Metres.
        radius_m: f64,
    },
    /// All samples of a rectangle in metres, those on its sides included. It may reach beyond the data.
    Extent {
        /// Its west, south, east and north side in metres of the south-west sample.
        sides_m: [f64; 4],
    },
}

/// Which way ground may be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// It is raised where it is lower, and else stays.
    AtLeast,
    /// It is lowered where it is higher, and else stays.
    AtMost,
}

impl Limit {
    /// The height in metres of ground that was moved to `height_m` as far as it may be.
    #[inline(always)]
    pub(crate) fn moved(self, ground_m: f64, height_m: f64) -> f64 {
        match self {
            Self::AtLeast => ground_m.max(height_m),
            Self::AtMost => ground_m.min(height_m),
        }
    }
}

/// By how much of a step a sample may lie beside a rectangle in metres and still be on its side: numbers such as 0.3 are no multiples of 0.1.
const ON_A_SIDE: f64 = 1e-6;

impl Area {
    /// Whether the numbers are usable; `what` names the edit.
    pub(crate) fn check(&self, what: &str) -> Result<(), LayoutError> {
        match self {
            Self::Rect(rect) if rect.west > rect.east || rect.south > rect.north => {
                Err(LayoutError::Usage(format!(
                    "{what}: the rectangle from sample {},{} to {},{} is inside out; give its south-west corner first",
                    rect.west, rect.south, rect.east, rect.north
                )))
            }
            Self::Rect(_) => Ok(()),
            Self::Disc { centre_m, radius_m } => {
                checked_centre(what, *centre_m)?;
                checked_radius(what, *radius_m)
            }
            Self::Extent { sides_m: [west, south, east, north] } => {
                checked_centre(what, [*west, *south])?;
                checked_centre(what, [*east, *north])?;
                if west <= east && south <= north {
                    return Ok(());
                }
                Err(LayoutError::Usage(format!(
                    "{what}: the rectangle from {west},{south} to {east},{north} metres is inside out; give west, south, east and north"
                )))
            }
        }
    }

    /// What it covers, whether or not there are data: west, south, east and north in metres.
    pub fn reach_m(&self, grid: &Grid) -> [f64; 4] {
        let [dx, dy] = grid.spacing_m();
        match *self {
            Self::Rect(r) => [
                f64::from(r.west) * dx,
                f64::from(r.south) * dy,
                f64::from(r.east) * dx,
                f64::from(r.north) * dy,
            ],
            Self::Disc { centre_m, radius_m } => around(centre_m, radius_m),
            Self::Extent { sides_m } => sides_m,
        }
    }

    /// The smallest rectangle that holds all samples in it; `None` if it lies outside the data or between samples.
    pub fn samples(&self, grid: &Grid) -> Option<SampleRect> {
        match *self {
            Self::Rect(rect) => clipped(rect, grid),
            Self::Disc { centre_m, radius_m } => disc_samples(centre_m, radius_m, grid),
            Self::Extent { sides_m } => extent_samples(sides_m, grid),
        }
    }

    /// Whether the sample lies in it.
    #[inline(always)]
    pub(crate) fn contains(&self, grid: &Grid, x: u32, y: u32) -> bool {
        match *self {
            Self::Rect(rect) => rect.contains(x, y),
            Self::Disc { centre_m, radius_m } => {
                let [east, north] = offset_m(grid, centre_m, x, y);
                east * east + north * north <= radius_m * radius_m
            }
            Self::Extent { sides_m: [west, south, east, north] } => {
                let [dx, dy] = grid.spacing_m();
                let is_between = |at: u32, low: f64, high: f64| {
                    (low - ON_A_SIDE..=high + ON_A_SIDE).contains(&f64::from(at))
                };
                is_between(x, west / dx, east / dx) && is_between(y, south / dy, north / dy)
            }
        }
    }
}

/// The samples between sides in metres; `None` if there are none.
pub(crate) fn extent_samples([west, south, east, north]: [f64; 4], grid: &Grid) -> Option<SampleRect> {
    let ([dx, dy], [wide, high]) = (grid.spacing_m(), grid.samples());
    let [west, east] = steps_between(west / dx, east / dx, wide)?;
    let [south, north] = steps_between(south / dy, north / dy, high)?;
    Some(SampleRect { west, south, east, north })
}

/// The first and the last of `count` samples from one side to another, both in steps.
fn steps_between(low: f64, high: f64, count: u32) -> Option<[u32; 2]> {
    let first = (low - ON_A_SIDE).ceil().max(0.0);
    let last = (high + ON_A_SIDE).floor().min(f64::from(count - 1));
    // Not-a-numbers compare as nothing does: there are no samples between them.
    (first <= last).then_some([first as u32, last as u32])
}

/// West, south, east and north of a disc in metres.
pub(crate) fn around([east_m, north_m]: [f64; 2], radius_m: f64) -> [f64; 4] {
    [east_m - radius_m, north_m - radius_m, east_m + radius_m, north_m + radius_m]
}

/// Metres east and north from `centre_m` to a sample.
#[inline(always)]
pub(crate) fn offset_m(grid: &Grid, centre_m: [f64; 2], x: u32, y: u32) -> [f64; 2] {
    let spacing = grid.spacing_m();
    [f64::from(x) * spacing[0] - centre_m[0], f64::from(y) * spacing[1] - centre_m[1]]
}

/// The part of a rectangle that has data.
pub(crate) fn clipped(rect: SampleRect, grid: &Grid) -> Option<SampleRect> {
    let [wide, high] = grid.samples();
    (rect.west < wide && rect.south < high && rect.west <= rect.east && rect.south <= rect.north)
        .then(|| SampleRect { east: rect.east.min(wide - 1), north: rect.north.min(high - 1), ..rect })
}

/// The part that two rectangles share.
pub(crate) fn shared(a: SampleRect, b: SampleRect) -> Option<SampleRect> {
    let both = SampleRect {
        west: a.west.max(b.west),
        south: a.south.max(b.south),
        east: a.east.min(b.east),
        north: a.north.min(b.north),
    };
    (both.west <= both.east && both.south <= both.north).then_some(both)
}

/// The rectangle of samples in the square around a disc.
pub(crate) fn disc_samples(centre_m: [f64; 2], radius_m: f64, grid: &Grid) -> Option<SampleRect> {
    let [x, y] = [0, 1].map(|axis| {
        let spacing = grid.spacing_m()[axis];
        let last = f64::from(grid.samples()[axis] - 1);
        let low = ((centre_m[axis] - radius_m) / spacing).ceil().max(0.0);
        let high = ((centre_m[axis] + radius_m) / spacing).floor().min(last);
        // Not-a-numbers compare as nothing does: such a disc has no samples.
        (low <= high).then_some([low as u32, high as u32])
    });
    let ([west, east], [south, north]) = (x?, y?);
    Some(SampleRect { west, south, east, north })
}

/// Calls `change` for every sample that `bounds` and the window share and that is no void, with its column, row and height.
#[inline(always)]
pub(crate) fn each_sample(
    window: &mut HeightWindow,
    bounds: Option<SampleRect>,
    mut change: impl FnMut(u32, u32, &mut f64),
) {
    let Some(rect) = bounds.and_then(|bounds| shared(bounds, window.rect())) else { return };
    for y in rect.south..=rect.north {
        let first = window.index(rect.west, y);
        let row = &mut window.heights_m_mut()[first..first + rect.wide() as usize];
        for (x, height) in (rect.west..).zip(row) {
            if !height.is_nan() {
                change(x, y, height);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_discs_samples_are_those_within_its_radius(
            centre_m in prop::array::uniform2(-60.0..200.0f64),
            radius_m in prop_oneof![0.01..120.0f64, Just(10.0)],
            spacing_m in prop::array::uniform2(1.0..20.0f64),
        ) {
            let grid = Grid::new([9, 14], spacing_m).unwrap();
            let disc = Area::Disc { centre_m, radius_m };
            let bounds = disc.samples(&grid);
            for y in 0..14 {
                for x in 0..9 {
                    let [east, north] = offset_m(&grid, centre_m, x, y);
                    // Along an axis rounding may leave a sample on the very circle out.
                    if east.hypot(north) < radius_m * (1.0 - 1e-12) {
                        prop_assert!(bounds.is_some_and(|b| b.contains(x, y)));
                    }
                    if bounds.is_some_and(|b| b.contains(x, y)) {
                        prop_assert!(east.abs().max(north.abs()) <= radius_m * (1.0 + 1e-12));
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn an_extents_samples_are_those_between_its_sides(
            steps in prop::array::uniform4(-4..20i32),
            spacing_m in prop::sample::select(vec![[0.1, 0.3], [10.0, 30.0], [28.3, 30.9]]),
            aside in prop::sample::select(vec![0.0, 0.25, -0.25]),
        ) {
            let grid = Grid::new([9, 14], spacing_m).unwrap();
            let [a, b, c, d] = steps.map(f64::from);
            let [west, south, east, north] = [a.min(c), b.min(d), a.max(c), b.max(d)];
            let [dx, dy] = spacing_m;
            let extent = Area::Extent {
                sides_m: [west * dx, south * dy, (east + aside) * dx, (north + aside) * dy],
            };
            let bounds = extent.samples(&grid);
            for y in 0..14 {
                for x in 0..9 {
                    let (at_x, at_y) = (f64::from(x), f64::from(y));
                    // By steps, which are whole numbers or quarters: nothing is rounded.
                    let is_in = west <= at_x && at_x <= east + aside && south <= at_y && at_y <= north + aside;
                    prop_assert_eq!(extent.contains(&grid, x, y), is_in, "{} {}", x, y);
                    prop_assert_eq!(bounds.is_some_and(|b| b.contains(x, y)), is_in, "{} {}", x, y);
                }
            }
        }
    }

    #[test]
    fn rectangles_are_cut_to_the_data() {
        let grid = Grid::new([9, 14], [1.0, 1.0]).unwrap();
        let rect = |west, south, east, north| SampleRect { west, south, east, north };
        assert_eq!(Area::Rect(rect(3, 4, 99, 5)).samples(&grid), Some(rect(3, 4, 8, 5)));
        assert_eq!(Area::Rect(rect(9, 4, 99, 5)).samples(&grid), None);
        let inside_out = Area::Rect(rect(3, 4, 2, 5));
        assert_eq!(inside_out.samples(&grid), None);
        assert!(inside_out.check("set").unwrap_err().to_string().contains("inside out"));
    }
}
