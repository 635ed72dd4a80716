//! A frame of the window, and what keys and panels ask for.
//!
//! The order of a frame: move the eye, lay the panels out, grant their wishes, refine, draw, show. What goes wrong becomes a note in the window;
//! a lost device is replaced and told, twice in a row it ends the program.

mod act;
mod draw;
mod hear;

use super::camera::{Camera, Rig, ground_below_m};
use super::events::Wake;
use super::flights::{Player, Recorder};
use super::hand::Hand;
use super::history::{Figures, History};
use super::job::{self, Job};
use super::overlay::Overlay;
use super::panel::{self, Facts, Memory, Note};
use super::pick::{self, Hit};
use super::screen::Screen;
use super::settings::Settings;
use super::stage::Stage;
use super::{Plan, keep};
use crate::app::overview::{FOV_DEG, overview};
use anyhow::Result;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::flight::Flight;
use terrasoar::flight::generate::Ground;
use terrasoar::view::{View, Viewport};
use terrasoar_layout::terrain::Terrain;
use winit::event_loop::{EventLoopProxy, OwnedDisplayHandle};
use winit::window::Window;

/// Longest span that a frame moves on by, so that a hitch is no leap, and that a flight does, whose way
/// is known.
const LONGEST_SPAN: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(1)];
/// How often a build's progress is looked at, and whether a window that could not be drawn on can be by now.
const LOOKS: Duration = Duration::from_millis(100);

/// When the next frame is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// Something moves.
    AtOnce,
    /// Nothing moves; not before that, events apart.
    In(Duration),
    /// Never: the window is to be closed.
    End,
}

/// Everything behind the window.
pub(super) struct Viewer {
    window: Arc<Window>,
    display: OwnedDisplayHandle,
    proxy: EventLoopProxy<Wake>,
    plan: Plan,
    screen: Screen,
    overlay: Overlay,
    stage: Stage,
    terrain_name: String,
    settings: Settings,
    memory: Memory,
    rig: Rig,
    /// What the hands do.
    pub hand: Hand,
    /// The view that the mesh was refined for, while it is frozen.
    frozen: Option<View>,
    recorder: Option<Recorder>,
    player: Option<Player>,
    job: Option<Job>,
    notes: Vec<Note>,
    history: History,
    under: Option<Hit>,
    frame_at: Option<Instant>,
    frames: u64,
    /// Whether the picture will be better when what it lacks has come.
    unsettled: bool,
    /// Whether the last frame found nothing to be drawn on.
    unshown: bool,
    hidden: bool,
    touched: bool,
    ending: bool,
    /// Why it ends, if not because it was asked to.
    pub failure: Option<anyhow::Error>,
    said: Vec<(&'static str, String)>,
}

impl Viewer {
    /// A window with a terrain, and a flight perhaps.
    ///
    /// # Errors
    /// No adapter, no device, or a terrain that cannot be shown.
    pub(super) fn new(
        window: Arc<Window>,
        display: OwnedDisplayHandle,
        proxy: EventLoopProxy<Wake>,
        plan: Plan,
        settings: Settings,
        terrain: Terrain,
        flight: Option<Flight>,
    ) -> Result<Self> {
        let screen = Screen::new(Arc::clone(&window), display.clone())?;
        let overlay = Overlay::new(&window, &display, &screen);
        let stage = Stage::new(terrain, &screen.gpu, settings.culling(), plan.cache_bytes)?;
        let rig = start(&stage, &screen, &window, &settings);
        let mut viewer = Self {
            terrain_name: String::new(),
            window,
            display,
            proxy,
            plan,
            screen,
            overlay,
            stage,
            settings,
            memory: Memory::default(),
            rig,
            hand: Hand::default(),
            frozen: None,
            recorder: None,
            player: None,
            job: None,
            notes: Vec::new(),
            history: History::default(),
            under: None,
            frame_at: None,
            frames: 0,
            unsettled: true,
            unshown: false,
            hidden: false,
            touched: true,
            ending: false,
            failure: None,
            said: Vec::new(),
        };
        viewer.name_terrain();
        if let Some(flight) = flight {
            viewer.take_flight(flight);
        }
        std::mem::take(&mut viewer.plan.drop).into_iter().for_each(|path| viewer.open(path));
        Ok(viewer)
    }

