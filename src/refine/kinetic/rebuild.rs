//! Rebuilding the bin-tree array in depth-first order, a few nodes a frame.
//!
//! Splits put nodes wherever there is room. When there is none left below the array's end and it has grown by half since the last time, it is rebuilt: a depth-first
//! walk moves each node it meets to the next place from the front, and whoever lies there out of the way. The walk pauses after
//! [`MOVES_PER_FRAME`] moves and goes on in the next frame from where its path still stands, so that no frame is long; nodes that came or
//! went behind it keep the places they have. The queue, the triangles and the GPU do not notice.

use super::Kinetic;
use super::nodes::{CENTRE, NONE, level_of};
use terrasoar_layout::record::RecordCodec;

/// Nodes moved in one frame at most.
const MOVES_PER_FRAME: usize = 64;
/// Nodes looked at in one frame at most.
const VISITS_PER_FRAME: usize = 512;
/// Smaller arrays are left as they are: they lie in the cache.
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
            let length = self.nodes.len();
            if !self.nodes.is_full() || length < LEAST.max(self.rebuild.length + self.rebuild.length / 2) {
                return;
            }
            self.rebuild.length = length;
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
            let child = self.nodes.links[node as usize][label];
            visits += 1;
            // A child below the next place has been met through its other parent.
            if child == NONE || child < self.rebuild.place {
                continue;
            }
            let place = self.rebuild.place;
            if child != place {
                self.clear_place(place);
                self.relocate(child, place);
                moves += 1;
            }
            self.rebuild.place += 1;
            if self.nodes.is_split(place) && level_of(self.nodes.points[place as usize]) > 0 {
                self.rebuild.path.push(Step { node: place, next: 0 });
            }
        }
    }

    /// Moves away whoever lies at `place`.
    fn clear_place(&mut self, place: u32) {
        if self.nodes.is_live(place) {
            let spare = self.nodes.spare(self.nodes.raws[CENTRE as usize]);
            self.relocate(place, spare);
        }
    }

    /// Cuts the path off where nodes on it have merged or gone since.
    fn forget_broken_path(&mut self) {
        let path = &mut self.rebuild.path;
        let stands = |pair: &[Step]| {
            let label = pair[0].next - 1;
            self.nodes.is_split(pair[0].node)
                && self.nodes.links[pair[0].node as usize][label] == pair[1].node
        };
        let mut length = 1 + path.windows(2).take_while(|pair| stands(pair)).count();
        if length > 1 && !self.nodes.is_split(path[length - 1].node) {
            length -= 1;
        }
        path.truncate(length);
    }
}
