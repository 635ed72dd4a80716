//! Where the eye is and what it sees: one frame's camera, and how exact its mesh must be.
//!
//! Space is metres east, north and up of the terrain's south-west sample at height zero. Angles at this
//! boundary are radians; flights and flags speak degrees.

use glam::DVec3;
use terrasoar_layout::portable;

/// A size in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Viewport {
    /// Pixels across.
    pub width_px: u32,
    /// Pixels down.
    pub height_px: u32,
}

impl Viewport {
    /// Pixels across and down.
    pub fn size_px(self) -> [u32; 2] {
        [self.width_px, self.height_px]
    }
}

impl From<[u32; 2]> for Viewport {
    fn from([width_px, height_px]: [u32; 2]) -> Self {
        Self { width_px, height_px }
    }
}

impl Default for Viewport {
    fn default() -> Self {
        Self { width_px: 800, height_px: 600 }
    }
}

/// How an error of the mesh is measured on the screen. Both keep the mesh free of cracks, and both depend on the eye's place alone: turning changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ErrorMetric {
    /// As if every error were seen from the side: an error e at a distance D shows as e / D.
    #[default]
    Ball,
    /// Along the line of sight: errors of height show as e g / D^2, g being the distance over the ground. They are the shorter the steeper the eye looks down, and from
    /// straight above they do not show at all. Outlines of voids are measured as by [`ErrorMetric::Ball`].
    Sight,
}

impl ErrorMetric {
    /// Both measures.
    pub const ALL: [Self; 2] = [Self::Ball, Self::Sight];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Sight => "sight",
        }
    }
}

/// One frame's camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Eye position in metres east, north and up, in the drawn (exaggerated) space.
    pub eye_m: DVec3,
    /// Heading in radians, clockwise from north.
    pub yaw_rad: f64,
    /// Climb of the line of sight in radians, positive upwards.
    pub pitch_rad: f64,
    /// Roll in radians, positive to the right.
    pub roll_rad: f64,
    /// Vertical field of view in radians, above 0 and below pi.
    pub vertical_fov_rad: f64,
    /// Size of the picture.
    pub viewport: Viewport,
    /// Largest error on the screen that the mesh may show, in pixels; above 0.
    pub tolerance_px: f64,
    /// What heights are multiplied by when drawn; above 0, 1 for true scale. The eye's height is not affected.
    pub vertical_exaggeration: f64,
    /// How errors are measured on the screen.
    pub metric: ErrorMetric,
}

impl View {
    /// Looks from a place in metres east, north and up, with a heading in degrees clockwise from north and a climb in degrees, positive upwards. Level, at a tolerance of a
    /// pixel and true scale, with a field of view of 45 degrees over 800 x 600 pixels; the methods below change that.
    ///
    /// ```
    /// use terrasoar::View;
    ///
    /// let view = View::new([5000.0, 2000.0, 1800.0], 30.0, -15.0).tolerance_px(2.0).viewport([1920, 1080]);
    /// assert_eq!(view.viewport.height_px, 1080);
    /// ```
    pub fn new(eye_m: impl Into<DVec3>, heading_deg: f64, climb_deg: f64) -> Self {
        Self {
            eye_m: eye_m.into(),
            yaw_rad: heading_deg.to_radians(),
            pitch_rad: climb_deg.to_radians(),
            roll_rad: 0.0,
            vertical_fov_rad: 45f64.to_radians(),
            viewport: Viewport::default(),
            tolerance_px: 1.0,
            vertical_exaggeration: 1.0,
            metric: ErrorMetric::default(),
        }
    }

    /// This view with another largest error on the screen, in pixels; above 0.
    pub fn tolerance_px(self, tolerance_px: f64) -> Self {
        Self { tolerance_px, ..self }
    }

    /// This view in a picture of another size, in pixels across and down.
    pub fn viewport(self, viewport: impl Into<Viewport>) -> Self {
        Self { viewport: viewport.into(), ..self }
    }

