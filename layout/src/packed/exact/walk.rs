//! The way through a tile of exact or fine records, octave by octave, the same for writing and reading.
//!
//! It is that of compact records with other parts.

use super::form::{Form, Parts};
use super::heights::{Real, class_of};
use super::numbers::{Row, raw, row, shift};
use super::rules::Rules;
use super::scratch::{Scratch, UNKNOWN};
use super::{codes, special};
use crate::packed::coder::{Coder, Segments};
use crate::packed::model::{HEIGHT_CLASSES, HEIGHTS};
use crate::packed::shape::TileShape;
use crate::packed::tile::TileRecords;
use crate::packed::walk::{IS_INERT, ORDINARY, Octave};
use std::ops::Range;

/// Takes a tile's values through `segments`, as many as there are. Reading makes the records out of nothing; writing gives them as `truth`.
pub(crate) fn walk(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    segments: &mut dyn Segments,
    truth: Option<&TileRecords>,
) -> TileRecords {
    let form = rules.form();
    let finest = (0..shape.tile_log).find(|o| TileShape::segment_of(*o) < segments.count());
    let finest = finest.unwrap_or(shape.tile_log);
    let mut records = TileRecords::filled(shape, finest, form.inert_words());
    let Some(coder) = segments.segment(0) else { return records };
    corners(form, shape, scratch, coder, truth, &mut records);
    for octave in (finest..shape.tile_log).rev() {
        let m = 1usize << (shape.tile_log - octave - 1);
        let Some(coder) = segments.segment(TileShape::segment_of(octave)) else { break };
        let truth: Option<Vec<Parts>> = truth.map(|truth| {
            truth.refining(m).chunks_exact(form.words()).map(|words| form.parts(words)).collect()
        });
        let truth = truth.as_deref();
        let at = Octave { octave, m, is_last: shape.is_last };
        scratch.heights.ring_coarse(m);
        if octave < shape.delivered() {
            if octave + 1 == shape.delivered() {
                scratch.errors.coarse.fill(m + 1, m + 1, UNKNOWN);
                scratch.radii.coarse.fill(m + 1, m + 1, UNKNOWN);
            }
            deliver(shape, rules, scratch, coder, truth, &at, records.refining_mut(m));
        } else {
            scratch.kinds[..at.count()].fill(ORDINARY);
            heights(form, scratch, coder, truth, &at, 3);
        }
        if octave != finest {
            next_lattice(shape, scratch, &at);
        }
    }
    records
}

/// The heights of the corners; in the coarsest tile their whole records.
fn corners(
    form: Form,
    shape: &TileShape,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&TileRecords>,
    records: &mut TileRecords,
) {
    scratch.heights.coarse.resize(2, 2);
    let last = 1 << shape.tile_log;
    let some = truth.filter(|_| !shape.is_top).and_then(|truth| {
        let all = truth.all().chunks_exact(form.words()).map(|words| form.parts(words));
        all.into_iter().find(|parts| *parts != form.inert())
    });
    for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let at = [x as u32 * last, y as u32 * last];
        let mut parts = truth.map_or(Parts::default(), |truth| form.parts(truth.words_at(at)));
        if let Some(some) = some.filter(|_| parts == form.inert()) {
            parts = some;
        }
        raw(coder, form.height_bits(), &mut parts.height);
        if shape.is_top {
            for code in [&mut parts.error, &mut parts.radius] {
                let mut number = u64::from(*code);
                raw(coder, form.code_bits(), &mut number);
                *code = number as u32;
            }
            form.put(parts, records.words_mut(at));
        }
        scratch.heights.coarse.set(x, y, form.value(parts.height));
    }
}

