//! Values in contexts into bytes and back: what a segment is made of (FORMAT.md, section 9.4).
//!
//! Tokens are coded by a range variant of asymmetric numeral systems (J. Duda, 2013) over tables that do not change. Several states take turns over one row of words, so that a processor has
//! several independent steps at hand. Invariant: decoding never reads outside the bytes, and [`Decoder::finish`] says whether all of them, and nothing else, were used.

use super::bits::{BitReader, BitWriter};
use super::model::{Counts, DecodeTable, DecodeTables, ERRORS};
use super::symbols::EncodeTables;
use super::token::{BASES, TOKENS, token_of};

/// What a state is before the first and after the last symbol.
const START: u32 = 1 << 16;
/// Most states that take turns.
const MOST_LANES: usize = 32;
/// Contexts that a row of values may be in, counted from its first.
const SPAN: usize = 64;
/// Values that are decoded at a time; all numbers of lanes divide it.
const ROW: usize = 1024;

/// Either way through the values of a tile: walking over it is the same for both.
pub(crate) trait Coder {
    /// One value after the other, each in its context, counted from `first`. The place of a value decides whose turn it is.
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]);

    /// A single value. `turn` is its place among those coded one by one.
    fn value(&mut self, context: u16, turn: usize, value: &mut u16);

    /// Bits as they are, at most 16.
    fn raw(&mut self, bits: u32, value: &mut u16);
}

/// Symbols of a segment on their way into bytes.
#[derive(Debug, Default)]
pub(crate) struct Encoder {
    symbols: Vec<Symbol>,
    bits: BitWriter,
}

/// A token in its context, and whose turn it is.
#[derive(Debug, Clone, Copy)]
struct Symbol(u32);

impl Symbol {
    const TURN_BITS: u32 = MOST_LANES.ilog2();
    const TOKEN_BITS: u32 = TOKENS.ilog2();

    #[inline(always)]
    fn new(context: u16, token: u8, turn: usize) -> Self {
        let turn = turn as u32 % MOST_LANES as u32;
        Self(((u32::from(context) << Self::TOKEN_BITS) | u32::from(token)) << Self::TURN_BITS | turn)
    }

    #[inline(always)]
    fn context(self) -> usize {
        (self.0 >> (Self::TURN_BITS + Self::TOKEN_BITS)) as usize
    }

    #[inline(always)]
    fn token(self) -> usize {
        (self.0 >> Self::TURN_BITS) as usize % TOKENS
    }

    /// Its turn among `lanes` states, a power of two that is no larger than [`MOST_LANES`].
    #[inline(always)]
    fn lane(self, lanes: usize) -> usize {
        self.0 as usize & (lanes - 1) & (MOST_LANES - 1)
    }
}

impl Coder for Encoder {
    #[inline(always)]
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]) {
        self.symbols.extend(contexts.iter().zip(&*values).enumerate().map(|(turn, (context, value))| {
            Symbol::new(first + u16::from(*context), token_of(*value), turn)
        }));
        // Most rows of flat ground have no bits beside their tokens.
        for values in values.chunks(16) {
            if values.iter().fold(0, |all, value| all | value) >= 16 {
                values.iter().for_each(|value| self.beside(*value));
            }
        }
    }

    fn value(&mut self, context: u16, turn: usize, value: &mut u16) {
        self.symbols.push(Symbol::new(context, token_of(*value), turn));
        self.beside(*value);
    }

    fn raw(&mut self, bits: u32, value: &mut u16) {
        self.bits.put(u32::from(*value), bits);
    }
}

impl Encoder {
    /// The bits beside a value's token.
    #[inline(always)]
    fn beside(&mut self, value: u16) {
        let (base, bits) = BASES[usize::from(token_of(value))];
        self.bits.put(u32::from(value - base), bits.into());
    }

    /// Counts its symbols.
    pub(crate) fn count(&self, counts: &mut Counts) {
        self.symbols.iter().for_each(|symbol| counts[symbol.context()][symbol.token()] += 1);
    }

