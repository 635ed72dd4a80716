//! The records of the eight finest levels around a changed rectangle, side by side as on the ground.
//!
//! Nearly all that an edit changes are vertices of these levels, each of which looks at a dozen others close by. Read once into rows, they are neighbours in memory,
//! and samples can be compared with a plane row by row, as a build does.
//!
//! Invariant: what is written to the pages inside the rectangle is written here as well.

use super::pages::Pages;
use crate::bound::Plane;
use crate::edit::operations::window::SampleRect;
use crate::grid::order::{BlackAlong, WhiteAlong, level_slots, slot_of};
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};

/// Levels that are done here.
pub(crate) const NEAR_LEVELS: u32 = 8;
/// Steps around the changed rectangle: a diamond of the coarsest of these levels that touches it reaches twice its step, and so do its children.
pub(crate) const MARGIN: u32 = 16;
/// Steps between the points that belong to coarser levels.
const COARSER: u32 = 1 << (NEAR_LEVELS / 2);

/// Bytes of a line of the processor's caches.
const LINE_BYTES: usize = 64;

/// Records of a rectangle of samples, padding left out.
#[derive(Debug)]
pub(crate) struct Near<C: RecordCodec> {
    west: u32,
    south: u32,
    wide: u32,
    high: u32,
    /// Records, row by row from the south.
    raws: Vec<C::Raw>,
    /// Slots of these records.
    slots: Vec<u64>,
    /// Height codes; NaN for voids.
    samples: Vec<f64>,
}

impl<C: RecordCodec> Default for Near<C> {
    fn default() -> Self {
        Self { west: 0, south: 0, wide: 0, high: 0, raws: Vec::new(), slots: Vec::new(), samples: Vec::new() }
    }
}

impl<C: RecordCodec> Near<C> {
    /// Reads the records of `rect` and of the samples around it.
    pub(crate) fn load(&mut self, grid: &Grid, rect: SampleRect, pages: &mut Pages<C>) {
        let around = rect.grown(MARGIN, grid);
        (self.west, self.south) = (around.west, around.south);
        (self.wide, self.high) = (around.wide(), around.high());
        let count = self.row_length() * self.high as usize;
        // Every point gets its slot and record below.
        self.slots.resize(count, 0);
        self.raws.resize(count, C::INERT);
        self.ask(grid, pages);
        for level in 0..NEAR_LEVELS.min(grid.levels()) {
            let step = 1 << (level / 2);
            for y in (self.south.next_multiple_of(step)..self.south + self.high).step_by(step as usize) {
                let Some(x) = first_of_row(level, self.west, y) else { continue };
                if level & 1 == 1 {
                    self.read_row(step, x, y, WhiteAlong::new(grid.k(), level, x, y), pages);
                } else {
                    self.read_row(step, x, y, BlackAlong::new(grid.k(), level, x, y), pages);
                }
            }
        }
        let step = COARSER.min(grid.side_steps());
        for y in (self.south.next_multiple_of(step)..self.south + self.high).step_by(step as usize) {
            for x in (self.west.next_multiple_of(step)..self.west + self.wide).step_by(step as usize) {
                let (at, slot) = (self.index(x, y), slot_of(grid.k(), GridPoint::new(x, y)));
                self.slots[at] = slot;
                self.raws[at] = pages.raw(slot);
            }
        }
        self.samples.clear();
        self.samples.extend(self.raws.iter().map(|raw| C::height_value(*raw)));
        if self.raws.iter().fold(false, |any, raw| any | C::is_void(*raw)) {
            let voids = self.raws.iter().zip(&mut self.samples).filter(|(raw, _)| C::is_void(**raw));
            voids.for_each(|(_, sample)| *sample = f64::NAN);
        }
    }

    /// Reads the records of a row of a level from (`x`, `y`) on, whose slots are `along`.
    #[inline(always)]
    fn read_row(
        &mut self,
        step: u32,
        x: u32,
        y: u32,
        along: impl Iterator<Item = u64>,
        pages: &mut Pages<C>,
    ) {
        if x >= self.west + self.wide {
            return;
        }
        let (mut at, end) = (self.index(x, y), self.index(self.west, y) + self.row_length());
        let (slots, raws) = (&mut self.slots[..end], &mut self.raws[..end]);
        for slot in along {
            if at >= end {
                break;
            }
            slots[at] = slot;
            raws[at] = pages.raw(slot);
            at += 2 * step as usize;
        }
    }

