//! Heights and records as they are in the middle of an update: new heights where there are any, else those of the records.

use super::pages::Pages;
use crate::edit::operations::window::SampleRect;
use crate::grid::order::slot_of;
use crate::grid::record::RecordCodec;
use crate::grid::{Grid, GridPoint};

/// New height codes of a rectangle of samples.
#[derive(Debug)]
pub(crate) struct NewCodes<'u> {
    /// Where something changed.
    pub(crate) rect: SampleRect,
    /// Codes, rows from the south; NaN for voids, whose records keep what they say.
    pub(crate) codes: &'u [f64],
    /// Codes before.
    pub(crate) old_codes: &'u [f64],
    /// Lowest and highest code before and after.
    pub(crate) ranges: [[f64; 2]; 2],
}

impl NewCodes<'_> {
    /// The new code of a data sample; `None` outside the rectangle and for voids.
    #[inline(always)]
    pub(crate) fn get(&self, q: GridPoint) -> Option<f64> {
        let rect = &self.rect;
        let (x, y) = (q.x().wrapping_sub(rect.west), q.y().wrapping_sub(rect.south));
        if x >= rect.wide() || y >= rect.high() {
            return None;
        }
        let code = self.codes[y as usize * rect.wide() as usize + x as usize];
        (!code.is_nan()).then_some(code)
    }

    /// Whether a data sample has another code than before.
    #[inline(always)]
    pub(crate) fn is_moved(&self, q: GridPoint) -> bool {
        let rect = &self.rect;
        let (x, y) = (q.x().wrapping_sub(rect.west), q.y().wrapping_sub(rect.south));
        if x >= rect.wide() || y >= rect.high() {
            return false;
        }
        let at = y as usize * rect.wide() as usize + x as usize;
        // Voids differ from everything, and stay.
        self.old_codes[at] != self.codes[at] && !self.codes[at].is_nan()
    }
}

/// What an update reads.
pub(crate) struct Ground<'u, C: RecordCodec> {
    pub(crate) grid: Grid,
    pub(crate) pages: &'u mut Pages<C>,
    pub(crate) new: NewCodes<'u>,
}

impl<C: RecordCodec> Ground<'_, C> {
    /// Height code of a grid point whose record is `raw`.
    #[inline(always)]
    pub(crate) fn code_of(&self, p: GridPoint, raw: C::Raw) -> f64 {
        self.new.get(self.grid.fold(p)).unwrap_or_else(|| C::height_value(raw))
    }

    /// Height code of a grid point.
    #[inline(always)]
    pub(crate) fn code(&mut self, p: GridPoint) -> f64 {
        match self.new.get(self.grid.fold(p)) {
            Some(code) => code,
            None => C::height_value(self.pages.raw(slot_of(self.grid.k(), p))),
        }
    }

    /// Height code of a grid point; NaN for a void.
    pub(crate) fn code_unless_void(&mut self, p: GridPoint) -> f64 {
        match self.new.get(self.grid.fold(p)) {
            Some(code) => code,
            None => {
                let raw = self.pages.raw(slot_of(self.grid.k(), p));
                if C::is_void(raw) { f64::NAN } else { C::height_value(raw) }
            }
        }
    }
}
