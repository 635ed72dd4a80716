//! Flights made over a terrain: straight, orbit, terrain-following and turning.
//!
//! Every frame follows from its number by a formula, so nothing drifts however long the flight is. **The eye stays over
//! the terrain in every flight.** A frame costs a few sines; the terrain-following flight reads 16,384 heights
//! first and one a frame.

mod follow;
mod orbit;
mod straight;
mod terrain_ground;
mod turn;

pub use terrain_ground::TerrainGround;

use super::format::{MAGIC, MAX_FRAMES, UNITS, VERSION, fault_in, values};
use super::{Flight, FlightFrame};
use std::str::FromStr;

/// Frames a second of the times written into generated flights.
pub(crate) const FRAMES_PER_SECOND: f64 = 30.0;

/// The ground that a flight is made over.
pub trait Ground {
    /// Metres from the first to the last sample, east and north; each above 0.
    fn extent_m(&self) -> [f64; 2];

    /// Height in metres at a place given in metres east and north; `None` for void ground or outside.
    fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64>;

    /// Lowest and highest height in metres.
    fn height_range_m(&self) -> [f64; 2];
}

/// What a generated flight does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FlightKind {
    /// Level, along the terrain's longer axis (east if it is square) through its middle, looking ahead and 15
    /// degrees down. The line has a fifth of the terrain ahead of its far end and a twentieth behind its near one; a shorter
    /// flight has the terrain's middle in its own, a longer one goes forth and back without turning the camera.
    Straight,
    /// Level, clockwise on a circle a quarter of the shorter extent round the terrain's middle, looking at it.
    Orbit,
    /// Over the ground at a clearance of 0.2 % of the longer extent, at least 2 m, on a smooth closed path that
    /// bends one way and the other, looking along it.
    Terrain,
    /// Level, on a circle with the turn rate and speed given, looking ahead and 15 degrees down. Speed 0 spins on
    /// the spot. Where the terrain has no room for the circle the path is mirrored at its edges; the camera is not.
    Turn,
}

impl FlightKind {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Straight, Self::Orbit, Self::Terrain, Self::Turn];

    /// The kind's name on command lines and in flight files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Straight => "straight",
            Self::Orbit => "orbit",
            Self::Terrain => "terrain",
            Self::Turn => "turn",
        }
    }
}

impl FromStr for FlightKind {
    type Err = GenerateError;

    fn from_str(name: &str) -> Result<Self, GenerateError> {
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| GenerateError::Kind { found: name.chars().take(40).collect() })
    }
}

/// What flight to make.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct FlightPlan {
    /// What the flight does.
    pub kind: FlightKind,
    /// Frames, 1..=[`MAX_FRAMES`].
    pub frames: u64,
    /// Metres along the path from a frame to the next, 0..=1e9.
    pub speed_m_per_frame: f64,
    /// Degrees of heading a frame, positive to the right, above 0 and up to 90 either way; only
    /// [`FlightKind::Turn`] heeds it. Default 0.5.
    pub turn_rate_deg_per_frame: f64,
    /// Vertical field of view in degrees, above 0 and below 180. Default 45.
    pub vertical_fov_deg: f64,
}

impl FlightPlan {
    /// A plan with the default turn rate and field of view.
    pub fn new(kind: FlightKind, frames: u64, speed_m_per_frame: f64) -> Self {
        Self { kind, frames, speed_m_per_frame, turn_rate_deg_per_frame: 0.5, vertical_fov_deg: 45.0 }
    }

    /// This plan with another rate of turn, in degrees of heading a frame.
    pub fn turn_rate_deg_per_frame(self, turn_rate_deg_per_frame: f64) -> Self {
        Self { turn_rate_deg_per_frame, ..self }
    }

    /// This plan with another vertical field of view in degrees.
    pub fn vertical_fov_deg(self, vertical_fov_deg: f64) -> Self {
        Self { vertical_fov_deg, ..self }
    }
}

