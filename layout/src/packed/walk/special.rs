//! Vertices that are not ordinary ones: inert, fringe, or with other codes than follow from heights. They lie beside voids and at the data's border.

use super::{FRINGE_CODE, IS_FRINGE, IS_INERT, ORDINARY, Octave, Scratch};
use crate::packed::coder::Coder;
use crate::packed::model::{FRINGE_ERRORS, FRINGE_RADII, KINDS, OTHER_ERRORS, OTHER_RADII};
use crate::packed::tile::INERT;
use crate::packed::token::{folded8, unfolded8};

/// Kinds of an inert, fringe or ordinary vertex.
const KIND_COUNT: u16 = 3;
/// First context of whether a vertex has other codes than follow from heights.
pub(in crate::packed) const OTHERS: u16 = KINDS + KIND_COUNT * KIND_COUNT;

/// Kinds of all vertices of an octave, where any is not ordinary; whether that is so. Of vertices whose records other tiles give, what is fringe counts as ordinary.
#[inline(always)]
pub(super) fn kinds(
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[u32]>,
    octave: &Octave,
) -> bool {
    let may_be_other = |record: &u32| *record == INERT || record.to_le_bytes()[2] >= FRINGE_CODE;
    if truth.is_some_and(|truth| !truth.iter().fold(false, |any, record| any | may_be_other(record))) {
        scratch.kinds[..octave.count()].fill(ORDINARY);
    } else if let Some(truth) = truth {
        for ((i, kind), &record) in scratch.kinds.iter_mut().enumerate().zip(truth) {
            *kind = match record.to_le_bytes()[2] {
                _ if record == INERT => IS_INERT,
                FRINGE_CODE.. if octave.is_given(i) => IS_FRINGE,
                _ => ORDINARY,
            };
        }
    }
    if !coded_kinds(&mut scratch.kinds, coder, octave, truth.is_some()) {
        return false;
    }
    for i in (0..octave.count()).filter(|i| scratch.kinds[*i] == IS_INERT) {
        (scratch.flat_errors[i], scratch.flat_radii[i]) = (0, 255);
    }
    true
}

/// Brings the kinds of an octave's vertices through a coder, which begin as the writer has them; whether any is not ordinary. Otherwise what they are is not said.
#[inline(always)]
pub(in crate::packed) fn coded_kinds(
    kinds: &mut [u8],
    coder: &mut dyn Coder,
    octave: &Octave,
    is_writing: bool,
) -> bool {
    let is_any = is_writing && kinds[..octave.count()].iter().fold(0, |all, kind| all | kind) != ORDINARY;
    let mut is_special = u16::from(is_any);
    coder.raw(1, &mut is_special);
    if is_special == 0 {
        return false;
    }
    for i in 0..octave.count() {
        let [west, south] = octave.before(i).map(|at| at.map_or(ORDINARY, |at| kinds[at]));
        let mut kind = u16::from(kinds[i]);
        coder.value(KINDS + KIND_COUNT * u16::from(west) + u16::from(south), i, &mut kind);
        // What no writer makes is taken for ordinary.
        kinds[i] = match kind as u8 {
            IS_FRINGE if !octave.is_given(i) => ORDINARY,
            kind @ (IS_INERT | IS_FRINGE) => kind,
            _ => ORDINARY,
        };
    }
    true
}

/// Codes of the fringe vertices, each after the one before it.
pub(super) fn fringe(scratch: &mut Scratch, coder: &mut dyn Coder, truth: Option<&[u32]>, octave: &Octave) {
    let of: Vec<usize> = (0..octave.count()).filter(|i| scratch.kinds[*i] == IS_FRINGE).collect();
    let codes = |i: usize| truth.map_or([0; 2], |truth| codes_of(truth[i]));
    let mut last = 0;
    for (turn, &i) in of.iter().enumerate() {
        let [error, radius] = codes(i);
        let mut value = u16::from(error.wrapping_sub(FRINGE_CODE));
        coder.value(FRINGE_ERRORS, 2 * turn, &mut value);
        scratch.flat_errors[i] = FRINGE_CODE.wrapping_add(value as u8);
        let mut value = folded8(radius.wrapping_sub(last));
        coder.value(FRINGE_RADII, 2 * turn + 1, &mut value);
        last = last.wrapping_add(unfolded8(value));
        scratch.flat_radii[i] = last;
    }
}

/// Codes that are others than follow from heights, where there are any.
#[inline(always)]
pub(super) fn others(
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[u32]>,
    octave: &Octave,
    is_special: bool,
) {
    let is_asked =
        |scratch: &Scratch, i: usize| (!is_special || scratch.kinds[i] == ORDINARY) && octave.is_given(i);
    let differs = |scratch: &Scratch, i: usize| {
        let codes = truth.map(|truth| codes_of(truth[i]));
        codes.is_some_and(|codes| codes != [scratch.flat_errors[i], scratch.flat_radii[i]])
    };
    let count = octave.count();
    // Nearly none differs, and to look whether it does is quick where nothing ends the look.
    let codes = scratch.flat_errors.iter().zip(&scratch.flat_radii);
    let is_other = |any: u32, (record, (error, radius)): (&u32, (&u8, &u8))| {
        any | (record >> 16) ^ (u32::from(*error) | u32::from(*radius) << 8)
    };
    let may_be_any = truth.is_some_and(|truth| truth.iter().zip(codes).fold(0, is_other) != 0);
    let are_any = may_be_any && (0..count).any(|i| differs(scratch, i) && is_asked(scratch, i));
    let mut are_any = u16::from(are_any);
    coder.raw(1, &mut are_any);
    if are_any == 0 {
        return;
    }
    let mut is_other = vec![false; count];
    let mut turn = 0;
    for i in 0..count {
        if !is_asked(scratch, i) {
            continue;
        }
        let [west, south] = octave.before(i).map(|at| u16::from(at.is_some_and(|at| is_other[at])));
        let mut value = u16::from(differs(scratch, i));
        coder.value(OTHERS + 2 * west + south, turn, &mut value);
        is_other[i] = value == 1;
        turn += 1;
        if !is_other[i] {
            continue;
        }
        let [error, radius] = truth.map_or([0; 2], |truth| codes_of(truth[i]));
        for (context, code, truth) in [
            (OTHER_ERRORS, &mut scratch.flat_errors[i], error),
            (OTHER_RADII, &mut scratch.flat_radii[i], radius),
        ] {
            let mut value = folded8(truth.wrapping_sub(*code));
            coder.value(context, turn, &mut value);
            *code = code.wrapping_add(unfolded8(value));
            turn += 1;
        }
    }
}

/// Error and radius code of a record.
pub(super) fn codes_of(record: u32) -> [u8; 2] {
    let [_, _, error, radius] = record.to_le_bytes();
    [error, radius]
}
