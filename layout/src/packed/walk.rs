//! The way through a tile, octave by octave, the same for writing and reading (FORMAT.md, section 9.3).
//!
//! Of an octave come first the vertices that are inert or fringe, if there are any, then heights, then error and radius codes. Each height is predicted from coarser ones; codes of the two
//! finest levels follow from heights, and those of other levels are coded as what is missing to their parents'. Invariant: whatever the bytes say, heights stay within 16 bits, and no
//! more values are asked for than the tile's shape gives. Cost: about a megabyte a thread.

mod codes;
pub(super) mod special;

use super::coder::{Coder, Segments};
use super::model::{HEIGHT_CLASSES, HEIGHTS};
use super::plane::{Lattices, Whole};
use super::rules::{Rules, TOP_ERROR};
use super::shape::{TILE_LOG, TileShape};
use super::tile::{INERT, TileRecords};
use super::token::{folded, unfolded};
use super::wide::{Width, Work};
use std::ops::Range;

/// What a vertex is.
pub(super) const ORDINARY: u8 = 0;
pub(super) const IS_INERT: u8 = 1;
pub(super) const IS_FRINGE: u8 = 2;
/// First error code of fringe vertices.
const FRINGE_CODE: u8 = 248;

/// Most vertices of an octave of a tile.
pub(super) const MOST: usize = {
    let m = 1 << (TILE_LOG - 1);
    m * m + 2 * m * (m + 1)
};

/// What a thread keeps from tile to tile: flat rows have room for the vertices of an octave, whites first, then those on edges that run east, then the others.
#[derive(Debug)]
pub(crate) struct Scratch {
    heights: Lattices<i32>,
    errors: Lattices<u8>,
    radii: Lattices<u8>,
    /// Of octaves that have others than ordinary ones.
    kinds: Vec<u8>,
    flat_heights: Vec<i32>,
    flat_errors: Vec<u8>,
    flat_radii: Vec<u8>,
    contexts: Vec<u8>,
    values: Vec<u16>,
    codes: codes::Rows,
    chosen: Vec<u32>,
    chosen_contexts: Vec<u8>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            heights: Lattices::default(),
            errors: Lattices::default(),
            radii: Lattices::default(),
            kinds: vec![0; MOST],
            flat_heights: vec![0; MOST],
            flat_errors: vec![0; MOST],
            flat_radii: vec![0; MOST],
            contexts: vec![0; MOST],
            values: vec![0; MOST],
            codes: codes::Rows::default(),
            chosen: Vec::with_capacity(MOST),
            chosen_contexts: Vec::with_capacity(MOST),
        }
    }
}

/// One octave of a tile.
#[derive(Debug, Clone, Copy)]
pub(super) struct Octave {
    /// Counted from the tile's finest.
    pub(super) octave: u32,
    /// Cells a side of the lattice it refines.
    pub(super) m: usize,
    pub(super) is_last: [bool; 2],
}

impl Octave {
    pub(super) fn whites(&self) -> usize {
        self.m * self.m
    }

    pub(super) fn easts(&self) -> usize {
        self.m * (self.m + 1)
    }

    pub(super) fn count(&self) -> usize {
        self.whites() + 2 * self.easts()
    }

    pub(super) fn blacks(&self) -> Range<usize> {
        self.whites()..self.count()
    }

    #[inline(always)]
    fn lattice_place(&self, i: usize) -> [usize; 2] {
        let m = self.m;
        if i < self.whites() {
            return [2 * (i % m) + 1, 2 * (i / m) + 1];
        }
        let i = i - self.whites();
        if i < self.easts() {
            return [2 * (i % m) + 1, 2 * (i / m)];
        }
        let i = i - self.easts();
        [2 * (i % (m + 1)), 2 * (i / (m + 1)) + 1]
    }

    /// The vertices of the same lattice west and south of one.
    pub(super) fn before(&self, i: usize) -> [Option<usize>; 2] {
        let (first, wide) = if i < self.whites() {
            (0, self.m)
        } else if i < self.whites() + self.easts() {
            (self.whites(), self.m)
        } else {
            (self.whites() + self.easts(), self.m + 1)
        };
        let within = i - first;
        [(!within.is_multiple_of(wide)).then(|| i - 1), (within >= wide).then(|| i - wide)]
    }

    /// Whether the tile gives the record of a vertex.
    #[inline(always)]
    pub(super) fn is_given(&self, i: usize) -> bool {
        let [x, y] = self.lattice_place(i);
        (x < 2 * self.m || self.is_last[0]) && (y < 2 * self.m || self.is_last[1])
    }
}

