//! Splitting and merging nodes: links, triangles and vertices kept in step.
//!
//! Invariant: after each call all of `super::nodes` and `super::triangles` holds. A split makes two triangles of each of a node's one or two,
//! a merge the reverse. Cost: four slots written, at most four nodes made or freed.

use super::nodes::{CENTRE, NONE, SPLIT, STATUS, child_point, first_child, level_of};
use super::triangles::{Corners, Owner};
use super::{Kinetic, is_hidden};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::record::RecordCodec;

/// One side of a node: its parent there, and the labels of the two children that side's triangle has.
#[derive(Clone, Copy)]
struct Side {
    parent: u32,
    /// Between parent and edge end p, counter-clockwise: child triangle (v; parent, p).
    first: usize,
    /// Between edge end q and parent: child triangle (v; q, parent).
    last: usize,
}

impl<C: RecordCodec> Kinetic<'_, C> {
    /// The sides of a node that have a triangle.
    fn sides(&self, node: u32, level: u32) -> [Option<Side>; 2] {
        let parents = self.nodes.parents[node as usize];
        [0, 1].map(|side| {
            (parents[side] != NONE).then(|| {
                let first = first_child(self.nodes.label(node, side), level);
                Side { parent: parents[side], first, last: (first + 3) & 3 }
            })
        })
    }

    /// The child of a split node that lies at `at`; `None` at the finest level, where there are none.
    pub(super) fn child_at(&self, node: u32, at: GridPoint) -> Option<u32> {
        let point = self.nodes.points[node as usize];
        let level = level_of(point);
        let label = (0..4).find(|label| level > 0 && child_point(point, level, *label) == at)?;
        Some(self.nodes.links[node as usize][label])
    }

    /// Makes the root with `label` at the centre: a triangle whose split vertex is the middle of a side of the square.
    pub(super) fn plant_root(&mut self, label: usize, corners: [u32; 3], blank: C::Raw) {
        let centre_at = self.nodes.points[CENTRE as usize];
        let node = self.nodes.create(child_point(centre_at, level_of(centre_at), label), blank);
        self.nodes.links[CENTRE as usize][label] = node;
        self.nodes.parents[node as usize][label >> 1] = CENTRE;
        self.fresh.push(node);
        let triangle = Corners { corners, hidden: self.hides(corners) };
        self.triangles.insert(
            0,
            triangle,
            Owner::new(node, label >> 1),
            &mut self.nodes.links,
            &self.vertices,
        );
    }

    fn hides(&self, corners: [u32; 3]) -> bool {
        is_hidden(&self.records, corners.map(|v| self.vertices.point(v)))
    }

    /// Splits a node. `false`, and nothing done, if a triangle on one of its sides is yet to come.
    pub(super) fn split(&mut self, node: u32) -> bool {
        if !self.nodes.is_complete(node, self.records.grid().side_steps()) {
            return false;
        }
        let at = node as usize;
        let point = self.nodes.points[at];
        let level = level_of(point);
        let sides = self.sides(node, level);
        let slots = self.nodes.links[at];
        let vertex = self.vertex_of(node);
        let here = self.vertices.place(point, vertex.height_m);
        self.nodes.words[at] |= SPLIT;
        self.nodes.links[at] = [NONE; 4];
        // Children and first halves for both sides, so that whatever moves when second halves come in has an owner that stands.
        let mut seconds = [None; 2];
        let mut ends = [here; 2];
        for (side, second) in
            sides.into_iter().zip(&mut seconds).enumerate().filter_map(|(i, (s, b))| Some(((i, s?), b)))
        {
            let (i, side) = side;
            let slot = slots[i];
            let [apex, p, q] = self.triangles.get(slot).corners;
            ends = [p, q];
            let first = self.owner_of_half(node, level, side, side.first);
            let last = self.owner_of_half(node, level, side, side.last);
            let corners = [here, apex, p];
            let triangle = Corners { corners, hidden: self.hides(corners) };
            self.triangles.set(slot, triangle, first, &mut self.nodes.links, &self.vertices);
            *second = Some((side.first, [here, q, apex], last));
        }
        for (beside, corners, owner) in seconds.into_iter().flatten() {
            // The first half's slot, wherever it is by now.
            let beside = self.half_slot(node, level, beside);
            let triangle = Corners { corners, hidden: self.hides(corners) };
            self.triangles.insert(beside, triangle, owner, &mut self.nodes.links, &self.vertices);
        }
        let patched = self.patch_vertex(point, &vertex, ends);
        self.patch.vertices.push((here, patched));
        self.work.splits += 1;
        true
    }

    /// Who is to own the half triangle of a split node in direction `label`: the child that splits it, made or found, or at the finest level the node.
    fn owner_of_half(&mut self, node: u32, level: u32, side: Side, label: usize) -> Owner {
        if level == 0 {
            return Owner::new(node, label);
        }
        // The neighbour around the parent that shares the child.
        let own = self.nodes.label(node, usize::from(self.nodes.parents[node as usize][1] == side.parent));
        let turn = if label == side.first { 3 } else { 1 };
        let neighbour = self.nodes.links[side.parent as usize][(own + turn) & 3];
        let shared = if neighbour != NONE && self.nodes.is_split(neighbour) {
            self.nodes.links[neighbour as usize][(label + 2) & 3]
        } else {
            NONE
        };
        let child = if shared == NONE {
            let point = child_point(self.nodes.points[node as usize], level, label);
            let blank = self.nodes.raws[node as usize];
            let child = self.nodes.create(point, blank);
            self.fresh.push(child);
            child
        } else {
            shared
        };
        self.nodes.links[node as usize][label] = child;
        self.nodes.parents[child as usize][label >> 1] = node;
        Owner::new(child, label >> 1)
    }

    /// The slot of a split node's half triangle in direction `label`, which is not split itself.
    fn half_slot(&self, node: u32, level: u32, label: usize) -> u32 {
        let link = self.nodes.links[node as usize][label];
        if level == 0 { link } else { self.nodes.links[link as usize][label >> 1] }
    }

    /// Merges a split node. Children that are still split are merged before it.
    pub(super) fn merge(&mut self, node: u32) {
        let at = node as usize;
        let level = level_of(self.nodes.points[at]);
        let sides = self.sides(node, level);
        if level > 0 {
            for child in self.nodes.links[at] {
                if child != NONE && self.nodes.is_split(child) {
                    // Only if it is late: in time it has merged already.
                    self.merge(child);
                    if self.nodes.words[child as usize] & STATUS != 0 {
                        self.nodes.words[child as usize] &= STATUS;
                        self.late.push(child);
                    }
                }
            }
        }
        let mut here = NONE;
        let mut whole = [[NONE; 3]; 2];
        for (side, whole) in sides.into_iter().zip(&mut whole) {
            let Some(side) = side else { continue };
            let [v, apex, p] = self.triangles.get(self.half_slot(node, level, side.first)).corners;
            let second = self.half_slot(node, level, side.last);
            let [_, q, _] = self.triangles.get(second).corners;
            here = v;
            *whole = [apex, p, q];
            self.triangles.remove(second, &mut self.nodes.links, &self.vertices);
        }
        let children = self.nodes.links[at];
        let firsts = sides.map(|side| side.map(|side| self.half_slot(node, level, side.first)));
        self.nodes.words[at] &= !SPLIT;
        self.nodes.links[at] = [NONE; 4];
        for (i, (slot, corners)) in firsts.into_iter().zip(whole).enumerate() {
            let Some(slot) = slot else { continue };
            let triangle = Corners { corners, hidden: self.hides(corners) };
            self.triangles.set(slot, triangle, Owner::new(node, i), &mut self.nodes.links, &self.vertices);
        }
        if level > 0 {
            for (label, child) in children.into_iter().enumerate() {
                if child != NONE {
                    self.desert(child, label >> 1);
                }
            }
        }
        self.vertices.remove(here);
        self.work.merges += 1;
    }

    /// Takes a leaf's parent on `side` from it; frees it if that was the last.
    fn desert(&mut self, node: u32, side: usize) {
        let at = node as usize;
        self.nodes.parents[at][side] = NONE;
        self.nodes.links[at][side] = NONE;
        if self.nodes.parents[at] == [NONE; 2] {
            self.nodes.free(node);
        }
    }

    /// Moves a node to a free place in the array, and tells all that know it.
    pub(super) fn relocate(&mut self, from: u32, to: u32) {
        self.nodes.move_record(from, to);
        let at = to as usize;
        let level = level_of(self.nodes.points[at]);
        for side in 0..2 {
            let parent = self.nodes.parents[at][side];
            if parent != NONE {
                let label = self.nodes.label(to, side);
                self.nodes.links[parent as usize][label] = to;
            }
        }
        let links = self.nodes.links[at];
        let split = self.nodes.is_split(to);
        for (place, link) in links.into_iter().enumerate().filter(|(_, link)| *link != NONE) {
            if split && level > 0 {
                self.nodes.parents[link as usize][place >> 1] = to;
            } else if split || place < 2 {
                self.triangles.set_owner(link, Owner::new(to, place));
            }
        }
        let word = self.nodes.words[at] & !SPLIT;
        if to != CENTRE && super::expiry_of(word) != 0 {
            self.queue.enter(super::clock_of(word), super::Entry { node: to, word });
        }
    }
}
