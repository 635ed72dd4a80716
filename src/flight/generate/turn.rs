//! The turning flight: constant speed, constant turn.
//!
//! Steps of equal length whose heading turns by the same angle add up to the chord of a circle, so frame i is at
//! `speed * sin(i rate / 2) / sin(rate / 2)` from the start, in the heading halfway. So there is no sum, no drift, and no
//! difference of large numbers when the circle is wide.

use super::straight::PITCH_DEG;
use super::{FlightPlan, Pose, Stage, folded};
use terrasoar_layout::portable::sin_cos;

/// Headings tried for the start, and places looked at along the arc.
const HEADINGS: u32 = 36;
const LOOKS: u32 = 720;

pub(super) fn path(stage: &Stage, plan: &FlightPlan) -> impl Fn(u64) -> Pose + use<> {
    let (extent, up) = (stage.extent_m, stage.cruise_m());
    let arc = Arc { speed_m: plan.speed_m_per_frame, rate_deg: plan.turn_rate_deg_per_frame };
    let (start_deg, start) = arc.best_start(stage, plan.frames);
    move |i| {
        let [east, north] = arc.offset_m(start_deg, i as f64);
        Pose {
            eye_m: [folded(start[0] + east, extent[0]), folded(start[1] + north, extent[1]), up],
            yaw_deg: start_deg + arc.turned_deg(i as f64),
            pitch_deg: PITCH_DEG,
        }
    }
}

struct Arc {
    speed_m: f64,
    rate_deg: f64,
}

impl Arc {
    /// Degrees turned after `i` frames, within a turn of 0.
    fn turned_deg(&self, i: f64) -> f64 {
        (self.rate_deg * i) % 360.0
    }

    /// Metres east and north of the start after `i` frames.
    fn offset_m(&self, start_deg: f64, i: f64) -> [f64; 2] {
        let half_deg = (0.5 * self.rate_deg * i) % 360.0;
        let chord =
            self.speed_m * sin_cos(half_deg.to_radians()).0 / sin_cos((0.5 * self.rate_deg).to_radians()).0;
        let (sin, cos) = sin_cos((start_deg + half_deg).to_radians());
        [chord * sin, chord * cos]
    }

    /// Heading in degrees and place of the start that put the arc's bounds in the terrain's middle and, of the
    /// headings tried, leave it the most room.
    fn best_start(&self, stage: &Stage, frames: u64) -> (f64, [f64; 2]) {
        let middle = stage.middle_m();
        // One turn at most; what follows repeats it.
        let last = ((frames - 1) as f64).min((360.0 / self.rate_deg.abs()).ceil());
        let mut best = (f64::INFINITY, 0.0, middle);
        for heading in 0..HEADINGS {
            let start_deg = f64::from(heading) * (360.0 / f64::from(HEADINGS));
            let (mut low, mut high) = ([0.0f64; 2], [0.0f64; 2]);
            for look in 0..=LOOKS {
                let offset = self.offset_m(start_deg, last * f64::from(look) / f64::from(LOOKS));
                for axis in 0..2 {
                    low[axis] = low[axis].min(offset[axis]);
                    high[axis] = high[axis].max(offset[axis]);
                }
            }
            let needed = [0, 1].map(|axis| (high[axis] - low[axis]) / stage.extent_m[axis]);
            let needed = needed[0].max(needed[1]);
            // A later heading has to be better by more than rounding.
            if needed < best.0 * (1.0 - 1e-6) {
                best = (needed, start_deg, [0, 1].map(|axis| middle[axis] - 0.5 * (low[axis] + high[axis])));
            }
        }
        (best.1, best.2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{puget, step_m};
    use super::super::{FlightKind, FlightPlan, generate};

    #[test]
    fn speed_zero_spins_on_the_spot() {
        let flight = generate(&puget(), &FlightPlan::new(FlightKind::Turn, 1441, 0.0)).unwrap();
        assert!(flight.frames.iter().all(|f| f.eye_m == [81_920.0, 81_920.0, 4000.0 + 1638.4]));
        assert_eq!(flight.frames[10].yaw_deg, 5.0);
        assert_eq!(flight.frames[720].yaw_deg, 0.0);
    }

    #[test]
    fn a_circle_that_fits_is_flown_whole() {
        for rate in [0.5, -2.0] {
            let plan = FlightPlan {
                turn_rate_deg_per_frame: rate,
                ..FlightPlan::new(FlightKind::Turn, 1500, 100.0)
            };
            let flight = generate(&puget(), &plan).unwrap();
            for pair in flight.frames.windows(2) {
                assert!((step_m(&pair[0], &pair[1]) - 100.0).abs() < 1e-6);
                let turn = (pair[1].yaw_deg - pair[0].yaw_deg + 180.0).rem_euclid(360.0) - 180.0;
                assert!((turn - rate).abs() < 1e-9);
            }
            let far = flight.frames.iter().map(|f| (f.eye_m[0] - 81_920.0).hypot(f.eye_m[1] - 81_920.0));
            let radius = 50.0 / (rate.abs() / 2.0).to_radians().sin();
            assert!(far.into_iter().all(|r| (r - radius).abs() < 0.001 * radius));
        }
    }

    #[test]
    fn a_wide_circles_short_arc_is_placed_where_it_fits() {
        // A radius of 230 km on 164 km of terrain, of which 12 degrees are flown.
        let flight = generate(&puget(), &FlightPlan::new(FlightKind::Turn, 25, 2000.0)).unwrap();
        assert!(flight.frames.windows(2).all(|w| (step_m(&w[0], &w[1]) - 2000.0).abs() < 1e-6));
    }
}
