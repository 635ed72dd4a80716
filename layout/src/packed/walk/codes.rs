//! Error and radius codes of ordinary vertices: what follows from heights, or what is missing to the parents' codes.
//!
//! Each step goes through whole rows: arithmetic that a processor does for many vertices at once, then looking up, one by one, then arithmetic.

use super::special::codes_of;
use super::{MOST, ORDINARY, Octave, Scratch};
use crate::packed::coder::Coder;
use crate::packed::model::{ERRORS, RADII};
use crate::packed::rules::{Rules, TOP_ERROR, slope_place};
use crate::packed::token::{folded8, unfolded8};

/// Rows with room for an octave. Of vertices on edges that run north there are only those whose records the tile gives, where codes are coded.
#[derive(Debug)]
pub(super) struct Rows {
    /// What error codes are looked up by, and, of whites, radius codes.
    apart: Vec<u32>,
    beside: Vec<u32>,
    along: Vec<u32>,
    /// Error code that a vertex has by itself.
    steps: Vec<u8>,
    /// Places of differences among slopes, and the radius codes there.
    places: Vec<u8>,
    slopes: Vec<u8>,
    /// What follows from the parents, or from heights.
    errors: Vec<u8>,
    radii: Vec<u8>,
    error_contexts: Vec<u8>,
    radius_contexts: Vec<u8>,
}

impl Default for Rows {
    fn default() -> Self {
        let (bytes, words) = (|| vec![0; MOST], || vec![0; MOST]);
        Self {
            apart: words(),
            beside: words(),
            along: words(),
            steps: bytes(),
            places: bytes(),
            slopes: bytes(),
            errors: bytes(),
            radii: bytes(),
            error_contexts: bytes(),
            radius_contexts: bytes(),
        }
    }
}

/// Looks numbers up.
#[inline(always)]
fn look_up<const COUNT: usize>(table: &[u8; COUNT], places: &[u32], found: &mut [u8]) {
    for (found, place) in found.iter_mut().zip(places) {
        *found = table[*place as usize & (COUNT - 1)];
    }
}

/// How far twice the heights of a row are from the sum of those at the ends of their edges.
#[inline(always)]
fn row_apart(of: &[i32], ends: [&[i32]; 2], apart: &mut [u32]) {
    let [a, b] = ends.map(|row| &row[..of.len()]);
    let apart = &mut apart[..of.len()];
    for i in 0..of.len() {
        apart[i] = (2 * of[i] - a[i] - b[i]).unsigned_abs();
    }
}

/// The same for a row of whites, which split one diagonal of their cells and the other in turn.
#[inline(always)]
fn white_row_apart(of: &[i32], low: &[i32], high: &[i32], j: usize, apart: &mut [u32]) {
    let m = of.len();
    let (low, high, apart) = (&low[..m + 1], &high[..m + 1], &mut apart[..m]);
    for i in 0..m {
        let ends = if (i ^ j) & 1 == 0 { low[i] + high[i + 1] } else { low[i + 1] + high[i] };
        apart[i] = (2 * of[i] - ends).unsigned_abs();
    }
}

/// Codes of levels 0 and 1, which follow from heights.
#[inline(always)]
pub(super) fn derived(rules: &Rules, scratch: &mut Scratch, octave: &Octave, is_special: bool) {
    let (m, side, whites, easts, count) =
        (octave.m, octave.m + 1, octave.whites(), octave.easts(), octave.count());
    let Scratch { heights, kinds, flat_heights, flat_errors, flat_radii, codes: rows, .. } = scratch;
    let (of_whites, blacks) = flat_heights[..count].split_at(whites);
    let (of_east, of_north) = blacks.split_at(easts);
    let e = |y: usize| heights.coarse.row(0, y as isize, side);
    for j in 0..m {
        let here = j * m..(j + 1) * m;
        let v = &of_whites[here.clone()];
        white_row_apart(v, e(j), e(j + 1), j, &mut rows.apart[here.clone()]);
        let north = &of_north[j * side..(j + 1) * side];
        row_farther(v, &north[..m], &north[1..], &mut rows.beside[here.clone()]);
        row_farther(v, &of_east[here.clone()], &of_east[(j + 1) * m..], &mut rows.along[here]);
    }
    for (j, v) in of_east.chunks_exact(m).enumerate() {
        row_apart(v, [e(j), &e(j)[1..]], &mut rows.apart[whites + j * m..]);
    }
    for (j, v) in of_north.chunks_exact(side).enumerate() {
        row_apart(v, [e(j), e(j + 1)], &mut rows.apart[whites + easts + j * side..]);
    }
    let (errors, radii) = if is_special {
        (&mut rows.errors[..count], &mut rows.radii[..count])
    } else {
        (&mut flat_errors[..count], &mut flat_radii[..count])
    };
    look_up(rules.steps(), &rows.apart, errors);
    look_up(rules.radii(0), &rows.beside[..whites], radii);
    look_up(rules.radii(1), &rows.along[..whites], &mut rows.slopes);
    radii.iter_mut().zip(&rows.slopes[..whites]).for_each(|(radius, other)| *radius = (*radius).max(*other));
    radii[whites..].fill(0);
    let (errors, blacks) = errors.split_at_mut(whites);
    let (of_east, of_north) = blacks.split_at(easts);
    for (j, row) in errors.chunks_exact_mut(m).enumerate() {
        let (below, above) = (&of_east[j * m..][..m], &of_east[(j + 1) * m..][..m]);
        let (west, east) = (&of_north[j * side..][..m], &of_north[j * side + 1..][..m]);
        for i in 0..row.len().min(m) {
            row[i] = row[i].max(below[i].max(above[i])).max(west[i].max(east[i]));
        }
    }
    if is_special {
        let ordinary = (0..count).filter(|i| kinds[*i] == ORDINARY);
        ordinary.for_each(|i| (flat_errors[i], flat_radii[i]) = (rows.errors[i], rows.radii[i]));
    }
}

