//! How the records come side by side: row by row of each level, whose slots follow from one another.
//!
//! Cost: some thirty instructions a record, and the wait for memory, which is asked for all records at once.

use super::{NEAR_LEVELS, Near, first_of_row};
use crate::edit::engine::pages::Pages;
use crate::edit::operations::window::SampleRect;
use crate::grid::order::{BlackAlong, FAMILY, WhiteAlong, family, slot_of};
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};
use crate::read::store::{byte_in_page, page_of};

/// Steps between the points that belong to coarser levels.
const COARSER: u32 = 1 << (NEAR_LEVELS / 2);

impl<C: RecordCodec> Near<C> {
    /// Reads the records of `rect` and of the samples around it, at least `margin` on each side.
    pub(crate) fn load(&mut self, grid: &Grid, rect: SampleRect, margin: u32, pages: &mut Pages<C>) {
        let around = looked_at(grid, rect, margin);
        ask(grid, around, pages);
        (self.west, self.south) = (around.west, around.south);
        (self.wide, self.high) = (around.wide(), around.high());
        // Every point gets its slot and record below.
        let count = self.row_length() * self.high as usize;
        self.slots.resize(count, 0);
        self.raws.resize(count, C::INERT);
        let k = grid.k();
        for level in 0..NEAR_LEVELS.min(grid.levels()) {
            let step = 1 << (level / 2);
            for y in (self.south.next_multiple_of(step)..self.south + self.high).step_by(step as usize) {
                let Some(x) = first_of_row(level, self.west, y).filter(|x| *x < self.west + self.wide) else {
                    continue;
                };
                if level & 1 == 1 {
                    self.read_row(2 * step, x, y, WhiteAlong::new(k, level, x, y), pages);
                } else {
                    self.read_row(2 * step, x, y, BlackAlong::new(k, level, x, y), pages);
                }
            }
        }
        let step = COARSER.min(grid.side_steps());
        for y in (self.south.next_multiple_of(step)..self.south + self.high).step_by(step as usize) {
            let first = self.west.next_multiple_of(step);
            if first >= self.west + self.wide {
                break;
            }
            let slots = (first..).step_by(step as usize).map(|x| slot_of(k, GridPoint::new(x, y)));
            self.read_row(step, first, y, slots, pages);
        }
        self.samples.clear();
        self.samples.extend(self.raws.iter().map(|raw| C::height_value(*raw)));
        if pages.has_voids() {
            let voids = self.raws.iter().zip(&mut self.samples).filter(|(raw, _)| C::is_void(**raw));
            voids.for_each(|(_, sample)| *sample = f64::NAN);
        }
    }

    /// Reads the records of points `apart` steps from each other in a row from (`x`, `y`) on, whose slots are `along`.
    #[inline(always)]
    fn read_row(
        &mut self,
        apart: u32,
        x: u32,
        y: u32,
        mut along: impl Iterator<Item = u64>,
        pages: &mut Pages<C>,
    ) {
        let (mut at, end) = (self.index(x, y), self.index(self.west, y) + self.row_length());
        let (slots, raws) = (&mut self.slots[..end], &mut self.raws[..end]);
        // What lies beyond the row is not asked for: it may lie beyond the square.
        if at >= end {
            return;
        }
        let Some(mut slot) = along.next() else { return };
        loop {
            // Slots of a row stay in a page for long.
            let logical = page_of::<C>(slot);
            let page = pages.page_at(slot);
            while page_of::<C>(slot) == logical {
                let within = byte_in_page::<C>(slot);
                slots[at] = slot;
                raws[at] = C::read(&page[within..within + C::BYTES]);
                at += apart as usize;
                if at >= end {
                    return;
                }
                match along.next() {
                    Some(next) => slot = next,
                    None => return,
                }
            }
        }
    }
}

/// What the vertices of these levels look at whose diamonds touch `rect`, and at least `margin` samples on each side.
#[inline(always)]
fn looked_at(grid: &Grid, rect: SampleRect, margin: u32) -> SampleRect {
    // A vertex of the coarsest of these levels lies at a multiple of its step, at most one step away, and looks one step farther. Those of finer levels look less far.
    let step = COARSER / 2;
    let ([wide, high], around) = (grid.samples(), rect.grown(margin, grid));
    let before = |v: u32| v.next_multiple_of(step).saturating_sub(2 * step);
    let behind = |v: u32| v / step * step + 2 * step;
    SampleRect {
        west: around.west.min(before(rect.west)),
        south: around.south.min(before(rect.south)),
        east: around.east.max(behind(rect.east)).min(wide - 1),
        north: around.north.max(behind(rect.north)).min(high - 1),
    }
}

/// Asks memory for the records of a rectangle, as far as their pages are here: family by family.
#[inline(always)]
fn ask<C: RecordCodec>(grid: &Grid, rect: SampleRect, pages: &Pages<C>) {
    let (k, n) = (grid.k(), grid.side_steps());
    for level in 0..NEAR_LEVELS.min(grid.levels().saturating_sub(4)) {
        let above = level + 4;
        // To the farthest vertices of a family.
        let (step, reach) = (1 << (above / 2), 3 << (level / 2));
        let (west, south) = (rect.west.saturating_sub(reach), rect.south.saturating_sub(reach));
        let (east, north) = ((rect.east + reach).min(n), (rect.north + reach).min(n));
        let ask = |slot: u64| pages.prefetch_row(family(k, level, slot), FAMILY);
        for y in (south.next_multiple_of(step)..=north).step_by(step as usize) {
            let Some(first) = first_of_row(above, west, y).filter(|first| *first <= east) else { continue };
            let count = ((east - first) / (2 * step) + 1) as usize;
            if above & 1 == 1 {
                WhiteAlong::new(k, above, first, y).take(count).for_each(ask);
            } else {
                BlackAlong::new(k, above, first, y).take(count).for_each(ask);
            }
        }
    }
}
