//! The definition, by brute force: test every vertex of the terrain against the view, then split every triangle whose vertex passed.
//!
//! It walks no tree to decide, and inherits or remembers no answer. It goes through the vertices in the order of their records, so that a store which reads pages reads each once a frame, however few it holds.
//! Cost: one test for each vertex of the terrain in every frame. It is for tests and small terrains.

use super::change::GroundChange;
use super::{Culling, Engine, Probe};
use crate::mesh::Triangle;
use crate::metric::{ALL_PLANES, Metric};
use crate::view::View;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{CENTRE_SLOT, corners, point_of, slot_count};
use terrasoar_layout::read::store::{CompleteStore, RecordStore};

/// Steps a side of the largest square that replays use it for: half a second a frame.
pub const MOST_STEPS: u32 = 1 << 12;

/// Brute-force refinement.
#[derive(Debug)]
pub struct Naive<S: RecordStore> {
    records: S,
    culling: Culling,
    /// Whether each vertex is active, row by row.
    active: Vec<bool>,
    triangles: Vec<Triangle>,
}

impl<S: CompleteStore> Naive<S> {
    /// An engine over `records`, all of which are at hand, that culls as `culling` says.
    pub fn new(records: S, culling: Culling) -> Self {
        let side = records.grid().side_steps() as usize + 1;
        Self { active: vec![false; side * side], culling, records, triangles: Vec::new() }
    }

    fn index(&self, p: GridPoint) -> usize {
        p.y() as usize * (self.records.grid().side_steps() as usize + 1) + p.x() as usize
    }

    fn split(&mut self, [a, b, d]: Triangle) {
        // The smallest triangles have no vertex to split at.
        let smallest = (b.x() + d.x()) & 1 == 1 || (b.y() + d.y()) & 1 == 1;
        if !smallest && self.active[self.index(b.midpoint(d))] {
            let v = b.midpoint(d);
            // (v; b, a) and (v; a, d) with the winding of (a; b, d) kept.
            self.split([v, a, b]);
            self.split([v, d, a]);
        } else {
            self.triangles.push([a, b, d]);
        }
    }
}

impl<S: CompleteStore> Engine for Naive<S> {
    type Store = S;

    fn store_mut(&mut self) -> &mut S {
        &mut self.records
    }

    /// Nothing is kept from frame to frame.
    fn ground_changed(&mut self, _: &GroundChange<'_>) {}

    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64 {
        let metric = Metric::new(view);
        let grid = *self.records.grid();
        let mut tests = 0;
        // Corners and centre come first, and are in every mesh.
        for slot in CENTRE_SLOT + 1..slot_count(grid.k()) {
            let Some(p) = point_of(grid.k(), slot) else { continue };
            tests += 1;
            probe.read(slot);
            let vertex = self.records.vertex(slot, grid.level(p));
            let sighting = metric.sight(grid.position_m(p), &vertex);
            let index = self.index(p);
            let planes = if self.culling == Culling::Vertices { ALL_PLANES } else { 0 };
            self.active[index] = sighting.is_selected() && metric.cull(&sighting, planes).is_some();
        }
        self.triangles.clear();
        let [sw, se, ne, nw] = corners(grid.k());
        let centre = sw.midpoint(ne);
        for (b, d) in [(sw, se), (se, ne), (ne, nw), (nw, sw)] {
            self.split([centre, b, d]);
        }
        tests
    }

    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle)) {
        self.triangles.iter().for_each(|t| visit(*t));
    }
}