/// The larger of a row's differences to two others.
#[inline(always)]
fn row_farther(of: &[i32], a: &[i32], b: &[i32], apart: &mut [u32]) {
    let (a, b, apart) = (&a[..of.len()], &b[..of.len()], &mut apart[..of.len()]);
    for i in 0..of.len() {
        apart[i] = (of[i] - a[i]).unsigned_abs().max((of[i] - b[i]).unsigned_abs());
    }
}

/// Codes of coarser levels: whites from the blacks of the octave before, blacks from the whites.
#[inline(always)]
pub(super) fn coded(
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[u32]>,
    octave: &Octave,
    octave_of_square: u32,
    is_special: bool,
) {
    let slopes = rules.slopes(octave_of_square);
    let whites = octave.whites();
    around_whites(scratch, octave);
    contexts(rules, slopes, &mut scratch.codes, whites, 0);
    take(scratch, coder, truth.map(|truth| &truth[..whites]), whites, 0, is_special);
    spread_whites(scratch, octave, is_special);

    let wide = octave.m + usize::from(octave.is_last[0]);
    let easts = octave.m * (octave.m + usize::from(octave.is_last[1]));
    let given = easts + octave.m * wide;
    around_blacks(scratch, octave, easts, wide);
    contexts(rules, slopes, &mut scratch.codes, given, 32);
    // Codes of those that run north lie one after the other, and so records and kinds have to.
    let (north, side) = (whites + octave.easts(), octave.m + 1);
    let truth = truth.map(|all| {
        let mut given = all[whites..whites + easts].to_vec();
        all[north..].chunks_exact(side).for_each(|row| given.extend(&row[..wide]));
        given
    });
    if is_special {
        for j in 0..octave.m {
            let from = north + j * side;
            scratch.kinds.copy_within(from..from + wide, whites + easts + j * wide);
        }
    }
    take(scratch, coder, truth.as_deref(), given, whites, is_special);
    spread_blacks(scratch, octave, easts, wide, is_special);
}

/// Whites' codes to where they belong, their planes included, with unknown ones around them. Those of what is not ordinary are there.
#[inline(always)]
fn spread_whites(scratch: &mut Scratch, octave: &Octave, is_special: bool) {
    let (m, whites) = (octave.m, octave.whites());
    let Scratch { errors, radii, flat_errors, flat_radii, kinds, codes: rows, .. } = scratch;
    let of = [(errors, flat_errors, &rows.errors, TOP_ERROR), (radii, flat_radii, &rows.radii, 0)];
    for (lattices, flat, codes, unknown) in of {
        spread(&mut flat[..whites], &codes[..whites], &kinds[..whites], is_special);
        lattices.whites.fill(m, m, unknown);
        lattices.take_whites(m, &flat[..whites]);
    }
}

#[inline(always)]
fn spread_blacks(scratch: &mut Scratch, octave: &Octave, easts: usize, wide: usize, is_special: bool) {
    let Scratch { flat_errors, flat_radii, kinds, codes: rows, .. } = scratch;
    let kinds = &kinds[octave.whites()..];
    for (flat, codes) in [(flat_errors, &rows.errors), (flat_radii, &rows.radii)] {
        let (of_east, of_north) = flat[octave.blacks()].split_at_mut(octave.easts());
        spread(&mut of_east[..easts], &codes[..easts], &kinds[..easts], is_special);
        for (j, row) in of_north.chunks_exact_mut(octave.m + 1).enumerate() {
            let here = easts + j * wide..easts + (j + 1) * wide;
            spread(&mut row[..wide], &codes[here.clone()], &kinds[here], is_special);
        }
    }
}

