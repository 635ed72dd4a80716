//! The expiry queue: it finds the words that are over now, without looking at any other.
//!
//! Each clock has a timing wheel (`super::wheel`): an entry lies in the slot of the highest digit in which its expiry differs from the clock. When the clock comes into the slot, the entry is
//! looked at in each frame until it is over, or, where the clock is slow, moves down a level.
//!
//! An entry is a node's number. The node has the word, so the queue does not: it asks for a word (`Words`) only where the slot does not tell whether that is over. Beside the number stand four
//! bits of the expiry, those below the slot's digit, so that few words are asked for. Words change, and nodes are given up, without a word to the queue: entries are left where
//! they are, and whoever takes one out looks whether the node's word is over.
//!
//! Invariant: a node whose word has not changed since it was entered is handed out in the first frame whose tick is not below its expiry. Other nodes may be handed out too. Cost: a few
//! nanoseconds to enter, the same on the way out, nothing for entries whose turn has not come; 4.3 bytes an entry. All entries lie in chunks of one pool.

use super::certificate::{clock_of, expiry_of};
use super::clocks::{CLOCKS, EXPIRY_BITS};
use super::wheel::{DIGIT, LEVELS, NONE, SLOTS, Wheels, frames_a_slot, level_of, over, slot_at};
use crate::refine::kinetic::capacity::give_up;
use crate::refine::kinetic::chunked::Chunked;
use terrasoar_layout::read::prefetch::prefetch;

/// Entries a chunk, which is two cache lines that a processor brings together.
const CHUNK_ENTRIES: usize = 30;
/// A slot that its wheel's tick is in is looked through in each frame, up to about so many times; where the clock is slower, its entries move down a level.
const LOOKS: u32 = 8;
/// How many entries ahead memory is asked for where they move to.
const MOVE_AHEAD: usize = 6;
/// Bits of an entry that hold a node's number.
pub(crate) const NODE_BITS: u32 = 28;
/// Bits of the expiry that stand beside it.
const BESIDE_BITS: u32 = 32 - NODE_BITS;

/// The words of nodes, without the tree's bit.
pub(crate) trait Words {
    /// The word of a node; of a place that is no more, any that has no certificate.
    fn word(&self, node: u32) -> u32;

    /// Asks memory for a word.
    fn fetch(&self, node: u32);
}

/// A node and the word it has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Entry {
    pub node: u32,
    pub word: u32,
}

/// Where a word is to be entered, while its clock stands still.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Place {
    place: u32,
    /// What stands beside the node's number.
    beside: u32,
}

/// A node and, above [`NODE_BITS`], what stands beside it.
type Packed = u32;

fn node_of(packed: Packed) -> u32 {
    packed & ((1 << NODE_BITS) - 1)
}

/// The bits of an expiry below the digit of its level, where there are some.
#[inline(always)]
fn beside(expiry: u32, level: usize) -> u32 {
    let below = (level as u32 * DIGIT).saturating_sub(BESIDE_BITS);
    expiry >> below & ((1 << BESIDE_BITS) - 1)
}

#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Chunk {
    next: u32,
    used: u32,
    entries: [Packed; CHUNK_ENTRIES],
}

/// The queue of one engine.
#[derive(Debug)]
pub(crate) struct Queue {
    wheels: Wheels,
    chunks: Chunked<Chunk, 8>,
    free: u32,
    /// Entries on their way to another level.
    moving: Vec<(u32, Place)>,
    entries: usize,
    /// The slot that was looked at last for entries that are of no use any more.
    swept: usize,
}

