//! Certificates of vertices whose errors are measured along the line of sight: selected where the eye is inside a tube of radius R about a level ring of radius h around
//! the vertex (`crate::metric`).
//!
//! The eye's distance from the ring is rho^2 = D^2 - 2 h g + h^2, D being its distance from the vertex and g that over the ground. Along a course D^2 is a parabola and g is convex. With a
//! line l(s) = g(0) + c s in the place of g, rho^2 is the parabola (s - b')^2 + rho(0)^2 - b'^2 with b' = b + h c, b the way along the course to the foot of the vertex: all that is known of spheres
//! (`super::certificate`) holds for it, b' in the place of b, rho in that of D, R in that of the reach.
//!
//! * Selected: the margin must not be overrated, so l must not be above g. No tangent of g is. Each stands for a sphere of radius R around a point of the ring, which lies in the tube and
//!   touches its rim. Two are taken: the nearest to the eye, and the nearest to where the course leaves the ball of all directions (the tube's outer rim). Up to the place s' where the course is as far from both points the first vouches,
//!   from there on the second: margins are concave, so L = min(m(0), m(s') + rho s', rho s2), s2 where it leaves the second.
//! * Not selected: l must not be below g. The line of slope w never is, w being the course's speed over the ground. Until the course passes the vertex at the side, S metres on, neither is
//!   the chord to there; so its certificate holds for S metres at most. Neither is D: outside of the ball of all directions nothing is selected. The longest of the three counts.
//!
//! Invariant: as for spheres, rounded towards a shorter life. Cost: some eight square roots.

use crate::metric::Sighting;

/// A bound on the error of squares, relative to them.
const SQUARE_ERROR: f64 = 1.0 / (1u64 << 48) as f64;

/// A vertex as a course passes it.
struct Passing {
    /// From the eye over the ground, and the course over the ground.
    offset_m: [f64; 2],
    course: [f64; 2],
    /// Way along the course to the foot of the vertex.
    foot_m: f64,
    /// What of it lies over the ground: minus half the slope of g^2.
    across_foot_m2: f64,
    across_m: f64,
    distance_m: f64,
    distance2: f64,
    /// From no farther away the vertex is selected.
    reach_m: f64,
    ring_m: f64,
    tube_m: f64,
    /// Distance from the ring, squared.
    away2: f64,
    /// What squares may be off by.
    slack2: f64,
}

impl Passing {
    #[inline(always)]
    fn new(sighting: &Sighting, [a, b, c]: [f64; 3]) -> Self {
        let [x, y, z] = sighting.offset_m();
        let across_foot_m2 = a * x + b * y;
        let (distance_m, reach_m) = (sighting.distance_m(), sighting.reach_m());
        let size_m = reach_m + distance_m;
        Self {
            offset_m: [x, y],
            course: [a, b],
            foot_m: across_foot_m2 + c * z,
            across_foot_m2,
            across_m: sighting.across_m(),
            distance_m,
            distance2: sighting.distance2(),
            reach_m,
            ring_m: sighting.ring_m(),
            tube_m: sighting.tube_m(),
            away2: sighting.ring2(),
            slack2: size_m * size_m * SQUARE_ERROR,
        }
    }

    /// Way to the foot of the ring's point that is nearest to the eye.
    #[inline(always)]
    fn nearest_foot_m(&self) -> f64 {
        // Straight below or above the vertex all directions are alike.
        let slope =
            if self.across_m > 0.0 { (-self.across_foot_m2 / self.across_m).clamp(-1.0, 1.0) } else { 0.0 };
        self.foot_m + self.ring_m * slope
    }

    /// Way to where the course leaves a sphere of radius R; `foot_m` is the way to the foot of its centre, `away2` the squared distance of that.
    #[inline(always)]
    fn chord_m(&self, foot_m: f64, away2: f64) -> f64 {
        let half_chord2 = self.tube_m * self.tube_m - away2 + foot_m * foot_m - self.slack2;
        foot_m + half_chord2.max(0.0).sqrt()
    }

