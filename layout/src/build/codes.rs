//! Rows of height codes, voids filled in, from the spool.
//!
//! A void's height is used for positions only. It is interpolated along its row between the nearest samples that have one; a row of
//! nothing but voids repeats the row south of it, and shares its memory. Both depend on the data alone, so every size of the window gives the same fill. Where blocks of the
//! DEM are void no code is stored: it follows from the samples on either side.

use super::land::Land;
use super::spool::Spool;
use super::survey::HeightCode;
use crate::error::LayoutError;
use std::sync::Arc;

/// Codes side by side.
#[derive(Debug)]
struct CodeRun {
    /// Column of the first.
    first: u32,
    codes: Box<[f64]>,
    /// Which are void; empty if none is.
    voids: Box<[bool]>,
}

/// Codes of voids side by side.
#[derive(Debug, Clone, Copy)]
enum Gap {
    /// All the same.
    Level(f64),
    /// From one height to another: `west` in the column before `at`, `east` `width` columns on.
    Slope { at: u32, width: f64, west: f64, east: f64 },
}

impl Gap {
    /// Between the samples that have heights next to columns `at..end`, if there are any.
    fn new(at: u32, end: u32, west: Option<f64>, east: Option<f64>) -> Self {
        let (Some(west), Some(east)) = (west.or(east), east.or(west)) else { return Self::Level(f64::NAN) };
        Self::Slope { at, width: f64::from(end - at + 1), west, east }
    }

    fn code(&self, x: u32) -> f64 {
        match *self {
            Self::Level(code) => code,
            // Rounded, for compact records keep whole codes only.
            Self::Slope { at, width, west, east } => {
                (west + (east - west) * (f64::from(x - at + 1) / width)).round_ties_even()
            }
        }
    }
}

/// The codes of a row.
#[derive(Debug)]
pub(super) struct RowCodes {
    /// Columns from one code to the next.
    step: u32,
    runs: Vec<CodeRun>,
    /// West of each run and east of the last.
    gaps: Vec<Gap>,
}

impl RowCodes {
    /// A row of one code.
    pub(super) fn level(code: f64) -> Self {
        Self { step: 1, runs: Vec::new(), gaps: vec![Gap::Level(code)] }
    }

    /// A row from raw runs, from the west, in which voids are NaN.
    fn filled(wide: u32, runs: Vec<(u32, Vec<f64>)>) -> Self {
        let is_whole = |(_, codes): &(u32, Vec<f64>)| codes.len() == wide as usize && !has_void(codes);
        if let [run] = &runs[..]
            && is_whole(run)
        {
            let codes = runs.into_iter().map(|(first, codes)| CodeRun {
                first,
                codes: codes.into(),
                voids: Box::default(),
            });
            return Self { step: 1, runs: codes.collect(), gaps: vec![Gap::Level(f64::NAN); 2] };
        }
        let mut codes: Vec<CodeRun> = runs
            .into_iter()
            .map(|(first, codes)| {
                let voids: Vec<bool> =
                    if has_void(&codes) { codes.iter().map(|v| v.is_nan()).collect() } else { Vec::new() };
                CodeRun { first, codes: codes.into(), voids: voids.into() }
            })
            .collect();
        let mut gaps = vec![Gap::Level(f64::NAN); codes.len() + 1];
        // The height west of a stretch of voids, the stretch's first column, and the run and place where it begins.
        let (mut west, mut at, mut from) = (None, 0, (0, 0));
        for run in 0..codes.len() {
            for place in 0..codes[run].codes.len() {
                let code = codes[run].codes[place];
                if code.is_nan() {
                    continue;
                }
                let x = codes[run].first + place as u32;
                if at < x {
                    close(&mut codes, &mut gaps, from, (run, place), Gap::new(at, x, west, Some(code)));
                }
                (west, at, from) = (Some(code), x + 1, (run, place + 1));
            }
        }
        let end = (codes.len(), 0);
        if at < wide {
            close(&mut codes, &mut gaps, from, end, Gap::new(at, wide, west, None));
        }
        Self { step: 1, runs: codes, gaps }
    }

