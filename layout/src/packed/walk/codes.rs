//! Error and radius codes of ordinary vertices: what follows from heights, or what is missing to the parents' codes.

use super::special::codes_of;
use super::{ORDINARY, Octave, Scratch};
use crate::packed::coder::Coder;
use crate::packed::model::{ERRORS, RADII};
use crate::packed::rules::{Rules, TOP_ERROR, slope_place};
use crate::packed::tile::TileRecords;
use crate::packed::token::{folded8, unfolded8};

/// Codes of levels 0 and 1, which follow from heights.
pub(super) fn derived(rules: &Rules, scratch: &mut Scratch, octave: &Octave) {
    let (m, whites, easts) = (octave.m, octave.whites(), octave.easts());
    let Scratch { heights, kinds, flat_errors, flat_radii, errors, .. } = scratch;
    let side = m + 1;
    for j in 0..side {
        let y = j as isize;
        let (low, high, at) =
            (heights.coarse.row(0, y, m), heights.coarse.row(1, y, m), heights.east.row(0, y, m));
        let codes = errors.east.row_mut(0, y, m);
        for i in 0..m {
            codes[i] = rules.step(2 * at[i] - low[i] - high[i]);
        }
    }
    for j in 0..m {
        let y = j as isize;
        let (low, high) = (heights.coarse.row(0, y, side), heights.coarse.row(0, y + 1, side));
        let at = heights.north.row(0, y, side);
        let codes = errors.north.row_mut(0, y, side);
        for i in 0..side {
            codes[i] = rules.step(2 * at[i] - low[i] - high[i]);
        }
    }
    let mut put = |i: usize, error: u8, radius: u8| {
        if kinds[i] == ORDINARY {
            (flat_errors[i], flat_radii[i]) = (error, radius);
        }
    };
    for j in 0..m {
        let y = j as isize;
        let v = heights.whites.row(0, y, m);
        let (south, north) = (heights.coarse.row(0, y, side), heights.coarse.row(0, y + 1, side));
        let beside = heights.north.row(0, y, side);
        let (below, above) = (heights.east.row(0, y, m), heights.east.row(0, y + 1, m));
        let of_beside = errors.north.row(0, y, side);
        let (of_below, of_above) = (errors.east.row(0, y, m), errors.east.row(0, y + 1, m));
        for i in 0..m {
            let ends = if (i ^ j) & 1 == 0 { south[i] + north[i + 1] } else { south[i + 1] + north[i] };
            let own = rules.step(2 * v[i] - ends);
            let error = own.max(of_beside[i]).max(of_beside[i + 1]).max(of_below[i]).max(of_above[i]);
            let apart = |a: i32, b: i32| (v[i] - a).abs().max((v[i] - b).abs());
            put(j * m + i, error, rules.radius(apart(beside[i], beside[i + 1]), apart(below[i], above[i])));
        }
    }
    for j in 0..side {
        errors
            .east
            .row(0, j as isize, m)
            .iter()
            .enumerate()
            .for_each(|(i, code)| put(whites + j * m + i, *code, 0));
    }
    for j in 0..m {
        let row = errors.north.row(0, j as isize, side);
        row.iter().enumerate().for_each(|(i, code)| put(whites + easts + j * side + i, *code, 0));
    }
}

/// Codes of coarser levels: whites from the blacks of the octave before, blacks from the whites.
pub(super) fn coded<C: Coder>(
    rules: &Rules,
    scratch: &mut Scratch,
    coder: &mut C,
    truth: Option<&TileRecords>,
    octave: &Octave,
    octave_of_square: u32,
    is_special: bool,
) {
    let count = octave.count();
    for flat in [
        &mut scratch.contexts,
        &mut scratch.most_errors,
        &mut scratch.radius_contexts,
        &mut scratch.least_radii,
    ] {
        flat.resize(count.max(flat.len()), 0);
    }
    let slopes = rules.slopes(octave_of_square);
    white_contexts(rules, slopes, scratch, octave);
    take(scratch, coder, truth, octave, 0..octave.whites(), is_special);
    spread_whites(scratch, octave);
    black_contexts(rules, slopes, scratch, octave);
    take(scratch, coder, truth, octave, octave.whites()..count, is_special);
    spread_blacks(scratch, octave);
}

