//! What is seen from where: the view of a frame, the ground under a pixel, the overview beside the panel.

use super::Viewer;
use crate::window::camera::{Camera, Rig};
use crate::window::panel;
use crate::window::pick::{self, Hit};
use crate::window::screen::Screen;
use crate::window::settings::Settings;
use crate::window::stage::Stage;
use terrasoar::flight::generate::Ground;
use terrasoar::view::{View, Viewport};
use terrasoar_scene::overview::{FOV_DEG, overview};
use winit::window::Window;

impl Viewer {
    fn viewport(&self) -> Viewport {
        let [width_px, height_px] = self.screen.size_px();
        Viewport { width_px, height_px }
    }

    pub(super) fn view(&self) -> View {
        let settings = &self.settings;
        let view = self.rig.camera.view(self.viewport(), settings.tolerance_px(), settings.exaggeration);
        view.metric(settings.metric())
    }

    /// The ground at a place of the window.
    pub(super) fn pick(&self, pointer: Option<[f64; 2]>) -> Option<Hit> {
        let [x, y] = pointer?;
        let viewport = self.viewport();
        let at = [x / f64::from(viewport.width_px), y / f64::from(viewport.height_px)];
        let camera = self.rig.camera;
        let ground = self.stage.heights();
        pick::cast(
            &ground,
            ground.spacing_m(),
            self.settings.exaggeration,
            camera.eye_m,
            camera.ray(at, viewport),
        )
    }

    /// Where a point of drawn space is seen, in pixels from the top left; none behind the eye.
    pub(super) fn place_on_screen(&self, at_m: glam::DVec3) -> Option<[f64; 2]> {
        let camera = self.rig.camera;
        let [right, up, forward] = camera.axes();
        let [width, height] = self.screen.size_px().map(f64::from);
        let to = at_m - camera.eye_m;
        let ahead_m = to.dot(forward);
        let px_a_m = 0.5 * height / ((0.5 * camera.vertical_fov_deg.to_radians()).tan() * ahead_m);
        (ahead_m > 0.0).then(|| [0.5 * width + to.dot(right) * px_a_m, 0.5 * height - to.dot(up) * px_a_m])
    }

    /// What lies in the middle of the picture, or would.
    pub(super) fn ahead_m(&self) -> glam::DVec3 {
        let [width, height] = self.screen.size_px().map(f64::from);
        match self.pick(Some([0.5 * width, 0.5 * height])) {
            Some(hit) => hit.at_m,
            None => {
                let [east_m, north_m] = self.stage.heights().extent_m();
                self.rig.camera.eye_m + self.rig.camera.axes()[2] * 0.25 * east_m.max(north_m)
            }
        }
    }

    /// The whole terrain, beside the panel.
    pub(super) fn overview(&self) -> Camera {
        overview_beside_panel(&self.stage, &self.screen, &self.window, &self.settings)
    }
}

/// A rig that sees the whole terrain.
pub(super) fn start(stage: &Stage, screen: &Screen, window: &Window, settings: &Settings) -> Rig {
    let camera = overview_beside_panel(stage, screen, window, settings);
    Rig::new(camera, &stage.heights())
}

/// The overview in what the panel leaves of the window.
fn overview_beside_panel(stage: &Stage, screen: &Screen, window: &Window, settings: &Settings) -> Camera {
    let [width_px, height_px] = screen.size_px();
    let panel_px = if settings.panel { panel::WIDTH * window.scale_factor() } else { 0.0 };
    let panel_px = panel_px.min(0.5 * f64::from(width_px));
    // Perspective makes the near side wider when the eye steps aside.
    let beside = Viewport { width_px: (0.94 * (f64::from(width_px) - panel_px)) as u32, height_px };
    let mut view = overview(stage.terrain(), settings.exaggeration, FOV_DEG, beside);
    // The eye steps aside by half the panel, as wide as that is in the middle of the terrain.
    let [east_m, north_m] = stage.heights().extent_m();
    let away_m = view.eye_m.distance(glam::DVec3::new(0.5 * east_m, 0.5 * north_m, 0.0));
    let m_a_px = 2.0 * away_m * view.half_tangents()[1] / f64::from(height_px);
    view.eye_m -= view.axes()[0] * (0.5 * panel_px * m_a_px);
    Camera::from(&view)
}
