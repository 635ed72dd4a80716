//! Kinetic: refinement that costs what changes, not what the mesh holds.
//!
//! The mesh of the frame before is kept. Every vertex in it has a live-range word, a certificate of how long its status holds
//! (`certificate`), and lies in a queue by the tick at which that ends (`queue`, `clocks`). A frame takes the words that are over, tests their
//! vertices again and splits or merges those whose status has changed (`tree`). Nothing else is looked at. Triangles and vertices
//! keep their slots (`clusters`, `vertices`), so what changed is a short [`Patch`].
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART" (live ranges, the bin-tree array); P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made
//! Easy", IEEE Visualization 2001 (the mesh, which is SOAR's in every frame); J. Basch, L. Guibas, J. Hershberger, "Data Structures for Mobile Data",
//! SODA 1997 (certificates that fail one by one).
//!
//! A vertex has one word for both its triangles. Mesh and words agree without any bookkeeping: errors and radii are saturated, so an active vertex's
//! parents are active in the same frame; splits go from coarse to fine, merges from fine to coarse. Where a
//! [`Budget`] runs out, a word is late and its vertex stays as it is. No vertex is split before its parents, so the mesh has no cracks whatever is late.
//!
//! Cost: some ten nanoseconds a test, a hundred a split or merge, a hundred additions for the clocks. Allocates nothing once its arrays have grown.

mod capacity;
mod chunked;
mod frame;
mod hands;
mod mesh;
mod time;

pub(crate) use frame::ahead::Want;
pub use frame::budget::Budget;
pub(crate) use hands::alone;
pub use mesh::bounds::Bounds;
pub use mesh::patch::{MeshVertex, Patch};

use super::change::GroundChange;
use super::listener::Listener;
use super::{Culling, Engine, Phase, Probe, Work};
use crate::mesh::Triangle;
use crate::metric::{ALL_PLANES, Metric};
use crate::view::View;
use capacity::{UNUSED, UNUSED_BY_NEW, settle};
use frame::ahead::Ahead;
use frame::budget::Allowance;
use frame::edited::Edits;
use mesh::clusters::{Clusters, Dealing};
use mesh::labels::level_of;
use mesh::nodes::{CENTRE, Nodes, STATUS};
use mesh::rings::{Corner, Ring};
use mesh::vertices::Vertices;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, corners};
use terrasoar_layout::grid::record::{RecordCodec, Vertex};
use terrasoar_layout::grid::{GridPoint, MOST_LEVELS};
use terrasoar_layout::read::store::{RawOf, RecordStore};
use time::certificate::Judge;
use time::certificate::batch::Batch;
use time::clocks::Clocks;
use time::course::Pose;
use time::queue::{Entry, Queue};

/// Late vertices that are asked for their error in a frame whose time is bounded: evenly out of all that are late.
const MOST_ASSESSED: usize = 8192;
/// Sweeps of a queue in one frame.
const MOST_SWEEPS: usize = 16;

/// Refinement by certificates.
#[derive(Debug)]
pub struct Kinetic<S: RecordStore> {
    records: S,
    culling: Culling,
    nodes: Nodes<RawOf<S>>,
    vertices: Vertices,
    /// The square's corners, which no node splits.
    corners: [Vertex; 4],
    /// Triangles in the mesh.
    triangles: usize,
    /// The cluster whose bounds are due to be made anew.
    stale: usize,
    /// The cluster that was looked at last for being sparse.
    sparse: usize,
    clocks: Clocks,
    queue: Queue,
    /// Looks ahead, if pages are to be wanted before they are needed.
    ahead: Option<Box<Ahead>>,
    /// Nodes whose record is away.
    unread: Vec<u32>,
    wants: Vec<Want>,
    budget: Budget,
    /// Nodes whose certificate is over and that are in no queue.
    due: Vec<u32>,
    /// Those that the budget left for the next frame.
    late: Vec<u32>,
    /// Children made by splits, untested yet.
    fresh: Vec<u32>,
    /// Nodes to be split or merged, in order.
    list: Vec<u32>,
    /// Leaves that are to be split, by level. What a budget leaves here waits for the next frame.
    to_split: [Vec<u32>; MOST_LEVELS],
    to_merge: [Vec<u32>; MOST_LEVELS],
    /// Records and words of the nodes being tested.
    verdicts: Vec<(RawOf<S>, u32)>,
    /// Room for what is tested together.
    batch: Option<Box<Batch>>,
    /// Nodes that may be over, each with the latest word on its clock that is.
    over: Vec<Entry>,
    /// Entries on their way from one clock to another.
    waiting: Vec<Entry>,
    patch: Patch,
    edits: Edits,
    /// Whether the frame before has made most of the mesh.
    is_new: bool,
    /// Whether arrays may hold more than the mesh needs, for it was larger before a jump.
    is_roomy: bool,
    work: Work,
}

