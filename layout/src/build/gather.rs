//! The records of the slots of one part of a page, from the rows in which they were made.
//!
//! The rows are looked up once for each part. A part with nothing but inert records, as in an ocean, costs a look at the rectangle around it and makes no page.

use super::levels::{LevelShape, Levels, Piece};
use super::plan::{PagePart, block_bounds};
use crate::grid::order::{BLOCK_SLOTS, BlockCells, level_slots};
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};

/// Rows that a block of slots can touch, and one more: 32 for white vertices, 63 for black ones, whose blocks stand on a corner.
const ROWS: usize = 64;

/// The bytes of a part's records; `None` if all are inert.
pub(super) fn gather<C: RecordCodec>(
    grid: &Grid,
    part: &PagePart,
    shape: &LevelShape,
    records: &Levels<C::Raw>,
) -> Option<Vec<u8>> {
    let offset = part.first() - level_slots(grid.k(), shape.level()).start;
    let within = (offset % BLOCK_SLOTS) as usize;
    let start = offset - within as u64;
    let [x, y] = block_bounds(grid.k(), shape, start, BLOCK_SLOTS.ilog2() / 2);
    let clip = |v: i64, i: usize| v.clamp(0, i64::from(shape.limit()[i])) as u32;
    let index = |i: usize| shape.index(GridPoint::new(clip(x[i], 0), clip(y[i], 1)));
    let ((south, west), (north, east)) = (index(0), index(1));
    // Rows of the block that are not kept belong to other parts of it.
    let mut rows: [Piece<'_, C::Raw>; ROWS] = std::array::from_fn(|_| Piece::none());
    for (place, row) in rows.iter_mut().zip(south..=north) {
        *place =
            records.row(shape.level(), row).map_or(Piece::none(), |row| row.piece(west, east + 1, C::INERT));
    }
    let is_inert = |row: &Piece<'_, C::Raw>| {
        let count = row.values.len();
        let columns =
            west.saturating_sub(row.from).min(count)..(east + 1).saturating_sub(row.from).min(count);
        // Without an early end the comparison takes many records at once.
        row.values[columns].iter().fold(true, |all, raw| all & (*raw == C::INERT))
    };
    if rows.iter().all(is_inert) {
        return None;
    }
    let mut bytes = vec![0; part.count() as usize * C::BYTES];
    let block = BlockCells::new(grid.k(), shape.level(), start);
    for (i, place) in bytes.chunks_exact_mut(C::BYTES).enumerate() {
        // Rows hold no more than what is not beyond the data, so ghosts and others are in none.
        let (row, column) = block.cell(within + i);
        let raw = rows.get(row.wrapping_sub(south)).and_then(|row| row.get(column));
        C::write(raw.unwrap_or(C::INERT), place);
    }
    Some(bytes)
}