    /// The segment. `None` if the tables lack one of its tokens.
    pub(crate) fn finish(self, tables: &EncodeTables) -> Option<Vec<u8>> {
        let lanes: usize = match self.symbols.len() {
            0..1_000 => 4,
            1_000..3_000 => 8,
            3_000..11_000 => 16,
            _ => MOST_LANES,
        };
        let mut states = [START; MOST_LANES];
        // A symbol gives a word at most. They are filled from behind, for the last symbol comes first.
        let mut words = vec![[0; 2]; self.symbols.len()];
        let (mut at, mut has_all) = (words.len(), true);
        for symbol in self.symbols.iter().rev() {
            let step = tables.step(symbol.context(), symbol.token());
            has_all &= step.is_known();
            let state = &mut states[symbol.lane(lanes)];
            let is_full = step.is_full(*state);
            // Without a branch, which nothing foretells: a word that does not count is written over by the next.
            if let Some(word) = words.get_mut(at.wrapping_sub(1)) {
                *word = (*state as u16).to_le_bytes();
            }
            at -= usize::from(is_full);
            *state = step.after(*state >> (16 * u32::from(is_full)));
        }
        if !has_all {
            return None;
        }
        let words = words[at..].as_flattened();
        let bits = self.bits.finish();
        let mut bytes = Vec::with_capacity(3 + 4 * lanes + words.len() + bits.len());
        bytes.push(lanes as u8);
        bytes.extend(u16::try_from(words.len() / 2).ok()?.to_le_bytes());
        states[..lanes].iter().for_each(|state| bytes.extend(state.to_le_bytes()));
        bytes.extend(words);
        bytes.extend(bits);
        Some(bytes)
    }
}

/// Values as they are: for segments whose tokens the tables of the file lack. What tables are is not needed.
#[derive(Debug, Default)]
pub(crate) struct PlainEncoder(BitWriter);

impl Coder for PlainEncoder {
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]) {
        for (context, value) in contexts.iter().zip(values) {
            self.value(first + u16::from(*context), 0, value);
        }
    }

    fn value(&mut self, context: u16, _: usize, value: &mut u16) {
        self.0.put(u32::from(*value), plain_bits(context));
    }

    fn raw(&mut self, bits: u32, value: &mut u16) {
        self.0.put(u32::from(*value), bits);
    }
}

impl PlainEncoder {
    /// The segment.
    pub(crate) fn finish(self) -> Vec<u8> {
        let mut bytes = vec![0];
        bytes.extend(self.0.finish());
        bytes
    }
}

/// Bits of a value that is stored as it is.
fn plain_bits(context: u16) -> u32 {
    if context < ERRORS { 16 } else { 8 }
}

/// A segment's values.
#[derive(Debug)]
pub(crate) struct Decoder<'b> {
    tables: &'b DecodeTables,
    states: [u32; MOST_LANES],
    /// 0 where values are stored as they are.
    lanes: usize,
    words: &'b [[u8; 2]],
    /// Words taken.
    at: usize,
    bits: BitReader<'b>,
}

impl<'b> Decoder<'b> {
    /// `None` if the bytes do not begin as a segment does.
    pub(crate) fn new(tables: &'b DecodeTables, bytes: &'b [u8]) -> Option<Self> {
        let (lanes, rest) = bytes.split_first()?;
        let lanes = usize::from(*lanes);
        let mut states = [START; MOST_LANES];
        let (mut words, mut bits): (&[[u8; 2]], _) = (&[], rest);
        if lanes > 0 {
            if !lanes.is_power_of_two() || lanes > MOST_LANES {
                return None;
            }
            let (count, rest) = rest.split_first_chunk()?;
            let (first, rest) = rest.split_at_checked(4 * lanes)?;
            for (state, bytes) in states.iter_mut().zip(first.as_chunks().0) {
                *state = u32::from_le_bytes(*bytes);
            }
            let (of_words, rest) = rest.split_at_checked(2 * usize::from(u16::from_le_bytes(*count)))?;
            (words, bits) = (of_words.as_chunks().0, rest);
        }
        let bits = BitReader::new(bits);
        Some(Self { tables, states, lanes, words, at: 0, bits })
    }

    /// Whether all of the segment was used, and led back to where encoding began.
    pub(crate) fn finish(&self) -> bool {
        self.at == self.words.len() && self.bits.is_at_end() && self.states.iter().all(|s| *s == START)
    }