    /// This view with another vertical field of view, in degrees above 0 and below 180.
    pub fn fov_deg(self, vertical_fov_deg: f64) -> Self {
        Self { vertical_fov_rad: vertical_fov_deg.to_radians(), ..self }
    }

    /// This view with a roll in degrees, positive to the right.
    pub fn roll_deg(self, roll_deg: f64) -> Self {
        Self { roll_rad: roll_deg.to_radians(), ..self }
    }

    /// This view with heights multiplied by another factor above 0.
    pub fn exaggeration(self, vertical_exaggeration: f64) -> Self {
        Self { vertical_exaggeration, ..self }
    }

    /// This view with errors measured in another way.
    pub fn metric(self, metric: ErrorMetric) -> Self {
        Self { metric, ..self }
    }

    /// Whether every number is one that a picture can be taken with: places and angles are finite, and the picture, the field of view, the tolerance and the exaggeration
    /// are what their fields say. The view of a window that is folded away, of no pixels, is not.
    pub fn is_sound(&self) -> bool {
        let angles = [self.yaw_rad, self.pitch_rad, self.roll_rad];
        self.eye_m.is_finite()
            && angles.iter().all(|angle| angle.is_finite())
            && (self.vertical_fov_rad > 0.0 && self.vertical_fov_rad < std::f64::consts::PI)
            && (self.tolerance_px > 0.0 && self.tolerance_px.is_finite())
            && (self.vertical_exaggeration > 0.0 && self.vertical_exaggeration.is_finite())
            && self.viewport.width_px > 0
            && self.viewport.height_px > 0
    }

    /// Looks from one point towards another, level, at a tolerance of a pixel and true scale, with a field of view of 0.8 radians. What looks
    /// straight down or up has north, or south, at the top; from a point towards itself the line of sight is north.
    pub fn look_at(eye_m: DVec3, at_m: DVec3, viewport: Viewport) -> Self {
        let to = at_m - eye_m;
        Self {
            eye_m,
            yaw_rad: portable::atan2(to.x, to.y),
            pitch_rad: portable::atan2(to.z, portable::hypot(to.x, to.y)),
            roll_rad: 0.0,
            vertical_fov_rad: 0.8,
            viewport,
            tolerance_px: 1.0,
            vertical_exaggeration: 1.0,
            metric: ErrorMetric::default(),
        }
    }

    /// Unit vectors to the right, up and forward of the eye.
    pub fn axes(&self) -> [DVec3; 3] {
        let (sin_yaw, cos_yaw) = portable::sin_cos(self.yaw_rad);
        let (sin_pitch, cos_pitch) = portable::sin_cos(self.pitch_rad);
        let forward = DVec3::new(sin_yaw * cos_pitch, cos_yaw * cos_pitch, sin_pitch);
        let level_right = DVec3::new(cos_yaw, -sin_yaw, 0.0);
        let level_up = level_right.cross(forward);
        let (sin_roll, cos_roll) = portable::sin_cos(self.roll_rad);
        let right = level_right * cos_roll - level_up * sin_roll;
        let up = level_right * sin_roll + level_up * cos_roll;
        [right, up, forward]
    }

    /// Pixels a radian of the vertical field of view: the paper's alpha = m / phi (Bao et al., eq. 1).
    pub fn pixels_per_radian(&self) -> f64 {
        f64::from(self.viewport.height_px) / self.vertical_fov_rad
    }

    /// Pixels a radian over the tolerance: a vertex is in the mesh when nearer than `nu * error + radius`, by [`ErrorMetric::Ball`].
    pub fn nu(&self) -> f64 {
        self.pixels_per_radian() / self.tolerance_px
    }

    /// Tangents of half the horizontal and half the vertical field of view.
    pub fn half_tangents(&self) -> [f64; 2] {
        let vertical = portable::tan(0.5 * self.vertical_fov_rad);
        [vertical * f64::from(self.viewport.width_px) / f64::from(self.viewport.height_px), vertical]
    }

