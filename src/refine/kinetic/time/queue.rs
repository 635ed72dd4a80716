//! The expiry queue: it finds the words that are over now, without looking at any other.
//!
//! Each clock has a hierarchical timing wheel, after G. Varghese, T. Lauck, "Hashed and Hierarchical Timing Wheels", SOSP 1987: an entry lies on
//! the level of the highest digit (of 6 bits) in which its expiry differs from the clock, and moves down at most once a
//! level as the clock advances. Entries of words that have changed since are left where they are; they no longer equal the
//! word and are dropped when their turn comes.
//!
//! Invariant: an entry's expiry is not below its wheel's tick, and differs from it in no digit above its level. Cost: a few nanoseconds to
//! enter, the same for each level on the way out, nothing for entries whose turn has not come. All entries lie in chunks of one pool.

use super::clocks::{CLOCKS, EXPIRY_BITS};
use crate::refine::kinetic::capacity::give_up;
use crate::refine::kinetic::chunked::Chunked;
use terrasoar_layout::read::prefetch::prefetch;

/// Bits of a digit.
const DIGIT: u32 = 6;
/// Slots of a level.
const SLOTS: usize = 1 << DIGIT;
/// Levels that cover every expiry.
const LEVELS: usize = EXPIRY_BITS.div_ceil(DIGIT) as usize;
/// No chunk.
const NONE: u32 = u32::MAX;
/// Entries a chunk, which is two cache lines that a processor brings together.
const CHUNK_ENTRIES: usize = 15;

/// How many entries ahead memory is asked for where they move to.
const MOVE_AHEAD: usize = 6;

/// A node and the word it had when it was entered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Entry {
    pub node: u32,
    pub word: u32,
}

impl Entry {
    fn expiry(self) -> u32 {
        self.word & ((1 << EXPIRY_BITS) - 1)
    }
}

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Chunk {
    next: u32,
    used: u32,
    entries: [Entry; CHUNK_ENTRIES],
}

/// The wheel of one clock. All but its heads is one cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Wheel {
    /// Bit s of level l: slot s holds something.
    occupied: [u64; LEVELS],
    /// Entries of a level.
    counts: [u32; LEVELS],
    now: u32,
    heads: [[u32; SLOTS]; LEVELS],
}

impl Wheel {
    /// Level and slot of what is over at `expiry`.
    #[inline(always)]
    fn place(&self, expiry: u32) -> (usize, usize) {
        let expiry = expiry.max(self.now);
        let differing = expiry ^ self.now;
        let level = (31 - (differing | 1).leading_zeros()) / DIGIT;
        ((level as usize).min(LEVELS - 1), (expiry >> (level * DIGIT)) as usize % SLOTS)
    }
}

const EMPTY: Wheel =
    Wheel { now: 0, occupied: [0; LEVELS], counts: [0; LEVELS], heads: [[NONE; SLOTS]; LEVELS] };

fn all_empty() -> Box<[Wheel; CLOCKS]> {
    let all: Box<[Wheel]> = vec![EMPTY; CLOCKS].into();
    all.try_into().unwrap_or_else(|_| unreachable!("there are as many wheels as clocks"))
}

/// The slots of a level that are over as a whole when a wheel moves on to `now`: up to the one that holds the new tick, or all of a turn that is over. Whether the turn is
/// the same, so that levels above have none.
#[inline(always)]
fn over(then: u32, now: u32, level: usize) -> (u64, bool) {
    let shift = level as u32 * DIGIT;
    let same_turn = then >> (shift + DIGIT) == now >> (shift + DIGIT);
    let digit = (now >> shift) % SLOTS as u32;
    let over = match (same_turn, level) {
        (false, _) => u64::MAX,
        (true, 0) => u64::MAX >> (SLOTS as u32 - 1 - digit),
        (true, _) => (1 << digit) - 1,
    };
    (over, same_turn)
}

