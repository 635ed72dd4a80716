//! What a frame reports: slots that show something else than before, and what there is to draw.
//!
//! Whether a triangle is drawn follows from what its node holds, so no file is read for it. A triangle is drawn even if the record of its split vertex has not come yet. Whether a void
//! touches it is known when the record comes. Cost: the slots that changed.

use crate::mesh::has_area;
use crate::metric::Metric;
use crate::refine::Culling;
use crate::refine::kinetic::Kinetic;
use crate::refine::kinetic::mesh::bounds::Bounds;
use crate::refine::kinetic::mesh::clusters::{Clusters, Dealing};
use crate::refine::kinetic::mesh::nodes::Nodes;
use crate::refine::kinetic::mesh::vertices::Vertices;
use terrasoar_layout::read::store::{RawOf, RecordStore};

/// What slots show follows from these alone.
pub(crate) struct Shown<'k, S: RecordStore> {
    pub records: &'k S,
    pub nodes: &'k Nodes<RawOf<S>>,
    pub vertices: &'k Vertices,
}

impl<S: RecordStore> Shown<'_, S> {
    /// What a slot of `node` with these corners sends to the GPU: nothing where voids touch or padding takes the area.
    #[inline(always)]
    pub(crate) fn corners(&self, node: u32, corners: Option<[u32; 3]>) -> [u32; 3] {
        corners.filter(|corners| self.is_drawn(node, corners)).unwrap_or([0; 3])
    }

    /// Folded position and height of a vertex, for bounds.
    #[inline(always)]
    pub(crate) fn place_of(&self, vertex: u32) -> [f32; 3] {
        let folded = self.records.grid().fold(self.vertices.point(vertex));
        // Columns and rows are below 2^24: exact.
        [folded.x() as f32, folded.y() as f32, self.vertices.height_m(vertex)]
    }

    /// The box around a cluster's triangles.
    pub(crate) fn bounds(&self, cluster: usize) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        for node in self.nodes.clusters.places_of(cluster) {
            for vertex in self.nodes.triangles(node).into_iter().flatten().flatten() {
                bounds.include(self.place_of(vertex));
            }
        }
        bounds
    }

    /// As [`crate::mesh::is_drawn`].
    #[inline(always)]
    fn is_drawn(&self, node: u32, corners: &[u32; 3]) -> bool {
        let shape = self.records.shape();
        if shape.grid.has_padding() && !has_area(&shape.grid, corners.map(|v| self.vertices.point(v))) {
            return false;
        }
        if !shape.has_voids {
            return true;
        }
        if self.nodes.is_live(node) && !self.nodes.is_split(node) {
            let leaf = self.nodes.get(node);
            let vertex = || self.records.decode(leaf.raw, leaf.place(self.vertices).1);
            self.nodes.is_unread(node) || vertex().class.is_plain()
        } else {
            corners.iter().all(|v| !self.vertices.is_void(*v))
        }
    }
}

impl<S: RecordStore> Kinetic<S> {
    /// What slots show.
    #[inline(always)]
    pub(crate) fn shows(&self) -> Shown<'_, S> {
        Shown { records: &self.records, nodes: &self.nodes, vertices: &self.vertices }
    }

    /// What a slot of `node` with these corners sends to the GPU.
    #[inline(always)]
    pub(crate) fn shown(&self, node: u32, corners: Option<[u32; 3]>) -> [u32; 3] {
        self.shows().corners(node, corners)
    }

    /// Lists the slots that show something else than in the frame before.
    pub(crate) fn list_written(&mut self) {
        let mut written = std::mem::take(&mut self.patch.triangles);
        let mut clusters = std::mem::replace(&mut self.nodes.clusters, Clusters::new(Dealing::Packed));
        let shape = self.records.shape();
        let shows_all = !shape.has_voids && !shape.grid.has_padding();
        clusters.take_written(|node, side| {
            let corners = self.nodes.triangle(node, side);
            let shown = if shows_all { corners.unwrap_or([0; 3]) } else { self.shown(node, corners) };
            written.push((2 * node + side as u32, shown));
        });
        self.nodes.clusters = clusters;
        self.patch.triangles = written;
    }

    /// Lists what there is to draw: all slots, or those of the clusters that the view's planes do not cull.
    pub(crate) fn list_draws(&mut self, metric: &Metric) {
        if self.culling == Culling::Vertices {
            self.patch.draws.push(0..2 * self.nodes.clusters.places() as u32);
            return;
        }
        if self.work.merges > 0 || self.edits.loose > 0 {
            self.edits.loose = self.edits.loose.saturating_sub(1);
            self.stale = (self.stale + 1) % self.nodes.clusters.len();
            self.tighten(self.stale);
        }
        let grid = self.records.grid();
        let [low, high] = self.records.shape().height_range_m;
        let largest = f64::from(grid.side_steps()).max(low.abs()).max(high.abs());
        let draws = &mut self.patch.draws;
        self.nodes.clusters.cull(&metric.box_planes(grid.spacing_m(), largest), |range| draws.push(range));
    }
}
