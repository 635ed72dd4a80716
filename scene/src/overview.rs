//! A view of a whole terrain, from obliquely above, for when no view is given.

use glam::DVec3;
use terrasoar::view::{ErrorMetric, View, Viewport};
use terrasoar_layout::read::terrain::Terrain;

/// Heading of the overview, degrees: the light comes from the left, as on maps.
const YAW_DEG: f64 = 16.0;
/// Its climb, degrees.
const PITCH_DEG: f64 = -38.0;
/// How much more room than the terrain needs.
const MARGIN: f64 = 1.03;

/// Vertical field of view where none is asked for, degrees.
pub const FOV_DEG: f64 = 45.0;

/// A view from `eye_m` with a heading and a climb in radians, at a tolerance of a pixel and true scale.
pub fn view_from(eye_m: DVec3, [yaw_rad, pitch_rad]: [f64; 2], fov_deg: f64, viewport: Viewport) -> View {
    View {
        eye_m,
        yaw_rad,
        pitch_rad,
        roll_rad: 0.0,
        vertical_fov_rad: fov_deg.to_radians(),
        viewport,
        tolerance_px: 1.0,
        vertical_exaggeration: 1.0,
        metric: ErrorMetric::default(),
    }
}

/// Middle of the terrain's box and half its extent, heights exaggerated, in metres.
fn box_of(terrain: &Terrain, exaggeration: f64) -> [DVec3; 2] {
    let [east_m, north_m] = terrain.grid().extent_m();
    let [low_m, high_m] = terrain.header().height_range_m.map(|h| h * exaggeration);
    let (low, high) = (DVec3::new(0.0, 0.0, low_m), DVec3::new(east_m, north_m, high_m));
    [0.5 * (low + high), 0.5 * (high - low)]
}

/// Heading and climb in radians from a place to the terrain's middle.
pub fn towards_middle(terrain: &Terrain, exaggeration: f64, eye_m: DVec3) -> [f64; 2] {
    let [middle, _] = box_of(terrain, exaggeration);
    let to = middle - eye_m;
    [to.x.atan2(to.y), to.z.atan2(to.truncate().length())]
}