    /// Tokens and bits beside them to values.
    #[inline(always)]
    fn expand(&mut self, tokens: &[u8], values: &mut [u16]) {
        for (tokens, values) in tokens.chunks(16).zip(values.chunks_mut(16)) {
            if tokens.iter().fold(0, |all, token| all | token) < 16 {
                values.iter_mut().zip(tokens).for_each(|(value, token)| *value = u16::from(*token));
                continue;
            }
            self.bits.take_some(|bits| {
                for (value, token) in values.iter_mut().zip(tokens) {
                    let (base, count) = BASES[usize::from(*token) % TOKENS];
                    *value = base.wrapping_add(bits.take(count.into()) as u16);
                }
            });
        }
    }

    /// Tokens of a row, whose contexts are below [`SPAN`].
    #[inline(always)]
    fn tokens<const LANES: usize>(&mut self, first: u16, contexts: &[u8], tokens: &mut [u8]) {
        let mut states = *self.states.first_chunk::<LANES>().unwrap_or(&[START; LANES]);
        let tables: [&DecodeTable; SPAN] =
            std::array::from_fn(|i| self.tables.of_context(usize::from(first) + i));
        let mut at = self.at;
        let mut tokens = tokens.chunks_exact_mut(LANES);
        let mut contexts = contexts.chunks_exact(LANES);
        for (tokens, contexts) in tokens.by_ref().zip(contexts.by_ref()) {
            // A turn takes a word a lane at most; behind the last there are zeros.
            let mut last = [[0; 2]; LANES];
            let words = match self.words.get(at..).and_then(|words| words.first_chunk::<LANES>()) {
                Some(words) => words,
                None => {
                    let rest = self.words.get(at..).unwrap_or_default();
                    last[..rest.len()].copy_from_slice(rest);
                    &last
                }
            };
            let mut taken = 0;
            for lane in 0..LANES {
                let (token, next) = tables[usize::from(contexts[lane]) % SPAN].step(states[lane]);
                tokens[lane] = token;
                // Without a branch, which nothing foretells.
                let word = u32::from(u16::from_le_bytes(words[taken % LANES]));
                let is_low = u32::from(next < START);
                states[lane] = next << (16 * is_low) | word & is_low.wrapping_neg();
                taken += is_low as usize;
            }
            at += taken;
        }
        let rest = tokens.into_remainder().iter_mut().zip(contexts.remainder());
        for ((token, context), state) in rest.zip(&mut states) {
            let next;
            (*token, next) = tables[usize::from(*context) % SPAN].step(*state);
            *state = next;
            if next < START {
                let word = self.words.get(at).copied().unwrap_or_default();
                *state = next << 16 | u32::from(u16::from_le_bytes(word));
                at += 1;
            }
        }
        self.at = at;
        self.states[..LANES].copy_from_slice(&states);
    }
}

impl Coder for Decoder<'_> {
    #[inline(always)]
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]) {
        if self.lanes == 0 {
            let bits = plain_bits(first);
            values.iter_mut().for_each(|value| *value = self.bits.take(bits) as u16);
            return;
        }
        for (contexts, values) in contexts.chunks(ROW).zip(values.chunks_mut(ROW)) {
            let mut tokens = [0; ROW];
            let tokens = &mut tokens[..contexts.len()];
            match self.lanes {
                1 => self.tokens::<1>(first, contexts, tokens),
                2 => self.tokens::<2>(first, contexts, tokens),
                4 => self.tokens::<4>(first, contexts, tokens),
                8 => self.tokens::<8>(first, contexts, tokens),
                16 => self.tokens::<16>(first, contexts, tokens),
                _ => self.tokens::<MOST_LANES>(first, contexts, tokens),
            }
            self.expand(tokens, values);
        }
    }

    #[inline(always)]
    fn value(&mut self, context: u16, turn: usize, value: &mut u16) {
        if self.lanes == 0 {
            *value = self.bits.take(plain_bits(context)) as u16;
            return;
        }
        let lane = turn & (self.lanes - 1) & (MOST_LANES - 1);
        let table = self.tables.of_context(usize::from(context));
        let (token, mut next) = table.step(self.states[lane]);
        if next < START {
            let word = self.words.get(self.at).copied().unwrap_or_default();
            next = next << 16 | u32::from(u16::from_le_bytes(word));
            self.at += 1;
        }
        self.states[lane] = next;
        let (base, bits) = BASES[usize::from(token) & 63];
        *value = base.wrapping_add(self.bits.take(bits.into()) as u16);
    }

    #[inline(always)]
    fn raw(&mut self, bits: u32, value: &mut u16) {
        *value = self.bits.take(bits) as u16;
    }
}
