//! The numbers of tiles in PMTiles: zoom by zoom, each along Hilbert's curve (PMTiles 3.4, section 4.1).
//!
//! A run of numbers is a few squares: each part of the curve of 4^k tiles that begins at a multiple of that fills one. Cost: a step a zoom.

use super::grid::{MAX_ZOOM, Span, Tile};

/// The first number of each zoom, and behind the last.
pub(super) const FIRST: [u64; MAX_ZOOM as usize + 2] = {
    let mut first = [0; MAX_ZOOM as usize + 2];
    let mut zoom = 1;
    while zoom < first.len() {
        first[zoom] = first[zoom - 1] + (1 << (2 * (zoom - 1)));
        zoom += 1;
    }
    first
};

/// Tiles that fill a square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) zoom: u8,
    pub(super) span: Span,
}

/// Turns a quarter of a square of `side` as the curve does there.
fn turn(side: u32, [x, y]: [u32; 2], right: u32, lower: u32) -> [u32; 2] {
    match (lower, right) {
        (0, 0) => [y, x],
        (0, _) => [side - 1 - y, side - 1 - x],
        _ => [x, y],
    }
}

/// The number of a tile.
pub(super) fn id_of(tile: Tile) -> u64 {
    let (mut at, mut along) = ([tile.x, tile.y], 0);
    for level in (0..tile.zoom).rev() {
        let side = 1u32 << level;
        let [right, lower] = at.map(|part| (part >> level) & 1);
        along += u64::from((3 * right) ^ lower) << (2 * level);
        at = turn(side, at.map(|part| part & (side - 1)), right, lower);
    }
    FIRST[usize::from(tile.zoom)] + along
}

/// Column and row at so many steps along the curve over a square of 2^`zoom` tiles.
fn at(zoom: u8, mut along: u64) -> [u32; 2] {
    let mut at = [0, 0];
    for level in 0..zoom {
        let right = (along >> 1) as u32 & 1;
        let lower = (along as u32 ^ right) & 1;
        let [x, y] = turn(1 << level, at, right, lower);
        at = [x | right << level, y | lower << level];
        along >>= 2;
    }
    at
}

/// Calls `each` with squares that make up the run of `count` tiles from number `id` on. Numbers beyond the last zoom are passed over.
pub(super) fn blocks(mut id: u64, count: u64, each: &mut dyn FnMut(Block)) {
    let end = id.saturating_add(count).min(FIRST[usize::from(MAX_ZOOM) + 1]);
    while id < end {
        // The first zoom begins at 0.
        let zoom = FIRST.partition_point(|first| *first <= id) - 1;
        let along = id - FIRST[zoom];
        let left = end.min(FIRST[zoom + 1]) - id;
        let aligned = if along == 0 { zoom as u32 } else { along.trailing_zeros() / 2 };
        let level = aligned.min(left.ilog2() / 2).min(zoom as u32);
        let zoom = zoom as u8;
        let [x, y] = at(zoom - level as u8, along >> (2 * level)).map(|part| part << level);
        let last = (1 << level) - 1;
        each(Block { zoom, span: Span { x: [x, x + last], y: [y, y + last] } });
        id += 1 << (2 * level);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn numbers_are_those_of_the_specification() {
        for (zoom, x, y, id) in [
            (0, 0, 0, 0),
            (1, 0, 0, 1),
            (1, 0, 1, 2),
            (1, 1, 1, 3),
            (1, 1, 0, 4),
            (2, 0, 0, 5),
            (12, 3423, 1763, 19_078_479),
        ] {
            assert_eq!(id_of(Tile { zoom, x, y }), id, "{zoom}/{x}/{y}");
        }
    }

    #[test]
    fn runs_are_squares_of_all_their_tiles() {
        for (first, count) in [(0, 1), (0, 85), (3, 200), (21, 64), (22, 63), (100, 1000), (5, 1)] {
            let mut tiles = BTreeSet::new();
            blocks(first, count, &mut |block| {
                for i in 0..block.span.count() {
                    assert!(tiles.insert(id_of(block.span.tile(block.zoom, i))), "twice");
                }
            });
            assert_eq!(tiles, (first..first + count).collect(), "{first} and {count}");
        }
        let mut blocks_of_all = 0;
        blocks(0, u64::MAX, &mut |_| blocks_of_all += 1);
        assert_eq!(blocks_of_all, 31, "a square a zoom");
    }
}
