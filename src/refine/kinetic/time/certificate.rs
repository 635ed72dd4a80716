//! How long a status will hold: the certificate that a live-range word states.
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART", sections 4.1 and 4.2. The paper's safe distance assumes that the eye may turn towards the
//! vertex at once. Here the eye has a course, a straight line from where it is now along u. A margin m(s) is known for
//! every point s metres along it; a clock (`super::clocks`) counts rho s plus the way off the course. The word lives on as long as its clock has
//! counted less than the largest L with
//!
//! ```text
//! m(s) >= L - rho s    for all s in [0, L / rho]
//! ```
//!
//! since a way of s along the course and x off it takes at most m(0) - m(s) + x from the margin. With b the way along the course to the foot of the
//! vertex, h its distance from the course, R = nu e + r and D = |P - p|:
//!
//! * selected, m = R - sqrt(h^2 + (s - b)^2) is concave: L = min(m(0), rho s1), s1 where the course leaves the sphere of radius R;
//! * not selected, m = sqrt(h^2 + (s - b)^2) - R is convex: L = m(0) if it falls by less than rho a metre from the start; else rho s1,
//!   s1 where the course enters the sphere, if it falls faster than rho until there; else the tangent of slope -rho, L = rho b + sqrt(1 - rho^2) h - R;
//! * planes: m is linear, with slope k: L = m(0) rho / max(rho, -k).
//!
//! A course may also turn about an axis through the eye. The clock then counts rho G t for an angle t, G being the band; a plane's distance h changes by at
//! most B t + d t^2 / 2, B = (axis x normal) . offset and d the distance from the axis. With T the angle at which that uses up m(0), L = min(m(0), rho G T), since
//! the bound is concave. That distance swings (`super::swing`), which may promise more. A course that has both turns by w s in a way s: the clock counts c s, c = rho (1 + G w), a plane's distance changes by at most
//! (k + B w) s + (d w^2 + 2 w) s^2 / 2, and with S the way at which that or the sphere of radius R ends it, L = min(m(0), c S).
//!
//! Courses that turn by themselves: `super::curve`.
//!
//! By the line of sight a vertex is selected inside the tube about a ring (`crate::metric`); `super::ring` brings that down to spheres.
//!
//! Where a course has no direction, L = m(0). Everything is rounded towards a shorter life. Cost: two square roots a vertex, and one a plane while turning.

use super::clocks::{BANDS, CLOCKS, Clocks, EXPIRY_BITS, HORIZON, Kind, band_of, clock_id, power_of_two};
use super::course::Course;
use super::curve::{Curve, Seen};
use super::ring;
use super::swing::TINY;
use crate::metric::{Metric, PLANES, Sighting};
use crate::view::ErrorMetric;
use batch::Way;
use glam::DVec3;

/// Status bit: the vertex is selected and not culled.
pub(crate) const ACTIVE: u32 = 1 << 31;
/// Where the clock's number starts in a word; one bit between it and [`ACTIVE`] is the tree's own.
const CLOCK_SHIFT: u32 = EXPIRY_BITS;

/// The clock of a word.
pub(crate) fn clock_of(word: u32) -> usize {
    (word >> CLOCK_SHIFT) as usize % CLOCKS
}

/// The expiry of a word in ticks of its clock; 0 if it has none.
pub(crate) fn expiry_of(word: u32) -> u32 {
    word & ((1 << EXPIRY_BITS) - 1)
}

/// A word's status and a new certificate.
pub(crate) fn with_certificate(word: u32, clock: usize, expiry: u32) -> u32 {
    (word & ACTIVE) | (clock as u32) << CLOCK_SHIFT | expiry
}

/// A bound on the error of squares, relative to them.
const SQUARE_ERROR: f64 = 1.0 / (1u64 << 48) as f64;

/// Tests vertices of one frame and states how long the answers hold.
#[derive(Debug, Clone)]
pub(crate) struct Judge {
    metric: Metric,
    culls: bool,
    course: usize,
    moves: bool,
    turns: bool,
    direction: [f64; 3],
    axis: [f64; 3],
    turn_per_m: f64,
    curve: Curve,
    /// What a plane's distance bends by a metre of way and another, the turn's arm left out.
    bend_per_m: f64,
    /// Share of the way along the course that its clocks count.
    rate: f64,
    /// What each plane's distance grows by a metre of way, the eye's turn left out.
    slopes: [f64; PLANES],
    /// Axis x normal of each plane.
    sweeps: [[f64; 3]; PLANES],
    /// Of each plane: normal . axis; what its distance from the circle's centre is, and what its sweep makes of that.
    along_axis: [f64; PLANES],
    centres_m: [f64; PLANES],
    centre_sweeps_m: [f64; PLANES],
    /// What planes are apart from where the way turns them, half a turn on, a metre of distance.
    apart: f64,
    /// Share of a margin to each plane that counts: from inside, from outside.
    from_inside: [f64; PLANES],
    from_outside: [f64; PLANES],
    now: [u32; CLOCKS],
    ticks_per_m: f64,
    bands_per_m: f64,
    way: Way,
}