/// The queue of one engine.
#[derive(Debug)]
pub(crate) struct Queue {
    wheels: Box<[Wheel; CLOCKS]>,
    chunks: Chunked<Chunk, 8>,
    free: u32,
    /// Entries on their way to another level.
    moving: Vec<Entry>,
    entries: usize,
    /// The slot that was looked at last for entries that are of no use any more.
    swept: usize,
}

impl Queue {
    pub(crate) fn new() -> Self {
        Self {
            wheels: all_empty(),
            chunks: Chunked::default(),
            free: NONE,
            moving: Vec::new(),
            entries: 0,
            swept: 0,
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.wheels.len() * size_of::<Wheel>()
            + self.chunks.bytes()
            + self.moving.capacity() * size_of::<Entry>()
    }

    /// Asks memory for what entering a word on clock `clock` will write to.
    #[inline(always)]
    pub(crate) fn prefetch(&self, clock: usize, word: u32) {
        let wheel = &self.wheels[clock % CLOCKS];
        let (level, slot) = wheel.place(word & ((1 << EXPIRY_BITS) - 1));
        self.chunks.prefetch(wheel.heads[level][slot] as usize);
    }

    /// Enters a node under its word's expiry on clock `clock`.
    #[inline(always)]
    pub(crate) fn enter(&mut self, clock: usize, entry: Entry) {
        self.entries += 1;
        let wheel = &mut self.wheels[clock % CLOCKS];
        let (level, slot) = wheel.place(entry.expiry());
        wheel.occupied[level] |= 1 << slot;
        wheel.counts[level] += 1;
        let head = &mut wheel.heads[level][slot];
        if *head != NONE {
            let chunk = &mut self.chunks[*head as usize];
            if (chunk.used as usize) < CHUNK_ENTRIES {
                chunk.entries[chunk.used as usize] = entry;
                chunk.used += 1;
                return;
            }
        }
        if self.free == NONE {
            let mut entries = [Entry::default(); CHUNK_ENTRIES];
            entries[0] = entry;
            *head = self.chunks.push(Chunk { next: *head, used: 1, entries }) as u32;
        } else {
            // Its other entries stay as they are.
            let chunk = &mut self.chunks[self.free as usize];
            let next = std::mem::replace(&mut chunk.next, *head);
            chunk.used = 1;
            chunk.entries[0] = entry;
            *head = std::mem::replace(&mut self.free, next);
        }
    }

    /// Moves a wheel on to tick `now` and hands out all entries whose expiry is not above it.
    pub(crate) fn advance(&mut self, clock: usize, now: u64, mut due: impl FnMut(Entry)) {
        let wheel = &mut self.wheels[clock % CLOCKS];
        if wheel.occupied == [0; LEVELS] {
            wheel.now = now.min(u64::from(u32::MAX)) as u32;
            return;
        }
        if now >= 1 << EXPIRY_BITS {
            wheel.now = now.min(u64::from(u32::MAX)) as u32;
            return self.drain(clock, due);
        }
        let (then, now) = (wheel.now, now as u32);
        wheel.now = now;
        for level in 0..LEVELS {
            let (over, same_turn) = over(then, now, level);
            let digit = (now >> (level as u32 * DIGIT)) % SLOTS as u32;
            let mut slots = self.wheels[clock % CLOCKS].occupied[level] & over;
            while slots != 0 {
                self.take_slot(clock, level, slots.trailing_zeros() as usize, &mut due);
                slots &= slots - 1;
            }
            if same_turn {
                if level > 0 && self.wheels[clock % CLOCKS].occupied[level] >> digit & 1 == 1 {
                    self.spread(clock, level, digit as usize, &mut due);
                }
                return;
            }
        }
    }

    /// Asks memory for what [`Queue::advance`] will look at: for the heads of slots, then, those having come, for what the heads name.
    #[inline(always)]
    pub(crate) fn fetch(&self, clock: usize, now: u64, heads: bool) {
        let wheel = &self.wheels[clock % CLOCKS];
        let now = now as u32;
        for level in 0..LEVELS {
            let (over, same_turn) = over(wheel.now, now, level);
            // The slot that the tick is in, too: what it holds moves to lower levels.
            let digit = 1 << ((now >> (level as u32 * DIGIT)) % SLOTS as u32);
            let mut slots = wheel.occupied[level] & (over | digit);
            if heads && slots != 0 {
                prefetch(&wheel.heads[level], slots.trailing_zeros() as usize);
            }
            while !heads && slots != 0 {
                self.chunks.prefetch(wheel.heads[level][slots.trailing_zeros() as usize] as usize);
                slots &= slots - 1;
            }
            if same_turn {
                return;
            }
        }
    }

    /// About how many entries would be over if a wheel moved on to tick `now`: those of levels that would be over as a whole, and of others the share of their slots.
    pub(crate) fn count_over(&self, clock: usize, now: u64) -> usize {
        let wheel = &self.wheels[clock % CLOCKS];
        if now >= 1 << EXPIRY_BITS {
            return wheel.counts.iter().map(|count| *count as usize).sum();
        }
        let now = now as u32;
        let mut count = 0;
        for level in 0..LEVELS {
            let (over, same_turn) = over(wheel.now, now, level);
            let occupied = wheel.occupied[level];
            if occupied & over != 0 {
                let share = u64::from((occupied & over).count_ones()) * u64::from(wheel.counts[level]);
                count += (share / u64::from(occupied.count_ones())) as usize;
            }
            if same_turn {
                break;
            }
        }
        count
    }

    /// Takes all entries out; memory stays, and so do the wheels' ticks.
    pub(crate) fn clear(&mut self) {
        for wheel in self.wheels.iter_mut() {
            if wheel.occupied != [0; LEVELS] {
                *wheel = Wheel { now: wheel.now, ..EMPTY };
            }
        }
        self.chunks.clear();
        (self.free, self.entries) = (NONE, 0);
    }

    /// Gives back chunks that hold nothing since all entries were taken out.
    pub(crate) fn give_back(&mut self) {
        give_up(self.chunks.take_empty());
    }

    /// Takes all entries of a clock out.
    pub(crate) fn drain(&mut self, clock: usize, mut each: impl FnMut(Entry)) {
        for level in 0..LEVELS {
            let mut slots = self.wheels[clock % CLOCKS].occupied[level];
            while slots != 0 {
                self.take_slot(clock, level, slots.trailing_zeros() as usize, &mut each);
                slots &= slots - 1;
            }
        }
    }

    /// Entries, those of words that have changed since included.
    pub(crate) fn len(&self) -> usize {
        self.entries
    }

    /// Looks through a few slots and drops entries that `keep` does not want, and all but one of those that are alike: ground that is changed back and forth under an eye that
    /// stands still gives a node the same word again and again, and the same entry with it.
    pub(crate) fn sweep_some(&mut self, keep: impl Fn(Entry) -> bool) {
        const SLOTS_A_FRAME: usize = 64;
        let mut kept = std::mem::take(&mut self.moving);
        for _ in 0..SLOTS_A_FRAME {
            self.swept = (self.swept + 1) % (CLOCKS * LEVELS * SLOTS);
            let (clock, level, slot) =
                (self.swept / (LEVELS * SLOTS), self.swept / SLOTS % LEVELS, self.swept % SLOTS);
            if self.wheels[clock % CLOCKS].occupied[level] >> slot & 1 == 1 {
                self.take_slot(clock, level, slot, &mut |entry| kept.extend(keep(entry).then_some(entry)));
                kept.sort_unstable_by_key(|entry| (entry.node, entry.word));
                kept.dedup();
                for entry in kept.drain(..) {
                    self.enter(clock, entry);
                }
            }
        }
        self.moving = kept;
    }

    /// Sets the tick of an empty wheel.
    pub(crate) fn restart(&mut self, clock: usize, now: u32) {
        debug_assert_eq!(self.wheels[clock % CLOCKS].occupied, [0; LEVELS]);
        self.wheels[clock % CLOCKS].now = now;
    }

    /// Moves the entries of a slot, which the wheel's tick has reached, to lower levels.
    fn spread(&mut self, clock: usize, level: usize, slot: usize, due: &mut impl FnMut(Entry)) {
        let now = self.wheels[clock % CLOCKS].now;
        let mut moving = std::mem::take(&mut self.moving);
        self.take_slot(clock, level, slot, &mut |entry| {
            if entry.expiry() <= now { due(entry) } else { moving.push(entry) }
        });
        for (i, entry) in moving.iter().enumerate() {
            if let Some(later) = moving.get(i + MOVE_AHEAD) {
                self.prefetch(clock, later.word);
            }
            self.enter(clock, *entry);
        }
        moving.clear();
        self.moving = moving;
    }

    fn take_slot(&mut self, clock: usize, level: usize, slot: usize, each: &mut impl FnMut(Entry)) {
        let wheel = &mut self.wheels[clock % CLOCKS];
        wheel.occupied[level] &= !(1 << slot);
        let mut at = std::mem::replace(&mut wheel.heads[level][slot], NONE);
        while at != NONE {
            self.chunks.prefetch(self.chunks[at as usize].next as usize);
            let chunk = &mut self.chunks[at as usize];
            chunk.entries[..chunk.used as usize].iter().for_each(|entry| each(*entry));
            self.entries -= chunk.used as usize;
            self.wheels[clock % CLOCKS].counts[level] -= chunk.used;
            let next = std::mem::replace(&mut chunk.next, self.free);
            self.free = at;
            at = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_sweep_keeps_what_is_wanted_once() {
        let mut queue = Queue::new();
        for round in 0..100 {
            for node in 0..300 {
                queue.enter(7, Entry { node, word: 5000 + 100 * node });
            }
            // Words that have changed since.
            queue.enter(7, Entry { node: 1000 + round, word: 70_000 });
        }
        for _ in 0..CLOCKS * LEVELS {
            queue.sweep_some(|entry| entry.node < 1000);
        }
        assert_eq!(queue.len(), 300);
        let mut rest = Vec::new();
        queue.drain(7, |entry| rest.push(entry.node));
        rest.sort_unstable();
        assert_eq!(rest, (0..300).collect::<Vec<_>>());
    }

    proptest! {
        /// Against a sorted list: whatever is entered comes out at its time, once.
        #[test]
        fn entries_come_out_when_they_are_due(
            steps in prop::collection::vec((0u64..400_000, prop::collection::vec(0u32..3_000_000, 0..20), any::<bool>()), 1..40)
        ) {
            let mut queue = Queue::new();
            let mut waiting: Vec<Entry> = Vec::new();
            let (mut now, mut node) = (0, 0);
            for (step, lives, small) in steps {
                now += if small { step % 70 } else { step };
                let mut got = Vec::new();
                queue.advance(3, now, |e| got.push(e));
                let mut expected: Vec<Entry> = waiting.iter().copied().filter(|e| u64::from(e.expiry()) <= now).collect();
                waiting.retain(|e| u64::from(e.expiry()) > now);
                got.sort_unstable_by_key(|e| e.node);
                expected.sort_unstable_by_key(|e| e.node);
                prop_assert_eq!(got, expected);
                for life in lives {
                    let expiry = now + u64::from(if node % 3 == 0 { life % 100 } else { life });
                    if expiry < 1 << EXPIRY_BITS {
                        let entry = Entry { node, word: expiry as u32 };
                        queue.enter(3, entry);
                        waiting.push(entry);
                        node += 1;
                    }
                }
            }
            let mut rest = 0;
            queue.drain(3, |_| rest += 1);
            prop_assert_eq!(rest, waiting.len());
        }
    }
}
