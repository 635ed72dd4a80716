//! Kinetic: refinement whose cost follows the change, not the mesh.
//!
//! The mesh of the frame before is kept. Every vertex in it has a live-range word, a certificate of how long its status holds
//! ([`certificate`]), and lies in a queue by the tick at which that ends ([`queue`], [`clocks`]). A frame takes the words that are over, tests their
//! vertices again and splits or merges those whose status has changed ([`tree`]); nothing else is looked at. Triangles and vertices
//! keep their slots ([`triangles`], [`vertices`]), so what changed is a short [`Patch`].
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART" (live ranges, the bin-tree array); P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made
//! Easy", IEEE Visualization 2001 (the mesh, which is SOAR's in every frame); J. Basch, L. Guibas, J. Hershberger, "Data Structures for Mobile Data",
//! SODA 1997 (certificates that fail one by one).
//!
//! One word a vertex serves both its triangles. That mesh and words agree needs no bookkeeping: errors and radii are saturated, so an active vertex's
//! parents are active in the same frame; splits go from coarse to fine, merges from fine to coarse. Where a word is late, because a
//! [`Budget`] ran out, its vertex stays as it is, and no vertex is split before its parents: the mesh conforms whatever is late.
//!
//! Cost: some ten nanoseconds a test, a hundred a split or merge, a hundred additions for the clocks. Allocates nothing once its arrays have grown.

mod budget;
mod capacity;
mod certificate;
mod clocks;
mod labels;
mod nodes;
mod pages;
mod patch;
mod queue;
mod rebuild;
mod tree;
mod vertices;

pub use budget::Budget;
pub use pages::Bounds;
pub use patch::{NO_LEVEL, Patch, PatchVertex};

use super::strip::StripBuilder;
use super::{Culling, Engine, Phase, Probe, Work};
use crate::mesh::{Triangle, is_drawn};
use crate::metric::{ALL_PLANES, Metric};
use crate::refine::soar::StripVertex;
use crate::view::View;
use budget::Allowance;
use capacity::settle;
use certificate::{ACTIVE, Judge, clock_of, expiry_of, with_certificate};
use clocks::{BANDS, Clocks, HORIZON, Kind, Pose, clock_id};
use glam::DVec3;
use labels::level_of;
use nodes::{CENTRE, Nodes, SPLIT, STATUS, body};
use pages::{Dealing, Pages};
use queue::{Entry, Queue};
use rayon::prelude::*;
use rebuild::Rebuild;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::order::{ROOTS, corners, slot_of};
use terrasoar_layout::prefetch::prefetch;
use terrasoar_layout::record::{RecordCodec, Vertex};
use terrasoar_layout::terrain::Records;
use vertices::Vertices;

/// From so many tests on they are shared among threads.
const PARALLEL: usize = 4096;
/// How many splits or merges ahead memory is asked for what: see [`Kinetic::fetch`].
const FETCH_AHEAD: [(u32, usize); 3] = [(2, 6), (1, 4), (0, 2)];
/// Levels of the largest terrain.
const LEVELS: usize = 32;

/// Refinement by certificates.
#[derive(Debug)]
pub struct Kinetic<'a, C: RecordCodec> {
    records: Records<'a, C>,
    culling: Culling,
    nodes: Nodes<C::Raw>,
    vertices: Vertices,
    /// Triangles in the mesh.
    triangles: usize,
    /// The page whose bounds are due to be made anew.
    stale: usize,
    clocks: Clocks,
    queue: Queue,
    rebuild: Rebuild,
    budget: Budget,
    /// Nodes whose certificate is over and that are in no queue.
    due: Vec<u32>,
    /// Those that the budget or their parents left for the next frame.
    late: Vec<u32>,
    /// Children made by splits, untested yet.
    fresh: Vec<u32>,
    /// Nodes to be split or merged, in order.
    list: Vec<u32>,
    to_split: [Vec<u32>; LEVELS],
    to_merge: [Vec<u32>; LEVELS],
    verdicts: Vec<(C::Raw, u32)>,
    /// Entries that are over, of words that may have changed since.
    over: Vec<Entry>,
    /// Entries on their way from one clock to another.
    waiting: Vec<Entry>,
    patch: Patch,
    work: Work,
}

