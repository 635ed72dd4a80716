//! The image on the terrain: the calls that set it, that tell which tiles are needed, and that give them.

use super::Renderer;
use crate::error::{RenderError, Result};
use crate::tiles::{Imagery, ImageryStats};
use terrasoar::view::View;
use terrasoar_layout::imagery::{ImageryShape, TileFormat, TileId};

impl Renderer {
    /// Device memory for image tiles where nothing else is wanted, in bytes: 512 tiles of BC1, 256 of BC7, 64 of RGBA8. Devices hold at most as many
    /// tiles as they have layers in a texture, 256 at least.
    pub const IMAGERY_BYTES: u64 = 64 << 20;

    /// Drapes an image over the terrain, in place of one before. Its tiles are given in `format`, one of [`crate::Capabilities::imagery_formats`]
    /// (the shape's own says how they are in the file), and held within `pool_bytes` ([`Renderer::IMAGERY_BYTES`] will do for
    /// most), none at first. Levels past the first that is one tile are not asked for. The image shows where a look says so ([`crate::Look::imagery`]).
    ///
    /// # Errors
    ///
    /// [`RenderError::Usage`] for a shape that is none, a format the device does not take, and a pool that does not hold the coarsest
    /// level. The image before is then gone too.
    pub fn set_imagery(&mut self, shape: &ImageryShape, format: TileFormat, pool_bytes: u64) -> Result<()> {
        self.clear_imagery();
        self.imagery = Some(Imagery::new(&self.device, &self.terrain, shape, format, pool_bytes)?);
        Ok(())
    }

    /// Takes the image off the terrain again, and its tiles off the device.
    pub fn clear_imagery(&mut self) {
        self.bind_group = None;
        self.imagery = None;
    }

    /// The image on the terrain.
    pub fn imagery(&self) -> Option<&ImageryShape> {
        self.imagery.as_ref().map(|i| &i.shape)
    }

    /// The format that its tiles are given in.
    pub fn imagery_format(&self) -> Option<TileFormat> {
        self.imagery.as_ref().map(|i| i.format)
    }

    /// Finds out which image tiles a view wants and returns those that are not on the device, most urgent first, at most `most`: those
    /// whose texels are about a pixel on ground anywhere in the terrain's range of heights, and all coarser ones above them,
    /// coarse before fine and near before far. To be called once a frame; what it returns is to be answered with
    /// [`Renderer::give_imagery`] or [`Renderer::set_imagery_absent`], now or some frames later; until then it is asked for again.
    pub fn want_imagery(&mut self, view: &View, most: usize) -> &[TileId] {
        let missing = self.imagery.as_mut().map_or(&[][..], |i| i.want(view));
        &missing[..missing.len().min(most)]
    }

    /// Tiles that a view some time ahead will want beside those of [`Renderer::want_imagery`], which is to be called before. They take no
    /// room that the current view needs, so a small pool may leave none for them.
    pub fn want_imagery_ahead(&mut self, predicted: &View, most: usize) -> &[TileId] {
        let missing = self.imagery.as_mut().map_or(&[][..], |i| i.want_ahead(predicted));
        &missing[..missing.len().min(most)]
    }

    /// Gives an image tile: rows from south to north, 512 x 512 texels with their border, in the format that was set. Returns the
    /// bytes sent; none where all room is taken by tiles that are wanted more.
    ///
    /// # Errors
    ///
    /// [`RenderError::TileSize`], [`RenderError::NoSuchTile`]; [`RenderError::Usage`] without an image.
    pub fn give_imagery(&mut self, tile: TileId, bytes: &[u8]) -> Result<u64> {
        self.imagery.as_mut().ok_or(NO_IMAGE)?.give(&self.queue, tile, bytes)
    }

    /// Says that a tile does not exist, because the image has nothing there: neither it nor any below it is asked for again.
    ///
    /// # Errors
    ///
    /// [`RenderError::NoSuchTile`]; [`RenderError::Usage`] without an image.
    pub fn set_imagery_absent(&mut self, tile: TileId) -> Result<()> {
        self.imagery.as_mut().ok_or(NO_IMAGE)?.set_absent(&self.queue, tile)
    }

    /// Notes that texels of these tiles changed, or that tiles said to be absent exist by now: whenever a view wants them they are asked for anew, coarse before
    /// fine as ever, and what is on the device shows until the new ones come.
    pub fn change_imagery(&mut self, tiles: &[TileId]) {
        if let Some(imagery) = &mut self.imagery {
            tiles.iter().for_each(|tile| imagery.outdate(*tile));
        }
    }

    /// Forgets a tile whose texels changed, or one that exists by now; it will be wanted again.
    pub fn forget_imagery(&mut self, tile: TileId) {
        if let Some(imagery) = &mut self.imagery {
            imagery.forget(&self.queue, tile);
        }
    }

    /// What the imagery did, and how near to its ideal the last view is. All zero without an image.
    pub fn imagery_stats(&self) -> ImageryStats {
        self.imagery.as_ref().map_or_else(ImageryStats::default, Imagery::stats)
    }
}

const NO_IMAGE: RenderError = RenderError::Usage("no image is set; call set_imagery before giving its tiles");
