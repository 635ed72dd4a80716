//! Timing wheels, one a clock: which of their slots hold something, and which are over when a clock has moved on.
//!
//! Hierarchical timing wheels, after G. Varghese, T. Lauck, "Hashed and Hierarchical Timing Wheels", SOSP 1987: an entry lies on the level of the highest digit in which its expiry
//! differs from the clock. Digits have 8 bits: a frame takes some hundred ticks on a straight way, so that most entries are over on the level that they were entered on.
//!
//! Few clocks have words at a time, so a wheel's slots are lent to it while it has entries: a *row* of all its levels.
//!
//! Invariant: an entry's expiry is not below its wheel's tick, and differs from it in no digit above its level. Row 0 is empty, and that of all wheels without entries. Cost: 3 KiB a row. A place is
//! one number, so that finding one takes few instructions.

use super::clocks::{CLOCKS, EXPIRY_BITS};

/// Bits of a digit.
pub(super) const DIGIT: u32 = 8;
/// Slots of a level.
pub(super) const SLOTS: usize = 1 << DIGIT;
/// Levels that cover every expiry.
pub(super) const LEVELS: usize = EXPIRY_BITS.div_ceil(DIGIT) as usize;
/// Slots of a row.
const ROW: usize = LEVELS * SLOTS;
/// Rows that memory is taken for at once.
const ROWS_MORE: usize = 8;
/// Slots whose bits are one word.
const WORD: usize = 64;
/// No chunk.
pub(super) const NONE: u32 = u32::MAX;

/// The wheels of all clocks.
#[derive(Debug)]
pub(super) struct Wheels {
    /// First chunk of each slot.
    pub heads: Vec<u32>,
    /// Bit p % 64 of word p / 64: the slot at place p holds something.
    occupied: Vec<u64>,
    /// Entries of each row's levels.
    pub counts: Vec<u32>,
    /// The row of a clock.
    rows: [u8; CLOCKS],
    /// Rows of no clock.
    free: Vec<u8>,
    /// Tick of a wheel.
    pub now: [u32; CLOCKS],
    /// Bit l: the slot of level l that the tick is in has entries.
    pub open: [u8; CLOCKS],
}

impl Wheels {
    pub(super) fn new() -> Self {
        let mut wheels = Self {
            heads: Vec::new(),
            occupied: Vec::new(),
            counts: Vec::new(),
            rows: [0; CLOCKS],
            free: Vec::with_capacity(CLOCKS + 1),
            now: [0; CLOCKS],
            open: [0; CLOCKS],
        };
        wheels.more_rows();
        // Row 0 is nobody's.
        wheels.free.pop();
        wheels
    }

    /// Empties all wheels, whose ticks stay.
    pub(super) fn clear(&mut self) {
        self.heads.fill(NONE);
        self.occupied.fill(0);
        self.counts.fill(0);
        self.open.fill(0);
        self.rows.fill(0);
        self.free.clear();
        self.free.extend((1..self.counts.len() / LEVELS).rev().map(|row| row as u8));
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        (self.heads.capacity() + self.counts.capacity()) * size_of::<u32>()
            + self.occupied.capacity() * size_of::<u64>()
            + self.free.capacity()
    }

    /// Makes rows, the first to be lent last in the list.
    fn more_rows(&mut self) {
        let from = self.counts.len() / LEVELS;
        let rows = (from + ROWS_MORE).min(CLOCKS + 1);
        self.heads.reserve_exact((rows - from) * ROW);
        self.heads.resize(rows * ROW, NONE);
        self.occupied.reserve_exact((rows - from) * ROW / WORD);
        self.occupied.resize(rows * ROW / WORD, 0);
        self.counts.resize(rows * LEVELS, 0);
        self.free.extend((from..rows).rev().map(|row| row as u8));
    }

    /// Lends a clock a row, unless it has one.
    #[inline(always)]
    pub(super) fn lend(&mut self, clock: usize) {
        if self.rows[clock % CLOCKS] == 0 {
            self.lend_row(clock % CLOCKS);
        }
    }

    #[cold]
    fn lend_row(&mut self, clock: usize) {
        if self.free.is_empty() {
            self.more_rows();
        }
        // There is one for each clock.
        self.rows[clock] = self.free.pop().unwrap_or_default();
    }