/// What happens to the view on a course, as far as tests ask. Each motion is a loop of its own where vertices are tested together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Motion {
    None,
    /// The eye stays and the view turns.
    Turn,
    /// The eye moves.
    Way,
    /// The eye moves and the view turns by the way.
    Bend,
    /// The way turns, and planes are not asked.
    Curve,
    /// The way turns, and so may the view.
    CurvedBend,
}

/// What a margin rests on.
#[derive(Debug, Clone, Copy)]
struct Life {
    active: bool,
    kind: Kind,
    /// Margin in metres on the course's clock.
    margin_m: f64,
    /// Metres that turning and zooming act on.
    scale_m: f64,
}

impl Judge {
    /// The judge of a frame, after the clocks have moved to it. Without `culls` the view's planes are not asked.
    pub(crate) fn new(metric: Metric, clocks: &Clocks, culls: bool) -> Self {
        let (number, course) = clocks.course();
        let Course { direction, axis, turn_per_m, rate, .. } = course;
        let curve = Curve::of(&course);
        // Of a way that turns as the view does, what the planes see of it is a turn about one axis.
        let apart_per_m = (course.curve - axis * turn_per_m).length();
        let normals = metric.normals().map(DVec3::from_array);
        let slopes = normals.map(|n| n.dot(direction));
        let moves = direction != DVec3::ZERO;
        // From the eye to the centre of the circle that it flies.
        let centre_m = course.curve.cross(direction) / (curve.per_m * curve.per_m).max(TINY);
        let share = |falls: f64| if moves { rate / rate.max(falls) } else { 1.0 };
        Self {
            culls,
            course: number,
            moves,
            turns: axis != DVec3::ZERO,
            direction: direction.to_array(),
            axis: axis.to_array(),
            turn_per_m,
            bend_per_m: (turn_per_m + apart_per_m).min(2.0 * turn_per_m + curve.per_m),
            curve,
            rate,
            // The eye's way takes it nearer to what lies ahead.
            slopes: slopes.map(|k| -k),
            sweeps: normals.map(|n| axis.cross(n).to_array()),
            along_axis: normals.map(|n| axis.dot(n)),
            centres_m: normals.map(|n| n.dot(centre_m)),
            centre_sweeps_m: normals.map(|n| axis.cross(n).dot(centre_m)),
            apart: apart_per_m * curve.half_m,
            // A plane moves with the eye: m = r - h grows by the slope inside, m = h - r falls by it outside.
            from_inside: slopes.map(|k| share(-k)),
            from_outside: slopes.map(share),
            now: clocks.all_now(),
            ticks_per_m: clocks.ticks_per_m(),
            bands_per_m: clocks.bands_per_m(),
            // Rings take many more steps, by ways that differ.
            way: if metric.kind() == ErrorMetric::Ball { Way::best() } else { Way::Single },
            metric,
        }
    }

    /// The frame's tick of a clock.
    #[inline(always)]
    pub(crate) fn now(&self, clock: usize) -> u32 {
        self.now[clock]
    }

    /// The frame's metric.
    pub(crate) fn metric(&self) -> &Metric {
        &self.metric
    }

    /// What happens to the view on the course.
    #[inline(always)]
    fn motion(&self) -> Motion {
        if self.moves && self.curve.per_m > 0.0 {
            return if self.culls { Motion::CurvedBend } else { Motion::Curve };
        }
        match (self.moves, self.turns && self.culls) {
            (false, false) => Motion::None,
            (false, true) => Motion::Turn,
            (true, false) => Motion::Way,
            // A course that has both turns by the way.
            (true, true) => Motion::Bend,
        }
    }

    /// The word of a vertex: its status by the same operations as every engine's, and its certificate.
    #[inline(always)]
    pub(crate) fn word(&self, sighting: &Sighting) -> u32 {
        let motion = self.motion();
        let life = if sighting.ring_m() == 0.0 {
            self.ball_life(sighting, motion, self.culls)
        } else {
            self.ring_life(sighting, motion)
        };
        let word = self.word_of_life(sighting, life, motion);
        word + self.now[clock_of(word)]
    }

