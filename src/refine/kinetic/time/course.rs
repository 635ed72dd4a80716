//! What the eye has been doing, and what it is expected to keep doing.
//!
//! A course counts little of the way along it and all of the way off it (`super::clocks`). So it is worth taking while the eye keeps to it, and worth leaving soon.
//! Invariant: nothing here decides a status. Courses only move the time at which a vertex is tested again. Cost: a few dozen operations a frame.

use crate::metric::Metric;
use crate::view::{ErrorMetric, View};
use glam::{DQuat, DVec3};
use terrasoar_layout::portable;

/// Share of the way along the course that is counted. A smaller one lets words last longer on course and shorter off it.
pub(crate) const RATE: f64 = 0.1;
/// That share on the course of an eye that has flown as straight as can be for some time.
pub(crate) const STEADY_RATE: f64 = 0.005;
/// A course is left when more than this times its rate of the recent way was counted.
const LEAVE: f64 = 2.5;
/// A way is steady while no more than this share of it went off the course.
pub(super) const STEADY: f64 = 0.003;
/// Share of the newest frame in what has gone off the course of late: what is over for some forty frames counts no more.
pub(super) const LONG: f64 = 0.15;
/// A course is taken only if the recent way leads this straight.
const STRAIGHT: f64 = 0.9;
/// How far ahead of a bend its course points.
const LEAD_RAD: f64 = 0.12;
/// Share of the newest frame in what "recent" means.
const RECENT: f64 = 0.2;
/// What of a view moves the clocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    pub eye_m: DVec3,
    /// Right, up and forward.
    pub axes: [DVec3; 3],
    pub normals: [DVec3; 4],
    pub nu: f64,
    pub exaggeration: f64,
    /// A change of it leaves no certificate.
    pub metric: ErrorMetric,
}

impl Pose {
    /// That of a view, whose metric is given.
    pub(crate) fn of(view: &View, metric: &Metric) -> Self {
        Self {
            eye_m: view.eye_m,
            axes: view.axes(),
            normals: metric.normals().map(DVec3::from_array),
            nu: metric.nu(),
            exaggeration: metric.exaggeration(),
            metric: metric.kind(),
        }
    }
}

/// What the eye is expected to keep doing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Course {
    /// Unit vector it moves along, or zero.
    pub direction: DVec3,
    /// Unit vector it turns about, right-handed, or zero.
    pub axis: DVec3,
    /// Radians it turns about the axis a metre of way, if it has both.
    pub turn_per_m: f64,
    /// Share of the way along the direction, and of the angle about the axis, that is counted.
    pub rate: f64,
}

impl Default for Course {
    fn default() -> Self {
        Self { direction: DVec3::ZERO, axis: DVec3::ZERO, turn_per_m: 0.0, rate: RATE }
    }
}

/// How something has been going of late.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Trend {
    vector: DVec3,
    length: f64,
    pub(super) used: f64,
}

impl Trend {
    /// Takes in the newest step, of which the current course counts `used`.
    pub(super) fn follow(&mut self, step: DVec3, used: f64) {
        let length = step.length();
        if length == 0.0 {
            return;
        }
        // The first step, and one that dwarfs all before it, is all there is to go by.
        let share = if length > 16.0 * self.length { 1.0 } else { RECENT };
        self.vector += share * (step - self.vector);
        self.length += share * (length - self.length);
        self.used += share * (used - self.used);
    }

    /// Whether a course of that rate misses much of what happens.
    pub(super) fn is_off(&self, rate: f64) -> bool {
        self.used > LEAVE * rate * self.length
    }

    /// The direction it keeps, or zero if it keeps none.
    fn direction(&self) -> DVec3 {
        if self.vector.length() >= STRAIGHT * self.length {
            self.vector.normalize_or_zero()
        } else {
            DVec3::ZERO
        }
    }
}

impl Course {
    /// The course that goes on as it has been going.
    pub(super) fn of(way: &Trend, turn: &Trend) -> Self {
        let (direction, axis) = (way.direction(), turn.direction());
        if direction == DVec3::ZERO || axis == DVec3::ZERO {
            return Self { direction, axis, ..Self::default() };
        }
        // Who turns flies a bend: straight ahead of where the trend, which lags behind, will have led in a while.
        let lead = turn_about(axis, turn.length / RECENT + LEAD_RAD);
        Self {
            direction: (lead * direction).normalize(),
            axis,
            turn_per_m: turn.length / way.length,
            rate: RATE,
        }
    }

    /// Metres that a step uses up.
    pub(super) fn used_m(&self, step: DVec3) -> f64 {
        self.rate * step.dot(self.direction).max(0.0) + self.off_m(step)
    }

    /// Metres of a step that lead off the course.
    pub(super) fn off_m(&self, step: DVec3) -> f64 {
        let along = step.dot(self.direction).max(0.0);
        (step - self.direction * along).length()
    }

    /// Whether it leads on without a turn.
    pub(super) fn is_straight(&self) -> bool {
        self.direction != DVec3::ZERO && self.axis == DVec3::ZERO
    }

    /// Radians that a turn uses up: a bound on how far the planes' normals are from where the counted angle would take them.
    pub(super) fn used_rad(&self, last: &Pose, pose: &Pose) -> f64 {
        let about = if self.turn_per_m > 0.0 {
            self.turn_per_m * (pose.eye_m - last.eye_m).dot(self.direction).max(0.0)
        } else {
            portable::asin(last.turn_to(pose).dot(self.axis).clamp(0.0, 1.0))
        };
        let expected = turn_about(if about > 0.0 { self.axis } else { DVec3::Z }, about);
        let off = |i: usize| (pose.normals[i] - expected * last.normals[i]).length();
        self.rate * about + (0..4).map(off).fold(0.0, f64::max)
    }
}

/// The turn by an angle in radians about an axis of length 1.
fn turn_about(axis: DVec3, angle_rad: f64) -> DQuat {
    let (sin, cos) = portable::sin_cos(0.5 * angle_rad);
    let [x, y, z] = (axis * sin).to_array();
    DQuat::from_xyzw(x, y, z, cos)
}

impl Pose {
    /// The turn to another pose: its axis, as long as the sine of its angle.
    pub(super) fn turn_to(&self, other: &Self) -> DVec3 {
        0.5 * (0..3).map(|i| self.axes[i].cross(other.axes[i])).sum::<DVec3>()
    }
}
