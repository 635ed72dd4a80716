//! Which record pages the file will have, where each will lie, and when its last record is known.
//!
//! A level's slots are cut into blocks of the quadtree, whose rows lie close together, and blocks at page borders: a page is made of parts.
//! Presence follows from the grid alone: a page is planned if one of its slots holds a vertex that is not beyond the data. Pages that turn out
//! to be all void are taken out at the end. Cost: a few blocks a part, single slots only along the data's outline.

use super::levels::LevelShape;
use crate::error::LayoutError;
use crate::file::bytes::to_usize;
use crate::grid::Grid;
use crate::grid::order::{BLOCK_SLOTS, level_slots, point_of, slot_count};
use rayon::prelude::*;

/// The slots of one page that lie in one block of one level: gathered together once the last of their rows is known. There are some two a
/// page and all are there from the start, so they are small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PagePart {
    /// First slot, and number of slots in the low [`COUNT_BITS`].
    slots: u64,
    /// Least and largest y of its vertices.
    pub(super) y: [u32; 2],
}

/// Bits that hold the number of slots of a block.
const COUNT_BITS: u32 = BLOCK_SLOTS.ilog2() + 1;

impl PagePart {
    fn new(slots: std::ops::Range<u64>, y: [u32; 2]) -> Self {
        Self { slots: slots.start << COUNT_BITS | (slots.end - slots.start), y }
    }

    /// First slot.
    pub(super) fn first(&self) -> u64 {
        self.slots >> COUNT_BITS
    }

    /// Number of slots, at most [`BLOCK_SLOTS`].
    pub(super) fn count(&self) -> u64 {
        self.slots & ((1 << COUNT_BITS) - 1)
    }
}

/// What one level contributes, in order of the row at which it becomes complete.
#[derive(Debug, Default)]
pub(super) struct LevelPlan {
    pub(super) parts: Vec<PagePart>,
    /// Largest difference between a part's least and largest y.
    pub(super) span: u32,
}

/// The whole file's plan.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) levels: Vec<LevelPlan>,
    /// Parts of each logical page; a page without any is absent.
    pub(super) parts: Vec<u8>,
}

impl Plan {
    pub(super) fn new(grid: &Grid, records_per_page: u64) -> Result<Self, LayoutError> {
        let k = grid.k();
        let pages = slot_count(k).div_ceil(records_per_page);
        let mut parts = vec![0u8; to_usize(pages)?];
        // The corners.
        parts[0] = 1;
        let mut levels = Vec::new();
        for level in 0..grid.levels() {
            let shape = LevelShape::new(grid, level);
            let slots = level_slots(k, level);
            let blocks = (slots.end - slots.start).div_ceil(BLOCK_SLOTS);
            let mut level_parts: Vec<PagePart> = (0..blocks)
                .into_par_iter()
                .flat_map_iter(|block| {
                    let start = slots.start + block * BLOCK_SLOTS;
                    let end = (start + BLOCK_SLOTS).min(slots.end);
                    let pages = start / records_per_page..(end - 1) / records_per_page + 1;
                    pages.filter_map(move |page| {
                        let first = start.max(page * records_per_page);
                        let last = end.min((page + 1) * records_per_page);
                        let y = rows_of(k, &shape, first..last)?;
                        Some(PagePart::new(first..last, y))
                    })
                })
                .collect();
            level_parts.sort_unstable_by_key(|p| (p.y[1], p.slots));
            for part in &level_parts {
                parts[(part.first() / records_per_page) as usize] += 1;
            }
            let span = level_parts.iter().map(|p| p.y[1] - p.y[0]).max().unwrap_or(0);
            levels.push(LevelPlan { parts: level_parts, span });
        }
        Ok(Self { levels, parts })
    }
}

/// Least and largest y of the vertices that the slots of one level hold, those beyond the data left out.
fn rows_of(k: u32, shape: &LevelShape, slots: std::ops::Range<u64>) -> Option<[u32; 2]> {
    let base = level_slots(k, shape.level()).start;
    let (mut from, to) = (slots.start - base, slots.end - base);
    let mut rows: Option<[u32; 2]> = None;
    while from < to {
        // The largest aligned block of the quadtree that starts here and fits.
        let aligned = from.trailing_zeros() / 2;
        let fits = (to - from).ilog2() / 2;
        let order = aligned.min(fits);
        block_rows(k, shape, base, from, order, &mut rows);
        from += 1 << (2 * order);
    }
    rows
}