#[inline(always)]
fn spread(flat: &mut [u8], codes: &[u8], kinds: &[u8], is_special: bool) {
    if !is_special {
        flat.copy_from_slice(codes);
        return;
    }
    for ((flat, code), kind) in flat.iter_mut().zip(codes).zip(kinds) {
        *flat = if *kind == ORDINARY { *code } else { *flat };
    }
}

/// Differences, and what follows from the parents, for all whites.
#[inline(always)]
fn around_whites(scratch: &mut Scratch, octave: &Octave) {
    let m = octave.m;
    let Scratch { heights, errors, radii, flat_heights, codes: rows, .. } = scratch;
    for (j, v) in flat_heights[..octave.whites()].chunks_exact(m).enumerate() {
        let here = j * m..(j + 1) * m;
        let y = j as isize;
        let (low, high) = (heights.coarse.row(0, y, m + 1), heights.coarse.row(0, y + 1, m + 1));
        white_row_apart(v, low, high, j, &mut rows.apart[here.clone()]);
        row_places([low, &high[1..], &low[1..], high], &mut rows.places[here.clone()]);
        let [of_errors, of_radii] = [&*errors, &*radii]
            .map(|plane| [plane.coarse.row(0, y, m + 1), plane.coarse.row(0, y + 1, m + 1)]);
        // Ends of the edge that a white splits lie on one diagonal, its parents on the other.
        for (i, error) in rows.errors[here.clone()].iter_mut().enumerate() {
            let [a, b] = across(of_errors, i, j);
            *error = a.min(b).min(TOP_ERROR);
        }
        for (i, radius) in rows.radii[here].iter_mut().enumerate() {
            let [a, b] = across(of_radii, i, j);
            *radius = a.max(b);
        }
    }
}

#[inline(always)]
fn across([low, high]: [&[u8]; 2], i: usize, j: usize) -> [u8; 2] {
    if (i ^ j) & 1 == 0 { [low[i + 1], high[i]] } else { [low[i], high[i + 1]] }
}

/// The same for all blacks whose records the tile gives: as many that run east as `easts`, and `wide` in each row of the others.
#[inline(always)]
fn around_blacks(scratch: &mut Scratch, octave: &Octave, easts: usize, wide: usize) {
    let m = octave.m;
    let Scratch { heights, errors, radii, flat_heights, codes: rows, .. } = scratch;
    let (of_east, of_north) = flat_heights[octave.blacks()].split_at(octave.easts());
    for (j, v) in of_east[..easts].chunks_exact(m).enumerate() {
        let here = j * m..(j + 1) * m;
        let y = j as isize;
        let e = heights.coarse.row(0, y, m + 1);
        row_apart(v, [e, &e[1..]], &mut rows.apart[here.clone()]);
        let (south, north) = (heights.whites.row(0, y - 1, m), heights.whites.row(0, y, m));
        row_places([e, &e[1..], south, north], &mut rows.places[here.clone()]);
        row_parents(
            [errors.whites.row(0, y - 1, m), errors.whites.row(0, y, m)],
            [radii.whites.row(0, y - 1, m), radii.whites.row(0, y, m)],
            &mut rows.errors[here.clone()],
            &mut rows.radii[here],
        );
    }
    for (j, v) in of_north.chunks_exact(m + 1).enumerate() {
        let here = easts + j * wide..easts + (j + 1) * wide;
        let y = j as isize;
        let (low, high) = (heights.coarse.row(0, y, m + 1), heights.coarse.row(0, y + 1, m + 1));
        row_apart(&v[..wide], [low, high], &mut rows.apart[here.clone()]);
        let (west, east) = (heights.whites.row(-1, y, m + 1), heights.whites.row(0, y, m + 1));
        row_places([low, high, west, east], &mut rows.places[here.clone()]);
        row_parents(
            [errors.whites.row(-1, y, m + 1), errors.whites.row(0, y, m + 1)],
            [radii.whites.row(-1, y, m + 1), radii.whites.row(0, y, m + 1)],
            &mut rows.errors[here.clone()],
            &mut rows.radii[here],
        );
    }
}

