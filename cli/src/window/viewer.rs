//! A frame of the window, and what keys and panels ask for.
//!
//! The order of a frame: move the eye, lay the panels out, do what they ask for, refine, draw, show. Errors become notes in the window.
//! A lost device is replaced, with a note. If it is lost twice in a row the program ends.

mod act;
mod draw;
mod edit;
mod hear;
mod lay_out;
mod sight;
mod tell;

use super::Plan;
use super::camera::Rig;
use super::coordinates::Coordinates;
use super::flights::{Player, Recorder};
use super::hand::Hand;
use super::history::History;
use super::job::Job;
use super::meter::Meter;
use super::overlay::Overlay;
use super::panel::{Memory, Note};
use super::pick::Hit;
use super::screen::Screen;
use super::settings::Settings;
use super::stage::Stage;
use super::tool::{Stroke, ToolBox};
use super::wake::Wake;
use super::workshop::Workshop;
use crate::lost::newest_header_is_lost;
use anyhow::Result;
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::flight::Flight;
use terrasoar::view::View;
use terrasoar_layout::read::terrain::Terrain;
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
    coordinates: Coordinates,
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
    tools: ToolBox,
    stroke: Option<Stroke>,
    /// Number of the stroke or rain that was begun last.
    strokes: u64,
    workshop: Workshop,
    rain: Option<edit::Rain>,
    /// How the rewriting of the file gets on, while it is under way.
    widening: Option<Arc<Meter>>,
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
        mut settings: Settings,
        terrain: Terrain,
        flight: Option<Flight>,
    ) -> Result<Self> {
        let screen = Screen::new(Arc::clone(&window), display.clone())?;
        let suited = settings.suit(&screen.gpu.capabilities);
        let overlay = Overlay::new(&window, &display, &screen);
        let stage = Stage::new(terrain, &screen.gpu, settings.culling(), plan.cache_bytes)?;
        let rig = sight::start(&stage, &screen, &window, &settings);
        let tools = edit::tools_for(&stage);
        let workshop = edit::workshop_for(&stage, &plan, &proxy);
        let mut viewer = Self {
            terrain_name: String::new(),
            coordinates: Coordinates::of(stage.terrain().header()),
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
            tools,
            stroke: None,
            strokes: 0,
            workshop,
            rain: None,
            widening: None,
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
        if let Some(words) = suited {
            viewer.news(words);
        }
        if let Some(words) = newest_header_is_lost(viewer.stage.terrain()) {
            viewer.news(words);
        }
        if let (Some(overlay), true) = (&viewer.plan.overlay, viewer.stage.terrain().base_has_grown()) {
            let words = format!(
                "{} was edited or draped after {} was begun; it is seen as it was then",
                viewer.plan.file.display(),
                overlay.display()
            );
            viewer.news(words);
        }
        if let Some(flight) = flight {
            let path = viewer.plan.flight.clone().unwrap_or_default();
            viewer.take_flight_of(flight, &path);
        }
        std::mem::take(&mut viewer.plan.drop).into_iter().for_each(|path| viewer.open(path));
        Ok(viewer)
    }

    /// The window.
    pub(super) fn window(&self) -> &Window {
        &self.window
    }

    /// Whether the window is to be closed, and nothing keeps it open.
    pub(super) fn may_end(&self) -> bool {
        self.ending && !self.is_widening()
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
            self.stage.ground.want_height(hit.at_m.x, hit.at_m.y);
        }
        self.look_after_edits();
        self.go_on_with_stroke();
        self.let_rain();
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
            || self.rain.is_some()
            || self.player.as_ref().is_some_and(Player::is_playing);
        self.tell_motion(moving);
        if self.may_end() {
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
            (self.job.is_some() || self.is_saving() || self.unshown || self.stage.ground.lacks_pages())
                .then_some(LOOKS),
            news.map(|until| until.saturating_duration_since(now)),
        ];
        Next::In(waits.into_iter().flatten().min().unwrap_or(again))
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
        rig.advance(span_s, &controls, &self.stage.heights(), exaggeration);
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
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.terrain_name = terrasoar_layout::printable::line(&name).into_owned();
        self.window.set_title(&format!("{} - Terrasoar", self.terrain_name));
    }
}
