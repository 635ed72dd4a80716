//! The rows of height codes the build is working on: a window that slides north over the terrain.

use super::codes::{Row, RowReader};
use super::levels::Piece;
use super::spool::Spool;
use crate::error::LayoutError;
use crate::grid::{Grid, GridPoint};
use std::borrow::Cow;
use std::collections::VecDeque;

/// Code to fill a void with, given its column and row; `None` where no vertex will say it.
pub(super) type Fills<'f> = dyn Fn(u32, u32) -> Option<f64> + Sync + 'f;

/// Height codes of rows `first..first + rows.len()`, and of every `coarse_step`-th sample of all rows read so far.
pub(super) struct Band<'f> {
    grid: Grid,
    /// Heights to fill voids with, other than those that the samples around them suggest.
    fills: Option<&'f Fills<'f>>,
    first: u32,
    rows: VecDeque<Row>,
    coarse_step: u32,
    coarse: Vec<Option<Row>>,
}

impl<'f> Band<'f> {
    /// An empty window that will keep every `coarse_step`-th sample for good.
    pub(super) fn new(grid: Grid, coarse_step: u32, fills: Option<&'f Fills<'f>>) -> Self {
        // Rows of the data on the coarse grid, and one for the data's far border.
        let coarse_rows = (grid.samples()[1] - 1).div_ceil(coarse_step) as usize + 1;
        Self { grid, fills, first: 0, rows: VecDeque::new(), coarse_step, coarse: vec![None; coarse_rows] }
    }

    /// Reads the coarse samples of all rows ahead of the window, so that triangles larger than it have their corners.
    pub(super) fn preload_coarse(
        &mut self,
        mut reader: RowReader<'_>,
        spool: &Spool<'_>,
    ) -> Result<(), LayoutError> {
        let high = self.grid.samples()[1];
        // Void rows have no corners, and get their codes when the window comes there.
        for y in (0..high).step_by(self.coarse_step as usize).chain([high - 1]) {
            if !spool.is_void_row(y) {
                self.keep_coarse(y, &reader.row(y)?);
            }
        }
        Ok(())
    }

    /// Code of a coarse sample that is not void.
    pub(super) fn coarse_code(&self, p: GridPoint) -> Option<f64> {
        self.coarse_at(self.grid.fold(p)).filter(|(_, is_void)| !is_void).map(|(code, _)| code)
    }

    /// Rows read so far.
    pub(super) fn rows_read(&self) -> u32 {
        self.first + self.rows.len() as u32
    }

    /// Adds the rows north of those in the window.
    pub(super) fn push(&mut self, rows: Vec<Row>) {
        for row in rows {
            self.keep_coarse(self.rows_read(), &row);
            self.rows.push_back(row);
        }
    }

    fn keep_coarse(&mut self, y: u32, row: &Row) {
        let [wide, high] = self.grid.samples();
        if y.is_multiple_of(self.coarse_step) || y == high - 1 {
            self.coarse[y.div_ceil(self.coarse_step) as usize] = Some(row.thinned(wide, self.coarse_step));
        }
    }

    /// Forgets rows south of `row`.
    pub(super) fn drop_below(&mut self, row: u32) {
        while self.first < row && self.rows.len() > 1 {
            self.rows.pop_front();
            self.first += 1;
        }
    }

    /// Row `y`, if it is in the window.
    #[inline(always)]
    fn find(&self, y: u32) -> Option<&Row> {
        self.rows.get(y.checked_sub(self.first)? as usize)
    }

    /// Row `y` of codes, if it is in the window and none is of a void.
    pub(super) fn find_row(&self, y: u32) -> Option<&[f64]> {
        self.find(y)?.whole()
    }

    /// Copies the codes of row `y` from column `first` on that are not of voids; whether there are any.
    pub(super) fn copy_heights(&self, y: u32, first: u32, to: &mut [f64]) -> bool {
        self.find(y).is_some_and(|row| row.copy_heights(first, to))
    }

    /// Which samples of row `y` are void, from column `from` to `to`; `None` if it has no voids or is not in the window.
    pub(super) fn find_voids(&self, y: u32, from: usize, to: usize) -> Option<Piece<'static, bool>> {
        let row = self.find(y).filter(|row| row.has_voids())?;
        let mut voids = Vec::new();
        row.copy_voids(from, to, &mut voids);
        Some(Piece { from, values: Cow::Owned(voids) })
    }

    /// Whether any row of `rows` may have voids; rows no longer in the window may.
    pub(super) fn may_have_voids(&self, mut rows: std::ops::RangeInclusive<u32>) -> bool {
        rows.any(|y| self.find(y).is_none_or(Row::has_voids))
    }

    /// Code of a folded point on the coarse grid, if it was read, and whether it is void.
    fn coarse_at(&self, p: GridPoint) -> Option<(f64, bool)> {
        let [wide, high] = self.grid.samples();
        let on = |v: u32, count: u32| v.is_multiple_of(self.coarse_step) || v == count - 1;
        if !(on(p.x(), wide) && on(p.y(), high)) {
            return None;
        }
        self.coarse[p.y().div_ceil(self.coarse_step) as usize].as_ref().map(|row| row.at(p.x()))
    }

    /// Code of a folded point, and whether it is void: from the window, else from the coarse samples.
    #[inline(always)]
    fn at(&self, q: GridPoint) -> Option<(f64, bool)> {
        match self.find(q.y()) {
            Some(row) => Some(row.at(q.x())),
            None => self.coarse_at(q),
        }
    }

    /// Height code at a grid point, padding folded.
    pub(super) fn code(&self, p: GridPoint) -> f64 {
        let q = self.grid.fold(p);
        let Some((code, is_void)) = self.at(q) else { return f64::NAN };
        let fill = if is_void { self.fills.and_then(|fill| fill(q.x(), q.y())) } else { None };
        fill.unwrap_or(code)
    }

    /// Whether the sample at a grid point, padding folded, is void.
    pub(super) fn is_void(&self, p: GridPoint) -> bool {
        self.at(self.grid.fold(p)).is_some_and(|(_, is_void)| is_void)
    }
}
