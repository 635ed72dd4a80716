//! The way through a tile, octave by octave, the same for writing and reading (FORMAT.md, section 9.3).
//!
//! Of an octave come first the vertices that are inert or fringe, if there are any, then heights, then error and radius codes. Each height is predicted from coarser ones; codes of the two
//! finest levels follow from heights, and those of other levels are coded as what is missing to their parents'. Invariant: whatever the bytes say, heights stay within 16 bits, and no
//! more values are asked for than the tile's shape gives. Cost: about a megabyte a thread.

mod codes;
mod special;

use super::coder::Coder;
use super::model::{HEIGHT_CLASSES, HEIGHTS};
use super::plane::Lattices;
use super::rules::{Rules, TOP_ERROR};
use super::shape::TileShape;
use super::tile::{INERT, TileRecords};
use super::token::{folded, unfolded};

/// What a vertex is.
const ORDINARY: u8 = 0;
const IS_INERT: u8 = 1;
const IS_FRINGE: u8 = 2;
/// First error code of fringe vertices.
const FRINGE_CODE: u8 = 248;

/// What a thread keeps from tile to tile.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    heights: Lattices<i32>,
    errors: Lattices<u8>,
    radii: Lattices<u8>,
    /// Of the octave's vertices, whites first, then those on edges that run east, then the others.
    kinds: Vec<u8>,
    flat_heights: Vec<i32>,
    flat_errors: Vec<u8>,
    flat_radii: Vec<u8>,
    contexts: Vec<u8>,
    most_errors: Vec<u8>,
    radius_contexts: Vec<u8>,
    least_radii: Vec<u8>,
    chosen: Vec<u32>,
    chosen_contexts: Vec<u8>,
    values: Vec<u16>,
}

/// One octave of a tile.
#[derive(Debug, Clone, Copy)]
struct Octave {
    /// Counted from the tile's finest.
    octave: u32,
    /// Cells a side of the lattice it refines.
    m: usize,
    is_last: [bool; 2],
}

impl Octave {
    fn whites(&self) -> usize {
        self.m * self.m
    }

    fn easts(&self) -> usize {
        self.m * (self.m + 1)
    }

    fn count(&self) -> usize {
        self.whites() + 2 * self.easts()
    }

