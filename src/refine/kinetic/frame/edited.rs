//! The ground was edited: nodes get the records that changed, and are tested again.
//!
//! One walk goes down the refinement graph, level by level, only to vertices that an edit can concern ([`Areas`]), and to each of them once. It compares each node's record with the present
//! one, and asks memory for what comes some nodes later. A node whose record has changed keeps its place. Its word is due in the next update, which tests it as any other. If its vertex is in the mesh it is sent anew, once
//! however many edits come between two frames. Errors and radii are saturated as before. So the mesh has no cracks, and without a budget it is SOAR's over the edited ground in the same frame.
//! Earlier looks ahead below a leaf saw records that may have changed, so they are made again.
//!
//! Invariant: after the walk every node that has a record has the present one. Cost: the nodes met, which are those whose record changed, their ancestors and a few around each
//! area. Nothing is allocated once the lists have grown.

use crate::refine::change::{Areas, GroundChange};
use crate::refine::kinetic::mesh::labels::{child_point, level_of, orientation};
use crate::refine::kinetic::mesh::nodes::{CENTRE, STATUS};
use crate::refine::kinetic::mesh::rings::{NONE, TURNS, label_of};
use crate::refine::kinetic::time::certificate::{clock_of, expiry_of};
use crate::refine::kinetic::{Kinetic, root_label};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, corners, slot_of};
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::prefetch::prefetch;
use terrasoar_layout::read::store::{RawOf, RecordStore, byte_in_page};

/// Lists below this length are left as they are.
const SHORT: usize = 4096;

/// How many nodes ahead memory is asked for a node, and for its record.
const AHEAD: [usize; 2] = [12, 6];

/// A node on the way down.
#[derive(Debug, Clone, Copy)]
struct Visit {
    point: GridPoint,
    node: u32,
    /// The side of the parent that led here.
    side: u32,
}

/// What edits have done since the last update, and where.
#[derive(Debug, Default)]
pub(crate) struct Edits {
    areas: Areas,
    /// Nodes that the walk has come to, empty after it.
    visits: Vec<Visit>,
    /// Calls since the last update.
    calls: u32,
    /// Vertex slots, and the nodes that split there ([`NONE`] for corners of the square).
    moved: Vec<(u32, u32)>,
    /// Leaves that may have a corner that moved, if clusters have bounds.
    leaves: Vec<u32>,
    /// Leaves to look ahead from again.
    looks: Vec<u32>,
    /// Clusters whose bounds edits may have left too large.
    pub loose: usize,
}

impl Edits {
    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.areas.bytes()
            + self.moved.capacity() * size_of::<(u32, u32)>()
            + self.visits.capacity() * size_of::<Visit>()
            + (self.leaves.capacity() + self.looks.capacity()) * size_of::<u32>()
    }

    /// Leaves each entry of the lists once. Sorted by vertex or node, so that patches are the same whatever the order of the walk.
    fn unite(&mut self) {
        self.moved.sort_unstable();
        self.moved.dedup();
        for list in [&mut self.leaves, &mut self.looks] {
            list.sort_unstable();
            list.dedup();
        }
    }

    /// Gives back what exceeds a mesh of so many nodes.
    pub(crate) fn settle(&mut self, nodes: usize) {
        let most = nodes.max(SHORT);
        if self.visits.capacity() > 2 * most {
            self.visits.shrink_to(most);
        }
        if self.moved.capacity() > 2 * most {
            self.moved.shrink_to(most);
        }
        for list in [&mut self.leaves, &mut self.looks] {
            if list.capacity() > 2 * most {
                list.shrink_to(most);
            }
        }
    }
}

impl<S: RecordStore> Kinetic<S> {
    /// Takes over what changed of the ground, between two frames. Pages of the store are replaced before, as far as it holds them.
    pub(in crate::refine) fn take_edit(&mut self, change: &GroundChange<'_>) {
        let [low, high] = change.height_range_m;
        self.clocks.raise_tallest(low.abs().max(high.abs()));
        if self.nodes.is_empty() || change.areas.is_empty() {
            return;
        }
        let mut edits = std::mem::take(&mut self.edits);
        edits.calls += 1;
        self.renew_top(&mut edits, change);
        edits.areas.start(self.records.grid(), change);
        self.walk(&mut edits, change);
        if self.nodes.clusters.has_bounds() {
            edits.loose = self.nodes.clusters.len();
        }
        // Frames may be far between.
        if edits.moved.len().max(edits.leaves.len()).max(edits.looks.len()) > 2 * self.nodes.clusters.taken()
        {
            edits.unite();
        }
        self.edits = edits;
    }

    /// The record at `slot` that there is now. One that is neither in the store nor in a page with changes is what it was.
    #[inline(always)]
    fn record_now(&self, change: &GroundChange<'_>, slot: u64) -> Option<RawOf<S>> {
        let raw = self.records.get(slot);
        if S::IS_COMPLETE || raw.is_some() {
            return raw;
        }
        let page = (change.page)(S::page_of(slot))?;
        let at = byte_in_page::<S::Codec>(slot);
        Some(S::Codec::read(&page[at..]))
    }