    /// Asks memory for all records at once, as far as their pages are here. Of slots side by side 16 are of one vertex four levels up.
    fn ask(&self, grid: &Grid, pages: &Pages<C>) {
        let n = grid.side_steps();
        for level in 0..NEAR_LEVELS.min(grid.levels().saturating_sub(4)) {
            let above = level + 4;
            let (start, above_start) =
                (level_slots(grid.k(), level).start, level_slots(grid.k(), above).start);
            let step = 1 << (above / 2);
            let (west, south) = (self.west.saturating_sub(step), self.south.saturating_sub(step));
            let (east, north) =
                ((self.west + self.wide + step).min(n), (self.south + self.high + step).min(n));
            for y in (south.next_multiple_of(step)..=north).step_by(step as usize) {
                let Some(x) = first_of_row(above, west, y).filter(|x| *x <= east) else { continue };
                let count = ((east - x) / (2 * step) + 1) as usize;
                let ask = |slot: u64| {
                    let first = start + 16 * (slot - above_start);
                    for at in (0..16).step_by(LINE_BYTES / C::BYTES).chain([15]) {
                        pages.prefetch(first + at);
                    }
                };
                if above & 1 == 1 {
                    WhiteAlong::new(grid.k(), above, x, y).take(count).for_each(ask);
                } else {
                    BlackAlong::new(grid.k(), above, x, y).take(count).for_each(ask);
                }
            }
        }
    }

    /// Height code of a sample of the rectangle; NaN for voids.
    #[inline(always)]
    pub(crate) fn sample(&self, x: u32, y: u32) -> f64 {
        self.samples[self.index(x, y)]
    }

    /// Gives samples new height codes, those of `rect` row by row; NaN leaves one as it is.
    pub(crate) fn set(&mut self, rect: SampleRect, codes: &[f64]) {
        for (y, row) in (rect.south..=rect.north).zip(codes.chunks_exact(rect.wide() as usize)) {
            let at = self.index(rect.west, y);
            for (i, code) in row.iter().enumerate().filter(|(_, code)| !code.is_nan()) {
                self.samples[at + i] = *code;
            }
        }
    }

    /// Index of a grid point of the rectangle.
    #[inline(always)]
    pub(crate) fn index(&self, x: u32, y: u32) -> usize {
        (y - self.south) as usize * self.wide as usize + (x - self.west) as usize
    }

    /// Points a row.
    #[inline(always)]
    pub(crate) fn row_length(&self) -> usize {
        self.wide as usize
    }

    #[inline(always)]
    pub(crate) fn raw(&self, at: usize) -> C::Raw {
        self.raws[at]
    }

    #[inline(always)]
    pub(crate) fn slot(&self, at: usize) -> u64 {
        self.slots[at]
    }

    /// Height code at an index; that of a void is what its record says.
    #[inline(always)]
    pub(crate) fn value(&self, at: usize) -> f64 {
        let code = self.samples[at];
        if code.is_nan() { C::height_value(self.raws[at]) } else { code }
    }

    /// Notes a record that was written, if it lies here.
    pub(crate) fn note(&mut self, p: GridPoint, raw: C::Raw) {
        let (x, y) = (p.x().wrapping_sub(self.west), p.y().wrapping_sub(self.south));
        if x < self.wide && y < self.high {
            self.raws[y as usize * self.wide as usize + x as usize] = raw;
        }
    }

    /// Column and row of a grid point within the rectangle.
    #[inline(always)]
    pub(crate) fn within(&self, p: GridPoint) -> [u32; 2] {
        [p.x() - self.west, p.y() - self.south]
    }

    /// Largest distance from `plane` over columns `from..=to` of row `y`, counted within the rectangle and all in it.
    #[inline(always)]
    pub(crate) fn row(&self, plane: &Plane, from: u32, to: u32, y: u32) -> f64 {
        let at = y as usize * self.wide as usize;
        let row = &self.samples[at + from as usize..=at + to as usize];
        plane.farthest_in_row(self.west + from, self.south + y, row)
    }

    /// Height codes, row by row from the south; NaN for voids.
    #[inline(always)]
    pub(crate) fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// Whether it holds a grid point and `around` steps on all sides of it.
    pub(crate) fn holds(&self, p: GridPoint, around: u32) -> bool {
        let is_within = |v: u32, low: u32, count: u32| v >= low + around && v + around < low + count;
        is_within(p.x(), self.west, self.wide) && is_within(p.y(), self.south, self.high)
    }
}

/// Column of the first vertex of `level` at or east of `west` in row `y`; `None` if the row has none.
#[inline(always)]
pub(crate) fn first_of_row(level: u32, west: u32, y: u32) -> Option<u32> {
    let (t, is_white) = (level / 2, level & 1 == 1);
    let row = y >> t;
    // White vertices lie at odd multiples of the step both ways, black ones where one is odd and one even.
    if y & ((1 << t) - 1) != 0 || (is_white && row & 1 == 0) {
        return None;
    }
    let is_odd = u32::from(is_white || row & 1 == 0);
    let column = (west + (1 << t) - 1) >> t;
    Some((column + ((column & 1) ^ is_odd)) << t)
}
