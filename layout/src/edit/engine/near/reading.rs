//! How the records come side by side: those of the finest four levels 16 at a time, as they lie in the file, the others one by one.
//!
//! Invariant: no page is read but for a record of the rectangle. Cost: some twenty instructions a record.

use super::{MARGIN, NEAR_LEVELS, Near, RIM, first_of_row};
use crate::edit::engine::pages::Pages;
use crate::edit::operations::window::SampleRect;
use crate::grid::order::{BlackAlong, FAMILY, STEPS, WhiteAlong, family, slot_of};
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};

/// Levels whose records are read by families.
const FAMILY_LEVELS: u32 = 4;
/// Steps between the points that belong to coarser levels.
const COARSER: u32 = 1 << (NEAR_LEVELS / 2);
/// Bytes of a line of the processor's caches.
const LINE_BYTES: usize = 64;

/// Sixteen vertices around another, whose records lie side by side.
#[derive(Debug, Clone, Copy)]
pub(super) struct Family {
    x: u32,
    y: u32,
    /// The first one's.
    slot: u64,
}

impl<C: RecordCodec> Near<C> {
    /// Reads the records of `rect` and of the samples around it.
    pub(crate) fn load(&mut self, grid: &Grid, rect: SampleRect, pages: &mut Pages<C>) {
        let around = rect.grown(MARGIN, grid);
        (self.west, self.south) = (around.west, around.south);
        (self.wide, self.high) = (around.wide(), around.high());
        // Every point gets its record below.
        self.raws.resize(self.row_length() * (self.high as usize + 2 * RIM), C::INERT);
        // Asked of memory all at once, then waited for.
        let of_families = grid.levels().saturating_sub(4);
        let mut families = std::mem::take(&mut self.families);
        families.clear();
        let mut ends = [0; NEAR_LEVELS as usize];
        for (level, end) in (0..of_families).zip(&mut ends) {
            self.list_families(grid, level, pages, &mut families);
            *end = families.len();
        }
        let mut start = 0;
        for (level, end) in (0..of_families.min(FAMILY_LEVELS)).zip(ends) {
            self.read_families(level, &families[start..end], pages);
            start = end;
        }
        self.read_coarse(grid, of_families.min(FAMILY_LEVELS), pages);
        self.families = families;
        self.samples.clear();
        self.samples.extend(self.raws.iter().map(|raw| C::height_value(*raw)));
        let (chunks, rest) = self.raws.as_chunks::<8>();
        let any_void = |raws: &[C::Raw]| raws.iter().fold(0, |any, raw| any | u32::from(C::is_void(*raw)));
        if any_void(rest) | chunks.iter().fold(0, |any, chunk| any | any_void(chunk)) != 0 {
            let voids = self.raws.iter().zip(&mut self.samples).filter(|(raw, _)| C::is_void(**raw));
            voids.for_each(|(_, sample)| *sample = f64::NAN);
        }
    }

    /// Lists the families of `level` that may have a vertex in the rectangle, and asks memory for their records, as far as their pages are here.
    fn list_families(&self, grid: &Grid, level: u32, pages: &Pages<C>, families: &mut Vec<Family>) {
        let (k, n, above) = (grid.k(), grid.side_steps(), level + 4);
        let (step, reach) = (1 << (above / 2), 3 << (level / 2));
        let (west, south) = (self.west.saturating_sub(reach), self.south.saturating_sub(reach));
        let (east, north) =
            ((self.west + self.wide - 1 + reach).min(n), (self.south + self.high - 1 + reach).min(n));
        for y in (south.next_multiple_of(step)..=north).step_by(step as usize) {
            let Some(first) = first_of_row(above, west, y) else { continue };
            let columns = (first..=east).step_by(2 * step as usize);
            let mut list = |(x, slot): (u32, u64)| {
                let slot = family(k, level, slot);
                for at in (0..FAMILY).step_by(LINE_BYTES / C::BYTES).chain([FAMILY - 1]) {
                    pages.prefetch(slot + at);
                }
                families.push(Family { x, y, slot });
            };
            if above & 1 == 1 {
                columns.zip(WhiteAlong::new(k, above, first, y)).for_each(&mut list);
            } else {
                columns.zip(BlackAlong::new(k, above, first, y)).for_each(&mut list);
            }
        }
    }

    /// Reads the records of families of `level`: all of a family whose page is here and that reaches no farther than the rim, and those in the rectangle of others.
    fn read_families(&mut self, level: u32, families: &[Family], pages: &mut Pages<C>) {
        let (row, t) = (self.row_length() as isize, level / 2);
        let steps = &STEPS[(level & 1) as usize];
        let offsets = steps.map(|[east, north]| ((east as isize) << t) + ((north as isize) << t) * row);
        // From the vertex that a family is of to the farthest of it, less the rim.
        let inwards = (3i32 << t) - RIM as i32;
        let [wide, high] = [self.wide as i32 - 1, self.high as i32 - 1];
        for Family { x, y, slot } in families.iter().copied() {
            // Below 0 where it lies outside.
            let [column, line] = [x as i32 - self.west as i32, y as i32 - self.south as i32];
            let fits = column.min(wide - column) >= inwards && line.min(high - line) >= inwards;
            if let (true, Some(records)) = (fits, pages.side_by_side(slot, FAMILY)) {
                let centre = (line as isize + RIM as isize) * row + column as isize + RIM as isize;
                for (offset, record) in offsets.iter().zip(records.chunks_exact(C::BYTES)) {
                    self.raws[(centre + offset) as usize] = C::read(record);
                }
                continue;
            }
            for ([east, north], slot) in steps.iter().zip(slot..) {
                let p = GridPoint::new(x.wrapping_add_signed(east << t), y.wrapping_add_signed(north << t));
                if self.holds(p, 0) {
                    let at = self.index(p.x(), p.y());
                    self.raws[at] = pages.raw(slot);
                }
            }
        }
    }

    /// Reads the records of `level` and all coarser ones.
    fn read_coarse(&mut self, grid: &Grid, level: u32, pages: &mut Pages<C>) {
        let k = grid.k();
        for level in level..NEAR_LEVELS.min(grid.levels()) {
            let step = 1 << (level / 2);
            for y in (self.south.next_multiple_of(step)..self.south + self.high).step_by(step as usize) {
                let Some(x) = first_of_row(level, self.west, y) else { continue };
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
            let slots = (first..).step_by(step as usize).map(|x| slot_of(k, GridPoint::new(x, y)));
            self.read_row(step, first, y, slots, pages);
        }
    }

    /// Reads the records of points `apart` steps from each other in a row from (`x`, `y`) on, whose slots are `along`.
    #[inline(always)]
    fn read_row(
        &mut self,
        apart: u32,
        x: u32,
        y: u32,
        along: impl Iterator<Item = u64>,
        pages: &mut Pages<C>,
    ) {
        let columns = (x..self.west + self.wide).step_by(apart as usize);
        for (x, slot) in columns.zip(along) {
            let at = self.index(x, y);
            self.raws[at] = pages.raw(slot);
        }
    }
}
