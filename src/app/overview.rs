//! Views that nobody has to think of: a whole terrain in the picture, from obliquely above.

use glam::DVec3;
use terrasoar::view::{View, Viewport};
use terrasoar_layout::terrain::Terrain;

/// Heading of the overview, degrees: the light comes from the left, as on maps.
const YAW_DEG: f64 = 22.0;
/// Its climb, degrees.
const PITCH_DEG: f64 = -33.0;
/// How much more room than the terrain needs.
const MARGIN: f64 = 1.02;

/// Vertical field of view where none is asked for, degrees.
pub(crate) const FOV_DEG: f64 = 45.0;

/// A view from `eye_m` with a heading and a climb in radians, at a tolerance of a pixel and true scale.
pub(crate) fn view_from(
    eye_m: DVec3,
    [yaw_rad, pitch_rad]: [f64; 2],
    fov_deg: f64,
    viewport: Viewport,
) -> View {
    View {
        eye_m,
        yaw_rad,
        pitch_rad,
        roll_rad: 0.0,
        vertical_fov_rad: fov_deg.to_radians(),
        viewport,
        tolerance_px: 1.0,
        vertical_exaggeration: 1.0,
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
pub(crate) fn towards_middle(terrain: &Terrain, exaggeration: f64, eye_m: DVec3) -> [f64; 2] {
    let [middle, _] = box_of(terrain, exaggeration);
    let to = middle - eye_m;
    [to.x.atan2(to.y), to.z.atan2(to.truncate().length())]
}

/// The nearest view in a fixed direction that has the terrain's whole box in the picture.
pub(crate) fn overview(terrain: &Terrain, exaggeration: f64, fov_deg: f64, viewport: Viewport) -> View {
    let angles = [YAW_DEG.to_radians(), PITCH_DEG.to_radians()];
    let view = view_from(DVec3::ZERO, angles, fov_deg, viewport);
    let [middle, half] = box_of(terrain, exaggeration);
    let [right, up, forward] = view.axes();
    let tan_y = (0.5 * view.vertical_fov_rad).tan();
    let tan_x = tan_y * f64::from(viewport.width_px) / f64::from(viewport.height_px);
    let corners =
        (0..8).map(|i| half * DVec3::from([0, 1, 2].map(|bit| f64::from(i >> bit & 1) * 2.0 - 1.0)));
    // A corner c is in the picture from distance d if |c . right| <= tan_x (d + c . forward), and likewise upwards.
    let distance_m = corners
        .map(|c| ((c.dot(right).abs() / tan_x).max(c.dot(up).abs() / tan_y)) - c.dot(forward))
        .fold(0.0, f64::max);
    View { eye_m: middle - forward * (MARGIN * distance_m), vertical_exaggeration: exaggeration, ..view }
}
