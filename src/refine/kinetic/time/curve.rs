//! Certificates on a course that turns: the eye flies a circle, or a helix where it climbs in its turn.
//!
//! With u the course's direction, w the radians it turns a metre of way and a its axis, half the square of the eye's distance from a vertex, g(s) = D(s)^2 / 2, has
//!
//! ```text
//! g'(0) = -b,    g''(s) = sin^2 c + q cos(w s) + w f sin(w s)
//! ```
//!
//! b being the way to the foot of the vertex on the tangent u, c the climb, f the vertex's offset along that part of u that is square to a, and q = cos^2 c - offset . (w a x u). So up to a turn of T,
//! D^2 lies below a parabola D(0)^2 - 2 b s + k s^2 with k = sin^2 c + q + max(0, -q) T^2 / 12 + max(0, f) w T / 3, and above the one with
//! k = sin^2 c + q - max(0, q) T^2 / 12 - max(0, -f) w T / 3. On a straight course k = 1, for both.
//!
//! * Selected: where k is at least b^2 / D(0)^2, the root of the parabola is convex, and so the margin is concave: L = min(m(0), rho s1), s1 where the parabola above reaches R^2. A larger k is on the safe side.
//! * Not selected, k > b^2 / D(0)^2: the root is convex, and all is as on a straight course (`super::certificate`), with b / k in the place of b and rho / sqrt(k) in that of rho. Else the root lies above a concave one:
//!   L = min(m(0), rho s1), s1 where the parabola below reaches R^2.
//!
//! Each holds up to the turn T only, so that L is at most rho T / w.
//!
//! For longer turns: but for the climb, D^2 swings about a mean. D(s)^2 = D(0)^2 + A - A cos(w s) - C sin(w s) - 2 (b - f) s + sin^2 c s^2 with A = 2 q / w^2 and C = 2 f / w. The last two terms are left out, and the most
//! that they can be in half a turn is taken from what is left. So `super::swing` says how the rest comes to nothing.
//!
//! * Selected: m >= (R^2 - D^2) / (2 R), which swings.
//! * Not selected: where D^2 is above its mean, D is concave as D^2 is; below it m >= (D^2 - R^2) / (D + R), where D is at most the root of the mean. So the claim of `super::swing` holds with a slope of rho times that
//!   root plus R, and with the margin (D(0)^2 - R^2) / (D(0) + R), which is m(0) where the eye does not climb.
//!
//! Besides, in whole turns D is at least, and at the most, what it is at the ends of its swing: with the margin m1 there, and the climb sin c a metre, L = m1 rho / max(rho, sin c).
//!
//! Planes that turn as the way does see the vertex turn about one axis: a plane's distance bends by d w^2 + w, d being the distance from the axis through the eye; where they turn otherwise, by the difference more. And it
//! swings about the circle's centre (`super::certificate::planes`).
//!
//! Invariant: as for straight courses, rounded towards a shorter life. Cost: five square roots.

use super::course::Course;
use super::swing::{Swing, TINY};
use std::f64::consts::PI;

/// The turn that parabolas bound, in radians.
const TURN_RAD: f64 = 0.35;
/// A bound on the error of squares, relative to them.
const SQUARE_ERROR: f64 = 1.0 / (1u64 << 48) as f64;

/// A course's curve.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Curve {
    /// Radians a metre of way, and of what that is one.
    pub per_m: f64,
    pub radius_m: f64,
    /// What the direction grows by a metre of way: the curve x direction.
    pub inward_per_m: [f64; 3],
    /// The part of the direction that is square to the axis.
    pub across: [f64; 3],
    across2: f64,
    /// Metres of a half turn, and the climb on it.
    pub half_m: f64,
    pub half_climb_m: f64,
    /// Share of a margin over whole turns that counts while the eye climbs.
    share: f64,
}

/// A vertex as the eye sees it now.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    /// Way along the direction to its foot.
    pub foot_m: f64,
    pub distance_m: f64,
    pub distance2: f64,
    pub reach_m: f64,
    /// Its offset . [`Curve::inward_per_m`].
    pub inward: f64,
    /// Its offset . [`Curve::across`].
    pub across_m: f64,
}

impl Curve {
    pub(super) fn of(course: &Course) -> Self {
        let per_m = course.curve.length();
        if per_m == 0.0 {
            return Self::default();
        }
        let axis = course.curve / per_m;
        let climb = axis.dot(course.direction).abs();
        let across = course.direction - axis * axis.dot(course.direction);
        Self {
            per_m,
            radius_m: 1.0 / per_m,
            inward_per_m: course.curve.cross(course.direction).to_array(),
            across: across.to_array(),
            across2: across.length_squared(),
            half_m: PI / per_m,
            half_climb_m: climb * PI / per_m,
            share: course.rate / course.rate.max(climb),
        }
    }