/// Why a flight cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GenerateError {
    /// No such kind of flight.
    #[error("there is no flight `{found}`; choose straight, orbit, terrain or turn")]
    Kind {
        /// The name given.
        found: String,
    },
    /// A parameter of the plan outside its range.
    #[error("the flight's {parameter} is {found}; it must be {allowed}")]
    Parameter {
        /// The parameter.
        parameter: &'static str,
        /// Its value.
        found: f64,
        /// The range allowed, in words.
        allowed: &'static str,
    },
    /// The terrain's size or heights are not what a flight can be made over.
    #[error(
        "the terrain's {what} is {found} m; a flight needs it to be {allowed}; check the terrain's spacing and height scale"
    )]
    Ground {
        /// What of the terrain.
        what: &'static str,
        /// Its value in metres.
        found: f64,
        /// The range allowed, in words.
        allowed: &'static str,
    },
}

/// Where the eye is and where it looks: position in metres, yaw and pitch in degrees.
struct Pose {
    eye_m: [f64; 3],
    yaw_deg: f64,
    pitch_deg: f64,
}

/// The terrain's measures as the flights use them, checked.
struct Stage {
    extent_m: [f64; 2],
    lowest_m: f64,
    highest_m: f64,
}

impl Stage {
    fn of(ground: &dyn Ground) -> Result<Self, GenerateError> {
        let (extent_m, [lowest_m, highest_m]) = (ground.extent_m(), ground.height_range_m());
        for (what, found) in [("width", extent_m[0]), ("length", extent_m[1])] {
            if !(found > 0.0 && found <= 1e8) {
                return Err(GenerateError::Ground { what, found, allowed: "above 0 and at most 1e8" });
            }
        }
        for (what, found) in [("lowest height", lowest_m), ("highest height", highest_m)] {
            if !(-1e8..=1e8).contains(&found) {
                return Err(GenerateError::Ground { what, found, allowed: "from -1e8 to 1e8" });
            }
        }
        Ok(Self { extent_m, lowest_m: lowest_m.min(highest_m), highest_m: highest_m.max(lowest_m) })
    }

    fn middle_m(&self) -> [f64; 2] {
        self.extent_m.map(|e| 0.5 * e)
    }

    fn longer_m(&self) -> f64 {
        self.extent_m[0].max(self.extent_m[1])
    }

    fn shorter_m(&self) -> f64 {
        self.extent_m[0].min(self.extent_m[1])
    }

    /// Height of level flights that look ahead: over the highest ground by a hundredth of the longer extent.
    fn cruise_m(&self) -> f64 {
        self.highest_m + 0.01 * self.longer_m()
    }
}

/// Name of the first note of every flight made here.
const FIRST_NOTE: &str = "flight";

/// Whether a flight file that begins with `start` was made here: 100 bytes are enough. One that was recorded or written by hand has no such note.
pub fn is_generated(start: &[u8]) -> bool {
    let beginning = |kind: FlightKind| {
        format!("{MAGIC} {VERSION}\n{}\n# {FIRST_NOTE}: {}\n", UNITS.join(" "), kind.name())
    };
    FlightKind::ALL.into_iter().any(|kind| start.starts_with(beginning(kind).as_bytes()))
}

/// Makes the flight of `plan` over `ground`. Equal input gives equal frames.
///
/// # Errors
/// [`GenerateError`] for a plan or a ground outside its ranges.
pub fn generate(ground: &dyn Ground, plan: &FlightPlan) -> Result<Flight, GenerateError> {
    check(plan)?;
    let stage = Stage::of(ground)?;
    let poses: Box<dyn Fn(u64) -> Pose + '_> = match plan.kind {
        FlightKind::Straight => Box::new(straight::path(&stage, plan)),
        FlightKind::Orbit => Box::new(orbit::path(&stage, plan)),
        FlightKind::Terrain => Box::new(follow::path(&stage, plan, ground)),
        FlightKind::Turn => Box::new(turn::path(&stage, plan)),
    };
    let frames: Vec<FlightFrame> = (0..plan.frames)
        .map(|i| {
            let pose = poses(i);
            FlightFrame {
                time_s: i as f64 / FRAMES_PER_SECOND,
                eye_m: pose.eye_m,
                yaw_deg: wrapped_deg(pose.yaw_deg),
                pitch_deg: pose.pitch_deg,
                roll_deg: 0.0,
                vertical_fov_deg: plan.vertical_fov_deg,
            }
        })
        .collect();
    debug_assert!(frames.iter().all(|f| fault_in(&values(f)).is_none()), "generated frames fit the format");
    let mut notes = vec![
        (FIRST_NOTE.to_owned(), plan.kind.name().to_owned()),
        ("speed-m-per-frame".to_owned(), plan.speed_m_per_frame.to_string()),
    ];
    if plan.kind == FlightKind::Turn {
        notes.push(("turn-rate-deg-per-frame".to_owned(), plan.turn_rate_deg_per_frame.to_string()));
    }
    Ok(Flight { notes, frames })
}

