//! Values in contexts out of bytes: what a segment is made of (FORMAT.md, section 9.4). Module `encoder` is the way into bytes.
//!
//! Tokens are coded by a range variant of asymmetric numeral systems (J. Duda, 2013) over tables that do not change. Several states take turns over one row of words, so that a processor has
//! several independent steps at hand. Invariant: decoding never reads outside the bytes, and [`Decoder::finish`] says whether all of them, and nothing else, were used.

use super::bits::BitReader;
use super::model::{DecodeTable, DecodeTables, ERRORS};
use super::token::{BASES, TOKENS};
use super::wide::{Width, Work};

/// What a state is before the first and after the last symbol.
pub(super) const START: u32 = 1 << 16;
/// Most states that take turns.
pub(super) const MOST_LANES: usize = 32;
/// Contexts that a row of values may be in, counted from its first.
pub(super) const SPAN: usize = 64;
/// Values that are decoded at a time; all numbers of lanes divide it.
pub(super) const ROW: usize = 1024;

/// Either way through the values of a tile: walking over it is the same for both, and compiled once for them.
pub(crate) trait Coder {
    /// One value after the other, each in its context, counted from `first`. The place of a value decides whose turn it is.
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]);

    /// A single value. `turn` is its place among those coded one by one.
    fn value(&mut self, context: u16, turn: usize, value: &mut u16);

    /// Bits as they are, at most 16.
    fn raw(&mut self, bits: u32, value: &mut u16);
}

/// The coders of a tile's segments, in order.
pub(crate) trait Segments {
    fn count(&self) -> usize;

    /// `None` if there are not so many.
    fn segment(&mut self, number: usize) -> Option<&mut dyn Coder>;
}

impl<C: Coder> Segments for &mut [C] {
    fn count(&self) -> usize {
        self.len()
    }

    fn segment(&mut self, number: usize) -> Option<&mut dyn Coder> {
        self.get_mut(number).map(|coder| -> &mut dyn Coder { coder })
    }
}

/// Bits of a value that is stored as it is.
pub(super) fn plain_bits(context: u16) -> u32 {
    if context < ERRORS { 16 } else { 8 }
}

/// A segment's values.
#[derive(Debug)]
pub(crate) struct Decoder<'b> {
    width: Width,
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
    pub(crate) fn new(width: Width, tables: &'b DecodeTables, bytes: &'b [u8]) -> Option<Self> {
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
        Some(Self { width, tables, states, lanes, words, at: 0, bits })
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
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]) {
        if self.lanes == 0 {
            let bits = plain_bits(first);
            values.iter_mut().for_each(|value| *value = self.bits.take(bits) as u16);
            return;
        }
        self.width.run(Rows { decoder: self, first, contexts, values });
    }

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

    fn raw(&mut self, bits: u32, value: &mut u16) {
        *value = self.bits.take(bits) as u16;
    }
}

/// Decodes values of a segment that has tables.
struct Rows<'d, 'b> {
    decoder: &'d mut Decoder<'b>,
    first: u16,
    contexts: &'d [u8],
    values: &'d mut [u16],
}

impl Work for Rows<'_, '_> {
    type Made = ();

    #[inline(always)]
    fn run(self) {
        let Rows { decoder, first, contexts, values } = self;
        for (contexts, values) in contexts.chunks(ROW).zip(values.chunks_mut(ROW)) {
            let mut tokens = [0; ROW];
            let tokens = &mut tokens[..contexts.len()];
            match decoder.lanes {
                1 => decoder.tokens::<1>(first, contexts, tokens),
                2 => decoder.tokens::<2>(first, contexts, tokens),
                4 => decoder.tokens::<4>(first, contexts, tokens),
                8 => decoder.tokens::<8>(first, contexts, tokens),
                16 => decoder.tokens::<16>(first, contexts, tokens),
                _ => decoder.tokens::<MOST_LANES>(first, contexts, tokens),
            }
            decoder.expand(tokens, values);
        }
    }
}
