//! Content for colour: a photograph, draped.
//!
//! Unlike slopes, which lie on the grid's points, texels are areas and the image has a place and a texel size of its own. Tiles carry a
//! border, so that a filter as wide as [`BORDER_TEXELS`](terrasoar_layout::imagery::BORDER_TEXELS) needs one tile alone and there is no seam.
//!
//! Filtered colours fade into the ground below without a fringe if they are multiplied by alpha, in linear light. Transparent texels
//! of BC1 are black, so these are multiplied already. RGBA8 is multiplied on its way to the device; opaque tiles are only checked.
//! BC7 can only be multiplied after it has been filtered.

use std::borrow::Cow;
use std::collections::HashSet;

use super::{Pyramid, Raster, TileLayout, TilePool, WantedTiles};
use crate::error::{RenderError, Result};
use crate::gpu::Capabilities;
use crate::ramps::{encode, linear_of};
use crate::view::TerrainShape;
use terrasoar::view::View;
use terrasoar_layout::imagery::{ImageryShape, TILE_TEXELS, TileFormat, TileId};

/// Longest side of an image in texels.
const MOST_TEXELS: u32 = 1 << 29;

/// How a device holds tiles of a format: sRGB, and alpha that the texels given are not multiplied by.
fn layout_of(format: TileFormat) -> TileLayout {
    let format = match format {
        TileFormat::Bc1 => wgpu::TextureFormat::Bc1RgbaUnormSrgb,
        TileFormat::Bc7 => wgpu::TextureFormat::Bc7RgbaUnormSrgb,
        TileFormat::Rgba8 => wgpu::TextureFormat::Rgba8UnormSrgb,
    };
    TileLayout { format, texels: TILE_TEXELS }
}

fn check(shape: &ImageryShape) -> Result<()> {
    let sound = shape.texels.iter().all(|n| (1..=MOST_TEXELS).contains(n))
        && shape.levels > 0
        && shape.texel_m.iter().all(|m| m.is_finite() && *m > 0.0)
        && shape.origin_m.iter().all(|m| m.is_finite());
    if sound {
        Ok(())
    } else {
        Err(RenderError::Usage(
            "an image needs 1 to 2^29 texels each way, a level, a finite place and texels of some size",
        ))
    }
}

impl Capabilities {
    /// Formats that [`crate::Renderer::set_imagery`] takes on this device, the smallest first. Where blocks are not among them the caller
    /// decodes them.
    pub fn imagery_formats(&self) -> &'static [TileFormat] {
        if self.texture_compression_bc {
            &[TileFormat::Bc1, TileFormat::Bc7, TileFormat::Rgba8]
        } else {
            &[TileFormat::Rgba8]
        }
    }
}

/// What the imagery did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ImageryStats {
    /// Tiles on the device.
    pub resident: u32,
    /// Tiles there is room for.
    pub capacity: u32,
    /// Device memory of the pool, bytes.
    pub pool_bytes: u64,
    /// Tiles known not to exist.
    pub absent: u32,
    /// Tiles the last view wants.
    pub wanted: u32,
    /// Tiles the last view wants, has room for and lacks, or has as they were before a change.
    pub missing: u32,
    /// Tiles uploaded since the image was set.
    pub uploads: u64,
    /// Their bytes.
    pub uploaded_bytes: u64,
    /// Tiles that made room for others.
    pub evicted: u64,
    /// Tiles that came when they were no longer wanted and found no room.
    pub dropped: u64,
    /// Share of the last view's wanted tiles that are here, as of now: where one is, the ground shows its ideal level. 1 is the optimum.
    pub ideal_share: f32,
    /// By how many levels what is shown may be too coarse, at most. 0 is the optimum; where nothing is shown, as many as there are above.
    pub most_levels_off: u32,
}

/// An image on the device.
#[derive(Debug)]
pub(crate) struct Imagery {
    pub shape: ImageryShape,
    /// How the device holds its tiles, whatever the shape's own format.
    pub format: TileFormat,
    pub pool: TilePool,
    raster: Raster,
    wanted: WantedTiles,
    wanted_ahead: WantedTiles,
    absent: HashSet<TileId>,
}