/// Extends `rows` by the vertices of the quadtree block of 4^order slots at `offset` into the level.
fn block_rows(k: u32, shape: &LevelShape, base: u64, offset: u64, order: u32, rows: &mut Option<[u32; 2]>) {
    let [x, y] = block_bounds(k, shape, offset, order);
    let limit = shape.limit();
    if x[1] < 0 || y[1] < 0 || x[0] > i64::from(limit[0]) || y[0] > i64::from(limit[1]) {
        return;
    }
    // Rows the block could add are known already.
    if let Some([low, high]) = rows
        && i64::from(*low) <= y[0].max(0)
        && i64::from(*high) >= y[1].min(i64::from(limit[1]))
    {
        return;
    }
    let inside = x[0] >= 0 && y[0] >= 0 && x[1] <= i64::from(limit[0]) && y[1] <= i64::from(limit[1]);
    if inside || order == 0 {
        let found = if order == 0 {
            point_of(k, base + offset).filter(|p| !shape.is_beyond(*p)).map(|p| [p.y(), p.y()])
        } else {
            Some([y[0] as u32, y[1] as u32])
        };
        if let Some([low, high]) = found {
            *rows = Some(rows.map_or([low, high], |r| [r[0].min(low), r[1].max(high)]));
        }
        return;
    }
    for quarter in 0..4 {
        block_rows(k, shape, base, offset + (quarter << (2 * (order - 1))), order - 1, rows);
    }
}

/// Bounds in x and y of a block of 4^order slots, ghosts included.
pub(super) fn block_bounds(k: u32, shape: &LevelShape, offset: u64, order: u32) -> [[i64; 2]; 2] {
    use crate::grid::order::{black_block_at, white_block_at};
    let d = k - 1 - shape.level() / 2;
    let t = shape.level() / 2;
    let last = (1i64 << order) - 1;
    if shape.is_white() {
        let [x, y] = white_block_at(offset, order).map(|v| v as i64);
        let at = |c: i64| (2 * c + 1) << t;
        [[at(x), at(x + last)], [at(y), at(y + last)]]
    } else {
        let [a, b] = black_block_at(d, offset, order).map(|v| v as i64);
        let centre = 1i64 << d;
        // w = A + B + 1 - 2^d and u = A - B + 2^d.
        let x = [a - (b + last) + centre, a + last - b + centre];
        let y = [a + b + 1 - centre, a + b + 2 * last + 1 - centre];
        [x.map(|v| v << t), y.map(|v| v << t)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::GridPoint;

    /// Against every slot looked at one by one.
    #[test]
    fn the_plan_matches_the_slots() {
        for (samples, per_page) in
            [([65, 65], 16), ([40, 65], 64), ([64, 33], 16), ([33, 2], 16), ([20, 20], 1024)]
        {
            let grid = Grid::new(samples, [1.0, 1.0]).unwrap();
            let k = grid.k();
            let plan = Plan::new(&grid, per_page).unwrap();
            let mut planned = 4;
            let mut seen = vec![0u8; plan.parts.len()];
            seen[0] = 1;
            for part in plan.levels.iter().flat_map(|l| &l.parts) {
                seen[(part.first() / per_page) as usize] += 1;
                assert_eq!(part.first() / per_page, (part.first() + part.count() - 1) / per_page);
                let rows: Vec<u32> = (part.first()..part.first() + part.count())
                    .filter_map(|s| point_of(k, s))
                    .filter(|p| !grid.is_beyond(*p, grid.level(*p)))
                    .map(GridPoint::y)
                    .collect();
                assert!(rows.iter().all(|y| (part.y[0]..=part.y[1]).contains(y)) && !rows.is_empty());
                planned += rows.len();
            }
            assert_eq!(seen, plan.parts);
            let all = (0..slot_count(k))
                .filter_map(|s| point_of(k, s))
                .filter(|p| grid.is_corner(*p) || !grid.is_beyond(*p, grid.level(*p)))
                .count();
            assert_eq!(planned, all);
        }
    }
}
