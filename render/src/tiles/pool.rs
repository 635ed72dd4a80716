//! Layers of an array texture, and the table that says what is in them.
//!
//! It knows how many bytes a block of texels has, and not what they mean. An upload is one texture write and a few texels of the
//! table; nothing else moves.

use super::{Pyramid, Residency, TileTable};
use crate::error::{RenderError, Result};
use terrasoar_layout::imagery::TileId;

/// How a content kind is laid out in a layer.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TileLayout {
    pub format: wgpu::TextureFormat,
    /// Texels a side of a layer.
    pub texels: u32,
}

impl TileLayout {
    /// Bytes of one layer: whole blocks.
    pub(crate) fn layer_bytes(&self) -> u64 {
        u64::from(self.row_bytes()) * u64::from(self.texels.div_ceil(self.format.block_dimensions().1))
    }

    fn row_bytes(&self) -> u32 {
        self.texels.div_ceil(self.format.block_dimensions().0)
            * self.format.block_copy_size(None).unwrap_or(0)
    }
}

/// What the tiles did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct TileStats {
    /// Tiles on the device.
    pub resident: u32,
    /// Tiles there is room for.
    pub capacity: u32,
    /// Tiles the last view wanted and lacks.
    pub missing: u32,
    /// Tiles uploaded since the renderer was made.
    pub uploads: u64,
    /// Their bytes.
    pub uploaded_bytes: u64,
    /// Tiles that made room for others.
    pub evictions: u64,
    /// Tiles that came when they were no longer wanted and found no room.
    pub dropped: u64,
}

/// A slot of the table.
const TABLE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// Tiles on the device.
#[derive(Debug)]
pub(crate) struct TilePool {
    pub pyramid: Pyramid,
    pub residency: Residency,
    pub view: wgpu::TextureView,
    pub table_view: wgpu::TextureView,
    table: TileTable,
    table_texture: wgpu::Texture,
    texture: wgpu::Texture,
    layout: TileLayout,
    stats: TileStats,
}

impl TilePool {
    pub(crate) fn new(
        device: &wgpu::Device,
        pyramid: Pyramid,
        layout: TileLayout,
        budget_bytes: u64,
    ) -> Self {
        let limits = device.limits();
        let most = u64::from(limits.max_texture_array_layers.saturating_sub(1)).min(pyramid.len() as u64);
        let capacity = (budget_bytes / layout.layer_bytes().max(1)).clamp(1, most) as u32;
        // OpenGL takes one layer for no array, and a multiple of six for cubes.
        let layers = if capacity == 1 || capacity.is_multiple_of(6) { capacity + 1 } else { capacity };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("tiles"),
            size: wgpu::Extent3d {
                width: layout.texels,
                height: layout.texels,
                depth_or_array_layers: layers,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: layout.format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        let table = TileTable::new(capacity);
        let [width, height] = table.size();
        let table_texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("table of tiles"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: TABLE_FORMAT,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        Self {
            residency: Residency::new(&pyramid, capacity),
            pyramid,
            view,
            table_view: table_texture.create_view(&Default::default()),
            table,
            table_texture,
            texture,
            layout,
            stats: TileStats::default(),
        }
    }

    /// Puts a tile on the device. Returns the bytes sent: none where no layer was free for it.
    pub(crate) fn upload(&mut self, queue: &wgpu::Queue, tile: TileId, bytes: &[u8]) -> Result<u64> {
        if !self.pyramid.contains(tile) {
            return Err(RenderError::NoSuchTile { tile: tile.to_string() });
        }
        let expected = self.layout.layer_bytes() as usize;
        if bytes.len() != expected {
            return Err(RenderError::TileSize { tile: tile.to_string(), expected, got: bytes.len() });
        }
        let Some(place) = self.residency.insert(tile) else {
            self.stats.dropped += 1;
            return Ok(0);
        };
        queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &self.texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: place.layer },
                aspect: wgpu::TextureAspect::All,
            },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(self.layout.row_bytes()),
                rows_per_image: None,
            },
            wgpu::Extent3d {
                width: self.layout.texels,
                height: self.layout.texels,
                depth_or_array_layers: 1,
            },
        );
        let mut sent = bytes.len() as u64;
        if let Some(gone) = place.evicted {
            self.stats.evictions += 1;
            sent += self.take_out(queue, gone);
        }
        let slot = self.table.insert(tile, place.layer);
        sent += self.send_slot(queue, slot);
        self.stats.uploads += 1;
        self.stats.uploaded_bytes += sent;
        Ok(sent)
    }

    /// Forgets a tile whose content changed.
    pub(crate) fn forget(&mut self, queue: &wgpu::Queue, tile: TileId) {
        if self.pyramid.contains(tile) && self.residency.forget(tile) {
            self.take_out(queue, tile);
        }
    }

    fn take_out(&mut self, queue: &wgpu::Queue, tile: TileId) -> u64 {
        self.table.remove(tile).into_iter().map(|slot| self.send_slot(queue, slot)).sum()
    }

    fn send_slot(&self, queue: &wgpu::Queue, slot: u32) -> u64 {
        let ([x, y], entry) = self.table.texel(slot);
        queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &self.table_texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x, y, z: 0 },
                aspect: wgpu::TextureAspect::All,
            },
            bytemuck::bytes_of(&entry),
            wgpu::TexelCopyBufferLayout::default(),
            wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        );
        size_of_val(&entry) as u64
    }

    pub(crate) fn stats(&self) -> TileStats {
        TileStats {
            resident: self.residency.resident(),
            capacity: self.residency.capacity(),
            missing: self.residency.missing().len() as u32,
            ..self.stats
        }
    }

    /// Bytes of device memory held.
    pub(crate) fn device_bytes(&self) -> u64 {
        self.layout.layer_bytes() * u64::from(self.texture.depth_or_array_layers()) + self.table.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Layers of whole blocks, for pixels one by one and for blocks of four by four.
    #[test]
    fn layers_hold_whole_blocks() {
        let layout = |format, texels| TileLayout { format, texels };
        assert_eq!(layout(wgpu::TextureFormat::Rg16Float, 129).layer_bytes(), 129 * 129 * 4);
        assert_eq!(layout(wgpu::TextureFormat::Rgba8UnormSrgb, 132).layer_bytes(), 132 * 132 * 4);
        assert_eq!(layout(wgpu::TextureFormat::Bc1RgbaUnormSrgb, 132).layer_bytes(), 33 * 33 * 8);
    }
}
