//! What goes into a frame and what it cost: plain values.

use crate::error::{RenderError, Result};
use crate::gpu::Capabilities;
use crate::look::Look;
use terrasoar::view::View;

/// Depth of the picture: 32-bit float, reversed, so that precision is even in the logarithm of distance.
pub(crate) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// What a renderer is made with.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
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

impl RendererOptions {
    /// These options with so many bytes of device memory for normal tiles.
    pub fn tile_budget_bytes(self, tile_budget_bytes: u64) -> Self {
        Self { tile_budget_bytes, ..self }
    }

    /// These options with many ranges drawn in one indirect call, or not.
    pub fn multi_draw(self, multi_draw: bool) -> Self {
        Self { multi_draw, ..self }
    }

    /// These options with frames timed on the device, or not.
    pub fn timestamps(self, timestamps: bool) -> Self {
        Self { timestamps, ..self }
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

/// What a render pass that ground is drawn into is like: the caller's own, with other things in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PassFormat {
    /// Format of its one colour target: any 8-bit or float colour format, sRGB or not; colours come out the same.
    pub colour: wgpu::TextureFormat,
    /// Format of its depth buffer.
    pub depth: wgpu::TextureFormat,
    /// Which way depth runs.
    pub depth_range: DepthRange,
    /// Samples a pixel.
    pub samples: u32,
}

impl PassFormat {
    /// A pass with one sample a pixel and 32-bit depth that is reversed, as this crate's own are.
    pub fn new(colour: wgpu::TextureFormat) -> Self {
        let depth = DEPTH_FORMAT;
        Self { colour, depth, depth_range: DepthRange::Reversed, samples: 1 }
    }

    /// This pass with another depth buffer.
    pub fn depth(self, depth: wgpu::TextureFormat, depth_range: DepthRange) -> Self {
        Self { depth, depth_range, ..self }
    }

    /// This pass with so many samples a pixel.
    pub fn samples(self, samples: u32) -> Self {
        Self { samples, ..self }
    }

    /// Refuses what no pass can have. Whether a device has it, the device says.
    pub(crate) fn check(&self) -> Result<()> {
        if !self.colour.has_color_aspect() {
            return Err(RenderError::Usage("PassFormat's colour is no format of colours"));
        }
        if matches!(
            self.colour.sample_type(None, None),
            Some(wgpu::TextureSampleType::Sint | wgpu::TextureSampleType::Uint)
        ) {
            return Err(RenderError::Usage(
                "PassFormat's colour holds whole numbers; it needs a format that is drawn to as fractions, such as Rgba8Unorm",
            ));
        }
        if !self.depth.has_depth_aspect() {
            return Err(RenderError::Usage("PassFormat's depth is no format of a depth buffer"));
        }
        if !matches!(self.samples, 1 | 2 | 4 | 8 | 16) {
            return Err(RenderError::Usage("PassFormat's samples are not 1, 2, 4, 8 or 16"));
        }
        Ok(())
    }
}

/// Which way depth runs. Both are endless: there is no far plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum DepthRange {
    /// 1 at the near plane, 0 infinitely far: even precision with floating-point depth. To be cleared to 0; nearer is greater.
    #[default]
    Reversed,
    /// 0 at the near plane, 1 infinitely far. To be cleared to 1; nearer is less. Far ground may flicker, for most of the precision lies near the eye.
    Forward,
}

impl DepthRange {
    /// What a depth buffer is to be cleared to.
    pub const fn clear(self) -> f32 {
        match self {
            Self::Reversed => 0.0,
            Self::Forward => 1.0,
        }
    }

    /// How depths are to be compared.
    pub const fn compare(self) -> wgpu::CompareFunction {
        match self {
            Self::Reversed => wgpu::CompareFunction::Greater,
            Self::Forward => wgpu::CompareFunction::Less,
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::TextureFormat as Format;

    #[test]
    fn passes_that_cannot_be_are_refused_in_words() {
        let sound = PassFormat::new(Format::Rgba8UnormSrgb);
        let floating =
            PassFormat::new(Format::Rgba16Float).depth(Format::Depth24PlusStencil8, DepthRange::Forward);
        assert!([sound, sound.samples(4), floating].iter().all(|format| format.check().is_ok()));
        for (format, word) in [
            (PassFormat::new(Format::Depth32Float), "colour is no format"),
            (PassFormat::new(Format::R32Uint), "whole numbers"),
            (sound.depth(Format::Rgba8Unorm, DepthRange::Reversed), "depth is no format"),
            (sound.samples(3), "samples are not"),
            (sound.samples(0), "samples are not"),
        ] {
            let said = format.check().unwrap_err().to_string();
            assert!(said.contains(word), "{said}");
        }
    }
}
