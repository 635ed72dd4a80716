//! How much of every live range has been used up: clocks that advance with the camera's movement, in metres of margin.
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART", section 4 (eq. 11 and 12), corrected and widened. A status holds while its margin is
//! positive. A clock adds up, rounded up, how much the camera's movement can have taken from the margin since. There is one clock for every combination of
//!
//! * a *course*: the direction the eye is expected to keep, and the axis it is expected to turn about. Course 0 expects nothing and counts the whole
//!   path and every turn. Any other course counts [`RATE`] times the way along its direction and the angle about its axis, and all of the way and angle that goes off
//!   them. What lies ahead on the course was taken into account when the margin was made (`super::certificate`). A word made on one course stays on it
//!   when the eye takes another;
//! * a *kind*: whether the status depends on the view's planes, so that turning uses it up too;
//! * a *band*: a power of two that bounds the distances which turning (by an angle) and zooming (by a ratio) act on.
//!
//! Claim: with L = f0 + floor(m / q), m metres of margin made at tick f0 and ticks of q metres, `f < L` implies that less than m has been used.
//! Proof: a rounding down rho of the total has rho(x) - rho(y) > x - y - 1 in ticks. Cost: some hundred additions a frame.

use glam::{DQuat, DVec3};
use terrasoar_layout::portable;

/// Share of the way along the course that is counted. A smaller one lets words last longer on course and shorter off it.
pub(crate) const RATE: f64 = 0.1;
/// Courses, the one without direction included.
pub(crate) const COURSES: usize = 4;
/// Bands: powers of two.
pub(crate) const BANDS: usize = 16;
/// All clocks.
pub(crate) const CLOCKS: usize = COURSES * 2 * BANDS;
/// Bits of a word that hold its expiry in ticks.
pub(crate) const EXPIRY_BITS: u32 = 23;
/// Longest life in ticks, and the tick at which a clock is set back.
pub(crate) const HORIZON: u32 = (1 << (EXPIRY_BITS - 1)) - 1;

/// Fixed-point units a metre.
const UNITS_PER_M: f64 = (1u64 << 20) as f64;
/// A course is left when more than this share of the recent way was counted.
const LEAVE_RATE: f64 = 0.25;
/// A course is taken only if the recent way leads this straight.
const STRAIGHT: f64 = 0.9;
/// How far ahead of a bend its course points.
const LEAD_RAD: f64 = 0.12;
/// Share of the newest frame in what "recent" means.
const RECENT: f64 = 0.2;
/// (e^x - 1) / x stays below this for x up to 1/2, which margins of at most half a band see to.
const EXP_SLOPE: f64 = 1.3;

/// What a status rests on besides the distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// The error test alone.
    Error,
    /// The view's planes as well.
    Planes,
}

/// Number of a clock.
pub(crate) const fn clock_id(course: usize, kind: Kind, band: usize) -> usize {
    course * 2 * BANDS + (kind as usize) * BANDS + band
}

/// What of a view moves the clocks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    pub eye_m: DVec3,
    /// Right, up and forward.
    pub axes: [DVec3; 3],
    pub normals: [DVec3; 4],
    pub nu: f64,
    pub exaggeration: f64,
}

/// What the eye is expected to keep doing.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Course {
    /// Unit vector it moves along, or zero.
    pub direction: DVec3,
    /// Unit vector it turns about, right-handed, or zero.
    pub axis: DVec3,
    /// Radians it turns about the axis a metre of way, if it has both.
    pub turn_per_m: f64,
}

/// How something has been going of late.
#[derive(Debug, Clone, Copy, Default)]
struct Trend {
    vector: DVec3,
    length: f64,
    used: f64,
}

