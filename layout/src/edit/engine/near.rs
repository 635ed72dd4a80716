//! The records of the eight finest levels around a changed rectangle, side by side as on the ground.
//!
//! Nearly all that an edit changes are vertices of these levels, each of which looks at a dozen others close by. Read once into rows, they are neighbours in memory,
//! and samples can be compared with a plane row by row, as a build does.
//!
//! Invariant: what is written to the pages inside the rectangle is written here as well.

mod reading;

use crate::bound::Plane;
use crate::edit::operations::window::SampleRect;
use crate::grid::GridPoint;
use crate::grid::record::RecordCodec;

/// Levels that are done here.
pub(crate) const NEAR_LEVELS: u32 = 8;
/// Steps around the changed rectangle: a diamond of the coarsest of these levels that touches it reaches twice its step, and so do its children.
pub(crate) const MARGIN: u32 = 16;
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
        Self { west: 0, south: 0, wide: 0, high: 0, raws: Vec::new(), samples: Vec::new(), slots: Vec::new() }
    }
}

impl<C: RecordCodec> Near<C> {
    /// Height codes of row `y` from column `west` to `east`, all in the rectangle; NaN for voids.
    #[inline(always)]
    pub(crate) fn samples_of_row(&self, y: u32, west: u32, east: u32) -> &[f64] {
        &self.samples[self.index(west, y)..=self.index(east, y)]
    }

    /// Gives samples new height codes, those of `rect` row by row; NaN leaves one as it is.
    pub(crate) fn set(&mut self, rect: SampleRect, codes: &[f64]) {
        for (y, row) in (rect.south..=rect.north).zip(codes.chunks_exact(rect.wide() as usize)) {
            let at = self.index(rect.west, y);
            for (sample, code) in self.samples[at..at + row.len()].iter_mut().zip(row) {
                *sample = if code.is_nan() { *sample } else { *code };
            }
        }
    }

    /// Index of a column and row within the rectangle.
    #[inline(always)]
    fn place(&self, x: usize, y: usize) -> usize {
        y * self.row_length() + x
    }

    /// Index of a grid point of the rectangle.
    #[inline(always)]
    pub(crate) fn index(&self, x: u32, y: u32) -> usize {
        self.place((x - self.west) as usize, (y - self.south) as usize)
    }

    /// Places a row.
    #[inline(always)]
    pub(crate) fn row_length(&self) -> usize {
        self.wide as usize
    }

    #[inline(always)]
    pub(crate) fn slot(&self, at: usize) -> u64 {
        self.slots[at]
    }

    #[inline(always)]
    pub(crate) fn raw(&self, at: usize) -> C::Raw {
        self.raws[at]
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
            let at = self.place(x as usize, y as usize);
            self.raws[at] = raw;
        }
    }

    /// Notes a record that was written, by its index.
    #[inline(always)]
    pub(crate) fn set_raw(&mut self, at: usize, raw: C::Raw) {
        self.raws[at] = raw;
    }

    /// Column and row of a grid point within the rectangle.
    #[inline(always)]
    pub(crate) fn within(&self, p: GridPoint) -> [u32; 2] {
        [p.x() - self.west, p.y() - self.south]
    }

    /// Largest distance from `plane` over columns `from..=to` of row `y`, counted within the rectangle and all in it.
    #[inline(always)]
    pub(crate) fn row(&self, plane: &Plane, from: u32, to: u32, y: u32) -> f64 {
        let row = &self.samples[self.place(from as usize, y as usize)..=self.place(to as usize, y as usize)];
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
