//! Which layer a tile is in, as the shader looks it up: a hash table in a small texture.
//!
//! Its size follows the layers of the pool, and not the tiles that there are: over a million samples a side these are ninety million. An entry is a tile and
//! its layer. A tile stands in the slot that its hash gives, or in the first free one after that. Where one is
//! taken out, those behind move up, so that there is never a gap between a tile's own slot and where it stands. `shaders/tiles.wgsl` looks tiles up in the same way.
//!
//! Invariant: at most a quarter of the slots is taken, so a search meets a free slot soon. Cost: one write a slot that changes, one or two for a tile that comes or goes.

use terrasoar_layout::imagery::TileId;

/// Slots in a row of the texture; the shader says the same.
const ROW_SLOTS: u32 = 64;
/// Slots for each layer of the pool, at least.
const SLOTS_A_LAYER: u32 = 4;

/// Column, row and level of a tile; its layer and 1. All zero where there is none.
pub(crate) type Slot = [u32; 4];

/// What is in the slots of the texture.
#[derive(Debug, Clone)]
pub(crate) struct TileTable {
    slots: Vec<Slot>,
}

impl TileTable {
    /// An empty table for so many tiles, at least 1.
    pub(crate) fn new(capacity: u32) -> Self {
        let slots = capacity.max(1).saturating_mul(SLOTS_A_LAYER).next_power_of_two().max(ROW_SLOTS);
        Self { slots: vec![[0; 4]; slots as usize] }
    }

    /// Columns and rows of the texture.
    pub(crate) fn size(&self) -> [u32; 2] {
        [ROW_SLOTS, self.slots.len() as u32 / ROW_SLOTS]
    }

    /// Bytes of the texture.
    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(&*self.slots) as u64
    }

    /// Where a slot is in the texture, and what it holds.
    pub(crate) fn texel(&self, slot: u32) -> ([u32; 2], Slot) {
        ([slot % ROW_SLOTS, slot / ROW_SLOTS], self.slots[slot as usize])
    }

    /// The slot that a tile has before all others.
    fn own(&self, tile: TileId) -> u32 {
        let mixed = tile.x.wrapping_mul(0x9e37_79b1)
            ^ tile.y.wrapping_mul(0x85eb_ca77)
            ^ tile.level.wrapping_mul(0xc2b2_ae3d);
        (mixed ^ mixed >> 15).wrapping_mul(0x2c1b_3c6d) >> (32 - self.slots.len().ilog2())
    }

    fn after(&self, slot: u32) -> u32 {
        (slot + 1) & (self.slots.len() as u32 - 1)
    }

    /// The slot of a tile, or the free one where it would stand.
    fn find(&self, tile: TileId) -> u32 {
        let key = [tile.x, tile.y, tile.level];
        let mut slot = self.own(tile);
        while let held = self.slots[slot as usize]
            && held[3] != 0
            && held[..3] != key
        {
            slot = self.after(slot);
        }
        slot
    }

    /// Notes which layer a tile is in. Gives the slot that changed.
    pub(crate) fn insert(&mut self, tile: TileId, layer: u32) -> u32 {
        let slot = self.find(tile);
        self.slots[slot as usize] = [tile.x, tile.y, tile.level, layer + 1];
        slot
    }

    /// Takes a tile out. Gives the slots that changed: none where it was not there.
    pub(crate) fn remove(&mut self, tile: TileId) -> Vec<u32> {
        let mut gap = self.find(tile);
        let mut changed = Vec::new();
        if self.slots[gap as usize][3] == 0 {
            return changed;
        }
        let last = self.slots.len() as u32 - 1;
        let mut slot = gap;
        loop {
            slot = self.after(slot);
            let held = self.slots[slot as usize];
            let [x, y, level, layer] = held;
            if layer == 0 {
                break;
            }
            // One that stands as far behind its own slot as behind the gap, or farther, may move into it.
            let behind = |from: u32| slot.wrapping_sub(from) & last;
            if behind(self.own(TileId { level, x, y })) >= behind(gap) {
                self.slots[gap as usize] = held;
                changed.push(gap);
                gap = slot;
            }
        }
        self.slots[gap as usize] = [0; 4];
        changed.push(gap);
        changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashMap;

    /// What the shader finds: the layer of a tile and how many slots it looks at.
    fn look_up(texels: &[Slot], table: &TileTable, tile: TileId) -> (Option<u32>, u32) {
        let mut slot = table.own(tile);
        for looked_at in 1.. {
            match texels[slot as usize] {
                [.., 0] => return (None, looked_at),
                [x, y, level, layer] if (TileId { level, x, y }) == tile => {
                    return (Some(layer - 1), looked_at);
                }
                _ => slot = (slot + 1) % texels.len() as u32,
            }
        }
        unreachable!("there are free slots");
    }

    /// Tiles come and go as over a terrain of a million samples a side; after each the texture holds what a map holds.
    #[test]
    fn tiles_are_found_where_a_map_has_them() {
        for capacity in [1, 7, 300] {
            let mut table = TileTable::new(capacity);
            let mut texels: Vec<Slot> = table.slots.clone();
            let mut map: HashMap<TileId, u32> = HashMap::new();
            let mut order: Vec<TileId> = Vec::new();
            let mut state = 1_u32;
            let mut next = |most: u32| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) % most
            };
            for turn in 0..4000 {
                let level = next(14);
                let side = 8192 >> level;
                let tile = TileId { level, x: next(side), y: (4000 >> level) + next(side.min(3)) };
                if order.len() == capacity as usize || turn % 7 == 6 && !order.is_empty() {
                    let gone = order.swap_remove(next(order.len() as u32) as usize);
                    map.remove(&gone);
                    table.remove(gone).iter().for_each(|s| texels[*s as usize] = table.texel(*s).1);
                }
                let layer = turn % capacity;
                if map.insert(tile, layer).is_none() {
                    order.push(tile);
                }
                let slot = table.insert(tile, layer);
                texels[slot as usize] = table.texel(slot).1;
                assert!(table.remove(TileId { level: 31, x: 1, y: 1 }).is_empty());
                assert_eq!(texels, table.slots);
                for tile in &order {
                    assert_eq!(look_up(&texels, &table, *tile).0, map.get(tile).copied(), "{tile}");
                }
                assert_eq!(texels.iter().filter(|t| t[3] != 0).count(), map.len());
            }
        }
    }

    /// The tiles of a view and those above them: few searches go past the first slot.
    #[test]
    fn searches_are_short() {
        let mut table = TileTable::new(1008);
        let tiles: Vec<TileId> = (0..14)
            .flat_map(|level| (0..72).map(move |i| (level, i)))
            .map(|(level, i)| TileId { level, x: (5000 >> level) + i % 9, y: (3000 >> level) + i / 9 })
            .collect();
        for (layer, tile) in (0..).zip(&tiles) {
            table.insert(*tile, layer);
        }
        let looked_at: u32 = tiles.iter().map(|t| look_up(&table.slots, &table, *t).1).sum();
        assert!(looked_at < tiles.len() as u32 * 5 / 4, "{looked_at} slots for {} tiles", tiles.len());
    }

    #[test]
    fn the_texture_follows_the_layers() {
        let table = TileTable::new(1008);
        assert_eq!((table.size(), table.bytes()), ([64, 64], 64 << 10));
        assert_eq!(TileTable::new(1).size(), [64, 1]);
    }
}