    /// Renews the square's corners and centre, which are never tested.
    fn renew_top(&mut self, edits: &mut Edits, change: &GroundChange<'_>) {
        for slot in 0..4u32 {
            let Some(raw) = self.record_now(change, slot.into()) else { continue };
            let vertex = self.records.decode(raw, 0);
            if vertex != self.corners[slot as usize] {
                self.corners[slot as usize] = vertex;
                self.vertices.set_height(slot, vertex.height_m);
                edits.moved.push((slot, NONE));
            }
        }
        if let Some(raw) = self.record_now(change, CENTRE_SLOT)
            && raw != self.nodes.get(CENTRE).raw
        {
            self.nodes.get_mut(CENTRE).raw = raw;
            let slot = self.nodes.get(CENTRE).slot();
            self.vertices.set_height(slot, self.vertex_of(CENTRE).height_m);
            edits.moved.push((slot, CENTRE));
        }
    }

    /// Looks at all nodes that areas can concern, coarser ones before finer ones. Of a node's parents the first one that it has leads to it.
    fn walk(&mut self, edits: &mut Edits, change: &GroundChange<'_>) {
        let mut visits = std::mem::take(&mut edits.visits);
        let centre = self.point_of(CENTRE);
        for (side, _) in ROOTS {
            let label = root_label(side);
            let point = child_point(centre, level_of(centre), label);
            visits.push(Visit { point, node: self.root(label), side: (label >> 1) as u32 });
        }
        let k = self.records.grid().k();
        let mut next = 0;
        while let Some(visit) = visits.get(next).copied() {
            if let Some(later) = visits.get(next + AHEAD[0]) {
                prefetch(&self.nodes.all, later.node as usize);
            }
            if let Some(later) = visits.get(next + AHEAD[1]) {
                self.records.prefetch(slot_of(k, later.point));
                if let Some(node) = self.nodes.all.get(later.node as usize) {
                    self.nodes.rings.fetch(node.links[0]);
                }
            }
            next += 1;
            self.visit(visit, &mut visits, edits, change);
        }
        visits.clear();
        edits.visits = visits;
    }

    /// Looks at a node, and lists those below it.
    #[inline(always)]
    fn visit(&mut self, visit: Visit, visits: &mut Vec<Visit>, edits: &mut Edits, change: &GroundChange<'_>) {
        let Visit { point, node, side } = visit;
        if side == 1 && self.nodes.parents(node)[0].is_some() {
            return;
        }
        let k = self.records.grid().k();
        let level = level_of(point);
        if !self.nodes.is_unread(node)
            && let Some(raw) = self.record_now(change, slot_of(k, point))
            && raw != self.nodes.get(node).raw
        {
            self.renew(node, raw, edits);
        } else if !S::IS_COMPLETE && !self.nodes.is_split(node) && self.has_been_looked_from(node) {
            edits.looks.push(node);
        }
        if !self.nodes.is_split(node) || level == 0 {
            if self.nodes.clusters.has_bounds() {
                edits.leaves.push(node);
            }
            return;
        }
        let ring = self.nodes.rings.get(self.nodes.get(node).slot());
        let turned = orientation(point);
        for turn in TURNS.into_iter().flatten().filter(|turn| ring.children[*turn] != NONE) {
            let label = label_of(turn, turned, level);
            let at = child_point(point, level, label);
            if edits.areas.concern(at, level - 1) {
                let side = (label >> 1) as u32;
                visits.push(Visit { point: at, node: ring.children[turn], side });
            }
        }
    }

    /// Gives a node another record.
    fn renew(&mut self, node: u32, raw: RawOf<S>, edits: &mut Edits) {
        let is_split = self.nodes.is_split(node);
        let record = self.nodes.get_mut(node);
        record.raw = raw;
        let slot = record.slot();
        // One that is due already is in the list.
        if record.word & !STATUS != 0 {
            record.word &= STATUS;
            self.late.push(node);
        }
        if is_split {
            self.vertices.set_height(slot, self.vertex_of(node).height_m);
            edits.moved.push((slot, node));
        }
    }

    /// Whether a leaf is near enough to being over for a look to have begun there.
    fn has_been_looked_from(&self, node: u32) -> bool {
        let word = self.nodes.get(node).word;
        let is_near = |until: u64| word & !STATUS != 0 && u64::from(expiry_of(word)) <= until;
        !self.nodes.is_unread(node)
            && self.ahead.as_ref().is_some_and(|ahead| is_near(ahead.until[clock_of(word)]))
    }

    /// At the start of an update: sends the vertices that edits have moved, covers them, and looks ahead where what is seen may be another thing. The patch is empty yet: what
    /// splits and merges do to slots comes after.
    pub(crate) fn tell_edits(&mut self) {
        if self.edits.calls == 0 {
            return;
        }
        let mut edits = std::mem::take(&mut self.edits);
        if std::mem::take(&mut edits.calls) > 1 {
            edits.unite();
        }
        let square = corners(self.records.grid().k());
        for (slot, node) in edits.moved.drain(..) {
            let (point, vertex, ends) = if node == NONE {
                (square[slot as usize], self.corners[slot as usize], [slot; 2])
            } else {
                let ends = if node == CENTRE { [slot; 2] } else { self.nodes.rings.get(slot).ends() };
                (self.point_of(node), self.vertex_of(node), ends)
            };
            self.patch.vertices.push((slot, self.patch_vertex(point, &vertex, ends)));
        }
        for node in edits.leaves.drain(..) {
            let leaf = self.nodes.get(node);
            let annex = if leaf.is_split() { self.nodes.rings.get(leaf.slot()).annex() } else { NONE };
            for place in [node, annex].into_iter().filter(|place| *place != NONE) {
                for corners in self.nodes.triangles(place).into_iter().flatten() {
                    self.cover(place, &corners);
                }
            }
        }
        for node in edits.looks.drain(..) {
            if let Some(ahead) = &mut self.ahead {
                ahead.near(node);
            }
        }
        self.edits = edits;
    }
}
