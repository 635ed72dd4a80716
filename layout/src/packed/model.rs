//! Tables of how often each token occurs in each context: made once a file, from all of it or a sample, and stored in it (FORMAT.md, section 9.5).
//!
//! Contexts that are alike, or rare, share a table, because a table costs some ten bytes. Invariant: the numbers of a table add up to 2,048, and every token that was counted has at least 1.

use super::bits::{BitReader, BitWriter};
use super::token::TOKENS;

/// Binary logarithm of what a table adds up to.
pub(crate) const SCALE_LOG: u32 = 11;
/// What a table adds up to.
pub(crate) const SCALE: usize = 1 << SCALE_LOG;
/// Bits of a frequency that are kept, of all but the largest.
const KEPT_BITS: u32 = 4;

/// Tokens beyond the largest of a sample that have a place in its table: an octave and a half.
const UNSEEN: usize = 6;

/// First context of heights: by octave, colour and class.
pub(crate) const HEIGHTS: u16 = 0;
/// Classes of heights.
pub(crate) const HEIGHT_CLASSES: u16 = 32;
/// First context of error codes: by colour.
pub(crate) const ERRORS: u16 = HEIGHTS + 8 * HEIGHT_CLASSES;
/// First context of radius codes.
pub(crate) const RADII: u16 = ERRORS + 64;
/// First context of what is not ordinary: by the kinds of the vertices west and south.
pub(crate) const KINDS: u16 = RADII + 64;
/// Error codes of fringe vertices.
pub(crate) const FRINGE_ERRORS: u16 = KINDS + 16;
/// Radius codes of fringe vertices.
pub(crate) const FRINGE_RADII: u16 = FRINGE_ERRORS + 1;
/// Error codes that are not the ones expected.
pub(crate) const OTHER_ERRORS: u16 = FRINGE_RADII + 1;
/// Radius codes that are not the ones expected.
pub(crate) const OTHER_RADII: u16 = OTHER_ERRORS + 1;
/// Contexts there are.
pub(crate) const CONTEXTS: usize = OTHER_RADII as usize + 1;

/// How often tokens were counted, by context.
pub(crate) type Counts = Vec<[u64; TOKENS]>;

/// Frequencies of tokens in one context.
pub(crate) type Frequencies = [u16; TOKENS];

/// The tables of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Model {
    /// Table of each context.
    pub(crate) table_of: Vec<u16>,
    pub(crate) tables: Vec<Frequencies>,
}

impl Model {
    /// The tables for what was counted.
    pub(crate) fn from_counts(counts: &Counts) -> Self {
        let mut pooled: Vec<[u64; TOKENS]> = Vec::new();
        let mut table_of = Vec::with_capacity(CONTEXTS);
        for of_context in counts {
            let joined = pooled.last().map(|last| {
                let both: [u64; TOKENS] = std::array::from_fn(|t| last[t] + of_context[t]);
                (both, cost_bits(&both) <= cost_bits(last) + cost_bits(of_context))
            });
            match (joined, pooled.last_mut()) {
                (Some((both, true)), Some(last)) => *last = both,
                _ => pooled.push(*of_context),
            }
            table_of.push(pooled.len() as u16 - 1);
        }
        Self { table_of, tables: pooled.iter().map(frequencies).collect() }
    }

    /// The tables for what was counted in a sample: what did not occur there, and may elsewhere, has a place in them.
    pub(crate) fn from_sample(counts: &Counts) -> Self {
        let mut counts = counts.clone();
        for of_context in &mut counts {
            let last = of_context.iter().rposition(|count| *count > 0);
            let likely = last.map_or(TOKENS, |last| TOKENS.min(last + 1 + UNSEEN));
            of_context[..likely].iter_mut().for_each(|count| *count = (*count).max(1));
        }
        Self::from_counts(&counts)
    }

    /// As it is stored.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bits = BitWriter::default();
        let mut last = None;
        for table in &self.table_of {
            let is_new = last != Some(*table);
            bits.put(u32::from(is_new), 1);
            if is_new {
                put_table(&mut bits, &self.tables[usize::from(*table)]);
            }
            last = Some(*table);
        }
        bits.finish()
    }

    /// What [`Model::to_bytes`] made; `None` if it is nothing of the kind.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let mut bits = BitReader::new(bytes);
        let (mut table_of, mut tables) = (Vec::with_capacity(CONTEXTS), Vec::new());
        for _ in 0..CONTEXTS {
            if bits.take(1) == 1 {
                tables.push(take_table(&mut bits)?);
            }
            table_of.push(u16::try_from(tables.len().checked_sub(1)?).ok()?);
        }
        bits.is_at_end().then_some(Self { table_of, tables })
    }
}

