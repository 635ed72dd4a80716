//! Whether what was asked for lies on the terrain: edits, flights, eyes.
//!
//! **What lies wholly outside is refused, with the terrain's extent; what lies partly outside, or below the ground, is said.** An eye outside that has the terrain in view
//! is no mistake. Cost: for a flight four heights a frame, of pages that are kept.

use super::output::{complain, decimal, grouped};
use crate::fit::{self, extent, is_over};
use anyhow::{Error, Result, bail};
#[cfg(feature = "pictures")]
use glam::DVec2;
use glam::DVec3;
use std::path::Path;
use terrasoar::edits::LoadedBatch;
use terrasoar::flight::Flight;
use terrasoar::view::{View, Viewport};
use terrasoar_layout::edit::Edit;
use terrasoar_layout::grid::Grid;
use terrasoar_layout::read::heights::Heights;
use terrasoar_layout::read::terrain::Terrain;
#[cfg(feature = "pictures")]
use terrasoar_render::Haze;

/// Of a step between samples, how far above the ground an eye is put that was below it. More than to the near plane, beyond which nothing is drawn.
const CLEARANCE: f64 = 0.1;
/// Of the terrain, how far something may reach beyond it and be taken to end at its border.
const AT_THE_BORDER: f64 = 1e-9;

/// Where an edit lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lies {
    Inside,
    Partly,
    Outside,
}

fn lies(edit: &Edit, grid: &Grid) -> Lies {
    let [west, south, east, north] = edit.reach_m(grid);
    let [wide_m, high_m] = grid.extent_m();
    let (slack_x, slack_y) = (AT_THE_BORDER * wide_m, AT_THE_BORDER * high_m);
    if east < -slack_x || north < -slack_y || west > wide_m + slack_x || south > high_m + slack_y {
        Lies::Outside
    } else if west < -slack_x || south < -slack_y || east > wide_m + slack_x || north > high_m + slack_y {
        Lies::Partly
    } else {
        Lies::Inside
    }
}

/// Looks where the edits of a script lie; gives a warning if some reach beyond the terrain. Of what was not read from a script but made over the terrain nothing is said.
///
/// # Errors
/// An edit wholly outside.
pub(super) fn edits(batches: &[LoadedBatch], grid: &Grid, script: Option<&Path>) -> Result<Option<String>> {
    let Some(script) = script.map(|path| path.display()) else { return Ok(None) };
    let (mut partly, mut first) = (0_u64, String::new());
    for (number, batch) in (1_u64..).zip(batches) {
        for edit in &batch.edits {
            let named = || format!("batch {number} ({}), {}", batch.label, edit.name());
            match lies(edit, grid) {
                Lies::Inside => {}
                Lies::Outside => {
                    let reach = reach(edit, grid);
                    bail!(
                        "{script}: {}: it covers {reach}, which is wholly outside the terrain, {}; nothing was done",
                        named(),
                        extent(grid)
                    );
                }
                Lies::Partly => {
                    partly += 1;
                    if partly == 1 {
                        first = format!("{} covers {}", named(), reach(edit, grid));
                    }
                }
            }
        }
    }
    let those =
        if partly == 1 { "1 edit reaches".into() } else { format!("{} edits reach", grouped(partly)) };
    Ok((partly > 0).then(|| {
        format!(
            "warning: {script}: {those} beyond the terrain, {}; what lies outside is left out. The first: {first}",
            extent(grid)
        )
    }))
}

/// What an edit covers, in words.
fn reach(edit: &Edit, grid: &Grid) -> String {
    let [west, south, east, north] = edit.reach_m(grid).map(|m| decimal(m, 4));
    format!("{west},{south} to {east},{north}")
}

/// Warns of one edit that lies partly outside.
pub(super) fn warn_of(edit: &Edit, grid: &Grid) {
    if lies(edit, grid) == Lies::Partly {
        complain(&format!(
            "warning: the {} covers {}, beyond the terrain, {}; what lies outside is left out",
            edit.name(),
            reach(edit, grid),
            extent(grid)
        ));
    }
}

#[cfg(feature = "pictures")]
/// Refuses an eye beside the terrain to which the air hides all of it. `hint` is what the place may be meant as, a clause.
///
/// # Errors
/// As said.
pub(super) fn air(terrain: &Terrain, view: &View, haze: Haze, hint: &str) -> Result<()> {
    let grid = terrain.grid();
    let [east_m, north_m] = grid.extent_m();
    let Some(haze_m) = haze.distance_m(east_m.hypot(north_m)) else { return Ok(()) };
    let nearest = view.eye_m.truncate().clamp(DVec2::ZERO, DVec2::new(east_m, north_m));
    let away_m = (view.eye_m.truncate() - nearest).length();
    let [low_m, high_m] = terrain.header().height_range_m.map(|h| h * view.vertical_exaggeration);
    // At least so much air: all of the way as thin as at its higher end, as the shader's air thins.
    let scale_height_m = Haze::scale_height_m(haze_m);
    let thinnest = (-(view.eye_m.z.max(high_m) - low_m) / scale_height_m).exp();
    // Of the colour that is scattered least.
    let left = (-0.75 * away_m * thinnest / haze_m).exp();
    if left < 1.0 / 512.0 {
        let [east, north, up] = view.eye_m.to_array().map(|m| decimal(m, 2));
        bail!(
            "from {east},{north},{up} nothing of the terrain is seen, {}; it is {} km away, and the air hides what is so far (--haze off shows it){hint}",
            extent(grid),
            decimal(away_m / 1000.0, 1)
        );
    }
    Ok(())
}

