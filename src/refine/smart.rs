//! SMART: walk the bin-tree array depth-first and test a vertex only when its live range is over.
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART: An Efficient Technique for Massive Terrain Visualization from Out-of-core". A node is
//! a triangle whose split vertex has been tested; its 4-byte word holds the vertex's status and when it expires. The vertex array has
//! an entry for every node, at the same index plus `FIRST_NODE_VERTEX`. When the array has doubled it is rebuilt in depth-first order.
//!
//! Three differences from the paper are needed to draw SOAR's mesh in every frame: the clock (`super::clock`); a vertex must be selected
//! *and* not culled, so its status holds for |min(d_tau, d_c)|, not min(|d_tau|, |d_c|) (eq. 10); a word says whether it depends on the
//! view's planes (then a rotation re-evaluates it, as in the paper) or on an ancestor that is wholly inside them (then it is re-evaluated once
//! no ancestor is).
//!
//! Cost: an integer comparison for each of 2T - 1 nodes a frame, a record read and a test for those that expired. Allocates nothing
//! once its arrays have grown.

use super::change::{Areas, GroundChange};
use super::clock::{EXPIRY_MASK, PathClock};
use super::soar::StripVertex;
use super::strip::{Strip, StripBuilder};
use super::{Culling, Engine, Probe};
use crate::mesh::{Triangle, for_each_in_strip};
use crate::metric::Metric;
use crate::view::View;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, corners, slot_of};
use terrasoar_layout::read::store::{CompleteStore, RecordStore};

/// Status bit: the vertex is selected and not culled.
const ACTIVE: u32 = 1 << 31;
/// Status bit: the range rests on the vertex's own distance from the view's planes; rotation ends it.
const OWN_PLANES: u32 = 1 << 30;
/// Status bit: the sphere is wholly inside all planes. Without [`OWN_PLANES`] an ancestor vouches for it.
const INSIDE: u32 = 1 << 29;
/// Status bit: the node has children in the array.
const SPLIT: u32 = 1 << 28;

/// Vertex array entries before those of nodes: the four corners and the centre.
const FIRST_NODE_VERTEX: usize = 5;
/// The array is not rebuilt below this many nodes.
const LEAST_CAPACITY: usize = 4096;
/// No children: index 0 is a root's and never a child's.
const NONE: u32 = 0;

/// The bin-tree array and the vertex array beside it.
#[derive(Debug, Default)]
struct NodeArray {
    /// Live-range words.
    words: Vec<u32>,
    /// Index of a node's first child, the second follows it; [`NONE`] if it is not split.
    children: Vec<u32>,
    /// Split vertices of the nodes, after the corners and the centre.
    vertices: Vec<StripVertex>,
}

impl NodeArray {
    fn clear(&mut self) {
        self.words.clear();
        self.children.clear();
        self.vertices.truncate(FIRST_NODE_VERTEX);
    }

    /// Appends nodes that are yet to be tested; returns the first one's index.
    fn push_untested(&mut self, count: usize) -> u32 {
        let first = self.words.len();
        self.words.resize(first + count, 0);
        self.children.resize(first + count, NONE);
        let blank = StripVertex { x: 0, y: 0, height_m: 0.0 };
        self.vertices.resize(FIRST_NODE_VERTEX + first + count, blank);
        first as u32
    }

    /// Copies the node `from` of `old` and all below it to `to`, depth-first.
    fn copy_tree(&mut self, old: &Self, from: u32, to: u32) {
        let (f, t) = (from as usize, to as usize);
        self.words[t] = old.words[f];
        self.vertices[FIRST_NODE_VERTEX + t] = old.vertices[FIRST_NODE_VERTEX + f];
        let children = old.children[f];
        if children != NONE {
            let pair = self.push_untested(2);
            self.children[t] = pair;
            self.copy_tree(old, children, pair);
            self.copy_tree(old, children + 1, pair + 1);
        }
    }
}

/// Refinement by live ranges.
#[derive(Debug)]
pub struct Smart<S: RecordStore> {
    records: S,
    culling: Culling,
    nodes: NodeArray,
    /// Where the next rebuild copies to.
    spare: NodeArray,
    capacity: usize,
    clock: PathClock,
    last: Option<Metric>,
    areas: Areas,
    /// Indices into the vertex array.
    strip: Strip<u32>,
}

impl<S: CompleteStore> Smart<S> {
    /// An engine over `records`, all of which are at hand, that culls as `culling` says, with nothing tested yet.
    pub fn new(records: S, culling: Culling) -> Self {
        let grid = *records.grid();
        let c = corners(grid.k());
        let centre = (c[0].midpoint(c[2]), records.vertex(CENTRE_SLOT, grid.levels() - 1));
        let vertices: Vec<StripVertex> = (0..4)
            .map(|i| (c[i], records.vertex(i as u64, 0)))
            .chain([centre])
            .map(|(p, v)| StripVertex { x: p.x(), y: p.y(), height_m: v.height_m as f32 })
            .collect();
        let tick_m = grid.spacing_m()[0].min(grid.spacing_m()[1]) / 64.0;
        let mut nodes = NodeArray { vertices: vertices.clone(), ..Default::default() };
        nodes.push_untested(ROOTS.len());
        Self {
            culling,
            nodes,
            spare: NodeArray { vertices, ..Default::default() },
            capacity: LEAST_CAPACITY,
            clock: PathClock::new(tick_m),
            last: None,
            areas: Areas::default(),
            strip: Strip::default(),
            records,
        }
    }

