//! The rows of height codes the build is working on: a window that slides north over the terrain, voids filled in.
//!
//! A void's height is used for positions only. It is interpolated along its row between the nearest samples that have one; a row of
//! nothing but voids repeats the row south of it, and shares its memory. Both depend on the data alone, so every band size gives the same fill.

use super::spool::Spool;
use super::survey::HeightCode;
use crate::error::LayoutError;
use crate::grid::{Grid, GridPoint};
use std::collections::VecDeque;
use std::sync::Arc;

/// One row of the window.
#[derive(Debug)]
pub(super) struct Row {
    codes: Arc<[f64]>,
    /// Which samples are void; empty if none is.
    voids: Arc<[bool]>,
}

/// Code to fill a void with, given its column and row; `None` where no vertex will say it.
pub(super) type Fills<'f> = dyn Fn(u32, u32) -> Option<f64> + Sync + 'f;

/// Reads rows of codes from the south, voids filled in; apart from the window, so that rows ahead of it can be read meanwhile.
pub(super) struct RowReader<'s> {
    spool: &'s Spool<'s>,
    code: HeightCode,
    fills: Option<&'s Fills<'s>>,
    next: u32,
    /// Filled codes of the row last read, which a wholly void row repeats.
    last: Arc<[f64]>,
    /// The voids of a wholly void row.
    all_void: Arc<[bool]>,
}

impl<'s> RowReader<'s> {
    /// A reader at the southernmost row; rows of voids before any height have `fallback_code`.
    pub(super) fn new(
        spool: &'s Spool<'s>,
        code: HeightCode,
        fills: Option<&'s Fills<'s>>,
        wide: u32,
        fallback_code: f64,
    ) -> Self {
        let wide = wide as usize;
        Self {
            spool,
            code,
            fills,
            next: 0,
            last: vec![fallback_code; wide].into(),
            all_void: vec![true; wide].into(),
        }
    }

    /// Reads on up to and including row `through`.
    pub(super) fn read(&mut self, through: u32) -> Result<Vec<Row>, LayoutError> {
        let mut rows = Vec::new();
        let mut codes = vec![0.0; self.last.len()];
        while self.next <= through {
            let voids = if self.spool.is_void_row(self.next) {
                Arc::clone(&self.all_void)
            } else {
                self.spool.read_row(self.next, &mut codes)?;
                codes.iter_mut().for_each(|v| *v = self.code.code(*v));
                let voids = fill(&mut codes);
                self.last = codes.as_slice().into();
                voids.into()
            };
            if let Some(fills) = self.fills.filter(|_| !voids.is_empty()) {
                let mut filled = self.last.to_vec();
                for x in (0..filled.len()).filter(|x| voids[*x]) {
                    if let Some(fill) = fills(x as u32, self.next) {
                        filled[x] = fill;
                    }
                }
                self.last = filled.into();
            }
            rows.push(Row { codes: Arc::clone(&self.last), voids });
            self.next += 1;
        }
        Ok(rows)
    }
}

/// Fills voids (NaN) along a row that is not wholly void; says which were void.
fn fill(codes: &mut [f64]) -> Vec<bool> {
    if !codes.iter().any(|v| v.is_nan()) {
        return Vec::new();
    }
    let voids: Vec<bool> = codes.iter().map(|v| v.is_nan()).collect();
    let mut at = 0;
    while at < codes.len() {
        if !voids[at] {
            at += 1;
            continue;
        }
        let end = (at..codes.len()).find(|i| !voids[*i]).unwrap_or(codes.len());
        let west = at.checked_sub(1).map(|i| codes[i]);
        let east = codes.get(end).copied();
        let (a, b) = match (west, east) {
            (Some(a), Some(b)) => (a, b),
            (Some(a), None) => (a, a),
            (None, Some(b)) => (b, b),
            // A row that is wholly void was dealt with above.
            (None, None) => break,
        };
        let gap = (end - at + 1) as f64;
        for (i, code) in codes[at..end].iter_mut().enumerate() {
            // Rounded, for compact records keep whole codes only.
            *code = (a + (b - a) * ((i + 1) as f64 / gap)).round_ties_even();
        }
        at = end;
    }
    voids
}

/// Height codes of rows `first..first + rows.len()`, and of every `coarse_step`-th sample of all rows read so far.
#[derive(Debug)]
pub(super) struct Band {
    grid: Grid,
    first: u32,
    rows: VecDeque<Row>,
    coarse_step: u32,
    coarse: Vec<f64>,
    coarse_voids: Vec<bool>,
}

impl Band {
    /// An empty window that will keep every `coarse_step`-th sample for good.
    pub(super) fn new(grid: Grid, coarse_step: u32, fallback_code: f64) -> Self {
        let side = Self::coarse_side(&grid, coarse_step);
        Self {
            grid,
            first: 0,
            rows: VecDeque::new(),
            coarse_step,
            coarse: vec![fallback_code; side[0] * side[1]],
            coarse_voids: vec![false; side[0] * side[1]],
        }
    }

