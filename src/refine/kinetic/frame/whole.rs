//! The whole mesh at once, for code that cannot follow patches: as one patch, as triangles, as SOAR's strip. Cost: in proportion to the mesh. Updates need
//! none of it.

use crate::refine::kinetic::mesh::nodes::CENTRE;
use crate::refine::kinetic::{Kinetic, Patch, root_label};
use crate::refine::soar::StripVertex;
use crate::refine::strip::{Strip, StripBuilder};
use std::collections::HashMap;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{ROOTS, corners};
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::store::RecordStore;

impl<S: RecordStore> Kinetic<S> {
    /// The whole mesh as a patch to an empty one, for a GPU that has lost its copy.
    pub fn whole_patch(&self) -> Patch {
        let mut patch = Patch { draws: self.patch.draws.clone(), ..Default::default() };
        if self.nodes.is_empty() {
            return patch;
        }
        self.for_each_slot(|slot, corners| {
            patch.triangles.push((slot, self.shown(slot / 2, Some(corners))));
        });
        let grid = self.records.grid();
        let square = corners(grid.k());
        let mut vertices: Vec<(u32, GridPoint, Vertex)> =
            self.corners.iter().enumerate().map(|(i, vertex)| (i as u32, square[i], *vertex)).collect();
        self.nodes().filter(|node| self.nodes.is_live(*node) && self.nodes.is_split(*node)).for_each(
            |node| {
                vertices.push((self.nodes.get(node).slot(), self.point_of(node), self.vertex_of(node)));
            },
        );
        let slot_at: HashMap<GridPoint, u32> =
            vertices.iter().map(|(slot, point, _)| (*point, *slot)).collect();
        for (slot, point, vertex) in vertices {
            let own = grid.is_corner(point) || self.point_of(CENTRE) == point;
            let ends = if own {
                [slot; 2]
            } else {
                grid.edge_ends(point).map(|p| slot_at.get(&p).copied().unwrap_or(slot))
            };
            patch.vertices.push((slot, self.patch_vertex(point, &vertex, ends)));
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
        let strip_vertex =
            |at: GridPoint, v: Vertex| StripVertex { x: at.x(), y: at.y(), height_m: v.height_m as f32 };
        let vertex = |i: usize| strip_vertex(c[i], self.corners[i]);
        let mut made = Strip::in_room(std::mem::take(strip));
        let mut walk = StripWalk { engine: self, strip: made.start(c[0], vertex(0)) };
        let centre_at = self.point_of(CENTRE);
        let centre = (centre_at, strip_vertex(centre_at, self.vertex_of(CENTRE)));
        for (root, (side, [b, d])) in ROOTS.into_iter().enumerate() {
            let node = self.root(root_label(side));
            walk.visit(grid.levels() - 1, Some(node), centre, c[b], c[d]);
            if root < 3 {
                walk.strip.append(c[root + 1], 0, vertex(root + 1));
            }
        }
        walk.strip.finish(vertex(0), &mut made);
        *strip = made.into_vec();
    }

    /// All nodes and annexes.
    fn nodes(&self) -> impl Iterator<Item = u32> {
        (0..self.nodes.clusters.len()).flat_map(|cluster| self.nodes.clusters.places_of(cluster))
    }

    /// Calls `visit` with every triangle of the mesh and its slot.
    pub(crate) fn for_each_slot(&self, mut visit: impl FnMut(u32, [u32; 3])) {
        for node in self.nodes() {
            for (side, corners) in self.nodes.triangles(node).into_iter().enumerate() {
                if let Some(corners) = corners {
                    visit(2 * node + side as u32, corners);
                }
            }
        }
    }
}

/// The walk that makes a strip.
struct StripWalk<'w, S: RecordStore> {
    engine: &'w Kinetic<S>,
    strip: StripBuilder<StripVertex>,
}

impl<S: RecordStore> StripWalk<'_, S> {
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