#[cfg(feature = "pictures")]
/// Refuses an eye outside the terrain that does not see it, and one below the ground. `hint` is what the place may be meant as, a clause.
///
/// # Errors
/// As said.
pub(super) fn eye(terrain: &Terrain, view: &View, hint: &str) -> Result<()> {
    let [east, north, up] = view.eye_m.to_array().map(|m| decimal(m, 2));
    if !is_over(terrain.grid(), view.eye_m) && !fit::sees(terrain, view) {
        bail!(
            "from {east},{north},{up} nothing of the terrain is seen, {}; the eye is outside it and looks elsewhere{hint}",
            extent(terrain.grid())
        );
    }
    if let Some(ground) = Ground::new(terrain).below(view) {
        bail!(
            "the eye at {east},{north},{up} is {} m below the ground, which is {} m high there{}; give it a height of {} or more",
            decimal(ground.depth_m, 2),
            decimal(ground.ground_m, 2),
            if view.vertical_exaggeration == 1.0 { "" } else { ", exaggerated" },
            decimal(ground.clear_m, 1)
        );
    }
    Ok(())
}

/// Looks whether a flight fits a terrain, for pictures of some size; says what is strange about it.
///
/// # Errors
/// A flight that lies wholly outside.
pub(super) fn flight(terrain: &Terrain, flight: &Flight, path: &Path, viewport: Viewport) -> Result<()> {
    for words in fit::strange(terrain, flight, path, viewport).map_err(Error::msg)? {
        complain(&format!("note: {words}"));
    }
    Ok(())
}

/// Says in how many frames of a flight the eye is below the ground.
pub(super) fn below_ground(terrain: &Terrain, flight: &Flight, path: &Path, exaggeration: f64) {
    let mut ground = Ground::new(terrain);
    let (mut count, mut first, mut deepest_m) = (0_u64, 0, 0.0_f64);
    for (number, frame) in flight.frames.iter().enumerate() {
        let view = frame.view(Viewport::default(), 1.0).exaggeration(exaggeration);
        if let Some(below) = ground.below(&view) {
            if count == 0 {
                first = number;
            }
            count += 1;
            deepest_m = deepest_m.max(below.depth_m);
        }
    }
    if count > 0 {
        complain(&format!(
            "note: {}: the eye is below the ground in {} of {} frames, first in frame {first}, by up to {} m",
            path.display(),
            grouped(count),
            grouped(flight.frames.len() as u64),
            decimal(deepest_m, 1)
        ));
    }
}

/// An eye below the ground.
#[derive(Debug, Clone, Copy)]
#[cfg_attr(not(feature = "pictures"), expect(dead_code, reason = "the verbs that draw use it"))]
pub(super) struct Below {
    /// Height of the ground as drawn, metres.
    pub(super) ground_m: f64,
    /// How far below it the eye is, metres.
    pub(super) depth_m: f64,
    /// A height of the eye that is clear of it, metres.
    pub(super) clear_m: f64,
}

/// The ground under eyes.
pub(super) struct Ground<'t> {
    heights: Heights<'t>,
    grid: Grid,
}

impl<'t> Ground<'t> {
    pub(super) fn new(terrain: &'t Terrain) -> Self {
        Self { heights: Heights::new(terrain), grid: *terrain.grid() }
    }

    /// How far the eye is below the ground, if it is. Beside the terrain, and where there is a void or damage, there is no ground.
    pub(super) fn below(&mut self, view: &View) -> Option<Below> {
        let ground_m = self.highest_m(view.eye_m)? * view.vertical_exaggeration;
        let [dx, dy] = self.grid.spacing_m();
        // To a decimetre, upwards, so that what is said is clear too.
        let clear_m = ((ground_m + CLEARANCE * dx.min(dy)) * 10.0).ceil() / 10.0;
        (view.eye_m.z <= ground_m).then_some(Below { ground_m, depth_m: ground_m - view.eye_m.z, clear_m })
    }

    /// The ground's height before exaggeration, by whichever diagonal of the cell is higher: either may be drawn.
    fn highest_m(&mut self, eye_m: DVec3) -> Option<f64> {
        if !is_over(&self.grid, eye_m) {
            return None;
        }
        let (spacing, samples) = (self.grid.spacing_m(), self.grid.samples());
        let at = [eye_m.x / spacing[0], eye_m.y / spacing[1]];
        let cell = [0, 1].map(|i| at[i].floor().clamp(0.0, f64::from(samples[i].saturating_sub(2))));
        let [fx, fy] = [at[0] - cell[0], at[1] - cell[1]];
        let mut corner = |x: f64, y: f64| {
            let place = [(cell[0] + x) * spacing[0], (cell[1] + y) * spacing[1]];
            self.heights.height_m(place[0], place[1]).ok().flatten()
        };
        let [sw, se, nw, ne] = [corner(0.0, 0.0)?, corner(1.0, 0.0)?, corner(0.0, 1.0)?, corner(1.0, 1.0)?];
        let rising =
            if fx > fy { sw + (se - sw) * fx + (ne - se) * fy } else { sw + (nw - sw) * fy + (ne - nw) * fx };
        let falling = if fx + fy < 1.0 {
            sw + (se - sw) * fx + (nw - sw) * fy
        } else {
            ne + (nw - ne) * (1.0 - fx) + (se - ne) * (1.0 - fy)
        };
        Some(rising.max(falling))
    }
}

#[cfg(feature = "pictures")]
/// Puts an eye that is below the ground above it; gives by how many metres it was raised.
pub(super) fn lifted(ground: &mut Ground<'_>, view: View) -> (View, Option<f64>) {
    match ground.below(&view) {
        None => (view, None),
        Some(below) => {
            let eye_m = DVec3::new(view.eye_m.x, view.eye_m.y, below.clear_m);
            (View { eye_m, ..view }, Some(below.clear_m - view.eye_m.z))
        }
    }
}
