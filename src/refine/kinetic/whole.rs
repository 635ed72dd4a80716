//! The whole mesh at once, for those who cannot follow patches: as one patch, as triangles, as SOAR's strip. Cost: proportional to the mesh; updates need
//! none of it.

use super::nodes::CENTRE;
use super::{Kinetic, Patch, root_label};
use crate::refine::soar::StripVertex;
use crate::refine::strip::StripBuilder;
use std::collections::HashMap;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::order::{ROOTS, corners};
use terrasoar_layout::record::RecordCodec;

impl<C: RecordCodec> Kinetic<'_, C> {
    /// The whole mesh as a patch to an empty one, for a GPU that has lost its copy. Reads the records of all vertices in the mesh.
    pub fn whole_patch(&self) -> Patch {
        let mut patch = Patch { draws: self.patch.draws.clone(), ..Default::default() };
        let mut in_use = vec![false; self.vertices.slots().len()];
        self.for_each_slot(|slot, corners| {
            corners.iter().for_each(|v| in_use[*v as usize] = true);
            patch.triangles.push((slot, self.shown(Some(corners))));
        });
        let grid = self.records.grid();
        let slot_at: HashMap<GridPoint, u32> = (0..in_use.len() as u32)
            .filter(|v| in_use[*v as usize])
            .map(|v| (self.vertices.point(v), v))
            .collect();
        for (point, slot) in &slot_at {
            let own = grid.is_corner(*point) || self.nodes.get(CENTRE).point == *point;
            let ends = if own {
                [*slot; 2]
            } else {
                grid.edge_ends(*point).map(|p| slot_at.get(&p).copied().unwrap_or(*slot))
            };
            patch.vertices.push((*slot, self.patch_vertex(*point, &self.records.vertex_at(*point), ends)));
        }
        patch.vertices.sort_unstable_by_key(|(slot, _)| *slot);
        patch
    }

    /// The mesh as one triangle strip, SOAR's, from scratch. For those who want a strip; updates do not need it.
    pub fn strip(&self, strip: &mut Vec<StripVertex>) {
        strip.clear();
        if self.nodes.is_empty() {
            return;
        }
        let grid = self.records.grid();
        let c = corners(grid.k());
        let vertex = |i: usize| *self.vertices.get(i as u32);
        let mut walk = StripWalk { engine: self, strip: StripBuilder::start(strip, c[0], vertex(0)) };
        let centre = (self.nodes.get(CENTRE).point, vertex(4));
        for (root, (side, [b, d])) in ROOTS.into_iter().enumerate() {
            let node = self.nodes.get(CENTRE).body[root_label(side)];
            walk.visit(grid.levels() - 1, Some(node), centre, c[b], c[d]);
            if root < 3 {
                walk.strip.append(c[root + 1], 0, vertex(root + 1));
            }
        }
        strip.push(*self.vertices.get(0));
    }

    /// Calls `visit` with every triangle of the mesh and its slot.
    pub(super) fn for_each_slot(&self, mut visit: impl FnMut(u32, [u32; 3])) {
        for node in (0..self.nodes.pages.len()).flat_map(|page| self.nodes.pages.places_of(page)) {
            for (side, corners) in self.nodes.triangles(node).into_iter().enumerate() {
                if let Some(corners) = corners {
                    visit(2 * node + side as u32, corners);
                }
            }
        }
    }
}

/// The walk that makes a strip.
struct StripWalk<'w, 'a, C: RecordCodec> {
    engine: &'w Kinetic<'a, C>,
    strip: StripBuilder<'w, StripVertex>,
}

impl<C: RecordCodec> StripWalk<'_, '_, C> {
    /// Visits the triangle (apex; b, d), whose split vertex is `node` unless it is one of the smallest.
    fn visit(
        &mut self,
        height: u32,
        node: Option<u32>,
        apex: (GridPoint, StripVertex),
        b: GridPoint,
        d: GridPoint,
    ) {
        if let Some(node) = node.filter(|node| self.engine.nodes.is_split(*node)) {
            let at = b.midpoint(d);
            let height_m = self.engine.vertex_of(node).height_m as f32;
            let here = (at, StripVertex { x: at.x(), y: at.y(), height_m });
            // At the finest level edges have no middle, and triangles no vertex to split at.
            let child = |end: GridPoint| {
                if height > 1 { self.engine.child_at(node, end.midpoint(apex.0)) } else { None }
            };
            let (left, right) = (child(b), child(d));
            self.visit(height - 1, left, here, b, apex.0);
            self.strip.append(apex.0, height & 1, apex.1);
            self.visit(height - 1, right, here, apex.0, d);
        } else {
            self.strip.append(apex.0, height & 1, apex.1);
        }
    }
}