    /// Coarse samples east and north: those of the data on the coarse grid, and one for the data's far border.
    fn coarse_side(grid: &Grid, step: u32) -> [usize; 2] {
        grid.samples().map(|s| ((s - 1).div_ceil(step) + 1) as usize)
    }

    /// Reads the coarse samples of all rows ahead of the window, so that triangles larger than it have their corners.
    pub(super) fn preload_coarse(&mut self, spool: &Spool<'_>, code: &HeightCode) -> Result<(), LayoutError> {
        let [wide, high] = self.grid.samples();
        let mut codes = vec![0.0; wide as usize];
        for y in (0..high).step_by(self.coarse_step as usize).chain([high - 1]) {
            spool.read_row(y, &mut codes)?;
            codes.iter_mut().for_each(|v| *v = code.code(*v));
            let voids: Vec<bool> = codes.iter().map(|v| v.is_nan()).collect();
            self.keep_coarse(y, &codes, &voids);
        }
        Ok(())
    }

    /// Code of a coarse sample that is not void.
    pub(super) fn coarse_code(&self, p: GridPoint) -> Option<f64> {
        self.coarse_index(self.grid.fold(p)).filter(|i| !self.coarse_voids[*i]).map(|i| self.coarse[i])
    }

    /// Rows read so far.
    pub(super) fn rows_read(&self) -> u32 {
        self.first + self.rows.len() as u32
    }

    /// Adds the rows north of those in the window.
    pub(super) fn push(&mut self, rows: Vec<Row>) {
        for row in rows {
            self.keep_coarse(self.rows_read(), &row.codes, &row.voids);
            self.rows.push_back(row);
        }
    }

    fn keep_coarse(&mut self, y: u32, codes: &[f64], voids: &[bool]) {
        let [wide, high] = self.grid.samples();
        if !y.is_multiple_of(self.coarse_step) && y != high - 1 {
            return;
        }
        let [side, _] = Self::coarse_side(&self.grid, self.coarse_step);
        let row = y.div_ceil(self.coarse_step) as usize * side;
        for i in 0..side {
            let x = (i * self.coarse_step as usize).min(wide as usize - 1);
            self.coarse[row + i] = codes[x];
            self.coarse_voids[row + i] = voids.get(x).copied().unwrap_or(false);
        }
    }

    /// Forgets rows south of `row`.
    pub(super) fn drop_below(&mut self, row: u32) {
        while self.first < row && self.rows.len() > 1 {
            self.rows.pop_front();
            self.first += 1;
        }
    }

    /// Row `y` of codes, while it is in the window.
    pub(super) fn row(&self, y: u32) -> &[f64] {
        &self.rows[(y - self.first) as usize].codes
    }

    /// Row `y` of codes, if it is in the window.
    pub(super) fn find_row(&self, y: u32) -> Option<&[f64]> {
        Some(&self.rows.get(y.checked_sub(self.first)? as usize)?.codes)
    }

    /// Which samples of row `y` are void, if it is in the window; empty if none is.
    pub(super) fn find_row_voids(&self, y: u32) -> Option<&[bool]> {
        Some(&self.rows.get(y.checked_sub(self.first)? as usize)?.voids)
    }

    /// Which samples of row `y` are void; empty if none is.
    pub(super) fn row_voids(&self, y: u32) -> &[bool] {
        &self.rows[(y - self.first) as usize].voids
    }

    /// Whether any row of `rows` may have voids; rows no longer in the window may.
    pub(super) fn may_have_voids(&self, rows: std::ops::RangeInclusive<u32>) -> bool {
        let (first, last) = (*rows.start(), *rows.end());
        first < self.first
            || last >= self.rows_read()
            || rows.into_iter().any(|y| !self.row_voids(y).is_empty())
    }

    /// Index of a folded point in the coarse arrays, if it is there.
    fn coarse_index(&self, p: GridPoint) -> Option<usize> {
        let [wide, high] = self.grid.samples();
        let on = |v: u32, count: u32| v.is_multiple_of(self.coarse_step) || v == count - 1;
        (on(p.x(), wide) && on(p.y(), high)).then(|| {
            let [side, _] = Self::coarse_side(&self.grid, self.coarse_step);
            p.y().div_ceil(self.coarse_step) as usize * side + p.x().div_ceil(self.coarse_step) as usize
        })
    }

    /// Height code at a grid point, padding folded: from the window, else from the coarse samples.
    pub(super) fn code(&self, p: GridPoint) -> f64 {
        let q = self.grid.fold(p);
        match q.y().checked_sub(self.first).and_then(|i| self.rows.get(i as usize)) {
            Some(row) => row.codes[q.x() as usize],
            None => self.coarse_index(q).map_or(f64::NAN, |i| self.coarse[i]),
        }
    }

    /// Whether the sample at a grid point, padding folded, is void.
    pub(super) fn is_void(&self, p: GridPoint) -> bool {
        let q = self.grid.fold(p);
        match q.y().checked_sub(self.first).and_then(|i| self.rows.get(i as usize)) {
            Some(row) => row.voids.get(q.x() as usize).copied().unwrap_or(false),
            None => self.coarse_index(q).is_some_and(|i| self.coarse_voids[i]),
        }
    }
}
