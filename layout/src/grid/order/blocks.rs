//! Aligned blocks of slots: where they start, and where their vertices lie from there, ghosts included.

use super::{BLOCK_ORDER, black_base, black_block_at, depth_of, gather, white_base, white_block_at};

/// Column and row from which [`step_in_block`] counts the vertices of the block of 4^5 slots that starts `offset` slots into its level at depth `d`, in steps of the level's octave.
pub(crate) const fn block_start(is_white: bool, d: u32, offset: u64) -> [i64; 2] {
    if is_white {
        let [x, y] = white_block_at(offset, BLOCK_ORDER);
        return [2 * x as i64, 2 * y as i64];
    }
    let [a, b] = black_block_at(d, offset, BLOCK_ORDER);
    // See `black_point`.
    [a as i64 - b as i64 + (1 << d), a as i64 + b as i64 - (1 << d)]
}

/// Column and row of the `i`-th slot of such a block, in steps of the octave.
pub(crate) const fn step_in_block(is_white: bool, i: usize) -> [i32; 2] {
    let (odd, even) = (gather(i as u64 >> 1) as i32, gather(i as u64) as i32);
    if is_white {
        return [2 * (odd ^ even) + 1, 2 * odd + 1];
    }
    let a = odd ^ ((1 << BLOCK_ORDER) - 1);
    let b = a ^ even;
    [a - b, a + b + 1]
}

/// The level that a slot is of: depth, whether it is of white vertices, and its slots. `None` for corners.
pub(crate) fn level_around(slot: u64) -> Option<(u32, bool, std::ops::Range<u64>)> {
    if slot < 4 {
        return None;
    }
    let d = depth_of(slot);
    let (white, black, next) = (white_base(d), black_base(d), white_base(d + 1));
    Some(if slot < black { (d, true, white..black) } else { (d, false, black..next) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::order::{BLOCK_SLOTS, level_slots, point_of};

    #[test]
    fn blocks_start_where_their_vertices_are_counted_from() {
        for (k, level) in (6..=8).flat_map(|k| (0..2 * (k - 5)).map(move |level| (k, level))) {
            let (is_white, t, slots) = (level & 1 == 1, level / 2, level_slots(k, level));
            for slot in slots.clone() {
                let offset = slot - slots.start;
                let start = block_start(is_white, k - 1 - t, offset & !(BLOCK_SLOTS - 1));
                let step = step_in_block(is_white, (offset % BLOCK_SLOTS) as usize);
                if let Some(p) = point_of(k, slot) {
                    let at = [0, 1].map(|i| (start[i] + i64::from(step[i])) << t);
                    assert_eq!(at, [i64::from(p.x()), i64::from(p.y())]);
                }
                assert_eq!(level_around(slot), Some((k - 1 - t, is_white, slots.clone())));
            }
        }
        assert!((0..4).all(|slot| level_around(slot).is_none()));
    }
}
