//! What the eye has been doing, and what it is expected to keep doing.
//!
//! A course counts little of the way along it and all of the way off it (`super::clocks`). So it is worth taking while the eye keeps to it, and worth leaving soon.
//! It leads straight on, or along a circle, or a helix where the eye climbs in its turn. All words of one course expect the same of the eye: that its direction goes on turning as the course's does.
//! Invariant: nothing here decides a status. Courses only move the time at which a vertex is tested again. Cost: a few dozen operations a frame.

use crate::metric::Metric;
use crate::view::{ErrorMetric, View};
use glam::{DQuat, DVec3};
use terrasoar_layout::portable;

/// Share of the way along the course that is counted. A smaller one lets words last longer on course and shorter off it.
pub(crate) const RATE: f64 = 0.1;
/// That share for an eye that has kept to its course for some time, and the share of the way that may have gone off it: the less, the lower.
pub(crate) const STEADY_RATES: [(f64, f64); 2] = [(0.005, 0.003), (0.001, 0.0006)];
/// The same on a course that turns, or on the spot.
pub(super) const STEADY_CURVE_RATES: [(f64, f64); 2] = [(0.01, 0.003), (0.002, 0.0006)];
/// A course is left when more than this times its rate of the recent way was counted.
const LEAVE: f64 = 2.5;
/// Share of the newest frame in what has gone off the course of late: what is over for some forty frames counts no more.
pub(super) const LONG: f64 = 0.15;
/// A course is taken only if the recent way leads this straight.
const STRAIGHT: f64 = 0.9;
/// How far ahead of a bend its course points.
const LEAD_RAD: f64 = 0.12;
/// Share of the newest frame in what "recent" means.
const RECENT: f64 = 0.2;
/// Ways that turn by less a frame are straight.
const LEAST_BEND_RAD: f64 = 0.0005;
/// Ways that turn by more a frame are none.
const MOST_BEND_RAD: f64 = 0.2;
/// A view turns as the way does where its turn is no further from the way's than this share of that.
const ALIKE: f64 = 0.001;

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
    /// Unit vector it moves along now, or zero.
    pub direction: DVec3,
    /// The axis that the direction turns about by itself, as long as the radians it turns a metre of way; zero where it leads straight on.
    pub curve: DVec3,
    /// Unit vector it turns about, right-handed, or zero.
    pub axis: DVec3,
    /// Radians it turns about the axis a metre of way, if it has both.
    pub turn_per_m: f64,
    /// Share of the way along the direction, and of the angle about the axis, that is counted.
    pub rate: f64,
}

impl Default for Course {
    fn default() -> Self {
        Self { direction: DVec3::ZERO, curve: DVec3::ZERO, axis: DVec3::ZERO, turn_per_m: 0.0, rate: RATE }
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

/// How the way itself has been turning of late.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Bend {
    /// The newest step that led anywhere.
    step: DVec3,
    /// Radians a metre of way, as the length of the axis.
    curve: DVec3,
    length: f64,
}

impl Bend {
    /// Takes in the newest step.
    pub(super) fn follow(&mut self, step: DVec3) {
        let [before_m, now_m] = [self.step, step].map(DVec3::length);
        if now_m == 0.0 {
            return;
        }
        if before_m > 0.0 {
            // That of the circle through the places of three frames.
            let across_m = (self.step + step).length();
            let curve = self.step.cross(step) * (2.0 / (before_m * now_m * across_m));
            let curve = if across_m > 0.0 { curve } else { DVec3::ZERO };
            self.curve += RECENT * (curve - self.curve);
            self.length += RECENT * (curve.length() - self.length);
        }
        self.step = step;
    }

    /// The curve that it keeps, or zero if it keeps none.
    fn curve(&self) -> DVec3 {
        let bend_rad = self.curve.length() * self.step.length();
        let is_kept = self.curve.length() >= STRAIGHT * self.length;
        if is_kept && (LEAST_BEND_RAD..MOST_BEND_RAD).contains(&bend_rad) { self.curve } else { DVec3::ZERO }
    }
}

impl Course {
    /// The course that goes on as it has been going.
    pub(super) fn of(way: &Trend, turn: &Trend, bend: &Bend) -> Self {
        let (direction, axis, curve) = (way.direction(), turn.direction(), bend.curve());
        let turn_per_m = if axis == DVec3::ZERO { 0.0 } else { turn.length / way.length };
        if direction != DVec3::ZERO && curve != DVec3::ZERO {
            let step = bend.step;
            let direction = (turn_along(curve, 0.5 * step.length()) * step).normalize();
            // The view may well turn as the way does, as far as one can tell.
            let is_alike = (curve - axis * turn_per_m).length() <= ALIKE * curve.length();
            let (axis, turn_per_m) =
                if is_alike { (curve.normalize(), curve.length()) } else { (axis, turn_per_m) };
            return Self { direction, curve, axis, turn_per_m, rate: RATE };
        }
        if direction == DVec3::ZERO || axis == DVec3::ZERO {
            return Self { direction, axis, ..Self::default() };
        }
        // Who turns flies a bend: straight ahead of where the trend, which lags behind, will have led in a while.
        let lead = turn_about(axis, turn.length / RECENT + LEAD_RAD);
        Self { direction: (lead * direction).normalize(), axis, turn_per_m, ..Self::default() }
    }

