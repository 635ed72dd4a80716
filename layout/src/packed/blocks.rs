//! Where the records of a page lie in tiles: aligned blocks of slots, each in few tiles, at places that are the same for all blocks of an octave.
//!
//! A block of 1,024 slots of a level is a square of whites, or a square of blacks that stands on a corner (see [`grid::order`](crate::grid::order)). A page has parts of two blocks, but for the few that hold
//! the coarsest levels. Invariant: a place is what [`Groups::tile_of`](super::shape::Groups::tile_of) says, unless the tile lies outside the square. Cost: 15 KiB once; then a load a record.

use super::shape::{Groups, OCTAVES, TILE_LOG, TileId};
use super::tile::index_of;
use crate::grid::order::{BLOCK_SLOTS, block_start, level_around, slot_count, step_in_block};
use std::array;
use std::ops::Range;
use std::sync::OnceLock;

/// Most tiles that a block lies in.
pub(super) const MOST_TILES: usize = 16;
const SLOTS: usize = BLOCK_SLOTS as usize;

/// Places of a block's slots.
#[derive(Debug)]
pub(super) struct Block {
    /// Of each slot the index in its tile, and above it the number of its tile in `tiles`.
    places: [u16; SLOTS],
    /// Columns and rows of tiles, counted from the one where the block's vertices are counted from.
    tiles: Vec<[i64; 2]>,
    octave: u32,
}

impl Block {
    /// A block of whites or blacks of an octave of a group, whose first column and row are `first` steps of the octave from a tile's.
    fn new(is_white: bool, octave: u32, first: i32) -> Self {
        let side = 1i32 << (TILE_LOG - octave);
        let mut tiles = Vec::new();
        let places = array::from_fn(|i| {
            let at = step_in_block(is_white, i).map(|v| v + first);
            let tile = at.map(|v| i64::from(v.div_euclid(side)));
            let number = tiles.iter().position(|known| *known == tile).unwrap_or_else(|| {
                tiles.push(tile);
                tiles.len() - 1
            });
            let within = at.map(|v| (v.rem_euclid(side) as u32) << octave);
            (number << place_bits(octave) | index_of(TILE_LOG, within)) as u16
        });
        debug_assert!(tiles.len() <= MOST_TILES);
        Self { places, tiles, octave }
    }

    /// The block of an octave of a group, by its first column and row in steps of it.
    fn of(is_white: bool, octave: u32, start: [i64; 2]) -> &'static Self {
        static BLOCKS: OnceLock<[[Block; 4]; 2]> = OnceLock::new();
        let blocks = BLOCKS.get_or_init(|| {
            [false, true].map(|is_white| {
                [(0, 0), (0, 32), (1, 0), (2, 0)].map(|(octave, first)| Self::new(is_white, octave, first))
            })
        });
        // Blocks start at multiples of 32 steps, blacks where both are odd ones or even ones; tiles have 64, 32 and 16.
        let which = if octave == 0 { (start[0] >> 5 & 1) as usize } else { octave as usize + 1 };
        &blocks[usize::from(is_white)][which & 3]
    }

    /// Its octave, counted from its group's finest.
    pub(super) fn octave(&self) -> u32 {
        self.octave
    }

    /// Numbers of the tiles that these slots of it lie in, as bits.
    pub(super) fn tiles_of(&self, slots: &Range<usize>) -> u32 {
        let bits = place_bits(self.octave);
        self.places[slots.clone()].iter().fold(0, |all, place| all | 1 << (place >> bits & 31))
    }

    /// The records of these slots of it. A tile has a record at all places of its octave; what others have is passed over.
    #[inline(always)]
    pub(super) fn gather(
        &self,
        slots: &Range<usize>,
        tiles: &[Option<&[u32]>; MOST_TILES],
        records: &mut [[u8; 4]],
    ) {
        match self.octave {
            0 => gather::<{ place_bits(0) }>(&self.places[slots.clone()], tiles, records),
            1 => gather::<{ place_bits(1) }>(&self.places[slots.clone()], tiles, records),
            _ => gather::<{ place_bits(2) }>(&self.places[slots.clone()], tiles, records),
        }
    }

    /// The same of records of so many `words`, each four bytes of `records`.
    pub(super) fn gather_words(
        &self,
        slots: &Range<usize>,
        tiles: &[Option<&[u32]>; MOST_TILES],
        records: &mut [[u8; 4]],
        words: usize,
    ) {
        let bits = place_bits(self.octave);
        for (record, place) in records.chunks_exact_mut(words).zip(&self.places[slots.clone()]) {
            let tile = tiles[usize::from(place >> bits) % MOST_TILES].unwrap_or_default();
            let first = words * (usize::from(*place) & ((1 << bits) - 1));
            if let Some(found) = tile.get(first..first + words) {
                record.iter_mut().zip(found).for_each(|(to, from)| *to = from.to_le_bytes());
            }
        }
    }

    /// Those of these slots that lie in a tile.
    pub(super) fn slots_in(&self, number: usize, slots: &Range<usize>) -> impl Iterator<Item = usize> {
        let bits = place_bits(self.octave);
        slots.clone().filter(move |i| usize::from(self.places[*i] >> bits) == number)
    }
}