    /// The word of a life, its expiry counted from now.
    #[inline(always)]
    fn word_of_life(&self, sighting: &Sighting, life: Life, motion: Motion) -> u32 {
        let margin_m = life.margin_m - sighting.guard_m();
        let band = band_of(life.scale_m * self.bands_per_m);
        let band_m = power_of_two(band) / self.bands_per_m;
        let margin_m = if motion == Motion::Turn {
            let turning_m = margin_m.min(self.turning_margin_m(sighting, &life, band_m));
            if life.kind == Kind::Planes { turning_m } else { margin_m }
        } else {
            margin_m
        };
        // Beyond half a band zooming would no longer be bounded by its first order.
        let margin_m = if band < BANDS - 1 { margin_m.min(0.5 * band_m) } else { margin_m };
        let clock = clock_id(self.course, life.kind, band);
        u32::from(life.active) << 31 | (clock as u32) << CLOCK_SHIFT | ticks(margin_m * self.ticks_per_m)
    }

    /// The life of a vertex whose errors show alike from everywhere.
    #[inline(always)]
    fn ball_life(&self, sighting: &Sighting, motion: Motion, culls: bool) -> Life {
        let (selected, reach_m) = (sighting.is_selected(), sighting.reach_m());
        let margin_m = self.error_margin_m(sighting, motion);
        let scale_m = if selected { reach_m } else { sighting.distance_m() };
        if !matches!(motion, Motion::Bend | Motion::CurvedBend) {
            return self.weigh(sighting, margin_m, scale_m, motion, culls);
        }
        let (chord_m, now_m) = if motion == Motion::CurvedBend {
            self.curve.chord_m(&self.seen(sighting), self.most_counted_per_m(sighting))
        } else {
            (self.chord_m(sighting, reach_m), reach_m - sighting.distance_m())
        };
        let bending = self.bending_life(sighting, motion, now_m, chord_m);
        // Field by field, so that no branch comes of it.
        Life {
            active: selected & bending.active,
            kind: if selected { Kind::Planes } else { Kind::Error },
            margin_m: if selected { bending.margin_m } else { margin_m },
            scale_m: if selected { bending.scale_m } else { scale_m },
        }
    }

    /// The life of a vertex whose errors are measured along the line of sight.
    #[inline(never)]
    fn ring_life(&self, sighting: &Sighting, motion: Motion) -> Life {
        if self.curve.per_m > 0.0 {
            return self.curved_ring_life(sighting);
        }
        if motion == Motion::Bend && sighting.is_selected() {
            return self.bending_life(
                sighting,
                motion,
                sighting.margin_m(),
                ring::chord_m(sighting, self.direction),
            );
        }
        // Near the axis of the ring an error may grow beyond the distance before it shows.
        let margin_m = ring::margin_m(sighting, self.moves.then_some(self.direction), self.rate);
        let scale_m = sighting.distance_m().max(sighting.reach_m());
        let culls = self.culls && motion != Motion::Bend;
        self.weigh(sighting, margin_m, scale_m, motion, culls)
    }

    /// The same on a course that turns by itself, which the eye leaves soon: see `Clocks`. A course straight ahead that counts half as much is off by no more than the other half, for a while.
    fn curved_ring_life(&self, sighting: &Sighting) -> Life {
        let ahead_m = ring::margin_m(sighting, Some(self.direction), 0.5 * self.rate);
        let margin_m = ahead_m.min(self.rate * self.rate / self.curve.per_m);
        if self.culls && sighting.is_selected() {
            return self.bending_life(sighting, Motion::Bend, margin_m, f64::INFINITY);
        }
        let scale_m = sighting.distance_m().max(sighting.reach_m());
        self.weigh(sighting, margin_m, scale_m, Motion::Curve, false)
    }