    /// The code of a column, and whether it is one that is void.
    #[inline(always)]
    fn at(&self, x: u32) -> (f64, bool) {
        let after = self.runs.partition_point(|run| run.first <= x);
        if let Some(run) = self.runs[..after].last() {
            let place = ((x - run.first) / self.step) as usize;
            if let Some(code) = run.codes.get(place) {
                return (*code, run.voids.get(place).copied().unwrap_or(false));
            }
        }
        (self.gaps[after].code(x), true)
    }

    /// Every `step`-th code of a row of `wide` columns, and the last.
    fn thinned(&self, wide: u32, step: u32) -> Self {
        let (mut runs, mut gaps) = (Vec::new(), Vec::new());
        for (run, gap) in self.runs.iter().zip(&self.gaps) {
            gaps.push(*gap);
            let first = run.first.next_multiple_of(step);
            let skipped = (first - run.first) as usize;
            let every = |count: usize| (skipped..count).step_by(step as usize);
            runs.push(CodeRun {
                first,
                codes: every(run.codes.len()).map(|i| run.codes[i]).collect(),
                voids: every(run.voids.len()).map(|i| run.voids[i]).collect(),
            });
        }
        let last = wide - 1;
        if !last.is_multiple_of(step)
            && let Some(run) = self.runs.last().filter(|run| run.first + run.codes.len() as u32 == wide)
        {
            let is_void = run.voids.last().copied();
            let code = run.codes.last().copied().into_iter().collect();
            runs.push(CodeRun { first: last, codes: code, voids: is_void.into_iter().collect() });
            gaps.push(Gap::Level(f64::NAN));
        }
        gaps.extend(self.gaps.last());
        Self { step, runs, gaps }
    }
}

fn has_void(codes: &[f64]) -> bool {
    // Without an early end the comparison takes many samples at once.
    codes.iter().fold(false, |any, v| any | v.is_nan())
}

/// Fills a stretch of voids that begins at a place in a run and ends before another.
fn close(codes: &mut [CodeRun], gaps: &mut [Gap], from: (usize, usize), to: (usize, usize), gap: Gap) {
    for (run, before) in gaps.iter_mut().enumerate().take(to.0 + 1).skip(from.0) {
        // The voids before a run, unless the stretch begins in it.
        if run > from.0 || from == (0, 0) {
            *before = gap;
        }
        let Some(CodeRun { first, codes, .. }) = codes.get_mut(run) else { continue };
        let start = if run == from.0 { from.1 } else { 0 };
        let end = if run == to.0 { to.1 } else { codes.len() };
        for (i, code) in codes[start..end].iter_mut().enumerate() {
            *code = gap.code(*first + (start + i) as u32);
        }
    }
}

/// One row of the window.
#[derive(Debug, Clone)]
pub(super) struct Row {
    codes: Arc<RowCodes>,
    /// Whether all of it is void.
    is_void: bool,
}

impl Row {
    /// Whether any sample may be void.
    pub(super) fn has_voids(&self) -> bool {
        self.is_void || self.whole().is_none()
    }

    /// All codes, if none is of a void.
    pub(super) fn whole(&self) -> Option<&[f64]> {
        match &self.codes.runs[..] {
            [run] if run.voids.is_empty() && !self.is_void && self.is_covered_by(run) => Some(&run.codes),
            _ => None,
        }
    }

    /// A run with gaps of void on its sides is none of a whole row: those are no [`Gap::Level`].
    fn is_covered_by(&self, run: &CodeRun) -> bool {
        run.first == 0 && matches!(self.codes.gaps[..], [Gap::Level(_), Gap::Level(_)])
    }

