//! What the left button does to the ground: a tool, its size, its strength, and the edits that a stroke of it makes.
//!
//! It knows no window. A stroke is a row of edits at distances of a part of the radius, so that it is the same however fast the hand moved.

use glam::DVec2;
use terrasoar_layout::edit::{Area, Brush, BrushAction, Crater, Edit, Falloff};

/// Distance between the edits of a stroke, in radii.
const APART: f64 = 0.35;
/// Smallest and largest radius in metres.
pub(crate) const RADII_M: [f64; 2] = [1.0, 20_000.0];
/// Samples in the radius of a tool to begin with, at most.
const FIRST_SAMPLES: f64 = 200.0;
/// How much one step makes a tool smaller or larger.
pub(crate) const STEP: f64 = 1.25;

/// What the left button does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Tool {
    /// It looks around.
    #[default]
    Look,
    Crater,
    Raise,
    Lower,
    Flatten,
    Smooth,
    Restore,
}

impl Tool {
    /// All tools, in the order in which a key steps through them.
    pub(crate) const ALL: [Self; 7] =
        [Self::Look, Self::Crater, Self::Raise, Self::Lower, Self::Flatten, Self::Smooth, Self::Restore];

    /// Its name.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Look => "look around",
            Self::Crater => "crater",
            Self::Raise => "raise",
            Self::Lower => "lower",
            Self::Flatten => "flatten",
            Self::Smooth => "smooth",
            Self::Restore => "restore",
        }
    }

    /// The one after it.
    pub(crate) fn next(self) -> Self {
        let at = Self::ALL.iter().position(|tool| *tool == self).unwrap_or(0);
        Self::ALL[(at + 1) % Self::ALL.len()]
    }
}

/// A tool as it is set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ToolBox {
    pub tool: Tool,
    /// Metres.
    pub radius_m: f64,
    /// Metres of height at the centre for each edit as a part of the radius; how much of the way for flattening and smoothing.
    pub strength: f64,
}

impl ToolBox {
    /// A box for a terrain so many metres wide, with so many between samples, east and north. To begin with a tool reaches over a hundredth of it, or what is done in a moment.
    pub(crate) fn new(extent_m: [f64; 2], spacing_m: [f64; 2]) -> Self {
        let [share_m, most_m] =
            [0.01 * extent_m[0].max(extent_m[1]), FIRST_SAMPLES * spacing_m[0].max(spacing_m[1])];
        let radius_m = share_m.min(most_m);
        Self { tool: Tool::Look, radius_m: radius_m.clamp(RADII_M[0], RADII_M[1]), strength: 0.3 }
    }

    /// Makes it larger or smaller.
    pub(crate) fn grow(&mut self, factor: f64) {
        self.radius_m = (self.radius_m * factor).clamp(RADII_M[0], RADII_M[1]);
    }

    /// What it does at a place; none while the button looks around. Shells fly in `direction_deg`.
    pub(crate) fn edit(&self, centre_m: [f64; 2], direction_deg: f64, level_m: Option<f64>) -> Option<Edit> {
        let Self { tool, radius_m, strength } = *self;
        let brush =
            |action| Some(Edit::Brush(Brush { action, centre_m, radius_m, falloff: Falloff::Smooth }));
        // A stroke adds up some three edits wherever it passes.
        let by_m = 0.3 * strength * radius_m;
        match tool {
            Tool::Look => None,
            Tool::Crater => Some(Edit::Crater(Crater {
                centre_m,
                direction_deg,
                // The rim reaches to twice the radius; the ring shows all that changes.
                radius_m: 0.5 * radius_m,
                depth_m: 0.5 * strength * radius_m,
            })),
            Tool::Raise => brush(BrushAction::Raise(by_m)),
            Tool::Lower => brush(BrushAction::Lower(by_m)),
            Tool::Flatten => brush(BrushAction::Flatten { height_m: level_m, strength }),
            Tool::Smooth => brush(BrushAction::Smooth { strength }),
            Tool::Restore => Some(Edit::Restore(Area::Disc { centre_m, radius_m })),
        }
    }
}

/// A stroke under way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stroke {
    /// Where its last edit was.
    last_m: DVec2,
    /// Height of the ground where it began.
    pub level_m: f64,
}

impl Stroke {
    /// A stroke that begins at a place.
    pub(crate) fn begin(at_m: DVec2, level_m: f64) -> Self {
        Self { last_m: at_m, level_m }
    }

    /// Places of edits between the last one and where the hand is now, at most so many.
    pub(crate) fn go_on(&mut self, to_m: DVec2, radius_m: f64, most: usize) -> Vec<DVec2> {
        let step_m = APART * radius_m;
        let mut places = Vec::new();
        while places.len() < most && self.last_m.distance(to_m) >= step_m {
            self.last_m += (to_m - self.last_m).normalize_or_zero() * step_m;
            places.push(self.last_m);
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::grid::Grid;

    #[test]
    fn every_tool_makes_an_edit_that_holds_and_stays_in_its_ring() {
        let grid = Grid::new([1000, 1000], [10.0, 10.0]).unwrap();
        for tool in Tool::ALL {
            let tools = ToolBox { tool, ..ToolBox::new([9990.0; 2], [10.0; 2]) };
            let Some(edit) = tools.edit([5000.0, 4000.0], 30.0, Some(7.0)) else {
                assert_eq!(tool, Tool::Look);
                continue;
            };
            edit.check(&grid).unwrap();
            let bounds = edit.bounds(&grid).unwrap();
            let within =
                |sample: u32, centre: f64| (f64::from(sample) * 10.0 - centre).abs() <= tools.radius_m + 1e-6;
            assert!(within(bounds.west, 5000.0) && within(bounds.east, 5000.0), "{tool:?}");
            assert!(within(bounds.south, 4000.0) && within(bounds.north, 4000.0), "{tool:?}");
        }
        let seen: Vec<Tool> = std::iter::successors(Some(Tool::Look), |t| Some(t.next())).take(8).collect();
        assert_eq!((seen[..7].to_vec(), seen[7]), (Tool::ALL.to_vec(), Tool::Look));
    }

    #[test]
    fn a_tool_begins_with_a_size_that_suits_the_terrain_and_its_samples() {
        let radius_m = |extent_m: f64, spacing_m: f64| ToolBox::new([extent_m; 2], [spacing_m; 2]).radius_m;
        assert_eq!([radius_m(10_000.0, 10.0), radius_m(50.0, 10.0)], [100.0, RADII_M[0]]);
        // Mostly void, a million samples wide.
        assert_eq!([radius_m(10_485_760.0, 10.0), radius_m(1e8, 500.0)], [2000.0, RADII_M[1]]);
    }

    #[test]
    fn a_stroke_is_the_same_however_the_hand_moved() {
        let to = DVec2::new(1000.0, 0.0);
        let mut at_once = Stroke::begin(DVec2::ZERO, 0.0);
        let all = at_once.go_on(to, 100.0, 99);
        let mut slowly = Stroke::begin(DVec2::ZERO, 0.0);
        let mut bit_by_bit = Vec::new();
        for i in 0..=100 {
            bit_by_bit.extend(slowly.go_on(to * (f64::from(i) / 100.0), 100.0, 3));
        }
        assert_eq!(all.len(), 28);
        assert_eq!(all, bit_by_bit);
    }
}
