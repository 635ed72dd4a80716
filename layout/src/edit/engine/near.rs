//! The records of the six finest levels around a changed rectangle, side by side as on the ground.
//!
//! Nearly all that an edit changes are vertices of these levels, each of which looks at a dozen others close by. Read once into rows, they are neighbours in memory,
//! and samples can be compared with a plane row by row, as a build does.
//!
//! Invariant: what is written to the pages inside the rectangle is written here as well.

use super::pages::Pages;
use crate::bound::{Plane, Samples};
use crate::edit::operations::window::SampleRect;
use crate::grid::order::{RowSlots, slot_of};
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};

/// Levels that are done here.
pub(crate) const NEAR_LEVELS: u32 = 6;
/// Steps around the changed rectangle: a diamond of the coarsest of these levels that touches it reaches twice its step, and so do its children.
pub(crate) const MARGIN: u32 = 8;
/// Steps between the points that belong to coarser levels.
const COARSER: u32 = 1 << (NEAR_LEVELS / 2);

/// Bytes of a line of the processor's caches.
const LINE_BYTES: u64 = 64;

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
    /// Height codes; those of voids are what their records say.
    values: Vec<f64>,
    /// Height codes; NaN for voids.
    samples: Vec<f64>,
}

impl<C: RecordCodec> Default for Near<C> {
    fn default() -> Self {
        Self {
            west: 0,
            south: 0,
            wide: 0,
            high: 0,
            raws: Vec::new(),
            slots: Vec::new(),
            values: Vec::new(),
            samples: Vec::new(),
        }
    }
}

impl<C: RecordCodec> Near<C> {
    /// Reads the records of `rect` and of the samples around it.
    pub(crate) fn load(&mut self, grid: &Grid, rect: SampleRect, pages: &mut Pages<C>) {
        let around = rect.grown(MARGIN, grid);
        (self.west, self.south) = (around.west, around.south);
        (self.wide, self.high) = (around.wide(), around.high());
        self.list_slots(grid);
        // Asked of memory all at once, then waited for.
        let mut line = u64::MAX;
        for slot in &self.slots {
            let here = slot * C::BYTES as u64 / LINE_BYTES;
            if here != line {
                pages.prefetch(*slot);
                line = here;
            }
        }
        self.raws.clear();
        self.raws.extend(self.slots.iter().map(|slot| pages.raw(*slot)));
        self.values.clear();
        self.values.extend(self.raws.iter().map(|raw| C::height_value(*raw)));
        self.samples.clear();
        let known = self.raws.iter().zip(&self.values);
        self.samples.extend(known.map(|(raw, value)| if C::is_void(*raw) { f64::NAN } else { *value }));
    }

    /// Fills in the slots of the rectangle, a level at a time.
    fn list_slots(&mut self, grid: &Grid) {
        self.slots.clear();
        self.slots.resize(self.wide as usize * self.high as usize, 0);
        let n = grid.side_steps();
        for level in 0..NEAR_LEVELS.min(grid.levels()) {
            for y in self.south..self.south + self.high {
                let Some(first) = first_of_row(level, self.west, y) else { continue };
                let row = RowSlots::new(grid.k(), level, y);
                for x in (first..self.west + self.wide).step_by(2 << (level / 2)) {
                    let at = self.index(x, y);
                    self.slots[at] = row.slot(x);
                }
            }
        }
        let step = COARSER.min(n);
        for y in (self.south.next_multiple_of(step)..self.south + self.high).step_by(step as usize) {
            for x in (self.west.next_multiple_of(step)..self.west + self.wide).step_by(step as usize) {
                let at = self.index(x, y);
                self.slots[at] = slot_of(grid.k(), GridPoint::new(x, y));
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
                self.values[at + i] = *code;
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

    /// Height code at an index.
    #[inline(always)]
    pub(crate) fn value(&self, at: usize) -> f64 {
        self.values[at]
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
}

impl<C: RecordCodec> Samples for Near<C> {
    #[inline(always)]
    fn corner(&self, x: u32, y: u32) -> (GridPoint, f64) {
        let p = GridPoint::new(self.west.wrapping_add(x), self.south.wrapping_add(y));
        let is_here = x < self.wide && y < self.high;
        let code =
            if is_here { self.samples[y as usize * self.wide as usize + x as usize] } else { f64::NAN };
        (p, code)
    }

    #[inline(always)]
    fn row(&self, plane: &Plane, from: u32, to: u32, y: u32) -> f64 {
        let at = y as usize * self.wide as usize;
        let row = &self.samples[at + from as usize..=at + to as usize];
        plane.farthest_in_row(self.west + from, self.south + y, row)
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