/// Bits that a table of its own makes of what was counted, the table included, by and large.
fn cost_bits(counts: &[u64; TOKENS]) -> f64 {
    let total: u64 = counts.iter().sum();
    let used = counts.iter().filter(|count| **count > 0);
    used.map(|count| 5.5 + *count as f64 * libm::log2(total as f64 / *count as f64)).sum::<f64>() + 16.0
}

/// Frequencies that add up to the scale, each but the largest of few bits.
fn frequencies(counts: &[u64; TOKENS]) -> Frequencies {
    let total = counts.iter().sum::<u64>().max(1);
    let largest = (0..TOKENS).max_by_key(|t| (counts[*t], TOKENS - t)).unwrap_or(0);
    let mut frequencies: Frequencies = std::array::from_fn(|t| {
        if t == largest || counts[t] == 0 {
            return 0;
        }
        let exact = counts[t] as f64 * SCALE as f64 / total as f64;
        let wanted = (exact + 0.5).max(1.0) as u32;
        // To the nearest number of so many bits.
        let dropped = (32 - wanted.leading_zeros()).saturating_sub(KEPT_BITS);
        (((wanted + (1 << dropped >> 1)) >> dropped) << dropped) as u16
    });
    // Rare tokens take at least 1, and rounding may take more than there is: the most frequent one has to have 1 left.
    while frequencies.iter().map(|f| usize::from(*f)).sum::<usize>() >= SCALE {
        let Some(most) = (0..TOKENS).max_by_key(|t| frequencies[*t]) else { break };
        let f = frequencies[most];
        frequencies[most] = f - (1 << (16 - f.leading_zeros()).saturating_sub(KEPT_BITS));
    }
    frequencies[largest] = (SCALE - frequencies.iter().map(|f| usize::from(*f)).sum::<usize>()) as u16;
    frequencies
}

fn put_table(bits: &mut BitWriter, table: &Frequencies) {
    // The one that takes what is left by the others: that of many bits, if there is one.
    let has_more = |f: u16| f > 0 && 16 - f.leading_zeros() - f.trailing_zeros() > KEPT_BITS;
    let largest = (0..TOKENS)
        .find(|t| has_more(table[*t]))
        .or_else(|| (0..TOKENS).max_by_key(|t| (table[*t], TOKENS - t)))
        .unwrap_or(0);
    let last = (0..TOKENS).rev().find(|t| table[*t] > 0 && *t != largest);
    bits.put(largest as u32, 6);
    bits.put(last.map_or(0, |last| last as u32 + 1), 7);
    let mut before = 0;
    for token in (0..last.map_or(0, |last| last + 1)).filter(|token| *token != largest) {
        let length = 16 - table[token].leading_zeros();
        let change = length as i32 - before;
        let steps = if change > 0 { 2 * change - 1 } else { -2 * change };
        (0..steps).for_each(|_| bits.put(1, 1));
        bits.put(0, 1);
        let kept = length.saturating_sub(1).min(KEPT_BITS - 1);
        bits.put(u32::from(table[token]) >> (length.saturating_sub(1) - kept) & ((1 << kept) - 1), kept);
        before = length as i32;
    }
}

fn take_table(bits: &mut BitReader<'_>) -> Option<Frequencies> {
    let largest = bits.take(6) as usize;
    let count = bits.take(7) as usize;
    if count > TOKENS {
        return None;
    }
    let mut table = [0; TOKENS];
    let (mut before, mut sum) = (0, 0);
    for token in (0..count).filter(|token| *token != largest) {
        let mut steps = 0;
        while bits.take(1) == 1 {
            steps += 1;
            if steps > 24 {
                return None;
            }
        }
        let change = if steps % 2 == 1 { (steps + 1) / 2 } else { -(steps / 2) };
        let length = u32::try_from(before + change).ok().filter(|length| *length <= SCALE_LOG)?;
        if length > 0 {
            let kept = (length - 1).min(KEPT_BITS - 1);
            table[token] = ((1 << kept | bits.take(kept)) << (length - 1 - kept)) as u16;
        }
        sum += usize::from(table[token]);
        before = length as i32;
    }
    table[largest] = u16::try_from(SCALE.checked_sub(sum).filter(|rest| *rest > 0)?).ok()?;
    Some(table)
}

