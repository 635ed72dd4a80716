//! Where the eye is, and numbers small enough for single precision.
//!
//! The space is metres east, north and up of the terrain's south-west sample at height zero, heights multiplied by
//! the exaggeration. A vertex far from that origin has no exact place in single precision; its distance from the eye has. So
//! the eye is split into a whole grid cell and a remainder: the shader subtracts whole columns and rows as integers,
//! which is exact, and only then turns to metres. Heights are treated alike.

use glam::{DVec3, Mat4, Vec3, Vec4};

use crate::error::{RenderError, Result};
use crate::frame::DepthRange;
use terrasoar::view::View;

/// What does not change while a terrain is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TerrainShape {
    /// Metres from sample to sample, east and north; above 0.
    pub spacing_m: [f64; 2],
    /// Samples east and north; at least 2.
    pub samples: [u32; 2],
    /// Lowest and highest height in metres, before exaggeration.
    pub height_range_m: [f64; 2],
}

impl TerrainShape {
    /// Metres from the south-west to the north-east sample.
    pub(crate) fn diagonal_m(&self) -> f64 {
        let [east, north] = self.samples.map(|n| f64::from(n.saturating_sub(1)));
        (east * self.spacing_m[0]).hypot(north * self.spacing_m[1])
    }

    pub(crate) fn check(&self) -> Result<()> {
        let finite = self.spacing_m.iter().all(|s| s.is_finite() && *s > 0.0)
            && self.height_range_m.iter().all(|h| h.is_finite())
            && self.height_range_m[0] <= self.height_range_m[1];
        if finite && self.samples.iter().all(|n| *n >= 2) {
            Ok(())
        } else {
            Err(RenderError::Usage(
                "a terrain needs positive spacing, two samples each way and a finite range of heights",
            ))
        }
    }
}

/// Whether a view can be drawn.
pub(crate) fn check(view: &View) -> Result<()> {
    let ok = view.eye_m.is_finite()
        && [view.yaw_rad, view.pitch_rad, view.roll_rad].iter().all(|a| a.is_finite())
        && view.vertical_fov_rad > 0.0
        && view.vertical_fov_rad < std::f64::consts::PI
        && view.viewport.size_px().iter().all(|p| *p > 0)
        && view.tolerance_px > 0.0
        && view.vertical_exaggeration > 0.0
        && view.vertical_exaggeration.is_finite();
    if ok {
        Ok(())
    } else {
        Err(RenderError::Usage(
            "a view needs a finite eye, finite angles and a field of view and numbers above 0",
        ))
    }
}

/// A view in numbers that single precision holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LocalView {
    /// Column and row of the whole cell below the eye.
    pub origin: [i32; 2],
    /// The eye's place within that cell, metres.
    pub eye_in_cell_m: [f32; 2],
    /// Height near the eye's, before exaggeration; near the ground's where the eye is very far from it.
    pub height_origin_m: f32,
    /// The eye above the exaggerated height origin.
    pub eye_above_origin_m: f32,
}

impl LocalView {
    pub(crate) fn new(view: &View, terrain: &TerrainShape) -> Self {
        let cell = [0, 1].map(|i| whole_and_rest(view.eye_m[i] / terrain.spacing_m[i]).0);
        let eye_height_m = view.eye_m.z / view.vertical_exaggeration;
        let [low_m, high_m] = terrain.height_range_m;
        let on_ground_m = eye_height_m.clamp(low_m, high_m);
        let is_far = (eye_height_m - on_ground_m).abs() > FAR_ABOVE_M;
        let height_origin_m = if is_far { on_ground_m } else { eye_height_m } as f32;
        Self {
            origin: cell,
            eye_in_cell_m: [0, 1].map(|i| (view.eye_m[i] - f64::from(cell[i]) * terrain.spacing_m[i]) as f32),
            height_origin_m,
            eye_above_origin_m: (view.eye_m.z - view.vertical_exaggeration * f64::from(height_origin_m))
                as f32,
        }
    }
}

