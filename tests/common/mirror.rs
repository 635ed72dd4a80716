//! A mesh that knows nothing but the patches it was sent, as a GPU does.

use terrasoar::mesh::{Triangle, TriangleKey, is_drawn};
use terrasoar::refine::kinetic::{Kinetic, MeshVertex, Patch};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::read::store::RecordStore;

#[derive(Default)]
pub struct Mirror {
    vertices: Vec<Option<MeshVertex>>,
    triangles: Vec<[u32; 3]>,
    draws: Vec<std::ops::Range<u32>>,
}

impl Mirror {
    pub fn apply(&mut self, patch: &Patch) {
        for (slot, vertex) in &patch.vertices {
            let slot = *slot as usize;
            self.vertices.resize(self.vertices.len().max(slot + 1), None);
            self.vertices[slot] = Some(*vertex);
        }
        for (slot, corners) in &patch.triangles {
            let slot = *slot as usize;
            self.triangles.resize(self.triangles.len().max(slot + 1), [0; 3]);
            self.triangles[slot] = *corners;
        }
        self.draws = patch.draws.clone();
    }

    fn drawn(&self) -> impl Iterator<Item = [MeshVertex; 3]> {
        let shown = |slot: u32| self.triangles.get(slot as usize).copied().unwrap_or_default();
        let slots = self.draws.iter().flat_map(|r| r.clone()).map(shown);
        slots
            .filter(|[a, b, _]| a != b)
            .map(|t| t.map(|v| self.vertices[v as usize].expect("a vertex that was sent")))
    }

    /// The drawn triangles' folded corners, rotated to begin with the least, as one number each, in order.
    pub fn triangles(&self) -> Vec<u128> {
        sorted(self.drawn().map(|t| t.map(|v| GridPoint::new(v.x, v.y))))
    }

    /// What is drawn has the same vertices, all their numbers included.
    pub fn check_same(&self, other: &Self) {
        // Which end comes first means nothing.
        let known = |v: Option<MeshVertex>| {
            v.map(|v| MeshVertex { ends: [v.ends[0].min(v.ends[1]), v.ends[0].max(v.ends[1])], ..v })
        };
        let slots = self.draws.iter().flat_map(|range| range.clone());
        let held = slots.filter_map(|slot| Some((slot, self.triangles.get(slot as usize)?)));
        for (slot, corners) in held.filter(|(_, [a, b, _])| a != b) {
            for v in corners.iter().map(|v| *v as usize) {
                assert_eq!(
                    known(self.vertices[v]),
                    known(other.vertices[v]),
                    "vertex {v} of triangle slot {slot}"
                );
            }
        }
    }

    /// Every vertex is where the terrain says, and on the edge between its ends.
    pub fn check_vertices(&self, records: &impl RecordStore) {
        for v in self.drawn().flatten() {
            let vertex = records.vertex_at(GridPoint::new(v.x, v.y));
            assert_eq!(v.height_m, vertex.height_m as f32);
            assert!(v.flags < 32 || v.flags == MeshVertex::NO_LEVEL);
            assert!(v.error_m >= 0.0 && v.radius_m >= 0.0);
            assert!(v.ends.iter().all(|end| self.vertices[*end as usize].is_some()));
        }
    }
}

fn sorted(triangles: impl Iterator<Item = [GridPoint; 3]>) -> Vec<u128> {
    // Numbers are sorted in half the time of rows.
    let number = |p: GridPoint| {
        assert!(p.x() < 1 << 21 && p.y() < 1 << 21, "{p:?} does not fit a third of a number");
        u128::from(p.y()) << 21 | u128::from(p.x())
    };
    let mut all: Vec<u128> = triangles
        .map(|t| {
            let [a, b, c] = t.map(number);
            let [a, b, c] = if a <= b && a <= c {
                [a, b, c]
            } else if b <= c {
                [b, c, a]
            } else {
                [c, a, b]
            };
            a << 84 | b << 42 | c
        })
        .collect();
    all.sort_unstable();
    all
}

/// The corners of a triangle of [`Mirror::triangles`].
pub fn corners(triangle: u128) -> [GridPoint; 3] {
    let coordinate = |low: u32| (triangle >> low) as u32 & 0x1f_ffff;
    [84, 42, 0].map(|low| GridPoint::new(coordinate(low), coordinate(low + 21)))
}

/// What of a full mesh is drawn, in the form of [`Mirror::triangles`].
pub fn drawn(records: &impl RecordStore, triangles: &[Triangle]) -> Vec<u128> {
    let grid = records.grid();
    sorted(triangles.iter().filter(|t| is_drawn(records, **t)).map(|t| t.map(|p| grid.fold(p))))
}

/// Clusters lie around their triangles, and each triangle of the mesh is in one of them.
pub fn check_clusters<S: RecordStore>(engine: &Kinetic<S>, whole: &Patch, expected: &[TriangleKey]) {
    let mut found = 0;
    assert!(whole.triangles.is_sorted_by_key(|(slot, _)| *slot));
    let first_from = |from: u32| whole.triangles.partition_point(|(slot, _)| *slot < from);
    for (bounds, range) in engine.clusters() {
        let triangles = &whole.triangles[first_from(range.start)..first_from(range.end)];
        found += triangles.len();
        for (_, corners) in triangles.iter().filter(|(_, corners)| corners[0] != corners[1]) {
            for corner in corners {
                let at =
                    whole.vertices.binary_search_by_key(corner, |(slot, _)| *slot).expect("in the patch");
                let v = whole.vertices[at].1;
                for (i, x) in [v.x as f32, v.y as f32, v.height_m].into_iter().enumerate() {
                    assert!((bounds.least[i]..=bounds.largest[i]).contains(&x), "{v:?} {bounds:?}");
                }
            }
        }
    }
    assert_eq!(found, expected.len());
    assert_eq!(engine.triangle_count(), expected.len());
}
