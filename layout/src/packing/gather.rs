//! The records of a tile out of a terrain file, row by row: the work for a row's slots is done once.

use crate::grid::GridPoint;
use crate::grid::order::{BlackAlong, WhiteAlong, slot_of};
use crate::grid::record::RecordCodec;
use crate::packed::shape::{Groups, TileId};
use crate::packed::tile::TileRecords;
use crate::read::records::Records;

/// Rows that memory is asked for ahead, and of which vertices of one: those whose records lie in one line of it are four by four, whites upright, blacks on a corner.
const AHEAD: u32 = 4;
const EACH: usize = 4;

/// The records of a tile; `inert` is the words of an inert one.
pub(super) fn tile_of<C: RecordCodec>(
    records: &Records<'_, C>,
    groups: &Groups,
    id: TileId,
    inert: &[u32],
) -> TileRecords {
    let group = &groups.groups[usize::from(id.group)];
    let k = records.grid().k();
    let first = id.at.map(|v| v << (group.stride_log + group.tile_log));
    let on_grid = |at: [u32; 2]| [0, 1].map(|axis| first[axis] + (at[axis] << group.stride_log));
    TileRecords::by_rows(&groups.shape(id), inert, |at, step, words| {
        let [x, y] = on_grid(at);
        let octave = (x | y).trailing_zeros();
        if octave >= k {
            let xs = (0u32..).map(|i| x + i * (step << group.stride_log));
            fill(records, xs.map(|x| slot_of(k, GridPoint::new(x, y))), words, inert.len());
            return;
        }
        // Records of a few rows lie together: those of rows ahead are asked for where they may be new ones.
        let ahead = y + ((AHEAD * step) << group.stride_log);
        let is_there = ahead <= first[1] + (1 << (group.stride_log + group.tile_log));
        if x.trailing_zeros() == y.trailing_zeros() {
            let is_first = (y >> (octave + 1)).is_multiple_of(AHEAD);
            let slots = WhiteAlong::new(k, 2 * octave + 1, x, ahead).take(words.len() / inert.len());
            if is_there && is_first {
                slots.step_by(EACH).for_each(|slot| records.prefetch(slot));
            }
            fill(records, WhiteAlong::new(k, 2 * octave + 1, x, y), words, inert.len());
        } else {
            let slots = BlackAlong::new(k, 2 * octave, x, ahead).take(words.len() / inert.len());
            if is_there {
                slots.step_by(EACH).for_each(|slot| records.prefetch(slot));
            }
            fill(records, BlackAlong::new(k, 2 * octave, x, y), words, inert.len());
        }
    })
}

/// The records of these slots, in words.
#[inline(always)]
fn fill<C: RecordCodec>(
    records: &Records<'_, C>,
    slots: impl Iterator<Item = u64>,
    words: &mut [u32],
    words_each: usize,
) {
    let mut near = records.near();
    for (record, slot) in words.chunks_exact_mut(words_each).zip(slots) {
        let mut bytes = [0; 16];
        C::write(near.raw(slot), &mut bytes);
        record.iter_mut().zip(bytes.as_chunks().0).for_each(|(to, from)| *to = u32::from_le_bytes(*from));
    }
}
