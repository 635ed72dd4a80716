//! Which record pages the file will have, where each will lie, and when its last record is known.
//!
//! A level's slots are cut into blocks of the quadtree, whose rows lie close together, and blocks at page borders: a page is made of parts.
//! Presence follows from the grid and from where there are heights: a page is planned if one of its slots holds a vertex that is not beyond the data, in a block near heights.
//! Pages that turn out to be all void are taken out at the end. Cost: a few blocks a part, single slots only along the data's outline; nothing for oceans.

use super::land::Land;
use super::levels::LevelShape;
use crate::file::entries::{ENTRIES_PER_LEAF, Entry};
use crate::grid::Grid;
use crate::grid::order::{BLOCK_SLOTS, level_slots, point_of};
use rayon::prelude::*;
use std::collections::BTreeMap;

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

/// Pages that one leaf of the directory leads to.
#[derive(Debug, Clone)]
pub(super) struct PlannedLeaf {
    /// Parts of each page; one without any is absent.
    pub(super) parts: [u8; ENTRIES_PER_LEAF],
    /// Place of each page.
    pub(super) entries: [Entry; ENTRIES_PER_LEAF],
}

/// The whole file's plan.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) levels: Vec<LevelPlan>,
    /// Leaves of the directory with planned pages, by number.
    pub(super) leaves: BTreeMap<u64, Box<PlannedLeaf>>,
}

/// Leaf of a logical page, and its place there.
pub(super) fn place_of(page: u64) -> (u64, usize) {
    let per_leaf = ENTRIES_PER_LEAF as u64;
    (page / per_leaf, (page % per_leaf) as usize)
}

impl Plan {
    pub(super) fn new(grid: &Grid, land: &Land, records_per_page: u64) -> Self {
        let k = grid.k();
        let mut leaves = BTreeMap::new();
        let mut add = |page: u64| {
            let (leaf, within) = place_of(page);
            let leaf: &mut Box<PlannedLeaf> = leaves.entry(leaf).or_insert_with(|| {
                Box::new(PlannedLeaf {
                    parts: [0; ENTRIES_PER_LEAF],
                    entries: [Entry::default(); ENTRIES_PER_LEAF],
                })
            });
            leaf.parts[within] += 1;
        };
        // The corners.
        add(0);
        let mut levels = Vec::new();
        for level in 0..grid.levels() {
            let shape = LevelShape::new(grid, level);
            let slots = level_slots(k, level);
            let mut level_parts: Vec<PagePart> = blocks_near(k, &shape, land)
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
            level_parts.iter().for_each(|part| add(part.first() / records_per_page));
            let span = level_parts.iter().map(|p| p.y[1] - p.y[0]).max().unwrap_or(0);
            levels.push(LevelPlan { parts: level_parts, span });
        }
        Self { levels, leaves }
    }
}

/// Blocks of [`BLOCK_SLOTS`] slots of a level, by number, that may hold records that are not inert: those near heights. The quadtree of blocks is followed from the top, so what is
/// far from all heights costs nothing.
fn blocks_near(k: u32, shape: &LevelShape, land: &Land) -> Vec<u64> {
    const BLOCK_ORDER: u32 = BLOCK_SLOTS.ilog2() / 2;
    let slots = level_slots(k, shape.level());
    let top = (slots.end - slots.start).ilog2() / 2;
    let mut blocks = Vec::new();
    let mut waiting = vec![(0, top.max(BLOCK_ORDER))];
    while let Some((offset, order)) = waiting.pop() {
        // Levels smaller than a block have one, which may hold anything.
        if top >= BLOCK_ORDER && !is_near(k, shape, land, offset, order) {
            continue;
        }
        if order == BLOCK_ORDER {
            blocks.push(offset / BLOCK_SLOTS);
        } else {
            waiting.extend((0..4).map(|quarter| (offset + (quarter << (2 * (order - 1))), order - 1)));
        }
    }
    blocks
}

