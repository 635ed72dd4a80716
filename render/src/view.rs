//! Where the eye is, and numbers small enough for single precision.
//!
//! The space is metres east, north and up of the terrain's south-west sample at height zero, heights multiplied by
//! the exaggeration. A vertex far from that origin has no exact place in single precision; its distance from the eye has. So
//! the eye is split into a whole grid cell and a remainder: the shader subtracts whole columns and rows as integers,
//! which is exact, and only then turns to metres. Heights are treated alike.

use glam::{DVec3, Mat4, Vec3, Vec4};

use crate::error::{RenderError, Result};

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
    pub fn diagonal_m(&self) -> f64 {
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

/// One frame's camera, and the tolerance its mesh was made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameView {
    /// The eye, metres east, north and up in the drawn (exaggerated) space.
    pub eye_m: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to its top.
    pub up: DVec3,
    /// Unit vector along the line of sight; `right x up = -forward`.
    pub forward: DVec3,
    /// Vertical field of view in radians, above 0 and below pi.
    pub vertical_fov_rad: f64,
    /// Size of the picture in pixels.
    pub viewport_px: [u32; 2],
    /// Largest error on the screen the mesh may show, in pixels; above 0.
    pub tolerance_px: f64,
    /// Factor on heights; above 0.
    pub vertical_exaggeration: f64,
}

impl FrameView {
    /// Looks from one point towards another, north-up or, straight down, with `up` towards north.
    pub fn look_at(eye_m: DVec3, at_m: DVec3, viewport_px: [u32; 2]) -> Self {
        let forward = (at_m - eye_m).try_normalize().unwrap_or(DVec3::Y);
        let right = forward.cross(DVec3::Z).try_normalize().unwrap_or(DVec3::X);
        Self {
            eye_m,
            right,
            up: right.cross(forward),
            forward,
            vertical_fov_rad: 0.8,
            viewport_px,
            tolerance_px: 1.0,
            vertical_exaggeration: 1.0,
        }
    }

    /// Pixels a radian of the vertical field of view.
    pub fn pixels_per_radian(&self) -> f64 {
        f64::from(self.viewport_px[1]) / self.vertical_fov_rad
    }

    /// Pixels a radian over the tolerance: a vertex is in the mesh when nearer than `nu * error + radius`.
    pub fn nu(&self) -> f64 {
        self.pixels_per_radian() / self.tolerance_px
    }

    /// Tangents of half the horizontal and half the vertical field of view.
    pub fn half_tangents(&self) -> [f64; 2] {
        let vertical = (0.5 * self.vertical_fov_rad).tan();
        [vertical * f64::from(self.viewport_px[0]) / f64::from(self.viewport_px[1]), vertical]
    }

    /// Outward unit normals of the left, right, bottom and top planes of the view pyramid; each passes through the eye.
    pub fn side_normals(&self) -> [DVec3; 4] {
        let [tan_x, tan_y] = self.half_tangents();
        [
            (-self.right - self.forward * tan_x).normalize(),
            (self.right - self.forward * tan_x).normalize(),
            (-self.up - self.forward * tan_y).normalize(),
            (self.up - self.forward * tan_y).normalize(),
        ]
    }

    pub(crate) fn check(&self) -> Result<()> {
        let ok = self.eye_m.is_finite()
            && [self.right, self.up, self.forward].iter().all(|a| (a.length() - 1.0).abs() < 1e-3)
            && self.vertical_fov_rad > 0.0
            && self.vertical_fov_rad < std::f64::consts::PI
            && self.viewport_px.iter().all(|p| *p > 0)
            && self.tolerance_px > 0.0
            && self.vertical_exaggeration > 0.0
            && self.vertical_exaggeration.is_finite();
        if ok {
            Ok(())
        } else {
            Err(RenderError::Usage("a view needs a finite eye, unit axes and positive angles"))
        }
    }
}

/// A view in numbers that single precision holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LocalView {
    /// Column and row of the whole cell below the eye.
    pub origin: [i32; 2],
    /// The eye's place within that cell, metres.
    pub eye_in_cell_m: [f32; 2],
    /// Height near the eye's, before exaggeration.
    pub height_origin_m: f32,
    /// The eye above the exaggerated height origin.
    pub eye_above_origin_m: f32,
}

impl LocalView {
    pub(crate) fn new(view: &FrameView, terrain: &TerrainShape) -> Self {
        let cell = [0, 1].map(|i| whole_and_rest(view.eye_m[i] / terrain.spacing_m[i]).0);
        let height_origin_m = (view.eye_m.z / view.vertical_exaggeration) as f32;
        Self {
            origin: cell,
            eye_in_cell_m: [0, 1].map(|i| (view.eye_m[i] - f64::from(cell[i]) * terrain.spacing_m[i]) as f32),
            height_origin_m,
            eye_above_origin_m: (view.eye_m.z - view.vertical_exaggeration * f64::from(height_origin_m))
                as f32,
        }
    }
}

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

/// From metres east, north, up of the eye to clip space: reversed depth, 1 at the near plane, 0 infinitely far.
pub(crate) fn clip_from_eye(view: &FrameView, near_m: f64) -> Mat4 {
    let [tan_x, tan_y] = view.half_tangents();
    let row = |v: DVec3| -> Vec3 { v.as_vec3() };
    let x = row(view.right / tan_x);
    let y = row(view.up / tan_y);
    let w = row(view.forward);
    Mat4::from_cols(
        Vec4::new(x.x, y.x, 0.0, w.x),
        Vec4::new(x.y, y.y, 0.0, w.y),
        Vec4::new(x.z, y.z, 0.0, w.z),
        Vec4::new(0.0, 0.0, near_m as f32, 0.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_near_over_distance() {
        let view = FrameView::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(5.0, 2.0, 3.0), [400, 300]);
        let clip = clip_from_eye(&view, 0.25) * Vec4::new(10.0, 0.0, 0.0, 1.0);
        assert!((clip.z / clip.w - 0.025).abs() < 1e-7);
        assert!(clip.x.abs() < 1e-6 && clip.y.abs() < 1e-6);
        let right_edge = view.forward * 10.0 + view.right * 10.0 * view.half_tangents()[0];
        let clip = clip_from_eye(&view, 0.25) * right_edge.as_vec3().extend(1.0);
        assert!((clip.x / clip.w - 1.0).abs() < 1e-6);
    }

    #[test]
    fn split_eye_adds_up() {
        let terrain = TerrainShape {
            spacing_m: [28.3, 30.9],
            samples: [65_537, 65_537],
            height_range_m: [0.0, 9000.0],
        };
        let mut view =
            FrameView::look_at(DVec3::new(1_234_567.891, 1_999_999.123, 4321.0987), DVec3::ZERO, [4, 3]);
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
