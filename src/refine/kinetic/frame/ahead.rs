//! Live ranges as a schedule for reading: which pages will be needed, and in how many frames, where only some pages of a terrain are in memory.
//!
//! A page is needed when a vertex splits whose children lie on it. A vertex's certificate says when that can happen at the earliest. So each word is looked at twice:
//! some frames before its live range is over (`until`), and when it is over. The first look ahead goes to the children's records. A child in
//! memory gets a certificate of its own, as if it were in the mesh. If that is over soon enough, the look goes on to its children in turn. A child whose page is not in memory is
//! asked for by the frame in which its parent may split, and is looked at again when the page has come.
//!
//! Invariant, with a lead of H frames and an eye that keeps its pace and course: what is needed in frame t was asked for in frame t - H. The reason: a look at a vertex
//! that may split in x frames goes down to everything needed within x + H frames. So what comes after its split is covered for H frames, and its
//! children are looked at when they are made, or H frames before they are over. Cost: one move from queue to queue a word, and a test for each vertex that a
//! look meets, most of them two or three times.
//!
//! Based on: the deadline of a vertex, max of what the error test and the planes allow, which is what a certificate states along the course; earliest deadline first
//! is C. Liu, J. Layland, "Scheduling Algorithms for Multiprogramming in a Hard-Real-Time Environment", JACM 20(1), 1973.

use crate::refine::kinetic::Kinetic;
use crate::refine::kinetic::mesh::labels::{child_point, level_of};
use crate::refine::kinetic::mesh::nodes::{STATUS, UNREAD};
use crate::refine::kinetic::time::certificate::{ACTIVE, Judge, clock_of, expiry_of};
use crate::refine::kinetic::time::clocks::{CLOCKS, Clocks};
use crate::refine::kinetic::time::queue::Queue;
use std::collections::HashSet;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::read::store::RecordStore;

/// Vertices that the looks of one frame may test, two to five milliseconds; the rest is looked at in the next.
const TESTS_A_FRAME: usize = 8000;
/// The same where the time of a frame is bounded.
const TESTS_IN_TIME: usize = 2000;
/// Tests of one look after which it remembers what it has tested. A vertex has two parents, so that a look which goes down many levels would come by the finest ones as
/// often as there are ways to them: few where errors shrink from level to level, as they do in sound files and near no void, and 2^32 elsewhere.
const TESTS_UNREMEMBERED: usize = 64;
/// Tests after which a look ends, whatever is left: records of nonsense may all be wanted at once.
const TESTS_A_LOOK: usize = 8 * TESTS_A_FRAME;
/// Share of the newest frame in a clock's pace.
const RECENT: f32 = 0.2;
/// A pace grows by no more than this a frame, lest one jump of the eye make everything urgent.
const LARGEST_GROWTH: f32 = 16.0;
/// Frames between two times that a page still away is wanted anew, by a new deadline.
const AGAIN: u64 = 8;

/// A page that the mesh lacks or will need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Want {
    /// Logical page.
    pub page: u64,
    /// Frames until it is needed if the eye keeps its pace and course, 0 or more.
    pub in_frames: f32,
    /// Whether the mesh lacks it now.
    pub is_lacking: bool,
}

/// What looks ahead.
#[derive(Debug)]
pub(crate) struct Ahead {
    /// Words that will not be over for a while.
    pub far: Queue,
    /// The tick of each clock that has been looked ahead to. Words that are over by then lie in the engine's own queue.
    pub until: [u64; CLOCKS],
    /// Ticks a frame, of late.
    pace: [f32; CLOCKS],
    lead_frames: f32,
    frame: u64,
    /// Nodes to look from.
    looks: Vec<u32>,
    /// Pages that looks have met and that are away, and the nodes looked from.
    blocked: Vec<(u64, u32)>,
    /// Vertices whose children are to be sought, and in how many frames they may split.
    stack: Vec<(GridPoint, f32)>,
    /// What a long look has met.
    seen: HashSet<GridPoint>,
}

impl Ahead {
    pub(crate) fn new(lead_frames: f32) -> Self {
        Self {
            far: Queue::new(),
            until: [0; CLOCKS],
            pace: [0.0; CLOCKS],
            lead_frames,
            frame: 0,
            looks: Vec::new(),
            blocked: Vec::new(),
            stack: Vec::new(),
            seen: HashSet::new(),
        }
    }

    pub(crate) fn set_lead(&mut self, frames: f32) {
        self.lead_frames = frames;
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.far.bytes()
            + self.looks.capacity() * size_of::<u32>()
            + self.blocked.capacity() * size_of::<(u64, u32)>()
            + self.stack.capacity() * size_of::<(GridPoint, f32)>()
            + self.seen.capacity() * size_of::<GridPoint>()
    }

    /// Forgets all nodes.
    pub(crate) fn clear(&mut self) {
        self.far.clear();
        self.looks.clear();
        self.blocked.clear();
    }

    /// Takes in what the clocks did in this frame.
    pub(crate) fn keep_pace(&mut self, clocks: &Clocks) {
        self.frame += 1;
        for (clock, pace) in self.pace.iter_mut().enumerate() {
            let step = clocks.newest_step(clock);
            let step = if *pace > 0.0 { step.min(LARGEST_GROWTH * *pace) } else { step };
            *pace += (if *pace > 0.0 { RECENT } else { 1.0 }) * (step - *pace);
        }
    }

    /// The tick of `clock`, which is at `now`, to look ahead to.
    pub(crate) fn reach(&mut self, clock: usize, now: u64) -> u64 {
        let ahead = (self.pace[clock] * self.lead_frames).ceil() as u64;
        self.until[clock] = self.until[clock].max(now.saturating_add(ahead));
        self.until[clock]
    }

