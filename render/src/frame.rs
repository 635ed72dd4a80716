//! What goes into a frame and what it cost: plain values.

use crate::gpu::Capabilities;
use crate::look::Look;
use terrasoar::view::View;

/// What a renderer is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RendererOptions {
    /// Device memory for normal tiles in bytes, 66,564 a tile. 64 MiB by default: a view of 1920 x 1080 pixels wants some hundred tiles, a thousand fit.
    pub tile_budget_bytes: u64,
    /// Whether the device draws many ranges in one indirect call ([`crate::Capabilities::multi_draw`]).
    pub multi_draw: bool,
    /// Whether to time frames where the device can.
    pub timestamps: bool,
}

impl Default for RendererOptions {
    fn default() -> Self {
        Self { tile_budget_bytes: 64 << 20, multi_draw: false, timestamps: false }
    }
}

impl From<&Capabilities> for RendererOptions {
    /// Everything the device can do.
    fn from(capabilities: &Capabilities) -> Self {
        Self { multi_draw: capabilities.multi_draw, timestamps: capabilities.timestamps, ..Self::default() }
    }
}

/// Where a frame goes.
#[derive(Debug, Clone, Copy)]
pub struct Target<'a> {
    /// A view of one layer and mip level of a texture that can be rendered to, of one sample a pixel.
    pub view: &'a wgpu::TextureView,
    /// Its size in pixels.
    pub size_px: [u32; 2],
    /// Its format: any 8-bit or float colour format, sRGB or not; colours come out the same.
    pub format: wgpu::TextureFormat,
}

/// One frame.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The camera.
    pub view: &'a View,
    /// The camera that the mesh was refined for, where it is another (frozen refinement): vertices move by its eye, field of
    /// view and tolerance. Its exaggeration is taken to be that of `view`.
    pub refined_for: Option<&'a View>,
    /// How it looks.
    pub look: &'a Look,
}

/// What a frame cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DrawStats {
    /// Triangle slots drawn, empty ones included.
    pub triangles: u64,
    /// Ranges drawn, after merging. The optimum is 1.
    pub ranges: u32,
    /// Draw calls recorded.
    pub draw_calls: u32,
    /// Bytes of uniforms and draw arguments sent.
    pub bytes: u64,
}