impl Imagery {
    pub(crate) fn new(
        device: &wgpu::Device,
        terrain: &TerrainShape,
        shape: &ImageryShape,
        format: TileFormat,
        pool_bytes: u64,
    ) -> Result<Self> {
        check(shape)?;
        let takes_blocks = device.features().contains(wgpu::Features::TEXTURE_COMPRESSION_BC);
        if format != TileFormat::Rgba8 && !takes_blocks {
            return Err(RenderError::Usage(
                "this device takes no BC textures; decode the image's tiles to RGBA8 (Capabilities::imagery_formats)",
            ));
        }
        let pyramid = Pyramid::of_image(shape);
        let [east, north] = pyramid.across(pyramid.levels() - 1).map(u64::from);
        let pool = TilePool::new(device, pyramid, layout_of(format), pool_bytes);
        if east * north > pool.residency.capacity().into() {
            return Err(RenderError::Usage(
                "the image's coarsest level alone does not fit the pool; give it more levels, or more memory",
            ));
        }
        Ok(Self {
            shape: *shape,
            format,
            pool,
            raster: Raster {
                origin_m: shape.origin_m,
                cell_m: shape.texel_m,
                cells: shape.texels,
                height_range_m: terrain.height_range_m,
                flattest: 1.0,
            },
            wanted: WantedTiles::default(),
            wanted_ahead: WantedTiles::default(),
            absent: HashSet::new(),
        })
    }

    /// Whether the device gets colours that are not multiplied by alpha.
    pub(crate) fn is_straight(&self) -> bool {
        self.format == TileFormat::Bc7
    }

    pub(crate) fn want(&mut self, view: &View) -> &[TileId] {
        let absent = &self.absent;
        let wanted =
            self.wanted.find_on(&self.pool.pyramid, &self.raster, view, |tile| !absent.contains(&tile));
        self.pool.residency.want(wanted);
        self.pool.residency.missing()
    }

    pub(crate) fn want_ahead(&mut self, view: &View) -> &[TileId] {
        let absent = &self.absent;
        let wanted =
            self.wanted_ahead.find_on(&self.pool.pyramid, &self.raster, view, |tile| !absent.contains(&tile));
        self.pool.residency.want_ahead(wanted);
        self.pool.residency.missing_ahead()
    }

    pub(crate) fn give(&mut self, queue: &wgpu::Queue, tile: TileId, bytes: &[u8]) -> Result<u64> {
        match self.format {
            TileFormat::Rgba8 => self.pool.upload(queue, tile, &multiplied(bytes)),
            TileFormat::Bc1 | TileFormat::Bc7 => self.pool.upload(queue, tile, bytes),
        }
    }

    pub(crate) fn set_absent(&mut self, queue: &wgpu::Queue, tile: TileId) -> Result<()> {
        if !self.pool.pyramid.contains(tile) {
            return Err(RenderError::NoSuchTile { tile: tile.to_string() });
        }
        self.absent.insert(tile);
        self.pool.forget(queue, tile);
        self.pool.residency.withdraw(tile);
        Ok(())
    }

    pub(crate) fn forget(&mut self, queue: &wgpu::Queue, tile: TileId) {
        self.absent.remove(&tile);
        self.pool.forget(queue, tile);
    }

    /// Notes that texels of a tile changed, or that it exists by now.
    pub(crate) fn outdate(&mut self, tile: TileId) {
        self.absent.remove(&tile);
        self.pool.residency.outdate(tile);
    }

    pub(crate) fn stats(&self) -> ImageryStats {
        let stats = self.pool.stats();
        let here = |tile: TileId| self.pool.residency.layer(tile).is_some();
        let levels = self.pool.pyramid.levels();
        let [mut wanted, mut ideal, mut most_levels_off] = [0_u32; 3];
        for tile in self.wanted.last().iter().filter(|t| !self.absent.contains(t)) {
            wanted += 1;
            let shown = std::iter::successors(Some(*tile), |t| Some(t.parent()))
                .take_while(|t| t.level < levels)
                .find(|t| here(*t));
            let off = shown.map_or(levels, |t| t.level) - tile.level;
            ideal += u32::from(off == 0);
            most_levels_off = most_levels_off.max(off);
        }
        ImageryStats {
            resident: stats.resident,
            capacity: stats.capacity,
            pool_bytes: self.pool.device_bytes(),
            absent: self.absent.len() as u32,
            wanted,
            missing: stats.missing,
            uploads: stats.uploads,
            uploaded_bytes: stats.uploaded_bytes,
            evicted: stats.evictions,
            dropped: stats.dropped,
            ideal_share: if wanted == 0 { 1.0 } else { ideal as f32 / wanted as f32 },
            most_levels_off,
        }
    }
}

