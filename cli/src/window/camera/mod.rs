//! Where the eye is and how it moves: plain numbers, no window.
//!
//! A [`Rig`] takes the keys held and the mouse's movement ([`Controls`]) and a span of time, and moves its [`Camera`]. Speeds are approached by exact
//! integration, so **the way does not depend on the frame rate**, and **the eye is never nearer to the ground below it than
//! [`CLEARANCE_M`]**, heights exaggerated. Angles are kept in degrees, as flight files have them, so that a recorded view is the view that
//! was seen, bit by bit. Cost: one height a step.

mod glide;
mod motion;
mod orbit;

use glam::DVec3;
use terrasoar::flight::FlightFrame;
use terrasoar::flight::generate::Ground;
use terrasoar::view::{View, Viewport};

use glide::Glide;
pub(crate) use glide::between;
use motion::Velocity;

/// How near to the ground the eye may come, in metres.
pub(crate) const CLEARANCE_M: f64 = 3.0;
/// How steeply one may look up or down, in degrees: short of straight, where there is no heading.
const STEEPEST_DEG: f64 = 89.0;
/// How fast a followed height is approached, in seconds to about a third.
const FOLLOW_S: f64 = 0.25;
/// How many times faster with the key for it.
const FAST: f64 = 5.0;

/// Place and direction of the eye.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Camera {
    /// Metres east, north and up, heights exaggerated.
    pub eye_m: DVec3,
    /// Heading, clockwise from north.
    pub yaw_deg: f64,
    /// Climb of the line of sight.
    pub pitch_deg: f64,
    /// Roll, positive to the right; only flights have any.
    pub roll_deg: f64,
    /// Vertical field of view.
    pub vertical_fov_deg: f64,
}

impl Camera {
    /// The camera as a frame of a flight.
    pub(crate) fn frame(&self, time_s: f64) -> FlightFrame {
        FlightFrame {
            time_s,
            eye_m: self.eye_m.to_array(),
            yaw_deg: self.yaw_deg,
            pitch_deg: self.pitch_deg,
            roll_deg: self.roll_deg,
            vertical_fov_deg: self.vertical_fov_deg,
        }
    }

    /// The view of this camera.
    pub(crate) fn view(&self, viewport: Viewport, tolerance_px: f64, vertical_exaggeration: f64) -> View {
        View { vertical_exaggeration, ..self.frame(0.0).view(viewport, tolerance_px) }
    }

    /// Unit vectors to the right, up and forward.
    pub(crate) fn axes(&self) -> [DVec3; 3] {
        self.view(Viewport::default(), 1.0, 1.0).axes()
    }

    /// Unit vector through a place of the picture, given in parts of its width and height from the top left.
    pub(crate) fn ray(&self, at: [f64; 2], viewport: Viewport) -> DVec3 {
        let view = self.view(viewport, 1.0, 1.0);
        let ([right, up, forward], [tan_x, tan_y]) = (view.axes(), view.half_tangents());
        (forward + right * (2.0 * at[0] - 1.0) * tan_x + up * (1.0 - 2.0 * at[1]) * tan_y).normalize()
    }

    fn turn(&mut self, by_deg: [f64; 2]) {
        self.yaw_deg = (self.yaw_deg + by_deg[0]).rem_euclid(360.0);
        self.pitch_deg = (self.pitch_deg + by_deg[1]).clamp(-STEEPEST_DEG, STEEPEST_DEG);
    }
}

impl From<&View> for Camera {
    fn from(view: &View) -> Self {
        Self {
            eye_m: view.eye_m,
            yaw_deg: view.yaw_rad.to_degrees(),
            pitch_deg: view.pitch_rad.to_degrees(),
            roll_deg: view.roll_rad.to_degrees(),
            vertical_fov_deg: view.vertical_fov_rad.to_degrees(),
        }
    }
}

