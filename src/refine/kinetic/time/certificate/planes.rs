//! What the planes of the view leave of a vertex's life where the view turns.
//!
//! A plane's distance from a vertex bends by no more than a bound for each metre of way and another, whatever turns; and where the view turns as the way does, or on the spot, it swings
//! (`super::super::swing`). Of the two the one that promises more is taken, plane by plane.
//!
//! Invariant: rounded towards a shorter life. Cost: two square roots a plane.

use super::super::clocks::{Kind, band_of, power_of_two};
use super::super::swing::Swing;
use super::{Judge, Life, Motion, SQUARE_ERROR, dot};
use crate::metric::{PLANES, Sighting};

/// A vertex that the planes pass.
struct Passing {
    motion: Motion,
    /// What the distance from a plane bends by at the most, a metre of way and another.
    bend: f64,
    /// Its offset along the axis.
    along_m: f64,
    /// What clocks count of a metre of way at the most.
    least_slope: f64,
}

impl Judge {
    /// What a margin that rests on the planes may be if the view turns on the spot.
    #[inline(always)]
    pub(super) fn turning_margin_m(&self, sighting: &Sighting, life: &Life, band_m: f64) -> f64 {
        let (arm_m, along_m) = (self.arm_m(sighting), dot(self.axis, sighting.offset_m()));
        let counted_m = self.rate * band_m;
        let plane = |i: usize| self.turning_plane(i, sighting, [along_m, arm_m, counted_m]);
        let planes = [plane(0), plane(1), plane(2), plane(3)];
        let inside_m = fold(&planes, f64::INFINITY, |least, (_, left_m)| least.min(left_m));
        // Each plane may vouch by itself.
        let vouched = |most: f64, (beyond, left_m)| most.max(if beyond > 0.0 { left_m } else { 0.0 });
        if life.active { inside_m } else { fold(&planes, 0.0, vouched) }
    }

    /// Of a plane that turns with a view on the spot: how far the vertex's sphere is beyond it, and the margin of that, if clocks count `counted_m` a radian.
    #[inline(always)]
    fn turning_plane(
        &self,
        plane: usize,
        sighting: &Sighting,
        [along_m, arm_m, counted_m]: [f64; 3],
    ) -> (f64, f64) {
        let beyond = self.metric.height_over_plane(plane, sighting) - sighting.radius_m();
        let sweep_m = dot(self.sweeps[plane], sighting.offset_m());
        let bent_rad = used_up_at(beyond.abs(), if beyond > 0.0 { -sweep_m } else { sweep_m }, arm_m);
        let swing = self.swing(plane, sighting, along_m, [sighting.distance_m(), 0.0]);
        let swung_rad = swing.turn_rad(counted_m);
        let lasts = swung_rad > bent_rad;
        let left_m = if lasts { swing.now } else { beyond.abs() };
        (beyond, left_m.min(counted_m * if lasts { swung_rad } else { bent_rad }))
    }

    /// The life of a selected vertex on a course that goes along and turns; the error test's margin, and the way along the course until it ends.
    #[inline(always)]
    pub(super) fn bending_life(
        &self,
        sighting: &Sighting,
        motion: Motion,
        margin_m: f64,
        chord_m: f64,
    ) -> Life {
        let passing = Passing {
            motion,
            bend: self.turn_per_m * (self.arm_m(sighting) * self.turn_per_m) + self.bend_per_m,
            along_m: dot(self.axis, sighting.offset_m()),
            least_slope: self.most_counted_per_m(sighting),
        };
        let plane = |i: usize| self.plane_ahead(i, sighting, &passing);
        let planes = [plane(0), plane(1), plane(2), plane(3)];
        let inside_m = fold(&planes, margin_m, |least, (_, left_m, _)| least.min(left_m));
        let least_m = fold(&planes, chord_m, |least, (_, _, way_m)| least.min(way_m));
        let outside = |beyond: f64, m: f64| if beyond > 0.0 { m } else { 0.0 };
        let most_m = fold(&planes, 0.0, |most, (beyond, _, way_m)| most.max(outside(beyond, way_m)));
        let culled = fold(&planes, 0.0, |most, (beyond, ..)| most.max(beyond)) > 0.0;
        let nearest = if culled { sighting.distance_m() } else { sighting.reach_m() };
        // A way of many times the distance would weigh on every turn.
        let longest_m = 4.0 * nearest;
        let way_m = if culled { most_m } else { least_m }.min(longest_m);
        let scale_m = nearest + way_m;
        let band_m = power_of_two(band_of(scale_m * self.bands_per_m)) / self.bands_per_m;
        let counted_per_m = self.rate * (1.0 + band_m * self.turn_per_m);
        // Each plane may vouch by itself.
        let outside_m = fold(&planes, 0.0, |most, (beyond, left_m, way_m)| {
            most.max(outside(beyond, left_m.min(counted_per_m * way_m.min(longest_m))))
        });
        let margin_m = if culled { outside_m } else { inside_m.min(counted_per_m * way_m) };
        Life { active: !culled, kind: Kind::Planes, margin_m, scale_m }
    }

