//! An editor for one kind of records: heights in, records out, whole or not at all.

mod differences;
mod replace;

pub(crate) use replace::Replacement;

use super::midway::NewCodes;
use super::near::MARGIN;
use super::pages::{Overwritten, Pages};
use super::update::{Scratch, Update};
use crate::bound::{Rules, larger, smaller};
use crate::edit::operations::window::{HeightWindow, SampleRect};
use crate::edit::{Changes, Edit};
use crate::error::LayoutError;
use crate::file::bytes::Page;
use crate::file::entries::Entry;
use crate::file::header::Header;
use crate::grid::GridPoint;
use crate::grid::record::{RecordCodec, Vertex};
use crate::read::store::page_of;
use crate::read::terrain::Terrain;
use std::sync::Arc;

/// Largest height code of compact records.
const LARGEST_CODE: f64 = 65_535.0;

/// Side in samples of the blocks that large windows are set by.
const BLOCK_SIDE: u32 = 256;
/// Samples of a block.
const BLOCK_SAMPLES: usize = (BLOCK_SIDE * BLOCK_SIDE) as usize;

/// Edits of a terrain with records of kind `C`.
#[derive(Debug)]
pub(crate) struct Core<C: RecordCodec> {
    rules: Rules<C>,
    pages: Pages<C>,
    /// The terrain before all edits.
    original: Option<Pages<C>>,
    header: Header,
    /// The header's range and error top as committed.
    committed: ([f64; 2], f64),
    /// The same before the commit that is under way.
    before_commit: Option<([f64; 2], f64)>,
    scratch: Scratch<C>,
    /// Height codes of the window being set, before and after; NaN for voids.
    codes: [Vec<f64>; 2],
}

impl<C: RecordCodec> Core<C> {
    pub(crate) fn new(terrain: Arc<Terrain>, codec: C) -> Self {
        let header = terrain.header().clone();
        let rules = Rules { grid: header.grid, codec, scale: header.scale, error_kind: header.error_kind };
        Self {
            rules,
            committed: (header.height_range_m, header.scale.error_top_m),
            before_commit: None,
            header,
            pages: Pages::new(terrain),
            original: None,
            scratch: Scratch::default(),
            codes: Default::default(),
        }
    }

    pub(crate) fn set_original(&mut self, original: Arc<Terrain>) {
        self.original = Some(Pages::new(original));
    }

    pub(crate) fn header(&self) -> &Header {
        &self.header
    }

    pub(crate) fn terrain(&self) -> &Arc<Terrain> {
        self.pages.terrain()
    }

    pub(crate) fn edited_page(&self, logical: u64) -> Option<&Page> {
        self.pages.edited(logical)
    }

    pub(crate) fn page(&mut self, logical: u64) -> Result<&Page, LayoutError> {
        self.pages.page(logical)
    }

    pub(crate) fn all_edited(&self) -> Vec<u64> {
        self.pages.all_edited()
    }

    pub(crate) fn keep_at_most(&mut self, pages: usize) {
        self.pages.keep_at_most(pages);
        if let Some(original) = &mut self.original {
            original.keep_at_most(pages);
        }
    }

    pub(crate) fn held_pages(&self) -> usize {
        self.pages.held_pages()
    }

    pub(crate) fn has_original(&self) -> bool {
        self.original.is_some()
    }

    pub(crate) fn uncommitted(&self) -> Vec<u64> {
        self.pages.uncommitted()
    }

    pub(crate) fn begin_commit(&mut self) {
        self.before_commit = Some(self.committed);
        self.committed = (self.header.height_range_m, self.header.scale.error_top_m);
        self.pages.begin_commit();
    }

    pub(crate) fn end_commit(&mut self, places: &[(u64, Entry)]) {
        self.before_commit = None;
        self.pages.end_commit(places);
    }

    pub(crate) fn fail_commit(&mut self) {
        if let Some(before) = self.before_commit.take() {
            self.committed = before;
        }
        self.pages.fail_commit();
    }

    pub(crate) fn vertex(&mut self, p: GridPoint) -> Result<Vertex, LayoutError> {
        let grid = self.rules.grid;
        let level = if grid.is_corner(p) { 0 } else { grid.level(p) };
        let raw = self.pages.raw_at(p);
        self.pages.check()?;
        Ok(self.rules.codec.decode(raw, level))
    }

