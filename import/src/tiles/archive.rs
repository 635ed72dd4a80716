//! What a pyramid is read from: a folder, MBTiles or PMTiles, behind one trait.
//!
//! Tiles are looked up one by one, and never listed in memory: a survey counts them and keeps a few for a first look. Rows are counted from the north here, whatever the file does.

use super::about::About;
use super::grid::{Span, Tile};
use std::collections::BTreeMap;
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// Tiles of a zoom that are kept for a first look.
const SAMPLES: usize = 16;

/// What there is of one zoom within an area.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    pub(super) count: u64,
    /// From the first to the last column and row that has a tile.
    pub(super) span: Span,
    /// Some tiles, spread: those of the least [`spread`].
    pub(super) samples: Vec<Tile>,
}

impl Level {
    /// Of one tile.
    pub(super) fn of(tile: Tile) -> Self {
        Self { count: 1, span: Span::of(tile), samples: vec![tile] }
    }

    /// Counts one more.
    pub(super) fn add(&mut self, tile: Tile) {
        self.count += 1;
        self.span = self.span.around(Span::of(tile));
        self.look_at(tile);
    }

    /// Keeps a tile for a first look, if it is among the first in [`spread`].
    pub(super) fn look_at(&mut self, tile: Tile) {
        let at = self.samples.partition_point(|kept| spread(*kept) <= spread(tile));
        if at < SAMPLES {
            self.samples.insert(at, tile);
            self.samples.truncate(SAMPLES);
        }
    }
}

/// Zooms that have tiles.
pub(super) type Levels = BTreeMap<u8, Level>;

/// Counts a tile in its zoom.
pub(super) fn count(levels: &mut Levels, tile: Tile) {
    levels.entry(tile.zoom).and_modify(|level| level.add(tile)).or_insert_with(|| Level::of(tile));
}

/// A number that has nothing to do with where a tile lies, so that the tiles of the least ones lie anywhere: the same on every machine, in whatever order they come.
fn spread(tile: Tile) -> (u64, Tile) {
    let mixed = (u64::from(tile.x) << 32 | u64::from(tile.y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9), tile)
}

/// A set of tiles.
pub(super) trait Archive: Send + Sync {
    fn path(&self) -> &Path;

    /// What it is, in words: "folder of tiles", "MBTiles".
    fn kind(&self) -> &'static str;

    fn about(&self) -> &About;

    /// What to say where it is in doubt from where rows are counted.
    fn rows_in_doubt(&self) -> Option<&'static str> {
        None
    }

    /// Memory that looking tiles up takes.
    fn memory_bytes(&self) -> u64;

    /// Counts the tiles of each zoom; `within` gives the columns and rows of a zoom that count.
    ///
    /// # Errors
    /// I/O; damage.
    fn survey(&self, within: &dyn Fn(u8) -> Option<Span>) -> Result<Levels, LayoutError>;

    /// Calls `each` with rectangles of tiles of a zoom, full of tiles, that make up all there are in `within`.
    ///
    /// # Errors
    /// I/O; damage.
    fn each_span(&self, zoom: u8, within: Span, each: &mut dyn FnMut(Span)) -> Result<(), LayoutError>;

    /// Whether a tile is there.
    ///
    /// # Errors
    /// I/O; damage.
    fn has(&self, tile: Tile) -> Result<bool, LayoutError>;

    /// Reads a tile, of `most` bytes at most, in place of what is in `into`; `false` where it is not there.
    ///
    /// # Errors
    /// I/O; damage; a tile that is longer.
    fn fetch(&self, tile: Tile, most: u64, into: &mut Vec<u8>) -> Result<bool, LayoutError>;

    /// A tile's name in messages.
    fn label(&self, tile: Tile) -> String {
        format!("tile {tile}")
    }

    /// A tile that is longer than it can be.
    fn too_long(&self, tile: Tile, bytes: u64, most: u64) -> LayoutError {
        LayoutError::damaged(
            self.path(),
            self.label(tile),
            format!("it has {bytes} bytes, and a tile of its size takes {most} at most; fetch it again"),
        )
    }
}