    /// The window.
    pub(super) fn window(&self) -> &Window {
        &self.window
    }

    /// Whether something was touched since the last frame.
    pub(super) fn is_touched(&self) -> bool {
        self.touched && !self.hidden
    }

    /// What is to be remembered, the window's size now included.
    pub(super) fn settings_to_keep(&mut self) -> &Settings {
        if self.window.fullscreen().is_none() {
            let size = self.window.inner_size().to_logical::<f64>(self.window.scale_factor());
            self.settings.window = [size.width.round() as u32, size.height.round() as u32];
        }
        &self.settings
    }

    /// Says in the window what went wrong.
    pub(super) fn trouble(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.tell(&format!("trouble {text}"));
        if self.notes.last().is_none_or(|note| note.text != text) {
            self.notes.push(Note::trouble(text));
        }
        self.touched = true;
    }

    fn news(&mut self, text: impl Into<String>) {
        self.notes.push(Note::news(text));
        self.touched = true;
    }

    /// Tells who drives the window what happened. If nobody listens there is nobody to tell.
    fn tell(&self, line: &str) {
        if self.plan.narrate {
            let mut out = std::io::stdout().lock();
            let _ = writeln!(out, "{line}").and_then(|()| out.flush());
        }
    }

    /// Tells a state when it is another than before.
    fn tell_state(&mut self, name: &'static str, value: String) {
        if !self.plan.narrate {
            return;
        }
        match self.said.iter_mut().find(|(said, _)| *said == name) {
            Some((_, before)) if *before == value => return,
            Some((_, before)) => before.clone_from(&value),
            None => self.said.push((name, value.clone())),
        }
        self.tell(&format!("{name} {value}"));
    }

    fn viewport(&self) -> Viewport {
        let [width_px, height_px] = self.screen.size_px();
        Viewport { width_px, height_px }
    }

    fn view(&self) -> View {
        let Settings { tolerance_px, exaggeration, .. } = self.settings;
        self.rig.camera.view(self.viewport(), tolerance_px, exaggeration)
    }

    /// The ground at a place of the window.
    fn pick(&self, pointer: Option<[f64; 2]>) -> Option<Hit> {
        let [x, y] = pointer?;
        let viewport = self.viewport();
        let at = [x / f64::from(viewport.width_px), y / f64::from(viewport.height_px)];
        let camera = self.rig.camera;
        let ground = self.stage.ground();
        pick::cast(
            &ground,
            ground.spacing_m(),
            self.settings.exaggeration,
            camera.eye_m,
            camera.ray(at, viewport),
        )
    }

    /// What lies in the middle of the picture, or would.
    fn ahead_m(&self) -> glam::DVec3 {
        let [width, height] = self.screen.size_px().map(f64::from);
        match self.pick(Some([0.5 * width, 0.5 * height])) {
            Some(hit) => hit.at_m,
            None => {
                let [east_m, north_m] = self.stage.ground().extent_m();
                self.rig.camera.eye_m + self.rig.camera.axes()[2] * 0.25 * east_m.max(north_m)
            }
        }
    }

    /// The whole terrain, beside the panel.
    fn overview(&self) -> Camera {
        overview_beside_panel(&self.stage, &self.screen, &self.window, &self.settings)
    }

    fn pause(&mut self) {
        if let Some(player) = &mut self.player {
            player.pause();
        }
    }