    /// The life of a vertex with that margin of the error test, planes included if it `culls`.
    #[inline(always)]
    fn weigh(&self, sighting: &Sighting, margin_m: f64, scale_m: f64, motion: Motion, culls: bool) -> Life {
        let selected = sighting.is_selected();
        if !culls {
            return Life { active: selected, kind: Kind::Error, margin_m, scale_m };
        }
        let radius_m = sighting.radius_m();
        let (mut inside_m, mut outside_m) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..PLANES {
            let h = self.metric.height_over_plane(i, sighting);
            // One difference for both, so that its sign is the status: h > r culls.
            let beyond = h - radius_m;
            inside_m = inside_m.min(-beyond * self.from_inside[i]);
            outside_m = outside_m.max(beyond * self.from_outside[i]);
        }
        let culled = outside_m > 0.0;
        let planes_m = if culled { outside_m } else { margin_m.min(inside_m) };
        // While the eye moves on by what the margin allows, turning acts on a longer arm.
        let arm_m = if motion == Motion::Way { planes_m / self.rate } else { 0.0 };
        let arm_m = if culled { sighting.distance_m() } else { sighting.reach_m() } + arm_m;
        Life {
            active: selected & !culled,
            kind: if selected { Kind::Planes } else { Kind::Error },
            margin_m: if selected { planes_m } else { margin_m },
            scale_m: if selected { arm_m } else { scale_m },
        }
    }

    /// A vertex as a course that turns passes it.
    #[inline(always)]
    fn seen(&self, sighting: &Sighting) -> Seen {
        let offset_m = sighting.offset_m();
        Seen {
            foot_m: dot(self.direction, offset_m),
            distance_m: sighting.distance_m(),
            distance2: sighting.distance2(),
            reach_m: sighting.reach_m(),
            inward: dot(self.curve.inward_per_m, offset_m),
            across_m: dot(self.curve.across, offset_m),
        }
    }

    /// Way along the course to where it leaves the sphere of radius `reach_m` around the vertex, rounded down.
    #[inline(always)]
    fn chord_m(&self, sighting: &Sighting, reach_m: f64) -> f64 {
        let b = dot(self.direction, sighting.offset_m());
        let (reach2, distance2) = (reach_m * reach_m, sighting.distance2());
        let half_chord2 = reach2 - distance2 + b * b - (reach2 + distance2) * SQUARE_ERROR;
        b + half_chord2.max(0.0).sqrt()
    }

    /// The margin of the error test. Written without branches, because no processor can predict the answer.
    #[inline(always)]
    fn error_margin_m(&self, sighting: &Sighting, motion: Motion) -> f64 {
        let (distance_m, reach_m) = (sighting.distance_m(), sighting.reach_m());
        let (rate, selected) = (self.rate, sighting.is_selected());
        let across2 = 1.0 - rate * rate;
        let now_m = (reach_m - distance_m).abs();
        if matches!(motion, Motion::None | Motion::Turn) {
            return now_m;
        }
        if matches!(motion, Motion::Curve | Motion::CurvedBend) {
            let seen = self.seen(sighting);
            let (chord_m, left_m) = self.curve.chord_m(&seen, rate);
            let inside_m = now_m.min(left_m.min(rate * chord_m).max(self.curve.always_m(&seen)));
            let outside_m = self.curve.outside_m(&seen, rate);
            return if selected { inside_m } else { outside_m };
        }
        // Way along the course to the foot of the vertex, and squares of the distances.
        let b = dot(self.direction, sighting.offset_m());
        let (reach2, distance2) = (reach_m * reach_m, sighting.distance2());
        let off2 = (distance2 - b * b - distance2 * SQUARE_ERROR).max(0.0);
        let half_chord2 = reach2 - distance2 + b * b - (reach2 + distance2) * SQUARE_ERROR;
        let enters = off2 <= across2 * reach2;
        let (square, sign, less) = if selected {
            (half_chord2, rate, 0.0)
        } else if enters {
            (reach2 - off2, -rate, 0.0)
        } else {
            (across2 * off2, 1.0, reach_m)
        };
        let ahead_m = rate * b + sign * square.max(0.0).sqrt() - less;
        let falls_slowly = !selected & (b <= rate * distance_m);
        if falls_slowly { now_m } else { ahead_m.min(now_m) }
    }
}

/// Whole ticks of a life, no more than [`HORIZON`]: rounded down, and of some whole numbers one less. Negative lives become 0, and so does what is no number.
#[inline(always)]
fn ticks(life: f64) -> u32 {
    // From here on numbers are as far apart as whole ones. No other conversion becomes a vector instruction.
    const WHOLE: f64 = (1u64 << 52) as f64;
    (life.max(0.5).min(f64::from(HORIZON)) - 0.5 + WHOLE).to_bits() as u32
}

#[inline(always)]
fn dot([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> f64 {
    a * x + b * y + c * z
}

pub(crate) mod batch;
mod planes;
#[cfg(test)]
mod tests;
