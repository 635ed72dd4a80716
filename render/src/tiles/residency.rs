//! Which tiles are in which layers, and which must go when another comes.
//!
//! Least recently wanted goes first. A tile wanted by the current view is never put out, nor is the coarsest level ever; so what comes in one
//! frame stays for as long as it is wanted, and a budget too small for the view leaves its fine tiles out instead of exchanging
//! them without end. A coarser tile that is used in place of a missing one counts as wanted, so it stays too. Tiles that a view ahead will want come second: they take
//! the place of tiles that neither view wants, and only room that the current view leaves. Cost: a hash lookup
//! a wanted tile; an insertion into a full pool looks at all layers.

use std::collections::{HashMap, HashSet};

use super::Pyramid;
use terrasoar_layout::imagery::TileId;

#[derive(Debug, Clone, Copy)]
struct Held {
    tile: TileId,
    last_wanted: Moment,
}

/// When a tile was last wanted: twice the frame for a view ahead, one more for the view itself.
type Moment = u64;

/// Assignment of tiles to layers of a pool.
#[derive(Debug, Clone)]
pub(crate) struct Residency {
    coarsest: u32,
    capacity: u32,
    layers: Vec<Option<Held>>,
    free: Vec<u32>,
    layer_of: HashMap<TileId, u32>,
    now: Moment,
    /// Layers that the current view's tiles take up, or will.
    claimed: u32,
    missing: Vec<TileId>,
    missing_ahead: Vec<TileId>,
    /// Tiles here whose content has changed elsewhere.
    outdated: HashSet<TileId>,
}

/// Where a new tile goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Placement {
    /// Layer to fill.
    pub layer: u32,
    /// Tile that was there.
    pub evicted: Option<TileId>,
}

impl Residency {
    /// An empty pool of `capacity` layers, at least 1.
    pub fn new(pyramid: &Pyramid, capacity: u32) -> Self {
        Self {
            coarsest: pyramid.levels() - 1,
            capacity: capacity.max(1),
            layers: Vec::new(),
            free: Vec::new(),
            layer_of: HashMap::new(),
            now: 1,
            claimed: 0,
            missing: Vec::new(),
            missing_ahead: Vec::new(),
            outdated: HashSet::new(),
        }
    }

    /// Begins a frame that wants these tiles, most urgent first. Those beyond the capacity are not considered.
    pub fn want(&mut self, wanted: &[TileId]) {
        self.now += 2;
        self.missing.clear();
        self.missing_ahead.clear();
        self.claimed = wanted.len().min(self.capacity as usize) as u32;
        for tile in &wanted[..self.claimed as usize] {
            if !self.touch(*tile, self.now) || self.outdated.contains(tile) {
                self.missing.push(*tile);
            }
        }
    }

    /// Says what a view ahead will want, most urgent first, after [`Residency::want`]. Those beyond the room that the current view leaves are
    /// not considered.
    pub fn want_ahead(&mut self, wanted: &[TileId]) {
        self.missing_ahead.clear();
        let mut room = self.capacity - self.claimed;
        for tile in wanted {
            if self.layer(*tile).is_some_and(|l| self.moment(l) == self.now) || self.missing.contains(tile) {
                continue;
            }
            if room == 0 {
                break;
            }
            room -= 1;
            if !self.touch(*tile, self.now - 1) || self.outdated.contains(tile) {
                self.missing_ahead.push(*tile);
            }
        }
    }

    fn moment(&self, layer: u32) -> Moment {
        self.layers.get(layer as usize).copied().flatten().map_or(0, |held| held.last_wanted)
    }

    /// Notes that a tile was wanted. Whether it is here.
    fn touch(&mut self, tile: TileId, moment: Moment) -> bool {
        let Some(layer) = self.layer_of.get(&tile) else { return false };
        if let Some(Some(held)) = self.layers.get_mut(*layer as usize) {
            held.last_wanted = held.last_wanted.max(moment);
        }
        true
    }

    /// Wanted tiles that are not here, or outdated, most urgent first.
    pub fn missing(&self) -> &[TileId] {
        &self.missing
    }

