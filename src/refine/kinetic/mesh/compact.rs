//! Keeping the bin-tree array dense, a few nodes a frame.
//!
//! Splits take places and merges give them back, so that after a while, or when the mesh shrinks, clusters are part empty. Packed clusters: once a quarter of all
//! places is free, nodes of the last cluster move to the first places that are free, and empty clusters at the end are given up. Near clusters: the
//! few nodes of a cluster that is nearly empty move beside their parents. At most [`MOVES_PER_FRAME`] nodes move in a frame, so that no
//! frame is long. Moved triangles show in the patch like changed ones; vertices keep their slots, and slots that are free at the end are given up.

use super::clusters::{CLUSTER, Dealing};
use super::nodes::{CENTRE, SPLIT, STATUS, UNREAD};
use crate::refine::kinetic::Kinetic;
use crate::refine::kinetic::time::certificate::{ACTIVE, clock_of, expiry_of};
use crate::refine::kinetic::time::queue::Entry;
use terrasoar_layout::read::store::RecordStore;

/// Nodes moved in one frame at most.
const MOVES_PER_FRAME: usize = 32;
/// A near cluster with no more nodes is emptied.
const SPARSE: usize = CLUSTER / 4;

impl<S: RecordStore> Kinetic<S> {
    /// Moves a few nodes, if that is of use.
    pub(crate) fn compact(&mut self) {
        match self.nodes.clusters.dealing() {
            Dealing::Packed => self.empty_last_cluster(),
            Dealing::Near => self.empty_sparse_cluster(),
        }
        if self.nodes.clusters.give_up_empty_end() {
            self.nodes.shorten();
        }
        if let Some(slots) = self.vertices.give_up_free_end() {
            self.nodes.rings.truncate(slots);
        }
    }

    fn empty_last_cluster(&mut self) {
        let clusters = &self.nodes.clusters;
        // A few clusters are not worth it.
        if clusters.taken() + 8 * CLUSTER > clusters.places() - clusters.places() / 4 {
            return;
        }
        let last = clusters.len() - 1;
        for from in clusters.places_of(last).take(MOVES_PER_FRAME) {
            let to = self.nodes.clusters.take(CENTRE);
            self.relocate(from, to);
        }
    }

    fn empty_sparse_cluster(&mut self) {
        self.sparse = (self.sparse + 1) % self.nodes.clusters.len();
        if self.sparse == 0 || self.nodes.clusters.places_of(self.sparse).count() > SPARSE {
            return;
        }
        for from in self.nodes.clusters.places_of(self.sparse) {
            // A node lies beside a parent, an annex beside the node whose it is.
            let parent = if self.nodes.is_live(from) {
                let [first, second] = self.nodes.parents(from);
                if first.is_some() { first } else { second }
            } else {
                self.nodes.get(from).links[0]
            };
            let beside = self.nodes.node_of(parent.slot());
            if let Some(to) = self.nodes.clusters.take_in_cluster_of(beside, self.sparse) {
                self.relocate(from, to);
                for corners in self.nodes.triangles(to).into_iter().flatten() {
                    self.cover(to, &corners);
                }
            }
        }
    }

    /// Moves a node or an annex to a place that has been taken for it, gives back its own, and tells all that know it.
    fn relocate(&mut self, from: u32, to: u32) {
        let record = *self.nodes.get(from);
        *self.nodes.get_mut(to) = record;
        self.nodes.free(from);
        for side in 0..2 {
            self.nodes.clusters.touch(from, side);
            self.nodes.clusters.touch(to, side);
        }
        if !record.is_live() {
            self.nodes.rings.children_mut(record.slot())[0] = to;
            return;
        }
        // Children and annexes know the vertex slot, which stays.
        for parent in self.nodes.parents(to).into_iter().filter(|parent| parent.is_some()) {
            self.nodes.rings.children_mut(parent.slot())[parent.turn()] = to;
        }
        let word = record.word & !SPLIT;
        if word == UNREAD {
            self.unread.push(to);
        } else if expiry_of(word) != 0 {
            self.enter(clock_of(word), Entry { node: to, word });
        } else {
            self.late.push(to);
        }
        if record.word & STATUS == ACTIVE {
            self.to_split[self.place_of(to).1 as usize].push(to);
        }
    }
}
