//! Splitting and merging nodes: relatives, triangles and vertices kept in step.
//!
//! Invariant: after each call all of `super::nodes` and `super::rings` holds, and the slots that show something else have been noted. A split makes two triangles of
//! each of a node's one or two, a merge the reverse. Cost: six slots, at most four nodes made or freed. Most of the time is the wait for memory, which
//! [`Fetch`] shortens by prefetching a node's relatives some splits ahead.

use super::labels::{child_point, first_child, is_on_border, level_of, orientation};
use super::nodes::{CENTRE, Node, SPLIT, STATUS};
use super::rings::{Corner, NONE, Ring, TURNS, label_of, sharer_of};
use crate::refine::kinetic::Kinetic;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::prefetch::prefetch;
use terrasoar_layout::read::store::{RawOf, RecordStore};

/// What is asked of memory ahead of a split or merge. Each needs what the one before has brought.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fetch {
    Node,
    Near,
    Far,
}

/// A node that is being split, or a vertex that is being merged.
#[derive(Debug, Clone, Copy)]
struct Place {
    node: u32,
    /// Its vertex slot.
    here: u32,
    point: GridPoint,
    level: u32,
}

impl<S: RecordStore> Kinetic<S> {
    /// The point and the level of a node.
    #[inline(always)]
    pub(crate) fn place_of(&self, node: u32) -> (GridPoint, u32) {
        self.nodes.get(node).place(&self.vertices)
    }

    /// The point of a node.
    #[inline(always)]
    pub(crate) fn point_of(&self, node: u32) -> GridPoint {
        self.place_of(node).0
    }

    /// The child of a split node that lies at `at`; `None` at the finest level, where there are none.
    pub(crate) fn child_at(&self, node: u32, at: GridPoint) -> Option<u32> {
        let slot = self.nodes.get(node).slot();
        let point = self.vertices.point(slot);
        let (level, turned) = (level_of(point), orientation(point));
        (0..4)
            .find(|turn| level > 0 && child_point(point, level, label_of(*turn, turned, level)) == at)
            .map(|turn| self.nodes.rings.child(slot, turn))
    }

    /// Places a vertex, and its ring.
    #[inline(always)]
    pub(crate) fn place_vertex(&mut self, at: GridPoint, vertex: &Vertex, ring: Ring) -> u32 {
        let slot = self.vertices.place(at, vertex);
        self.nodes.rings.set(slot, ring);
        slot
    }

    /// Makes the root with `label` at the centre: the triangle (centre; p, q), whose split vertex is the middle of a side of the square.
    pub(crate) fn plant_root(&mut self, label: usize, [p, q]: [u32; 2]) {
        let centre = *self.nodes.get(CENTRE);
        let (here, turn) = (centre.slot(), self.root_turn(label));
        let node = self.nodes.create(CENTRE, centre.raw);
        let mut ring = self.nodes.rings.get(here);
        ring.children[turn] = node;
        ring.corners[turn] = Corner::of(p);
        ring.corners[(turn + 1) & 3] = Corner::of(q);
        self.nodes.rings.set(here, ring);
        self.adopt(node, label >> 1, Corner::parent(here, turn, label));
        self.cover(node, &[here, p, q]);
        self.fresh.push(node);
    }

    /// The root with `label` at the centre.
    pub(crate) fn root(&self, label: usize) -> u32 {
        self.nodes.rings.child(self.nodes.get(CENTRE).slot(), self.root_turn(label))
    }

    fn root_turn(&self, label: usize) -> usize {
        let (centre, level) = self.place_of(CENTRE);
        (label + 4 - first_child(orientation(centre), level)) & 3
    }

    /// Gives a leaf its parent on a side, and with it a triangle.
    #[inline(always)]
    fn adopt(&mut self, node: u32, side: usize, parent: Corner) {
        self.nodes.get_mut(node).links[side] = parent;
        self.nodes.clusters.touch(node, side);
    }