    /// Outward unit normals of the left, right, bottom and top planes of the view pyramid; each passes through the eye.
    pub fn side_normals(&self) -> [DVec3; 4] {
        let [right, up, forward] = self.axes();
        let [tan_x, tan_y] = self.half_tangents();
        [
            (-right - forward * tan_x).normalize(),
            (right - forward * tan_x).normalize(),
            (-up - forward * tan_y).normalize(),
            (up - forward * tan_y).normalize(),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_point_out_of_what_is_seen() {
        for (yaw, pitch, roll) in [(0.0, 0.0, 0.0), (1.0, -0.4, 0.3), (4.0, 0.7, -2.0)] {
            let view = View {
                eye_m: DVec3::new(5.0, 6.0, 7.0),
                yaw_rad: yaw,
                pitch_rad: pitch,
                roll_rad: roll,
                vertical_fov_rad: 0.8,
                viewport: Viewport::default(),
                tolerance_px: 1.0,
                vertical_exaggeration: 1.0,
                metric: ErrorMetric::default(),
            };
            let [right, up, forward] = view.axes();
            assert!((right.cross(up) + forward).length() < 1e-12, "right-handed, looking along forward");
            for n in view.side_normals() {
                assert!(n.dot(forward) < 0.0);
            }
            let half_width = 0.4f64.tan() * 800.0 / 600.0;
            let edge = |s: f64| forward + right * (half_width * s) + up * (0.4f64.tan() * s);
            assert!(view.side_normals().iter().all(|n| n.dot(edge(0.999)) < 0.0));
            assert!(view.side_normals().iter().all(|n| n.dot(edge(-0.999)) < 0.0));
            assert!(view.side_normals().iter().any(|n| n.dot(edge(1.001)) > 0.0));
        }
    }

    #[test]
    fn what_is_looked_at_is_in_the_middle_and_level() {
        for (eye, at) in [
            ([0.0, 0.0, 0.0], [3.0, 4.0, -5.0]),
            ([1e6, 2e6, 3e3], [1e6 - 700.0, 2e6 - 200.0, 4e3]),
            ([5.0, 5.0, 5.0], [6.0, 5.0, 5.0]),
        ] {
            let [eye, at] = [eye, at].map(DVec3::from);
            let [right, up, forward] = View::look_at(eye, at, Viewport::default()).axes();
            assert!((forward - (at - eye).normalize()).length() < 1e-12);
            assert!(right.z.abs() < 1e-12 && up.z > 0.0);
        }
        let [right, up, _] = View::look_at(DVec3::Z, DVec3::ZERO, Viewport::default()).axes();
        assert!(
            (right - DVec3::X).length() < 1e-12 && (up - DVec3::Y).length() < 1e-12,
            "north is at the top"
        );
        let [_, _, forward] = View::look_at(DVec3::X, DVec3::X, Viewport::default()).axes();
        assert_eq!(forward, DVec3::Y);
    }

    #[test]
    fn yaw_is_clockwise_from_north_and_pitch_is_up() {
        let view = View {
            eye_m: DVec3::ZERO,
            yaw_rad: std::f64::consts::FRAC_PI_2,
            pitch_rad: 0.0,
            roll_rad: 0.0,
            vertical_fov_rad: 0.8,
            viewport: Viewport::default(),
            tolerance_px: 1.0,
            vertical_exaggeration: 1.0,
            metric: ErrorMetric::default(),
        };
        assert!((view.axes()[2] - DVec3::X).length() < 1e-12, "yaw 90 degrees looks east");
        let up = View { pitch_rad: 0.5, ..view };
        assert!(up.axes()[2].z > 0.0);
        assert!((view.axes()[1] - DVec3::Z).length() < 1e-12);
    }
}