/// An octave of which the tile gives the records.
fn deliver(
    shape: &TileShape,
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
    records: &mut [u32],
) {
    let form = rules.form();
    if special::kinds(form, scratch, coder, truth, octave) {
        special::fringe(form, scratch, coder, truth, octave);
    }
    heights(form, scratch, coder, truth, octave, octave.octave.min(3));
    let octave_of_square = shape.stride_log + octave.octave;
    if octave_of_square == 0 {
        codes::derived(rules, scratch, octave);
        special::others(form, scratch, coder, truth, octave);
    } else {
        codes::coded(rules, scratch, coder, truth, octave, octave_of_square);
    }
    for (i, words) in records.chunks_exact_mut(form.words()).enumerate() {
        let parts = if scratch.kinds[i] == IS_INERT {
            form.inert()
        } else {
            let [error, radius] = [scratch.flat_errors[i], scratch.flat_radii[i]];
            Parts { height: scratch.flat_heights[i], error, radius }
        };
        form.put(parts, words);
    }
}

/// All heights of an octave: whites, then blacks.
fn heights(
    form: Form,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
    coded: u32,
) {
    let (m, whites) = (octave.m, octave.whites());
    let first = HEIGHTS + 2 * coded as u16 * HEIGHT_CLASSES;
    let Scratch { heights, predicted, uneven, .. } = scratch;
    heights.predict_whites::<Real>(m, &mut predicted[..whites], &mut uneven[..whites]);
    residuals(form, scratch, coder, truth, 0..whites, first);
    let Scratch { heights, predicted, uneven, values, .. } = scratch;
    heights.take_whites(m, &values[..whites]);
    heights.ring_whites(m);
    heights.predict_blacks::<Real>(m, &mut predicted[octave.blacks()], &mut uneven[octave.blacks()]);
    residuals(form, scratch, coder, truth, octave.blacks(), first + HEIGHT_CLASSES);
}

/// Makes heights of what was predicted for some vertices. Those that are inert have none.
fn residuals(
    form: Form,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    range: Range<usize>,
    first: u16,
) {
    let mantissa = match form {
        Form::Fine => None,
        Form::Single => Some(23),
        Form::Double => Some(52),
    };
    let Scratch { kinds, flat_heights, values, numbers, contexts, heads, chosen, predicted, uneven, .. } =
        scratch;
    chosen.clear();
    for i in range {
        flat_heights[i] = form.nearest(predicted[i]);
        values[i] = form.value(flat_heights[i]);
        if kinds[i] != IS_INERT {
            chosen.push(i as u32);
        }
    }
    let (numbers, contexts) = (&mut numbers[..chosen.len()], &mut contexts[..chosen.len()]);
    if let Some(truth) = truth {
        for (number, i) in numbers.iter_mut().zip(&*chosen) {
            let (parts, expected) = (&truth[*i as usize], flat_heights[*i as usize]);
            // What another tile gives, and is inert, may have any height here.
            let height = if *parts == form.inert() { expected } else { parts.height };
            *number = form.residual(height, expected);
        }
    }
    let of = Row { bits: form.height_bits(), most: u16::MAX, first, kept: 8 };
    let low = shift(coder, &of, truth.map(|_| &*numbers));
    for (context, i) in contexts.iter_mut().zip(&*chosen) {
        *context = class_of(uneven[*i as usize], values[*i as usize], mantissa, low);
    }
    row(coder, &of, low, contexts, numbers, heads);
    for (number, i) in numbers.iter().zip(&*chosen) {
        let i = *i as usize;
        flat_heights[i] = form.restored(*number, flat_heights[i]);
        values[i] = form.value(flat_heights[i]);
    }
}

/// The lattice that the next octave refines, with codes as far as this tile gives them and they say something of others.
fn next_lattice(shape: &TileShape, scratch: &mut Scratch, octave: &Octave) {
    let (m, easts) = (octave.m, octave.easts());
    let Scratch { heights, errors, radii, kinds, values, flat_errors, flat_radii, .. } = scratch;
    let (east, north) = values[octave.blacks()].split_at(easts);
    heights.merge(m, east, north);
    if octave.octave >= shape.delivered() {
        return;
    }
    for (lattices, flat) in [(errors, flat_errors), (radii, flat_radii)] {
        for i in octave.blacks().filter(|i| kinds[*i] != ORDINARY || !octave.is_given(*i)) {
            flat[i] = UNKNOWN;
        }
        let (east, north) = flat[octave.blacks()].split_at(easts);
        lattices.merge(m, east, north);
    }
}