/// Takes a tile's values through `segments`, as many as there are. Reading makes `truth` out of nothing; writing gives the records, which come out as they went in.
pub(crate) fn walk(
    width: Width,
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    segments: &mut dyn Segments,
    truth: Option<&TileRecords>,
) -> TileRecords {
    width.run(Walk { shape, rules, scratch, segments, truth })
}

struct Walk<'w> {
    shape: &'w TileShape,
    rules: &'w Rules,
    scratch: &'w mut Scratch,
    segments: &'w mut dyn Segments,
    truth: Option<&'w TileRecords>,
}

impl Work for Walk<'_> {
    type Made = TileRecords;

    #[inline(always)]
    fn run(self) -> TileRecords {
        let Walk { shape, rules, scratch, segments, truth } = self;
        let finest = (0..shape.tile_log).find(|o| TileShape::segment_of(*o) < segments.count());
        let finest = finest.unwrap_or(shape.tile_log);
        let mut records = TileRecords::inert(shape, finest);
        let Some(coder) = segments.segment(0) else { return records };
        corners(shape, scratch, coder, truth, &mut records);
        for octave in (finest..shape.tile_log).rev() {
            let m = 1usize << (shape.tile_log - octave - 1);
            let Some(coder) = segments.segment(TileShape::segment_of(octave)) else { break };
            let is_finest = octave == finest;
            let octave = Octave { octave, m, is_last: shape.is_last };
            scratch.heights.ring_coarse(m);
            if octave.octave < shape.delivered() {
                if octave.octave + 1 == shape.delivered() {
                    scratch.errors.coarse.fill(m + 1, m + 1, TOP_ERROR);
                    scratch.radii.coarse.fill(m + 1, m + 1, 0);
                }
                deliver(shape, rules, scratch, coder, truth, &octave, is_finest, &mut records);
            } else {
                heights(scratch, coder, truth.map(|truth| truth.refining(m)), &octave, 3, false);
            }
            if !is_finest {
                let (east, north) = scratch.flat_heights[octave.blacks()].split_at(octave.easts());
                scratch.heights.merge(m, east, north);
            }
        }
        records
    }
}

/// The heights of the corners; in the coarsest tile their whole records.
fn corners(
    shape: &TileShape,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&TileRecords>,
    records: &mut TileRecords,
) {
    scratch.heights.coarse.resize(2, 2);
    let last = 1 << shape.tile_log;
    for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let at = [x as u32 * last, y as u32 * last];
        let [low, high, mut error, mut radius] = truth.map_or(0, |t| t.at(at)).to_le_bytes().map(u16::from);
        let mut height = low | high << 8;
        if let Some(truth) = truth.filter(|t| t.at(at) == INERT && !shape.is_top) {
            height = some_height(shape, truth);
        }
        coder.raw(16, &mut height);
        if shape.is_top {
            coder.raw(8, &mut error);
            coder.raw(8, &mut radius);
            records.set(at, u32::from(height) | u32::from(error) << 16 | u32::from(radius) << 24);
        }
        scratch.heights.coarse.set(x, y, height.into());
    }
}

/// A height that occurs in the tile, for corners that have none.
fn some_height(shape: &TileShape, truth: &TileRecords) -> u16 {
    let last = 1 << shape.tile_log;
    let mut all = (0..=last).flat_map(|y| (0..=last).map(move |x| [x, y])).map(|at| truth.at(at));
    all.find(|record| *record != INERT).unwrap_or(0) as u16
}

/// An octave of which the tile gives the records.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "the walk's own, taken apart")]
fn deliver(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&TileRecords>,
    octave: &Octave,
    is_finest: bool,
    records: &mut TileRecords,
) {
    let truth = truth.map(|truth| truth.refining(octave.m));
    let is_special = special::kinds(scratch, coder, truth, octave);
    if is_special {
        special::fringe(scratch, coder, truth, octave);
    }
    heights(scratch, coder, truth, octave, octave.octave.min(3) as usize, is_special);
    if shape.stride_log + octave.octave == 0 {
        codes::derived(rules, scratch, octave, is_special);
        special::others(scratch, coder, truth, octave, is_special);
    } else {
        codes::coded(rules, scratch, coder, truth, octave, shape.stride_log + octave.octave, is_special);
    }
    store(scratch, records.refining_mut(octave.m));
    if !is_finest {
        unknown_border(scratch, octave);
        let (m, easts) = (octave.m, octave.easts());
        let (east, north) = scratch.flat_errors[octave.blacks()].split_at(easts);
        scratch.errors.merge(m, east, north);
        let (east, north) = scratch.flat_radii[octave.blacks()].split_at(easts);
        scratch.radii.merge(m, east, north);
    }
}

