//! The orbit: level and clockwise round the terrain's middle, looking at it.
//!
//! The eye is a quarter of the shorter extent away from the middle in every frame.

use super::{FlightPlan, Pose, Stage};
use terrasoar_layout::portable::{atan2, sin_cos};

pub(super) fn path(stage: &Stage, plan: &FlightPlan) -> impl Fn(u64) -> Pose + use<> {
    let middle = stage.middle_m();
    let radius = 0.25 * stage.shorter_m();
    let up = stage.highest_m + 0.05 * stage.shorter_m();
    let target = 0.5 * (stage.lowest_m + stage.highest_m);
    let pitch_deg = atan2(target - up, radius).to_degrees();
    let step_rad = plan.speed_m_per_frame / radius;
    move |i| {
        // Bearing of the eye from the middle.
        let bearing = (step_rad * i as f64).rem_euclid(std::f64::consts::TAU);
        let (sin, cos) = sin_cos(bearing);
        let eye_m = [middle[0] + radius * sin, middle[1] + radius * cos, up];
        Pose { eye_m, yaw_deg: bearing.to_degrees() + 180.0, pitch_deg }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Hills, puget};
    use super::super::{FlightKind, FlightPlan, generate};
    use crate::view::Viewport;
    use glam::DVec3;

    #[test]
    fn the_middle_stays_in_the_middle_of_the_picture() {
        let ground = Hills { extent_m: [9000.0, 4000.0], ..puget() };
        for frame in generate(&ground, &FlightPlan::new(FlightKind::Orbit, 300, 40.0)).unwrap().frames {
            let view = frame.view(Viewport::default(), 1.0);
            let target = DVec3::new(4500.0, 2000.0, 2000.0);
            let [_, _, forward] = view.axes();
            assert!((forward - (target - view.eye_m).normalize()).length() < 1e-9);
        }
    }
}