impl Trend {
    /// Takes in the newest step, of which the current course counts `used`.
    fn follow(&mut self, step: DVec3, used: f64) {
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

    /// Whether the course misses much of what happens.
    fn is_off(&self) -> bool {
        self.used > LEAVE_RATE * self.length
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

/// The clocks of one engine.
#[derive(Debug)]
pub(crate) struct Clocks {
    /// Used since a clock was last set back, in units.
    totals: [u64; CLOCKS],
    /// Units that the newest move has used.
    steps: [u64; CLOCKS],
    /// Units a tick: 2^shift.
    shift: u32,
    least_band_m: f64,
    /// Largest height or depth in metres: what a change of exaggeration moves.
    tallest_m: f64,
    last: Option<Pose>,
    courses: [Course; COURSES],
    current: usize,
    /// The course that was taken last, to be succeeded by the next number.
    newest: usize,
    way: Trend,
    turn: Trend,
}

/// What [`Clocks::move_to`] has done.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Moved {
    /// Bit c: clock c has advanced.
    pub clocks: u128,
    /// A course whose words are to be moved to course 0, after which [`Clocks::take_course`] is called.
    pub next_course: Option<(usize, Course)>,
}

impl Clocks {
    /// Heights may lie so far from height 0 from now on. What was counted before moved nothing that was not there.
    pub(crate) fn raise_tallest(&mut self, tallest_m: f64) {
        self.tallest_m = self.tallest_m.max(tallest_m);
    }

    /// Clocks for a terrain whose samples are `spacing_m` apart and at most `tallest_m` from height 0.
    pub(crate) fn new(spacing_m: f64, tallest_m: f64) -> Self {
        let shift = portable::log2(spacing_m / 256.0 * UNITS_PER_M).floor().clamp(0.0, 40.0) as u32;
        Self {
            // Expiry 0 is kept for words that are not in the queue.
            totals: [1 << shift; CLOCKS],
            steps: [0; CLOCKS],
            shift,
            least_band_m: 4.0 * spacing_m,
            tallest_m,
            last: None,
            courses: [Course::default(); COURSES],
            current: 0,
            newest: 0,
            way: Trend::default(),
            turn: Trend::default(),
        }
    }

    /// Counts the way from the last pose to `pose`.
    pub(crate) fn move_to(&mut self, pose: Pose) -> Moved {
        self.steps = [0; CLOCKS];
        let Some(last) = self.last.replace(pose) else { return Moved::default() };
        let step = pose.eye_m - last.eye_m;
        let raised_m = self.tallest_m * (pose.exaggeration - last.exaggeration).abs();
        let ratio = |now: f64, then: f64| if now == then { 0.0 } else { portable::ln(now / then).abs() };
        let zoomed = EXP_SLOPE * (ratio(pose.nu, last.nu) + ratio(pose.exaggeration, last.exaggeration));
        let turned = pose.normals != last.normals;
        let mut moved = Moved::default();
        if step == DVec3::ZERO && !turned && raised_m + zoomed == 0.0 {
            return moved;
        }
        let beyond = (u64::from(HORIZON) + 1) << self.shift;
        for course in 0..COURSES {
            let used_m = self.courses[course].used_m(step) + raised_m;
            let expects_turn = self.courses[course].turn_per_m > 0.0;
            let used_rad =
                if turned || expects_turn { self.courses[course].used_rad(&last, &pose) } else { 0.0 };
            for (kind, angle) in [(Kind::Error, zoomed), (Kind::Planes, zoomed + used_rad)] {
                if used_m + angle == 0.0 {
                    continue;
                }
                for band in 0..BANDS {
                    let clock = clock_id(course, kind, band);
                    let metres = used_m + if angle > 0.0 { self.band_m(band) * angle } else { 0.0 };
                    // One unit more covers the rounding of the sum itself; beyond the horizon nothing is alive.
                    let units = ((metres * UNITS_PER_M).ceil() as u64).min(beyond) + 1;
                    self.totals[clock] += units;
                    self.steps[clock] = units;
                    moved.clocks |= 1 << clock;
                }
            }
        }
        let current = self.courses[self.current];
        self.way.follow(step, current.used_m(step));
        self.turn.follow(last.turn_to(&pose), current.used_rad(&last, &pose));
        let next = Course::of(&self.way, &self.turn);
        // Whoever keeps no direction is on no course that could be better.
        let changes =
            |off: bool, current: DVec3, next: DVec3| off && (current != DVec3::ZERO || next != DVec3::ZERO);
        if changes(self.way.is_off(), current.direction, next.direction)
            || changes(self.turn.is_off(), current.axis, next.axis)
        {
            if next.direction == DVec3::ZERO && next.axis == DVec3::ZERO {
                self.current = 0;
            } else {
                moved.next_course = Some((self.newest % (COURSES - 1) + 1, next));
            }
        }
        moved
    }

    /// Makes new words on course `number` from now on. No word may be left on it.
    pub(crate) fn take_course(&mut self, number: usize, course: Course) {
        self.courses[number] = course;
        self.current = number;
        self.newest = number;
        // What the new course will make of it is yet to be seen.
        self.way.used = 0.0;
        self.turn.used = 0.0;
    }

    /// The course that new words are made on, and its number.
    pub(crate) fn course(&self) -> (usize, Course) {
        (self.current, self.courses[self.current])
    }

    /// Current tick of a clock; may exceed the horizon until [`Clocks::set_back`] is called.
    pub(crate) fn now(&self, clock: usize) -> u64 {
        self.totals[clock] >> self.shift
    }

    /// Ticks, and parts of them, that the newest move took on a clock.
    pub(crate) fn newest_step(&self, clock: usize) -> f32 {
        self.steps[clock] as f32 / (1u64 << self.shift) as f32
    }

    /// Ticks of all clocks, once none exceeds the horizon.
    pub(crate) fn all_now(&self) -> [u32; CLOCKS] {
        std::array::from_fn(|c| self.now(c) as u32)
    }

    /// Starts clock `clock` again at tick 1; returns the ticks that expiries must be set back by, or `None` if it is not time.
    pub(crate) fn set_back(&mut self, clock: usize) -> Option<u64> {
        let now = self.now(clock);
        if now < u64::from(HORIZON) {
            return None;
        }
        self.totals[clock] -= (now - 1) << self.shift;
        Some(now - 1)
    }

    /// Ticks a metre.
    pub(crate) fn ticks_per_m(&self) -> f64 {
        UNITS_PER_M / (1u64 << self.shift) as f64
    }

    /// The metres that band `band` stands for. The last one stands for any distance.
    fn band_m(&self, band: usize) -> f64 {
        if band == BANDS - 1 { f64::INFINITY } else { self.least_band_m * f64::from(1u32 << band) }
    }

    /// Reciprocal of the metres of band 0.
    pub(crate) fn bands_per_m(&self) -> f64 {
        1.0 / self.least_band_m
    }
}

impl Course {
    /// The course that goes on as it has been going.
    fn of(way: &Trend, turn: &Trend) -> Self {
        let (direction, axis) = (way.direction(), turn.direction());
        if direction == DVec3::ZERO || axis == DVec3::ZERO {
            return Self { direction, axis, turn_per_m: 0.0 };
        }
        // Who turns flies a bend: straight ahead of where the trend, which lags behind, will have led in a while.
        let lead = turn_about(axis, turn.length / RECENT + LEAD_RAD);
        Self { direction: (lead * direction).normalize(), axis, turn_per_m: turn.length / way.length }
    }

    /// Metres that a step uses up.
    fn used_m(&self, step: DVec3) -> f64 {
        let along = step.dot(self.direction).max(0.0);
        RATE * along + (step - self.direction * along).length()
    }

    /// Radians that a turn uses up: a bound on how far the planes' normals are from where the counted angle would take them.
    fn used_rad(&self, last: &Pose, pose: &Pose) -> f64 {
        let about = if self.turn_per_m > 0.0 {
            self.turn_per_m * (pose.eye_m - last.eye_m).dot(self.direction).max(0.0)
        } else {
            portable::asin(last.turn_to(pose).dot(self.axis).clamp(0.0, 1.0))
        };
        let expected = turn_about(if about > 0.0 { self.axis } else { DVec3::Z }, about);
        let off = |i: usize| (pose.normals[i] - expected * last.normals[i]).length();
        RATE * about + (0..4).map(off).fold(0.0, f64::max)
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
    fn turn_to(&self, other: &Self) -> DVec3 {
        0.5 * (0..3).map(|i| self.axes[i].cross(other.axes[i])).sum::<DVec3>()
    }
}

/// The smallest band that covers `scale` times the metres of band 0.
#[inline(always)]
pub(crate) fn band_of(scale: f64) -> usize {
    // The binary exponent, rounded up; NaN and infinity end in the last band.
    let bits = scale.to_bits() + ((1 << 52) - 1);
    ((bits >> 52) as i64 - 1023).clamp(0, BANDS as i64 - 1) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_cover_what_they_stand_for() {
        for scale in [
            0.0,
            1e-9,
            0.5,
            1.0,
            1.0001,
            2.0,
            2.5,
            4.0,
            1000.0,
            16384.0,
            16385.0,
            1e9,
            f64::INFINITY,
            f64::NAN,
        ] {
            let band = band_of(scale);
            assert!(band == BANDS - 1 || scale <= f64::from(1u32 << band), "{scale} {band}");
            assert!(band == 0 || band == BANDS - 1 || scale > f64::from(1u32 << (band - 1)));
        }
    }

    fn pose(eye_m: DVec3) -> Pose {
        Pose {
            eye_m,
            axes: [DVec3::X, DVec3::Z, DVec3::Y],
            normals: [DVec3::X; 4],
            nu: 100.0,
            exaggeration: 1.0,
        }
    }

    #[test]
    fn slow_flight_advances_the_clocks() {
        let mut clocks = Clocks::new(256.0, 0.0);
        let start = clocks.now(0);
        for i in 0..4096 {
            clocks.move_to(pose(DVec3::X * (f64::from(i) / 1024.0)));
        }
        assert!(clocks.now(0) >= start + 3, "{}", clocks.now(0));
    }

    #[test]
    fn a_straight_flight_takes_its_course_and_uses_little_of_it() {
        let mut clocks = Clocks::new(256.0, 0.0);
        let mut taken = 0;
        for i in 0..100 {
            let moved = clocks.move_to(pose(DVec3::Y * f64::from(10 * i)));
            if let Some((course, direction)) = moved.next_course {
                clocks.take_course(course, direction);
                taken += 1;
            }
        }
        assert_eq!((taken, clocks.course().0), (1, 1));
        let (of_course, of_path) =
            (clocks.now(clock_id(1, Kind::Error, 3)), clocks.now(clock_id(0, Kind::Error, 3)));
        assert!(of_path > 980 && of_course < 120, "{of_path} {of_course}");
    }

    #[test]
    fn turning_uses_up_words_that_rest_on_planes_and_zooming_all() {
        let mut clocks = Clocks::new(1.0, 0.0);
        clocks.move_to(pose(DVec3::ZERO));
        let turned = Pose { normals: [DVec3::Y; 4], ..pose(DVec3::ZERO) };
        let moved = clocks.move_to(turned);
        for course in 0..COURSES {
            for band in 0..BANDS {
                assert_eq!(moved.clocks >> clock_id(course, Kind::Error, band) & 1, 0);
                assert_eq!(moved.clocks >> clock_id(course, Kind::Planes, band) & 1, 1);
            }
        }
        assert_eq!(clocks.move_to(turned).clocks, 0, "standing still uses up nothing");
        assert_eq!(clocks.move_to(Pose { nu: 200.0, ..turned }).clocks, u128::MAX);
    }
}