    /// What a move uses up: metres, and radians on the planes.
    pub(super) fn counts(&self, last: &Pose, pose: &Pose) -> (f64, f64) {
        let turns = pose.normals != last.normals || self.turn_per_m > 0.0;
        (self.used_m(pose.eye_m - last.eye_m), if turns { self.used_rad(last, pose) } else { 0.0 })
    }

    /// The course as it was before a step that kept to it.
    pub(super) fn before(self, step: DVec3) -> Self {
        if self.curve == DVec3::ZERO {
            return self;
        }
        Self { direction: turn_along(self.curve, -step.length()) * self.direction, ..self }
    }

    /// Metres that a step uses up.
    pub(super) fn used_m(&self, step: DVec3) -> f64 {
        self.rate * self.along_m(step) + self.off_m(step)
    }

    /// Metres of a step that lead off the course.
    pub(super) fn off_m(&self, step: DVec3) -> f64 {
        (step - self.path(self.along_m(step))).length()
    }

    /// The way along the course that a step makes.
    fn along_m(&self, step: DVec3) -> f64 {
        let middle = if self.curve == DVec3::ZERO {
            self.direction
        } else {
            turn_along(self.curve, 0.5 * step.length()) * self.direction
        };
        let chord_m = step.dot(middle).max(0.0);
        let per_m = self.curve.length();
        if per_m == 0.0 { chord_m } else { portable::asin((0.5 * per_m * chord_m).min(1.0)) * (2.0 / per_m) }
    }

    /// Where a way of `way_m` metres along it leads.
    pub(super) fn path(&self, way_m: f64) -> DVec3 {
        let per_m = self.curve.length();
        if per_m == 0.0 {
            return self.direction * way_m;
        }
        let axis = self.curve / per_m;
        let up = axis * axis.dot(self.direction);
        let across = self.direction - up;
        let (sin, cos) = portable::sin_cos(0.5 * per_m * way_m);
        up * way_m + (across * cos + axis.cross(across) * sin) * (2.0 * sin / per_m)
    }

    /// Turns the direction as a step makes it turn.
    pub(super) fn lead_on(&mut self, step: DVec3) {
        if self.curve != DVec3::ZERO {
            self.direction =
                (turn_along(self.curve, self.along_m(step)) * self.direction).normalize_or_zero();
        }
    }

    /// The rate for an eye that has kept to such a course but for the share `off` of its way.
    pub(super) fn steady_rate(&self, off: f64) -> f64 {
        let [moves, curves, turns] = [self.direction, self.curve, self.axis].map(|v| v != DVec3::ZERO);
        let rates = match (moves, curves, turns) {
            (true, true, _) | (false, _, true) => STEADY_CURVE_RATES,
            (true, false, false) => STEADY_RATES,
            // A view that turns on a straight way will see it bend before long.
            _ => return RATE,
        };
        rates.iter().filter(|(_, most_off)| off <= *most_off).fold(RATE, |_, (rate, _)| *rate)
    }

    /// Whether it is of the same kind as another.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let kind = |course: &Self| [course.direction, course.curve, course.axis].map(|v| v == DVec3::ZERO);
        kind(self) == kind(other)
    }

    /// Radians that a turn uses up: a bound on how far the planes' normals are from where the counted angle would take them.
    pub(super) fn used_rad(&self, last: &Pose, pose: &Pose) -> f64 {
        let about = if self.turn_per_m > 0.0 {
            self.turn_per_m * self.along_m(pose.eye_m - last.eye_m)
        } else {
            portable::asin(last.turn_to(pose).dot(self.axis).clamp(0.0, 1.0))
        };
        let expected = turn_about(if about > 0.0 { self.axis } else { DVec3::Z }, about);
        let off = |i: usize| (pose.normals[i] - expected * last.normals[i]).length();
        self.rate * about + (0..4).map(off).fold(0.0, f64::max)
    }
}

/// The turn of a curve in `way_m` metres.
fn turn_along(curve: DVec3, way_m: f64) -> DQuat {
    let per_m = curve.length();
    turn_about(curve / per_m, per_m * way_m)
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