    /// A frame, and when the next is due.
    pub(super) fn frame(&mut self) -> Next {
        if self.hidden {
            self.frame_at = None;
            return if self.ending { Next::End } else { Next::In(Duration::MAX) };
        }
        self.touched = false;
        let now = Instant::now();
        let passed = self.frame_at.map(|before| now - before);
        let spans_s = LONGEST_SPAN.map(|longest| passed.unwrap_or_default().min(longest).as_secs_f64());
        self.look_after_job();
        self.notes.retain(|note| note.until.is_none_or(|until| until > now));
        self.fly(spans_s);
        if let Some(recorder) = &mut self.recorder {
            recorder.push(spans_s[0], &self.rig.camera);
        }
        let pointer = self.hand.pointer.filter(|_| !self.overlay.has_pointer());
        self.under = self.pick(pointer);
        if let Some(hit) = &self.under {
            self.stage.scene.feed_mut().want_ground(hit.at_m.x, hit.at_m.y);
        }
        let mut layer = self.lay_out();
        let again = layer.again;
        self.show(&mut layer, passed, now);
        if self.plan.exit_after_frames.is_some_and(|frames| self.frames >= frames) {
            self.ending = true;
        }
        let counting = self.plan.exit_after_frames.is_some() || self.plan.lose_device_after_frames.is_some();
        let moving = self.rig.is_moving()
            || self.hand.is_dragging()
            || self.hand.is_flying()
            || self.recorder.is_some()
            || self.player.as_ref().is_some_and(Player::is_playing);
        self.tell_motion(moving);
        if self.ending {
            return Next::End;
        }
        if moving || self.unsettled || self.touched || counting || again.is_zero() {
            self.frame_at = Some(now);
            return Next::AtOnce;
        }
        self.frame_at = None;
        let news = self.notes.iter().filter_map(|note| note.until).min();
        let waits = [
            Some(again),
            // What cannot be read now is tried again.
            (self.job.is_some() || self.unshown || self.stage.scene.feed().lacks_pages()).then_some(LOOKS),
            news.map(|until| until.saturating_duration_since(now)),
        ];
        Next::In(waits.into_iter().flatten().min().unwrap_or(again))
    }

    fn tell_motion(&mut self, moving: bool) {
        let [width, height] = self.screen.size_px();
        let flying = self.rig.is_moving() || self.hand.is_dragging();
        self.tell_state("moving", flying.to_string());
        self.tell_state("size", format!("{width}x{height}"));
        self.tell_state("panel", self.settings.panel.to_string());
        self.tell_state("help", self.memory.help.to_string());
        self.tell_state("frozen", self.frozen.is_some().to_string());
        self.tell_state("style", self.settings.style.clone());
        self.tell_state("playing", self.player.as_ref().is_some_and(Player::is_playing).to_string());
        self.tell_state("recording", self.recorder.is_some().to_string());
        self.tell_state("full-screen", self.window.fullscreen().is_some().to_string());
        if !moving && !self.unsettled {
            let Camera { eye_m, yaw_deg, pitch_deg, .. } = self.rig.camera;
            let place = format!("{:.2} {:.2} {:.2} {yaw_deg:.3} {pitch_deg:.3}", eye_m.x, eye_m.y, eye_m.z);
            self.tell_state("at-rest", place);
        } else {
            self.said.retain(|(name, _)| *name != "at-rest");
        }
    }

    /// Moves the eye: by the flight that is played, or by hand.
    fn fly(&mut self, [span_s, played_s]: [f64; 2]) {
        let controls = self.hand.controls();
        if let Some(player) = &mut self.player
            && player.is_playing()
        {
            if controls.thrust == [0.0; 3] && !self.hand.is_dragging() {
                player.advance(played_s);
                self.rig.place(player.camera());
                return;
            }
            player.pause();
        }
        let (rig, exaggeration) = (&mut self.rig, self.settings.exaggeration);
        let span_s = if rig.is_gliding() { played_s } else { span_s };
        rig.advance(span_s, &controls, &self.stage.ground(), exaggeration);
    }