    /// Place of a vertex in steps of the tile.
    #[inline(always)]
    fn place(&self, i: usize) -> [u32; 2] {
        let [x, y] = self.lattice_place(i);
        [(x as u32) << self.octave, (y as u32) << self.octave]
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

    /// Whether the tile gives the record of a vertex.
    #[inline(always)]
    fn is_given(&self, i: usize) -> bool {
        let [x, y] = self.lattice_place(i);
        (x < 2 * self.m || self.is_last[0]) && (y < 2 * self.m || self.is_last[1])
    }
}

/// Takes a tile's values through `segments`, as many as there are. Reading makes `truth` out of nothing; writing gives the records, which come out as they went in.
pub(crate) fn walk<C: Coder>(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    segments: &mut [C],
    truth: Option<&TileRecords>,
) -> TileRecords {
    let finest = (0..shape.tile_log).find(|o| TileShape::segment_of(*o) < segments.len());
    let finest = finest.unwrap_or(shape.tile_log);
    let mut records = TileRecords::inert(shape, finest);
    let Some((coder, _)) = segments.split_first_mut() else { return records };
    corners(shape, scratch, coder, truth, &mut records);
    for octave in (finest..shape.tile_log).rev() {
        let m = 1usize << (shape.tile_log - octave - 1);
        let Some(coder) = segments.get_mut(TileShape::segment_of(octave)) else { break };
        let octave = Octave { octave, m, is_last: shape.is_last };
        scratch.heights.begin(m);
        scratch.heights.ring_coarse(m);
        if octave.octave < shape.delivered() {
            if octave.octave + 1 == shape.delivered() {
                scratch.errors.coarse.fill(m + 1, m + 1, TOP_ERROR);
                scratch.radii.coarse.fill(m + 1, m + 1, 0);
            }
            deliver(shape, rules, scratch, coder, truth, &octave, &mut records);
        } else {
            heights(scratch, coder, truth, &octave, 3, false);
        }
        scratch.heights.merge(m);
    }
    records
}

/// The heights of the corners; in the coarsest tile their whole records.
fn corners<C: Coder>(
    shape: &TileShape,
    scratch: &mut Scratch,
    coder: &mut C,
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
fn deliver<C: Coder>(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut C,
    truth: Option<&TileRecords>,
    octave: &Octave,
    records: &mut TileRecords,
) {
    let (m, count) = (octave.m, octave.count());
    for flat in [&mut scratch.kinds, &mut scratch.flat_errors, &mut scratch.flat_radii] {
        flat.clear();
        flat.resize(count, 0);
    }
    let is_special = special::kinds(scratch, coder, truth, octave);
    if is_special {
        special::fringe(scratch, coder, truth, octave);
    }
    let coded = octave.octave.min(3) as usize;
    heights(scratch, coder, truth, octave, coded, is_special);
    scratch.errors.begin(m);
    scratch.radii.begin(m);
    if shape.stride_log + octave.octave == 0 {
        codes::derived(rules, scratch, octave);
        special::others(scratch, coder, truth, octave);
    } else {
        codes::coded(rules, scratch, coder, truth, octave, shape.stride_log + octave.octave, is_special);
    }
    store(scratch, octave, records);
    if octave.octave > 0 {
        unknown_border(scratch, octave);
        scratch.errors.merge(m);
        scratch.radii.merge(m);
    }
}

/// All heights of an octave: whites, then blacks.
fn heights<C: Coder>(
    scratch: &mut Scratch,
    coder: &mut C,
    truth: Option<&TileRecords>,
    octave: &Octave,
    coded: usize,
    is_special: bool,
) {
    let (m, whites, count) = (octave.m, octave.whites(), octave.count());
    scratch.flat_heights.resize(count, 0);
    scratch.contexts.resize(count.max(scratch.contexts.len()), 0);
    let first = HEIGHTS + 2 * coded as u16 * HEIGHT_CLASSES;
    let classes = &mut scratch.contexts[..count];
    scratch.heights.predict_whites(m, &mut scratch.flat_heights[..whites], &mut classes[..whites]);
    residuals(scratch, coder, truth, octave, 0..whites, first, is_special);
    for (j, row) in scratch.flat_heights[..whites].chunks_exact(m).enumerate() {
        scratch.heights.whites.row_mut(0, j as isize, m).copy_from_slice(row);
    }
    scratch.heights.ring_whites(m);
    let classes = &mut scratch.contexts[whites..count];
    scratch.heights.predict_blacks(m, &mut scratch.flat_heights[whites..], classes);
    residuals(scratch, coder, truth, octave, whites..count, first + HEIGHT_CLASSES, is_special);
    let (east, north) = scratch.flat_heights[whites..].split_at(octave.easts());
    for (j, row) in east.chunks_exact(m).enumerate() {
        scratch.heights.east.row_mut(0, j as isize, m).copy_from_slice(row);
    }
    for (j, row) in north.chunks_exact(m + 1).enumerate() {
        scratch.heights.north.row_mut(0, j as isize, m + 1).copy_from_slice(row);
    }
}

/// Makes heights of what was predicted for some vertices. Those that are inert have none.
fn residuals<C: Coder>(
    scratch: &mut Scratch,
    coder: &mut C,
    truth: Option<&TileRecords>,
    octave: &Octave,
    range: std::ops::Range<usize>,
    first: u16,
    is_special: bool,
) {
    let Scratch { flat_heights, contexts, kinds, values, chosen, chosen_contexts, .. } = scratch;
    let true_residual = |i: usize, predicted: i32| {
        let record = truth.map_or(INERT, |truth| truth.at(octave.place(i)));
        let height = if record == INERT { predicted.clamp(0, 0xffff) } else { (record & 0xffff) as i32 };
        folded(height - predicted)
    };
    if is_special {
        chosen.clear();
        chosen.extend(range.clone().filter(|i| kinds[*i] != IS_INERT).map(|i| i as u32));
        chosen_contexts.clear();
        chosen_contexts.extend(chosen.iter().map(|i| contexts[*i as usize]));
        values.resize(chosen.len(), 0);
        if truth.is_some() {
            for (value, i) in values.iter_mut().zip(&*chosen) {
                *value = true_residual(*i as usize, flat_heights[*i as usize]);
            }
        }
        coder.values(first, chosen_contexts, values);
        for i in range.filter(|i| kinds[*i] == IS_INERT) {
            flat_heights[i] = flat_heights[i].clamp(0, 0xffff);
        }
        for (i, value) in chosen.iter().zip(&*values) {
            let height = &mut flat_heights[*i as usize];
            *height = (*height + unfolded(*value)) & 0xffff;
        }
        return;
    }
    values.resize(range.len(), 0);
    if truth.is_some() {
        for (value, i) in values.iter_mut().zip(range.clone()) {
            *value = true_residual(i, flat_heights[i]);
        }
    }
    coder.values(first, &contexts[range.clone()], values);
    for (height, value) in flat_heights[range].iter_mut().zip(&*values) {
        *height = (*height + unfolded(*value)) & 0xffff;
    }
}

/// Puts an octave's records where they belong.
fn store(scratch: &Scratch, octave: &Octave, records: &mut TileRecords) {
    for i in 0..octave.count() {
        if octave.is_given(i) {
            let (error, radius) = (scratch.flat_errors[i], scratch.flat_radii[i]);
            let height = scratch.flat_heights[i] as u16;
            let [low, high] = if (error, radius) == (0, 255) { [0; 2] } else { height.to_le_bytes() };
            records.set(octave.place(i), u32::from_le_bytes([low, high, error, radius]));
        }
    }
}

/// What another tile gives is not known here.
fn unknown_border(scratch: &mut Scratch, octave: &Octave) {
    let m = octave.m;
    let (errors, radii) = (&mut scratch.errors, &mut scratch.radii);
    if !octave.is_last[1] {
        errors.east.row_mut(0, m as isize, m).fill(TOP_ERROR);
        radii.east.row_mut(0, m as isize, m).fill(0);
    }
    if !octave.is_last[0] {
        for j in 0..m as isize {
            errors.north.set(m as isize, j, TOP_ERROR);
            radii.north.set(m as isize, j, 0);
        }
    }
}
