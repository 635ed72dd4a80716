//! Values into bytes: a segment on its way into a file (FORMAT.md, section 9.4).
//!
//! What a walk asked is kept until all of it is known, for the last symbol is written first. It also says whether a decoder that is asked the same gives the same: then the walk that reads, which asks by
//! what it was given, makes what the walk that wrote made. Cost: 4 bytes a value, kept from tile to tile.

use super::bits::BitWriter;
use super::coder::{Coder, Decoder, MOST_LANES, ROW, SPAN, START, plain_bits};
use super::model::{Counts, DecodeTables};
use super::symbols::{EncodeTables, Step};
use super::token::{BASES, TOKENS, token_of};
use super::wide::{Width, Work};

/// Tokens without bits beside them.
const BARE: u16 = 16;
/// Values that are looked at together for such tokens.
const TOGETHER: usize = 16;

/// What a walk asked of a segment.
#[derive(Debug)]
pub(crate) struct Encoder {
    width: Width,
    asked: Vec<Asked>,
    /// Of rows, one after the other.
    contexts: Vec<u8>,
    values: Vec<u16>,
    tokens: Vec<u8>,
    singles: usize,
    bits: BitWriter,
}

#[derive(Debug, Clone, Copy)]
enum Asked {
    Row { first: u16, count: u32 },
    Single { context: u16, turn: u8, value: u16 },
    Raw { bits: u8, value: u16 },
}

impl Coder for Encoder {
    fn values(&mut self, first: u16, contexts: &[u8], values: &mut [u16]) {
        self.width.run(Note { encoder: self, first, contexts, values });
    }

    fn value(&mut self, context: u16, turn: usize, value: &mut u16) {
        let turn = (turn % MOST_LANES) as u8;
        self.asked.push(Asked::Single { context, turn, value: *value });
        self.singles += 1;
        let (base, bits) = BASES[usize::from(token_of(*value))];
        self.bits.put(u32::from(*value - base), bits.into());
    }

    fn raw(&mut self, bits: u32, value: &mut u16) {
        self.asked.push(Asked::Raw { bits: bits as u8, value: *value });
        self.bits.put(u32::from(*value), bits);
    }
}

/// Keeps a row.
struct Note<'e> {
    encoder: &'e mut Encoder,
    first: u16,
    contexts: &'e [u8],
    values: &'e [u16],
}

impl Work for Note<'_> {
    type Made = ();

    #[inline(always)]
    fn run(self) {
        let Note { encoder, first, contexts, values } = self;
        encoder.asked.push(Asked::Row { first, count: values.len() as u32 });
        encoder.contexts.extend_from_slice(&contexts[..values.len()]);
        encoder.values.extend_from_slice(values);
        encoder.tokens.extend(values.iter().map(|value| *value as u8));
        let from = encoder.tokens.len() - values.len();
        // Most rows of flat ground have nothing but bare tokens.
        let (tokens, last_tokens) = encoder.tokens[from..].as_chunks_mut::<TOGETHER>();
        let (values, last_values) = values.as_chunks::<TOGETHER>();
        let beside = |token: u8, value: u16| {
            let (base, bits) = BASES[usize::from(token) % TOKENS];
            (value.wrapping_sub(base), bits)
        };
        for (tokens, values) in tokens.iter_mut().zip(values) {
            if values.iter().fold(0, |all, value| all | value) < BARE {
                continue;
            }
            *tokens = values.map(token_of);
            let mut some = [(0, 0); TOGETHER];
            for i in 0..TOGETHER {
                some[i] = beside(tokens[i], values[i]);
            }
            encoder.bits.put_some(some);
        }
        for (token, value) in last_tokens.iter_mut().zip(last_values) {
            *token = token_of(*value);
            encoder.bits.put_some([beside(*token, *value)]);
        }
    }
}

impl Encoder {
    pub(crate) fn new(width: Width) -> Self {
        let (asked, bits) = (Vec::new(), BitWriter::default());
        Self { width, asked, contexts: Vec::new(), values: Vec::new(), tokens: Vec::new(), singles: 0, bits }
    }

    /// Forgets what was asked, and keeps the room for more.
    pub(crate) fn clear(&mut self) {
        self.asked.clear();
        self.contexts.clear();
        self.values.clear();
        self.tokens.clear();
        self.singles = 0;
        self.bits.clear();
    }

    /// Counts its symbols.
    pub(crate) fn count(&self, counts: &mut Counts) {
        let mut rows = self.contexts.iter().zip(&self.tokens);
        for asked in &self.asked {
            match *asked {
                Asked::Row { first, count } => {
                    let counts = &mut counts[usize::from(first)..];
                    for (context, token) in rows.by_ref().take(count as usize) {
                        counts[usize::from(*context)][usize::from(*token)] += 1;
                    }
                }
                Asked::Single { context, value, .. } => {
                    counts[usize::from(context)][usize::from(token_of(value))] += 1;
                }
                Asked::Raw { .. } => {}
            }
        }
    }

    /// Appends the segment to `bytes`, by way of `words`, which keeps its room. `None` if the tables lack one of its tokens: then nothing is appended.
    pub(crate) fn finish(
        &self,
        tables: &EncodeTables,
        words: &mut Vec<[u8; 2]>,
        bytes: &mut Vec<u8>,
    ) -> Option<()> {
        let lanes: usize = match self.tokens.len() + self.singles {
            0..1_000 => 4,
            1_000..3_000 => 8,
            3_000..11_000 => 16,
            _ => MOST_LANES,
        };
        let (states, words) = self.width.run(Finish { encoder: self, tables, lanes, words })?;
        let count = u16::try_from(words.len()).ok()?;
        let words = words.as_flattened();
        bytes.push(lanes as u8);
        bytes.extend(count.to_le_bytes());
        states[..lanes].iter().for_each(|state| bytes.extend(state.to_le_bytes()));
        bytes.extend(words);
        self.bits.write(bytes);
        Some(())
    }