impl<'a, C: RecordCodec> Kinetic<'a, C> {
    /// An engine over `records` that culls as `culling` says.
    pub fn new(records: Records<'a, C>, culling: Culling) -> Self {
        let grid = *records.grid();
        let [dx, dy] = grid.spacing_m();
        let [low, high] = records.height_range_m();
        let dealing = if culling == Culling::Clusters { Dealing::Near } else { Dealing::Packed };
        Self {
            culling,
            nodes: Nodes::new(Pages::new(dealing)),
            vertices: Vertices::default(),
            triangles: 0,
            stale: 0,
            clocks: Clocks::new(dx.min(dy), low.abs().max(high.abs())),
            queue: Queue::new(),
            rebuild: Rebuild::default(),
            budget: Budget::default(),
            due: Vec::new(),
            late: Vec::new(),
            fresh: Vec::new(),
            list: Vec::new(),
            to_split: Default::default(),
            to_merge: Default::default(),
            verdicts: Vec::new(),
            over: Vec::new(),
            waiting: Vec::new(),
            patch: Patch::default(),
            work: Work::default(),
            records,
        }
    }

    /// Bounds what a frame may do from now on. What it leaves undone stays coarse, conforming, and is told by [`Work::late`].
    pub fn set_budget(&mut self, budget: Budget) {
        self.budget = budget;
    }

    /// What the last update changed in the mesh.
    pub fn patch(&self) -> &Patch {
        &self.patch
    }