impl<S: RecordStore> Kinetic<S> {
    /// An engine over `records` that culls as `culling` says.
    pub fn new(records: S, culling: Culling) -> Self {
        let shape = records.shape();
        let [dx, dy] = shape.grid.spacing_m();
        let [low, high] = shape.height_range_m;
        let nowhere = shape.codec.decode(S::Codec::INERT, 0);
        let dealing = if culling == Culling::Clusters { Dealing::Near } else { Dealing::Packed };
        Self {
            culling,
            nodes: Nodes::new(Clusters::new(dealing)),
            vertices: Vertices::new(dealing == Dealing::Near),
            corners: [nowhere; 4],
            triangles: 0,
            stale: 0,
            sparse: 0,
            clocks: Clocks::new(dx.min(dy), low.abs().max(high.abs())),
            queue: Queue::new(),
            ahead: None,
            unread: Vec::new(),
            wants: Vec::new(),
            budget: Budget::default(),
            due: Vec::new(),
            late: Vec::new(),
            fresh: Vec::new(),
            list: Vec::new(),
            to_split: std::array::from_fn(|_| Vec::new()),
            to_merge: std::array::from_fn(|_| Vec::new()),
            verdicts: Vec::new(),
            batch: None,
            over: Vec::new(),
            waiting: Vec::new(),
            patch: Patch::default(),
            edits: Edits::default(),
            is_new: false,
            is_roomy: false,
            work: Work::default(),
            records,
        }
    }

    /// Bounds what a frame may do from now on. What it leaves undone stays coarse, conforming, and is told by [`Work::late`].
    pub fn set_budget(&mut self, budget: Budget) {
        self.budget = budget;
    }

    /// Looks `frames` ahead for pages from now on, for stores that are not complete: see [`Kinetic::wants`]. To be called before the first frame, and again
    /// whenever the lead changes. Without it only what the mesh lacks already is wanted.
    pub(crate) fn look_ahead(&mut self, frames: f32) {
        match &mut self.ahead {
            Some(ahead) => ahead.set_lead(frames),
            None => self.ahead = Some(Box::new(Ahead::new(frames))),
        }
    }

    /// Clusters that the mesh lacks or will need, in no order and some more than once. What is away is wanted again every few frames.
    pub(crate) fn wants(&self) -> &[Want] {
        &self.wants
    }

    /// Where its records come from.
    pub fn store(&self) -> &S {
        &self.records
    }

    /// What the last update changed in the mesh.
    pub fn patch(&self) -> &Patch {
        &self.patch
    }

    /// Bounds and triangle slots of the clusters of the mesh. Bounds are kept with [`Culling::Clusters`] only; without it they are empty.
    pub fn clusters(&self) -> impl Iterator<Item = (Bounds, std::ops::Range<u32>)> {
        self.nodes.clusters.clusters()
    }

    /// Triangles in the mesh, also those that are not drawn.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Vertices under watch: those in the mesh and those that the next splits would add.
    pub fn node_count(&self) -> usize {
        self.nodes.clusters.taken()
    }

    /// Bytes held by all arrays, spare capacity included.
    pub fn bytes(&self) -> usize {
        let lists = [&self.due, &self.late, &self.fresh, &self.list, &self.unread];
        let by_level = self.to_split.iter().chain(&self.to_merge);
        self.nodes.bytes()
            + self.vertices.bytes()
            + self.queue.bytes()
            + lists.into_iter().chain(by_level).map(|l| l.capacity() * size_of::<u32>()).sum::<usize>()
            + size_of::<Batch>()
            + self.verdicts.capacity() * size_of::<(RawOf<S>, u32)>()
            + (self.over.capacity() + self.waiting.capacity()) * size_of::<Entry>()
            + self.ahead.as_ref().map_or(0, |ahead| ahead.bytes())
            + self.wants.capacity() * size_of::<Want>()
            + self.patch.vertices.capacity() * size_of::<(u32, MeshVertex)>()
            + self.edits.bytes()
            + self.patch.triangles.capacity() * size_of::<(u32, [u32; 3])>()
            + self.patch.draws.capacity() * size_of::<std::ops::Range<u32>>()
    }