impl From<&FlightFrame> for Camera {
    fn from(frame: &FlightFrame) -> Self {
        Self {
            eye_m: DVec3::from_array(frame.eye_m),
            yaw_deg: frame.yaw_deg,
            pitch_deg: frame.pitch_deg,
            roll_deg: frame.roll_deg,
            vertical_fov_deg: frame.vertical_fov_deg,
        }
    }
}

/// What is held and what was dragged since the step before.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Controls {
    /// Right, forward and up, each from -1 to 1.
    pub thrust: [f64; 3],
    /// Faster.
    pub fast: bool,
    /// Degrees to look to the right and up.
    pub look_deg: [f64; 2],
    /// Degrees to go round the pivot, to the right and up.
    pub orbit_deg: [f64; 2],
}

impl Controls {
    fn is_idle(&self) -> bool {
        *self == Self { fast: self.fast, ..Self::default() }
    }
}

/// A camera and what moves it.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    /// Where it is now.
    pub camera: Camera,
    /// Metres a second at full thrust.
    pub speed_m_s: f64,
    /// Metres above the ground that are kept, if they are.
    pub follow_m: Option<f64>,
    /// The point that it circles by itself, in drawn space, if it does.
    pub circling: Option<DVec3>,
    /// The point that dragging goes round.
    pub pivot: Option<DVec3>,
    glide: Option<Glide>,
    velocity: Velocity,
    /// Whether a height that is kept is still to be reached.
    rising: bool,
}

impl Rig {
    /// Starts at a camera, at a speed that crosses the ground in half a minute.
    pub(crate) fn new(camera: Camera, ground: &dyn Ground) -> Self {
        let [east_m, north_m] = ground.extent_m();
        Self {
            camera,
            speed_m_s: east_m.max(north_m) / 30.0,
            follow_m: None,
            circling: None,
            pivot: None,
            glide: None,
            velocity: Velocity::default(),
            rising: false,
        }
    }

    /// Multiplies the speed, within what still makes sense: a walk to 1,000 km a second.
    pub(crate) fn change_speed(&mut self, factor: f64) {
        self.speed_m_s = (self.speed_m_s * factor).clamp(1.0, 1e6);
    }

    /// Starts a way to another camera; any thrust ends it.
    pub(crate) fn glide_to(&mut self, target: Camera) {
        self.circling = None;
        self.glide = Some(Glide::new(self.camera, target));
    }

    /// Starts a way to a point of the ground, in drawn space, to look at it from `away_m`.
    pub(crate) fn go_to(&mut self, at_m: DVec3, away_m: f64) {
        let (sin, cos) = (-28f64).to_radians().sin_cos();
        let (sin_yaw, cos_yaw) = self.camera.yaw_deg.to_radians().sin_cos();
        let forward = DVec3::new(sin_yaw * cos, cos_yaw * cos, sin);
        let eye_m = at_m - away_m * forward;
        self.glide_to(Camera { eye_m, pitch_deg: -28.0, roll_deg: 0.0, ..self.camera });
    }

    /// Takes a camera from elsewhere, such as a flight, and stops.
    pub(crate) fn place(&mut self, camera: Camera) {
        self.camera = camera;
        self.velocity = Velocity::default();
        (self.glide, self.circling) = (None, None);
    }

    /// Keeps the height above the ground from now on, or no longer.
    pub(crate) fn toggle_follow(&mut self, ground: &dyn Ground, exaggeration: f64) {
        self.follow_m = match self.follow_m {
            Some(_) => None,
            None => ground_below_m(ground, self.camera.eye_m, exaggeration)
                .map(|below_m| (self.camera.eye_m.z - below_m).max(CLEARANCE_M)),
        };
    }

    /// Moves the eye with the ground below it when heights are drawn with another exaggeration.
    pub(crate) fn exaggerate(&mut self, ground: &dyn Ground, before: f64, now: f64) {
        let eye_m = self.camera.eye_m;
        let below = |exaggeration| {
            ground_below_m(ground, eye_m, exaggeration)
                .unwrap_or_else(|| ground.height_range_m()[1] * exaggeration)
        };
        self.camera.eye_m.z += below(now) - below(before);
        self.keep_clear(ground, now);
    }

