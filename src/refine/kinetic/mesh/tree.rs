//! Splitting and merging nodes: relatives, triangles and vertices kept in step.
//!
//! Invariant: after each call all of `super::nodes` holds, and the slots that show something else have been noted. A split makes two triangles of
//! each of a node's one or two, a merge the reverse. Cost: six slots, at most four nodes made or freed. Most of the time is the wait for memory, which
//! [`Fetch`] shortens by prefetching a node's relatives some splits ahead.

use super::labels::{child_point, level_of};
use super::nodes::{CENTRE, NONE, SPLIT, STATUS, Side, body, half};
use crate::refine::kinetic::Kinetic;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::read::prefetch::prefetch;
use terrasoar_layout::read::store::RecordStore;

/// What is asked of memory ahead of a split or merge. Each needs what the one before has brought.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Fetch {
    Node,
    Near,
    Far,
}

impl<S: RecordStore> Kinetic<S> {
    /// The child of a split node that lies at `at`; `None` at the finest level, where there are none.
    pub(crate) fn child_at(&self, node: u32, at: GridPoint) -> Option<u32> {
        let node = self.nodes.get(node);
        let level = level_of(node.point);
        (0..4)
            .find(|label| level > 0 && child_point(node.point, level, *label) == at)
            .map(|label| node.body[label])
    }

    /// Makes the root with `label` at the centre: the triangle (centre; p, q), whose split vertex is the middle of a side of the square.
    pub(crate) fn plant_root(&mut self, label: usize, [apex, p, q]: [u32; 3]) {
        let centre = *self.nodes.get(CENTRE);
        let point = child_point(centre.point, level_of(centre.point), label);
        let node = self.nodes.create(CENTRE, point, slot_of(self.records.grid().k(), point), centre.raw);
        self.nodes.get_mut(CENTRE).body[label] = node;
        self.adopt(node, CENTRE, label, [apex, p, q]);
        self.cover(node, &[apex, p, q]);
        self.fresh.push(node);
    }

