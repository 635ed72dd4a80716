//! What a symbol does to a state when it is written (FORMAT.md, section 9.4): a division by its frequency, done by a multiplication.
//!
//! Invariant: a state of less than frequency * 2^21 has its exact quotient, for `m` = 2^43 / frequency, rounded up, is too large by less than frequency / 2^43 of itself, and the product stays within
//! 64 bits. The tests go through all frequencies. Cost: 16 bytes for each token of each table.

use super::model::{Model, SCALE_LOG};
use super::token::TOKENS;

/// Binary logarithm of what frequencies divide.
const QUOTIENT_LOG: u32 = 43;

/// What is done to a state for one token in one context.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Step {
    /// 2^43 / frequency, rounded up; 0 if the token does not occur.
    inverse: u64,
    frequency: u16,
    start: u16,
}

impl Step {
    fn new(frequency: u16, start: u16) -> Self {
        let inverse = if frequency == 0 { 0 } else { (1u64 << QUOTIENT_LOG).div_ceil(frequency.into()) };
        Self { inverse, frequency, start }
    }

    /// Whether the tables have the token.
    #[inline(always)]
    pub(crate) fn is_known(&self) -> bool {
        self.frequency > 0
    }

    /// Whether a state has to give a word before it takes the token.
    #[inline(always)]
    pub(crate) fn is_full(&self, state: u32) -> bool {
        u64::from(state) >= u64::from(self.frequency) << (32 - SCALE_LOG)
    }

    /// The state with the token in it; it was not full.
    #[inline(always)]
    pub(crate) fn after(&self, state: u32) -> u32 {
        let quotient = (u64::from(state).wrapping_mul(self.inverse) >> QUOTIENT_LOG) as u32;
        // (quotient << 11) + remainder + start.
        let beside = (1 << SCALE_LOG) - u32::from(self.frequency);
        state.wrapping_add(quotient.wrapping_mul(beside)).wrapping_add(self.start.into())
    }
}

/// The steps of a file's tables.
#[derive(Debug)]
pub(crate) struct EncodeTables {
    /// Table of each context.
    table_of: Vec<u16>,
    tables: Vec<[Step; TOKENS]>,
}

impl EncodeTables {
    pub(crate) fn of(model: &Model) -> Self {
        let steps = |frequencies: &[u16; TOKENS]| {
            let mut at = 0;
            std::array::from_fn(|token| {
                at += frequencies[token];
                Step::new(frequencies[token], at - frequencies[token])
            })
        };
        Self { table_of: model.table_of.clone(), tables: model.tables.iter().map(steps).collect() }
    }

    /// What tokens in a context do; nothing is known of contexts that there are not.
    #[inline(always)]
    pub(crate) fn of_context(&self, context: usize) -> &[Step; TOKENS] {
        const NONE: [Step; TOKENS] = [Step { inverse: 0, frequency: 0, start: 0 }; TOKENS];
        let table = self.table_of.get(context).and_then(|table| self.tables.get(usize::from(*table)));
        table.unwrap_or(&NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As the format has it, by a division.
    fn plain(state: u32, frequency: u32, start: u32) -> u32 {
        ((state / frequency) << SCALE_LOG) + state % frequency + start
    }

    #[test]
    fn products_are_quotients_for_every_frequency() {
        for frequency in 1..=1u32 << SCALE_LOG {
            let (end, start) = (u64::from(frequency) << 21, (1 << SCALE_LOG) - frequency);
            let step = Step::new(frequency as u16, start as u16);
            let multiples =
                (0..=2_000u64).map(|i| end * i / 2_000 / u64::from(frequency) * u64::from(frequency));
            for state in multiples.flat_map(|at| [at.wrapping_sub(1), at, at + 1]).filter(|at| *at < end) {
                assert!(!step.is_full(state as u32));
                assert_eq!(
                    step.after(state as u32),
                    plain(state as u32, frequency, start),
                    "{state} {frequency}"
                );
            }
            assert!(u32::try_from(end).map_or(true, |state| step.is_full(state)));
        }
    }

    #[test]
    fn what_tables_lack_is_told() {
        let mut table = [0; TOKENS];
        table[3] = 1 << SCALE_LOG;
        let tables = EncodeTables::of(&Model { table_of: vec![0], tables: vec![table] });
        assert!(tables.of_context(0)[3].is_known());
        assert!(!tables.of_context(0)[2].is_known() && !tables.of_context(1)[3].is_known());
    }
}