    /// Whether it is on a way that is known beforehand.
    pub(crate) fn is_gliding(&self) -> bool {
        self.glide.is_some()
    }

    /// Whether it moves by itself or still rolls out.
    pub(crate) fn is_moving(&self) -> bool {
        let still = self.velocity.is_rest(self.speed_m_s) && !self.rising;
        self.glide.is_some() || self.circling.is_some() || !still
    }

    /// Moves on by `span_s` seconds.
    pub(crate) fn advance(
        &mut self,
        span_s: f64,
        controls: &Controls,
        ground: &dyn Ground,
        exaggeration: f64,
    ) {
        if !controls.is_idle() {
            self.glide = None;
        }
        if let Some(glide) = &mut self.glide {
            self.velocity = Velocity::default();
            let (camera, arrived) = glide.advance(span_s);
            self.camera = camera;
            if arrived {
                self.glide = None;
            }
        } else {
            self.fly(span_s, controls, ground, exaggeration);
        }
        self.keep_clear(ground, exaggeration);
    }

    fn fly(&mut self, span_s: f64, controls: &Controls, ground: &dyn Ground, exaggeration: f64) {
        self.camera.turn(controls.look_deg);
        if controls.thrust != [0.0; 3] || controls.look_deg != [0.0; 2] {
            self.camera.roll_deg = 0.0;
        }
        if let Some(pivot) = self.circling {
            orbit::around(&mut self.camera, pivot, [orbit::CIRCLING_DEG_S * span_s, 0.0]);
        }
        if let Some(pivot) = self.pivot {
            orbit::around(&mut self.camera, pivot, controls.orbit_deg);
        }
        let [right, _, forward] = self.camera.axes();
        let [to_right, to_front, to_sky] = controls.thrust;
        let speed_m_s = self.speed_m_s * if controls.fast { FAST } else { 1.0 };
        // With a height to keep, the height is what up and down change, and forward is level.
        let forward = match self.follow_m {
            Some(_) => DVec3::new(forward.x, forward.y, 0.0).normalize_or(forward),
            None => forward,
        };
        let climb = if self.follow_m.is_some() { 0.0 } else { to_sky };
        let wanted = (right * to_right + forward * to_front + DVec3::Z * climb).clamp_length_max(1.0);
        self.camera.eye_m += self.velocity.advance(span_s, wanted * speed_m_s);
        if wanted == DVec3::ZERO && self.velocity.is_rest(self.speed_m_s) {
            self.velocity = Velocity::default();
        }
        self.rising = false;
        if let Some(height_m) = &mut self.follow_m {
            *height_m = (*height_m * (1.5 * to_sky * span_s).exp()).clamp(CLEARANCE_M, 1e7);
            if let Some(below_m) = ground_below_m(ground, self.camera.eye_m, exaggeration) {
                let kept = (-span_s / FOLLOW_S).exp();
                let target_m = below_m + *height_m;
                self.camera.eye_m.z = target_m + (self.camera.eye_m.z - target_m) * kept;
                self.rising = (self.camera.eye_m.z - target_m).abs() > 1e-3 * *height_m;
            }
        }
    }

    fn keep_clear(&mut self, ground: &dyn Ground, exaggeration: f64) {
        if let Some(below_m) = ground_below_m(ground, self.camera.eye_m, exaggeration) {
            self.camera.eye_m.z = self.camera.eye_m.z.max(below_m + CLEARANCE_M);
        }
    }
}

/// Height of the ground below a place, exaggerated.
pub(crate) fn ground_below_m(ground: &dyn Ground, at_m: DVec3, exaggeration: f64) -> Option<f64> {
    ground.height_m(at_m.x, at_m.y).map(|height_m| height_m * exaggeration)
}

#[cfg(test)]
pub(super) mod tests;