    /// Of a plane: how far the vertex's sphere is beyond it, how far from its side of it at the least, and the way on which it stays there.
    #[inline(always)]
    fn plane_ahead(&self, plane: usize, sighting: &Sighting, passing: &Passing) -> (f64, f64, f64) {
        let beyond = self.metric.height_over_plane(plane, sighting) - sighting.radius_m();
        let grows = self.slopes[plane] + self.turn_per_m * dot(self.sweeps[plane], sighting.offset_m());
        let bend_m = used_up_at(beyond.abs(), if beyond > 0.0 { -grows } else { grows }, passing.bend);
        if passing.motion != Motion::CurvedBend {
            return (beyond, beyond.abs(), bend_m);
        }
        let (left_m, swing_m) = self.swing_m(plane, sighting, passing);
        let lasts = swing_m > bend_m;
        (beyond, if lasts { left_m } else { beyond.abs() }, if lasts { swing_m } else { bend_m })
    }

    /// Of a vertex on one side of a plane that turns as the way does: its distance from there, and the way on which that lasts, as `super::swing` claims it.
    #[inline(always)]
    fn swing_m(&self, plane: usize, sighting: &Sighting, passing: &Passing) -> (f64, f64) {
        // The climb, and what turns otherwise, may take the plane nearer.
        let round_m = sighting.distance_m() + 2.0 * self.curve.radius_m + self.curve.half_climb_m;
        let other_m = self.apart * round_m + self.along_axis[plane].abs() * self.curve.half_climb_m;
        let swing = self.swing(plane, sighting, passing.along_m, [round_m, other_m]);
        (swing.now, swing.turn_rad(passing.least_slope * self.curve.radius_m) * self.curve.radius_m)
    }

    /// How a vertex's distance from its side of a plane swings while the view turns about the circle's centre, or on the spot, less `other_m`. Its offset along the axis is `along_m`, and nothing in it is larger than `round_m`.
    #[inline(always)]
    fn swing(&self, plane: usize, sighting: &Sighting, along_m: f64, [round_m, other_m]: [f64; 2]) -> Swing {
        let (height_m, radius_m) = (self.metric.height_over_plane(plane, sighting), sighting.radius_m());
        let sign = if height_m > radius_m { 1.0 } else { -1.0 };
        // The distance from the plane is constant + swing cos t + sine sin t. On the spot the centre is the eye.
        let swing_m = height_m - self.along_axis[plane] * along_m - self.centres_m[plane];
        let sine_m = dot(self.sweeps[plane], sighting.offset_m()) - self.centre_sweeps_m[plane];
        let error_m = (round_m + radius_m) * (64.0 * SQUARE_ERROR);
        let now = sign * (height_m - radius_m) - other_m - error_m;
        Swing { now, opposite: now - 2.0 * sign * swing_m, grows: sign * sine_m }
    }

    /// No clock counts more of a metre of way.
    #[inline(always)]
    pub(super) fn most_counted_per_m(&self, sighting: &Sighting) -> f64 {
        // A band is less than twice what it stands for, which is at most five times this.
        let most_m = 10.0 * sighting.distance_m().max(sighting.reach_m()) + 1.0 / self.bands_per_m;
        self.rate * (1.0 + most_m * self.turn_per_m)
    }

    /// Distance from the course's axis, rounded up.
    #[inline(always)]
    fn arm_m(&self, sighting: &Sighting) -> f64 {
        let along_m = dot(self.axis, sighting.offset_m());
        let square = sighting.distance2() - along_m * along_m;
        square.max(0.0).sqrt() + sighting.distance_m() * SQUARE_ERROR.sqrt()
    }
}

/// A fold without a loop: of loops within loops the compiler makes no vector instructions.
#[inline(always)]
fn fold<T: Copy>([a, b, c, d]: &[T; PLANES], start: f64, each: impl Fn(f64, T) -> f64) -> f64 {
    each(each(each(each(start, *a), *b), *c), *d)
}

/// The least t at which `slope` t + `bend` t^2 / 2 reaches `margin`, which is 0 or more, as `bend` is.
#[inline(always)]
fn used_up_at(margin: f64, slope: f64, bend: f64) -> f64 {
    let root = (slope * slope + 2.0 * bend * margin).sqrt();
    let (part, whole) = if slope > 0.0 { (2.0 * margin, slope + root) } else { (root - slope, bend) };
    part / whole
}