    /// The code of a column, and whether the sample is void.
    #[inline(always)]
    pub(super) fn at(&self, x: u32) -> (f64, bool) {
        let (code, is_void) = self.codes.at(x);
        (code, is_void || self.is_void)
    }

    /// Every `step`-th sample, and the last.
    pub(super) fn thinned(&self, wide: u32, step: u32) -> Self {
        Self { codes: self.codes.thinned(wide, step).into(), is_void: self.is_void }
    }

    /// Codes from column `first` on into `to`, whose voids stay as they are; whether there are any.
    pub(super) fn copy_heights(&self, first: u32, to: &mut [f64]) -> bool {
        let mut any = false;
        for run in self.codes.runs.iter().filter(|_| !self.is_void) {
            let end = (run.first + run.codes.len() as u32).min(first + to.len() as u32);
            let from = run.first.max(first);
            if from >= end {
                continue;
            }
            let (place, here) =
                ((from - first) as usize..(end - first) as usize, (from - run.first) as usize);
            let count = place.len();
            let to = &mut to[place];
            if run.voids.is_empty() {
                to.copy_from_slice(&run.codes[here..here + count]);
                any = true;
                continue;
            }
            let codes = run.codes[here..here + count].iter().zip(&run.voids[here..here + count]);
            for (to, (code, _)) in to.iter_mut().zip(codes).filter(|(_, (_, is_void))| !**is_void) {
                *to = *code;
                any = true;
            }
        }
        any
    }

    /// Which of the columns from `from` to `to` are void, into `voids`.
    pub(super) fn copy_voids(&self, from: usize, to: usize, voids: &mut Vec<bool>) {
        voids.clear();
        voids.resize(to.saturating_sub(from), true);
        for run in self.codes.runs.iter().filter(|_| !self.is_void) {
            let first = run.first as usize;
            let (west, east) = (from.max(first), to.min(first + run.codes.len()));
            if west < east {
                let place = &mut voids[west - from..east - from];
                match run.voids.get(west - first..east - first) {
                    Some(of_run) => place.copy_from_slice(of_run),
                    None => place.fill(false),
                }
            }
        }
    }
}

/// Reads rows of codes from the south, voids filled in; apart from the window, so that rows ahead of it can be read meanwhile.
pub(super) struct RowReader<'s> {
    spool: &'s Spool<'s>,
    land: &'s Land,
    code: HeightCode,
    wide: u32,
    next: u32,
    /// Filled codes of the row last read, which a wholly void row repeats.
    last: Arc<RowCodes>,
}

impl<'s> RowReader<'s> {
    /// A reader at the southernmost row; rows of voids before any height have `fallback_code`.
    pub(super) fn new(spool: &'s Spool<'s>, code: HeightCode, wide: u32, fallback_code: f64) -> Self {
        let last = RowCodes::level(fallback_code).into();
        Self { spool, land: spool.land(), code, wide, next: 0, last }
    }

    /// Reads on up to and including row `through`.
    pub(super) fn read(&mut self, through: u32) -> Result<Vec<Row>, LayoutError> {
        let mut rows = Vec::new();
        while self.next <= through {
            rows.push(self.row(self.next)?);
            self.next += 1;
        }
        Ok(rows)
    }

    /// Row `y`; if it is void, with the codes of the row before.
    pub(super) fn row(&mut self, y: u32) -> Result<Row, LayoutError> {
        if self.spool.is_void_row(y) {
            return Ok(Row { codes: Arc::clone(&self.last), is_void: true });
        }
        let mut runs = Vec::new();
        for run in self.land.runs(y..=y) {
            let mut codes = vec![0.0; run.len()];
            self.spool.read_part(y, run.start, &mut codes)?;
            codes.iter_mut().for_each(|v| *v = self.code.code(*v));
            runs.push((run.start, codes));
        }
        self.last = RowCodes::filled(self.wide, runs).into();
        Ok(Row { codes: Arc::clone(&self.last), is_void: false })
    }
}