    /// The vertex array. Entries of nodes that are no longer in the tree are stale.
    pub fn vertices(&self) -> &[StripVertex] {
        &self.nodes.vertices
    }

    /// The strip of the last update, as indices into [`Smart::vertices`].
    pub fn strip(&self) -> &[u32] {
        self.strip.as_slice()
    }

    /// Copies what is in the tree, depth-first, into the spare array.
    fn rebuild(&mut self) {
        self.spare.clear();
        self.spare.push_untested(ROOTS.len());
        for root in 0..ROOTS.len() as u32 {
            self.spare.copy_tree(&self.nodes, root, root);
        }
        std::mem::swap(&mut self.nodes, &mut self.spare);
        self.capacity = (2 * self.nodes.words.len()).max(LEAST_CAPACITY);
    }
}

/// A vertex of the walk: its place in the vertex array and on the grid.
#[derive(Clone, Copy)]
struct Apex {
    index: u32,
    at: GridPoint,
}

/// One frame's walk.
struct Walk<'w, S: RecordStore, P> {
    records: &'w S,
    nodes: &'w mut NodeArray,
    clock: &'w PathClock,
    metric: Metric,
    now: u32,
    rotated: bool,
    strip: StripBuilder<u32>,
    tests: u64,
    probe: &'w mut P,
}

impl<S: RecordStore, P: Probe> Walk<'_, S, P> {
    /// Visits the triangle (apex; b, d) of `node`. Inlined, so that only triangles that are split cost a call.
    #[inline(always)]
    fn visit(&mut self, height: u32, node: u32, apex: Apex, b: GridPoint, d: GridPoint, inside: bool) {
        let at = node as usize;
        let word = self.status(at, height, b, d, inside);
        if word & ACTIVE != 0 {
            self.split(height, node, apex, b, d, inside || word & INSIDE != 0);
            return;
        }
        if word & SPLIT != 0 {
            self.nodes.children[at] = NONE;
            self.nodes.words[at] = word & !SPLIT;
        }
        self.append(apex, height & 1);
    }

    /// Visits the two children of the triangle (apex; b, d) of `node`.
    fn split(&mut self, height: u32, node: u32, apex: Apex, b: GridPoint, d: GridPoint, inside: bool) {
        let at = node as usize;
        let here = Apex { index: (FIRST_NODE_VERTEX + at) as u32, at: b.midpoint(d) };
        if height == 1 {
            // The smallest triangles have no vertex of their own and no node.
            self.append(here, 0);
            self.append(apex, 1);
            self.append(here, 0);
            return;
        }
        let mut children = self.nodes.children[at];
        if children == NONE {
            children = self.nodes.push_untested(2);
            self.nodes.children[at] = children;
            self.nodes.words[at] |= SPLIT;
        }
        self.visit(height - 1, children, here, b, apex.at, inside);
        self.append(apex, height & 1);
        self.visit(height - 1, children + 1, here, apex.at, d, inside);
    }

    /// The word of a node, tested again if it must be.
    #[inline(always)]
    fn status(&mut self, node: usize, height: u32, b: GridPoint, d: GridPoint, inside: bool) -> u32 {
        let word = self.nodes.words[node];
        let alive = self.now < word & EXPIRY_MASK;
        if inside {
            // An ancestor answers the question of culling; a vertex that rested on itself rests on the ancestor from now on.
            if alive && word & (ACTIVE | OWN_PLANES) != OWN_PLANES {
                if word & (ACTIVE | OWN_PLANES) == ACTIVE | OWN_PLANES {
                    self.nodes.words[node] = (word & !OWN_PLANES) | INSIDE;
                }
                return word;
            }
        } else {
            let own_planes_turned = word & OWN_PLANES != 0 && self.rotated;
            let deserted = word & (INSIDE | OWN_PLANES) == INSIDE;
            if alive && !own_planes_turned && !deserted {
                return word;
            }
        }
        self.test(node, height, b.midpoint(d), inside)
    }

    #[inline(never)]
    fn test(&mut self, node: usize, height: u32, v: GridPoint, inside: bool) -> u32 {
        self.tests += 1;
        let grid = self.records.grid();
        let slot = slot_of(grid.k(), v);
        self.probe.read(slot);
        let vertex = self.records.vertex(slot, height - 1);
        let sighting = self.metric.sight(grid.position_m(v), &vertex);
        let guard_m = sighting.guard_m();
        let margin_m = sighting.margin_m();
        let radius_m = sighting.radius_m();
        let (bits, safe_m) = if inside {
            if sighting.is_selected() { (ACTIVE | INSIDE, margin_m) } else { (0, -margin_m) }
        } else {
            let outermost_m = self.metric.outermost(&sighting);
            match (sighting.is_selected(), outermost_m > radius_m) {
                (true, false) if outermost_m < -radius_m => {
                    (ACTIVE | INSIDE | OWN_PLANES, margin_m.min(-radius_m - outermost_m))
                }
                (true, false) => (ACTIVE | OWN_PLANES, margin_m.min(radius_m - outermost_m)),
                (true, true) => (OWN_PLANES, outermost_m - radius_m),
                // Either reason suffices; while turning only the first outlasts the frame.
                (false, true) if !self.rotated && outermost_m - radius_m > -margin_m => {
                    (OWN_PLANES, outermost_m - radius_m)
                }
                (false, _) => (0, -margin_m),
            }
        };
        let word = bits | (self.nodes.words[node] & SPLIT) | self.clock.expiry(safe_m - guard_m);
        self.nodes.words[node] = word;
        self.nodes.vertices[FIRST_NODE_VERTEX + node] =
            StripVertex { x: v.x(), y: v.y(), height_m: vertex.height_m as f32 };
        word
    }

    /// Continues the strip to `apex`.
    #[inline(always)]
    fn append(&mut self, apex: Apex, parity: u32) {
        self.strip.append(apex.at, parity, apex.index);
    }
}

