//! What swings as the eye flies a circle: F(t) = a + b cos t + c sin t, t being the turn.
//!
//! Half the square of a distance is such a quantity, and so is the distance from a plane that turns with the eye.
//!
//! Where it first comes to zero. With x = tan(t / 2), (1 + x^2) F = (a + b) + 2 c x + (a - b) x^2. So with Q = a + b = F(0) > 0, P = a - b and
//! d = c^2 - P Q, the first zero within half a turn is at x = Q / (sqrt(d) - c), if that is positive. There F falls by sqrt(d) a radian.
//!
//! Claim: let T be that zero, or half a turn if it comes later, and s no more than the slope sqrt(d). Then F(t) >= L - s t on [0, T] with L = min(F(0), s T). Where a <= 0, any s will do.
//! Proof: F'' = a - F, so F is concave above its mean a and convex below it. Where a <= 0, F is concave up to T, and lies above the chord from F(0) to a zero. Else it comes to zero convex,
//! above its tangent there, whose slope is at least s. Before that it may be concave, between places where the claim holds, and before that convex and rising from F(0).
//!
//! Cost: a square root and two divisions.

/// What stands for nothing where a number is divided by.
pub(super) const TINY: f64 = 1e-30;
/// A bound on the error of the polynomial in [`angle_below`].
const ANGLE_ERROR: f64 = 2e-6;

/// One such quantity.
#[derive(Debug, Clone, Copy)]
pub(super) struct Swing {
    /// What it is now: a + b.
    pub now: f64,
    /// What it is half a turn on: a - b.
    pub opposite: f64,
    /// What it grows a radian, now: c.
    pub grows: f64,
}

impl Swing {
    /// The turn in radians up to which the claim holds with a slope of `least_slope` a radian, rounded down. 0 if it does not.
    #[inline(always)]
    pub(super) fn turn_rad(&self, least_slope: f64) -> f64 {
        let slope2 = self.grows * self.grows - self.now * self.opposite;
        let falls = slope2 >= least_slope * least_slope;
        let is_concave = self.now + self.opposite <= 0.0;
        let ahead = (slope2.max(0.0).sqrt() - self.grows).max(0.0);
        let turn_rad = 2.0 * angle_below(self.now, ahead);
        if (self.now > 0.0) & (falls | is_concave) { turn_rad } else { 0.0 }
    }
}

/// The angle whose tangent is `up` / `ahead`, rounded down; neither is negative.
#[inline(always)]
fn angle_below(up: f64, ahead: f64) -> f64 {
    use std::f64::consts::FRAC_PI_2;
    let x = up.min(ahead) / up.max(ahead).max(TINY);
    let x2 = x * x;
    // The polynomial of this degree that is nearest to the angle for tangents from 0 to 1.
    let angle = x
        * (0.999_977_2
            + x2 * (-0.332_622_8
                + x2 * (0.193_540_4 + x2 * (-0.116_426_5 + x2 * (0.052_647_3 - x2 * 0.011_719_1)))));
    (if up <= ahead { angle } else { FRAC_PI_2 - angle }) - ANGLE_ERROR
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]
        #[test]
        fn angles_are_rounded_down_by_little(up in 0.0f64..10.0, ahead in prop_oneof![Just(0.0), 1e-6f64..10.0]) {
            let below = angle_below(up, ahead);
            let angle = up.atan2(ahead);
            prop_assert!(below <= angle && below >= angle - 4e-6, "{below} {angle}");
        }

        /// The claim, and that the turn is not a part of what it could be.
        #[test]
        fn it_stays_above_a_line_until_it_comes_to_zero(
            mean in -1.0f64..1.0, swing in 0.0f64..2.0, phase_rad in 0.0f64..6.3, slope in prop_oneof![0.0f64..0.1, 0.0f64..2.0],
        ) {
            let at = |turn_rad: f64| mean + swing * (turn_rad - phase_rad).cos();
            let now = at(0.0);
            let swinging = Swing { now, opposite: 2.0 * mean - now, grows: swing * phase_rad.sin() };
            let turn_rad = swinging.turn_rad(slope);
            prop_assert!(turn_rad <= std::f64::consts::PI);
            let most = now.min(slope * turn_rad);
            for i in 0..=500 {
                let t = turn_rad * f64::from(i) / 500.0;
                prop_assert!(turn_rad == 0.0 || at(t) >= most - slope * t - 1e-9, "{} < {most} at {t}", at(t));
            }
            let lowest = (0..=500).map(|i| at(std::f64::consts::PI * f64::from(i) / 500.0)).fold(now, f64::min);
            if now > 0.0 && lowest < -1e-6 && (mean <= 0.0 || swing * swing - mean * mean > slope * slope + 1e-9) {
                prop_assert!(at(turn_rad + 1e-4) < 1e-3 * (1.0 + swing), "it ends at {turn_rad}");
            }
        }
    }
}
