//! Depth and, where edges are smoothed, the samples: textures that go with a target of some size.

use crate::frame::DEPTH_FORMAT;

/// Textures of one size, format and sample count.
#[derive(Debug)]
pub(crate) struct Attachments {
    key: Key,
    pub depth: wgpu::Texture,
    pub depth_view: wgpu::TextureView,
    /// Present with more than one sample.
    pub samples: Option<wgpu::TextureView>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Key {
    pub size_px: [u32; 2],
    pub format: wgpu::TextureFormat,
    pub samples: u32,
}

impl Attachments {
    /// Those of `key`, made anew where `old` are not.
    pub(crate) fn keep_or_make(old: Option<Self>, device: &wgpu::Device, key: Key) -> Self {
        if let Some(old) = old
            && old.key == key
        {
            return old;
        }
        let texture = |label, format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width: key.size_px[0],
                    height: key.size_px[1],
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: key.samples,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        // Samples of depth cannot be copied; one sample can.
        let depth_usage =
            if key.samples == 1 { attachment | wgpu::TextureUsages::COPY_SRC } else { attachment };
        let depth = texture("depth", DEPTH_FORMAT, depth_usage);
        Self {
            key,
            depth_view: depth.create_view(&Default::default()),
            depth,
            samples: (key.samples > 1)
                .then(|| texture("samples", key.format, attachment).create_view(&Default::default())),
        }
    }
}