/// Metres between the eye's height and the ground's beyond which heights are counted from the ground: so far from the eye single precision knows no decimetres.
const FAR_ABOVE_M: f64 = (1 << 20) as f64;

/// A coordinate as a whole number and what is left. Far outside, the whole number ends where the shader's difference of two stays in range.
pub(crate) fn whole_and_rest(at: f64) -> (i32, f64) {
    const FARTHEST: f64 = (1 << 29) as f64;
    let whole = at.floor().clamp(-FARTHEST, FARTHEST);
    (whole as i32, at - whole)
}

/// Distance in metres of the near plane. With infinite reversed depth its choice costs no precision far away.
pub(crate) fn near_m(terrain: &TerrainShape) -> f64 {
    (0.02 * terrain.spacing_m[0].min(terrain.spacing_m[1])).clamp(1e-4, 0.5)
}

/// From metres east, north, up of the eye to clip space, by a view's axes and half tangents. Depth is endless and runs as `range` says.
pub(crate) fn clip_from_eye(
    [right, up, forward]: [DVec3; 3],
    [tan_x, tan_y]: [f64; 2],
    near_m: f64,
    range: DepthRange,
) -> Mat4 {
    let row = |v: DVec3| -> Vec3 { v.as_vec3() };
    let x = row(right / tan_x);
    let y = row(up / tan_y);
    let w = row(forward);
    let near = near_m as f32;
    // Depth is near / distance, or what that lacks of 1.
    let (z, z_near) = match range {
        DepthRange::Reversed => (Vec3::ZERO, near),
        DepthRange::Forward => (w, -near),
    };
    Mat4::from_cols(
        Vec4::new(x.x, y.x, z.x, w.x),
        Vec4::new(x.y, y.y, z.y, w.y),
        Vec4::new(x.z, y.z, z.z, w.z),
        Vec4::new(0.0, 0.0, z_near, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_near_over_distance() {
        let view = View::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(5.0, 2.0, 3.0), [400, 300].into());
        let ([right, _, forward], tangents) = (view.axes(), view.half_tangents());
        let clip_from_eye = clip_from_eye(view.axes(), tangents, 0.25, DepthRange::Reversed);
        let clip = clip_from_eye * Vec4::new(10.0, 0.0, 0.0, 1.0);
        assert!((clip.z / clip.w - 0.025).abs() < 1e-7);
        assert!(clip.x.abs() < 1e-6 && clip.y.abs() < 1e-6);
        let right_edge = forward * 10.0 + right * 10.0 * tangents[0];
        let clip = clip_from_eye * right_edge.as_vec3().extend(1.0);
        assert!((clip.x / clip.w - 1.0).abs() < 1e-6);
        let forward = super::clip_from_eye(view.axes(), tangents, 0.25, DepthRange::Forward);
        for (away_m, depth) in [(0.25, 0.0), (10.0, 0.975), (1e9, 1.0)] {
            let clip = forward * Vec4::new(away_m, 0.0, 0.0, 1.0);
            assert!((clip.z / clip.w - depth).abs() < 1e-6, "{away_m} m");
        }
    }

    #[test]
    fn split_eye_adds_up() {
        let terrain = TerrainShape {
            spacing_m: [28.3, 30.9],
            samples: [65_537, 65_537],
            height_range_m: [0.0, 9000.0],
        };
        let mut view =
            View::look_at(DVec3::new(1_234_567.891, 1_999_999.123, 4321.0987), DVec3::ZERO, [4, 3].into());
        view.vertical_exaggeration = 1.7;
        let local = LocalView::new(&view, &terrain);
        for i in 0..2 {
            let sum = f64::from(local.origin[i]) * terrain.spacing_m[i] + f64::from(local.eye_in_cell_m[i]);
            assert!((sum - view.eye_m[i]).abs() < 1e-5);
        }
        let z = 1.7 * f64::from(local.height_origin_m) + f64::from(local.eye_above_origin_m);
        assert!((z - view.eye_m.z).abs() < 1e-8);
    }
}