/// Bits of an index in a tile down to an octave.
const fn place_bits(octave: u32) -> u32 {
    // (2^6 / 2^octave + 1)^2 vertices at most.
    13 - 2 * octave
}

#[inline(always)]
fn gather<const BITS: u32>(places: &[u16], tiles: &[Option<&[u32]>; MOST_TILES], records: &mut [[u8; 4]]) {
    let tiles = tiles.map(Option::unwrap_or_default);
    for (record, place) in records.iter_mut().zip(places) {
        let tile = tiles[usize::from(place >> BITS) % MOST_TILES];
        if let Some(found) = tile.get(usize::from(*place) & ((1 << BITS) - 1)) {
            *record = found.to_le_bytes();
        }
    }
}

/// A part of a page.
#[derive(Debug)]
pub(super) enum Piece {
    /// Slots of the page whose records are found one by one.
    Single(Range<u64>),
    /// Slots of a block that begin at a slot.
    Block {
        first: u64,
        slots: Range<usize>,
        block: &'static Block,
        /// Group, and the column and row of the tile that the block's are counted from.
        group: u8,
        tile: [i64; 2],
    },
}

/// The parts of a row of slots.
pub(super) fn pieces(groups: &Groups, k: u32, slots: Range<u64>) -> impl Iterator<Item = Piece> {
    let mut next = slots.start;
    std::iter::from_fn(move || {
        let first = next;
        if first >= slots.end {
            return None;
        }
        let level = level_around(first).filter(|_| first < slot_count(k));
        let Some((d, is_white, level)) = level else {
            next = if first < 4 { slots.end.min(4) } else { slots.end };
            return Some(Piece::Single(first..next));
        };
        let octave = k - 1 - d;
        let group = (octave / OCTAVES) as usize;
        let offset = first - level.start;
        // Smaller levels have no block, or one that the square lies across.
        let is_block =
            1u64 << (2 * d) >= BLOCK_SLOTS && groups.groups.get(group).is_some_and(|group| !group.is_top);
        if !is_block {
            next = slots.end.min(level.end);
            return Some(Piece::Single(first..next));
        }
        let from = offset - offset % BLOCK_SLOTS;
        next = slots.end.min(level.start + from + BLOCK_SLOTS);
        let within = (offset % BLOCK_SLOTS) as usize;
        let octave = octave % OCTAVES;
        let start = block_start(is_white, d, from);
        Some(Piece::Block {
            first,
            slots: within..within + (next - first) as usize,
            block: Block::of(is_white, octave, start),
            group: group as u8,
            tile: start.map(|v| v >> (TILE_LOG - octave)),
        })
    })
}

/// The tiles that some slots of a block lie in, with their numbers there: `None` for what lies outside the square, or where no records are.
pub(super) fn tiles_of<'b>(
    groups: &Groups,
    block: &'b Block,
    slots: &Range<usize>,
    group: u8,
    tile: [i64; 2],
) -> impl Iterator<Item = (usize, Option<TileId>)> + use<'b> {
    let side = i64::from(groups.groups[usize::from(group)].side);
    let used = block.tiles_of(slots);
    let numbered = block.tiles.iter().enumerate().filter(move |(number, _)| used >> number & 1 == 1);
    numbered.map(move |(number, [x, y])| {
        let at = [tile[0] + x, tile[1] + y];
        let is_inside = at.iter().all(|v| (0..side).contains(v));
        (number, is_inside.then(|| TileId { group, at: at.map(|v| v as u32) }))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;
    use crate::grid::order::point_of;

    /// The tile and index of every slot of a page are those of its vertex.
    #[test]
    fn blocks_say_where_vertices_lie() {
        for k in 7..=10 {
            let grid = Grid::new([(1 << k) + 1; 2], [1.0; 2]).unwrap();
            let groups = Groups::of(&grid);
            let mut in_blocks = 0;
            for page in 0..=slot_count(k) / 1024 {
                let mut next = 1024 * page;
                for piece in pieces(&groups, k, next..next + 1024) {
                    let (first, slots, block, group, tile) = match piece {
                        Piece::Single(slots) => {
                            assert_eq!(slots.start, next);
                            next = slots.end;
                            continue;
                        }
                        Piece::Block { first, slots, block, group, tile } => {
                            (first, slots, block, group, tile)
                        }
                    };
                    assert_eq!(first, next);
                    next += slots.len() as u64;
                    let tiles: Vec<_> = tiles_of(&groups, block, &slots, group, tile).collect();
                    for (number, id) in tiles {
                        for i in block.slots_in(number, &slots) {
                            let Some(p) = point_of(k, first + (i - slots.start) as u64) else {
                                assert_eq!(id, None);
                                continue;
                            };
                            let (known, at) = groups.tile_of(p, groups.octave(p));
                            in_blocks += u64::from(id.is_some());
                            if id.is_some() {
                                let place =
                                    usize::from(block.places[i]) & ((1 << place_bits(block.octave)) - 1);
                                assert_eq!((id, place), (Some(known), index_of(TILE_LOG, at)), "{p:?} {k}");
                            } else {
                                assert!(p.x() == 1 << k || p.y() == 1 << k);
                            }
                        }
                    }
                }
                assert_eq!(next, 1024 * page + 1024);
            }
            assert!(in_blocks > (1 << (2 * k)) * 9 / 10);
        }
    }
}
