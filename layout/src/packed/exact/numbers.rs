//! Numbers of up to 64 bits by a coder of values below 65,536: their low bits as they are, what is above as values in contexts.

use crate::packed::coder::Coder;

/// Bits that say how many low bits of a row's numbers stand as they are.
const SHIFT_BITS: u32 = 6;
/// Bits as they are that are taken at a time.
const RAW_BITS: u32 = 16;

/// What a row of numbers is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Bits of a number.
    pub(super) bits: u32,
    /// Largest value above the low bits: it stands for a number that follows whole.
    pub(super) most: u16,
    /// First context.
    pub(super) first: u16,
    /// Bits that values have by and large.
    pub(super) kept: u32,
}

/// How many low bits of these numbers are stored as they are: what is above has `kept` bits by and large.
pub(super) fn shift_of(row: &Row, numbers: &[u64]) -> u32 {
    let bits: u64 = numbers.iter().map(|number| u64::from(64 - number.leading_zeros())).sum();
    let mean = bits / (numbers.len() as u64).max(1);
    (mean as u32).saturating_sub(row.kept).min(row.bits - 1)
}

/// The low bits that stand as they are, coded.
pub(super) fn shift(coder: &mut dyn Coder, row: &Row, numbers: Option<&[u64]>) -> u32 {
    let mut shift = numbers.map_or(0, |numbers| shift_of(row, numbers)) as u16;
    coder.raw(SHIFT_BITS, &mut shift);
    u32::from(shift).min(row.bits - 1)
}

/// A row of numbers, each in its context, counted from the row's first; `shift` low bits of each as they are.
#[inline(always)]
pub(super) fn row(
    coder: &mut dyn Coder,
    row: &Row,
    shift: u32,
    contexts: &[u8],
    numbers: &mut [u64],
    heads: &mut [u16],
) {
    let heads = &mut heads[..numbers.len()];
    for (head, number) in heads.iter_mut().zip(&*numbers) {
        *head = (*number >> shift).min(u64::from(row.most)) as u16;
    }
    coder.values(row.first, contexts, heads);
    for (head, number) in heads.iter().zip(numbers) {
        if *head >= row.most {
            raw(coder, row.bits, number);
        } else {
            raw(coder, shift, number);
            *number |= u64::from(*head) << shift;
        }
    }
}

/// A single number in a context, as one of a row without low bits.
pub(super) fn single(coder: &mut dyn Coder, bits: u32, context: u16, turn: usize, number: &mut u64) {
    let most = u64::from(u8::MAX);
    let mut head = (*number).min(most) as u16;
    coder.value(context, turn, &mut head);
    if u64::from(head) >= most {
        raw(coder, bits, number);
    } else {
        *number = u64::from(head);
    }
}

/// The low bits of a number as they are; the others become 0.
#[inline(always)]
pub(super) fn raw(coder: &mut dyn Coder, bits: u32, number: &mut u64) {
    let (mut at, whole) = (0, *number);
    *number = 0;
    while at < bits {
        let count = (bits - at).min(RAW_BITS);
        let mut part = (whole >> at & ((1 << count) - 1)) as u16;
        coder.raw(count, &mut part);
        *number |= u64::from(part) << at;
        at += count;
    }
}