    /// Widens the bounds of a node's cluster to contain vertices.
    #[inline(always)]
    pub(crate) fn cover<const N: usize>(&mut self, node: u32, vertices: &[u32; N]) {
        if self.nodes.clusters.has_bounds() {
            let shown = self.shows();
            let places = vertices.map(|v| shown.place_of(v));
            self.nodes.clusters.cover(node, &places);
        }
    }

    /// Makes the bounds of a cluster anew, which merges and edits leave too large.
    pub(crate) fn tighten(&mut self, cluster: usize) {
        let bounds = self.shows().bounds(cluster);
        self.nodes.clusters.set_bounds(cluster, bounds);
    }

    /// Asks memory for what splitting a node will look at, in order: itself; its parents; the neighbours around each of them.
    #[inline(always)]
    pub(crate) fn fetch_for_split(&self, node: u32, what: Fetch) {
        match what {
            Fetch::Node => prefetch(&self.nodes.all, node as usize),
            Fetch::Near => self.leaf_parents(node).for_each(|parent| {
                self.nodes.rings.fetch(parent);
                self.vertices.fetch(parent.slot());
            }),
            Fetch::Far => self.neighbours(node).for_each(|node| prefetch(&self.nodes.all, node as usize)),
        }
    }

    /// Asks memory for what merging a node will look at: itself; its vertex; then its children.
    #[inline(always)]
    pub(crate) fn fetch_for_merge(&self, node: u32, what: Fetch) {
        let slot = || self.nodes.all.get(node as usize).map_or(NONE, |node| node.links[0].slot());
        match what {
            Fetch::Node => prefetch(&self.nodes.all, node as usize),
            Fetch::Near => {
                self.nodes.rings.fetch(Corner::of(slot()));
                self.vertices.fetch(slot());
            }
            Fetch::Far => {
                let children = self.nodes.rings.children(slot());
                children.iter().for_each(|child| prefetch(&self.nodes.all, *child as usize));
            }
        }
    }

    /// The parents of a leaf, whose place may have been given up since.
    #[inline(always)]
    fn leaf_parents(&self, node: u32) -> impl Iterator<Item = Corner> + use<S> {
        let links = self.nodes.all.get(node as usize).map_or([Corner::NONE; 2], |node| node.links);
        links.into_iter().filter(|parent| parent.is_some())
    }

    /// The nodes beside a leaf around its parents, if the leaf still is one.
    #[inline(always)]
    fn neighbours(&self, node: u32) -> impl Iterator<Item = u32> {
        self.leaf_parents(node).flat_map(|parent| {
            let children = self.nodes.rings.children(parent.slot());
            [1, 3].map(|step| children[(parent.turn() + step) & 3])
        })
    }

    /// Splits a node. `false`, and nothing done, if a triangle on one of its sides is yet to come, or slots or places are all taken.
    pub(crate) fn split(&mut self, node: u32) -> bool {
        let Node { raw, links, .. } = *self.nodes.get(node);
        let (point, level) = self.place_of(node);
        let is_whole = links[0].is_some() & links[1].is_some();
        let is_ready = is_whole || is_on_border(point, self.records.grid().side_steps());
        if !is_ready || !self.vertices.have_room(1) || !self.nodes.have_room() {
            return false;
        }
        let vertex = self.records.decode(raw, level);
        let ends = self.nodes.rings.edge_of(links);
        let here = self.place_vertex(point, &vertex, Ring::new(links, ends));
        self.nodes.get_mut(node).become_split(here, level);
        let place = Place { node, here, point, level };
        for (side, parent) in links.into_iter().enumerate().filter(|(_, parent)| parent.is_some()) {
            self.nodes.clusters.touch(node, side);
            self.triangles += 1;
            if level == 0 {
                let [p, q] = self.nodes.rings.edge(here, 2 * side);
                self.cover(node, &[here, p, q]);
                continue;
            }
            self.halve(&place, raw, side, parent, false);
            self.halve(&place, raw, side, parent, true);
        }
        if level == 0 {
            let annex = self.nodes.create_annex(node, here);
            self.nodes.rings.children_mut(here)[0] = annex;
            self.nodes.clusters.touch(annex, 0);
            self.nodes.clusters.touch(annex, 1);
            for corners in self.nodes.triangles(annex).into_iter().flatten() {
                self.cover(annex, &corners);
            }
        }
        let patched = self.patch_vertex(point, &vertex, ends);
        self.patch.vertices.push((here, patched));
        self.work.splits += 1;
        true
    }