    /// Applies a batch, all of it or nothing.
    pub(crate) fn apply(&mut self, edits: &[Edit]) -> Result<Changes, LayoutError> {
        let grid = self.rules.grid;
        for edit in edits {
            edit.check(&grid)?;
        }
        self.whole(|core, changes| {
            for edit in edits {
                let Some(bounds) = edit.bounds(&grid) else { continue };
                let around = bounds.grown(edit.margin(), &grid);
                let original =
                    if edit.needs_original() { Some(core.original_heights(around)?) } else { None };
                if bounds.count() <= BLOCK_SAMPLES && edit.margin() <= MARGIN {
                    core.load_block(bounds, edit.margin());
                    let mut window = core.heights_in_block(around)?;
                    edit.apply(&grid, &mut window, original.as_ref());
                    core.set_block(bounds, &window, changes)?;
                } else {
                    let mut window = core.heights(around)?;
                    edit.apply(&grid, &mut window, original.as_ref());
                    core.set(&window, changes)?;
                }
            }
            Ok(())
        })
    }

    /// Sets heights, all or none.
    pub(crate) fn set_heights(&mut self, window: &HeightWindow) -> Result<Changes, LayoutError> {
        self.check_rect(window.rect())?;
        self.whole(|core, changes| core.set(window, changes))
    }

    /// Does `work` or, if that fails, nothing.
    fn whole(
        &mut self,
        work: impl FnOnce(&mut Self, &mut Changes) -> Result<(), LayoutError>,
    ) -> Result<Changes, LayoutError> {
        let former = (self.header.height_range_m, self.header.scale.error_top_m);
        let mut changes = Changes::default();
        let done = work(self, &mut changes);
        if let Err(mut error) = done {
            // Slopes are found to be too steep where heights are no longer at hand. The range has those of the batch.
            if let LayoutError::OutOfRange { heights_m, .. } = &mut error
                && heights_m.iter().all(|height| height.is_nan())
            {
                *heights_m = self.header.height_range_m;
            }
            self.pages.take_back();
            self.set_range(former);
            return Err(error);
        }
        self.tell(&mut changes);
        self.pages.keep();
        Ok(changes)
    }

    fn set_range(&mut self, (range_m, error_top_m): ([f64; 2], f64)) {
        self.header.height_range_m = range_m;
        self.header.scale.error_top_m = error_top_m;
        self.rules.scale.error_top_m = error_top_m;
    }

    /// Vertices and pages that the batch wrote to, as far as they are not as they were.
    fn tell(&mut self, changes: &mut Changes) {
        let written = self.pages.overwritten();
        changes.vertices.reserve_exact(written.len());
        for Overwritten { point, slot, old } in written {
            if self.pages.raw_if_held(*slot) != Some(*old) {
                changes.vertices.push(*point);
                let page = page_of::<C>(*slot);
                if changes.pages.last() != Some(&page) {
                    changes.pages.push(page);
                }
            }
        }
        changes.pages.sort_unstable();
        changes.pages.dedup();
    }

    fn check_rect(&self, rect: SampleRect) -> Result<(), LayoutError> {
        let [wide, high] = self.rules.grid.samples();
        if rect.west <= rect.east && rect.south <= rect.north && rect.east < wide && rect.north < high {
            return Ok(());
        }
        Err(LayoutError::Usage(format!(
            "the samples ({}, {}) to ({}, {}) do not all lie in the terrain, which has {wide} x {high}",
            rect.west, rect.south, rect.east, rect.north
        )))
    }

    pub(crate) fn heights(&mut self, rect: SampleRect) -> Result<HeightWindow, LayoutError> {
        self.check_rect(rect)?;
        heights_of(&mut self.pages, &self.rules, rect)
    }

    fn original_heights(&mut self, rect: SampleRect) -> Result<HeightWindow, LayoutError> {
        let terrain = Arc::clone(self.pages.terrain());
        let original = self.original.get_or_insert_with(|| Pages::new(terrain));
        let window = heights_of(original, &self.rules, rect);
        original.keep();
        window
    }