    /// Gives a leaf the triangle (apex; p, q) on the side of its parent, at which it has `label`.
    #[inline(always)]
    fn adopt(&mut self, node: u32, parent: u32, label: usize, [apex, p, q]: [u32; 3]) {
        let side = label >> 1;
        let child = self.nodes.get_mut(node);
        child.parents[side] = parent;
        let [p, q] = if side == 0 { [p, q] } else { [q, p] };
        child.body[body::P] = p;
        child.body[body::Q] = q;
        child.body[body::APEX + side] = apex;
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

    /// Asks memory for what splitting a node will look at, in order: itself; its parents; its neighbours.
    #[inline(always)]
    pub(crate) fn fetch_for_split(&self, node: u32, what: Fetch) {
        match what {
            Fetch::Node => self.fetch(node),
            Fetch::Near => self.parents(node).for_each(|parent| self.fetch(parent)),
            // The neighbours around each parent, which its body names.
            Fetch::Far => self.parents(node).for_each(|parent| self.fetch_children(parent)),
        }
    }

    /// Asks memory for what merging a node will look at: itself; then its children.
    #[inline(always)]
    pub(crate) fn fetch_for_merge(&self, node: u32, what: Fetch) {
        match what {
            Fetch::Node => self.fetch(node),
            Fetch::Near => self.fetch_children(node),
            Fetch::Far => {}
        }
    }

    /// A record may begin in one cache line and end in the next.
    #[inline(always)]
    fn fetch(&self, node: u32) {
        [0, 1].iter().for_each(|i| prefetch(&self.nodes.all, node as usize + i));
    }

    #[inline(always)]
    fn fetch_children(&self, node: u32) {
        let node = self.nodes.all.get(node as usize);
        node.into_iter().flat_map(|node| &node.body[..4]).for_each(|child| self.fetch(*child));
    }

    /// The parents of a node, whose place may have been given up since.
    #[inline(always)]
    fn parents(&self, node: u32) -> impl Iterator<Item = u32> + use<S> {
        let parents = self.nodes.all.get(node as usize).map_or([NONE; 2], |node| node.parents);
        parents.into_iter().filter(|parent| *parent != NONE)
    }

    /// Splits a node. `false`, and nothing done, if a triangle on one of its sides is yet to come.
    pub(crate) fn split(&mut self, node: u32) -> bool {
        if !self.nodes.is_complete(node, self.records.grid().side_steps()) {
            return false;
        }
        let leaf = *self.nodes.get(node);
        let level = level_of(leaf.point);
        let sides = self.nodes.sides(node, level);
        let vertex = self.records.decode(leaf.raw, level);
        let here = self.vertices.place(leaf.point, &vertex);
        {
            let split = self.nodes.get_mut(node);
            split.word |= SPLIT;
            split.body[body::HERE] = here;
            if level > 0 {
                split.body[..4].fill(NONE);
            }
        }
        for (i, side) in sides.into_iter().enumerate() {
            let Some(side) = side else { continue };
            let [_, apex, p, q] = half(&leaf, i);
            self.nodes.clusters.touch(node, i);
            self.triangles += 1;
            if level == 0 {
                self.cover(node, &[here, apex, p, q]);
                continue;
            }
            self.halve(node, &leaf.point, level, side, side.first, [here, apex, p]);
            self.halve(node, &leaf.point, level, side, side.last, [here, q, apex]);
        }
        if level == 0 {
            let annex = self.nodes.create_annex(node);
            self.nodes.get_mut(node).body[body::ANNEX] = annex;
            self.nodes.clusters.touch(annex, 0);
            self.nodes.clusters.touch(annex, 1);
            let corners = [here, leaf.body[body::P], leaf.body[body::Q]];
            self.cover(annex, &corners);
            for apex in [0, 1].into_iter().filter(|i| leaf.parents[*i] != NONE) {
                self.cover(annex, &[leaf.body[body::APEX + apex]]);
            }
        }
        let patched = self.patch_vertex(leaf.point, &vertex, [leaf.body[body::P], leaf.body[body::Q]]);
        self.patch.vertices.push((here, patched));
        self.work.splits += 1;
        true
    }

    /// Gives the half triangle of a node in direction `label` to the child that splits it, made or found.
    #[inline(always)]
    fn halve(
        &mut self,
        node: u32,
        point: &GridPoint,
        level: u32,
        side: Side,
        label: usize,
        corners: [u32; 3],
    ) {
        // The neighbour around the parent that shares the child.
        let turn = if label == side.first { 3 } else { 1 };
        let neighbour = self.nodes.get(side.parent).body[(side.label + turn) & 3];
        let shared = if neighbour != NONE && self.nodes.is_split(neighbour) {
            self.nodes.get(neighbour).body[(label + 2) & 3]
        } else {
            NONE
        };
        let child = if shared == NONE {
            let at = child_point(*point, level, label);
            let slot = slot_of(self.records.grid().k(), at);
            self.records.prefetch(slot);
            let child = self.nodes.create(node, at, slot, self.nodes.get(node).raw);
            self.fresh.push(child);
            child
        } else {
            shared
        };
        self.nodes.get_mut(node).body[label] = child;
        self.adopt(child, node, label, corners);
        self.cover(child, &corners);
    }

    /// Merges a split node. Children that are still split are merged before it.
    pub(crate) fn merge(&mut self, node: u32) {
        let split = *self.nodes.get(node);
        let level = level_of(split.point);
        let sides = self.nodes.sides(node, level);
        self.nodes.get_mut(node).word &= !SPLIT;
        if level == 0 {
            let annex = split.body[body::ANNEX];
            self.nodes.clusters.touch(annex, 0);
            self.nodes.clusters.touch(annex, 1);
            self.nodes.get_mut(annex).parents = [NONE; 2];
            self.nodes.free(annex);
        } else {
            self.merge_children(&split.body[..4]);
            let mut leaf = [NONE; 6];
            for (i, side) in sides.into_iter().enumerate() {
                let Some(side) = side else { continue };
                // From the first half (v; parent, p) and the last one (v; q, parent).
                let child = |label: usize| half(self.nodes.get(split.body[label]), label >> 1);
                let ([_, _, apex, p], [_, _, q, _]) = (child(side.first), child(side.last));
                leaf[body::APEX + i] = apex;
                [leaf[body::P], leaf[body::Q]] = if i == 0 { [p, q] } else { [q, p] };
            }
            self.nodes.get_mut(node).body = leaf;
            for (label, child) in split.body[..4].iter().enumerate() {
                if *child != NONE {
                    self.desert(*child, label >> 1);
                }
            }
        }
        for i in 0..2 {
            if split.parents[i] != NONE {
                self.nodes.clusters.touch(node, i);
                self.triangles -= 1;
                let [_, apex, p, q] = half(self.nodes.get(node), i);
                self.cover(node, &[apex, p, q]);
            }
        }
        self.vertices.remove(split.body[body::HERE]);
        self.work.merges += 1;
    }

    /// Merges those children of a node that are late: in time they have merged before it.
    fn merge_children(&mut self, children: &[u32]) {
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
        leaf.parents[side] = NONE;
        if leaf.parents == [NONE; 2] {
            self.nodes.free(node);
        }
    }
}
