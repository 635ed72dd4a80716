//! Does what keys, panels and dropped files ask for.

use super::{Viewer, edit, sight};
use crate::fit;
use crate::lost::newest_header_is_lost;
use crate::window::camera::ground_below_m;
use crate::window::flights::{Player, Recorder};
use crate::window::job::{self, Job};
use crate::window::keep;
use crate::window::keys::Action;
use crate::window::panel::Wish;
use crate::window::stage::Stage;
use crate::window::tool::{STEP, Tool};
use crate::window::wake::Wake;
use std::path::{Path, PathBuf};
use terrasoar::flight::Flight;
use terrasoar::flight::generate::Ground;
use terrasoar::view::Viewport;
use winit::window::Fullscreen;

impl Viewer {
    /// Does what a key stands for.
    pub(super) fn act(&mut self, action: Action) {
        self.touched = true;
        match action {
            Action::Help => self.memory.help = !self.memory.help,
            Action::Panel => self.settings.panel = !self.settings.panel,
            Action::Figures => self.settings.figures = !self.settings.figures,
            Action::FullScreen => {
                let is_full = self.window.fullscreen().is_some();
                self.window.set_fullscreen((!is_full).then_some(Fullscreen::Borderless(None)));
            }
            Action::Follow => {
                let (rig, exaggeration) = (&mut self.rig, self.settings.exaggeration);
                let before = rig.follow_m;
                rig.toggle_follow(&self.stage.heights(), exaggeration);
                if before.is_none() && self.rig.follow_m.is_none() {
                    self.news("There is no ground below to keep a height above.");
                }
            }
            Action::Circle => {
                self.pause();
                self.rig.circling = match self.rig.circling {
                    Some(_) => None,
                    None => Some(self.ahead_m()),
                };
            }
            Action::Overview => {
                self.pause();
                self.rig.follow_m = None;
                self.rig.glide_to(self.overview());
            }
            Action::GoTo => {
                self.settings.panel = true;
                self.memory.focus_place = true;
            }
            Action::Freeze => {
                self.frozen = match self.frozen {
                    Some(_) => None,
                    None => Some(self.view()),
                };
            }
            Action::NextStyle => self.settings.next_style(),
            Action::Contours => self.settings.contours = !self.settings.contours,
            Action::Wireframe => self.settings.wireframe = !self.settings.wireframe,
            Action::NextTool => self.tools.tool = self.tools.tool.next(),
            Action::SmallerTool => self.tools.grow(1.0 / STEP),
            Action::LargerTool => self.tools.grow(STEP),
            Action::Undo => self.undo(true),
            Action::Redo => self.undo(false),
            Action::Rain => self.toggle_rain(),
            Action::Screenshot => self.keep_picture(),
            Action::Record => self.record(),
            Action::Play => match &mut self.player {
                Some(player) => player.toggle(),
                None => {
                    self.news("There is no flight yet: R records one; a .flight file may be dropped here.")
                }
            },
            Action::StepBack => self.step(-1),
            Action::StepForward => self.step(1),
            Action::Cancel => {
                self.memory.help = false;
                self.tools.tool = Tool::Look;
                if self.rain.is_some() {
                    self.toggle_rain();
                }
                self.pause();
                self.rig.circling = None;
                self.rig.place(self.rig.camera);
            }
            Action::Quit => self.quit(),
        }
    }

    /// Does what a panel asks for.
    pub(super) fn grant(&mut self, wish: Wish) {
        self.touched = true;
        match wish {
            Wish::Act(action) => self.act(action),
            Wish::GoTo(text) => self.go_to(&text),
            Wish::Seek(frame) => {
                if let Some(player) = &mut self.player {
                    player.pause();
                    player.seek(frame);
                    self.rig.place(player.camera());
                }
            }
            Wish::CloseFlight => self.player = None,
            Wish::Tools(tools) => self.tools = tools,
            Wish::Dismiss(note) => {
                if note < self.notes.len() {
                    self.notes.remove(note);
                }
            }
        }
    }

    /// Opens what was dropped on the window: a terrain, a flight, or elevation data, which is built first.
    pub(in crate::window) fn open(&mut self, path: PathBuf) {
        self.touched = true;
        if job::is_terrain(&path) {
            self.open_terrain(&path);
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("flight")) {
            match Flight::read(&path) {
                Ok(flight) => self.take_flight_of(flight, &path),
                Err(error) => self.trouble(error.to_string()),
            }
        } else if self.job.is_some() {
            self.trouble(format!(
                "{}: another terrain is being built; drop it again after that",
                path.display()
            ));
        } else {
            let proxy = self.proxy.clone();
            // A window that has gone needs no waking.
            match Job::start(path, move || {
                let _ = proxy.send_event(Wake);
            }) {
                Ok(job) => self.job = Some(job),
                Err(words) => self.trouble(words),
            }
        }
    }

