//! The start of a frame: clocks move, what is over leaves the queue, and words change clocks where a course ends or a clock starts again.
//!
//! Invariant: afterwards every live word is in the queue exactly once, or due. Cost: what is over; moving a course's words when the eye takes
//! another.

use super::Kinetic;
use super::certificate::{expiry_of, with_certificate};
use super::clocks::{BANDS, HORIZON, Kind, Pose, clock_id};
use super::nodes::{SPLIT, STATUS};
use super::queue::Entry;
use crate::refine::{Phase, Probe};
use terrasoar_layout::prefetch::prefetch;
use terrasoar_layout::record::RecordCodec;

impl<C: RecordCodec> Kinetic<'_, C> {
    /// Takes from the queue what is over, and brings clocks and courses in order.
    pub(super) fn collect<P: Probe>(&mut self, pose: Pose, probe: &mut P) {
        let moved = self.clocks.move_to(pose);
        let mut clocks = moved.clocks;
        while clocks != 0 {
            let clock = clocks.trailing_zeros() as usize;
            clocks &= clocks - 1;
            let over = &mut self.over;
            self.queue.advance(clock, self.clocks.now(clock), |entry| {
                prefetch(&self.nodes.all, entry.node as usize);
                over.push(entry);
            });
            if let Some(by) = self.clocks.set_back(clock) {
                self.move_words(clock, clock, |expiry| u64::from(expiry).saturating_sub(by) as u32);
            }
        }
        self.keep_true_entries();
        // Late nodes may have gone since, or be another's by now, which then is in the queue.
        let is_late = |node: &u32| self.nodes.all.get(*node as usize).is_some_and(|n| n.word & !STATUS == 0);
        self.due.extend(self.late.drain(..).filter(is_late));
        if let Some((number, course)) = moved.next_course {
            for kind in [Kind::Error, Kind::Planes] {
                for band in 0..BANDS {
                    let (from, to) = (clock_id(number, kind, band), clock_id(0, kind, band));
                    let (then, now) = (self.clocks.now(from) as u32, self.clocks.now(to) as u32);
                    // A tick less, for the two clocks' ticks begin at different points.
                    self.move_words(from, to, |expiry| now + expiry.saturating_sub(then + 1).min(HORIZON));
                }
            }
            self.clocks.take_course(number, course);
        }
        self.work.expired = self.due.len() as u64;
        probe.phase(Phase::Test);
    }

    /// Makes due those nodes whose word still is the one that was entered.
    fn keep_true_entries(&mut self) {
        for entry in self.over.drain(..) {
            if let Some(word) = self.nodes.word_if(entry.node, entry.word) {
                *word &= STATUS;
                self.due.push(entry.node);
            }
        }
    }

    /// Gives all words on clock `from` an expiry on clock `to`.
    fn move_words(&mut self, from: usize, to: usize, expiry: impl Fn(u32) -> u32) {
        let mut waiting = std::mem::take(&mut self.waiting);
        let nodes = &mut self.nodes;
        self.queue.drain(from, |entry| {
            if let Some(word) = nodes.word_if(entry.node, entry.word) {
                let moved = with_certificate(entry.word, to, expiry(expiry_of(entry.word)));
                *word = moved | (*word & SPLIT);
                waiting.push(Entry { node: entry.node, word: moved });
            }
        });
        self.queue.restart(from, self.clocks.now(from) as u32);
        for entry in waiting.drain(..) {
            self.queue.enter(to, entry);
        }
        self.waiting = waiting;
    }
}
