//! The straight flight: a level line through the terrain's middle, as in the fly-overs of Bao et al. (2004).
//!
//! The eye is over the terrain in every frame and always has a fifth of it ahead.

use super::{FlightPlan, Pose, Stage, folded};

/// Where the line starts and ends, as parts of the extent along it.
const LINE: [f64; 2] = [0.05, 0.80];
/// Climb of the line of sight in degrees.
pub(super) const PITCH_DEG: f64 = -15.0;

pub(super) fn path(stage: &Stage, plan: &FlightPlan) -> impl Fn(u64) -> Pose + use<> {
    let east = stage.extent_m[0] >= stage.extent_m[1];
    let (middle, length, up) = (stage.middle_m(), stage.longer_m(), stage.cruise_m());
    let (near, far) = (LINE[0] * length, LINE[1] * length);
    let speed = plan.speed_m_per_frame;
    let flown = speed * (plan.frames - 1) as f64;
    // Centred as long as both ends stay on the line; later the start moves towards its near end.
    let start = if flown < far - near { (0.5 * (length - flown)).clamp(near, far - flown) } else { near };
    move |i| {
        let along = near + folded(start - near + speed * i as f64, far - near);
        let eye_m = if east { [along, middle[1], up] } else { [middle[0], along, up] };
        Pose { eye_m, yaw_deg: if east { 90.0 } else { 0.0 }, pitch_deg: PITCH_DEG }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Hills, puget};
    use super::super::{FlightKind, FlightPlan, generate};

    #[test]
    fn a_short_flight_has_the_middle_in_its_own() {
        let flight = generate(&puget(), &FlightPlan::new(FlightKind::Straight, 1001, 12.0)).unwrap();
        let (first, last) = (flight.frames[0], flight.frames[1000]);
        assert!((0.5 * (first.eye_m[0] + last.eye_m[0]) - 81_920.0).abs() < 1e-6);
        assert_eq!((first.yaw_deg, first.pitch_deg, first.vertical_fov_deg), (90.0, -15.0, 45.0));
        assert_eq!(first.eye_m[2], 4000.0 + 1638.4);
        assert_eq!(last.time_s, 1000.0 / 30.0);
    }

    #[test]
    fn a_long_flight_goes_forth_and_back_without_turning() {
        let ground = Hills { extent_m: [1000.0, 5000.0], ..puget() };
        let flight = generate(&ground, &FlightPlan::new(FlightKind::Straight, 2001, 10.0)).unwrap();
        let north: Vec<f64> = flight.frames.iter().map(|f| f.eye_m[1]).collect();
        assert!(north.iter().all(|n| (250.0 - 1e-6..=4000.0 + 1e-6).contains(n)));
        assert!(north.windows(2).any(|w| w[1] < w[0]) && north.windows(2).any(|w| w[1] > w[0]));
        assert!(flight.frames.iter().all(|f| f.yaw_deg == 0.0 && f.eye_m[0] == 500.0));
    }
}
