//! A frame that is ready to be drawn into a render pass of the caller.

use super::options::{Drawn, SceneError};
use glam::{DVec3, Mat4};
use terrasoar::view::View;
use terrasoar_render::{DepthRange, DrawStats, Prepared, Renderer, wgpu};

/// One frame of a scene, all of it on the device.
pub struct SceneFrame<'s> {
    pub(super) renderer: &'s Renderer,
    pub(super) prepared: Prepared,
    pub(super) view: View,
    pub(super) depth_range: DepthRange,
    pub(super) drawn: Drawn,
}

impl SceneFrame<'_> {
    /// Draws ground and walls into a pass like the one that the frame was made for. Clears nothing, and writes the pass's depth, so what was or will be drawn
    /// there hides and is hidden as it should. Changes the pass's pipeline, bind group 0 (and 1 with a material), index buffer and vertex buffer 0.
    ///
    /// # Errors
    /// None is known; a frame that does not fit its renderer would be one.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) -> Result<DrawStats, SceneError> {
        Ok(self.renderer.draw(pass, &self.prepared, false)?)
    }

    /// As [`SceneFrame::draw`], and the sky where nothing was drawn so far.
    ///
    /// # Errors
    /// As there.
    pub fn draw_with_sky(&self, pass: &mut wgpu::RenderPass<'_>) -> Result<DrawStats, SceneError> {
        Ok(self.renderer.draw(pass, &self.prepared, true)?)
    }

    /// From metres around `origin_m`, a place in metres east, north and up (heights exaggerated), to clip space, as the ground is drawn: for whatever else stands on it. An origin near what is drawn
    /// keeps places exact in single precision.
    pub fn clip_from_local(&self, origin_m: DVec3) -> Mat4 {
        let from_eye = Mat4::from_translation((origin_m - self.view.eye_m).as_vec3());
        self.renderer.clip_from_eye(&self.view, self.depth_range) * from_eye
    }

    /// What came to the device for it.
    pub fn drawn(&self) -> Drawn {
        self.drawn
    }
}