impl Queue {
    pub(crate) fn new() -> Self {
        Self {
            wheels: Wheels::new(),
            chunks: Chunked::default(),
            free: NONE,
            moving: Vec::new(),
            entries: 0,
            swept: 0,
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.wheels.bytes() + self.chunks.bytes() + self.moving.capacity() * size_of::<(u32, Place)>()
    }

    /// Where a word on clock `clock` is to be entered. Asks memory for what that will write to.
    #[inline(always)]
    pub(crate) fn place(&mut self, clock: usize, word: u32) -> Place {
        self.wheels.lend(clock);
        let place = self.place_on(clock, word);
        self.fetch_place(place);
        place
    }

    #[inline(always)]
    fn fetch_place(&self, place: Place) {
        self.chunks.prefetch(self.wheels.heads[place.place as usize] as usize);
    }

    #[inline(always)]
    fn place_on(&self, clock: usize, word: u32) -> Place {
        let expiry = expiry_of(word);
        let place = self.wheels.place(clock, expiry);
        Place { place: place as u32, beside: beside(expiry, level_of(place) % LEVELS) }
    }

    /// Enters a node under its word's expiry on clock `clock`.
    #[inline(always)]
    pub(crate) fn enter(&mut self, clock: usize, entry: Entry) {
        self.wheels.lend(clock);
        self.enter_at(self.place_on(clock, entry.word), entry.node);
    }

    /// Enters a node where its word belongs.
    #[inline(always)]
    pub(crate) fn enter_at(&mut self, Place { place, beside }: Place, node: u32) {
        let (place, packed) = (place as usize, beside << NODE_BITS | node);
        self.entries += 1;
        self.wheels.counts[level_of(place)] += 1;
        let head = &mut self.wheels.heads[place];
        if *head != NONE {
            let chunk = &mut self.chunks[*head as usize];
            if let Some(free) = chunk.entries.get_mut(chunk.used as usize) {
                *free = packed;
                chunk.used += 1;
                return;
            }
        }
        if self.free == NONE {
            let mut entries = [0; CHUNK_ENTRIES];
            entries[0] = packed;
            *head = self.chunks.push(Chunk { next: *head, used: 1, entries }) as u32;
        } else {
            // Its other entries stay as they are.
            let chunk = &mut self.chunks[self.free as usize];
            let next = std::mem::replace(&mut chunk.next, *head);
            chunk.used = 1;
            chunk.entries[0] = packed;
            *head = std::mem::replace(&mut self.free, next);
        }
        self.wheels.set_occupied(place, true);
    }

    /// Moves a wheel on to tick `now` and hands out all nodes whose words' expiry is not above it, and maybe some whose words are others by now.
    pub(crate) fn advance(&mut self, clock: usize, now: u64, words: &impl Words, mut due: impl FnMut(u32)) {
        let then =
            std::mem::replace(&mut self.wheels.now[clock % CLOCKS], now.min(u64::from(u32::MAX)) as u32);
        if self.wheels.is_empty(clock) {
            return self.wheels.take_back(clock);
        }
        if now >= 1 << EXPIRY_BITS {
            return self.drain(clock, due);
        }
        let now = now as u32;
        let mut open = u32::from(std::mem::take(&mut self.wheels.open[clock % CLOCKS]));
        for level in 0..LEVELS {
            let (end, same_turn) = over(then, now, level);
            self.take_slots(clock, level, end, &mut due);
            if same_turn {
                // This level's slot, and those above that have been open before.
                open = open >> level << level | 1 << level;
                break;
            }
        }
        open &= !1;
        while open != 0 {
            let level = open.trailing_zeros() as usize % LEVELS;
            open &= open - 1;
            let place = self.wheels.place_of(clock, level, slot_at(now, level));
            if !self.wheels.is_occupied(place) {
                continue;
            }
            if frames_a_slot(now - then, level) < LOOKS {
                self.sift(clock, place, words, &mut due);
            } else {
                self.spread(clock, place, words, &mut due);
            }
        }
    }

    /// Asks memory for what [`Queue::advance`] will look at: for the heads of slots, then, those having come, for what the heads name.
    #[inline(always)]
    pub(crate) fn fetch(&self, clock: usize, now: u64, heads: bool) {
        if self.wheels.is_empty(clock) {
            return;
        }
        let (then, now) = (self.wheels.now[clock % CLOCKS], now as u32);
        for level in 0..LEVELS {
            let (end, same_turn) = over(then, now, level);
            // The slot that the tick is in, too: what it holds is looked at.
            let first = self.wheels.place_of(clock, level, 0);
            let end = first + end.max(slot_at(now, level) + 1);
            let mut at = first;
            while let Some(place) = self.wheels.next_occupied(at, end) {
                if heads {
                    prefetch(&self.wheels.heads, place);
                    break;
                }
                self.chunks.prefetch(self.wheels.heads[place] as usize);
                at = place + 1;
            }
            if same_turn {
                return;
            }
        }
    }

    /// No fewer entries than would be over if a wheel moved on to tick `now`: all of the levels that have some.
    pub(crate) fn most_over(&self, clock: usize, now: u64) -> usize {
        if self.wheels.is_empty(clock) {
            return 0;
        }
        self.sum_over(clock, now, |place, end, count| {
            let has_some = self.wheels.next_occupied(place, end).is_some();
            if has_some { count } else { 0 }
        })
    }

    /// About how many entries would be over if a wheel moved on to tick `now`: those of levels that would be over as a whole, and of others the share of their slots.
    pub(crate) fn count_over(&self, clock: usize, now: u64) -> usize {
        self.sum_over(clock, now, |place, end, count| {
            let all = self.wheels.count_occupied(place, place + SLOTS).max(1);
            (self.wheels.count_occupied(place, end) * count as u64 / all) as usize
        })
    }

    /// Sums what `of` makes of each level that a wheel passes on its way to tick `now`: from its first place and the end of what is over, and its number of entries.
    #[inline(always)]
    fn sum_over(&self, clock: usize, now: u64, of: impl Fn(usize, usize, usize) -> usize) -> usize {
        let counts = self.wheels.counts_of(clock).map(|count| count as usize);
        if now >= 1 << EXPIRY_BITS {
            return counts.iter().sum();
        }
        let mut sum = 0;
        for (level, count) in counts.into_iter().enumerate() {
            let (end, same_turn) = over(self.wheels.now[clock % CLOCKS], now as u32, level);
            if count > 0 {
                let place = self.wheels.place_of(clock, level, 0);
                sum += of(place, place + end, count);
            }
            if same_turn {
                break;
            }
        }
        sum
    }

    /// Takes all entries out; memory stays, and so do the wheels' ticks.
    pub(crate) fn clear(&mut self) {
        self.wheels.clear();
        self.chunks.clear();
        (self.free, self.entries) = (NONE, 0);
    }

    /// Gives back chunks that hold nothing since all entries were taken out.
    pub(crate) fn give_back(&mut self) {
        give_up(self.chunks.take_empty());
    }

    /// Takes all entries of a clock out.
    pub(crate) fn drain(&mut self, clock: usize, mut each: impl FnMut(u32)) {
        for level in 0..LEVELS {
            self.take_slots(clock, level, SLOTS, &mut each);
        }
    }

    /// Entries, those of words that have changed since included.
    pub(crate) fn len(&self) -> usize {
        self.entries
    }

    /// Looks through a few slots and drops the entries of words that have changed since, and all but one of those that are alike: ground that is changed back and forth under an eye that
    /// stands still gives a node the same word again and again, and the same entry with it.
    pub(crate) fn sweep_some(&mut self, words: &impl Words) {
        const SLOTS_A_FRAME: usize = 256;
        let mut kept = std::mem::take(&mut self.moving);
        for _ in 0..SLOTS_A_FRAME {
            self.swept = (self.swept + 1) % self.wheels.heads.len();
            if self.wheels.is_occupied(self.swept) {
                self.take_slot(self.swept, &mut |node| kept.push((node, Place::default())));
                kept.sort_unstable_by_key(|(node, _)| *node);
                kept.dedup_by_key(|(node, _)| *node);
                for (node, _) in kept.drain(..) {
                    if let Some(place) = self.place_within(self.swept, words.word(node)) {
                        self.enter_at(place, node);
                    }
                }
            }
        }
        self.moving = kept;
    }

    /// Sets the tick of an empty wheel.
    pub(crate) fn restart(&mut self, clock: usize, now: u32) {
        debug_assert!(self.wheels.is_empty(clock));
        self.wheels.take_back(clock);
        (self.wheels.now[clock % CLOCKS], self.wheels.open[clock % CLOCKS]) = (now, 0);
    }

    /// Moves the entries of a slot, which the wheel's tick has reached, to lower levels.
    fn spread(&mut self, clock: usize, place: usize, words: &impl Words, due: &mut impl FnMut(u32)) {
        let now = self.wheels.now[clock % CLOCKS];
        let mut moving = std::mem::take(&mut self.moving);
        self.take_slot(place, &mut |node| {
            words.fetch(node);
            moving.push((node, Place::default()));
        });
        moving.retain_mut(|(node, to)| {
            let word = words.word(*node);
            if expiry_of(word) <= now {
                due(*node);
                return false;
            }
            let found = self.place_within(place, word);
            *to = found.unwrap_or_default();
            found.is_some()
        });
        for (i, (node, to)) in moving.iter().enumerate() {
            if let Some((_, later)) = moving.get(i + MOVE_AHEAD) {
                self.fetch_place(*later);
            }
            self.enter_at(*to, *node);
        }
        moving.clear();
        self.moving = moving;
    }

    /// Where a word belongs now that has been entered at a place: there, or on a level below. `None` if it lies elsewhere, for it has changed since.
    #[inline(always)]
    fn place_within(&self, place: usize, word: u32) -> Option<Place> {
        let found = self.place_on(clock_of(word), word);
        let (level, found_level) = (level_of(place), level_of(found.place as usize));
        let is_below = found_level < level && found_level / LEVELS == level / LEVELS;
        (is_below || found.place as usize == place).then_some(found)
    }

    /// Hands out those nodes of a slot, which the wheel's tick is in, that are over. The others stay.
    fn sift(&mut self, clock: usize, place: usize, words: &impl Words, due: &mut impl FnMut(u32)) {
        let now = self.wheels.now[clock % CLOCKS];
        let now_beside = beside(now, level_of(place) % LEVELS);
        let (mut at, mut before, mut head) = (self.wheels.heads[place], NONE, NONE);
        let mut out = 0;
        while at != NONE {
            self.chunks.prefetch(self.chunks[at as usize].next as usize);
            let Chunk { next, used, entries } = &mut self.chunks[at as usize];
            let (this, mut kept) = (at, 0);
            at = *next;
            let all = (*used as usize).min(CHUNK_ENTRIES);
            // Few entries' words are to be asked for: those whose bits are the tick's.
            for packed in entries[..all].iter().filter(|packed| **packed >> NODE_BITS == now_beside) {
                words.fetch(node_of(*packed));
            }
            for i in 0..all {
                let packed = entries[i];
                let is_over = packed >> NODE_BITS < now_beside
                    || packed >> NODE_BITS == now_beside && { expiry_of(words.word(node_of(packed))) <= now };
                if is_over {
                    due(node_of(packed));
                } else {
                    entries[kept] = packed;
                    kept += 1;
                }
            }
            out += *used - kept as u32;
            *used = kept as u32;
            if kept == 0 {
                *next = std::mem::replace(&mut self.free, this);
                continue;
            }
            match before {
                NONE => head = this,
                _ => self.chunks[before as usize].next = this,
            }
            before = this;
        }
        if before != NONE {
            self.chunks[before as usize].next = NONE;
        }
        self.wheels.heads[place] = head;
        self.wheels.counts[level_of(place)] -= out;
        self.entries -= out as usize;
        if head == NONE {
            self.wheels.set_occupied(place, false);
        } else {
            self.wheels.open[clock % CLOCKS] |= 1 << (level_of(place) % LEVELS);
        }
    }

    /// Takes the entries of the first `end` slots of a level out.
    #[inline(always)]
    fn take_slots(&mut self, clock: usize, level: usize, end: usize, each: &mut impl FnMut(u32)) {
        let first = self.wheels.place_of(clock, level, 0);
        let (mut at, end) = (first, first + end);
        while let Some(place) = self.wheels.next_occupied(at, end) {
            self.take_slot(place, each);
            at = place + 1;
        }
    }

    fn take_slot(&mut self, place: usize, each: &mut impl FnMut(u32)) {
        self.wheels.set_occupied(place, false);
        let mut at = std::mem::replace(&mut self.wheels.heads[place], NONE);
        let mut out = 0;
        while at != NONE {
            self.chunks.prefetch(self.chunks[at as usize].next as usize);
            let chunk = &mut self.chunks[at as usize];
            chunk.entries[..chunk.used as usize].iter().for_each(|packed| each(node_of(*packed)));
            out += chunk.used;
            let next = std::mem::replace(&mut chunk.next, self.free);
            self.free = at;
            at = next;
        }
        self.entries -= out as usize;
        self.wheels.counts[level_of(place)] -= out;
    }
}

#[cfg(test)]
mod tests;