/// Colours multiplied by alpha, in linear light.
fn multiplied(rgba: &[u8]) -> Cow<'_, [u8]> {
    let (texels, _) = rgba.as_chunks::<4>();
    if texels.iter().all(|t| t[3] == 255) {
        return rgba.into();
    }
    // Each pair of colour and alpha is worked out once a tile.
    let mut known = vec![None; 1 << 16];
    let mut times = |code: u8, alpha: u8| {
        *known[usize::from(code) << 8 | usize::from(alpha)].get_or_insert_with(|| {
            let [linear, ..] = linear_of(u32::from(code) << 16);
            (255.0 * encode(linear * f32::from(alpha) / 255.0)).round() as u8
        })
    };
    let multiplied = texels.iter().map(|&[r, g, b, a]| match a {
        255 => [r, g, b, a],
        0 => [0; 4],
        _ => [times(r, a), times(g, a), times(b, a), a],
    });
    multiplied.flatten().collect::<Vec<u8>>().into()
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use glam::DVec3;

    use super::*;
    use crate::tiles::Residency;

    const SHAPE: ImageryShape = ImageryShape {
        format: TileFormat::Bc1,
        texels: [16_384, 16_384],
        levels: 7,
        origin_m: [0.0; 2],
        texel_m: [1.0; 2],
    };

    #[test]
    fn colours_are_multiplied_in_linear_light() {
        let opaque = [9, 200, 77, 255];
        assert!(matches!(multiplied(&opaque), Cow::Borrowed(_)));
        // Half of the light of white is 188.
        let texels = [255, 255, 0, 128, 90, 80, 70, 0, 1, 2, 3, 255];
        assert_eq!(*multiplied(&texels), [188, 188, 0, 128, 0, 0, 0, 0, 1, 2, 3, 255]);
    }

    #[test]
    fn tiles_have_the_bytes_of_their_format() {
        for format in [TileFormat::Bc1, TileFormat::Bc7, TileFormat::Rgba8] {
            assert_eq!(layout_of(format).layer_bytes(), format.tile_bytes() as u64);
        }
    }

    /// The pool of 64 MiB over an image of 16,384 x 16,384 texels, in a flight at 90 m/s with a turn, eight tiles a frame at 60 frames a second.
    #[test]
    fn a_flight_has_its_ideal_levels() {
        let raster = Raster {
            origin_m: SHAPE.origin_m,
            cell_m: SHAPE.texel_m,
            cells: SHAPE.texels,
            height_range_m: [0.0, 900.0],
            flattest: 1.0,
        };
        let pyramid = Pyramid::of_image(&SHAPE);
        let mut pool = Residency::new(&pyramid, 512);
        let mut wanted = WantedTiles::default();
        let (mut most_wanted, mut uploads, mut lacking, mut times_us) = (0, 0, 0, Vec::new());
        let frames = 3600;
        for frame in 0..frames {
            let time_s = f64::from(frame) / 60.0;
            let course = 0.02 * time_s;
            let eye = DVec3::new(3000.0 + 90.0 * time_s, 8000.0 + 900.0 * course.sin(), 1300.0);
            let ahead = DVec3::new(course.cos(), course.sin(), -0.35);
            let view = View::look_at(eye, eye + ahead, [1920, 1080].into());
            let start = Instant::now();
            pool.want(wanted.find_on(&pyramid, &raster, &view, |_| true));
            times_us.push(start.elapsed().as_secs_f64() * 1e6);
            most_wanted = most_wanted.max(wanted.last().len());
            for tile in pool.missing().iter().take(8).copied().collect::<Vec<_>>() {
                assert!(pool.insert(tile).is_some(), "{tile} finds no room in frame {frame}");
                uploads += 1;
            }
            lacking += u32::from(frame > 60 && !pool.missing().is_empty());
        }
        times_us.sort_by(f64::total_cmp);
        println!(
            "at most {most_wanted} tiles wanted, {uploads} uploads in {frames} frames, {lacking} of these lack a tile \
             after the first second; {:.1} us a frame to find them, {:.1} in one of a hundred",
            times_us[frames as usize / 2],
            times_us[frames as usize * 99 / 100]
        );
        assert!(most_wanted <= 512, "{most_wanted} tiles wanted");
        assert_eq!(lacking, 0);
        assert!(uploads < 1200, "{uploads} uploads");
    }
}
