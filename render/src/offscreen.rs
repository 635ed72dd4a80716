//! Pictures without a window: a texture to render to, and reading it back.

use crate::error::{RenderError, Result};
use crate::frame::Target;
use crate::renderer::Renderer;
use crate::words;

/// A picture on the device, 8-bit sRGB with alpha.
#[derive(Debug)]
pub struct Offscreen {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

impl Offscreen {
    /// A picture of some size in pixels.
    ///
    /// # Errors
    ///
    /// [`RenderError::PictureSize`] for no pixels or more than the device's textures have.
    pub fn new(device: &wgpu::Device, size_px: [u32; 2]) -> Result<Self> {
        let most = device.limits().max_texture_dimension_2d;
        if size_px.iter().any(|s| *s == 0 || *s > most) {
            return Err(RenderError::PictureSize { wide: size_px[0], high: size_px[1], most });
        }
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width: size_px[0], height: size_px[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        Ok(Self { view: texture.create_view(&Default::default()), texture })
    }

    /// A picture in a texture of the caller's, which must have four bytes a pixel and allow copies from it.
    ///
    /// # Errors
    ///
    /// [`RenderError::Usage`] where it does not.
    pub fn of(texture: wgpu::Texture) -> Result<Self> {
        let fits = texture.format().block_copy_size(None) == Some(4)
            && texture.usage().contains(wgpu::TextureUsages::COPY_SRC)
            && texture.sample_count() == 1;
        if !fits {
            return Err(RenderError::Usage(
                "a picture needs four bytes a pixel, one sample and copies from it",
            ));
        }
        Ok(Self { view: texture.create_view(&Default::default()), texture })
    }

    /// What to render to.
    pub fn target(&self) -> Target<'_> {
        Target {
            view: &self.view,
            size_px: [self.texture.width(), self.texture.height()],
            format: self.texture.format(),
        }
    }

    /// The pixels, four bytes each, row by row from the top. Waits for all submitted work.
    ///
    /// # Errors
    ///
    /// [`RenderError::Device`] or [`RenderError::DeviceLost`] when the device fails meanwhile.
    pub fn read_rgba(&self, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Vec<u8>> {
        read_back(device, queue, &self.texture)
    }
}

/// Distances along the line of sight of the renderer's last frame in metres, row by row from the top; infinite where
/// there is sky. Waits for all submitted work. Only where [`crate::Capabilities::depth_copies`] says so.
///
/// # Errors
///
/// [`RenderError::Usage`] before the first frame and with smoothed edges; as [`Offscreen::read_rgba`].
pub fn read_depth_m(renderer: &Renderer, device: &wgpu::Device, queue: &wgpu::Queue) -> Result<Vec<f32>> {
    let (depth, near_m) = renderer
        .depth()
        .ok_or(RenderError::Usage("depth can be read after a frame without smoothed edges"))?;
    let bytes = read_back(device, queue, depth)?;
    let metres = |d: [u8; 4]| (near_m / f64::from(f32::from_le_bytes(d))) as f32;
    Ok(bytes.as_chunks().0.iter().map(|d| metres(*d)).collect())
}

/// A texture of four bytes a texel.
fn read_back(device: &wgpu::Device, queue: &wgpu::Queue, texture: &wgpu::Texture) -> Result<Vec<u8>> {
    let row = 4 * texture.width();
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size: u64::from(padded) * u64::from(texture.height()),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        texture.size(),
    );
    queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| {
        // The receiver lives until the poll below has returned.
        let _ = sender.send(result);
    });
    let refused = |message: String| RenderError::Device { message: words::last_cause(&message) };
    device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| refused(e.to_string()))?;
    receiver
        .try_recv()
        .map_err(|_| RenderError::DeviceLost { reason: "a picture never arrived".to_owned() })?
        .map_err(|e| refused(e.to_string()))?;
    let mapped = buffer.slice(..).get_mapped_range().map_err(|e| refused(e.to_string()))?;
    Ok(mapped.chunks_exact(padded as usize).flat_map(|r| &r[..row as usize]).copied().collect())
}
