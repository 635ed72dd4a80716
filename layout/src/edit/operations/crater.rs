//! The crater of a shell: a bowl, and a rim of what was in it.
//!
//! Based on: M. Liao, F. Xu, X. He, "Improvement on Dynamic Tiled Terrain Rendering Algorithm in libMini", section 5 (after K. Yang, 2009): the parameters position, direction,
//! radius and depth, and a profile that reaches to twice the radius. The formula is our own. With t the distance from
//! the centre in radii, d the depth, s = t - 1 and c the cosine of the angle between the direction and the way from the centre, the ground changes by
//!
//! ```text
//! t <= 1        -d (1 - t^2)                                                the bowl
//! 1 < t < 2      d s (1 - s)^2 (6 + s) / 3 * (1 + 0.8 c (1 - (1 - s)^2))     the rim
//! t >= 2         0
//! ```
//!
//! **Over flat ground as much is heaped up as is dug out**: both integrals are pi r^2 d / 2, and c averages to nothing. The change is continuous, its slope
//! too: the rim leaves the bowl as steeply as the bowl reaches it (2 d / r) and ends level at 2 r. Without ejecta the rim is 0.31 d high at its crest, which lies at
//! 1.35 r; ejecta thrown forward make the crest about one half higher ahead and farther out, two fifths lower behind and nearer. Cost: a square root for each
//! sample of the rim, none in the bowl.

use super::area::{disc_samples, each_sample, offset_m};
use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::imagery::{Paint, Scorch};
use crate::numbers::{checked, checked_amount, checked_centre, checked_radius};
use crate::portable;

/// How far the rim reaches, in radii.
pub const REACH: f64 = 2.0;
/// How much more than the mean the ejecta heap up straight ahead, far out on the rim.
const THROWN_FORWARD: f64 = 0.8;

/// A crater by position, direction, radius and depth, as in Liao et al. (EDITS.md).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crater {
    /// Its centre in metres east and north of the south-west sample.
    pub centre_m: [f64; 2],
    /// Where the shell flew to, degrees clockwise from north.
    pub direction_deg: f64,
    /// Radius of the bowl in metres. The rim reaches to twice that.
    pub radius_m: f64,
    /// Depth of the bowl's centre below the old ground in metres.
    pub depth_m: f64,
}

impl Crater {
    pub(crate) fn check(&self) -> Result<(), LayoutError> {
        checked_centre("crater", self.centre_m)?;
        checked_radius("crater", self.radius_m)?;
        checked_amount("crater", "depth", self.depth_m)?;
        let direction = self.direction_deg;
        checked("crater", "direction", direction, direction.abs() <= 1e9, "degrees clockwise from north")
    }

    pub(crate) fn bounds(&self, grid: &Grid) -> Option<SampleRect> {
        disc_samples(self.centre_m, REACH * self.radius_m, grid)
    }

    /// Metres by which the ground changes at an offset (east, north) from the centre in metres, with the direction (east, north) of length 1.
    #[inline]
    fn change_m(&self, [east, north]: [f64; 2], direction: [f64; 2]) -> f64 {
        let t2 = (east * east + north * north) / (self.radius_m * self.radius_m);
        if t2 <= 1.0 {
            return -self.depth_m * (1.0 - t2);
        }
        if t2 >= REACH * REACH {
            return 0.0;
        }
        let t = t2.sqrt();
        let s = t - 1.0;
        let left = (1.0 - s) * (1.0 - s);
        let cosine = (east * direction[0] + north * direction[1]) / (t * self.radius_m);
        self.depth_m * s * left * (6.0 + s) / 3.0 * (1.0 + THROWN_FORWARD * cosine * (1.0 - left))
    }

    pub(crate) fn apply(&self, grid: &Grid, window: &mut HeightWindow) {
        let (east, north) = portable::sin_cos(self.direction_deg.to_radians());
        each_sample(window, self.bounds(grid), |x, y, height| {
            *height += self.change_m(offset_m(grid, self.centre_m, x, y), [east, north]);
        });
    }
}

