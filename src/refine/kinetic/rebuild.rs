//! Rebuilding the bin-tree array in depth-first order, a few nodes a frame.
//!
//! Splits put nodes wherever there is room. When the array is full and has grown by half since the last time, it is rebuilt: a depth-first walk moves each
//! node it meets to the next place from the front, and whoever lies there out of the way. The walk pauses after [`MOVES_PER_FRAME`] moves and
//! goes on in the next frame from where its path still stands, so that no frame is long; nodes that came or went behind it keep the places
//! they have. Moved triangles show in the patch like changed ones. Vertices keep their slots.

use super::Kinetic;
use super::certificate::{clock_of, expiry_of};
use super::labels::level_of;
use super::nodes::{CENTRE, NONE, SPLIT, STATUS, body};
use super::pages::Dealing;
use super::queue::Entry;
use terrasoar_layout::record::RecordCodec;

/// Nodes moved in one frame at most.
const MOVES_PER_FRAME: usize = 32;
/// Nodes looked at in one frame at most.
const VISITS_PER_FRAME: usize = 256;
/// Shorter arrays are left as they are: they lie in the cache.
const LEAST: usize = 16_384;

/// A step of the walk's path: a node and the label of the child to visit next.
#[derive(Debug, Clone, Copy)]
struct Step {
    node: u32,
    next: usize,
}

/// Where the walk is.
#[derive(Debug, Default)]
pub(super) struct Rebuild {
    path: Vec<Step>,
    /// The next place to be filled.
    place: u32,
    /// Length of the array when the last walk began.
    length: usize,
}

impl<C: RecordCodec> Kinetic<'_, C> {
    /// Begins a walk if it is time, or goes on with it.
    pub(super) fn step_rebuild(&mut self) {
        if self.rebuild.path.is_empty() {
            let pages = &self.nodes.pages;
            let is_full = pages.taken() == pages.places() && pages.dealing() == Dealing::Packed;
            if !is_full || pages.places() < LEAST.max(self.rebuild.length + self.rebuild.length / 2) {
                return;
            }
            self.rebuild.length = pages.places();
            self.rebuild.place = CENTRE + 1;
            self.rebuild.path.push(Step { node: CENTRE, next: 0 });
        }
        self.forget_broken_path();
        let (mut moves, mut visits) = (0, 0);
        while let Some(step) = self.rebuild.path.last_mut()
            && moves < MOVES_PER_FRAME
            && visits < VISITS_PER_FRAME
        {
            let (node, label) = (step.node, step.next);
            step.next += 1;
            if label == 4 {
                self.rebuild.path.pop();
                continue;
            }
            let child = self.nodes.get(node).body[label];
            visits += 1;
            // A child below the next place has been met through its other parent.
            if child == NONE || child < self.rebuild.place {
                continue;
            }
            let place = self.rebuild.place;
            if child != place {
                if let Some(spare) = self.nodes.pages.clear(place) {
                    self.relocate(place, spare);
                }
                self.relocate(child, place);
                moves += 1;
            }
            self.rebuild.place += 1;
            if self.nodes.is_split(place) && level_of(self.nodes.get(place).point) > 0 {
                self.rebuild.path.push(Step { node: place, next: 0 });
            }
        }
    }

    /// Cuts the path off where nodes on it have merged or gone since.
    fn forget_broken_path(&mut self) {
        let nodes = &self.nodes;
        let path = &mut self.rebuild.path;
        let stands = |pair: &[Step]| {
            nodes.is_split(pair[0].node) && nodes.get(pair[0].node).body[pair[0].next - 1] == pair[1].node
        };
        let mut length = 1 + path.windows(2).take_while(|pair| stands(pair)).count();
        if length > 1 && !nodes.is_split(path[length - 1].node) {
            length -= 1;
        }
        path.truncate(length);
    }

    /// Moves a node or an annex to a place that has been taken for it, gives back its own, and tells all that know it.
    fn relocate(&mut self, from: u32, to: u32) {
        let record = *self.nodes.get(from);
        *self.nodes.get_mut(to) = record;
        self.nodes.vacate(from);
        for side in 0..2 {
            self.nodes.pages.touch(from, side);
            self.nodes.pages.touch(to, side);
        }
        if !self.nodes.is_live(to) {
            self.nodes.get_mut(record.parents[0]).body[body::ANNEX] = to;
            return;
        }
        let level = level_of(record.point);
        for side in 0..2 {
            if record.parents[side] != NONE {
                let label = self.nodes.label(to, side);
                self.nodes.get_mut(record.parents[side]).body[label] = to;
            }
        }
        if self.nodes.is_split(to) {
            if level == 0 {
                self.nodes.get_mut(record.body[body::ANNEX]).parents[0] = to;
            } else {
                for (label, child) in record.body[..4].iter().enumerate().filter(|(_, child)| **child != NONE)
                {
                    self.nodes.get_mut(*child).parents[label >> 1] = to;
                }
            }
        }
        let word = record.word & !SPLIT;
        if expiry_of(word) != 0 {
            self.queue.enter(clock_of(word), Entry { node: to, word });
        } else if word & !STATUS == 0 {
            self.late.push(to);
        }
    }
}
