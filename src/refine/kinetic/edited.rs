//! The ground was edited: nodes take over records that changed, and their words are over.
//!
//! One descent from the roots, into triangles only that an edit can concern, compares each node's record with the page that now holds it. A node whose record is another one
//! keeps its place; its word is due in the next update, which tests it as any other, and a vertex in the mesh is sent anew. Errors and radii are saturated as
//! before, so the mesh conforms, and without a budget it is SOAR's over the edited ground in the same frame. Cost: the triangles around what changed and their ancestors; nothing is
//! allocated once the lists have grown.

use super::labels::level_of;
use super::nodes::{CENTRE, STATUS, body, half};
use super::{Kinetic, root_label};
use crate::refine::ground::{Areas, GroundChange};
use std::ops::Range;
use terrasoar_layout::bytes::PAGE_BYTES;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::order::{ROOTS, corners, slot_of};
use terrasoar_layout::record::RecordCodec;
use terrasoar_layout::store::{RawOf, RecordStore};

/// The record at `slot` in a page that holds changed ones.
fn record<S: RecordStore>(change: &GroundChange<'_>, slot: u64) -> Option<RawOf<S>> {
    let page = (change.page)(S::page_of(slot))?;
    let at = (slot as usize % (PAGE_BYTES / S::Codec::BYTES)) * S::Codec::BYTES;
    Some(S::Codec::read(&page[at..]))
}

impl<S: RecordStore> Kinetic<S> {
    /// Takes over what changed of the ground, between two frames. Pages of the store are replaced before, as far as it holds them.
    pub(in super::super) fn take_edit(&mut self, change: &GroundChange<'_>) {
        let [low, high] = change.height_range_m;
        self.clocks.raise_tallest(low.abs().max(high.abs()));
        if self.nodes.is_empty() {
            return;
        }
        let grid = *self.records.grid();
        let mut areas = std::mem::take(&mut self.areas);
        let all = areas.start(&grid, change);
        let square = corners(grid.k());
        for (i, at) in square.into_iter().enumerate() {
            if let Some(raw) = record::<S>(change, i as u64) {
                let vertex = self.records.decode(raw, 0);
                if vertex != self.corners[i] {
                    self.corners[i] = vertex;
                    self.vertices.set_height(i as u32, vertex.height_m);
                    self.moved.push((i as u32, self.patch_vertex(at, &vertex, [i as u32; 2])));
                }
            }
        }
        let centre_slot = self.nodes.get(CENTRE).body[body::HERE];
        self.take_record(CENTRE, [centre_slot; 2], change);
        let centre = self.nodes.get(CENTRE).point;
        for (side, [b, d]) in ROOTS {
            let label = root_label(side);
            let node = self.nodes.get(CENTRE).body[label];
            let slots = [centre_slot, b as u32, d as u32];
            self.descend(node, label >> 1, slots, [centre, square[b], square[d]], &all, &mut areas, change);
        }
        self.areas = areas;
    }

    /// Looks at a node through its triangle on one side: corners (apex; p, q) by vertex slot and point.
    #[expect(
        clippy::too_many_arguments,
        reason = "a triangle, by slots and points, and what goes down with it"
    )]
    fn descend(
        &mut self,
        node: u32,
        side: usize,
        slots: [u32; 3],
        points: [GridPoint; 3],
        above: &Range<usize>,
        areas: &mut Areas,
        change: &GroundChange<'_>,
    ) {
        let point = self.nodes.get(node).point;
        let level = level_of(point);
        let here = areas.narrow(above, points, level);
        if here.is_empty() {
            return;
        }
        if !self.nodes.is_unread(node) {
            self.take_record(node, [slots[1], slots[2]], change);
        }
        let record = *self.nodes.get(node);
        if !self.nodes.is_split(node) {
            self.cover(node, &slots);
            return;
        }
        let own = record.body[body::HERE];
        if level == 0 {
            let [_, apex, p, q] = half(&record, side);
            self.cover(node, &[own, apex, p, q]);
            self.cover(record.body[body::ANNEX], &[own, apex, p, q]);
            return;
        }
        let Some(side) = self.nodes.sides(node, level)[side] else { return };
        let [apex, p, q] = slots;
        let [apex_at, p_at, q_at] = points;
        let halves = [
            (side.first, [own, apex, p], [point, apex_at, p_at]),
            (side.last, [own, q, apex], [point, q_at, apex_at]),
        ];
        for (label, slots, points) in halves {
            self.descend(record.body[label], label >> 1, slots, points, &here, areas, change);
        }
    }

    /// Gives a node the record that its page holds now. `ends` are the vertex slots of the edge that it splits.
    fn take_record(&mut self, node: u32, ends: [u32; 2], change: &GroundChange<'_>) {
        let point = self.nodes.get(node).point;
        let Some(raw) = record::<S>(change, slot_of(self.records.grid().k(), point)) else { return };
        if raw == self.nodes.get(node).raw {
            return;
        }
        self.nodes.get_mut(node).raw = raw;
        if self.nodes.is_split(node) || node == CENTRE {
            let vertex = self.vertex_of(node);
            let here = self.nodes.get(node).body[body::HERE];
            self.vertices.set_height(here, vertex.height_m);
            // As a split would order them.
            let record = self.nodes.get(node);
            let ends = if level_of(point) == 0 { [record.body[body::P], record.body[body::Q]] } else { ends };
            self.moved.push((here, self.patch_vertex(point, &vertex, ends)));
        }
        if node != CENTRE {
            let word = &mut self.nodes.get_mut(node).word;
            // One that is due already is in the list.
            if *word & !STATUS != 0 {
                *word &= STATUS;
                self.late.push(node);
            }
        }
    }
}