    /// Gives the first or the last half of a triangle to the child that splits it, made or found. `parent` is the apex of the triangle, which lies on `side` of the node; `raw` stands in for
    /// the child's record.
    #[inline(always)]
    fn halve(&mut self, place: &Place, raw: RawOf<S>, side: usize, parent: Corner, last: bool) {
        let Place { node, here, point, level } = *place;
        let turned = orientation(point);
        let turn = TURNS[side][usize::from(last)];
        let (step, turn_there) = sharer_of(side, turned, last);
        // The neighbour around the parent that shares the child.
        let neighbour = self.nodes.rings.child(parent.slot(), parent.turn() + step);
        let shared = if neighbour != NONE && self.nodes.is_split(neighbour) {
            self.nodes.rings.child(self.nodes.get(neighbour).slot(), turn_there)
        } else {
            NONE
        };
        let label = label_of(turn, turned, level);
        let child = if shared == NONE {
            let at = child_point(point, level, label);
            self.records.prefetch(slot_of(self.records.grid().k(), at));
            let child = self.nodes.create(node, raw);
            self.fresh.push(child);
            child
        } else {
            shared
        };
        self.nodes.rings.children_mut(here)[turn] = child;
        let [p, q] = self.nodes.rings.edge(here, turn);
        self.adopt(child, label >> 1, Corner::parent(here, turn, label));
        self.cover(child, &[here, p, q]);
    }

    /// Merges a split node. Children that are still split are merged before it.
    pub(crate) fn merge(&mut self, node: u32) {
        let here = self.nodes.get(node).slot();
        let ring = self.nodes.rings.get(here);
        let point = self.vertices.point(here);
        let level = level_of(point);
        if level == 0 {
            let annex = ring.annex();
            self.nodes.clusters.touch(annex, 0);
            self.nodes.clusters.touch(annex, 1);
            self.nodes.free(annex);
        } else {
            self.merge_children(&ring.children);
            let turned = orientation(point);
            for (turn, child) in ring.children.into_iter().enumerate().filter(|(_, child)| *child != NONE) {
                self.desert(child, label_of(turn, turned, level) >> 1);
            }
        }
        let merged = self.nodes.get_mut(node);
        merged.word &= !SPLIT;
        merged.links = ring.parents();
        for side in (0..2).filter(|side| ring.parents()[*side].is_some()) {
            self.nodes.clusters.touch(node, side);
            self.triangles -= 1;
            if self.nodes.clusters.has_bounds()
                && let Some(corners) = self.nodes.triangle(node, side)
            {
                self.cover(node, &corners);
            }
        }
        self.vertices.remove(here);
        self.work.merges += 1;
    }

    /// Merges those children of a node that are late: in time they have merged before it.
    fn merge_children(&mut self, children: &[u32; 4]) {
        for child in children.iter().copied().filter(|child| *child != NONE) {
            if self.nodes.is_split(child) {
                self.merge(child);
                let word = &mut self.nodes.get_mut(child).word;
                *word &= STATUS;
                self.late.push(child);
            }
        }
    }

    /// Takes a leaf's parent on `side` from it; frees it if that was the last.
    #[inline(always)]
    fn desert(&mut self, node: u32, side: usize) {
        self.nodes.clusters.touch(node, side);
        let leaf = self.nodes.get_mut(node);
        leaf.links[side] = Corner::NONE;
        if leaf.links == [Corner::NONE; 2] {
            self.nodes.free(node);
        }
    }
}