/// Radii of a crater that its scorch has.
const SCORCH_RADII: f64 = 1.5;

/// How much of the light a crater's scorch takes at most.
const SCORCH_STRENGTH: f64 = 0.85;

impl Paint {
    /// The scorch of a crater: 1.5 times as wide as its bowl, ejecta flying where the shell flew.
    pub fn scorch_of(crater: &Crater) -> Self {
        Self::Scorch(Scorch {
            centre_m: crater.centre_m,
            radius_m: SCORCH_RADII * crater.radius_m,
            direction_deg: crater.direction_deg,
            strength: SCORCH_STRENGTH,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn crater(direction_deg: f64) -> Crater {
        Crater { centre_m: [0.0; 2], direction_deg, radius_m: 50.0, depth_m: 8.0 }
    }

    fn at(crater: &Crater, t: f64, azimuth_deg: f64) -> f64 {
        let [wanted, way] = [azimuth_deg, crater.direction_deg].map(|a| a.to_radians().sin_cos());
        crater.change_m([wanted.0 * t * 50.0, wanted.1 * t * 50.0], [way.0, way.1])
    }

    #[test]
    fn the_profile_is_a_bowl_and_a_rim_that_ends_level() {
        let crater = crater(90.0);
        for azimuth in [0.0, 90.0, 135.0, 270.0] {
            assert_eq!(at(&crater, 0.0, azimuth), -8.0);
            assert!(at(&crater, 1.0, azimuth).abs() < 1e-12);
            assert_eq!(at(&crater, 2.000_001, azimuth), 0.0);
            let slope = |t: f64| (at(&crater, t + 1e-7, azimuth) - at(&crater, t - 1e-7, azimuth)) / 2e-7;
            assert!((slope(1.0) - 16.0).abs() < 1e-3 && slope(2.0).abs() < 1e-3);
            // Continuous, with a continuous slope.
            for i in 1..40_000 {
                let t = f64::from(i) * 1e-4;
                assert!((at(&crater, t, azimuth) - at(&crater, t - 1e-4, azimuth)).abs() < 2.5e-3);
                assert!((slope(t) - slope(t - 1e-4)).abs() < 0.02, "{t}");
                assert!(t <= 1.0 || at(&crater, t, azimuth) >= 0.0);
            }
        }
        let crest =
            |azimuth| (100..200).map(|i| at(&crater, f64::from(i) / 100.0, azimuth)).fold(0.0, f64::max);
        let [ahead, aside, behind] = [90.0, 0.0, 270.0].map(crest);
        assert!((aside / 8.0 - 0.31).abs() < 0.01, "{aside}");
        assert!((ahead / aside - 1.48).abs() < 0.01 && (behind / aside - 0.61).abs() < 0.01);
    }

    #[test]
    fn as_much_is_heaped_up_as_is_dug_out() {
        let crater = crater(33.0);
        let (sin, cos) = 33.0f64.to_radians().sin_cos();
        let (mut dug, mut heaped) = (0.0, 0.0);
        for y in -400..=400 {
            for x in -400..=400 {
                let change = crater.change_m([f64::from(x) / 4.0, f64::from(y) / 4.0], [sin, cos]) / 16.0;
                if change < 0.0 { dug -= change } else { heaped += change }
            }
        }
        let wanted = std::f64::consts::PI * 2500.0 * 8.0 / 2.0;
        assert!((dug / wanted - 1.0).abs() < 1e-3 && (heaped / wanted - 1.0).abs() < 1e-3, "{dug} {heaped}");
    }

    proptest! {
        #[test]
        fn a_turned_crater_is_the_crater_turned(t in 0.0..2.1f64, azimuth in 0.0..360.0f64, turn in -720.0..720.0f64) {
            let (plain, turned) = (crater(0.0), crater(turn));
            prop_assert!((at(&plain, t, azimuth) - at(&turned, t, azimuth + turn)).abs() < 1e-9);
        }
    }
}
