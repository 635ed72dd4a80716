//! SOAR's mesh as one patch a frame: every triangle is sent, and nothing is remembered. Pictures of engines that send changes are compared with it.
//!
//! Vertices are numbered in the order of their grid points, so equal meshes give equal patches. Cost: the whole mesh, and a sort of its vertices.

use super::engine::{MeshEngine, Refined};
use super::samples::{HeightTile, tile_of};
use crate::mesh::{Triangle, is_drawn, with_apex_first};
use crate::refine::kinetic::{Budget, MeshVertex, Patch};
use crate::refine::soar::Soar;
use crate::refine::{Culling, Engine, Unobserved, Work};
use crate::stream::{HeightAt, height_at};
use crate::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::read::store::CompleteStore;

/// SOAR and its mesh.
pub(super) struct FullMesh<S: CompleteStore> {
    engine: Soar<S>,
    records: S,
    patch: Patch,
}

impl<S: CompleteStore + Clone> FullMesh<S> {
    /// Over `records`, culled as `culling` says.
    pub(super) fn new(records: S, culling: Culling) -> Self {
        Self { engine: Soar::new(records.clone(), culling), records, patch: Patch::default() }
    }

    fn vertex(&self, point: GridPoint, slot: u32, slot_of: impl Fn(GridPoint) -> Option<u32>) -> MeshVertex {
        let grid = self.records.grid();
        let middle = grid.side_steps() / 2;
        // Corners and the centre split no edge.
        let own = grid.is_corner(point) || point == GridPoint::new(middle, middle);
        let ends =
            if own { [slot; 2] } else { grid.edge_ends(point).map(|end| slot_of(end).unwrap_or(slot)) };
        MeshVertex::of(&self.records, point, &self.records.vertex_at(point), ends)
    }
}

impl<S: CompleteStore + Clone> MeshEngine for FullMesh<S> {
    fn update(&mut self, view: &View) -> Refined {
        let tests = self.engine.update(view, &mut Unobserved);
        let mut triangles: Vec<Triangle> = Vec::new();
        self.engine.for_each_triangle(&mut |t| triangles.push(with_apex_first(t)));
        let mut points: Vec<GridPoint> = triangles.iter().flatten().copied().collect();
        points.sort_unstable_by_key(|p| p.packed());
        points.dedup();
        let slot_of = |p: GridPoint| {
            points.binary_search_by_key(&p.packed(), |q| q.packed()).ok().map(|slot| slot as u32)
        };
        let mut patch = std::mem::take(&mut self.patch);
        patch.vertices.clear();
        patch.vertices.extend((0..).zip(&points).map(|(slot, p)| (slot, self.vertex(*p, slot, slot_of))));
        patch.triangles.clear();
        let drawn = triangles.iter().filter(|t| is_drawn(&self.records, **t));
        patch
            .triangles
            .extend((0..).zip(drawn).map(|(slot, t)| (slot, t.map(|p| slot_of(p).unwrap_or_default()))));
        patch.draws.clear();
        patch.draws.push(0..patch.triangles.len() as u32);
        self.patch = patch;
        Refined {
            work: Work { tests, ..Work::default() },
            triangles: triangles.len() as u64,
            ..Refined::default()
        }
    }

    fn patch(&self) -> &Patch {
        &self.patch
    }

    fn whole(&self) -> Patch {
        self.patch.clone()
    }

    fn set_budget(&mut self, _: Budget) -> bool {
        false
    }

    fn heights_m(&mut self, tile: HeightTile, heights_m: &mut Vec<f32>) -> bool {
        tile_of(&self.records, tile, heights_m);
        true
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.records.shape().height_range_m
    }

    fn height_at(&self, east_m: f64, north_m: f64) -> HeightAt {
        height_at(&self.records, east_m, north_m)
    }

    fn take_error(&mut self) -> Option<LayoutError> {
        self.records.take_error()
    }
}
