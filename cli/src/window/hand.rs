//! What the user's hands do: keys held, buttons dragged, and whether a press is a click or a drag.
//!
//! A drag belongs to the panel or terrain over which it began. A frame takes the movement since the frame before.

use super::camera::Controls;
use super::keys;
use std::collections::BTreeSet;
use std::time::{Duration, Instant};
use winit::event::MouseButton;
use winit::keyboard::KeyCode;

/// Degrees a pixel of looking around.
const LOOK_DEG_PX: f64 = 0.15;
/// Degrees a pixel of going round.
const ORBIT_DEG_PX: f64 = 0.25;
/// How soon a click must follow another, and how near, to be a double click.
const DOUBLE: (Duration, f64) = (Duration::from_millis(400), 6.0);

/// Keys and buttons.
#[derive(Debug, Default)]
pub(crate) struct Hand {
    held: BTreeSet<KeyCode>,
    /// Whether Shift is held.
    pub shift: bool,
    /// Whether Ctrl is held.
    pub ctrl: bool,
    /// The pointer in pixels from the top left, while it is in the window.
    pub pointer: Option<[f64; 2]>,
    dragging: Option<MouseButton>,
    /// Held by a tool.
    working: Option<MouseButton>,
    look_px: [f64; 2],
    orbit_px: [f64; 2],
    clicked: Option<(Instant, [f64; 2])>,
}

impl Hand {
    /// A key goes down or up.
    pub(crate) fn key(&mut self, code: KeyCode, down: bool) {
        if down && !self.ctrl {
            self.held.insert(code);
        } else {
            self.held.remove(&code);
        }
    }

    /// Nothing is held any more, as when the window is left.
    pub(crate) fn release(&mut self) {
        self.held.clear();
        (self.dragging, self.working) = (None, None);
        (self.shift, self.ctrl) = (false, false);
    }

    /// The pointer moves.
    pub(crate) fn move_to(&mut self, to: [f64; 2]) {
        let dragged_px = match self.dragging {
            Some(MouseButton::Left) => Some(&mut self.look_px),
            Some(MouseButton::Right) => Some(&mut self.orbit_px),
            _ => None,
        };
        if let (Some(from), Some(dragged_px)) = (self.pointer, dragged_px) {
            *dragged_px = [0, 1].map(|i| dragged_px[i] + to[i] - from[i]);
        }
        self.pointer = Some(to);
    }

    /// A button goes down over the terrain; says whether that is a double click.
    pub(crate) fn press(&mut self, button: MouseButton, now: Instant) -> bool {
        self.dragging.get_or_insert(button);
        let (Some(at), true) = (self.pointer, button == MouseButton::Left) else { return false };
        let is_second = self.clicked.take().is_some_and(|(when, where_)| {
            now.duration_since(when) <= DOUBLE.0 && (at[0] - where_[0]).hypot(at[1] - where_[1]) <= DOUBLE.1
        });
        if !is_second {
            self.clicked = Some((now, at));
        }
        is_second
    }

    /// A button goes down that a tool has taken: it drags nothing.
    pub(crate) fn hold(&mut self, button: MouseButton) {
        self.working = Some(button);
    }

    /// A button goes up.
    pub(crate) fn lift(&mut self, button: MouseButton) {
        for held in [&mut self.dragging, &mut self.working] {
            if *held == Some(button) {
                *held = None;
            }
        }
    }

    /// Whether a button is held that went down over the terrain.
    pub(crate) fn is_dragging(&self) -> bool {
        self.dragging.is_some() || self.working.is_some()
    }

    /// Whether something is held that flies.
    pub(crate) fn is_flying(&self) -> bool {
        self.held.iter().any(|code| keys::thrust(*code).is_some())
    }

    /// What is held, and what was dragged since the last time.
    pub(crate) fn controls(&mut self) -> Controls {
        let mut controls = Controls { fast: self.shift, ..Controls::default() };
        for thrust in self.held.iter().filter_map(|code| keys::thrust(*code)) {
            for (sum, part) in controls.thrust.iter_mut().zip(thrust) {
                *sum = (*sum + part).clamp(-1.0, 1.0);
            }
        }
        let degrees = |px: &mut [f64; 2], scale: f64| {
            let [x, y] = std::mem::take(px);
            [x * scale, -y * scale]
        };
        controls.look_deg = degrees(&mut self.look_px, LOOK_DEG_PX);
        controls.orbit_deg = degrees(&mut self.orbit_px, ORBIT_DEG_PX);
        controls
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drags_turn_and_count_once() {
        let mut hand = Hand::default();
        hand.move_to([10.0, 10.0]);
        hand.move_to([50.0, 10.0]);
        assert_eq!(hand.controls(), Controls::default(), "no button, no drag");
        hand.press(MouseButton::Left, Instant::now());
        hand.move_to([60.0, 30.0]);
        hand.lift(MouseButton::Left);
        let look = hand.controls().look_deg;
        assert!(look[0] > 0.0 && look[1] < 0.0, "to the right and down: {look:?}");
        assert_eq!(hand.controls(), Controls::default());
        hand.press(MouseButton::Right, Instant::now());
        hand.move_to([70.0, 30.0]);
        assert!(hand.controls().orbit_deg[0] > 0.0);
    }

    #[test]
    fn two_clicks_in_one_place_are_a_double_click() {
        let (mut hand, start) = (Hand::default(), Instant::now());
        let ms = |n| start + Duration::from_millis(n);
        hand.move_to([10.0, 10.0]);
        assert!(!hand.press(MouseButton::Left, ms(0)));
        hand.lift(MouseButton::Left);
        assert!(hand.press(MouseButton::Left, ms(200)));
        assert!(!hand.press(MouseButton::Left, ms(300)), "a third begins anew");
        assert!(!hand.press(MouseButton::Left, ms(900)), "too late");
        hand.move_to([90.0, 10.0]);
        assert!(!hand.press(MouseButton::Left, ms(1000)), "too far");
        assert!(!hand.press(MouseButton::Right, ms(1010)));
    }

    #[test]
    fn keys_add_up_until_they_are_let_go() {
        let mut hand = Hand::default();
        hand.key(KeyCode::KeyW, true);
        hand.key(KeyCode::ArrowUp, true);
        hand.key(KeyCode::KeyA, true);
        assert_eq!(hand.controls().thrust, [-1.0, 1.0, 0.0]);
        hand.key(KeyCode::KeyD, true);
        assert_eq!(hand.controls().thrust, [0.0, 1.0, 0.0]);
        hand.release();
        assert_eq!(hand.controls().thrust, [0.0; 3]);
        hand.ctrl = true;
        hand.key(KeyCode::KeyQ, true);
        assert_eq!(hand.controls().thrust, [0.0; 3], "Ctrl+Q does not sink");
    }
}
