//! The way from one camera to another. It starts and ends slowly, and rises in between, over ground that may lie on the way.
//!
//! The camera is a function of the time passed, so the way is the same at any frame rate.

use super::Camera;
use glam::DVec3;

/// Seconds of the shortest and the longest way.
const SPAN_S: [f64; 2] = [0.6, 2.5];

/// A way that has been begun.
#[derive(Debug, Clone, Copy)]
pub(super) struct Glide {
    from: Camera,
    to: Camera,
    span_s: f64,
    passed_s: f64,
}

impl Glide {
    /// A way between two cameras; farther ones take longer.
    pub(super) fn new(from: Camera, to: Camera) -> Self {
        let far = from.eye_m.distance(to.eye_m) / (1.0 + from.eye_m.distance(to.eye_m) + 2000.0);
        Self { from, to, span_s: SPAN_S[0] + far * (SPAN_S[1] - SPAN_S[0]), passed_s: 0.0 }
    }

    /// The camera after `span_s` seconds more, and whether that is the end.
    pub(super) fn advance(&mut self, span_s: f64) -> (Camera, bool) {
        self.passed_s += span_s;
        if self.passed_s >= self.span_s {
            return (self.to, true);
        }
        let t = self.passed_s / self.span_s;
        let eased = t * t * (3.0 - 2.0 * t);
        let rise_m = 0.3 * eased * (1.0 - eased) * self.from.eye_m.distance(self.to.eye_m);
        let mut camera = between(&self.from, &self.to, eased);
        camera.eye_m += DVec3::Z * rise_m;
        (camera, false)
    }
}

/// A camera between two, angles the shorter way round.
pub(crate) fn between(a: &Camera, b: &Camera, t: f64) -> Camera {
    let angle = |a: f64, b: f64| a + ((b - a + 180.0).rem_euclid(360.0) - 180.0) * t;
    Camera {
        eye_m: a.eye_m.lerp(b.eye_m, t),
        yaw_deg: angle(a.yaw_deg, b.yaw_deg),
        pitch_deg: a.pitch_deg + (b.pitch_deg - a.pitch_deg) * t,
        roll_deg: angle(a.roll_deg, b.roll_deg),
        vertical_fov_deg: a.vertical_fov_deg + (b.vertical_fov_deg - a.vertical_fov_deg) * t,
    }
}
