//! The records of a tile out of a terrain file, row by row: the work for a row's slots is done once.

use crate::grid::GridPoint;
use crate::grid::order::{BlackAlong, WhiteAlong, slot_of};
use crate::grid::record::RecordCodec;
use crate::packed::shape::{Groups, TileId};
use crate::packed::tile::TileRecords;
use crate::read::records::Records;

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
        } else if x.trailing_zeros() == y.trailing_zeros() {
            fill(records, WhiteAlong::new(k, 2 * octave + 1, x, y), words, inert.len());
        } else {
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
