//! Errors and radii of ordinary vertices: what follows from heights, or what is missing to the parents'.

use super::form::{Form, Parts, folded, unfolded};
use super::heights::half_octaves;
use super::numbers::{Row, row, shift};
use super::rules::Rules;
use super::scratch::{Scratch, UNKNOWN};
use crate::packed::coder::Coder;
use crate::packed::model::{ERRORS, RADII};
use crate::packed::walk::{ORDINARY, Octave};

/// Class of errors whose parents are not known.
const NO_PARENTS: i64 = 31;
/// Contexts of whites; those of blacks follow.
const COLOUR: u8 = 32;
/// Half octaves of a slope, from a 64th on, have classes of their own.
const SLOPES: i64 = 16;

/// What lies around a vertex.
#[derive(Debug, Clone, Copy)]
struct Around {
    /// Heights at the ends of the edge that it splits.
    ends: [f64; 2],
    /// The largest difference between the corners of its diamond.
    range: f64,
    /// Errors and radii of its parents.
    errors: [u32; 2],
    radii: [u32; 2],
}

impl Around {
    fn white(scratch: &Scratch, octave: &Octave, i: usize) -> Self {
        let (x, y) = ((i % octave.m) as isize, (i / octave.m) as isize);
        let e = |(dx, dy): (isize, isize)| scratch.heights.coarse.at(x + dx, y + dy);
        let [edge, parents] = diagonals(x, y);
        let (ends, apexes) = (edge.map(e), parents.map(e));
        Self {
            ends,
            range: range([ends[0], ends[1], apexes[0], apexes[1]]),
            errors: parents.map(|(dx, dy)| scratch.errors.coarse.at(x + dx, y + dy)),
            radii: parents.map(|(dx, dy)| scratch.radii.coarse.at(x + dx, y + dy)),
        }
    }

    fn black(scratch: &Scratch, octave: &Octave, i: usize) -> Self {
        let (x, y, is_east) = black_place(octave, i);
        let ends = black_ends(scratch, octave, i);
        let whites = [if is_east { (0, -1) } else { (-1, 0) }, (0, 0)];
        let apexes = whites.map(|(dx, dy)| scratch.heights.whites.at(x + dx, y + dy));
        Self {
            ends,
            range: range([ends[0], ends[1], apexes[0], apexes[1]]),
            errors: whites.map(|(dx, dy)| scratch.errors.whites.at(x + dx, y + dy)),
            radii: whites.map(|(dx, dy)| scratch.radii.whites.at(x + dx, y + dy)),
        }
    }
}

/// Steps from a white's south-west corner to the ends of its edge, and to the other corners of its cell.
fn diagonals(x: isize, y: isize) -> [[(isize, isize); 2]; 2] {
    let (rising, falling) = ([(0, 0), (1, 1)], [(1, 0), (0, 1)]);
    if (x ^ y) & 1 == 0 { [rising, falling] } else { [falling, rising] }
}

/// Heights at the ends of a white's edge.
fn white_ends(scratch: &Scratch, octave: &Octave, i: usize) -> [f64; 2] {
    let (x, y) = ((i % octave.m) as isize, (i / octave.m) as isize);
    diagonals(x, y)[0].map(|(dx, dy)| scratch.heights.coarse.at(x + dx, y + dy))
}

/// Column and row of a black one among those of its lattice, and whether its edge runs east.
fn black_place(octave: &Octave, i: usize) -> (isize, isize, bool) {
    let i = i - octave.whites();
    let is_east = i < octave.easts();
    let (i, wide) = if is_east { (i, octave.m) } else { (i - octave.easts(), octave.m + 1) };
    ((i % wide) as isize, (i / wide) as isize, is_east)
}

/// Heights at the ends of a black one's edge.
fn black_ends(scratch: &Scratch, octave: &Octave, i: usize) -> [f64; 2] {
    let (x, y, is_east) = black_place(octave, i);
    let (dx, dy) = if is_east { (1, 0) } else { (0, 1) };
    let e = &scratch.heights.coarse;
    [e.at(x, y), e.at(x + dx, y + dy)]
}

fn range([a, b, c, d]: [f64; 4]) -> f64 {
    a.max(b).max(c.max(d)) - a.min(b).min(c.min(d))
}

/// Codes of levels 0 and 1, which follow from heights.
pub(super) fn derived(rules: &Rules, scratch: &mut Scratch, octave: &Octave) {
    let (m, whites, easts) = (octave.m, octave.whites(), octave.easts());
    for i in whites..octave.count() {
        let [b, d] = black_ends(scratch, octave, i);
        if scratch.kinds[i] == ORDINARY {
            scratch.flat_errors[i] = rules.step(scratch.values[i], b, d);
            scratch.flat_radii[i] = 0;
        }
    }
    for i in (0..whites).filter(|i| scratch.kinds[*i] == ORDINARY) {
        let [b, d] = white_ends(scratch, octave, i);
        let v = scratch.values[i];
        let north = whites + easts + i / m * (m + 1) + i % m;
        let children = [north, north + 1, whites + i, whites + i + m];
        // Those that are not ordinary make it fringe, unless no tile gives them: then their own error follows from heights all the same.
        let errors = children.map(|child| match scratch.kinds[child] {
            ORDINARY => scratch.flat_errors[child],
            _ => 0,
        });
        let error = rules.step(v, b, d).max(errors.into_iter().max().unwrap_or(0));
        let [west, east, south, north] = children.map(|child| scratch.values[child]);
        scratch.flat_errors[i] = error;
        scratch.flat_radii[i] = rules.radius(v, [west, east], [south, north]);
    }
}