    /// The margin of a selected vertex.
    #[inline(always)]
    fn inside_m(&self, now_m: f64, rate: f64) -> f64 {
        let near_m = self.nearest_foot_m();
        let leaves_m = self.chord_m(near_m, self.away2);
        if rate * leaves_m >= now_m {
            return now_m;
        }
        let one_m = rate * leaves_m;
        // Where the course leaves the ball, seen from the vertex. Any direction would do, this one is good.
        let out_m = self.foot_m
            + (self.reach_m * self.reach_m - self.distance2 + self.foot_m * self.foot_m).max(0.0).sqrt();
        let [x, y] = [0, 1].map(|i| self.course[i] * out_m - self.offset_m[i]);
        let length = (x * x + y * y).sqrt();
        let ([a, b], [east_m, north_m]) = (self.course, self.offset_m);
        let far_m = self.foot_m + self.ring_m * ((x * a + y * b) / length);
        let side_m = -(x * east_m + y * north_m) / length;
        let far2 = self.distance2 - 2.0 * self.ring_m * side_m + self.ring_m * self.ring_m + self.slack2;
        let half_chord2 = self.tube_m * self.tube_m - far2 + far_m * far_m - self.slack2;
        let s = (far2 - self.away2) / (2.0 * (far_m - near_m));
        let at2 = |foot_m: f64, away2: f64| s * (s - 2.0 * foot_m) + away2;
        let between_m =
            self.tube_m - (at2(near_m, self.away2).max(at2(far_m, far2)).max(0.0) + self.slack2).sqrt();
        // No number where directions are none or both are one.
        if half_chord2 > 0.0 && s >= 0.0 && far_m > near_m {
            one_m.max((between_m + rate * s).min(rate * (far_m + half_chord2.sqrt())).min(now_m))
        } else {
            one_m
        }
    }

    /// The margin of a vertex that is not selected, if something is at least as far from the eye as a point, whose squared distance is `away2` and to whose foot it is `foot_m`, and selection needs `within_m` of it.
    #[inline(always)]
    fn outside_m(&self, foot_m: f64, away2: f64, within_m: f64, rate: f64) -> f64 {
        let across2 = 1.0 - rate * rate;
        let within2 = within_m * within_m;
        // Below zero where the line is so far above g that the parabola goes below zero.
        let off2 = away2 - foot_m * foot_m - self.slack2;
        let away_m = away2.sqrt();
        let now_m = away_m - within_m;
        let ahead_m = if foot_m <= rate * away_m {
            now_m
        } else if off2 <= across2 * within2 {
            rate * (foot_m - (within2 - off2).sqrt())
        } else {
            rate * foot_m + (across2 * off2).sqrt() - within_m
        };
        ahead_m.min(now_m)
    }
}

/// The margin of the error test on a course of that direction, which counts `rate` of the way along it; without one, if there is none.
#[inline(never)]
pub(super) fn margin_m(sighting: &Sighting, direction: Option<[f64; 3]>, rate: f64) -> f64 {
    let now_m = sighting.margin_m().abs();
    let Some(direction) = direction else { return now_m };
    let passing = Passing::new(sighting, direction);
    if sighting.is_selected() {
        return passing.inside_m(now_m, rate);
    }
    let Passing { foot_m, across_foot_m2, across_m, ring_m, tube_m, away2, .. } = passing;
    let [a, b] = passing.course;
    let speed2 = a * a + b * b;
    let speed = speed2.sqrt();
    let ring = |slope: f64| passing.outside_m(foot_m + ring_m * slope, away2, tube_m, rate);
    let mut margin_m = ring(speed);
    if passing.distance_m > passing.reach_m {
        margin_m = margin_m.max(passing.outside_m(foot_m, passing.distance2, passing.reach_m, rate));
    }
    if across_foot_m2 > 0.0 {
        // Distance at the side, rounded up: squares that are nearly equal leave but rounding.
        let side_m = across_foot_m2 / speed2;
        let across2 = across_m * across_m;
        let side2 = across2 - across_foot_m2 * side_m + across2 * SQUARE_ERROR;
        let slope = (side2.max(0.0).sqrt() - across_m) / side_m;
        margin_m = margin_m.max(ring(slope.min(speed)).min(rate * side_m));
    }
    margin_m.min(now_m)
}

/// Way along a course to where a selected vertex may be selected no more.
#[inline(always)]
pub(super) fn chord_m(sighting: &Sighting, direction: [f64; 3]) -> f64 {
    let passing = Passing::new(sighting, direction);
    passing.chord_m(passing.nearest_foot_m(), passing.away2)
}