    /// Tiles that a view ahead will want and that are not here, or outdated, most urgent first.
    pub fn missing_ahead(&self) -> &[TileId] {
        &self.missing_ahead
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

    /// Finds a layer for a tile that arrived; its old one if it has one. None where all layers hold tiles that are wanted more: then
    /// the tile must be dropped.
    pub fn insert(&mut self, tile: TileId) -> Option<Placement> {
        let urgent = self.missing.contains(&tile);
        self.withdraw(tile);
        self.outdated.remove(&tile);
        // What comes too late counts as wanted ahead: the view may turn back.
        let held = Held { tile, last_wanted: self.now - u64::from(!urgent) };
        if let Some(&layer) = self.layer_of.get(&tile) {
            return Some(Placement { layer, evicted: None });
        }
        let fresh = (self.layers.len() < self.capacity as usize).then_some(self.layers.len() as u32);
        let (layer, evicted) = match self.free.pop().or(fresh) {
            Some(layer) => (layer, None),
            None => self.oldest(held).map(|(layer, tile)| (layer, Some(tile)))?,
        };
        if let Some(gone) = evicted {
            self.layer_of.remove(&gone);
            self.outdated.remove(&gone);
        }
        self.layer_of.insert(tile, layer);
        match self.layers.get_mut(layer as usize) {
            Some(place) => *place = Some(held),
            None => self.layers.push(Some(held)),
        }
        Some(Placement { layer, evicted })
    }

    /// The tile that may go: one wanted less lately than the one that comes. The coarsest level may take the place of a wanted tile, for without it there are holes.
    fn oldest(&self, coming: Held) -> Option<(u32, TileId)> {
        let pinned = |tile: TileId| tile.level >= self.coarsest;
        let may_go =
            |h: &Held| !pinned(h.tile) && (h.last_wanted < coming.last_wanted || pinned(coming.tile));
        (0..)
            .zip(&self.layers)
            .filter_map(|(layer, held)| held.map(|h| (layer, h)))
            .filter(|(_, h)| may_go(h))
            .min_by_key(|(_, h)| (h.last_wanted, h.tile.level))
            .map(|(layer, h)| (layer, h.tile))
    }

    /// Waits no longer for a tile.
    pub fn withdraw(&mut self, tile: TileId) {
        self.missing.retain(|t| *t != tile);
        self.missing_ahead.retain(|t| *t != tile);
    }

    /// Notes that the content of a tile has changed: it is wanted anew whenever it is wanted, and stays until it comes.
    pub fn outdate(&mut self, tile: TileId) {
        if self.layer_of.contains_key(&tile) {
            self.outdated.insert(tile);
        }
    }

    /// Forgets a tile whose content changed, so that it is wanted anew. Whether it was here.
    pub fn forget(&mut self, tile: TileId) -> bool {
        let layer = self.layer_of.remove(&tile);
        self.outdated.remove(&tile);
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
    fn outdated_tiles_stay_until_they_come_anew() {
        let mut pool = pool(2);
        pool.want(&[tile(6, 0), tile(0, 1)]);
        pool.insert(tile(6, 0));
        pool.insert(tile(0, 1));
        pool.outdate(tile(0, 1));
        pool.outdate(tile(0, 7));
        pool.want(&[tile(6, 0), tile(0, 1)]);
        assert_eq!(pool.missing(), [tile(0, 1)]);
        assert_eq!(pool.layer(tile(0, 1)), Some(1));
        assert_eq!(pool.insert(tile(0, 1)), Some(Placement { layer: 1, evicted: None }));
        pool.want(&[tile(6, 0), tile(0, 1)]);
        assert!(pool.missing().is_empty());
        pool.want(&[tile(6, 0), tile(0, 7)]);
        assert_eq!(pool.missing(), [tile(0, 7)], "what was not here is wanted as ever");
    }

    #[test]
    fn what_is_ahead_takes_only_what_the_view_leaves() {
        let mut pool = pool(4);
        let root = tile(6, 0);
        let here = [root, tile(0, 1), tile(0, 2)];
        pool.want(&here);
        pool.want_ahead(&[root, tile(0, 2), tile(0, 3), tile(0, 4)]);
        assert_eq!(pool.missing_ahead(), [tile(0, 3)], "there is room for one");
        // It comes before what the view itself waits for, and puts out none of it.
        pool.insert(tile(0, 3));
        for t in here {
            assert!(pool.insert(t).is_some_and(|p| p.evicted.is_none()));
        }
        // Neither view wants 3 any more: 4 may have its place, and nobody else's.
        pool.want(&here);
        pool.want_ahead(&[tile(0, 4), tile(0, 5)]);
        assert_eq!(pool.missing_ahead(), [tile(0, 4)]);
        assert_eq!(pool.insert(tile(0, 4)).and_then(|p| p.evicted), Some(tile(0, 3)));
        assert_eq!(pool.insert(tile(0, 5)), None);
        // The view has the last word.
        pool.want(&[root, tile(0, 1), tile(0, 2), tile(0, 6)]);
        assert_eq!(pool.insert(tile(0, 6)).and_then(|p| p.evicted), Some(tile(0, 4)));
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