fn check(plan: &FlightPlan) -> Result<(), GenerateError> {
    let rate = plan.turn_rate_deg_per_frame;
    for (parameter, found, inside, allowed) in [
        (
            "number of frames",
            plan.frames as f64,
            (1..=MAX_FRAMES).contains(&plan.frames),
            "from 1 to 10000000",
        ),
        (
            "speed in metres a frame",
            plan.speed_m_per_frame,
            (0.0..=1e9).contains(&plan.speed_m_per_frame),
            "from 0 to 1e9",
        ),
        (
            "turn rate in degrees a frame",
            rate,
            plan.kind != FlightKind::Turn || (1e-6..=90.0).contains(&rate.abs()),
            "from 1e-6 to 90 to either side",
        ),
        (
            "vertical field of view in degrees",
            plan.vertical_fov_deg,
            plan.vertical_fov_deg > 0.0 && plan.vertical_fov_deg < 180.0,
            "above 0 and below 180",
        ),
    ] {
        if !inside {
            return Err(GenerateError::Parameter { parameter, found, allowed });
        }
    }
    Ok(())
}

/// `angle_deg` in 0..360.
fn wrapped_deg(angle_deg: f64) -> f64 {
    let wrapped = angle_deg.rem_euclid(360.0);
    if wrapped < 360.0 { wrapped } else { 0.0 }
}