    /// Takes back the row of a clock that has no entries.
    #[inline(always)]
    pub(super) fn take_back(&mut self, clock: usize) {
        let row = std::mem::take(&mut self.rows[clock % CLOCKS]);
        if row != 0 {
            self.free.push(row);
        }
    }

    /// A place of a clock's wheel.
    #[inline(always)]
    pub(super) fn place_of(&self, clock: usize, level: usize, slot: usize) -> usize {
        (self.rows[clock % CLOCKS] as usize * LEVELS + level) * SLOTS + slot
    }

    /// The place of what is over at `expiry` on a clock. One in row 0 is to be looked at only.
    #[inline(always)]
    pub(super) fn place(&self, clock: usize, expiry: u32) -> usize {
        const { assert!(LEVELS == 3 && CLOCKS < 256) };
        let now = self.now[clock % CLOCKS];
        let expiry = expiry.max(now);
        let differing = expiry ^ now;
        let level = usize::from(differing >= 1 << DIGIT) + usize::from(differing >= 1 << (2 * DIGIT));
        self.place_of(clock, level, slot_at(expiry, level))
    }

    /// Entries of each level of a clock.
    #[inline(always)]
    pub(super) fn counts_of(&self, clock: usize) -> [u32; LEVELS] {
        let row = self.rows[clock % CLOCKS] as usize;
        std::array::from_fn(|level| self.counts[row * LEVELS + level])
    }

    #[inline(always)]
    pub(super) fn is_empty(&self, clock: usize) -> bool {
        self.counts_of(clock) == [0; LEVELS]
    }

    /// Whether a slot holds something.
    #[inline(always)]
    pub(super) fn is_occupied(&self, place: usize) -> bool {
        self.occupied[place / WORD] >> (place % WORD) & 1 == 1
    }

    /// Notes whether a slot holds something.
    #[inline(always)]
    pub(super) fn set_occupied(&mut self, place: usize, holds: bool) {
        let word = &mut self.occupied[place / WORD];
        *word = *word & !(1 << (place % WORD)) | u64::from(holds) << (place % WORD);
    }

    /// The first place from `from` on and before `end` that holds something.
    #[inline(always)]
    pub(super) fn next_occupied(&self, from: usize, end: usize) -> Option<usize> {
        let mut from = from;
        while from < end {
            let rest = self.occupied[from / WORD] >> (from % WORD);
            if rest != 0 {
                return Some(from + rest.trailing_zeros() as usize).filter(|place| *place < end);
            }
            from = (from / WORD + 1) * WORD;
        }
        None
    }

    /// How many places hold something.
    pub(super) fn count_occupied(&self, from: usize, end: usize) -> u64 {
        let (mut at, mut count) = (from, 0);
        while let Some(place) = self.next_occupied(at, end) {
            (at, count) = (place + 1, count + 1);
        }
        count
    }
}

/// The level of all rows' levels that a place is on.
#[inline(always)]
pub(super) fn level_of(place: usize) -> usize {
    place / SLOTS
}

/// How many slots of a level, from the first one, are over as a whole when a wheel moves on from `then` to `now`: up to the one that the new tick is in, or all of a turn that is over. Whether the
/// turn is the same, so that levels above have none.
#[inline(always)]
pub(super) fn over(then: u32, now: u32, level: usize) -> (usize, bool) {
    let shift = level as u32 * DIGIT;
    let same_turn = then >> (shift + DIGIT) == now >> (shift + DIGIT);
    // On the lowest level a slot is a tick.
    let end = if same_turn { slot_at(now, level) + usize::from(level == 0) } else { SLOTS };
    (end, same_turn)
}

/// The slot of a level that a tick is in.
#[inline(always)]
pub(super) fn slot_at(tick: u32, level: usize) -> usize {
    (tick >> (level as u32 * DIGIT)) as usize % SLOTS
}

/// How often so many ticks go into a slot of a level.
#[inline(always)]
pub(super) fn frames_a_slot(ticks: u32, level: usize) -> u32 {
    (1u32 << (level as u32 * DIGIT)).checked_div(ticks).unwrap_or(u32::MAX)
}
