//! Vertices that are not ordinary: inert, fringe, or with another error or radius than follows from heights.

use super::form::{Form, Parts, folded, unfolded};
use super::numbers::single;
use super::scratch::Scratch;
use crate::packed::coder::Coder;
use crate::packed::model::{FRINGE_ERRORS, FRINGE_RADII, OTHER_ERRORS, OTHER_RADII};
use crate::packed::walk::special::{OTHERS, coded_kinds};
use crate::packed::walk::{IS_FRINGE, IS_INERT, ORDINARY, Octave};

/// Kinds of all vertices of an octave, where any is not ordinary; whether that is so. Of vertices whose records other tiles give, what is fringe counts as ordinary.
pub(super) fn kinds(
    form: Form,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
) -> bool {
    if let Some(truth) = truth {
        for ((i, kind), parts) in scratch.kinds.iter_mut().enumerate().zip(truth) {
            *kind = match parts.error & form.sign() {
                _ if *parts == form.inert() => IS_INERT,
                1.. if octave.is_given(i) => IS_FRINGE,
                _ => ORDINARY,
            };
        }
    }
    let is_special = coded_kinds(&mut scratch.kinds, coder, octave, truth.is_some());
    if !is_special {
        scratch.kinds[..octave.count()].fill(ORDINARY);
    }
    is_special
}

/// Errors and radii of the fringe vertices, each after the one before it.
pub(super) fn fringe(
    form: Form,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
) {
    let mut last = [form.sign(), 0];
    let mut turn = 0;
    for i in (0..octave.count()).filter(|i| scratch.kinds[*i] == IS_FRINGE) {
        let codes = truth.map_or([0; 2], |truth| [truth[i].error, truth[i].radius]);
        for ((context, last), code) in [FRINGE_ERRORS, FRINGE_RADII].into_iter().zip(&mut last).zip(codes) {
            *last = coded(form, coder, context, turn, *last, code);
            turn += 1;
        }
        [scratch.flat_errors[i], scratch.flat_radii[i]] = last;
    }
}

/// A code that is near an expected one.
fn coded(form: Form, coder: &mut dyn Coder, context: u16, turn: usize, expected: u32, code: u32) -> u32 {
    let bits = form.code_bits();
    let mut number = folded(u64::from(code.wrapping_sub(expected)), bits);
    single(coder, bits, context, turn, &mut number);
    expected.wrapping_add(unfolded(number) as u32) & form.code_mask()
}

/// Codes that are others than follow from heights, where there are any.
pub(super) fn others(
    form: Form,
    scratch: &mut Scratch,
    coder: &mut dyn Coder,
    truth: Option<&[Parts]>,
    octave: &Octave,
) {
    let is_asked = |scratch: &Scratch, i: usize| scratch.kinds[i] == ORDINARY && octave.is_given(i);
    let differs = |scratch: &Scratch, i: usize| {
        truth.is_some_and(|truth| {
            [truth[i].error, truth[i].radius] != [scratch.flat_errors[i], scratch.flat_radii[i]]
        })
    };
    let count = octave.count();
    let mut are_any = u16::from((0..count).any(|i| differs(scratch, i) && is_asked(scratch, i)));
    coder.raw(1, &mut are_any);
    if are_any == 0 {
        return;
    }
    let mut is_other = vec![false; count];
    let mut turn = 0;
    for i in (0..count).filter(|i| octave.is_given(*i)) {
        if scratch.kinds[i] != ORDINARY {
            continue;
        }
        let [west, south] = octave.before(i).map(|at| u16::from(at.is_some_and(|at| is_other[at])));
        let mut value = u16::from(differs(scratch, i));
        coder.value(OTHERS + 2 * west + south, turn, &mut value);
        turn += 1;
        is_other[i] = value == 1;
        if !is_other[i] {
            continue;
        }
        let Parts { error, radius, .. } = truth.map_or(Parts::default(), |truth| truth[i]);
        scratch.flat_errors[i] = coded(form, coder, OTHER_ERRORS, turn, scratch.flat_errors[i], error);
        scratch.flat_radii[i] = coded(form, coder, OTHER_RADII, turn + 1, scratch.flat_radii[i], radius);
        turn += 2;
    }
}
