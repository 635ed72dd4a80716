//! Going round a point that keeps its place in the picture.
//!
//! Eye and line of sight turn together, about the vertical and about the axis to the eye's right; the distance to the point stays.

use super::{Camera, STEEPEST_DEG};
use glam::{DQuat, DVec3};

/// Degrees a second of a circle flown by itself.
pub(super) const CIRCLING_DEG_S: f64 = 8.0;

/// Turns the camera about `pivot` by degrees of heading and of climb.
pub(super) fn around(camera: &mut Camera, pivot: DVec3, by_deg: [f64; 2]) {
    let climb_deg = (camera.pitch_deg + by_deg[1]).clamp(-STEEPEST_DEG, STEEPEST_DEG) - camera.pitch_deg;
    let [right, ..] = Camera { roll_deg: 0.0, ..*camera }.axes();
    // Headings go clockwise, rotations about the vertical the other way.
    let turn = DQuat::from_rotation_z(-by_deg[0].to_radians())
        * DQuat::from_axis_angle(right, climb_deg.to_radians());
    camera.eye_m = pivot + turn * (camera.eye_m - pivot);
    camera.turn([by_deg[0], climb_deg]);
}
