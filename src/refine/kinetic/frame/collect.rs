//! The start of a frame: clocks advance, words that are over leave the queue, and words change clocks where a course ends or a clock starts again.
//!
//! Invariant: afterwards every node with a live word is in one of the queues where that word belongs, or due, and due once. Cost: in proportion to the words that are over, and to a
//! course's words when the eye takes another course.

use super::ahead::Ahead;
use crate::refine::Phase;
use crate::refine::kinetic::Kinetic;
use crate::refine::kinetic::mesh::nodes::{SPLIT, STATUS};
use crate::refine::kinetic::time::certificate::{expiry_of, with_certificate};
use crate::refine::kinetic::time::clocks::{BANDS, EXPIRY_BITS, HORIZON, Kind, clock_id};
use crate::refine::kinetic::time::course::Pose;
use crate::refine::kinetic::time::queue::{Entry, Queue};
use crate::refine::listener::Listener;
use terrasoar_layout::read::prefetch::prefetch;
use terrasoar_layout::read::store::RecordStore;

impl<S: RecordStore> Kinetic<S> {
    /// Takes from the queue what is over, and brings clocks and courses in order.
    pub(crate) fn collect(&mut self, pose: Pose, probe: &mut Listener<'_>) {
        let moved = self.clocks.move_to(pose);
        if let Some(ahead) = &mut self.ahead {
            ahead.keep_pace(&self.clocks);
        }
        if self.has_jumped(moved.clocks) {
            self.uproot();
        }
        for heads in [true, false] {
            each_clock(moved.clocks, |clock| self.queue.fetch(clock, self.clocks.now(clock), heads));
        }
        let mut clocks = moved.clocks;
        while clocks != 0 {
            let clock = clocks.trailing_zeros() as usize;
            clocks &= clocks - 1;
            self.bring_near(clock);
            let (over, now) = (&mut self.over, self.clocks.now(clock));
            let until = latest(clock, now);
            self.queue.advance(clock, now, &self.nodes.all, |node| {
                prefetch(&self.nodes.all, node as usize);
                over.push(Entry { node, word: until });
            });
            if let Some(by) = self.clocks.set_back(clock) {
                self.keep_true_entries();
                if let Some(ahead) = &mut self.ahead {
                    ahead.until[clock] = ahead.until[clock].saturating_sub(by);
                }
                self.move_words(clock, clock, |expiry| u64::from(expiry).saturating_sub(by) as u32);
            }
        }
        self.keep_true_entries();
        // Late nodes may have gone since, or be another's by now, which then is in the queue.
        let is_late = |node: &u32| self.nodes.all.get(*node as usize).is_some_and(|n| n.word & !STATUS == 0);
        self.due.extend(self.late.drain(..).filter(is_late));
        if let Some((number, course)) = moved.next_course {
            let finer_bits = self.clocks.finer_bits(number);
            for kind in [Kind::Error, Kind::Planes] {
                for band in 0..BANDS {
                    let (from, to) = (clock_id(number, kind, band), clock_id(0, kind, band));
                    let (then, now) = (self.clocks.now(from) as u32, self.clocks.now(to) as u32);
                    // A tick less, for the two clocks' ticks begin at different points.
                    self.move_words(from, to, |expiry| {
                        now + (expiry.saturating_sub(then + 1) >> finer_bits).min(HORIZON)
                    });
                }
            }
            self.clocks.take_course(number, course);
            for clock in clock_id(number, Kind::Error, 0)..clock_id(number + 1, Kind::Error, 0) {
                let now = self.clocks.now(clock);
                self.queue.restart(clock, now as u32);
                if let Some(ahead) = &mut self.ahead {
                    ahead.restart(clock, now, self.clocks.newest_step(clock));
                }
            }
        }
        self.work.expired = self.due.len() as u64;
        probe.phase(Phase::Test);
    }