/// Whether vertices of the quadtree block of 4^order slots may have heights below them.
fn is_near(k: u32, shape: &LevelShape, land: &Land, offset: u64, order: u32) -> bool {
    let reach = i64::from(shape.reach());
    let mut clipped = [[0; 2]; 2];
    for ((place, [from, to]), limit) in
        clipped.iter_mut().zip(block_bounds(k, shape, offset, order)).zip(shape.limit())
    {
        if to < 0 || from > i64::from(limit) {
            return false;
        }
        *place = [from - reach, to + reach].map(|v| v.clamp(0, i64::from(limit)) as u32);
    }
    land.touches(clipped[0], clipped[1])
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
    use crate::grid::order::{slot_count, slot_of};

    /// Against every slot looked at one by one.
    #[test]
    fn the_plan_matches_the_slots() {
        for (samples, per_page) in
            [([65, 65], 16), ([40, 65], 64), ([64, 33], 16), ([33, 2], 16), ([20, 20], 1024)]
        {
            let grid = Grid::new(samples, [1.0, 1.0]).unwrap();
            let k = grid.k();
            let plan = Plan::new(&grid, &Land::in_windows(samples, None), per_page);
            let mut planned = 4;
            let mut seen = BTreeMap::from([(0, 1)]);
            for part in plan.levels.iter().flat_map(|l| &l.parts) {
                *seen.entry(part.first() / per_page).or_insert(0) += 1;
                assert_eq!(part.first() / per_page, (part.first() + part.count() - 1) / per_page);
                let rows: Vec<u32> = (part.first()..part.first() + part.count())
                    .filter_map(|s| point_of(k, s))
                    .filter(|p| !grid.is_beyond(*p, grid.level(*p)))
                    .map(GridPoint::y)
                    .collect();
                assert!(rows.iter().all(|y| (part.y[0]..=part.y[1]).contains(y)) && !rows.is_empty());
                planned += rows.len();
            }
            assert_eq!(seen, counts(&plan));
            let all = (0..slot_count(k))
                .filter_map(|s| point_of(k, s))
                .filter(|p| grid.is_corner(*p) || !grid.is_beyond(*p, grid.level(*p)))
                .count();
            assert_eq!(planned, all);
        }
    }

    fn counts(plan: &Plan) -> BTreeMap<u64, u8> {
        let pages = plan.leaves.iter().flat_map(|(leaf, of_leaf)| (256 * leaf..).zip(of_leaf.parts));
        pages.filter(|(_, parts)| *parts > 0).collect()
    }

    /// Every vertex that has a sample of an island among its descendants, or is one, found from the islands' samples up, is planned; of the ocean next to nothing is.
    #[test]
    fn what_lies_over_heights_is_planned() {
        let samples = [1025, 900];
        let grid = Grid::new(samples, [1.0, 1.0]).unwrap();
        let k = grid.k();
        let land = Land::none(samples);
        let islands = [[30, 40], [600, 41], [601, 700], [1024, 899], [0, 899], [512, 512]];
        islands.iter().for_each(|[x, y]| land.mark(*x..*x + 1, *y));
        let plan = Plan::new(&grid, &land, 16);
        let planned: Vec<std::ops::Range<u64>> = plan
            .levels
            .iter()
            .flat_map(|level| &level.parts)
            .map(|part| part.first()..part.first() + part.count())
            .collect();
        let mut alive: Vec<GridPoint> = Vec::new();
        let n = grid.side_steps();
        let images = |v: u32, count: u32| v..if v + 1 == count { n + 1 } else { v + 1 };
        for [x, y] in islands {
            let at =
                images(y, samples[1]).flat_map(|y| images(x, samples[0]).map(move |x| GridPoint::new(x, y)));
            alive.extend(at.filter(|p| !grid.is_corner(*p) && !grid.is_beyond(*p, grid.level(*p))));
        }
        let mut seen = std::collections::BTreeSet::new();
        while let Some(p) = alive.pop() {
            if seen.insert(p.packed()) {
                let slot = slot_of(k, p);
                assert!(planned.iter().any(|slots| slots.contains(&slot)), "{p:?}");
                // Parents are the apexes of the triangles that a vertex splits.
                alive.extend(grid.apexes(p).filter(|p| !grid.is_corner(*p)));
            }
        }
        assert!(seen.len() > 100);
        let slots: u64 = planned.iter().map(|slots| slots.end - slots.start).sum();
        assert!(slots < slot_count(k) * 3 / 4, "{slots}");
    }
}