    /// Closes the window, at once or when a rewriting of the file is over.
    pub(in crate::window) fn quit(&mut self) {
        if self.is_widening() && !self.ending {
            self.news("The window closes when the file is rewritten and all edits are saved.");
        }
        self.ending = true;
    }

    pub(super) fn open_terrain(&mut self, path: &Path) {
        if self.is_widening() {
            return self.trouble(format!(
                "{}: {} is being rewritten with room for edits; open this one after that",
                path.display(),
                self.terrain_name
            ));
        }
        // First, for it may be the same file.
        let closed = self.close_workshop();
        if let Err(words) = &closed {
            self.trouble(format!("edits of {} were lost: {words}", self.terrain_name));
        }
        let (culling, cache_bytes) = (self.settings.culling(), self.plan.cache_bytes);
        match Stage::open(path, &self.screen.gpu, culling, cache_bytes) {
            Ok(stage) => {
                self.end_recording();
                self.take_stage(stage);
                self.tools = edit::tools_for(&self.stage);
                self.rig = sight::start(&self.stage, &self.screen, &self.window, &self.settings);
                self.player = None;
                self.name_terrain();
                self.tell(&format!("opened {}", path.display()));
                if let Some(words) = newest_header_is_lost(self.stage.terrain()) {
                    self.news(words);
                }
            }
            Err(error) => {
                self.trouble(format!("{error:#}"));
                if closed.is_err() {
                    self.show_file();
                }
            }
        }
    }

    /// Takes a flight of a file, and says what is strange about it over this terrain.
    pub(super) fn take_flight_of(&mut self, flight: Flight, path: &Path) {
        let strange = fit::strange(self.stage.terrain(), &flight, path, Viewport::default());
        match strange {
            Ok(words) => {
                words.into_iter().for_each(|words| self.trouble(words));
                self.take_flight(flight);
            }
            Err(words) => self.trouble(words),
        }
    }

    fn take_flight(&mut self, flight: Flight) {
        self.player = Player::new(flight);
        if let Some(player) = &self.player {
            self.rig.place(player.camera());
        }
    }

    fn step(&mut self, by: isize) {
        if let Some(player) = &mut self.player {
            player.step(by);
            self.rig.place(player.camera());
        }
    }

    fn go_to(&mut self, text: &str) {
        let [east, north] = match self.coordinates.meant(text) {
            Ok(place_m) => place_m,
            Err(words) => return self.trouble(words),
        };
        let [wide, high] = self.stage.heights().extent_m();
        let exaggeration = self.settings.exaggeration;
        let at = glam::DVec3::new(east, north, 0.0);
        let below_m = ground_below_m(&self.stage.heights(), at, exaggeration);
        self.pause();
        self.rig.go_to(at.with_z(below_m.unwrap_or_default()), 0.04 * wide.max(high));
    }

    fn record(&mut self) {
        if self.recorder.is_some() {
            self.end_recording();
        } else {
            self.pause();
            self.recorder = Some(Recorder::new(&self.stage.path(), self.settings.exaggeration));
        }
    }

    pub(in crate::window) fn end_recording(&mut self) {
        let Some(recorder) = self.recorder.take() else { return };
        let path = keep::free_name(Path::new(""), &self.stage.path(), "flight");
        match recorder.finish(&path) {
            Ok(flight) => {
                self.news(format!("flight: {}", shown(&path)));
                self.tell(&format!("flight {}", shown(&path)));
                self.player = Player::new(flight);
            }
            Err(error) => self.trouble(error.to_string()),
        }
    }

    fn keep_picture(&mut self) {
        let path = keep::free_name(Path::new(""), &self.stage.path(), "png");
        match self.take_picture(&path) {
            Ok(()) => {
                self.news(format!("picture: {}", shown(&path)));
                self.tell(&format!("picture {}", shown(&path)));
            }
            Err(error) => self.trouble(format!("{error:#}")),
        }
    }
}

/// A path that tells where the file is.
fn shown(path: &Path) -> String {
    std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()).display().to_string()
}