    /// Moves to the queue what is over before long, and notes that it is to be looked from.
    fn bring_near(&mut self, clock: usize) {
        let Some(ahead) = &mut self.ahead else { return };
        let until = ahead.reach(clock, self.clocks.now(clock));
        let mut near = std::mem::take(&mut self.waiting);
        let word = latest(clock, until);
        ahead.far.advance(clock, until, &self.nodes.all, |node| near.push(Entry { node, word }));
        for Entry { node, word } in near.drain(..) {
            if let Some(word) = self.nodes.word_over(node, word) {
                ahead.near(node);
                self.queue.enter(clock, Entry { node, word: *word & !SPLIT });
            }
        }
        self.waiting = near;
    }

    /// Enters a word under its expiry.
    #[inline(always)]
    pub(crate) fn enter(&mut self, clock: usize, entry: Entry) {
        enter::<S>(&mut self.queue, &mut self.ahead, clock, entry);
    }

    /// Makes due those nodes whose word is over, once each.
    fn keep_true_entries(&mut self) {
        for Entry { node, word: until } in self.over.drain(..) {
            if let Some(word) = self.nodes.word_over(node, until) {
                *word &= STATUS;
                self.due.push(node);
                self.vertices.fetch(self.nodes.get(node).anchor().slot());
            }
        }
    }

    /// Gives all words on clock `from` an expiry on clock `to`.
    fn move_words(&mut self, from: usize, to: usize, expiry: impl Fn(u32) -> u32) {
        let mut waiting = std::mem::take(&mut self.waiting);
        let nodes = &mut self.nodes;
        let mut moved = |node: u32| {
            nodes.word_on(from, node).map(|word| {
                let moved = with_certificate(*word, to, expiry(expiry_of(*word)));
                // None while it is in no queue, so that no other entry of the node moves it again.
                *word &= STATUS;
                Entry { node, word: moved }
            })
        };
        self.queue.drain(from, |node| waiting.extend(moved(node)));
        self.queue.restart(from, self.clocks.now(from) as u32);
        let near = waiting.len();
        if let Some(ahead) = &mut self.ahead {
            ahead.far.drain(from, |node| waiting.extend(moved(node)));
            ahead.far.restart(from, ahead.until[from].min(u64::from(u32::MAX)) as u32);
        }
        for (i, entry) in waiting.drain(..).enumerate() {
            let word = &mut self.nodes.get_mut(entry.node).word;
            *word = entry.word | *word & SPLIT;
            let stays_near = |ahead: &Ahead| i < near && u64::from(expiry_of(entry.word)) <= ahead.until[to];
            // What was near has been looked from; that another clock counts it brings nothing that it will need.
            if self.ahead.as_deref().is_none_or(stays_near) {
                self.queue.enter(to, entry);
            } else {
                self.enter(to, entry);
            }
        }
        self.waiting = waiting;
    }
}

/// The word that is over last on a clock whose tick is `now`.
fn latest(clock: usize, now: u64) -> u32 {
    with_certificate(0, clock, now.min((1 << EXPIRY_BITS) - 1) as u32)
}

/// Calls `each` with the clocks of a set.
#[inline(always)]
pub(crate) fn each_clock(mut clocks: u128, mut each: impl FnMut(usize)) {
    while clocks != 0 {
        each(clocks.trailing_zeros() as usize);
        clocks &= clocks - 1;
    }
}

/// Enters a word under its expiry: into the queue, or into the one that is looked at some frames before.
#[inline(always)]
pub(crate) fn enter<S: RecordStore>(
    queue: &mut Queue,
    ahead: &mut Option<Box<Ahead>>,
    clock: usize,
    entry: Entry,
) {
    if !S::IS_COMPLETE
        && let Some(ahead) = ahead
    {
        if u64::from(expiry_of(entry.word)) > ahead.until[clock] {
            return ahead.far.enter(clock, entry);
        }
        ahead.near(entry.node);
    }
    queue.enter(clock, entry);
}
