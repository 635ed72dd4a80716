//! How much of every live range has been used up: clocks that advance with the camera's movement, in metres of margin.
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART", section 4 (eq. 11 and 12), corrected and widened. A status holds while its margin is
//! positive. A clock adds up, rounded up, how much the camera's movement can have taken from the margin since. There is one clock for every combination of
//!
//! * a *course*: the direction the eye is expected to keep, and the axis it is expected to turn about. Course 0 expects nothing and counts the whole
//!   path and every turn. Any other course counts its `rate` times the way along its direction and the angle about its axis, and all of the way and angle that goes off
//!   them. What lies ahead on the course was taken into account when the margin was made (`super::certificate`). A word made on one course stays on it
//!   when the eye takes another;
//! * a *kind*: whether the status depends on the view's planes, so that turning uses it up too;
//! * a *band*: a power of two that bounds the distances which turning (by an angle) and zooming (by a ratio) act on.
//!
//! Claim: with L = f0 + floor(m / q), m metres of margin made at tick f0 and ticks of q metres, `f < L` implies that less than m has been used.
//! Proof: a rounding down rho of the total has rho(x) - rho(y) > x - y - 1 in ticks. Cost: some hundred additions a frame.

use super::course::{Bend, Course, LONG, Pose, Trend};
use crate::view::ErrorMetric;
use glam::DVec3;
use terrasoar_layout::portable;

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

/// The course of a clock.
fn course_of(clock: usize) -> usize {
    clock / (2 * BANDS) % COURSES
}

/// Number of a clock.
pub(crate) const fn clock_id(course: usize, kind: Kind, band: usize) -> usize {
    course * 2 * BANDS + (kind as usize) * BANDS + band
}

