//! What an edit does to heights: a region and a function from old heights to new ones.
//!
//! **A sample's new height depends on the edit, the sample's place and old heights within the margin.** It never depends on the window through which it is looked at, and
//! nothing outside the bounds changes. Voids stay voids. Cost: O(samples of the bounds), nothing allocated but by smoothing, which copies the window.

use super::area::{Area, Limit, around, each_sample};
use super::brush::Brush;
use super::check::checked_size;
use super::crater::Crater;
use super::line::Line;
use super::stamp::Stamp;
use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::numbers::checked_height;

/// One change of the ground. Positions are metres east and north of the south-west sample.
#[derive(Debug, Clone, PartialEq)]
pub enum Edit {
    /// The crater of a shell.
    Crater(Crater),
    /// A stroke of a round brush.
    Brush(Brush),
    /// Heights from elsewhere.
    Stamp(Stamp),
    /// All samples of an area to one height.
    Set {
        /// Where.
        area: Area,
        /// Their new height in metres.
        height_m: f64,
    },
    /// The samples of an area that are lower than one height, or those that are higher, to that height.
    Limit {
        /// Where.
        area: Area,
        /// Their new height in metres.
        height_m: f64,
        /// Which of them.
        limit: Limit,
    },
    /// A dam, dike, ditch or road along a path.
    Line(Line),
    /// All samples of an area back to their heights before all edits.
    Restore(
        /// Where.
        Area,
    ),
}

impl Edit {
    /// All samples of a rectangle to one height in metres.
    pub fn set(rect: SampleRect, height_m: f64) -> Self {
        Self::Set { area: Area::Rect(rect), height_m }
    }

    /// Its name in scripts and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Crater(_) => "crater",
            Self::Brush(brush) => brush.action.name(),
            Self::Stamp(_) => "stamp",
            Self::Set { .. } | Self::Limit { .. } => "set",
            Self::Line(_) => "line",
            Self::Restore(_) => "restore",
        }
    }

    /// Checks that all numbers are usable.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] that says which is not.
    pub fn check(&self, grid: &Grid) -> Result<(), LayoutError> {
        self.check_numbers()?;
        checked_size(self.name(), self.bounds(grid))
    }

    /// Checks all that can be checked without a terrain.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] that says which number is not usable.
    pub fn check_numbers(&self) -> Result<(), LayoutError> {
        match self {
            Self::Crater(crater) => crater.check(),
            Self::Brush(brush) => brush.check(),
            Self::Stamp(stamp) => stamp.check(),
            Self::Line(line) => line.check(),
            Self::Set { area, height_m } | Self::Limit { area, height_m, .. } => {
                area.check("set")?;
                checked_height("set", *height_m)
            }
            Self::Restore(area) => area.check("restore"),
        }
    }

    /// The samples that it may change; `None` if it lies wholly outside the data.
    pub fn bounds(&self, grid: &Grid) -> Option<SampleRect> {
        match self {
            Self::Crater(crater) => crater.bounds(grid),
            Self::Brush(brush) => brush.bounds(grid),
            Self::Stamp(stamp) => stamp.bounds(grid),
            Self::Line(line) => line.bounds(grid),
            Self::Set { area, .. } | Self::Limit { area, .. } | Self::Restore(area) => area.samples(grid),
        }
    }

    /// What it covers, whether or not there are data: west, south, east and north in metres of the south-west sample.
    pub fn reach_m(&self, grid: &Grid) -> [f64; 4] {
        match self {
            Self::Crater(crater) => around(crater.centre_m, 2.0 * crater.radius_m),
            Self::Brush(brush) => around(brush.centre_m, brush.radius_m),
            Self::Stamp(stamp) => stamp.reach_m(grid),
            Self::Line(line) => line.reach_m(),
            Self::Set { area, .. } | Self::Limit { area, .. } | Self::Restore(area) => area.reach_m(grid),
        }
    }

    /// Samples around its bounds whose heights it looks at.
    pub fn margin(&self) -> u32 {
        match self {
            Self::Brush(brush) => brush.margin(),
            _ => 0,
        }
    }

    /// Whether it looks at the heights before all edits.
    pub fn needs_original(&self) -> bool {
        matches!(self, Self::Restore(_))
    }

    /// Changes the heights of `window`, which covers its bounds and the margin around them as far as the data goes. `original` are the heights before all
    /// edits of a rectangle that holds its bounds, if it needs them. Voids (NaN) stay as they are.
    pub fn apply(&self, grid: &Grid, window: &mut HeightWindow, original: Option<&HeightWindow>) {
        match self {
            Self::Crater(crater) => crater.apply(grid, window),
            Self::Brush(brush) => brush.apply(grid, window),
            Self::Stamp(stamp) => stamp.apply(grid, window),
            Self::Set { area, height_m } => each_sample(window, area.samples(grid), |x, y, height| {
                if area.contains(grid, x, y) {
                    *height = *height_m;
                }
            }),
            Self::Limit { area, height_m, limit } => {
                each_sample(window, area.samples(grid), |x, y, height| {
                    if area.contains(grid, x, y) {
                        *height = limit.moved(*height, *height_m);
                    }
                });
            }
            Self::Line(line) => line.apply(grid, window),
            Self::Restore(area) => {
                let Some(original) = original else { return };
                each_sample(window, area.samples(grid), |x, y, height| {
                    let is_known = area.contains(grid, x, y) && original.rect().contains(x, y);
                    let before = if is_known { original.height_m(x, y) } else { f64::NAN };
                    if !before.is_nan() {
                        *height = before;
                    }
                });
            }
        }
    }
}