/// Codes of coarser levels: whites from the blacks of the octave before, blacks from the whites.
pub(super) fn coded(
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
    octave_of_square: u32,
) {
    let level = 2 * octave_of_square as usize;
    take(rules, scratch, coder, truth, octave, true, octave_of_square, level + 1);
    let (m, whites) = (octave.m, octave.whites());
    for (lattices, flat) in
        [(&mut scratch.errors, &scratch.flat_errors), (&mut scratch.radii, &scratch.flat_radii)]
    {
        lattices.whites.fill(m, m, UNKNOWN);
        lattices.take_whites(m, &flat[..whites]);
        for i in (0..whites).filter(|i| scratch.kinds[*i] != ORDINARY) {
            lattices.whites.set((i % m) as isize, (i / m) as isize, UNKNOWN);
        }
    }
    take(rules, scratch, coder, truth, octave, false, octave_of_square, level);
}

/// Errors, then radii, of the ordinary whites or blacks whose records the tile gives.
#[expect(clippy::too_many_arguments, reason = "the walk's own, taken apart")]
fn take(
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
    is_white: bool,
    octave_of_square: u32,
    level: usize,
) {
    let form = rules.form();
    let (bits, mask) = (form.code_bits(), form.code_mask());
    let range = if is_white { 0..octave.whites() } else { octave.blacks() };
    let mut chosen = std::mem::take(&mut scratch.chosen);
    chosen.clear();
    chosen.extend(range.filter(|i| scratch.kinds[*i] == ORDINARY && octave.is_given(*i)).map(|i| i as u32));
    let first = if is_white { 0 } else { COLOUR };
    for is_radius in [false, true] {
        for (at, i) in chosen.iter().map(|i| *i as usize).enumerate() {
            let around =
                if is_white { Around::white(scratch, octave, i) } else { Around::black(scratch, octave, i) };
            let (expected, class) = if is_radius && form == Form::Fine {
                let known = around.radii.into_iter().filter(|radius| *radius != UNKNOWN).max();
                let expected = known.unwrap_or(0);
                let steep = rules.slope_radius(level, 0.5 * rules.slope(around.range, octave_of_square));
                (expected, radius_class(expected, steep))
            } else if is_radius {
                let slope = rules.slope(around.range, octave_of_square);
                let parents = around.radii.into_iter().filter(|radius| *radius != UNKNOWN).max();
                // Half octaves from a 64th on.
                let class = (half_octaves(slope) - half_octaves(1.0) + 12).clamp(0, SLOPES - 1);
                let known = if parents.is_some() { SLOPES } else { 0 };
                (rules.expected_radius(level, parents, slope), class + known)
            } else {
                let parents = around.errors.into_iter().filter(|error| *error != UNKNOWN).min();
                let [b, d] = around.ends;
                let own = rules.step(scratch.values[i], b, d);
                match parents {
                    Some(most) if form == Form::Fine => (most, codes_between(most, own)),
                    Some(most) => (most, errors_between(most, own, bits)),
                    None => (rules.of_range(around.range), NO_PARENTS),
                }
            };
            scratch.expected[at] = expected;
            let first = if is_radius && form == Form::Fine { 0 } else { first };
            scratch.contexts[at] = first + class as u8;
            // Errors are no larger than the parents'; where these are not known, and radii, lie on either side.
            let is_folded = is_radius || class == NO_PARENTS;
            scratch.is_folded[at] = is_folded;
            if let Some(truth) = truth {
                let code = if is_radius { truth[i].radius } else { truth[i].error };
                scratch.numbers[at] = if is_folded {
                    folded(u64::from(code.wrapping_sub(expected)), bits)
                } else {
                    u64::from(expected.wrapping_sub(code) & mask)
                };
            }
        }
        let count = chosen.len();
        let of =
            Row { bits, most: u16::from(u8::MAX), first: if is_radius { RADII } else { ERRORS }, kept: 5 };
        let Scratch { numbers, contexts, heads, expected, is_folded, flat_errors, flat_radii, .. } =
            &mut *scratch;
        let low = shift(coder, &of, truth.map(|_| &numbers[..count]));
        row(coder, &of, low, &contexts[..count], &mut numbers[..count], heads);
        let flat = if is_radius { flat_radii } else { flat_errors };
        for (at, i) in chosen.iter().enumerate() {
            let (number, expected) = (numbers[at], expected[at]);
            let code = if is_folded[at] {
                expected.wrapping_add(unfolded(number) as u32)
            } else {
                expected.wrapping_sub(number as u32)
            };
            flat[*i as usize] = code & mask;
        }
    }
    scratch.chosen = chosen;
}

/// The class of an error between the parents' code and its own, of fine records.
fn codes_between(most: u32, own: u32) -> i64 {
    let between = i64::from(most.saturating_sub(own));
    let quarters = between >> 2;
    if quarters == 0 {
        return between;
    }
    (3 + quarters.min(12) + ((quarters - 12).clamp(0, 12) >> 1) + ((quarters - 24).clamp(0, 88) >> 3)).min(30)
}

/// The class of a fine record's radius, from the parents' larger code and the code of what slopes around it make of flat ground.
fn radius_class(expected: u32, steep: u32) -> i64 {
    let (expected, steep) = (i64::from(expected), i64::from(steep));
    let more = expected - steep;
    let steps = 7 + more.clamp(-7, 5) + ((more - 5).clamp(0, 23) >> 3);
    let size = [4, 10, 18].into_iter().filter(|size| expected >= *size).count() as i64;
    16 * size + steps
}

/// The class of an error between the parents' and its own.
fn errors_between(most: u32, own: u32, bits: u32) -> i64 {
    let between = (most.saturating_sub(own) >> (bits - 16)) + 1;
    let octave = between.ilog2();
    let half = if octave == 0 { 0 } else { between >> (octave - 1) & 1 };
    i64::from((2 * octave + half).min(30))
}
