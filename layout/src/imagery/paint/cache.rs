//! The tiles that a painter has in memory. Painted ones stay until they are committed. Clean ones are kept up to a bound; those not used for longest are dropped first.

use super::super::Imagery;
use super::super::shape::TileId;
use super::tile::Tile;
use crate::error::LayoutError;
use crate::read::terrain::Terrain;
use std::collections::HashMap;
use std::sync::Arc;

/// Bytes of clean tiles that stay.
const CLEAN_BYTES: usize = 16 << 20;

/// Tiles in memory.
#[derive(Debug, Default)]
pub(super) struct Cache {
    tiles: HashMap<TileId, Tile>,
    /// Rises with every batch.
    now: u64,
}

/// What the file holds.
#[derive(Debug, Clone)]
pub(super) struct Files {
    pub(super) terrain: Arc<Terrain>,
    /// The imagery the terrain has now.
    pub(super) current: Imagery,
    /// The imagery before all paint.
    pub(super) original: Imagery,
}

impl Files {
    /// A tile as it is stored; `None` if it is absent.
    fn read(&self, imagery: &Imagery, id: TileId) -> Result<Option<Vec<u8>>, LayoutError> {
        let mut bytes = Vec::new();
        Ok(imagery.read_stored(&self.terrain, id, &mut bytes)?.map(|_| bytes))
    }

    /// A tile as it was before all paint.
    pub(super) fn original(&self, id: TileId) -> Result<Option<Vec<u8>>, LayoutError> {
        self.read(&self.original, id)
    }

    fn load(&self, id: TileId) -> Result<Tile, LayoutError> {
        let mut tile = Tile::new(&self.current.shape(), id, self.read(&self.current, id)?);
        if !self.current.has_same_tile(&self.original, id) {
            tile.compare(self.original(id)?.as_deref());
        }
        Ok(tile)
    }
}

impl Cache {
    /// Begins a batch: tiles used from now on are used later than all before.
    pub(super) fn begin(&mut self) -> u64 {
        self.now += 1;
        self.now
    }

    /// Has a tile in memory.
    pub(super) fn need(&mut self, files: &Files, id: TileId) -> Result<(), LayoutError> {
        let now = self.now;
        match self.tiles.get_mut(&id) {
            Some(tile) => tile.last_used = now,
            None => {
                let mut tile = files.load(id)?;
                tile.last_used = now;
                self.tiles.insert(id, tile);
            }
        }
        Ok(())
    }

    pub(super) fn get(&self, id: TileId) -> Option<&Tile> {
        self.tiles.get(&id)
    }

    pub(super) fn get_mut(&mut self, id: TileId) -> Option<&mut Tile> {
        self.tiles.get_mut(&id)
    }

    pub(super) fn holds(&self, id: TileId) -> bool {
        self.tiles.contains_key(&id)
    }

    /// Tiles of which something holds, in the order of their names.
    pub(super) fn those(&self, holds: impl Fn(&Tile) -> bool) -> Vec<TileId> {
        let mut ids: Vec<TileId> =
            self.tiles.iter().filter(|(_, tile)| holds(tile)).map(|(id, _)| *id).collect();
        ids.sort_unstable();
        ids
    }

    /// Puts a tile in place of the one it has.
    pub(super) fn put(&mut self, id: TileId, tile: Tile) {
        self.tiles.insert(id, tile);
    }

    /// All that was to be written is the file's from now on.
    pub(super) fn mark_written(&mut self) {
        self.tiles.values_mut().for_each(|tile| tile.is_unwritten = false);
        self.trim();
    }

    /// Forgets tiles.
    pub(super) fn forget(&mut self, ids: &[TileId]) {
        ids.iter().for_each(|id| {
            self.tiles.remove(id);
        });
    }

    /// Lets clean tiles go that are too many.
    pub(super) fn trim(&mut self) {
        let bytes = |tile: &Tile| tile.bytes().map_or(0, |bytes| bytes.len()) + 64;
        let clean = || self.tiles.iter().filter(|(_, tile)| !tile.is_painted && !tile.is_unwritten);
        let mut left: usize = clean().map(|(_, tile)| bytes(tile)).sum();
        if left <= CLEAN_BYTES {
            return;
        }
        let mut oldest: Vec<(u64, TileId, usize)> =
            clean().map(|(id, tile)| (tile.last_used, *id, bytes(tile))).collect();
        oldest.sort_unstable();
        for (_, id, bytes) in oldest {
            if left <= CLEAN_BYTES * 3 / 4 {
                break;
            }
            self.tiles.remove(&id);
            left -= bytes;
        }
    }
}