/// What is around a vertex that its codes depend on.
struct Around {
    is_black: bool,
    near: [i32; 4],
    apart: i32,
    errors: [u8; 2],
    radii: [u8; 2],
}

impl Around {
    /// Context of the error code, most it may be, context of the radius code, and what that is likely to be.
    #[inline(always)]
    fn contexts(&self, rules: &Rules, slopes: &[u8; 256]) -> [u8; 4] {
        let most = self.errors[0].min(self.errors[1]).min(TOP_ERROR);
        let radius = self.radii[0].max(self.radii[1]);
        let [a, b, c, d] = self.near;
        let range = a.max(b).max(c.max(d)) - a.min(b).min(c.min(d));
        let missing = (i32::from(most) - i32::from(rules.step(self.apart))).clamp(0, 255);
        let fine = missing.min(12) + ((missing - 12).clamp(0, 12) >> 1) + ((missing - 24).clamp(0, 88) >> 3);
        let error_context = 32 * i32::from(self.is_black) + fine.min(29);
        let beyond = i32::from(radius) - i32::from(slopes[slope_place(range)]);
        let steps = beyond.clamp(-6, 5) + ((beyond - 5).clamp(0, 23) >> 3) + ((beyond + 6).clamp(-8, 0) >> 3);
        let size = i32::from(radius >= 6) + i32::from(radius >= 20) + i32::from(radius >= 60);
        [error_context as u8, most, (16 * size + steps + 7) as u8, radius]
    }
}

fn white_contexts(rules: &Rules, slopes: &[u8; 256], scratch: &mut Scratch, octave: &Octave) {
    let m = octave.m;
    let Scratch { heights, errors, radii, contexts, most_errors, radius_contexts, least_radii, .. } = scratch;
    for j in 0..m {
        let y = j as isize;
        let v = heights.whites.row(0, y, m);
        let rows = [heights.coarse.row(0, y, m + 1), heights.coarse.row(0, y + 1, m + 1)];
        let of_errors = [errors.coarse.row(0, y, m + 1), errors.coarse.row(0, y + 1, m + 1)];
        let of_radii = [radii.coarse.row(0, y, m + 1), radii.coarse.row(0, y + 1, m + 1)];
        for i in 0..m {
            let near = [rows[0][i], rows[1][i + 1], rows[0][i + 1], rows[1][i]];
            // The ends of the edge it splits lie on one diagonal, its parents on the other.
            let climbs = (i ^ j) & 1 == 0;
            let ends = if climbs { near[0] + near[1] } else { near[2] + near[3] };
            let parents = |rows: [&[u8]; 2]| {
                if climbs { [rows[0][i + 1], rows[1][i]] } else { [rows[0][i], rows[1][i + 1]] }
            };
            let around = Around {
                is_black: false,
                near,
                apart: 2 * v[i] - ends,
                errors: parents(of_errors),
                radii: parents(of_radii),
            };
            let at = j * m + i;
            [contexts[at], most_errors[at], radius_contexts[at], least_radii[at]] =
                around.contexts(rules, slopes);
        }
    }
}

fn black_contexts(rules: &Rules, slopes: &[u8; 256], scratch: &mut Scratch, octave: &Octave) {
    let m = octave.m;
    let Scratch { heights, errors, radii, contexts, most_errors, radius_contexts, least_radii, .. } = scratch;
    let mut at = octave.whites();
    let mut put = |around: Around| {
        [contexts[at], most_errors[at], radius_contexts[at], least_radii[at]] =
            around.contexts(rules, slopes);
        at += 1;
    };
    for j in 0..=m {
        let y = j as isize;
        let (v, e) = (heights.east.row(0, y, m), heights.coarse.row(0, y, m + 1));
        let w = [heights.whites.row(0, y - 1, m), heights.whites.row(0, y, m)];
        let of_errors = [errors.whites.row(0, y - 1, m), errors.whites.row(0, y, m)];
        let of_radii = [radii.whites.row(0, y - 1, m), radii.whites.row(0, y, m)];
        for i in 0..m {
            put(Around {
                is_black: true,
                near: [e[i], e[i + 1], w[0][i], w[1][i]],
                apart: 2 * v[i] - e[i] - e[i + 1],
                errors: of_errors.map(|row| row[i]),
                radii: of_radii.map(|row| row[i]),
            });
        }
    }
    for j in 0..m {
        let y = j as isize;
        let v = heights.north.row(0, y, m + 1);
        let e = [heights.coarse.row(0, y, m + 1), heights.coarse.row(0, y + 1, m + 1)];
        let w = heights.whites.row(-1, y, m + 2);
        let (of_errors, of_radii) = (errors.whites.row(-1, y, m + 2), radii.whites.row(-1, y, m + 2));
        for i in 0..=m {
            put(Around {
                is_black: true,
                near: [e[0][i], e[1][i], w[i], w[i + 1]],
                apart: 2 * v[i] - e[0][i] - e[1][i],
                errors: [of_errors[i], of_errors[i + 1]],
                radii: [of_radii[i], of_radii[i + 1]],
            });
        }
    }
}