/// The nearest view in a fixed direction that has the terrain's whole box in the picture.
pub fn overview(terrain: &Terrain, exaggeration: f64, fov_deg: f64, viewport: Viewport) -> View {
    let angles = [YAW_DEG.to_radians(), PITCH_DEG.to_radians()];
    let view = view_from(DVec3::ZERO, angles, fov_deg, viewport);
    let [middle, half] = box_of(terrain, exaggeration);
    let [right, up, forward] = view.axes();
    let [tan_x, tan_y] = view.half_tangents();
    let corners =
        (0..8).map(|i| half * DVec3::from([0, 1, 2].map(|bit| f64::from(i >> bit & 1) * 2.0 - 1.0)));
    // A corner c is between two opposite planes from distance d and a step s aside if |c . axis - s| <= tan (d + c . forward). The least d and
    // its s:
    let between = |axis: DVec3, tan: f64| {
        let reach = |sign: f64| {
            corners
                .clone()
                .map(|c| sign * c.dot(axis) - tan * c.dot(forward))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let [one, other] = [reach(1.0), reach(-1.0)];
        [0.5 * (one + other) / tan, 0.5 * (one - other)]
    };
    let [[far_x, aside_x], [far_y, aside_y]] = [between(right, tan_x), between(up, tan_y)];
    let eye_m = middle + right * aside_x + up * aside_y - forward * (MARGIN * far_x.max(far_y));
    View { eye_m, vertical_exaggeration: exaggeration, ..view }
}

/// A view of the whole terrain from straight above, north at the top, every pixel as many metres as every other; in the largest picture of the terrain's shape
/// that `most` has room for. The ground's border is the picture's. Gives the metres of a pixel too.
///
/// The eye is so far away that the highest ground stands a twentieth of a pixel aside at most.
pub fn from_above(terrain: &Terrain, exaggeration: f64, most: Viewport) -> (View, f64) {
    let [east_m, north_m] = terrain.grid().extent_m();
    from_above_part(terrain, [0.0, 0.0, east_m, north_m], exaggeration, most)
}

/// As [`from_above`], of a part: west, south, east and north in metres from the south-west sample, west below east and south below north.
pub fn from_above_part(
    terrain: &Terrain,
    [west_m, south_m, east_m, north_m]: [f64; 4],
    exaggeration: f64,
    most: Viewport,
) -> (View, f64) {
    let extent_m = [east_m - west_m, north_m - south_m];
    let [low_m, high_m] = terrain.header().height_range_m.map(|h| h * exaggeration);
    let [most_wide, most_high] = most.size_px().map(f64::from);
    let pixel_m = (extent_m[0] / most_wide).max(extent_m[1] / most_high);
    let size = [0, 1].map(|i| (extent_m[i] / pixel_m).round().clamp(1.0, [most_wide, most_high][i]));
    // Rather half a pixel less of the ground than a seam of sky.
    let pixel_m = (extent_m[0] / size[0]).min(extent_m[1] / size[1]);
    let away_m =
        ((10.0 * size[0].max(size[1]) + 1.0) * (high_m - low_m)).max(10.0 * extent_m[0].hypot(extent_m[1]));
    let eye_m = DVec3::new(0.5 * (west_m + east_m), 0.5 * (south_m + north_m), low_m + away_m);
    let fov_deg = (2.0 * (0.5 * pixel_m * size[1] / away_m).atan()).to_degrees();
    let viewport = Viewport::from(size.map(|side| side as u32));
    let down = [0.0, -std::f64::consts::FRAC_PI_2];
    (View { vertical_exaggeration: exaggeration, ..view_from(eye_m, down, fov_deg, viewport) }, pixel_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::build::{BuildOptions, build};
    use terrasoar_layout::dem::{MemoryDem, SampleType};
    use terrasoar_layout::progress::Silent;

    #[test]
    fn from_above_a_pixel_is_as_large_everywhere() {
        let dem = MemoryDem::from_fn([65, 33], SampleType::I16, |x, y| f64::from((x * 70) ^ (y * 50)));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("land.iqt");
        build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 20.0]), &Silent).unwrap();
        let terrain = Terrain::open(&path).unwrap();
        for (most, size) in [([1280, 720], [1280, 427]), ([300, 900], [300, 100]), ([1, 1], [1, 1])] {
            let (view, pixel_m) = from_above(&terrain, 3.0, most.into());
            assert_eq!(view.viewport.size_px(), size);
            let [right, up, forward] = view.axes();
            let tangents = view.half_tangents();
            // Where corners at the lowest and the highest ground are, in pixels of the middle.
            for (east, north) in [(0.0, 0.0), (1920.0, 0.0), (1920.0, 640.0)] {
                for height in terrain.header().height_range_m {
                    let to = DVec3::new(east, north, 3.0 * height) - view.eye_m;
                    let at = [(right, 0), (up, 1)].map(|(axis, i)| {
                        0.5 * f64::from(size[i]) * to.dot(axis) / to.dot(forward) / tangents[i]
                    });
                    let even = [(east - 960.0) / pixel_m, (north - 320.0) / pixel_m];
                    for i in [0, 1] {
                        // A twentieth of a pixel in the picture, more by as much as the ground reaches beyond it.
                        let most = 0.05 * even[i].abs() / (0.5 * f64::from(size[i]));
                        assert!((at[i] - even[i]).abs() < most + 1e-9, "{at:?} {even:?}");
                        // The ground covers the picture.
                        assert!(even[i].abs() >= 0.5 * f64::from(size[i]) - 1e-6);
                    }
                }
            }
        }
    }

    #[test]
    fn the_whole_box_is_in_the_picture_and_fills_it_one_way() {
        let dem = MemoryDem::from_fn([65, 33], SampleType::I16, |x, y| f64::from((x * 7) ^ (y * 5)));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("land.iqt");
        build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 20.0]), &Silent).unwrap();
        let terrain = Terrain::open(&path).unwrap();
        for (width_px, height_px) in [(1280, 720), (300, 900)] {
            let view = overview(&terrain, 2.0, FOV_DEG, Viewport { width_px, height_px });
            let [middle, half] = box_of(&terrain, 2.0);
            let least = |n: DVec3| {
                let corner =
                    |i: u8| half * DVec3::from([0, 1, 2].map(|bit| f64::from(i >> bit & 1) * 2.0 - 1.0));
                let beyond = |c: DVec3| n.dot(middle + c - view.eye_m);
                (0..8).map(|i| -beyond(corner(i))).fold(f64::INFINITY, f64::min)
            };
            let room = view.side_normals().map(least);
            assert!(room.iter().all(|r| *r > 0.0), "{room:?}");
            assert!(room.iter().any(|r| *r < 0.06 * half.length()), "{room:?}");
        }
    }
}
