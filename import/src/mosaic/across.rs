//! From a grid of files to another system: where its ground lies there, and how long its steps are.
//!
//! What the other system does not cover has no place. Cost: some points a grid.

use super::lattice::Tied;
use super::plan::Placed;
use super::sheet::Sheet;
use crate::crs::Ground;
use crate::warp::{apply, mesh};
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::remedy::Remedy;

/// The way from a grid to another system: none where it is the same.
pub(super) struct Over<'a> {
    map: [f64; 6],
    pub(super) grounds: Option<(&'a Ground, &'a Ground)>,
    turn: Option<f64>,
}

impl<'a> Over<'a> {
    pub(super) fn new(map: &[f64; 6], from: &'a Tied, to: &'a Tied, is_same: bool) -> Self {
        let grounds = from.ground.as_ref().zip(to.ground.as_ref()).filter(|_| !is_same);
        Self { map: *map, grounds, turn: to.ground.as_ref().and_then(Ground::turn) }
    }

    /// Coordinates in the target's system, near those of `near` where longitudes go round.
    pub(super) fn at(&self, at: [f64; 2], near: Option<f64>) -> Option<[f64; 2]> {
        let point = apply(&self.map, at);
        let Some((from, to)) = self.grounds else { return Some(point) };
        let mut point = from.across_to(to, point)?;
        if let (Some(turn), Some(near)) = (self.turn, near) {
            point[0] += turn * ((near - point[0]) / turn).round();
        }
        Some(point)
    }

    /// Places in the target's system of a mesh over a sheet, and over each of its files where the system does not cover all of the sheet.
    pub(super) fn mesh(&self, sheet: &Sheet, placed: &Placed, near: &mut Option<f64>) -> Vec<[f64; 2]> {
        let mut found = Vec::new();
        let mut look = |at: [f64; 2]| {
            let point = self.at(at, *near);
            if let Some(point) = point {
                near.get_or_insert(point[0]);
                found.push(point);
            }
            point.is_some()
        };
        let missed = mesh(sheet.samples).filter(|at| !look(*at)).count();
        if missed > 0 {
            for member in &sheet.members {
                let first = member.at.map(f64::from);
                for [col, row] in mesh(placed.sources[member.source].samples) {
                    look([first[0] + col, first[1] + row]);
                }
            }
        }
        found
    }

    /// Lengths of a sheet's steps at its centre, or at that of its first file that the system covers.
    pub(super) fn steps(&self, sheet: &Sheet, placed: &Placed) -> Option<[f64; 2]> {
        let middle = |samples: [u32; 2]| samples.map(|count| f64::from(count - 1) / 2.0);
        let in_files = sheet.members.iter().map(|member| {
            let [col, row] = middle(placed.sources[member.source].samples);
            [f64::from(member.at[0]) + col, f64::from(member.at[1]) + row]
        });
        std::iter::once(middle(sheet.samples)).chain(in_files).find_map(|at| self.steps_at(at))
    }

    /// Lengths of its steps, by x and y of the target's system.
    fn steps_at(&self, [x, y]: [f64; 2]) -> Option<[f64; 2]> {
        let centre = self.at([x, y], None)?;
        let step = |a: [f64; 2], b: [f64; 2]| {
            let [from, to] = [self.at(a, Some(centre[0]))?, self.at(b, Some(centre[0]))?];
            Some([to[0] - from[0], to[1] - from[1]])
        };
        let across = step([x - 0.5, y], [x + 0.5, y])?;
        let down = step([x, y - 0.5], [x, y + 0.5])?;
        let steps = [0, 1].map(|i| hypot(across[i], down[i]));
        steps.iter().all(|step| step.is_finite() && *step > 0.0).then_some(steps)
    }
}

/// That no file lies where its system and that of the mosaic cover the ground.
pub(super) fn outside(name: &Path) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: a file lies outside of what its reference system or that of the mosaic covers; name another one to bring them into",
        name.display()
    ))
    .mended_by(Remedy::Reproject)
}
