//! The ground changed by hand: strokes, undo and redo, a rain of craters. A crater scorches the picture, where one is draped.
//!
//! Frames give orders and take results; the workshop's thread does the work. A stroke is seen a frame or two after the hand made it. Edited ground is kept in memory until it
//! is on the disk, [`MOST_HELD`] pages at most.

use super::Viewer;
use crate::window::Plan;
use crate::window::coordinates::Coordinates;
use crate::window::stage::Stage;
use crate::window::tool::{RADII_M, Stroke, Tool, ToolBox};
use crate::window::wake::Wake;
use crate::window::workshop::{News, Seen, Workshop};
use std::time::{Duration, Instant};
use terrasoar::edits::rain::Rain as RainOfCraters;
use terrasoar::flight::generate::Ground;
use terrasoar_layout::edit::Edit;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_scene::repaint::Repaint;
use winit::event_loop::EventLoopProxy;

/// Edits that a frame makes of a stroke at most: a hand faster than that is caught up with.
const EDITS_A_FRAME: usize = 24;
/// Craters that fall in a frame of rain.
const CRATERS_A_FRAME: u64 = 2;
/// How often rain is brought to the disk.
const RAIN_COMMITS: Duration = Duration::from_secs(2);
/// What a commit of rain is called.
const RAIN: &str = "rain of craters";
/// Orders that nothing is known of yet, beyond which the hand and the rain wait.
const MOST_IN_FLIGHT: u64 = 32;
/// Edited pages that are not in the file, beyond which nothing more is edited: 128 MiB, some 30 million samples.
const MOST_HELD: usize = 32_768;
/// What is said then.
const UNSAVED: &str =
    "128 MiB of edited ground are not on the disk yet, so this stroke ends here; go on when they are saved";
/// What is said of a terrain in the folder for caches.
const KEPT: &str = "this terrain was built of elevation data for looking at, and edits of it would be lost; make a file of it with `terrasoar build` and open that";
/// Points of the ring that shows where a tool works.
const RING_POINTS: usize = 72;

/// A rain of craters.
#[derive(Debug)]
pub(in crate::window) struct Rain {
    fallen: u64,
    since: Instant,
}

/// The tools to begin with over a terrain.
pub(super) fn tools_for(stage: &Stage) -> ToolBox {
    let heights = stage.heights();
    ToolBox::new(heights.extent_m(), heights.spacing_m())
}

/// A workshop for what is on show, which wakes the window.
pub(super) fn workshop_for(stage: &Stage, plan: &Plan, proxy: &EventLoopProxy<Wake>) -> Workshop {
    let proxy = proxy.clone();
    let wake = move || {
        // A window that has gone needs no waking.
        let _ = proxy.send_event(Wake);
    };
    if plan.is_kept && stage.path() == plan.file {
        return Workshop::closed(stage.terrain(), KEPT, wake);
    }
    Workshop::new(stage.terrain(), wake)
}

impl Viewer {
    /// Begins a stroke at the point under the cursor. Whether there is a tool to make one with.
    pub(super) fn begin_stroke(&mut self) -> bool {
        if self.tools.tool == Tool::Look {
            return false;
        }
        if let Some(hit) = self.pick(self.hand.pointer) {
            let at = hit.at_m.truncate();
            self.strokes += 1;
            self.stroke = Some(Stroke::begin(at, hit.height_m));
            self.work_at(&[at]);
        }
        true
    }

    /// Goes on with a stroke to where the cursor is. A hand that is ahead of the ground is caught up with.
    pub(super) fn go_on_with_stroke(&mut self) {
        if !self.is_behind() {
            self.lengthen_stroke();
        }
    }

