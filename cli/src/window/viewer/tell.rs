//! What the viewer says: notes in the window, and lines on standard output for tests that drive it.

use super::Viewer;
use crate::window::camera::Camera;
use crate::window::flights::Player;
use crate::window::panel::Note;
use std::io::Write;

impl Viewer {
    /// Says in the window what went wrong.
    pub(in crate::window) fn trouble(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.tell(&format!("trouble {text}"));
        if self.notes.last().is_none_or(|note| note.text != text) {
            self.notes.push(Note::trouble(text));
        }
        self.touched = true;
    }

    /// Says in the window what went well.
    pub(super) fn news(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.tell(&format!("news {text}"));
        self.notes.push(Note::news(text));
        self.touched = true;
    }

    /// Writes to standard output what happened, for tests that drive the window. Errors are ignored.
    pub(super) fn tell(&self, line: &str) {
        if self.plan.narrate {
            let mut out = std::io::stdout().lock();
            let line = terrasoar_layout::printable::line(line);
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

    /// Tells what state the window is in, where that is news.
    pub(super) fn tell_motion(&mut self, moving: bool) {
        let [width, height] = self.screen.size_px();
        let flying = self.rig.is_moving() || self.hand.is_dragging();
        self.tell_state("moving", flying.to_string());
        self.tell_state("size", format!("{width}x{height}"));
        self.tell_state("panel", self.settings.panel.to_string());
        self.tell_state("help", self.memory.help.to_string());
        self.tell_state("frozen", self.frozen.is_some().to_string());
        self.tell_state("tolerance", format!("{} px", self.settings.tolerance_px()));
        self.tell_state("metric", self.settings.metric.clone());
        self.tell_state("style", self.settings.style.clone());
        self.tell_state("playing", self.player.as_ref().is_some_and(Player::is_playing).to_string());
        self.tell_state("tool", self.tools.tool.name().into());
        self.tell_state("raining", self.rain.is_some().to_string());
        self.tell_state("recording", self.recorder.is_some().to_string());
        self.tell_state("full-screen", self.window.fullscreen().is_some().to_string());
        if moving || self.unsettled {
            self.said.retain(|(name, _)| *name != "at-rest");
        } else if self.workshop.in_flight() == 0 {
            // What is ordered and not seen yet may make another picture.
            let Camera { eye_m, yaw_deg, pitch_deg, .. } = self.rig.camera;
            let place = format!("{:.2} {:.2} {:.2} {yaw_deg:.3} {pitch_deg:.3}", eye_m.x, eye_m.y, eye_m.z);
            self.tell_state("at-rest", place);
        }
    }
}
