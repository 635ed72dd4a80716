//! The ground changed by hand: strokes, undo and redo, a rain of craters. A crater scorches the picture, where one is draped.

use super::Viewer;
use crate::window::events::Wake;
use crate::window::tool::{RADII_M, Stroke, Tool};
use crate::window::workshop::Workshop;
use std::time::{Duration, Instant};
use terrasoar::edits::rain::Rain as RainOfCraters;
use terrasoar::flight::generate::Ground;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, Edit};

/// Edits that a frame makes of a stroke at most: a hand faster than that is caught up with.
const EDITS_A_FRAME: usize = 24;
/// Craters that fall in a frame of rain.
const CRATERS_A_FRAME: u64 = 2;
/// How often rain is brought to the disk.
const RAIN_COMMITS: Duration = Duration::from_secs(2);
/// Points of the ring that shows where a tool works.
const RING_POINTS: usize = 72;

/// A rain of craters.
#[derive(Debug)]
pub(in crate::window) struct Rain {
    fallen: u64,
    since: Instant,
}

impl Viewer {
    /// Begins a stroke at the point under the cursor. Whether there is a tool to make one with.
    pub(super) fn begin_stroke(&mut self) -> bool {
        if self.tools.tool == Tool::Look {
            return false;
        }
        if let Some(hit) = self.pick(self.hand.pointer) {
            let at = hit.at_m.truncate();
            self.stroke = Some(Stroke::begin(at, hit.height_m));
            self.work_at(&[at]);
        }
        true
    }

    /// Goes on with a stroke to where the cursor is.
    pub(super) fn go_on_with_stroke(&mut self) {
        let (Some(mut stroke), Some(hit)) = (self.stroke, self.under) else { return };
        // Craters are shot one by one.
        if self.tools.tool == Tool::Crater {
            return;
        }
        let places = stroke.go_on(hit.at_m.truncate(), self.tools.radius_m, EDITS_A_FRAME);
        self.stroke = Some(stroke);
        if !places.is_empty() {
            self.work_at(&places);
            self.touched = true;
        }
    }

    /// Ends a stroke and has it brought to the disk.
    pub(super) fn end_stroke(&mut self) {
        if self.stroke.is_some() {
            // The hand may have moved since the last frame.
            self.under = self.pick(self.hand.pointer);
            self.go_on_with_stroke();
            self.stroke = None;
            self.commit(self.tools.tool.name());
        }
    }

    fn work_at(&mut self, places: &[glam::DVec2]) {
        let direction_deg = self.rig.camera.yaw_deg;
        let level_m = self.stroke.map(|stroke| stroke.level_m);
        let edits: Vec<Edit> =
            places.iter().filter_map(|at| self.tools.edit(at.to_array(), direction_deg, level_m)).collect();
        self.apply(&edits);
    }

    /// Applies edits, scorches the picture where craters are, and shows them in the next picture. Whether that went well.
    fn apply(&mut self, edits: &[Edit]) -> bool {
        if edits.is_empty() {
            return true;
        }
        let scorches = self.stage.scene.scorches_of(edits);
        let applied = match self.workshop() {
            Ok(workshop) => workshop.apply(edits, &scorches),
            Err(error) => Err(error),
        };
        match applied {
            Ok(changes) => self.follow(&changes),
            Err(error @ LayoutError::OutOfRange { .. }) => {
                self.stroke = None;
                self.trouble(format!(
                    "{error} (`terrasoar edit` does that by itself; here it would take the ground from under the eye)"
                ));
                false
            }
            Err(error) => {
                self.stroke = None;
                self.trouble(error.to_string());
                false
            }
        }
    }

    /// The workshop, opened if need be.
    fn workshop(&mut self) -> Result<&mut Workshop, LayoutError> {
        let opened = match self.workshop.take() {
            Some(workshop) => workshop,
            None => Workshop::open(self.stage.terrain())?,
        };
        Ok(self.workshop.insert(opened))
    }

    /// Has the scene follow what became of the picture.
    fn follow_picture(&mut self) {
        if let Some(workshop) = &mut self.workshop
            && let Err(error) = self.stage.scene.repainted(workshop.session_mut())
        {
            self.trouble(error.to_string());
        }
    }

    /// Has the scene follow what changed. Whether it could.
    fn follow(&mut self, changes: &Changes) -> bool {
        self.follow_picture();
        let Some(workshop) = &self.workshop else { return false };
        self.touched = true;
        // The picture is another one once this is drawn.
        self.said.retain(|(name, _)| *name != "at-rest");
        match self.stage.scene.ground_changed(changes, workshop.session().editor()) {
            Ok(is_followed) => is_followed,
            Err(error) => {
                self.trouble(error.to_string());
                false
            }
        }
    }

    /// Shows all edits in a scene that was made anew.
    pub(super) fn follow_all(&mut self) {
        if let Some(workshop) = &self.workshop {
            let changes = workshop.all_changes();
            self.follow(&changes);
        }
    }

