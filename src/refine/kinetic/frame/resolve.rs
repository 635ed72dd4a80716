//! The middle of a frame: vertices that are due are tested, and those whose status has changed are split or merged.
//!
//! Invariant: without a budget nothing is left due, and exactly the vertices are split whose words say so. Tests give the same answers in whatever order and on
//! however many threads they are made. Splits and merges go one by one, in the order of the list of words that were over. Cost: in proportion to the words that are over, and to the
//! children of vertices that are split.

use super::budget::Allowance;
use crate::refine::Phase;
use crate::refine::kinetic::Kinetic;
use crate::refine::kinetic::hands::is_shared;
use crate::refine::kinetic::mesh::nodes::{SPLIT, STATUS, UNREAD};
use crate::refine::kinetic::mesh::tree::Fetch;
use crate::refine::kinetic::time::certificate::batch::{BATCH, Batch, Words};
use crate::refine::kinetic::time::certificate::{ACTIVE, Judge, clock_of, expiry_of};
use crate::refine::kinetic::time::queue::{Entry, Place};
use crate::refine::listener::Listener;
#[cfg(feature = "files")]
use rayon::prelude::*;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::store::{RawOf, RecordStore};

/// From so many tests on they are shared among threads.
const PARALLEL: usize = 4096;
/// How many splits or merges ahead memory is asked for what.
const FETCH_AHEAD: [(Fetch, usize); 3] = [(Fetch::Node, 6), (Fetch::Near, 4), (Fetch::Far, 2)];

impl<S: RecordStore> Kinetic<S> {
    /// Tests what is due, as far as the budget allows.
    pub(crate) fn test_due(&mut self, judge: &Judge, allowance: &mut Allowance, probe: &mut Listener<'_>) {
        let mut batch = std::mem::take(&mut self.list);
        while !self.due.is_empty() {
            let splits_wait = self.to_split.iter().any(|nodes| !nodes.is_empty());
            let allowed = allowance.tests(self.due.len(), splits_wait);
            if allowed == 0 {
                break;
            }
            // From the end, where those lie that have been late before.
            batch.extend(self.due.drain(self.due.len() - allowed..));
            self.test(&batch, false, judge, probe);
            batch.clear();
        }
        self.late.append(&mut self.due);
        self.list = batch;
    }

    /// Tests nodes and sorts out those that are to be split or merged. Fresh ones have their records read first; where a record is away
    /// the node waits for it.
    fn test(&mut self, nodes: &[u32], fresh: bool, judge: &Judge, probe: &mut Listener<'_>) {
        let mut verdicts = std::mem::take(&mut self.verdicts);
        let mut batch = self.batch.take().unwrap_or_default();
        self.work.tests += nodes.len() as u64;
        let k = self.records.grid().k();
        let parallel = is_shared(nodes.len(), PARALLEL / 2);
        // By one thread, what has been tested is still at hand when it is entered.
        for part in nodes.chunks(if parallel { nodes.len() } else { BATCH }) {
            verdicts.clear();
            verdicts.resize(part.len(), (S::Codec::INERT, UNREAD));
            let batches = |batch: &mut Batch, part: &[u32], verdicts: &mut [(RawOf<S>, u32)]| {
                for (nodes, verdicts) in part.chunks(BATCH).zip(verdicts.chunks_mut(BATCH)) {
                    let mut places = [(GridPoint::default(), 0); BATCH];
                    for (place, node) in places.iter_mut().zip(nodes) {
                        *place = self.place_of(*node);
                    }
                    let raw_of = |i: usize| {
                        if fresh {
                            self.records.get(slot_of(k, places[i].0))
                        } else {
                            Some(self.nodes.get(nodes[i]).raw)
                        }
                    };
                    self.judge_batch(batch, &places[..nodes.len()], raw_of, judge, verdicts);
                }
            };
            if parallel {
                #[cfg(feature = "files")]
                part.par_chunks(PARALLEL / 8)
                    .zip(verdicts.par_chunks_mut(PARALLEL / 8))
                    .for_each(|(part, verdicts)| batches(&mut Batch::default(), part, verdicts));
            } else {
                batches(&mut batch, part, &mut verdicts);
            }
            for (nodes, verdicts) in part.chunks(BATCH).zip(verdicts.chunks(BATCH)) {
                let mut places = [Place::default(); BATCH];
                for (place, (_, word)) in places.iter_mut().zip(verdicts) {
                    *place = self.queue.place(clock_of(*word), *word);
                }
                for ((node, (raw, word)), place) in nodes.iter().zip(verdicts).zip(places) {
                    self.take_verdict(*node, fresh, *raw, *word, place, probe);
                }
            }
        }
        (self.verdicts, self.batch) = (verdicts, Some(batch));
    }