    /// Way along the course on which a selected vertex stays so, rounded down, and a margin: up to there its own margin is that, less `least_slope` a metre, or better.
    #[inline(always)]
    pub(super) fn chord_m(&self, seen: &Seen, least_slope: f64) -> (f64, f64) {
        let reach2 = seen.reach_m * seen.reach_m;
        let within2 = (reach2 - seen.distance2 - (reach2 + seen.distance2) * SQUARE_ERROR).max(0.0);
        let (b, q) = (seen.foot_m, self.across2 - seen.inward);
        let line = b * b / seen.distance2.max(TINY);
        let k = 1.0 - seen.inward
            + (-q).max(0.0) * (TURN_RAD * TURN_RAD / 12.0)
            + self.per_m * seen.across_m.max(0.0) * (TURN_RAD / 3.0);
        let k = k.max(line).max(TINY) + (k.abs() + line) * SQUARE_ERROR;
        let root = (b * b + k * within2).sqrt();
        let (part, whole) = if b > 0.0 { (b + root, k) } else { (within2, (root - b).max(TINY)) };
        let short_m = (part / whole).min(TURN_RAD / self.per_m);
        // The climb may take the eye away from the vertex.
        let (swing2, sine2, error2) = self.swing2(seen);
        let climb2 = 2.0 * (seen.across_m - b).max(0.0) * self.half_m + self.half_climb_m * self.half_climb_m;
        let now = reach2 - seen.distance2 - error2 - climb2;
        let swing = Swing { now, opposite: now - 2.0 * swing2, grows: sine2 };
        let long_m = swing.turn_rad(2.0 * seen.reach_m * least_slope / self.per_m) / self.per_m;
        let (is_long, left_m) = (long_m > short_m, seen.reach_m - seen.distance_m);
        // Field by field, so that no branch comes of it.
        (if is_long { long_m } else { short_m }, if is_long { now / (2.0 * seen.reach_m) } else { left_m })
    }

    /// The margin of a selected vertex that stays selected in a whole turn, or less than nothing.
    #[inline(always)]
    pub(super) fn always_m(&self, seen: &Seen) -> f64 {
        let farthest2 = self.extreme2(seen, 1.0);
        self.share * (seen.reach_m - farthest2.max(0.0).sqrt())
    }

    /// The margin of a vertex that is not selected.
    #[inline(always)]
    pub(super) fn outside_m(&self, seen: &Seen, rate: f64) -> f64 {
        let Seen { foot_m: b, distance_m, distance2, reach_m, .. } = *seen;
        let reach2 = reach_m * reach_m;
        let now_m = distance_m - reach_m;
        let beyond2 = (distance2 - reach2 - (reach2 + distance2) * SQUARE_ERROR).max(0.0);
        let (line, q) = (b * b / distance2.max(TINY), self.across2 - seen.inward);
        let k = 1.0
            - seen.inward
            - q.max(0.0) * (TURN_RAD * TURN_RAD / 12.0)
            - self.per_m * (-seen.across_m).max(0.0) * (TURN_RAD / 3.0);
        let k = k - (1.0 + k.abs() + seen.inward.abs()) * SQUARE_ERROR;
        let convex = k > line;
        let above = k.max(TINY);
        let off2 = (distance2 - b * b / above - distance2 * SQUARE_ERROR).max(0.0);
        let across2 = (1.0 - rate * rate / above).max(0.0);
        let enters = off2 <= across2 * reach2;
        let square = if enters { (reach2 - off2) / above } else { across2 * off2 };
        let root = square.max(0.0).sqrt();
        let foot_m = rate * b / above;
        let past_m = if enters { foot_m - rate * root } else { foot_m + root - reach_m };
        // On the way along a line or a bow, the first place at the distance that selects.
        let nears = b + (b * b - k * beyond2).max(0.0).sqrt();
        let straight_m = if nears > TINY { rate * beyond2 / nears } else { f64::INFINITY };
        let falls_slowly = b <= rate * distance_m;
        let convex_m = if falls_slowly { now_m } else { past_m };
        let ahead_m = if convex { convex_m } else { straight_m };
        let short_m = ahead_m.min(rate * TURN_RAD / self.per_m);
        // The climb may take the eye nearer to the vertex.
        let (swing2, sine2, error2) = self.swing2(seen);
        let now = distance2 - reach2 - error2 - 2.0 * (b - seen.across_m).max(0.0) * self.half_m;
        let swing = Swing { now, opposite: now + 2.0 * swing2, grows: -sine2 };
        // Below the mean of its square, the distance is at most the mean's root, which is no more than this.
        let mean_m = distance_m + 0.5 * swing2 / distance_m.max(TINY);
        let long_m = rate * swing.turn_rad((mean_m + reach_m) * rate / self.per_m) / self.per_m;
        let long_m = long_m.min(now / (distance_m + reach_m).max(TINY));
        let nearest2 = self.extreme2(seen, -1.0);
        let never_m = self.share * (nearest2.max(0.0).sqrt() - reach_m);
        short_m.max(long_m).max(never_m).min(now_m)
    }