    /// Starts a clock without words again at tick `now`, with a pace of `pace` ticks a frame.
    pub(crate) fn restart(&mut self, clock: usize, now: u64, pace: f32) {
        self.far.restart(clock, now as u32);
        self.until[clock] = now;
        self.pace[clock] = pace;
    }

    /// Enters a word whose end has been looked ahead to.
    pub(crate) fn near(&mut self, node: u32) {
        self.looks.push(node);
    }

    /// Frames until a word may be over.
    fn frames_left(&self, word: u32, judge: &Judge) -> f32 {
        if word & ACTIVE != 0 || word & !STATUS == 0 {
            return 0.0;
        }
        let clock = clock_of(word);
        expiry_of(word).saturating_sub(judge.now(clock)) as f32 / self.pace[clock]
    }
}

impl<S: RecordStore> Kinetic<S> {
    /// Looks for the pages that the next frames will need. From nodes only that are close to being over; nodes that wait for their own record want its page.
    pub(crate) fn look(&mut self, judge: &Judge) {
        let k = self.records.grid().k();
        self.wants.clear();
        self.wants.extend(self.unread.iter().filter(|node| self.nodes.is_unread(**node)).map(|node| {
            let slot = slot_of(k, self.nodes.get(*node).place(&self.vertices).0);
            Want { page: S::page_of(slot), in_frames: 0.0, is_lacking: true }
        }));
        let Some(mut ahead) = self.ahead.take() else { return };
        let again = ahead.frame.is_multiple_of(AGAIN);
        let mut blocked = std::mem::take(&mut ahead.blocked);
        blocked.retain(|(page, node)| {
            // The first record of the page tells whether it has come.
            if self.records.get(*page * S::records_per_page()).is_some() {
                ahead.looks.push(*node);
                return false;
            }
            if again && self.may_split(*node) {
                let in_frames = ahead.frames_left(self.nodes.get(*node).word, judge);
                if in_frames < 2.0 * ahead.lead_frames {
                    self.wants.push(Want { page: *page, in_frames, is_lacking: false });
                }
            }
            self.may_split(*node)
        });
        ahead.blocked = blocked;
        let mut looked = 0;
        let mut tests = 0;
        let most = if self.budget.time.is_some() { TESTS_IN_TIME } else { TESTS_A_FRAME };
        while tests < most && looked < ahead.looks.len() {
            let node = ahead.looks[looked];
            looked += 1;
            if self.may_split(node) {
                tests += self.look_from(node, &mut ahead, judge);
            }
        }
        ahead.looks.drain(..looked);
        self.ahead = Some(ahead);
    }

    /// Whether a place holds a leaf with a record.
    fn may_split(&self, node: u32) -> bool {
        self.nodes.all.get(node as usize).is_some_and(|_| {
            self.nodes.is_live(node) && !self.nodes.is_split(node) && !self.nodes.is_unread(node)
        })
    }

    /// Seeks what the split of a leaf will need, and what may follow from it. Tells the tests made.
    fn look_from(&mut self, node: u32, ahead: &mut Ahead, judge: &Judge) -> usize {
        let grid = *self.records.grid();
        let (k, side) = (grid.k(), grid.side_steps());
        let first = ahead.frames_left(self.nodes.get(node).word, judge);
        let most = first + ahead.lead_frames;
        if !most.is_finite() {
            return 0;
        }
        let mut tests = 0;
        let mut away = None;
        ahead.stack.clear();
        ahead.seen.clear();
        ahead.stack.push((self.point_of(node), first));
        while let Some((point, in_frames)) = ahead.stack.pop().filter(|_| tests < TESTS_A_LOOK) {
            let level = level_of(point);
            if level == 0 {
                continue;
            }
            for child in (0..4)
                .map(|label| child_point(point, level, label))
                .filter(|c| c.x() <= side && c.y() <= side)
            {
                let slot = slot_of(k, child);
                let Some(raw) = self.records.get(slot) else {
                    let page = S::page_of(slot);
                    if self.wants.last().is_none_or(|last| last.page != page || last.in_frames > in_frames) {
                        self.wants.push(Want { page, in_frames, is_lacking: false });
                    }
                    away = away.or(Some(page));
                    continue;
                };
                if level == 1 {
                    continue;
                }
                // The first way to it says when it can be needed at the earliest, as every other does.
                if tests > TESTS_UNREMEMBERED && !ahead.seen.insert(child) {
                    continue;
                }
                tests += 1;
                let vertex = self.records.decode(raw, level - 1);
                let word = judge.word(&judge.metric().sight(grid.position_m(child), &vertex));
                // No vertex splits before its parent.
                let child_in_frames = ahead.frames_left(word, judge).max(in_frames);
                if child_in_frames <= most {
                    ahead.stack.push((child, child_in_frames));
                }
            }
        }
        if let Some(page) = away {
            ahead.blocked.push((page, node));
        }
        tests + 1
    }

    /// Makes fresh those unread nodes whose record has come.
    pub(crate) fn take_arrivals(&mut self) {
        if S::IS_COMPLETE {
            return;
        }
        let k = self.records.grid().k();
        let mut unread = std::mem::take(&mut self.unread);
        unread.retain(|node| {
            let Some(record) = self.nodes.all.get_mut(*node as usize).filter(|n| n.word == UNREAD) else {
                return false;
            };
            let is_away = self.records.get(slot_of(k, record.place(&self.vertices).0)).is_none();
            if !is_away {
                record.word = 0;
                self.fresh.push(*node);
                // What its triangles show may depend on it.
                (0..2).for_each(|side| self.nodes.clusters.touch(*node, side));
            }
            is_away
        });
        self.unread = unread;
    }
}
