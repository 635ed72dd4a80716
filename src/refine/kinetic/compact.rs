//! Keeping the bin-tree array dense, a few nodes a frame.
//!
//! Splits take places and merges give them back, so that after a while, or when the mesh shrinks, pages are part empty. Packed pages: once a quarter of all
//! places is free, nodes of the last page move to the first places that are free, and empty pages at the end are given up. Near pages: the
//! few nodes of a page that is nearly empty move beside their parents. At most [`MOVES_PER_FRAME`] nodes move in a frame, so that no
//! frame is long. Moved triangles show in the patch like changed ones; vertices keep their slots.

use super::Kinetic;
use super::certificate::{ACTIVE, clock_of, expiry_of};
use super::labels::level_of;
use super::nodes::{CENTRE, NONE, SPLIT, STATUS, UNREAD, body};
use super::pages::{Dealing, PAGE};
use super::queue::Entry;
use terrasoar_layout::read::store::RecordStore;

/// Nodes moved in one frame at most.
const MOVES_PER_FRAME: usize = 32;
/// A near page with no more nodes is emptied.
const SPARSE: usize = PAGE / 4;

impl<S: RecordStore> Kinetic<S> {
    /// Moves a few nodes, if that is of use.
    pub(super) fn compact(&mut self) {
        match self.nodes.pages.dealing() {
            Dealing::Packed => self.empty_last_page(),
            Dealing::Near => self.empty_sparse_page(),
        }
        if self.nodes.pages.give_up_empty_end() {
            self.nodes.shorten();
        }
    }

    fn empty_last_page(&mut self) {
        let pages = &self.nodes.pages;
        // A few pages are not worth it.
        if pages.taken() + 8 * PAGE > pages.places() - pages.places() / 4 {
            return;
        }
        let last = pages.len() - 1;
        for from in pages.places_of(last).take(MOVES_PER_FRAME) {
            let to = self.nodes.pages.take(CENTRE);
            self.relocate(from, to);
        }
    }

    fn empty_sparse_page(&mut self) {
        self.sparse = (self.sparse + 1) % self.nodes.pages.len();
        if self.sparse == 0 || self.nodes.pages.places_of(self.sparse).count() > SPARSE {
            return;
        }
        for from in self.nodes.pages.places_of(self.sparse) {
            let [first, second] = self.nodes.get(from).parents;
            let beside = if first != NONE { first } else { second };
            if let Some(to) = self.nodes.pages.take_in_page_of(beside, self.sparse) {
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
        if word == UNREAD {
            self.unread.push(to);
        } else if expiry_of(word) != 0 {
            self.enter(clock_of(word), Entry { node: to, word });
        } else {
            self.late.push(to);
        }
        if record.word & STATUS == ACTIVE {
            self.to_split[level as usize].push(to);
        }
    }
}