    fn patch_vertex(&self, point: GridPoint, vertex: &Vertex, ends: [u32; 2]) -> MeshVertex {
        MeshVertex::of(&self.records, point, vertex, ends)
    }

    /// The vertex of a node, from the record it holds.
    #[inline(always)]
    fn vertex_of(&self, node: u32) -> Vertex {
        self.records.decode(self.nodes.get(node).raw, self.place_of(node).1)
    }

    /// Counts what is late and how far the largest error of it exceeds the tolerance. Where time counts, [`MOST_ASSESSED`] vertices at the most are asked for their error.
    fn assess_late(&mut self, metric: &Metric, view: &View) {
        let [dx, dy] = self.records.grid().spacing_m();
        let nearest_m = dx.min(dy);
        // What a vertex leaves on the screen while it is not split, if that shows.
        let error_px = |node: u32| {
            let vertex = self.vertex_of(node);
            let sighting = metric.sight(self.records.grid().position_m(self.point_of(node)), &vertex);
            let culled = self.culling == Culling::Vertices && metric.cull(&sighting, ALL_PLANES).is_none();
            let shows = sighting.is_selected() && !culled;
            if shows { sighting.error_px(view.tolerance_px, nearest_m) } else { 0.0 }
        };
        let (mut late, mut late_error_px) = (0u64, 0.0f64);
        let all = self.late.len() + self.to_split.iter().map(Vec::len).sum::<usize>();
        let apart = if self.budget.time.is_some() { all.div_ceil(MOST_ASSESSED).max(1) as u64 } else { 1 };
        for node in
            self.late.iter().chain(self.to_split.iter().flatten()).filter(|node| self.nodes.is_live(**node))
        {
            late += 1;
            if late.is_multiple_of(apart) && !self.nodes.is_split(*node) {
                late_error_px = late_error_px.max(error_px(*node));
            }
        }
        let mut unread = 0;
        for node in self.unread.iter().filter(|node| self.nodes.is_unread(**node)) {
            unread += 1;
            // Its own error is not known, but no larger than its parents'.
            let parents = self.nodes.get(*node).links.into_iter().filter(|parent| parent.is_some());
            let bound_px = parents
                .map(|parent| error_px(self.nodes.node_of(parent.slot())))
                .fold(f64::INFINITY, f64::min);
            late_error_px = late_error_px.max(if bound_px.is_finite() { bound_px } else { 0.0 });
        }
        self.work.late = late + unread;
        self.work.unread = unread;
        self.work.late_error_px = late_error_px;
    }

    /// Gives back what only a large frame before this one has needed.
    fn settle(&mut self) {
        // A frame that made most of the mesh says nothing about the next ones.
        let made_anew = self.work.tests as usize > self.nodes.clusters.taken() / 2;
        let used = if made_anew {
            self.nodes.clusters.taken() / 128
        } else {
            (self.work.tests + self.work.slots_written) as usize
        };
        let unused = if std::mem::replace(&mut self.is_new, made_anew) { UNUSED_BY_NEW } else { UNUSED };
        let lists = [&mut self.due, &mut self.late, &mut self.fresh, &mut self.list];
        lists
            .into_iter()
            .chain(&mut self.to_split)
            .chain(&mut self.to_merge)
            .for_each(|list| settle(list, used, unused));
        settle(&mut self.over, used, unused);
        if made_anew {
            // Filled whenever a course ends, however little else there is to do.
            settle(&mut self.waiting, 0, unused);
        }
        settle(&mut self.verdicts, used, unused);
        self.nodes.clusters.settle(used, unused);
        settle(&mut self.patch.vertices, used, unused);
        settle(&mut self.patch.triangles, used, unused);
        self.edits.settle(self.nodes.clusters.taken());
        self.give_back_room();
    }