    fn lengthen_stroke(&mut self) {
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
            self.lengthen_stroke();
            self.end_work();
        }
    }

    fn work_at(&mut self, places: &[glam::DVec2]) {
        let direction_deg = self.rig.camera.yaw_deg;
        let level_m = self.stroke.map(|stroke| stroke.level_m);
        let edits: Vec<Edit> =
            places.iter().filter_map(|at| self.tools.edit(at.to_array(), direction_deg, level_m)).collect();
        self.apply(edits);
    }

    /// Has edits applied, and the picture scorched where craters are; a later frame shows them. Whether there can be edits.
    fn apply(&mut self, edits: Vec<Edit>) -> bool {
        if edits.is_empty() {
            return true;
        }
        if self.stage.ground.held_pages() >= MOST_HELD {
            self.end_work();
            self.trouble(UNSAVED);
            return false;
        }
        let scorches = self.stage.scene.scorches_of(&edits);
        let applied = self.workshop.apply(self.strokes, edits, scorches);
        self.is_ordered(applied)
    }

    /// Says why there can be no edits, if there can be none.
    fn is_ordered(&mut self, ordered: Result<(), String>) -> bool {
        let Err(words) = ordered else { return true };
        (self.stroke, self.rain) = (None, None);
        self.trouble(words);
        false
    }

    /// Whether so much is ordered that the hand should wait for the ground.
    fn is_behind(&self) -> bool {
        self.workshop.in_flight() >= MOST_IN_FLIGHT
    }

    /// Ends what is being done to the ground and has what was done of it brought to the disk.
    fn end_work(&mut self) {
        if self.stroke.take().is_some() {
            self.workshop.commit(self.tools.tool.name());
        }
        if self.rain.take().is_some() {
            self.workshop.commit(RAIN);
        }
    }

    /// Has the scene follow what changed.
    fn follow(&mut self, Seen { ground, picture, trouble }: Seen) {
        self.touched = true;
        // The picture is another one once this is drawn.
        self.said.retain(|(name, _)| *name != "at-rest");
        if let Err(error) = self.stage.ground.take_edits(ground) {
            self.trouble(error.to_string());
        }
        self.follow_picture(picture);
        if let Some(error) = trouble {
            self.trouble(error.to_string());
        }
    }

    /// Has the scene follow what became of the picture.
    fn follow_picture(&mut self, picture: Option<Box<Repaint>>) {
        if let Some(picture) = picture
            && let Err(error) = self.stage.scene.repainted(*picture)
        {
            self.trouble(error.to_string());
        }
    }

    /// Takes notice of what has become of edits. Waits for nothing.
    pub(super) fn look_after_edits(&mut self) {
        while let Some(news) = self.workshop.take() {
            self.heed(news);
        }
    }

    fn heed(&mut self, news: News) {
        match news {
            News::Nothing | News::Closed(None) => {}
            News::Edited(seen) => self.follow(*seen),
            News::Refused(error) => {
                self.widening = None;
                self.end_work();
                self.trouble(error.to_string());
            }
            News::Widening { words, meter } => {
                self.widening = Some(meter);
                self.news(words);
                self.tell("widening");
            }
            News::Widened(terrain) => self.show_widened(*terrain),
            News::Turned { back, seen } => {
                self.follow(*seen);
                self.tell(if back { "undone" } else { "redone" });
            }
            News::NothingToTurn { back } => {
                self.news(if back { "There is nothing to undo." } else { "There is nothing to redo." });
            }
            News::Saved { places, picture } => {
                self.stage.ground.relocate(&places);
                match picture {
                    Ok(picture) => self.follow_picture(picture),
                    Err(error) => self.trouble(error.to_string()),
                }
                self.tell("saved");
            }
            News::NotSaved(error) | News::Closed(Some(error)) => {
                self.trouble(format!("the edits are not on the disk yet: {error}"));
            }
            News::NotTurned(error) => self.trouble(error.to_string()),
            News::NotOpened(error) => {
                (self.stroke, self.rain, self.widening) = (None, None, None);
                self.trouble(error.to_string());
            }
            News::Broken(words) => {
                (self.stroke, self.rain, self.widening) = (None, None, None);
                self.trouble(words);
                self.show_file();
            }
        }
    }

    /// Shows what is in the file, after edits were lost that are on show. Where that fails nothing can be edited until a terrain is opened.
    pub(super) fn show_file(&mut self) {
        match self.stage.again(&self.screen.gpu) {
            Ok(stage) => {
                self.take_stage(stage);
                self.news("The ground is shown as it is on the disk.");
            }
            Err(error) => self.trouble(format!("{error:#}")),
        }
    }

    /// Shows the file as it was rewritten. What is edited from now on is of that file.
    fn show_widened(&mut self, terrain: Terrain) {
        self.widening = None;
        match self.stage.with(terrain, &self.screen.gpu) {
            Ok(stage) => {
                self.put_on_show(stage);
                self.tell("widened");
            }
            Err(error) => {
                self.trouble(format!("{error:#}"));
                // What follows cannot be shown over what is on show. It is brought to the disk, and the file is opened from there.
                (self.stroke, self.rain) = (None, None);
                if let (_, Err(words)) = self.workshop.close() {
                    self.trouble(words);
                }
                self.show_file();
            }
        }
    }

    /// Whether the file is being rewritten.
    pub(super) fn is_widening(&self) -> bool {
        self.widening.is_some()
    }

    /// Puts another stage in place of the one before, whose edits are settled.
    pub(super) fn take_stage(&mut self, stage: Stage) {
        self.workshop = workshop_for(&stage, &self.plan, &self.proxy);
        self.put_on_show(stage);
    }

    fn put_on_show(&mut self, stage: Stage) {
        self.coordinates = Coordinates::of(stage.terrain().header());
        self.stage = stage;
        self.frozen = None;
        self.touched = true;
    }

    /// Whether edits are on their way to the disk.
    pub(super) fn is_saving(&self) -> bool {
        self.workshop.is_unsaved()
    }

    /// Takes the last stroke back, or brings it back.
    pub(super) fn undo(&mut self, back: bool) {
        if self.stroke.take().is_some() {
            self.workshop.commit(self.tools.tool.name());
        }
        let turned = self.workshop.turn(back);
        self.is_ordered(turned);
    }

    /// Lets craters rain, or no longer.
    pub(super) fn toggle_rain(&mut self) {
        self.rain = match self.rain.take() {
            Some(_) => {
                self.workshop.commit(RAIN);
                None
            }
            None => {
                self.strokes += 1;
                Some(Rain { fallen: 0, since: Instant::now() })
            }
        };
    }

    /// Craters of a frame, around what the eye looks at.
    pub(super) fn let_rain(&mut self) {
        if self.is_behind() {
            return;
        }
        let Some(mut rain) = self.rain.take() else { return };
        let ahead = self.ahead_m();
        let reach_m = 0.4 * ahead.distance(self.rig.camera.eye_m);
        let [wide, high] = self.stage.heights().extent_m();
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
        if !self.apply(edits) {
            self.workshop.commit(RAIN);
            return;
        }
        if rain.since.elapsed() >= RAIN_COMMITS {
            rain.since = Instant::now();
            self.workshop.commit(RAIN);
        }
        self.touched = true;
        self.rain = Some(rain);
    }

    /// Waits until all edits are on the disk and gives the right to edit back.
    ///
    /// # Errors
    /// What could not be saved, as a message.
    pub(in crate::window) fn close_workshop(&mut self) -> Result<(), String> {
        self.end_work();
        let (news, closed) = self.workshop.close();
        news.into_iter().for_each(|news| self.heed(news));
        closed
    }

    /// The ring on the ground within which the tool works, in points of the window; pieces of it that can be seen.
    pub(super) fn ring(&self) -> Vec<[f32; 2]> {
        let (Some(hit), true) = (self.under, self.tools.tool != Tool::Look) else { return Vec::new() };
        let ground = self.stage.heights();
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