/// `x` mirrored at 0 and `length` as often as it takes to lie between them.
fn folded(x: f64, length: f64) -> f64 {
    let phase = x.rem_euclid(2.0 * length);
    if phase <= length { phase } else { (2.0 * length - phase).max(0.0) }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Hills with a void patch, for tests.
    pub(crate) struct Hills {
        pub(crate) extent_m: [f64; 2],
        pub(crate) base_m: f64,
        pub(crate) relief_m: f64,
        pub(crate) void_from: f64,
    }

    impl Ground for Hills {
        fn extent_m(&self) -> [f64; 2] {
            self.extent_m
        }

        fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
            let (x, y) = (east_m / self.extent_m[0], north_m / self.extent_m[1]);
            let inside = (0.0..=1.0).contains(&x) && (0.0..=1.0).contains(&y);
            let wave = 0.5 + 0.5 * (40.0 * x).sin() * (31.0 * y).cos();
            (inside && x < self.void_from).then_some(self.base_m + self.relief_m * wave)
        }

        fn height_range_m(&self) -> [f64; 2] {
            [self.base_m, self.base_m + self.relief_m]
        }
    }

    pub(crate) fn puget() -> Hills {
        Hills { extent_m: [163_840.0, 163_840.0], base_m: 0.0, relief_m: 4000.0, void_from: 2.0 }
    }

    pub(super) fn step_m(a: &FlightFrame, b: &FlightFrame) -> f64 {
        a.eye_m.iter().zip(b.eye_m).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn names_read_back() {
        for kind in FlightKind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        let error = "zigzag".parse::<FlightKind>().unwrap_err().to_string();
        assert!(error.contains("`zigzag`") && error.contains("choose straight"), "{error}");
    }

    #[test]
    fn plans_and_grounds_outside_their_ranges_are_refused() {
        let good = FlightPlan::new(FlightKind::Turn, 10, 5.0);
        for (plan, says) in [
            (FlightPlan { frames: 0, ..good }, "number of frames is 0"),
            (FlightPlan { frames: MAX_FRAMES + 1, ..good }, "number of frames"),
            (FlightPlan { speed_m_per_frame: -1.0, ..good }, "speed in metres a frame is -1"),
            (FlightPlan { speed_m_per_frame: f64::NAN, ..good }, "speed"),
            (FlightPlan { turn_rate_deg_per_frame: 0.0, ..good }, "turn rate"),
            (FlightPlan { vertical_fov_deg: 180.0, ..good }, "field of view"),
        ] {
            let error = generate(&puget(), &plan).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        for ground in [
            Hills { extent_m: [0.0, 5.0], ..puget() },
            Hills { extent_m: [5.0, f64::INFINITY], ..puget() },
            Hills { base_m: f64::NAN, ..puget() },
        ] {
            assert!(matches!(generate(&ground, &good), Err(GenerateError::Ground { .. })));
        }
    }

    #[test]
    fn all_kinds_move_at_the_speed_asked_for() {
        for kind in FlightKind::ALL {
            let flight = generate(&puget(), &FlightPlan::new(kind, 400, 15.0)).unwrap();
            for pair in flight.frames.windows(2) {
                let step = step_m(&pair[0], &pair[1]);
                let level = (step.powi(2) - (pair[0].eye_m[2] - pair[1].eye_m[2]).powi(2)).sqrt();
                assert!((level - 15.0).abs() < 0.02, "{kind:?}: {level}");
                assert!((step - 15.0).abs() < 2.0, "{kind:?}: {step}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(96))]
        #[test]
        fn any_flight_over_any_ground_is_sound(
            kind in prop::sample::select(FlightKind::ALL.to_vec()),
            width_exp in 0.0..6.8f64,
            aspect_exp in -3.0..=0.0f64,
            tall in any::<bool>(),
            base_m in -500.0..4000.0f64,
            relief_m in prop_oneof![Just(0.0), 0.0..9000.0f64],
            void_from in prop_oneof![Just(2.0), Just(0.0), 0.0..1.0f64],
            speed in prop_oneof![Just(0.0), Just(1e9), (-4.0..8.0f64).prop_map(|e| 10f64.powf(e))],
            rate in prop_oneof![Just(0.5), Just(-0.5), Just(1e-6), Just(90.0), -90.0..-1e-6f64],
            frames in 1u64..60,
        ) {
            let (long, short) = (10f64.powf(width_exp), 10f64.powf(width_exp + aspect_exp));
            let extent_m = if tall { [short, long] } else { [long, short] };
            let ground = Hills { extent_m, base_m, relief_m, void_from };
            let plan = FlightPlan { turn_rate_deg_per_frame: rate, ..FlightPlan::new(kind, frames, speed) };
            let flight = generate(&ground, &plan).unwrap();
            prop_assert_eq!(flight.frames.len() as u64, frames);
            for frame in &flight.frames {
                prop_assert!(fault_in(&values(frame)).is_none(), "{frame:?}");
                prop_assert!((0.0..360.0).contains(&frame.yaw_deg));
                for axis in 0..2 {
                    prop_assert!((0.0..=extent_m[axis]).contains(&frame.eye_m[axis]), "{frame:?} {extent_m:?}");
                }
                if let Some(height) = ground.height_m(frame.eye_m[0], frame.eye_m[1]) {
                    prop_assert!(frame.eye_m[2] > height, "{frame:?} under {height}");
                }
            }
            prop_assert_eq!(&generate(&ground, &plan).unwrap(), &flight);
            // What is generated can be kept.
            flight.write_to(Vec::new(), std::path::Path::new("x")).unwrap();
        }

        #[test]
        fn folding_stays_inside_and_keeps_small_steps(x in -1e6..1e6f64, step in 0.0..10.0f64, length in 20.0..1e4f64) {
            let (a, b) = (folded(x, length), folded(x + step, length));
            prop_assert!((0.0..=length).contains(&a));
            prop_assert!((a - b).abs() <= step + 1e-6);
        }
    }
}