/// All heights of an octave: whites, then blacks.
#[inline(always)]
fn heights(
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[u32]>,
    octave: &Octave,
    coded: usize,
    is_special: bool,
) {
    let (m, whites) = (octave.m, octave.whites());
    let first = HEIGHTS + 2 * coded as u16 * HEIGHT_CLASSES;
    let Scratch { heights, flat_heights, contexts, .. } = scratch;
    heights.predict_whites::<Whole>(m, &mut flat_heights[..whites], &mut contexts[..whites]);
    residuals(scratch, coder, truth, 0..whites, first, is_special);
    let Scratch { heights, flat_heights, contexts, .. } = scratch;
    heights.take_whites(m, &flat_heights[..whites]);
    heights.ring_whites(m);
    heights.predict_blacks::<Whole>(m, &mut flat_heights[octave.blacks()], &mut contexts[octave.blacks()]);
    residuals(scratch, coder, truth, octave.blacks(), first + HEIGHT_CLASSES, is_special);
}

/// Makes heights of what was predicted for some vertices. Those that are inert have none.
#[inline(always)]
fn residuals(
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[u32]>,
    range: Range<usize>,
    first: u16,
    is_special: bool,
) {
    let Scratch { flat_heights, contexts, kinds, values, chosen, chosen_contexts, .. } = scratch;
    let (heights, contexts) = (&mut flat_heights[range.clone()], &contexts[range.clone()]);
    let truth = truth.map(|truth| &truth[range.clone()]);
    let true_residual = |record: u32, predicted: i32| {
        let height = if record == INERT { predicted.clamp(0, 0xffff) } else { (record & 0xffff) as i32 };
        folded(height - predicted)
    };
    if is_special {
        let kinds = &kinds[range];
        chosen.clear();
        chosen.extend((0..kinds.len()).filter(|i| kinds[*i] != IS_INERT).map(|i| i as u32));
        chosen_contexts.clear();
        chosen_contexts.extend(chosen.iter().map(|i| contexts[*i as usize]));
        let values = &mut values[..chosen.len()];
        if let Some(truth) = truth {
            for (value, i) in values.iter_mut().zip(&*chosen) {
                *value = true_residual(truth[*i as usize], heights[*i as usize]);
            }
        }
        coder.values(first, chosen_contexts, values);
        for (height, _) in heights.iter_mut().zip(kinds).filter(|(_, kind)| **kind == IS_INERT) {
            *height = (*height).clamp(0, 0xffff);
        }
        for (i, value) in chosen.iter().zip(&*values) {
            let height = &mut heights[*i as usize];
            *height = (*height + unfolded(*value)) & 0xffff;
        }
        return;
    }
    let values = &mut values[..heights.len()];
    if let Some(truth) = truth {
        for ((value, height), record) in values.iter_mut().zip(&*heights).zip(truth) {
            *value = true_residual(*record, *height);
        }
    }
    coder.values(first, contexts, values);
    for (height, value) in heights.iter_mut().zip(&*values) {
        *height = (*height + unfolded(*value)) & 0xffff;
    }
}

/// Puts an octave's records together.
#[inline(always)]
fn store(scratch: &Scratch, records: &mut [u32]) {
    let codes = scratch.flat_errors.iter().zip(&scratch.flat_radii);
    for ((record, height), (error, radius)) in records.iter_mut().zip(&scratch.flat_heights).zip(codes) {
        let codes = u32::from(*error) << 16 | u32::from(*radius) << 24;
        *record = if codes == INERT { INERT } else { *height as u32 & 0xffff | codes };
    }
}

/// What another tile gives is not known here.
#[inline(always)]
fn unknown_border(scratch: &mut Scratch, octave: &Octave) {
    let Scratch { flat_errors, flat_radii, .. } = scratch;
    for (flat, unknown) in [(flat_errors, TOP_ERROR), (flat_radii, 0)] {
        let (east, north) = flat[octave.blacks()].split_at_mut(octave.easts());
        if !octave.is_last[1] {
            east[octave.m * octave.m..].fill(unknown);
        }
        if !octave.is_last[0] {
            north.chunks_exact_mut(octave.m + 1).for_each(|row| row[octave.m] = unknown);
        }
    }
}
