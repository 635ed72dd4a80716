//! Brushes: round, with a strength that falls off from the centre.
//!
//! With t the distance from the centre in radii, the strength is multiplied by 1 (hard), 1 - t (linear) or (1 - t^2)^2 (smooth, level at both ends) where t <= 1.
//! Smoothing reads old heights only, so the result does not depend on the order of samples. Cost: O(samples), nine reads each for smoothing.

use super::area::{disc_samples, each_sample, offset_m};
use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::numbers::{checked_amount, checked_centre, checked_fraction, checked_height, checked_radius};

/// A stroke of a round brush.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brush {
    /// What it does.
    pub action: BrushAction,
    /// Its centre in metres east and north of the south-west sample.
    pub centre_m: [f64; 2],
    /// Its radius in metres.
    pub radius_m: f64,
    /// How its strength falls off.
    pub falloff: Falloff,
}

/// What a brush does to the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BrushAction {
    /// Raises it by as many metres at the centre.
    Raise(f64),
    /// Lowers it by as many metres at the centre.
    Lower(f64),
    /// Moves it towards one height.
    Flatten {
        /// Metres; `None`: the height of the sample nearest to the centre that has one.
        height_m: Option<f64>,
        /// The part of the way that it moves, 0..=1.
        strength: f64,
    },
    /// Moves each height towards the mean of its eight neighbours (those that are no voids, and lie in the data).
    Smooth {
        /// The part of the way that it moves, 0..=1.
        strength: f64,
    },
}

/// How the strength of a brush falls off from its centre.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Falloff {
    /// The same everywhere.
    Hard,
    /// To nothing at the radius, evenly.
    Linear,
    /// To nothing at the radius, level at both ends.
    #[default]
    Smooth,
}

impl Falloff {
    /// What the strength is multiplied by at a distance whose square, in radii, is `t2`.
    #[inline(always)]
    fn weight(self, t2: f64) -> f64 {
        match self {
            _ if t2 > 1.0 => 0.0,
            Self::Hard => 1.0,
            Self::Linear => 1.0 - t2.sqrt(),
            Self::Smooth => (1.0 - t2) * (1.0 - t2),
        }
    }
}

impl BrushAction {
    /// Its name in scripts and messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Raise(_) => "raise",
            Self::Lower(_) => "lower",
            Self::Flatten { .. } => "flatten",
            Self::Smooth { .. } => "smooth",
        }
    }
}

impl Brush {
    pub(crate) fn check(&self) -> Result<(), LayoutError> {
        let what = self.action.name();
        checked_centre(what, self.centre_m)?;
        checked_radius(what, self.radius_m)?;
        match self.action {
            BrushAction::Raise(metres) | BrushAction::Lower(metres) => {
                checked_amount(what, "strength", metres)
            }
            BrushAction::Flatten { height_m, strength } => {
                height_m.map_or(Ok(()), |height_m| checked_height(what, height_m))?;
                checked_fraction(what, "strength", strength)
            }
            BrushAction::Smooth { strength } => checked_fraction(what, "strength", strength),
        }
    }

    pub(crate) fn bounds(&self, grid: &Grid) -> Option<SampleRect> {
        disc_samples(self.centre_m, self.radius_m, grid)
    }

    pub(crate) fn margin(&self) -> u32 {
        u32::from(matches!(self.action, BrushAction::Smooth { .. }))
    }

    pub(crate) fn apply(&self, grid: &Grid, window: &mut HeightWindow) {
        match self.action {
            BrushAction::Raise(metres) => self.blend(grid, window, |_, _, height, w| height + metres * w),
            BrushAction::Lower(metres) => self.blend(grid, window, |_, _, height, w| height - metres * w),
            BrushAction::Flatten { height_m, strength } => {
                let Some(target) = height_m.or_else(|| self.height_at_centre(grid, window)) else { return };
                self.blend(grid, window, |_, _, height, w| height + (target - height) * (strength * w));
            }
            BrushAction::Smooth { strength } => {
                let old = window.clone();
                self.blend(grid, window, |x, y, height, w| {
                    height + (mean_of_neighbours(&old, x, y) - height) * (strength * w)
                });
            }
        }
    }

    /// Puts `change(x, y, height, weight)` in place of every height under the brush.
    #[inline(always)]
    fn blend(&self, grid: &Grid, window: &mut HeightWindow, change: impl Fn(u32, u32, f64, f64) -> f64) {
        each_sample(window, self.bounds(grid), |x, y, height| {
            let [east, north] = offset_m(grid, self.centre_m, x, y);
            let t2 = (east * east + north * north) / (self.radius_m * self.radius_m);
            if t2 <= 1.0 {
                *height = change(x, y, *height, self.falloff.weight(t2));
            }
        });
    }

    /// Height of the sample under the brush that is nearest to its centre and no void; of several the southernmost, then the westernmost.
    fn height_at_centre(&self, grid: &Grid, window: &mut HeightWindow) -> Option<f64> {
        let mut nearest = None;
        each_sample(window, self.bounds(grid), |x, y, height| {
            let [east, north] = offset_m(grid, self.centre_m, x, y);
            let d2 = east * east + north * north;
            if nearest.is_none_or(|(before, _)| d2 < before) {
                nearest = Some((d2, *height));
            }
        });
        nearest.map(|(_, height)| height)
    }
}

/// Mean of the neighbours of a sample that has a height; its own height where all of them are voids.
fn mean_of_neighbours(window: &HeightWindow, x: u32, y: u32) -> f64 {
    let rect = window.rect();
    let (mut sum, mut count) = (0.0, 0.0);
    for v in y.saturating_sub(1).max(rect.south)..=(y + 1).min(rect.north) {
        for u in x.saturating_sub(1).max(rect.west)..=(x + 1).min(rect.east) {
            let height = window.height_m(u, v);
            if (u, v) != (x, y) && !height.is_nan() {
                sum += height;
                count += 1.0;
            }
        }
    }
    if count == 0.0 { window.height_m(x, y) } else { sum / count }
}
