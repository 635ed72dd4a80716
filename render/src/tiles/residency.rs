//! Which tiles are in which layers, and which must go when another comes.
//!
//! Least recently wanted goes first. A tile wanted by the current view is never put out, nor is the root ever; so what comes in one frame
//! stays for as long as it is wanted, and a budget too small for the view leaves its fine tiles out instead of
//! exchanging them without end. Cost: a hash lookup a wanted tile; an insertion into a full pool looks at all layers.

use std::collections::HashMap;

use super::{Pyramid, TileId};

#[derive(Debug, Clone, Copy)]
struct Held {
    tile: TileId,
    last_wanted: u64,
}

/// Assignment of tiles to layers of a pool.
#[derive(Debug, Clone)]
pub struct Residency {
    root: TileId,
    capacity: u32,
    layers: Vec<Option<Held>>,
    free: Vec<u32>,
    layer_of: HashMap<TileId, u32>,
    frame: u64,
    missing: Vec<TileId>,
}

/// Where a new tile goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placement {
    /// Layer to fill.
    pub layer: u32,
    /// Tile that was there.
    pub evicted: Option<TileId>,
}

impl Residency {
    /// An empty pool of `capacity` layers, at least 1.
    pub fn new(pyramid: &Pyramid, capacity: u32) -> Self {
        Self {
            root: pyramid.root(),
            capacity: capacity.max(1),
            layers: Vec::new(),
            free: Vec::new(),
            layer_of: HashMap::new(),
            frame: 0,
            missing: Vec::new(),
        }
    }

    /// Begins a frame that wants these tiles, most urgent first. Those beyond the capacity are not considered.
    pub fn want(&mut self, wanted: &[TileId]) {
        self.frame += 1;
        self.missing.clear();
        for tile in wanted.iter().take(self.capacity as usize) {
            match self.layer_of.get(tile) {
                Some(layer) => {
                    if let Some(held) = &mut self.layers[*layer as usize] {
                        held.last_wanted = self.frame;
                    }
                }
                None => self.missing.push(*tile),
            }
        }
    }

    /// Wanted tiles that are not here, most urgent first.
    pub fn missing(&self) -> &[TileId] {
        &self.missing
    }

    /// The layer of a tile.
    pub fn layer(&self, tile: TileId) -> Option<u32> {
        self.layer_of.get(&tile).copied()
    }

    /// Tiles here now.
    pub fn resident(&self) -> u32 {
        self.layer_of.len() as u32
    }

    /// Layers there are.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Finds a layer for a tile that arrived; its old one if it has one. None where all layers hold tiles the current
    /// view wants: then the tile must be dropped.
    pub fn insert(&mut self, tile: TileId) -> Option<Placement> {
        self.missing.retain(|t| *t != tile);
        let held = Held { tile, last_wanted: self.frame };
        if let Some(&layer) = self.layer_of.get(&tile) {
            return Some(Placement { layer, evicted: None });
        }
        let fresh = (self.layers.len() < self.capacity as usize).then_some(self.layers.len() as u32);
        let (layer, evicted) = match self.free.pop().or(fresh) {
            Some(layer) => (layer, None),
            None => self.oldest(tile == self.root).map(|(layer, tile)| (layer, Some(tile)))?,
        };
        if let Some(gone) = evicted {
            self.layer_of.remove(&gone);
        }
        self.layer_of.insert(tile, layer);
        match self.layers.get_mut(layer as usize) {
            Some(place) => *place = Some(held),
            None => self.layers.push(Some(held)),
        }
        Some(Placement { layer, evicted })
    }

    /// The tile that may go. The root may take the place of a wanted one, for without it there are holes.
    fn oldest(&self, for_root: bool) -> Option<(u32, TileId)> {
        let may_go = |h: &Held| h.tile != self.root && (h.last_wanted < self.frame || for_root);
        (0..)
            .zip(&self.layers)
            .filter_map(|(layer, held)| held.map(|h| (layer, h)))
            .filter(|(_, h)| may_go(h))
            .min_by_key(|(_, h)| (h.last_wanted, h.tile.level))
            .map(|(layer, h)| (layer, h.tile))
    }

    /// Forgets a tile whose content changed, so that it is wanted anew. Whether it was here.
    pub fn forget(&mut self, tile: TileId) -> bool {
        let layer = self.layer_of.remove(&tile);
        if let Some(layer) = layer {
            self.layers[layer as usize] = None;
            self.free.push(layer);
        }
        layer.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(level: u32, x: u32) -> TileId {
        TileId { level, x, y: 0 }
    }

    fn pool(capacity: u32) -> Residency {
        Residency::new(&Pyramid::over([128 * 64 + 1, 128 * 64 + 1]), capacity)
    }

    #[test]
    fn budget_is_kept_and_the_oldest_goes() {
        let mut pool = pool(3);
        let root = tile(6, 0);
        pool.want(&[root, tile(0, 1), tile(0, 2)]);
        for t in pool.missing().to_vec() {
            assert!(pool.insert(t).unwrap().evicted.is_none());
        }
        assert!(pool.missing().is_empty());
        pool.want(&[root, tile(0, 2), tile(0, 3)]);
        assert_eq!(pool.missing(), [tile(0, 3)]);
        assert_eq!(pool.insert(tile(0, 3)), Some(Placement { layer: 1, evicted: Some(tile(0, 1)) }));
        assert_eq!(pool.resident(), 3);
        assert_eq!(pool.layer(tile(0, 1)), None);
    }

    #[test]
    fn too_small_a_budget_does_not_thrash() {
        let mut pool = pool(4);
        let wanted: Vec<_> = std::iter::once(tile(6, 0)).chain((0..20).map(|x| tile(0, x))).collect();
        let mut uploads = 0;
        for _ in 0..50 {
            pool.want(&wanted);
            for t in pool.missing().to_vec() {
                uploads += u32::from(pool.insert(t).is_some());
            }
        }
        assert_eq!(uploads, 4, "each tile that fits comes once, the others are not asked for");
        assert_eq!(pool.insert(tile(0, 19)), None, "what nobody waits for puts out nothing");
    }

    #[test]
    fn forgotten_tiles_come_anew() {
        let mut pool = pool(2);
        pool.want(&[tile(6, 0), tile(0, 1)]);
        pool.insert(tile(6, 0));
        pool.insert(tile(0, 1));
        assert!(pool.forget(tile(0, 1)) && !pool.forget(tile(0, 1)));
        pool.want(&[tile(6, 0), tile(0, 1)]);
        assert_eq!(pool.missing(), [tile(0, 1)]);
        assert_eq!(pool.insert(tile(0, 1)), Some(Placement { layer: 1, evicted: None }));
        assert_eq!(pool.resident(), 2);
    }

    #[test]
    fn the_root_stays() {
        let mut pool = pool(2);
        pool.want(&[tile(6, 0)]);
        pool.insert(tile(6, 0));
        for x in 0..10 {
            pool.want(&[tile(0, x)]);
            pool.insert(tile(0, x));
            assert!(pool.layer(tile(6, 0)).is_some());
        }
    }
}
