//! What lies under a place of the picture: a ray from the eye marched to the ground.
//!
//! Steps grow with the distance, as a pixel's footprint does, and the crossing is found by halving. **What a step may miss is smaller on the
//! screen than a few pixels.** The ray passes through voids and through what lies outside. Cost: some hundred heights.

use glam::DVec3;
use terrasoar::flight::generate::Ground;

/// Step as a part of the distance.
const STEP: f64 = 0.004;
/// Steps at most: enough from a metre to the far side of the largest terrain.
const STEPS: u32 = 4000;

/// A point of the ground that was hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    /// Metres east, north and up in drawn space, heights exaggerated.
    pub at_m: DVec3,
    /// Height of the ground there, not exaggerated.
    pub height_m: f64,
    /// Distance from the eye.
    pub distance_m: f64,
    /// Steepness of the ground there, not exaggerated; none at voids and borders.
    pub slope_deg: Option<f64>,
}

/// Where the ray from `eye_m` along the unit vector `along` meets the ground, whose samples are `spacing_m` apart.
pub(crate) fn cast(
    ground: &dyn Ground,
    spacing_m: [f64; 2],
    exaggeration: f64,
    eye_m: DVec3,
    along: DVec3,
) -> Option<Hit> {
    let [near_m, far_m] = within(ground, exaggeration, eye_m, along)?;
    let finest_m = 0.5 * spacing_m[0].min(spacing_m[1]);
    let above_m = |t: f64| {
        let at = eye_m + along * t;
        ground.height_m(at.x, at.y).map(|height_m| at.z - height_m * exaggeration)
    };
    let (mut t, mut before) = (near_m, None);
    for _ in 0..STEPS {
        let above = above_m(t);
        if above.is_some_and(|a| a <= 0.0)
            && let Some(free) = before
        {
            return hit(ground, spacing_m, eye_m, along, halve(above_m, free, t));
        }
        // From below or behind an edge nothing is seen: the ray has to have been above the ground.
        before = above.filter(|a| *a > 0.0).map(|_| t);
        if t >= far_m {
            break;
        }
        t = (t + finest_m.max(STEP * t)).min(far_m);
    }
    None
}

/// The crossing between `free`, which is above the ground, and `under`, which is not.
fn halve(above_m: impl Fn(f64) -> Option<f64>, mut free: f64, mut under: f64) -> f64 {
    for _ in 0..40 {
        let middle = 0.5 * (free + under);
        if above_m(middle).is_some_and(|a| a <= 0.0) {
            under = middle;
        } else {
            free = middle;
        }
    }
    under
}

fn hit(ground: &dyn Ground, spacing_m: [f64; 2], eye_m: DVec3, along: DVec3, distance_m: f64) -> Option<Hit> {
    let at_m = eye_m + along * distance_m;
    let height_m = ground.height_m(at_m.x, at_m.y)?;
    let slope_deg = slope_deg(ground, spacing_m, at_m);
    Some(Hit { at_m, height_m, distance_m, slope_deg })
}

fn slope_deg(ground: &dyn Ground, [dx, dy]: [f64; 2], at: DVec3) -> Option<f64> {
    let height = |x: f64, y: f64| ground.height_m(at.x + x, at.y + y);
    let east = (height(dx, 0.0)? - height(-dx, 0.0)?) / (2.0 * dx);
    let north = (height(0.0, dy)? - height(0.0, -dy)?) / (2.0 * dy);
    Some(east.hypot(north).atan().to_degrees())
}

/// The part of a ray that lies in the box of the ground, from nearest to farthest.
fn within(ground: &dyn Ground, exaggeration: f64, eye_m: DVec3, along: DVec3) -> Option<[f64; 2]> {
    let [east_m, north_m] = ground.extent_m();
    let [low, high] = ground.height_range_m().map(|h| h * exaggeration);
    let margin_m = 1.0 + 1e-3 * (high - low);
    let least = DVec3::new(0.0, 0.0, low - margin_m);
    let largest = DVec3::new(east_m, north_m, high + margin_m);
    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let (a, b) = ((least[axis] - eye_m[axis]) / along[axis], (largest[axis] - eye_m[axis]) / along[axis]);
        if along[axis] == 0.0 {
            if !(least[axis]..=largest[axis]).contains(&eye_m[axis]) {
                return None;
            }
        } else {
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
    }
    (near <= far && far.is_finite()).then_some([near, far])
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Waves of known height and slope, 10 km a side.
    pub(crate) struct Hills;

    const SPACING_M: [f64; 2] = [10.0, 10.0];

    impl Ground for Hills {
        fn extent_m(&self) -> [f64; 2] {
            [10_000.0; 2]
        }

        fn height_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
            let inside = |m| (0.0..=10_000.0).contains(&m);
            (inside(east_m) && inside(north_m)).then(|| 400.0 + 200.0 * (north_m / 500.0).sin())
        }

        fn height_range_m(&self) -> [f64; 2] {
            [200.0, 600.0]
        }
    }

    #[test]
    fn a_ray_meets_the_ground_where_the_ground_is() {
        for exaggeration in [0.5, 1.0, 3.0] {
            let eye = DVec3::new(4000.0, -3000.0, 4500.0);
            for (east, north) in [(0.1, 0.9), (-0.3, 1.0), (0.0, 0.6)] {
                let along = DVec3::new(east, north, -0.35).normalize();
                let hit = cast(&Hills, SPACING_M, exaggeration, eye, along).unwrap();
                assert!((hit.at_m.z - hit.height_m * exaggeration).abs() < 1e-3, "{hit:?}");
                assert!((hit.at_m - eye - along * hit.distance_m).length() < 1e-6);
                // Nothing before it is under the ground.
                for i in 0..10_000 {
                    let at = eye + along * (hit.distance_m * f64::from(i) / 10_000.0 - 1.0);
                    let below = Hills.height_m(at.x, at.y).map(|h| h * exaggeration);
                    assert!(below.is_none_or(|h| at.z > h - 2.0), "{at} {hit:?}");
                }
            }
        }
    }

    #[test]
    fn slope_is_the_grounds_not_the_pictures() {
        let eye = DVec3::new(4000.0, 4000.0, 9000.0);
        let hit = cast(&Hills, SPACING_M, 4.0, eye, DVec3::new(0.0, 1e-9, -1.0).normalize()).unwrap();
        let expected = (200.0 / 500.0 * (8.0_f64).cos()).abs().atan().to_degrees();
        assert!((hit.slope_deg.unwrap() - expected).abs() < 0.01, "{hit:?} {expected}");
    }

    #[test]
    fn sky_sides_and_undersides_are_not_hit() {
        let cast = |eye: DVec3, along: DVec3| cast(&Hills, SPACING_M, 1.0, eye, along.normalize());
        let above = DVec3::new(5000.0, 5000.0, 1500.0);
        assert_eq!(cast(above, DVec3::Z), None);
        assert_eq!(cast(above, DVec3::new(1.0, 0.0, 0.1)), None);
        assert_eq!(cast(DVec3::new(-100.0, 5000.0, 100.0), DVec3::X), None, "against the side");
        assert_eq!(cast(DVec3::new(5000.0, 5000.0, 50.0), DVec3::Z), None, "from below");
        assert_eq!(cast(DVec3::new(-500.0, 5000.0, 900.0), -DVec3::X), None, "away from it");
    }
}