    /// Sets the heights of a window that lies in the data, block by block, so that little memory is taken for large ones.
    fn set(&mut self, window: &HeightWindow, changes: &mut Changes) -> Result<(), LayoutError> {
        let rect = window.rect();
        for south in (rect.south..=rect.north).step_by(BLOCK_SIDE as usize) {
            for west in (rect.west..=rect.east).step_by(BLOCK_SIDE as usize) {
                let block = SampleRect {
                    west,
                    south,
                    east: (west + BLOCK_SIDE - 1).min(rect.east),
                    north: (south + BLOCK_SIDE - 1).min(rect.north),
                };
                self.load_block(block, 0);
                self.set_block(block, window, changes)?;
            }
        }
        Ok(())
    }

    /// Brings the finest levels around a block to hand, and at least `margin` samples on each side.
    fn load_block(&mut self, block: SampleRect, margin: u32) {
        self.scratch.near.load(&self.rules.grid, block, margin, &mut self.pages);
    }

    /// Heights around the block that was loaded last.
    fn heights_in_block(&self, rect: SampleRect) -> Result<HeightWindow, LayoutError> {
        let (near, scale) = (&self.scratch.near, &self.rules.scale);
        let mut heights_m = Vec::with_capacity(rect.count());
        for y in rect.south..=rect.north {
            let codes = near.samples_of_row(y, rect.west, rect.east).iter();
            heights_m.extend(codes.map(|code| scale.height_base_m + code * scale.height_step_m));
        }
        HeightWindow::new(rect, heights_m)
    }

    /// Sets the heights of the block that was loaded last to those of `window`, which holds it.
    fn set_block(
        &mut self,
        block: SampleRect,
        window: &HeightWindow,
        changes: &mut Changes,
    ) -> Result<(), LayoutError> {
        self.pages.check()?;
        let scale = self.rules.scale;
        let [mut then, mut now] = std::mem::take(&mut self.codes);
        then.clear();
        now.clear();
        for y in block.south..=block.north {
            let (at, first) = (then.len(), window.index(block.west, y));
            let heights_m = &window.heights_m()[first..first + block.wide() as usize];
            then.extend_from_slice(self.scratch.near.samples_of_row(y, block.west, block.east));
            now.extend(heights_m.iter().zip(&then[at..]).map(|(height_m, old)| {
                let new = C::round_height((height_m - scale.height_base_m) / scale.height_step_m);
                if height_m.is_nan() || old.is_nan() { *old } else { new }
            }));
            if self.pages.has_voids() {
                let voids = heights_m.iter().zip(&then[at..]).filter(|(m, old)| old.is_nan() && !m.is_nan());
                changes.voids_passed += voids.count() as u64;
            }
        }
        let (changed, range) = (changed_within(block, &then, &now), range_of_changed(&then, &now));
        self.codes = [then, now];
        let Some(changed) = changed else { return Ok(()) };
        self.check_range(range)?;
        self.renew(block, changed);
        self.pages.check()?;
        changes.samples.push(changed);
        Ok(())
    }

    /// Updates the records around `changed`, whose codes lie in those of `block`, which was loaded last.
    fn renew(&mut self, block: SampleRect, changed: SampleRect) {
        let mut codes = std::mem::take(&mut self.codes);
        if block != changed {
            codes.iter_mut().for_each(|codes| cut_out(codes, block, changed));
        }
        let ranges = [0, 1].map(|i| crate::bound::range(&codes[i]));
        self.scratch.near.set(changed, &codes[1]);
        let new = NewCodes { rect: changed, codes: &codes[1], old_codes: &codes[0], ranges };
        Update::new(&self.rules, &mut self.pages, new, &mut self.scratch).run();
        self.codes = codes;
    }

    /// Whether records can hold these height codes; notes the new range of heights.
    fn check_range(&mut self, codes: [f64; 2]) -> Result<(), LayoutError> {
        let scale = &mut self.rules.scale;
        let metres = codes.map(|code| scale.height_base_m + code * scale.height_step_m);
        let [low, high] = self.header.height_range_m;
        let range_m = [low.min(metres[0]), high.max(metres[1])];
        let needed_top_m = (range_m[1] - range_m[0]) * (1.0 + 1e-6);
        let has_codes = self.header.record_kind.has_height_codes();
        let fits = if has_codes {
            codes[0] >= 0.0 && codes[1] <= LARGEST_CODE && needed_top_m <= scale.error_top_m * (1.0 + 1e-12)
        } else {
            metres.iter().all(|m| m.abs() <= 1e9)
        };
        if !fits {
            let [holds_from, holds_to] = if has_codes {
                let top_m = scale.error_top_m / (1.0 + 1e-6);
                let codes_to = scale.height_base_m + LARGEST_CODE * scale.height_step_m;
                [scale.height_base_m.max(high - top_m), codes_to.min(low + top_m)]
            } else {
                [-1e9, 1e9]
            };
            return Err(LayoutError::OutOfRange {
                path: self.pages.terrain().path().to_owned(),
                heights_m: metres,
                problem: format!(
                    "the edit leads to heights from {:.3} to {:.3} m, this file's records hold {holds_from:.3} to {holds_to:.3} m; rewrite it with room for them",
                    metres[0], metres[1]
                ),
            });
        }
        if !has_codes {
            scale.error_top_m = scale.error_top_m.max(needed_top_m);
            self.header.scale.error_top_m = scale.error_top_m;
        }
        self.header.height_range_m = range_m;
        Ok(())
    }
}