/// The smaller error codes and the larger radius codes of two rows of parents.
#[inline(always)]
fn row_parents(of_errors: [&[u8]; 2], of_radii: [&[u8]; 2], errors: &mut [u8], radii: &mut [u8]) {
    let count = errors.len();
    let ([a, b], [c, d]) = (of_errors.map(|row| &row[..count]), of_radii.map(|row| &row[..count]));
    let radii = &mut radii[..count];
    for i in 0..count {
        errors[i] = a[i].min(b[i]).min(TOP_ERROR);
        radii[i] = c[i].max(d[i]);
    }
}

/// Places among slopes of the largest differences between four rows.
#[inline(always)]
fn row_places(near: [&[i32]; 4], places: &mut [u8]) {
    let [a, b, c, d] = near.map(|row| &row[..places.len()]);
    for i in 0..places.len() {
        let range = a[i].max(b[i]).max(c[i].max(d[i])) - a[i].min(b[i]).min(c[i].min(d[i]));
        places[i] = slope_place(range) as u8;
    }
}

/// Contexts of so many error and radius codes, those of errors from `first` on.
#[inline(always)]
fn contexts(rules: &Rules, slopes: &[u8; 256], rows: &mut Rows, count: usize, first: u8) {
    look_up(rules.steps(), &rows.apart[..count], &mut rows.steps);
    for (slope, place) in rows.slopes[..count].iter_mut().zip(&rows.places) {
        *slope = slopes[usize::from(*place)];
    }
    let of = rows.errors.iter().zip(&rows.steps);
    for (context, (most, step)) in rows.error_contexts[..count].iter_mut().zip(of) {
        let missing = most.saturating_sub(*step);
        let fine = missing.min(12)
            + (missing.saturating_sub(12).min(12) >> 1)
            + (missing.saturating_sub(24).min(88) >> 3);
        *context = first + fine.min(29);
    }
    let of = rows.radii.iter().zip(&rows.slopes);
    for (context, (radius, slope)) in rows.radius_contexts[..count].iter_mut().zip(of) {
        let (more, less) = (radius.saturating_sub(*slope), slope.saturating_sub(*radius));
        let steps = 7 + more.min(5) + (more.saturating_sub(5).min(23) >> 3) - less.min(7);
        let size = u8::from(*radius >= 6) + u8::from(*radius >= 20) + u8::from(*radius >= 60);
        *context = 16 * size + steps;
    }
}

/// Error codes, then radius codes, of the ordinary ones of a row of vertices, whose kinds begin at `kinds`. They replace what followed from the parents.
#[inline(always)]
fn take(
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[u32]>,
    count: usize,
    kinds: usize,
    is_special: bool,
) {
    let Scratch { kinds: all_kinds, chosen, chosen_contexts, values, codes: rows, .. } = scratch;
    let Rows { errors, radii, error_contexts, radius_contexts, .. } = rows;
    if is_special {
        chosen.clear();
        let kinds = &all_kinds[kinds..kinds + count];
        chosen.extend((0..count as u32).filter(|i| kinds[*i as usize] == ORDINARY));
    }
    for (is_radius, codes, contexts) in [(false, errors, error_contexts), (true, radii, radius_contexts)] {
        let (codes, contexts) = (&mut codes[..count], &contexts[..count]);
        let first = if is_radius { RADII } else { ERRORS };
        let value_of = |code: u8, record: u32| match codes_of(record) {
            [_, radius] if is_radius => folded8(radius.wrapping_sub(code)),
            [error, _] => u16::from(code.wrapping_sub(error)),
        };
        let code_of = |code: u8, value: u16| {
            if is_radius { code.wrapping_add(unfolded8(value)) } else { code.wrapping_sub(value as u8) }
        };
        if is_special {
            chosen_contexts.clear();
            chosen_contexts.extend(chosen.iter().map(|i| contexts[*i as usize]));
            let values = &mut values[..chosen.len()];
            if let Some(truth) = truth {
                for (value, i) in values.iter_mut().zip(&*chosen) {
                    *value = value_of(codes[*i as usize], truth[*i as usize]);
                }
            }
            coder.values(first, chosen_contexts, values);
            for (value, i) in values.iter().zip(&*chosen) {
                codes[*i as usize] = code_of(codes[*i as usize], *value);
            }
            continue;
        }
        let values = &mut values[..count];
        if let Some(truth) = truth {
            for ((value, code), record) in values.iter_mut().zip(&*codes).zip(truth) {
                *value = value_of(*code, *record);
            }
        }
        coder.values(first, contexts, values);
        codes.iter_mut().zip(&*values).for_each(|(code, value)| *code = code_of(*code, *value));
    }
}