    /// Makes the words of up to [`BATCH`] vertices, given by point and level, from their records, and gives them with those. [`UNREAD`] where they are away.
    #[inline(always)]
    pub(crate) fn judge_batch(
        &self,
        batch: &mut Batch,
        places: &[(GridPoint, u32)],
        raw_of: impl Fn(usize) -> Option<RawOf<S>>,
        judge: &Judge,
        verdicts: &mut [(RawOf<S>, u32)],
    ) {
        let together = judge.makes_batches();
        for (i, ((point, level), verdict)) in places.iter().zip(verdicts.iter_mut()).enumerate() {
            let Some(raw) = raw_of(i) else { continue };
            let vertex = self.records.decode(raw, *level);
            let at_m = self.records.grid().position_m(*point);
            *verdict = (raw, 0);
            if together {
                batch.set(i, at_m, &vertex);
            } else {
                verdict.1 = judge.word(&judge.metric().sight(at_m, &vertex));
            }
        }
        if together {
            let mut words = Words::default();
            judge.words(batch, places.len(), &mut words);
            for ((_, verdict), word) in verdicts.iter_mut().zip(words.as_flattened()) {
                if S::IS_COMPLETE || *verdict != UNREAD {
                    *verdict = *word;
                }
            }
        }
    }

    /// Enters a node's new word, and lists the node if it is to be split or merged.
    #[inline(always)]
    fn take_verdict(
        &mut self,
        node: u32,
        fresh: bool,
        raw: RawOf<S>,
        word: u32,
        place: Place,
        probe: &mut Listener<'_>,
    ) {
        let record = self.nodes.get_mut(node);
        let old = record.word;
        if !S::IS_COMPLETE && word == UNREAD {
            record.word = UNREAD;
            self.unread.push(node);
            return;
        }
        if fresh {
            record.raw = raw;
            if probe.hears_reads() {
                probe.read(slot_of(self.records.grid().k(), self.point_of(node)));
            }
        } else if expiry_of(old) != 0 {
            // Twice in the list: it had been late, then gone, then come back.
            return;
        }
        self.nodes.get_mut(node).word = word | (old & SPLIT);
        // Where pages may be away, it may go into the other queue.
        if S::IS_COMPLETE {
            self.queue.enter_at(place, node)
        } else {
            self.enter(clock_of(word), Entry { node, word })
        }
        match (word & ACTIVE != 0, old & SPLIT != 0) {
            (true, false) => self.to_split[self.level(node)].push(node),
            (false, true) => self.to_merge[self.level(node)].push(node),
            _ => {}
        }
    }

    #[inline(always)]
    fn level(&self, node: u32) -> usize {
        self.place_of(node).1 as usize
    }

    /// Tests the children that splits have made.
    pub(crate) fn test_fresh(&mut self, judge: &Judge, probe: &mut Listener<'_>) {
        let mut fresh = std::mem::take(&mut self.fresh);
        self.test(&fresh, true, judge, probe);
        fresh.clear();
        self.fresh = fresh;
    }

    /// Splits and merges what is to be, until no child made on the way is left untested.
    pub(crate) fn apply(&mut self, judge: &Judge, allowance: &mut Allowance, probe: &mut Listener<'_>) {
        let mut list = std::mem::take(&mut self.list);
        // From fine to coarse, so that children have merged before their parents.
        list.extend(self.to_merge.iter_mut().flat_map(|nodes| nodes.drain(..)));
        self.in_order(&list, Self::fetch_for_merge, |engine, node| {
            if engine.nodes.is_live(node) && engine.nodes.get(node).word & STATUS == SPLIT {
                engine.merge(node);
            }
            true
        });
        loop {
            allowance.start_round();
            // From coarse to fine, so that parents have split before their children.
            for level in (0..self.to_split.len()).rev() {
                if self.to_split[level].is_empty() || !allowance.split() {
                    continue;
                }
                list.clear();
                list.append(&mut self.to_split[level]);
                let done = self.in_order(&list, Self::fetch_for_split, |engine, node| {
                    let wanted = engine.nodes.is_live(node) && engine.nodes.get(node).word & STATUS == ACTIVE;
                    if !wanted {
                        return true;
                    }
                    if !allowance.split() {
                        return false;
                    }
                    let before = engine.fresh.len();
                    if engine.split(node) {
                        // At the finest level there are no children to be tested.
                        allowance.charge((engine.fresh.len() - before).max(usize::from(level == 0)));
                    } else {
                        // Its other parent may be among the untested.
                        engine.to_split[level].push(node);
                    }
                    true
                });
                // The rest waits for the next round, or the next frame.
                self.to_split[level].extend_from_slice(&list[done..]);
            }
            if self.fresh.is_empty() {
                break;
            }
            probe.phase(Phase::Test);
            self.test_fresh(judge, probe);
            probe.phase(Phase::Apply);
        }
        list.clear();
        self.list = list;
    }

    /// Does something to each node until that says no, and asks memory for what comes after it meanwhile. Tells how many nodes it was done to.
    #[inline(always)]
    fn in_order(
        &mut self,
        nodes: &[u32],
        fetch: impl Fn(&Self, u32, Fetch),
        mut each: impl FnMut(&mut Self, u32) -> bool,
    ) -> usize {
        for (i, node) in nodes.iter().enumerate() {
            for (what, distance) in FETCH_AHEAD {
                if let Some(later) = nodes.get(i + distance) {
                    fetch(self, *later, what);
                }
            }
            if !each(self, *node) {
                return i;
            }
        }
        nodes.len()
    }
}
