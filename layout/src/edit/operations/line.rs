//! Lines: dams, dikes, ditches and road beds along a path of straight pieces, level or following the ground, with sloped sides.
//!
//! With d the distance from the path and w the width, sides begin at d = w / 2 and have a fall of `slope` (d - w / 2). **A sample's new height depends on its own distance and its own old height
//! alone**, and all of it is plain arithmetic. Cost: a distance to each piece of the path for each sample of the rectangle around it.

use super::area::{Limit, each_sample, extent_samples};
use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::numbers::{checked, checked_amount, checked_centre, checked_height};

/// Most places that a path has.
pub const MAX_LINE_PLACES: usize = 128;

/// Ground shaped along a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Where it leads: 2 to [`MAX_LINE_PLACES`] places in metres east and north of the south-west sample.
    pub path_m: Vec<[f64; 2]>,
    /// How high its crest is.
    pub crest: Crest,
    /// Width of the crest in metres, 0 to 1e7.
    pub width_m: f64,
    /// Fall of its sides in metres a metre, 0.001 to 1000.
    pub slope: f64,
}

/// How high a line's crest is, and what that does to the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Crest {
    /// At one height everywhere.
    Level {
        /// Metres.
        height_m: f64,
        /// Whether ground is only raised (a dam), only lowered (a cutting), or both (a road).
        limit: Option<Limit>,
        /// The sides reach so many metres below the crest, and above it where ground is lowered; ground beyond stays.
        sides_m: f64,
    },
    /// So many metres above the ground that is there, as a dike is.
    Above(f64),
    /// So many metres below it, as a ditch is.
    Below(f64),
}

impl Line {
    pub(crate) fn check(&self) -> Result<(), LayoutError> {
        let count = self.path_m.len();
        if !(2..=MAX_LINE_PLACES).contains(&count) {
            return Err(LayoutError::Usage(format!(
                "line: the path has {count} places; give 2 to {MAX_LINE_PLACES}, or several lines"
            )));
        }
        self.path_m.iter().try_for_each(|place| checked_centre("line", *place))?;
        checked_amount("line", "width", self.width_m)?;
        let is_slope = (1e-3..=1e3).contains(&self.slope);
        checked("line", "slope", self.slope, is_slope, "metres of fall a metre, from 0.001 to 1000")?;
        match self.crest {
            Crest::Level { height_m, sides_m, .. } => {
                checked_height("line", height_m)?;
                checked_amount("line", "depth of the sides", sides_m)
            }
            Crest::Above(metres) | Crest::Below(metres) => checked_amount("line", "height", metres),
        }
    }

    /// How far from the path it may change the ground, metres.
    fn reach_from_path_m(&self) -> f64 {
        let fall_m = match self.crest {
            Crest::Level { sides_m, .. } => sides_m,
            Crest::Above(metres) | Crest::Below(metres) => metres,
        };
        self.width_m / 2.0 + fall_m / self.slope
    }

    /// What it may cover: west, south, east and north in metres.
    pub(crate) fn reach_m(&self) -> [f64; 4] {
        let far = self.reach_from_path_m();
        let first = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        self.path_m.iter().fold(first, |[west, south, east, north], [x, y]| {
            [west.min(x - far), south.min(y - far), east.max(x + far), north.max(y + far)]
        })
    }

    pub(crate) fn bounds(&self, grid: &Grid) -> Option<SampleRect> {
        extent_samples(self.reach_m(), grid)
    }

    /// Distance from the path to a place, squared.
    fn distance2(&self, [x, y]: [f64; 2]) -> f64 {
        let to_piece = |pair: &[[f64; 2]]| {
            let ([ax, ay], [bx, by]) = (pair[0], pair[1]);
            let (along, across) = ([bx - ax, by - ay], [x - ax, y - ay]);
            let length2 = along[0] * along[0] + along[1] * along[1];
            let dot = along[0] * across[0] + along[1] * across[1];
            // Two places in one are a piece without length.
            let part = if length2 > 0.0 { (dot / length2).clamp(0.0, 1.0) } else { 0.0 };
            let [east, north] = [across[0] - part * along[0], across[1] - part * along[1]];
            east * east + north * north
        };
        self.path_m.windows(2).map(to_piece).fold(f64::INFINITY, f64::min)
    }

    pub(crate) fn apply(&self, grid: &Grid, window: &mut HeightWindow) {
        let [dx, dy] = grid.spacing_m();
        let far = self.reach_from_path_m();
        each_sample(window, self.bounds(grid), |x, y, ground| {
            let distance2 = self.distance2([f64::from(x) * dx, f64::from(y) * dy]);
            if distance2 > far * far {
                return;
            }
            let fall = self.slope * (distance2.sqrt() - self.width_m / 2.0).max(0.0);
            match self.crest {
                Crest::Level { height_m, limit, .. } => {
                    let (lowest, highest) = (height_m - fall, height_m + fall);
                    if limit != Some(Limit::AtMost) {
                        *ground = ground.max(lowest);
                    }
                    if limit != Some(Limit::AtLeast) {
                        *ground = ground.min(highest);
                    }
                }
                Crest::Above(metres) => *ground += (metres - fall).max(0.0),
                Crest::Below(metres) => *ground -= (metres - fall).max(0.0),
            }
        });
    }
}
