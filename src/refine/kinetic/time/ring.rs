//! Certificates of vertices whose errors are measured along the line of sight: selected where the eye is inside a tube of radius R about a level ring of radius h around
//! the vertex (`crate::metric`).
//!
//! The eye's distance from the ring is rho^2 = D^2 - 2 h g + h^2, D being its distance from the vertex and g that over the ground. Along a course D^2 is a parabola and g is convex. With a
//! line l(s) = g(0) + c s in the place of g, rho^2 is the parabola (s - b')^2 + rho(0)^2 - b'^2 with b' = b + h c, b the way along the course to the foot of the vertex: all that is known of spheres
//! (`super::certificate`) holds for it, b' in the place of b, rho in that of D, R in that of the reach.
//!
//! * Selected: the margin must not be overrated, so l must not be above g. The tangent at the eye never is. (Its sphere is the one of radius R around the ring's point nearest to the eye, which lies in
//!   the tube and touches its rim.)
//! * Not selected: l must not be below g. The line of slope w never is, w being the course's speed over the ground. Until the course passes the vertex at the side, S metres on, neither is
//!   the chord to there; so its certificate holds for S metres at most. The longer of the two counts.
//!
//! Invariant: as for spheres, rounded towards a shorter life. Cost: five square roots.

use crate::metric::Sighting;

/// A bound on the error of squares, relative to them.
const SQUARE_ERROR: f64 = 1.0 / (1u64 << 48) as f64;

/// A vertex as a course passes it.
struct Passing {
    /// Way along the course to the foot of the vertex.
    foot_m: f64,
    /// What of it lies over the ground: minus half the slope of g^2.
    across_foot_m2: f64,
    /// Square of the course's speed over the ground.
    speed2: f64,
    across_m: f64,
    ring_m: f64,
    tube_m: f64,
    /// Distance from the ring, and its square.
    away_m: f64,
    away2: f64,
    /// What squares may be off by.
    slack2: f64,
}

impl Passing {
    #[inline(always)]
    fn new(sighting: &Sighting, [a, b, c]: [f64; 3]) -> Self {
        let [x, y, z] = sighting.offset_m();
        let across_foot_m2 = a * x + b * y;
        let away2 = sighting.ring2();
        let size_m = sighting.reach_m() + sighting.distance_m();
        Self {
            foot_m: across_foot_m2 + c * z,
            across_foot_m2,
            speed2: a * a + b * b,
            across_m: sighting.across_m(),
            ring_m: sighting.ring_m(),
            tube_m: sighting.tube_m(),
            away_m: away2.sqrt(),
            away2,
            slack2: size_m * size_m * SQUARE_ERROR,
        }
    }

    /// Way to where the course leaves the sphere in the tube that is nearest now.
    #[inline(always)]
    fn chord_m(&self) -> f64 {
        // Straight below or above the vertex all directions are alike.
        let slope = if self.across_m > 0.0 { (-self.across_foot_m2 / self.across_m).clamp(-1.0, 1.0) } else { 0.0 };
        let foot_m = self.foot_m + self.ring_m * slope;
        let half_chord2 = self.tube_m * self.tube_m - self.away2 + foot_m * foot_m - self.slack2;
        foot_m + half_chord2.max(0.0).sqrt()
    }

    /// The margin if g stays below the line of this slope.
    #[inline(always)]
    fn outside_m(&self, slope: f64, rate: f64) -> f64 {
        let foot_m = self.foot_m + self.ring_m * slope;
        if foot_m <= rate * self.away_m {
            return f64::INFINITY;
        }
        let across2 = 1.0 - rate * rate;
        let tube2 = self.tube_m * self.tube_m;
        // Below zero where the line is so far above g that the parabola goes below zero.
        let off2 = self.away2 - foot_m * foot_m - self.slack2;
        if off2 <= across2 * tube2 {
            rate * (foot_m - (tube2 - off2).sqrt())
        } else {
            rate * foot_m + (across2 * off2).sqrt() - self.tube_m
        }
    }
}

/// The margin of the error test on a course of that direction, which counts `rate` of the way along it; without one, if there is none.
#[inline(never)]
pub(super) fn margin_m(sighting: &Sighting, direction: Option<[f64; 3]>, rate: f64) -> f64 {
    let now_m = sighting.margin_m().abs();
    let Some(direction) = direction else { return now_m };
    let passing = Passing::new(sighting, direction);
    if sighting.is_selected() {
        return now_m.min(rate * passing.chord_m());
    }
    let speed = passing.speed2.sqrt();
    let always_m = passing.outside_m(speed, rate);
    if passing.across_foot_m2 <= 0.0 {
        return now_m.min(always_m);
    }
    // Distance at the side, rounded up: squares that are nearly equal leave but rounding.
    let side_m = passing.across_foot_m2 / passing.speed2;
    let across2 = passing.across_m * passing.across_m;
    let side2 = across2 - passing.across_foot_m2 * side_m + across2 * SQUARE_ERROR;
    let slope = (side2.max(0.0).sqrt() - passing.across_m) / side_m;
    let until_m = passing.outside_m(slope.min(speed), rate).min(rate * side_m);
    now_m.min(always_m.max(until_m))
}

/// Way along a course to where a selected vertex may be selected no more.
#[inline(always)]
pub(super) fn chord_m(sighting: &Sighting, direction: [f64; 3]) -> f64 {
    Passing::new(sighting, direction).chord_m()
}