/// Whether a sample with these height codes changed. Voids differ from everything, and stay.
#[inline(always)]
fn is_changed(old: f64, new: f64) -> bool {
    new != old && !old.is_nan()
}

/// The rectangle around the samples of `block` that have other height codes `now` than `then`; `None` if none has.
fn changed_within(block: SampleRect, then: &[f64], now: &[f64]) -> Option<SampleRect> {
    let wide = block.wide() as usize;
    let mut changed: Option<SampleRect> = None;
    for (y, (then, now)) in (block.south..).zip(then.chunks_exact(wide).zip(now.chunks_exact(wide))) {
        let mut samples = then.iter().zip(now);
        let Some(first) = samples.position(|(old, new)| is_changed(*old, *new)) else { continue };
        let last = samples.rposition(|(old, new)| is_changed(*old, *new)).map_or(first, |at| first + 1 + at);
        let (west, east) = (block.west + first as u32, block.west + last as u32);
        changed = Some(match changed {
            None => SampleRect { west, south: y, east, north: y },
            Some(r) => SampleRect { west: r.west.min(west), east: r.east.max(east), north: y, ..r },
        });
    }
    changed
}

/// Lowest and highest of the height codes `now` that differ from those `then`.
#[inline(always)]
fn range_of_changed(then: &[f64], now: &[f64]) -> [f64; 2] {
    // Eight lanes, so that the compiler can vectorise.
    let (mut lowest, mut highest) = ([f64::INFINITY; 8], [f64::NEG_INFINITY; 8]);
    let mut look = |lane: usize, old: f64, new: f64| {
        let is_changed = is_changed(old, new);
        lowest[lane] = smaller(lowest[lane], if is_changed { new } else { f64::INFINITY });
        highest[lane] = larger(highest[lane], if is_changed { new } else { f64::NEG_INFINITY });
    };
    let ((then, then_rest), (now, now_rest)) = (then.as_chunks::<8>(), now.as_chunks::<8>());
    for (then, now) in then.iter().zip(now) {
        for lane in 0..8 {
            look(lane, then[lane], now[lane]);
        }
    }
    then_rest.iter().zip(now_rest).for_each(|(old, new)| look(0, *old, *new));
    [lowest.into_iter().fold(f64::INFINITY, smaller), highest.into_iter().fold(f64::NEG_INFINITY, larger)]
}

/// Leaves of `values`, one for each sample of `rect`, those of `part`, which lies in it.
fn cut_out(values: &mut Vec<f64>, rect: SampleRect, part: SampleRect) {
    // Moved to the front row by row; a row never moves past where it was.
    let (mut to, wide) = (0, part.wide() as usize);
    for y in part.south..=part.north {
        let from = (y - rect.south) as usize * rect.wide() as usize + (part.west - rect.west) as usize;
        values.copy_within(from..from + wide, to);
        to += wide;
    }
    values.truncate(to);
}

/// Heights of a rectangle that lies in the data.
fn heights_of<C: RecordCodec>(
    pages: &mut Pages<C>,
    rules: &Rules<C>,
    rect: SampleRect,
) -> Result<HeightWindow, LayoutError> {
    let points =
        (rect.south..=rect.north).flat_map(|y| (rect.west..=rect.east).map(move |x| GridPoint::new(x, y)));
    let heights_m = points
        .map(|p| {
            let vertex = rules.codec.decode(pages.raw_at(p), 0);
            if vertex.class.is_void() { f64::NAN } else { vertex.height_m }
        })
        .collect();
    pages.check()?;
    HeightWindow::new(rect, heights_m)
}