/// Ends the live ranges of all nodes that an edit can concern.
struct Expiry<'e> {
    nodes: &'e mut NodeArray,
    areas: &'e Areas,
}

impl Expiry<'_> {
    /// Visits the triangle (apex; b, d) of `node`.
    fn visit(&mut self, level: u32, node: u32, [apex, b, d]: Triangle) {
        let v = b.midpoint(d);
        if !self.areas.concern(v, level) {
            return;
        }
        let word = &mut self.nodes.words[node as usize];
        let is_split = *word & SPLIT != 0;
        *word &= SPLIT;
        let children = self.nodes.children[node as usize];
        if is_split && children != NONE {
            self.visit(level - 1, children, [v, b, apex]);
            self.visit(level - 1, children + 1, [v, apex, d]);
        }
    }
}

impl<S: CompleteStore> Engine for Smart<S> {
    type Store = S;

    fn store_mut(&mut self) -> &mut S {
        &mut self.records
    }

    fn ground_changed(&mut self, change: &GroundChange<'_>) {
        let grid = *self.records.grid();
        let c = corners(grid.k());
        let heights = (0..4).map(|i| (i, 0)).chain([(CENTRE_SLOT, grid.levels() - 1)]);
        for (i, (slot, level)) in heights.enumerate() {
            let height_m = self.records.vertex(slot, level).height_m as f32;
            self.nodes.vertices[i].height_m = height_m;
            self.spare.vertices[i].height_m = height_m;
        }
        self.areas.start(&grid, change);
        let mut expiry = Expiry { nodes: &mut self.nodes, areas: &self.areas };
        for (root, (_, [b, d])) in ROOTS.into_iter().enumerate() {
            expiry.visit(grid.levels() - 2, root as u32, [c[0].midpoint(c[2]), c[b], c[d]]);
        }
    }

    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64 {
        let grid = *self.records.grid();
        let metric = Metric::new(view);
        let rotated = self.last.is_none_or(|last| last.normals() != metric.normals());
        // A change of nu or of exaggeration scales every margin by its own error, and another measure makes other margins: no word outlives it.
        let scale = |m: &Metric| (m.nu(), m.exaggeration(), m.kind());
        if self.last.is_some_and(|last| scale(&last) != scale(&metric)) {
            self.nodes.words.iter_mut().for_each(|word| *word &= SPLIT);
        }
        self.last = Some(metric);
        self.clock.move_to(metric.eye_m());
        if self.clock.needs_sweep() {
            self.clock.sweep(&mut self.nodes.words);
        }
        if self.nodes.words.len() > self.capacity {
            self.rebuild();
        }
        let c = corners(grid.k());
        let mut walk = Walk {
            records: &self.records,
            nodes: &mut self.nodes,
            clock: &self.clock,
            metric,
            now: self.clock.now() as u32,
            rotated,
            strip: self.strip.start(c[0], 0),
            tests: 0,
            probe,
        };
        let centre = Apex { index: 4, at: c[0].midpoint(c[2]) };
        let height = grid.levels() - 1;
        for (root, (_, [b, d])) in ROOTS.into_iter().enumerate() {
            // Where nothing is culled, all lies inside.
            let inside = self.culling == Culling::Clusters;
            walk.visit(height, root as u32, centre, c[b], c[d], inside);
            if root < 3 {
                walk.append(Apex { index: root as u32 + 1, at: c[root + 1] }, 0);
            }
        }
        let tests = walk.tests;
        walk.strip.finish(0, &mut self.strip);
        tests
    }

    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle)) {
        let point = |i: &u32| {
            let v = &self.nodes.vertices[*i as usize];
            GridPoint::new(v.x, v.y)
        };
        for_each_in_strip(self.strip().iter().map(point), visit);
    }
}