    /// Whether a segment gives all that was asked, and nothing else.
    pub(crate) fn is_given_by(&self, tables: &DecodeTables, segment: &[u8]) -> bool {
        Decoder::new(self.width, tables, segment).is_some_and(|decoder| self.is_what_gives(decoder))
    }

    fn is_what_gives(&self, mut decoder: Decoder<'_>) -> bool {
        let (mut is_same, mut from) = (true, 0);
        let mut found = [0; ROW];
        for asked in &self.asked {
            match *asked {
                Asked::Row { first, count } => {
                    let row = from..from + count as usize;
                    from = row.end;
                    let rows = self.contexts[row.clone()].chunks(ROW).zip(self.values[row].chunks(ROW));
                    for (contexts, values) in rows {
                        let found = &mut found[..values.len()];
                        decoder.values(first, contexts, found);
                        is_same &= found == values;
                    }
                }
                Asked::Single { context, turn, value } => {
                    let mut found = 0;
                    decoder.value(context, turn.into(), &mut found);
                    is_same &= found == value;
                }
                Asked::Raw { bits, value } => {
                    let mut found = 0;
                    decoder.raw(bits.into(), &mut found);
                    is_same &= found == value;
                }
            }
        }
        is_same && decoder.finish()
    }
}

/// Symbols into words, the last one first.
struct Finish<'e, 'w> {
    encoder: &'e Encoder,
    tables: &'e EncodeTables,
    lanes: usize,
    words: &'w mut Vec<[u8; 2]>,
}

impl<'w> Work for Finish<'_, 'w> {
    type Made = Option<([u32; MOST_LANES], &'w [[u8; 2]])>;

    #[inline(always)]
    fn run(self) -> Self::Made {
        let Finish { encoder, tables, lanes, words } = self;
        // A symbol gives a word at most. They are filled from behind.
        let most = encoder.tokens.len() + encoder.singles;
        if words.len() < most {
            words.resize(most, [0; 2]);
        }
        let mut states = States { states: [START; MOST_LANES], words, at: most, has_all: true };
        let mut end = encoder.tokens.len();
        for asked in encoder.asked.iter().rev() {
            match *asked {
                Asked::Row { first, count } => {
                    let row = end - count as usize..end;
                    end = row.start;
                    let (contexts, tokens) = (&encoder.contexts[row.clone()], &encoder.tokens[row]);
                    match lanes {
                        4 => states.take_row::<4>(tables, first, contexts, tokens),
                        8 => states.take_row::<8>(tables, first, contexts, tokens),
                        16 => states.take_row::<16>(tables, first, contexts, tokens),
                        _ => states.take_row::<MOST_LANES>(tables, first, contexts, tokens),
                    }
                }
                Asked::Single { context, turn, value } => {
                    let steps = tables.of_context(usize::from(context));
                    states
                        .take(usize::from(turn) & (lanes - 1), &steps[usize::from(token_of(value)) % TOKENS]);
                }
                Asked::Raw { .. } => {}
            }
        }
        let States { states, words, at, has_all } = states;
        has_all.then_some((states, &words[at..most]))
    }
}

/// The states, and the words that they gave.
struct States<'w> {
    states: [u32; MOST_LANES],
    words: &'w mut [[u8; 2]],
    /// The word that was written last.
    at: usize,
    has_all: bool,
}

impl States<'_> {
    #[inline(always)]
    fn take(&mut self, lane: usize, step: &Step) {
        self.has_all &= step.is_known();
        let state = &mut self.states[lane % MOST_LANES];
        let is_full = step.is_full(*state);
        // Without a branch, which nothing foretells: a word that does not count is written over by the next.
        if let Some(word) = self.words.get_mut(self.at.wrapping_sub(1)) {
            *word = (*state as u16).to_le_bytes();
        }
        self.at -= usize::from(is_full);
        *state = step.after(*state >> (16 * u32::from(is_full)));
    }

    /// A row, whose contexts are below [`SPAN`]; its first value is the first lane's.
    #[inline(always)]
    fn take_row<const LANES: usize>(
        &mut self,
        tables: &EncodeTables,
        first: u16,
        contexts: &[u8],
        tokens: &[u8],
    ) {
        let steps: [&[Step; TOKENS]; SPAN] =
            std::array::from_fn(|i| tables.of_context(usize::from(first) + i));
        let step = |context: u8, token: u8| &steps[usize::from(context) % SPAN][usize::from(token) % TOKENS];
        let (contexts, last_contexts) = contexts.as_chunks::<LANES>();
        let (tokens, last_tokens) = tokens.as_chunks::<LANES>();
        for (lane, (context, token)) in last_contexts.iter().zip(last_tokens).enumerate().rev() {
            self.take(lane, step(*context, *token));
        }
        for (contexts, tokens) in contexts.iter().zip(tokens).rev() {
            for lane in (0..LANES).rev() {
                self.take(lane, step(contexts[lane], tokens[lane]));
            }
        }
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
    /// Appends the segment to `bytes`.
    pub(crate) fn finish(&self, bytes: &mut Vec<u8>) {
        bytes.push(0);
        self.0.write(bytes);
    }
}