/// What decoding looks up.
#[derive(Debug)]
pub(crate) struct DecodeTables {
    table_of: Vec<u16>,
    tables: Vec<DecodeTable>,
}

/// One table: small, so that those in use stay near the processor.
#[derive(Debug, Clone)]
pub(crate) struct DecodeTable {
    /// Token by the low bits of a state.
    tokens: [u8; SCALE],
    /// Of each token the frequency in 16 bits, and above it its first number.
    frequencies: [u32; TOKENS],
}

impl DecodeTables {
    pub(crate) fn of(model: &Model) -> Self {
        Self { table_of: model.table_of.clone(), tables: model.tables.iter().map(DecodeTable::of).collect() }
    }

    /// The table of a context.
    #[inline(always)]
    pub(crate) fn of_context(&self, context: usize) -> &DecodeTable {
        &self.tables[usize::from(self.table_of[context])]
    }
}

impl DecodeTable {
    fn of(frequencies: &Frequencies) -> Self {
        let mut table = Self { tokens: [0; SCALE], frequencies: [0; TOKENS] };
        let mut first = 0;
        for (token, frequency) in frequencies.iter().enumerate() {
            let next = first + usize::from(*frequency);
            table.tokens[first..next].fill(token as u8);
            table.frequencies[token] = u32::from(*frequency) | (first as u32) << 16;
            first = next;
        }
        table
    }

    /// The token that a state stands for, and the state after it.
    #[inline(always)]
    pub(crate) fn step(&self, state: u32) -> (u8, u32) {
        let low = state & (SCALE as u32 - 1);
        let token = self.tokens[low as usize];
        let of_token = self.frequencies[usize::from(token) % TOKENS];
        // No state is above 2^32 - 1 after it: the frequency is at most 2^11, and what is above the low bits less than 2^21.
        let next = (of_token & 0xffff).wrapping_mul(state >> SCALE_LOG);
        (token, next.wrapping_add(low).wrapping_sub(of_token >> 16))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn tables_come_back(seed in prop::collection::vec((0usize..CONTEXTS, 0usize..TOKENS, 1u64..1 << 40), 0..600)) {
            let mut counts = vec![[0; TOKENS]; CONTEXTS];
            seed.iter().for_each(|(context, token, count)| counts[*context][*token] += count);
            let model = Model::from_counts(&counts);
            for (of_context, table) in counts.iter().zip(&model.table_of) {
                let table = &model.tables[usize::from(*table)];
                prop_assert_eq!(table.iter().map(|f| usize::from(*f)).sum::<usize>(), SCALE);
                prop_assert!((0..TOKENS).all(|t| of_context[t] == 0 || table[t] > 0));
            }
            let stored = model.to_bytes();
            prop_assert_eq!(Model::parse(&stored), Some(model));
            prop_assert_eq!(Model::parse(&stored[..stored.len() - 1]), None);
        }

        /// A sample's tables have what it has, and what lies near.
        #[test]
        fn samples_leave_room(seed in prop::collection::vec((0usize..CONTEXTS, 0usize..TOKENS, 1u64..1 << 40), 0..600)) {
            let mut counts = vec![[0; TOKENS]; CONTEXTS];
            seed.iter().for_each(|(context, token, count)| counts[*context][*token] += count);
            let model = Model::from_sample(&counts);
            for (of_context, table) in counts.iter().zip(&model.table_of) {
                let table = &model.tables[usize::from(*table)];
                let last = of_context.iter().rposition(|count| *count > 0).map_or(TOKENS, |last| last + 7);
                prop_assert!(table[..last.min(TOKENS)].iter().all(|frequency| *frequency > 0));
                prop_assert_eq!(table.iter().map(|f| usize::from(*f)).sum::<usize>(), SCALE);
            }
            prop_assert_eq!(Model::parse(&model.to_bytes()), Some(model));
        }

        #[test]
        fn any_bytes_are_tables_or_none(bytes in prop::collection::vec(any::<u8>(), 0..4000)) {
            if let Some(model) = Model::parse(&bytes) {
                prop_assert!(model.tables.iter().all(|t| t.iter().map(|f| usize::from(*f)).sum::<usize>() == SCALE));
            }
        }
    }
}