    /// The whole mesh as a patch to an empty one, for a GPU that has lost its copy. Reads the records of all vertices in the mesh.
    pub fn whole_patch(&self) -> Patch {
        let mut patch = Patch { draws: self.patch.draws.clone(), ..Default::default() };
        let mut in_use = vec![false; self.vertices.slots().len()];
        self.for_each_slot(|slot, corners| {
            corners.iter().for_each(|v| in_use[*v as usize] = true);
            patch.triangles.push((slot, self.shown(Some(corners))));
        });
        let grid = self.records.grid();
        let slot_at: std::collections::HashMap<GridPoint, u32> = (0..in_use.len() as u32)
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

    /// Bounds and triangle slots of the clusters of the mesh. Bounds are kept with [`Culling::Clusters`] only; without it they are empty.
    pub fn clusters(&self) -> impl Iterator<Item = (&Bounds, std::ops::Range<u32>)> {
        self.nodes.pages.clusters()
    }

    /// Triangles in the mesh, also those that are not drawn.
    pub fn triangle_count(&self) -> usize {
        self.triangles
    }

    /// Vertices under watch: those in the mesh and those that the next splits would add.
    pub fn node_count(&self) -> usize {
        self.nodes.pages.taken()
    }

    /// Bytes held by all arrays, spare capacity included.
    pub fn bytes(&self) -> usize {
        let lists = [&self.due, &self.late, &self.fresh, &self.list];
        let by_level = self.to_split.iter().chain(&self.to_merge);
        self.nodes.bytes()
            + self.vertices.bytes()
            + self.queue.bytes()
            + lists.into_iter().chain(by_level).map(|l| l.capacity() * size_of::<u32>()).sum::<usize>()
            + self.verdicts.capacity() * size_of::<(C::Raw, u32)>()
            + (self.over.capacity() + self.waiting.capacity()) * size_of::<Entry>()
            + self.patch.vertices.capacity() * size_of::<(u32, PatchVertex)>()
            + self.patch.triangles.capacity() * size_of::<(u32, [u32; 3])>()
            + self.patch.draws.capacity() * size_of::<std::ops::Range<u32>>()
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

    fn patch_vertex(&self, point: GridPoint, vertex: &Vertex, ends: [u32; 2]) -> PatchVertex {
        let folded = self.records.grid().fold(point);
        PatchVertex {
            x: folded.x(),
            y: folded.y(),
            height_m: vertex.height_m as f32,
            error_m: vertex.error_m as f32,
            radius_m: vertex.radius_m as f32,
            ends,
            flags: if self.records.grid().is_corner(point) { NO_LEVEL } else { level_of(point) },
        }
    }

    /// The vertex of a node, from the record it holds.
    #[inline(always)]
    fn vertex_of(&self, node: u32) -> Vertex {
        let node = self.nodes.get(node);
        self.records.decode(node.raw, level_of(node.point))
    }

    /// Calls `visit` with every triangle of the mesh and its slot.
    fn for_each_slot(&self, mut visit: impl FnMut(u32, [u32; 3])) {
        for node in (0..self.nodes.pages.len()).flat_map(|page| self.nodes.pages.places_of(page)) {
            for (side, corners) in self.nodes.triangles(node).into_iter().enumerate() {
                if let Some(corners) = corners {
                    visit(2 * node + side as u32, corners);
                }
            }
        }
    }

    /// What a slot sends to the GPU: nothing where voids touch or padding takes the area.
    #[inline(always)]
    fn shown(&self, corners: Option<[u32; 3]>) -> [u32; 3] {
        let partial = self.records.grid().has_padding() || self.records.has_voids();
        let drawn = |t: &[u32; 3]| !partial || is_drawn(&self.records, t.map(|v| self.vertices.point(v)));
        corners.filter(drawn).unwrap_or([0; 3])
    }

    /// Takes from the queue what is over, and brings clocks and courses in order.
    fn collect<P: Probe>(&mut self, pose: Pose, probe: &mut P) {
        let moved = self.clocks.move_to(pose);
        self.due.clear();
        // Late nodes may have gone since, or be another's by now, which then is in the queue.
        let is_late = |node: &u32| self.nodes.get(*node).word & !STATUS == 0;
        self.due.extend(self.late.drain(..).filter(is_late));
        let mut clocks = moved.clocks;
        while clocks != 0 {
            let clock = clocks.trailing_zeros() as usize;
            clocks &= clocks - 1;
            let over = &mut self.over;
            self.queue.advance(clock, self.clocks.now(clock), |entry| {
                prefetch(&self.nodes.all, entry.node as usize);
                over.push(entry);
            });
            if let Some(by) = self.clocks.set_back(clock) {
                self.move_words(clock, clock, |expiry| u64::from(expiry).saturating_sub(by) as u32);
            }
        }
        self.keep_true_entries();
        if let Some((number, course)) = moved.next_course {
            for kind in [Kind::Error, Kind::Planes] {
                for band in 0..BANDS {
                    let (from, to) = (clock_id(number, kind, band), clock_id(0, kind, band));
                    let (then, now) = (self.clocks.now(from) as u32, self.clocks.now(to) as u32);
                    // A tick less, for the two clocks' ticks begin at different points.
                    self.move_words(from, to, |expiry| now + expiry.saturating_sub(then + 1).min(HORIZON));
                }
            }
            self.clocks.take_course(number, course);
        }
        self.work.expired = self.due.len() as u64;
        probe.phase(Phase::Test);
    }

    /// Makes due those nodes whose word still is the one that was entered.
    fn keep_true_entries(&mut self) {
        for entry in self.over.drain(..) {
            let word = &mut self.nodes.get_mut(entry.node).word;
            if *word & !SPLIT == entry.word {
                *word &= STATUS;
                self.due.push(entry.node);
            }
        }
    }

    /// Gives all words on clock `from` an expiry on clock `to`.
    fn move_words(&mut self, from: usize, to: usize, expiry: impl Fn(u32) -> u32) {
        let mut waiting = std::mem::take(&mut self.waiting);
        let nodes = &mut self.nodes.all;
        self.queue.drain(from, |entry| {
            let word = &mut nodes[entry.node as usize].word;
            if *word & !SPLIT == entry.word {
                let moved = with_certificate(entry.word, to, expiry(expiry_of(entry.word)));
                *word = moved | (*word & SPLIT);
                waiting.push(Entry { node: entry.node, word: moved });
            }
        });
        self.queue.restart(from, self.clocks.now(from) as u32);
        for entry in waiting.drain(..) {
            self.queue.enter(to, entry);
        }
        self.waiting = waiting;
    }

    /// Tests nodes and sorts out those that are to be split or merged. Fresh ones have their records read first.
    fn test<P: Probe>(&mut self, fresh: bool, judge: &Judge, allowance: &mut Allowance, probe: &mut P) {
        let mut nodes = std::mem::take(if fresh { &mut self.fresh } else { &mut self.due });
        if !fresh {
            let allowed = allowance.tests(nodes.len());
            self.late.extend(nodes.drain(allowed..));
        }
        let k = self.records.grid().k();
        let mut verdicts = std::mem::take(&mut self.verdicts);
        let verdict = |node: &u32| {
            let node = self.nodes.get(*node);
            let point = node.point;
            let raw = if fresh { self.records.raw(slot_of(k, point)) } else { node.raw };
            let vertex = self.records.decode(raw, level_of(point));
            (raw, judge.word(&judge.metric().sight(self.records.grid().position_m(point), &vertex)))
        };
        if nodes.len() >= PARALLEL && rayon::current_num_threads() > 1 {
            nodes.par_iter().with_min_len(PARALLEL / 8).map(verdict).collect_into_vec(&mut verdicts);
        } else {
            verdicts.clear();
            verdicts.extend(nodes.iter().map(verdict));
        }
        self.work.tests += nodes.len() as u64;
        for (node, (raw, word)) in nodes.iter().zip(&verdicts) {
            let record = self.nodes.get_mut(*node);
            let (old, point) = (record.word, record.point);
            if fresh {
                probe.read(slot_of(k, point));
                record.raw = *raw;
            } else if expiry_of(old) != 0 {
                // Twice in the list: it had been late, then gone, then come back.
                continue;
            }
            record.word = *word | (old & SPLIT);
            self.queue.enter(clock_of(*word), Entry { node: *node, word: *word });
            match (*word & ACTIVE != 0, old & SPLIT != 0) {
                (true, false) => self.to_split[level_of(point) as usize].push(*node),
                (false, true) => self.to_merge[level_of(point) as usize].push(*node),
                _ => {}
            }
        }
        self.verdicts = verdicts;
        nodes.clear();
        *(if fresh { &mut self.fresh } else { &mut self.due }) = nodes;
    }

    /// Splits and merges what is to be, until no child made on the way is left untested.
    fn apply<P: Probe>(&mut self, judge: &Judge, allowance: &mut Allowance, probe: &mut P) {
        let mut list = std::mem::take(&mut self.list);
        // From fine to coarse, so that children have merged before their parents.
        list.extend(self.to_merge.iter_mut().flat_map(|nodes| nodes.drain(..)));
        self.in_order(&list, |engine, node| {
            if engine.nodes.is_live(node) && engine.nodes.get(node).word & STATUS == SPLIT {
                engine.merge(node);
            }
        });
        loop {
            list.clear();
            // From coarse to fine, so that parents have split before their children.
            list.extend(self.to_split.iter_mut().rev().flat_map(|nodes| nodes.drain(..)));
            self.in_order(&list, |engine, node| {
                let wanted = engine.nodes.is_live(node) && engine.nodes.get(node).word & STATUS == ACTIVE;
                if wanted && !(allowance.split() && engine.split(node)) {
                    // Its other parent may be among the untested.
                    let level = level_of(engine.nodes.get(node).point);
                    engine.to_split[level as usize].push(node);
                }
            });
            if self.fresh.is_empty() {
                break;
            }
            probe.phase(Phase::Test);
            self.test(true, judge, allowance, probe);
            probe.phase(Phase::Apply);
        }
        self.postpone();
        list.clear();
        self.list = list;
    }

    /// Does something to each node, and asks memory for what comes after it meanwhile.
    #[inline(always)]
    fn in_order(&mut self, nodes: &[u32], mut each: impl FnMut(&mut Self, u32)) {
        for (i, node) in nodes.iter().enumerate() {
            for (ahead, distance) in FETCH_AHEAD {
                if let Some(later) = nodes.get(i + distance) {
                    self.fetch(*later, ahead);
                }
            }
            each(self, *node);
        }
    }

    /// Leaves the splits that could not be made to the next frame.
    fn postpone(&mut self) {
        for nodes in &mut self.to_split {
            for node in nodes.drain(..) {
                self.nodes.get_mut(node).word &= STATUS;
                self.late.push(node);
            }
        }
    }

    /// Counts what is late and how far the largest error of it exceeds the tolerance.
    fn assess_late(&mut self, metric: &Metric, view: &View) {
        self.work.late = self.late.len() as u64;
        for node in &self.late {
            let vertex = self.vertex_of(*node);
            let at_m = self.records.grid().position_m(self.nodes.get(*node).point);
            let sighting = metric.sight(at_m, &vertex);
            let culled = self.culling == Culling::Vertices && metric.cull(&sighting, ALL_PLANES).is_none();
            if !self.nodes.is_split(*node) && sighting.is_selected() && !culled {
                let error_px = sighting.error_px(view.tolerance_px);
                self.work.late_error_px = self.work.late_error_px.max(error_px);
            }
        }
    }

    /// Lists the slots that show something else than in the frame before.
    fn list_written(&mut self) {
        let mut written = std::mem::take(&mut self.patch.triangles);
        let mut pages = std::mem::replace(&mut self.nodes.pages, Pages::new(Dealing::Packed));
        pages.take_written(|node, side| {
            written.push((2 * node + side as u32, self.shown(self.nodes.triangles(node)[side])));
        });
        self.nodes.pages = pages;
        self.patch.triangles = written;
    }

    /// Lists what there is to draw: all slots, or those of the clusters that the view's planes do not cull.
    fn list_draws(&mut self, metric: &Metric) {
        if self.culling == Culling::Vertices {
            self.patch.draws.push(0..2 * self.nodes.pages.places() as u32);
            return;
        }
        self.stale = (self.stale + 1) % self.nodes.pages.len();
        self.tighten(self.stale);
        let [dx, dy] = self.records.grid().spacing_m();
        let draws = &mut self.patch.draws;
        for (bounds, range) in self.nodes.pages.clusters() {
            if !metric.culls_box(bounds.least, bounds.largest, [dx, dy]) {
                draws.push(range);
            }
        }
    }

    /// Gives back what only a large frame before this one has needed.
    fn settle(&mut self) {
        // A frame that made most of the mesh says nothing about the next ones.
        let made_anew = self.work.tests as usize > self.nodes.pages.taken() / 2;
        let used = if made_anew { 0 } else { (self.work.tests + self.work.slots_written) as usize };
        let lists = [&mut self.due, &mut self.late, &mut self.fresh, &mut self.list];
        lists
            .into_iter()
            .chain(&mut self.to_split)
            .chain(&mut self.to_merge)
            .for_each(|list| settle(list, used));
        [&mut self.over, &mut self.waiting].into_iter().for_each(|list| settle(list, used));
        settle(&mut self.verdicts, used);
        settle(&mut self.patch.vertices, used);
        settle(&mut self.patch.triangles, used);
    }

    /// Makes the mesh of four triangles that every other grows from.
    fn plant<P: Probe>(&mut self, probe: &mut P) {
        let grid = *self.records.grid();
        let square = corners(grid.k());
        for (slot, at) in square.into_iter().enumerate() {
            probe.read(slot as u64);
            let vertex = self.records.vertex_at(at);
            self.vertices.place(at, vertex.height_m);
            self.patch.vertices.push((slot as u32, self.patch_vertex(at, &vertex, [slot as u32; 2])));
        }
        let centre_at = square[0].midpoint(square[2]);
        let centre_slot = slot_of(grid.k(), centre_at);
        probe.read(centre_slot);
        let raw = self.records.raw(centre_slot);
        let centre = self.nodes.create(CENTRE, centre_at, raw);
        self.nodes.get_mut(centre).word = STATUS;
        let vertex = self.vertex_of(centre);
        let slot = self.vertices.place(centre_at, vertex.height_m);
        self.patch.vertices.push((slot, self.patch_vertex(centre_at, &vertex, [slot; 2])));
        self.nodes.get_mut(centre).body[body::HERE] = slot;
        for (side, [b, d]) in ROOTS {
            self.plant_root(root_label(side), [slot, b as u32, d as u32]);
        }
        self.triangles = ROOTS.len();
    }
}

/// The centre's label for the root whose side has this slot in the file: W, S, E, N are 5 to 8.
fn root_label(side_slot: u64) -> usize {
    [2, 3, 0, 1][side_slot as usize - 5]
}

impl<C: RecordCodec> Engine for Kinetic<'_, C> {
    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64 {
        let metric = Metric::new(view);
        let pose = Pose {
            eye_m: view.eye_m,
            axes: view.axes(),
            normals: metric.normals().map(DVec3::from_array),
            nu: metric.nu(),
            exaggeration: metric.exaggeration(),
        };
        self.work = Work::default();
        self.patch.clear();
        probe.phase(Phase::Scan);
        if self.nodes.is_empty() {
            self.plant(probe);
        }
        self.collect(pose, probe);
        let judge = Judge::new(metric, &self.clocks, self.culling == Culling::Vertices);
        let mut allowance = Allowance::new(self.budget);
        if !self.fresh.is_empty() {
            self.test(true, &judge, &mut allowance, probe);
        }
        self.test(false, &judge, &mut allowance, probe);
        probe.phase(Phase::Apply);
        self.apply(&judge, &mut allowance, probe);
        self.step_rebuild();
        if !self.late.is_empty() {
            self.assess_late(&metric, view);
        }
        self.list_written();
        self.list_draws(&metric);
        self.work.slots_written = self.patch.triangles.len() as u64;
        self.work.patch_bytes = self.patch.bytes();
        self.settle();
        probe.phase(Phase::Done);
        self.work.tests
    }

    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle)) {
        self.for_each_slot(|_, corners| visit(corners.map(|v| self.vertices.point(v))));
    }

    fn work(&self) -> Work {
        self.work
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
