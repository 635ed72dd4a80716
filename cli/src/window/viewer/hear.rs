//! Events of the window: changes of the window itself, keys and the mouse. Each becomes a state or an action for the next frame.

use super::Viewer;
use crate::window::keys;
use std::time::Instant;
use winit::event::{MouseButton, WindowEvent};
use winit::keyboard::KeyCode;

impl Viewer {
    /// The overlay hears an event first.
    pub(in crate::window) fn overlay_hears(&mut self, event: &WindowEvent) -> bool {
        self.overlay.hear(&self.window, event)
    }

    /// The window has another size.
    pub(in crate::window) fn resize(&mut self, width: u32, height: u32) {
        self.hidden = width == 0 || height == 0;
        self.screen.resize(width, height);
        self.touched = true;
    }

    /// The window is out of sight, or seen again.
    pub(in crate::window) fn hide(&mut self, hidden: bool) {
        self.hidden = hidden;
        self.touched |= !hidden;
    }

    /// A key goes down or up.
    pub(in crate::window) fn key(&mut self, code: KeyCode, down: bool, repeat: bool) {
        if down && self.overlay.is_typing() {
            return;
        }
        self.touched = true;
        self.hand.key(code, down);
        if down
            && !repeat
            && let Some(action) = keys::action(code, self.hand.ctrl)
        {
            self.act(action);
        }
    }

    /// A mouse button goes down or up.
    pub(in crate::window) fn button(&mut self, button: MouseButton, down: bool) {
        self.touched = true;
        if !down {
            // What was dragged is still to be turned by, about its own pivot.
            self.hand.lift(button);
            if button == MouseButton::Left {
                self.end_stroke();
            }
            return;
        }
        if self.overlay.has_pointer() {
            return;
        }
        if button == MouseButton::Left && self.begin_stroke() {
            self.hand.hold(button);
            return;
        }
        let double = self.hand.press(button, Instant::now());
        let hit = self.pick(self.hand.pointer);
        if button == MouseButton::Right {
            self.rig.pivot = Some(hit.map_or_else(|| self.ahead_m(), |hit| hit.at_m));
        } else if double && let Some(hit) = hit {
            self.pause();
            self.rig.go_to(hit.at_m, (0.35 * hit.distance_m).max(30.0));
        }
    }

    /// The wheel turns by lines.
    pub(in crate::window) fn wheel(&mut self, lines: f64) {
        if !self.overlay.has_pointer() {
            self.rig.change_speed(1.25f64.powf(lines.clamp(-20.0, 20.0)));
            self.touched = true;
        }
    }
}