    /// A record of the first page.
    fn first_record(&self, slot: u64) -> RawOf<S> {
        self.records.get(slot).unwrap_or(S::Codec::INERT)
    }

    /// Brings the mesh to a view; returns the vertex tests that took.
    fn refine(&mut self, view: &View, probe: &mut Listener<'_>) -> u64 {
        let metric = Metric::new(view);
        let pose = Pose::of(view, &metric);
        self.work = Work::default();
        self.patch.clear();
        self.tell_edits();
        probe.phase(Phase::Scan);
        self.take_arrivals();
        self.collect(pose, probe);
        let judge = Judge::new(metric, &self.clocks, self.culling == Culling::Vertices);
        let is_planted = self.nodes.is_empty();
        if is_planted {
            self.plant(probe);
        }
        if is_planted && self.budget == Budget::default() {
            self.build(&judge, probe);
        } else {
            let mut allowance = Allowance::new(self.budget);
            self.test_fresh(&judge, probe);
            self.test_due(&judge, &mut allowance, probe);
            probe.phase(Phase::Apply);
            self.apply(&judge, &mut allowance, probe);
        }
        if !S::IS_COMPLETE {
            self.look(&judge);
        }
        if !self.late.is_empty()
            || !self.unread.is_empty()
            || self.to_split.iter().any(|nodes| !nodes.is_empty())
        {
            self.assess_late(&metric, view);
        }
        self.compact();
        for queue in std::iter::once(&mut self.queue).chain(self.ahead.as_mut().map(|ahead| &mut ahead.far)) {
            // The more, the faster: edits end many words long before their time.
            for _ in 0..(queue.len() / (2 * self.nodes.clusters.taken())).min(MOST_SWEEPS) {
                queue.sweep_some(&self.nodes.all);
            }
        }
        self.list_written();
        self.list_draws(&metric);
        self.work.slots_written = self.patch.triangles.len() as u64;
        self.work.patch_bytes = self.patch.bytes();
        self.settle();
        probe.phase(Phase::Done);
        self.work.tests
    }

    /// Makes the mesh of four triangles that every other grows from.
    fn plant(&mut self, probe: &mut Listener<'_>) {
        let grid = *self.records.grid();
        let square = corners(grid.k());
        // The first page is always at hand.
        for (slot, at) in square.into_iter().enumerate() {
            probe.read(slot as u64);
            let vertex = self.records.decode(self.first_record(slot as u64), 0);
            self.corners[slot] = vertex;
            self.place_vertex(at, &vertex, Ring::new([Corner::NONE; 2], [slot as u32; 2]));
            self.patch.vertices.push((slot as u32, self.patch_vertex(at, &vertex, [slot as u32; 2])));
        }
        let centre_at = square[0].midpoint(square[2]);
        probe.read(CENTRE_SLOT);
        let raw = self.first_record(CENTRE_SLOT);
        let centre = self.nodes.create(CENTRE, raw);
        let level = level_of(centre_at);
        let vertex = self.records.decode(raw, level);
        // Its corners are told by the roots.
        let slot = self.place_vertex(centre_at, &vertex, Ring::new([Corner::NONE; 2], [0; 2]));
        let record = self.nodes.get_mut(centre);
        record.word = STATUS;
        record.become_split(slot, level);
        self.patch.vertices.push((slot, self.patch_vertex(centre_at, &vertex, [slot; 2])));
        for (side, [b, d]) in ROOTS {
            self.plant_root(root_label(side), [b as u32, d as u32]);
        }
        self.triangles = ROOTS.len();
    }
}

/// The centre's label for the root whose side has this slot in the file: W, S, E, N are 5 to 8.
fn root_label(side_slot: u64) -> usize {
    [2, 3, 0, 1][side_slot as usize - 5]
}

impl<S: RecordStore> Engine for Kinetic<S> {
    type Store = S;

    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64 {
        self.refine(view, &mut Listener::new(probe))
    }

    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle)) {
        self.for_each_slot(|_, corners| visit(corners.map(|v| self.vertices.point(v))));
    }

    fn work(&self) -> Work {
        self.work
    }

    fn store_mut(&mut self) -> &mut S {
        &mut self.records
    }

    fn ground_changed(&mut self, change: &GroundChange<'_>) {
        self.take_edit(change);
    }
}

#[cfg(test)]
mod tests;