    /// How the square of the distance swings, the climb left out: it is distance2 + A - A cos t - C sin t. A, C and the error of it all.
    #[inline(always)]
    fn swing2(&self, seen: &Seen) -> (f64, f64, f64) {
        let per_m2 = self.per_m * self.per_m;
        let swing2 = 2.0 * (self.across2 - seen.inward) / per_m2;
        let sine2 = 2.0 * seen.across_m / self.per_m;
        let reach2 = seen.reach_m * seen.reach_m;
        let error2 =
            (seen.distance2 + reach2 + swing2.abs() + sine2.abs() + 1.0 / per_m2) * (64.0 * SQUARE_ERROR);
        (swing2, sine2, error2)
    }

    /// The squared distance that the eye has at the most in a whole turn without the climb, with a `sign` of 1, or at the least, with -1.
    #[inline(always)]
    fn extreme2(&self, seen: &Seen, sign: f64) -> f64 {
        let (q, sine) = (self.across2 - seen.inward, self.per_m * seen.across_m);
        let swing = (q * q + sine * sine).sqrt();
        let per_m2 = self.per_m * self.per_m;
        let error2 = (seen.distance2 + (q.abs() + swing + 1.0) / per_m2) * (64.0 * SQUARE_ERROR);
        seen.distance2 + 2.0 * (q + sign * swing) / per_m2 + sign * error2
    }
}

#[cfg(test)]
mod tests {
    use super::super::course::{Course, RATE};
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    fn direction() -> impl Strategy<Value = DVec3> {
        (-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0)
            .prop_map(|(x, y, z)| (DVec3::new(x, y, z) + DVec3::X * 1e-3).normalize())
    }

    fn seen(curve: &Curve, course: &Course, offset_m: DVec3, reach_m: f64) -> Seen {
        let along = |[x, y, z]: [f64; 3]| offset_m.dot(DVec3::new(x, y, z));
        Seen {
            foot_m: offset_m.dot(course.direction),
            distance_m: offset_m.length(),
            distance2: offset_m.length_squared(),
            reach_m,
            inward: along(curve.inward_per_m),
            across_m: along(curve.across),
        }
    }

    /// Of a way of that many metres in steps: how far the eye is then from a vertex.
    fn distances(course: &Course, offset_m: DVec3, way_m: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        (0..=400).map(move |i| {
            let way_m = way_m * f64::from(i) / 400.0;
            (way_m, (offset_m - course.path(way_m)).length())
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]
        /// No margin is overrated, anywhere on its way; and margins are not a small part of what they could be.
        #[test]
        fn margins_hold_along_the_curve(
            forward in direction(), about in direction(), is_level in prop::bool::weighted(0.4), radius_m in 5.0f64..20_000.0,
            towards in direction(), is_flat in prop::bool::weighted(0.4), distance in -2.0f64..3.0, closeness in 0.5f64..2.0, meets in prop::option::weighted(0.5, (0.0f64..6.0, -0.02f64..0.02)),
            rate in prop_oneof![Just(RATE), 0.001f64..0.3],
        ) {
            let about = if is_level { (about - forward * about.dot(forward)).normalize_or(DVec3::Z) } else { about };
            let towards = if is_flat { (towards - about * towards.dot(about)).normalize_or(forward) } else { towards };
            let course = Course { direction: forward, curve: about / radius_m, rate, ..Default::default() };
            let curve = Curve::of(&course);
            let offset_m = towards * radius_m * distance.exp();
            let distance_m = offset_m.length();
            // A reach that the eye comes by before long, or any.
            let reach_m = meets.map_or(distance_m * closeness, |(turn, off)| {
                (offset_m - course.path(turn * radius_m)).length() * (1.0 + off)
            });
            let seen = seen(&curve, &course, offset_m, reach_m);
            let selected = distance_m <= reach_m;
            let now_m = (reach_m - distance_m).abs();
            let margin_m = if selected {
                let (chord_m, left_m) = curve.chord_m(&seen, rate);
                now_m.min(left_m.min(rate * chord_m).max(curve.always_m(&seen)))
            } else {
                curve.outside_m(&seen, rate)
            };
            let sign = if selected { 1.0 } else { -1.0 };
            let error_m = 1e-9 * (distance_m + reach_m + radius_m);
            for (way_m, distance_m) in distances(&course, offset_m, margin_m.max(0.0) / rate) {
                let left_m = margin_m - rate * way_m;
                prop_assert!(sign * (reach_m - distance_m) >= left_m - error_m, "at {way_m} of {margin_m} / {rate}");
            }
        }
    }
}