/// The clocks of one engine.
#[derive(Debug)]
pub(crate) struct Clocks {
    /// Used since a clock was last set back, in units.
    totals: [u64; CLOCKS],
    /// Units that the newest move has used.
    steps: [u64; CLOCKS],
    /// Units a tick, by course: 2^shift.
    shifts: [u32; COURSES],
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
    bend: Bend,
    /// Metres and radians of the newest move that the next course would have counted.
    next_counts: (f64, f64),
    /// Share of the way, or of the turn, that went off the current course, over a long time.
    off: f64,
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
            shifts: [shift; COURSES],
            least_band_m: 4.0 * spacing_m,
            tallest_m,
            last: None,
            courses: [Course::default(); COURSES],
            current: 0,
            newest: 0,
            way: Trend::default(),
            turn: Trend::default(),
            bend: Bend::default(),
            next_counts: (0.0, 0.0),
            off: 1.0,
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
        // Another measure is another mesh.
        let zoomed = if pose.metric == last.metric { zoomed } else { f64::INFINITY };
        let mut moved = Moved::default();
        if step == DVec3::ZERO && pose.normals == last.normals && raised_m + zoomed == 0.0 {
            return moved;
        }
        for course in 0..COURSES {
            let beyond = (u64::from(HORIZON) + 1) << self.shifts[course];
            let (used_m, used_rad) = self.courses[course].counts(&last, &pose);
            for (kind, angle) in [(Kind::Error, zoomed), (Kind::Planes, zoomed + used_rad)] {
                if used_m + raised_m + angle == 0.0 {
                    continue;
                }
                for band in 0..BANDS {
                    let clock = clock_id(course, kind, band);
                    // Beyond the horizon nothing is alive.
                    let units = self.units(used_m + raised_m, angle, band).min(beyond) + 1;
                    self.totals[clock] += units;
                    self.steps[clock] = units;
                    moved.clocks |= 1 << clock;
                }
            }
        }
        let current = self.courses[self.current];
        let (turn, used_rad) = (last.turn_to(&pose), current.used_rad(&last, &pose));
        self.way.follow(step, current.used_m(step));
        self.turn.follow(turn, used_rad);
        let (way_m, turn_rad) = (step.length(), turn.length());
        let off_way = if way_m > 0.0 { current.off_m(step) / way_m } else { 0.0 };
        let is_about = current.axis != DVec3::ZERO && turn_rad > 0.0;
        let off_turn = if is_about { (used_rad / turn_rad - current.rate).max(0.0) } else { 0.0 };
        if way_m > 0.0 || is_about {
            self.off += LONG * (off_way.max(off_turn) - self.off);
        }
        self.bend.follow(step);
        self.courses.iter_mut().for_each(|course| course.lead_on(step));
        // Certificates by the line of sight know of no curves that would be of use.
        let bend = if pose.metric == ErrorMetric::Ball { self.bend } else { Bend::default() };
        let next = Course::of(&self.way, &self.turn, &bend);
        // Whoever keeps no direction is on no course that could be better.
        let changes =
            |off: bool, current: DVec3, next: DVec3| off && (current != DVec3::ZERO || next != DVec3::ZERO);
        let steady_rate = next.steady_rate(self.off);
        if changes(self.way.is_off(current.rate), current.direction, next.direction)
            || changes(self.turn.is_off(current.rate), current.axis, next.axis)
        {
            self.off = 1.0;
            if next.direction == DVec3::ZERO && next.axis == DVec3::ZERO {
                self.current = 0;
            } else {
                moved.next_course = Some((self.newest % (COURSES - 1) + 1, next));
            }
        } else if steady_rate < current.rate && next.is_like(&current) {
            let steady = Course { rate: steady_rate, ..next };
            moved.next_course = Some((self.newest % (COURSES - 1) + 1, steady));
        }
        if let Some((_, next)) = moved.next_course {
            self.next_counts = next.before(step).counts(&last, &pose);
        }
        moved
    }

    /// Units of a way and an angle, rounded up. [`Clocks::move_to`] adds one more, for the rounding of the sum itself.
    fn units(&self, metres: f64, angle: f64, band: usize) -> u64 {
        let metres = metres + if angle > 0.0 { self.band_m(band) * angle } else { 0.0 };
        (metres * UNITS_PER_M).ceil() as u64
    }

    /// Makes new words on course `number` from now on. No word may be left on it, for its clocks start again.
    pub(crate) fn take_course(&mut self, number: usize, course: Course) {
        // The less of the way is counted, the shorter are ticks: who is tested a tick too early is tested again.
        let shift = self.shifts[0].saturating_sub(portable::log2(1.0 / course.rate).round() as u32);
        self.shifts[number] = shift;
        for clock in (0..CLOCKS).filter(|clock| course_of(*clock) == number) {
            self.totals[clock] = 1 << shift;
            // What the newest move would have taken on it.
            let (used_m, used_rad) = self.next_counts;
            let angle = if clock / BANDS % 2 == Kind::Planes as usize { used_rad } else { 0.0 };
            let beyond = (u64::from(HORIZON) + 1) << shift;
            self.steps[clock] = self.units(used_m, angle, clock % BANDS).min(beyond);
        }
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
        self.totals[clock] >> self.shifts[course_of(clock)]
    }

    /// Ticks, and parts of them, that the newest move took on a clock.
    pub(crate) fn newest_step(&self, clock: usize) -> f32 {
        self.steps[clock] as f32 / (1u64 << self.shifts[course_of(clock)]) as f32
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
        self.totals[clock] -= (now - 1) << self.shifts[course_of(clock)];
        Some(now - 1)
    }

    /// Ticks a metre, of the clocks that new words are made on.
    pub(crate) fn ticks_per_m(&self) -> f64 {
        UNITS_PER_M / (1u64 << self.shifts[self.current]) as f64
    }

    /// How many ticks of course `number` make one of course 0: 2^bits.
    pub(crate) fn finer_bits(&self, number: usize) -> u32 {
        self.shifts[0] - self.shifts[number]
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

/// The smallest band that covers `scale` times the metres of band 0.
#[inline(always)]
pub(crate) fn band_of(scale: f64) -> usize {
    // The binary exponent, rounded up; NaN and infinity end in the last band.
    let bits = scale.to_bits() + ((1 << 52) - 1);
    ((bits >> 52) as i64 - 1023).clamp(0, BANDS as i64 - 1) as usize
}

/// 2^exponent, for small exponents, by its bits.
#[inline(always)]
pub(crate) fn power_of_two(exponent: usize) -> f64 {
    f64::from_bits((exponent as u64 + 1023) << 52)
}

#[cfg(test)]
mod tests {
    use super::super::course::{RATE, STEADY_CURVE_RATES, STEADY_RATES};
    use super::*;
    use crate::view::ErrorMetric;

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
            assert_eq!(power_of_two(band), f64::from(1u32 << band));
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
            metric: ErrorMetric::Ball,
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
        for i in 0..30 {
            let moved = clocks.move_to(pose(DVec3::Y * f64::from(10 * i)));
            if let Some((course, direction)) = moved.next_course {
                clocks.take_course(course, direction);
                taken += 1;
            }
        }
        assert_eq!((taken, clocks.course().0), (1, 1));
        let (of_course, of_path) =
            (clocks.now(clock_id(1, Kind::Error, 3)), clocks.now(clock_id(0, Kind::Error, 3)));
        let of_course = of_course >> clocks.finer_bits(1);
        assert!(of_path > 280 && of_course < 50, "{of_path} {of_course}");
    }

    /// A course is flown at the lower rate once it has been kept for long, and given up for another at the first bend.
    #[test]
    fn a_long_straight_way_is_steady_until_it_bends() {
        let mut clocks = Clocks::new(256.0, 0.0);
        let mut at = DVec3::ZERO;
        let mut fly = |clocks: &mut Clocks, steps: usize, step: DVec3| {
            let mut taken = Vec::new();
            for _ in 0..steps {
                at += step;
                if let Some((number, course)) = clocks.move_to(pose(at)).next_course {
                    clocks.take_course(number, course);
                    taken.push(course.rate);
                }
            }
            taken
        };
        assert_eq!(fly(&mut clocks, 30, DVec3::Y * 10.0), [RATE]);
        assert_eq!(fly(&mut clocks, 200, DVec3::Y * 10.0), STEADY_RATES.map(|(rate, _)| rate));
        assert_eq!(clocks.course().1.direction, DVec3::Y);
        let bent = DVec3::new(1.0, 9.9, 0.0);
        let taken = fly(&mut clocks, 30, bent);
        assert!(!taken.is_empty() && taken.iter().all(|rate| *rate == RATE), "{taken:?}");
        assert!(clocks.course().1.direction.dot(bent.normalize()) > 0.98);
    }

    /// A circle is a course of its own, flown at a lower rate before long, and its clocks count nearly nothing else.
    #[test]
    fn a_circle_is_kept_as_long_as_it_is_flown() {
        let mut clocks = Clocks::new(256.0, 0.0);
        let at = |i: i32| {
            let (sin, cos) = (f64::from(i) * 0.01).sin_cos();
            Pose {
                normals: [DVec3::new(cos, sin, 0.0); 4],
                axes: [DVec3::new(cos, sin, 0.0), DVec3::Z, DVec3::new(-sin, cos, 0.0)],
                ..pose(1000.0 * DVec3::new(cos, sin, 0.0))
            }
        };
        let taken: Vec<f64> = (0..700)
            .filter_map(|i| {
                let (number, course) = clocks.move_to(at(i)).next_course?;
                clocks.take_course(number, course);
                (course.curve != DVec3::ZERO).then_some(course.rate)
            })
            .collect();
        let [(first, _), (steady, _)] = STEADY_CURVE_RATES;
        assert_eq!(taken, [RATE, first, steady]);
        let (number, course) = clocks.course();
        assert!((course.curve - DVec3::Z / 1000.0).length() < 1e-6, "{course:?}");
        let before = clocks.now(clock_id(number, Kind::Planes, 6));
        (700..800).for_each(|i| {
            clocks.move_to(at(i));
        });
        // 1,000 m of way, and a turn of 1 on an arm of 65,536 m.
        let used_m = (clocks.now(clock_id(number, Kind::Planes, 6)) - before) as f64 / clocks.ticks_per_m();
        assert!(used_m < 1.1 * steady * (1000.0 + 65_536.0), "{used_m}");
    }

    #[test]
    fn who_looks_around_may_be_on_a_steady_way() {
        let mut clocks = Clocks::new(256.0, 0.0);
        let taken: Vec<f64> = (0..200)
            .filter_map(|i| {
                let (sin, cos) = (0.02 * f64::from(i % 7)).sin_cos();
                let forward = DVec3::new(sin, cos, 0.0);
                let ahead = Pose {
                    axes: [DVec3::new(cos, -sin, 0.0), DVec3::Z, forward],
                    normals: [forward; 4],
                    ..pose(DVec3::Y * f64::from(10 * i))
                };
                let (number, course) = clocks.move_to(ahead).next_course?;
                clocks.take_course(number, course);
                Some(course.rate)
            })
            .collect();
        assert_eq!(taken.last(), Some(&STEADY_RATES[1].0), "{taken:?}");
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
        clocks.move_to(Pose { metric: ErrorMetric::Sight, nu: 200.0, ..turned });
        assert!(
            (0..CLOCKS).all(|clock| clocks.now(clock) >= u64::from(HORIZON)),
            "nothing outlives a change of the measure"
        );
    }
}