    fn commit(&mut self, label: &str) {
        let proxy = self.proxy.clone();
        let wake = move || {
            // A window that has gone needs no waking.
            let _ = proxy.send_event(Wake);
        };
        let Some(workshop) = &mut self.workshop else { return };
        if let Err(error) = workshop.commit(label, wake) {
            self.trouble(format!("the edits are not on the disk yet: {error}"));
        }
    }

    /// Looks after commits under way.
    pub(super) fn look_after_edits(&mut self) {
        let proxy = self.proxy.clone();
        let wake = move || {
            let _ = proxy.send_event(Wake);
        };
        let Some(workshop) = &mut self.workshop else { return };
        match workshop.look_after(wake) {
            Ok(true) => self.tell("saved"),
            Ok(false) => {}
            Err(error) => self.trouble(format!("the edits are not on the disk yet: {error}")),
        }
        self.follow_picture();
    }

    /// Whether edits are on their way to the disk.
    pub(super) fn is_saving(&self) -> bool {
        self.workshop.as_ref().is_some_and(Workshop::is_unsaved)
    }

    /// Takes the last stroke back, or brings it back.
    pub(super) fn undo(&mut self, back: bool) {
        self.stroke = None;
        let done = match self.workshop() {
            Ok(workshop) if back => workshop.undo(),
            Ok(workshop) => workshop.redo(),
            Err(error) => Err(error),
        };
        match done {
            Ok(Some(changes)) => {
                self.follow(&changes);
                self.tell(if back { "undone" } else { "redone" });
            }
            Ok(None) => {
                self.news(if back { "There is nothing to undo." } else { "There is nothing to redo." })
            }
            Err(error) => self.trouble(error.to_string()),
        }
    }

    /// Lets craters rain, or no longer.
    pub(super) fn toggle_rain(&mut self) {
        self.rain = match self.rain.take() {
            Some(_) => {
                self.commit("rain of craters");
                None
            }
            None => Some(Rain { fallen: 0, since: Instant::now() }),
        };
    }

    /// Craters of a frame, around what the eye looks at.
    pub(super) fn let_rain(&mut self) {
        let Some(mut rain) = self.rain.take() else { return };
        let ahead = self.ahead_m();
        let reach_m = 0.4 * ahead.distance(self.rig.camera.eye_m);
        let [wide, high] = self.stage.ground().extent_m();
        let [west, south] = [ahead.x, ahead.y].map(|m| m - reach_m);
        let [east, north] = [ahead.x, ahead.y].map(|m| m + reach_m);
        let craters = RainOfCraters {
            count: CRATERS_A_FRAME,
            // Another rain every frame, the same ones every time.
            seed: rain.fallen,
            extent_m: [west.max(0.0), south.max(0.0), east.min(wide), north.min(high)],
            radius_m: [0.004, 0.05].map(|part| (part * reach_m).clamp(RADII_M[0], RADII_M[1])),
            depth_ratio: [0.2, 0.4],
            batch: CRATERS_A_FRAME,
        };
        let is_over_ground =
            craters.extent_m[0] < craters.extent_m[2] && craters.extent_m[1] < craters.extent_m[3];
        let edits: Vec<Edit> = craters.craters().filter(|_| is_over_ground).map(Edit::Crater).collect();
        rain.fallen += CRATERS_A_FRAME;
        if !self.apply(&edits) {
            return;
        }
        if rain.since.elapsed() >= RAIN_COMMITS {
            rain.since = Instant::now();
            self.commit("rain of craters");
        }
        self.touched = true;
        self.rain = Some(rain);
    }

    /// Waits until all edits are on the disk and gives the right to edit back.
    pub(in crate::window) fn close_workshop(&mut self) -> Result<(), LayoutError> {
        self.stroke = None;
        self.rain = None;
        self.workshop.take().map_or(Ok(()), |workshop| workshop.close().map(drop))
    }

    /// The ring on the ground within which the tool works, in points of the window; pieces of it that can be seen.
    pub(super) fn ring(&self) -> Vec<[f32; 2]> {
        let (Some(hit), true) = (self.under, self.tools.tool != Tool::Look) else { return Vec::new() };
        let ground = self.stage.ground();
        let scale = 1.0 / self.window.scale_factor();
        let around = (0..=RING_POINTS).filter_map(|i| {
            let (sin, cos) = (i as f64 / RING_POINTS as f64 * std::f64::consts::TAU).sin_cos();
            let at = hit.at_m.truncate() + self.tools.radius_m * glam::DVec2::new(sin, cos);
            let height_m = ground.height_m(at.x, at.y)?;
            let [x, y] = self.place_on_screen(at.extend(height_m * self.settings.exaggeration))?;
            Some([(x * scale) as f32, (y * scale) as f32])
        });
        around.collect()
    }
}