/// Error codes, then radius codes, of ordinary vertices of a range whose records the tile gives.
fn take<C: Coder>(
    scratch: &mut Scratch,
    coder: &mut C,
    truth: Option<&TileRecords>,
    octave: &Octave,
    range: std::ops::Range<usize>,
    is_special: bool,
) {
    let Scratch {
        kinds,
        flat_errors,
        flat_radii,
        contexts,
        most_errors,
        radius_contexts,
        least_radii,
        chosen,
        chosen_contexts,
        values,
        ..
    } = scratch;
    chosen.clear();
    chosen.extend(
        range.filter(|i| octave.is_given(*i) && (!is_special || kinds[*i] == ORDINARY)).map(|i| i as u32),
    );
    values.resize(chosen.len(), 0);
    let codes = |i: usize| truth.map_or([0; 2], |truth| codes_of(truth.at(octave.place(i))));
    for is_radius in [false, true] {
        chosen_contexts.clear();
        let of_what = if is_radius { &*radius_contexts } else { &*contexts };
        chosen_contexts.extend(chosen.iter().map(|i| of_what[*i as usize]));
        if truth.is_some() {
            for (value, i) in values.iter_mut().zip(&*chosen) {
                let i = *i as usize;
                let [error, radius] = codes(i);
                *value = if is_radius {
                    folded8(radius.wrapping_sub(least_radii[i]))
                } else {
                    u16::from(most_errors[i].wrapping_sub(error))
                };
            }
        }
        coder.values(if is_radius { RADII } else { ERRORS }, chosen_contexts, values);
        for (value, i) in values.iter().zip(&*chosen) {
            let i = *i as usize;
            if is_radius {
                flat_radii[i] = least_radii[i].wrapping_add(unfolded8(*value));
            } else {
                flat_errors[i] = most_errors[i].wrapping_sub(*value as u8);
            }
        }
    }
}

/// Whites' codes into their planes, and unknown ones around them.
fn spread_whites(scratch: &mut Scratch, octave: &Octave) {
    let m = octave.m;
    let Scratch { errors, radii, flat_errors, flat_radii, .. } = scratch;
    errors.whites.fill(m, m, TOP_ERROR);
    radii.whites.fill(m, m, 0);
    for j in 0..m {
        errors.whites.row_mut(0, j as isize, m).copy_from_slice(&flat_errors[j * m..(j + 1) * m]);
        radii.whites.row_mut(0, j as isize, m).copy_from_slice(&flat_radii[j * m..(j + 1) * m]);
    }
}

fn spread_blacks(scratch: &mut Scratch, octave: &Octave) {
    let m = octave.m;
    let Scratch { errors, radii, flat_errors, flat_radii, .. } = scratch;
    for (lattices, flat) in [(errors, &*flat_errors), (radii, &*flat_radii)] {
        let (east, north) = flat[octave.whites()..octave.count()].split_at(octave.easts());
        for (j, row) in east.chunks_exact(m).enumerate() {
            lattices.east.row_mut(0, j as isize, m).copy_from_slice(row);
        }
        for (j, row) in north.chunks_exact(m + 1).enumerate() {
            lattices.north.row_mut(0, j as isize, m + 1).copy_from_slice(row);
        }
    }
}