    /// Lays the panels out and grants their wishes.
    fn lay_out(&mut self) -> super::overlay::Layer {
        let before = self.settings.clone();
        let (mut settings, mut wishes) = (self.settings.clone(), Vec::new());
        let adapter = self.screen.gpu.capabilities.adapter.clone();
        let extent_m = self.stage.ground().extent_m();
        let job = self.job.as_ref().map(|job| {
            let (stage, part) = job.progress();
            (job.input.file_name().unwrap_or_default().to_string_lossy().into_owned(), stage, part)
        });
        let facts = Facts {
            terrain: &self.terrain_name,
            extent_m,
            adapter: &adapter,
            under: self.under,
            eye_m: self.rig.camera.eye_m.to_array(),
            speed_m_s: self.rig.speed_m_s,
            follow_m: self.rig.follow_m,
            circling: self.rig.circling.is_some(),
            frozen: self.frozen.is_some(),
            recorder: self.recorder.as_ref(),
            player: self.player.as_ref(),
            history: &self.history,
            job,
            notes: &self.notes,
        };
        let memory = &mut self.memory;
        let layer = self.overlay.lay_out(&self.window, |ui| {
            wishes.extend(panel::show(ui, &facts, &mut settings, memory));
        });
        self.settings = settings;
        wishes.into_iter().for_each(|wish| self.grant(wish));
        self.touched |= self.settings != before;
        self.follow_settings(&before);
        layer
    }

    /// What other settings mean beyond the picture.
    fn follow_settings(&mut self, before: &Settings) {
        let now = self.settings.exaggeration;
        if now != before.exaggeration {
            let rig = &mut self.rig;
            rig.exaggerate(&self.stage.ground(), before.exaggeration, now);
        }
        if self.settings.culling != before.culling {
            if let Err(error) = self.stage.set_culling(self.settings.culling(), &self.screen.gpu) {
                self.settings.culling.clone_from(&before.culling);
                self.trouble(format!("{error:#}"));
            }
            self.frozen = None;
        }
    }

    fn look_after_job(&mut self) {
        let Some(ended) = self.job.as_mut().and_then(Job::take) else { return };
        self.job = None;
        match ended {
            Ok(built) => {
                self.tell(&format!("built {}", built.path.display()));
                self.open_terrain(&built.path);
                if let Some(note) = built.note {
                    self.trouble(note);
                }
            }
            Err(words) => self.trouble(words),
        }
    }

    fn name_terrain(&mut self) {
        let path = self.stage.path();
        self.terrain_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.window.set_title(&format!("{} - Terrasoar", self.terrain_name));
    }
}

/// A rig that sees the whole terrain.
fn start(stage: &Stage, screen: &Screen, window: &Window, settings: &Settings) -> Rig {
    let camera = overview_beside_panel(stage, screen, window, settings);
    Rig::new(camera, &stage.ground())
}

/// The overview in what the panel leaves of the window.
fn overview_beside_panel(stage: &Stage, screen: &Screen, window: &Window, settings: &Settings) -> Camera {
    let [width_px, height_px] = screen.size_px();
    let panel_px = if settings.panel { panel::WIDTH * window.scale_factor() } else { 0.0 };
    let panel_px = panel_px.min(0.5 * f64::from(width_px));
    // Perspective makes the near side wider when the eye steps aside.
    let beside = Viewport { width_px: (0.94 * (f64::from(width_px) - panel_px)) as u32, height_px };
    let mut view = overview(stage.terrain(), settings.exaggeration, FOV_DEG, beside);
    // The eye steps aside by half the panel, as wide as that is in the middle of the terrain.
    let [east_m, north_m] = stage.ground().extent_m();
    let away_m = view.eye_m.distance(glam::DVec3::new(0.5 * east_m, 0.5 * north_m, 0.0));
    let m_a_px = 2.0 * away_m * (0.5 * view.vertical_fov_rad).tan() / f64::from(height_px);
    view.eye_m -= view.axes()[0] * (0.5 * panel_px * m_a_px);
    Camera::from(&view)
}
