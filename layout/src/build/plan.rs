//! Which record pages the file will have, where each will lie, and when its last record is known.
//!
//! Presence follows from the grid alone: a page is planned if one of its slots holds a vertex that is not beyond the data. Pages that turn out
//! to be all void are taken out at the end. Cost: a few blocks a page, single slots only along the data's outline.

use super::levels::LevelShape;
use crate::bytes::to_usize;
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::order::{level_slots, point_of, slot_count};
use rayon::prelude::*;

/// A page all of whose slots belong to one level.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PageTask {
    /// Logical page.
    pub(super) page: u64,
    /// Least and largest y of its vertices.
    pub(super) y: [u32; 2],
}

/// A single slot in a page shared by several levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SlotTask {
    pub(super) y: u32,
    pub(super) slot: u64,
}

/// What one level contributes, in order of the row at which it becomes complete.
#[derive(Debug, Default)]
pub(super) struct LevelPlan {
    pub(super) pages: Vec<PageTask>,
    pub(super) slots: Vec<SlotTask>,
    /// Largest difference between a page's least and largest y.
    pub(super) span: u32,
}

/// The whole file's plan.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) levels: Vec<LevelPlan>,
    /// Whether each logical page is planned to be present.
    pub(super) present: Vec<bool>,
}

impl Plan {
    pub(super) fn new(grid: &Grid, records_per_page: u64) -> Result<Self, LayoutError> {
        let k = grid.k();
        let pages = slot_count(k).div_ceil(records_per_page);
        let mut present = vec![false; to_usize(pages)?];
        // The corners' page.
        present[0] = true;
        let mut levels = Vec::new();
        for level in 0..grid.levels() {
            let shape = LevelShape::new(grid, level);
            let slots = level_slots(k, level);
            let first_whole = slots.start.div_ceil(records_per_page);
            let end_whole = (slots.end / records_per_page).max(first_whole);
            let mut tasks: Vec<PageTask> = (first_whole..end_whole)
                .into_par_iter()
                .filter_map(|page| {
                    let first = page * records_per_page;
                    rows_of(k, &shape, first..first + records_per_page).map(|y| PageTask { page, y })
                })
                .collect();
            tasks.sort_unstable_by_key(|t| (t.y[1], t.page));
            for task in &tasks {
                present[task.page as usize] = true;
            }
            let edges = if first_whole == end_whole {
                [slots.start..slots.end, 0..0]
            } else {
                [slots.start..first_whole * records_per_page, end_whole * records_per_page..slots.end]
            };
            let mut singles = Vec::new();
            for slot in edges.into_iter().flatten() {
                if let Some(p) = point_of(k, slot).filter(|p| !shape.is_beyond(*p)) {
                    present[(slot / records_per_page) as usize] = true;
                    singles.push(SlotTask { y: p.y(), slot });
                }
            }
            singles.sort_unstable_by_key(|t| (t.y, t.slot));
            let span = tasks.iter().map(|t| t.y[1] - t.y[0]).max().unwrap_or(0);
            levels.push(LevelPlan { pages: tasks, slots: singles, span });
        }
        Ok(Self { levels, present })
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
fn block_bounds(k: u32, shape: &LevelShape, offset: u64, order: u32) -> [[i64; 2]; 2] {
    use crate::order::{black_block_at, white_block_at};
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
            let mut tasks = 0;
            for (page, present) in plan.present.iter().enumerate() {
                let slots = page as u64 * per_page..(page as u64 + 1) * per_page;
                let points: Vec<GridPoint> = slots
                    .clone()
                    .filter_map(|s| point_of(k, s))
                    .filter(|p| grid.is_corner(*p) || !grid.is_beyond(*p, grid.level(*p)))
                    .collect();
                assert_eq!(*present, !points.is_empty(), "page {page} of {samples:?}");
                let task = plan.levels.iter().flat_map(|l| &l.pages).find(|t| t.page == page as u64);
                if let Some(task) = task {
                    let low = points.iter().map(|p| p.y()).min().unwrap();
                    let high = points.iter().map(|p| p.y()).max().unwrap();
                    assert!(task.y[0] <= low && task.y[1] >= high, "{task:?} {low} {high}");
                    tasks += points.len();
                }
            }
            let singles: usize = plan.levels.iter().map(|l| l.slots.len()).sum();
            let all = (0..slot_count(k))
                .filter_map(|s| point_of(k, s))
                .filter(|p| !grid.is_corner(*p) && !grid.is_beyond(*p, grid.level(*p)))
                .count();
            assert_eq!(tasks + singles, all);
        }
    }
}
