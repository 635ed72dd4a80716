//! SOAR: visit the active tree top-down every frame, test each triangle's split vertex, emit one triangle strip.
//!
//! Based on: P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made Easy", IEEE Visualization 2001, and "Terrain
//! Simplification Simplified", IEEE TVCG 8(3), 2002: nested spheres, inherited culling flags, strips by parity, slots by index arithmetic.
//!
//! Cost: 2T - 1 nodes for T triangles, a record read and a test each. Allocates nothing once the strip has grown.

use super::change::GroundChange;
use super::strip::StripBuilder;
use super::{Culling, Engine, Probe};
use crate::mesh::{Triangle, for_each_in_strip};
use crate::metric::{ALL_PLANES, Metric};
use crate::view::View;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, child_slots, corners};
use terrasoar_layout::read::store::{CompleteStore, RecordStore};

/// A vertex of the strip: 12 bytes, ready to be uploaded.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct StripVertex {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Height in metres.
    pub height_m: f32,
}

impl StripVertex {
    fn new(p: GridPoint, height_m: f64) -> Self {
        Self { x: p.x(), y: p.y(), height_m: height_m as f32 }
    }
}

/// Full refinement every frame.
#[derive(Debug)]
pub struct Soar<S: RecordStore> {
    records: S,
    culling: Culling,
    strip: Vec<StripVertex>,
}

impl<S: CompleteStore> Soar<S> {
    /// An engine over `records`, all of which are at hand, that culls as `culling` says.
    ///
    /// A pool, of which pages may be away, is refused by the compiler: SOAR would take what is away for ground without detail.
    ///
    /// ```compile_fail,E0277
    /// # use terrasoar::refine::{Culling, soar::Soar};
    /// # use terrasoar_layout::{grid::record::Compact, read::pool::PagePool};
    /// fn wrong(pool: PagePool<Compact>) -> Soar<PagePool<Compact>> {
    ///     Soar::new(pool, Culling::Vertices)
    /// }
    /// ```
    pub fn new(records: S, culling: Culling) -> Self {
        Self { records, culling, strip: Vec::new() }
    }

    /// The strip of the last update. Consecutive triples are triangles; repeated vertices turn it.
    pub fn strip(&self) -> &[StripVertex] {
        &self.strip
    }
}

/// A vertex that the walk has tested: where it lies in the file, on the grid and in height.
#[derive(Clone, Copy)]
struct Apex {
    slot: u64,
    at: GridPoint,
    height_m: f64,
}

/// One frame's walk.
struct Walk<'w, S: RecordStore, P> {
    records: &'w S,
    metric: Metric,
    strip: StripBuilder<'w, StripVertex>,
    tests: u64,
    probe: &'w mut P,
}

impl<S: RecordStore, P: Probe> Walk<'_, S, P> {
    /// Visits the triangle (apex; b, d) whose split vertex has slot `split` and level `height - 1`; `planes` are those its ancestors cross.
    /// Inlined, so that only triangles that are split cost a call.
    #[inline(always)]
    fn visit(&mut self, height: u32, apex: Apex, split: u64, b: GridPoint, d: GridPoint, planes: u8) {
        let v = b.midpoint(d);
        let vertex = self.records.vertex(split, height - 1);
        self.probe.read(split);
        self.tests += 1;
        let sighting = self.metric.sight(self.records.grid().position_m(v), &vertex);
        let planes = match planes {
            _ if !sighting.is_selected() => None,
            0 => Some(0),
            crossing => self.metric.cull(&sighting, crossing),
        };
        match planes {
            Some(planes) => {
                let here = Apex { slot: split, at: v, height_m: vertex.height_m };
                self.split(height, apex, here, b, d, planes);
            }
            None => self.append(apex, height & 1),
        }
    }

    /// Visits the two children of the triangle (apex; b, d), split at `here`.
    fn split(&mut self, height: u32, apex: Apex, here: Apex, b: GridPoint, d: GridPoint, planes: u8) {
        if height == 1 {
            // The smallest triangles have no vertex to split at.
            self.append(here, 0);
            self.append(apex, 1);
            self.append(here, 0);
            return;
        }
        let [left, right] = child_slots(apex.slot, here.slot);
        self.visit(height - 1, here, left, b, apex.at, planes);
        self.append(apex, height & 1);
        self.visit(height - 1, here, right, apex.at, d, planes);
    }

    /// Continues the strip to `apex`.
    #[inline(always)]
    fn append(&mut self, apex: Apex, parity: u32) {
        self.strip.append(apex.at, parity, StripVertex::new(apex.at, apex.height_m));
    }
}

impl<S: CompleteStore> Engine for Soar<S> {
    type Store = S;

    fn store_mut(&mut self) -> &mut S {
        &mut self.records
    }

    /// Nothing is kept from frame to frame.
    fn ground_changed(&mut self, _: &GroundChange<'_>) {}

    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64 {
        let grid = *self.records.grid();
        let c = corners(grid.k());
        let corner =
            |i: usize| Apex { slot: i as u64, at: c[i], height_m: self.records.vertex(i as u64, 0).height_m };
        let [sw, se, ne, nw] = [0, 1, 2, 3].map(corner);
        let centre_at = c[0].midpoint(c[2]);
        let centre = Apex {
            slot: CENTRE_SLOT,
            at: centre_at,
            height_m: self.records.vertex(CENTRE_SLOT, grid.levels() - 1).height_m,
        };
        (0..=CENTRE_SLOT).for_each(|slot| probe.read(slot));
        let mut walk = Walk {
            records: &self.records,
            metric: Metric::new(view),
            strip: StripBuilder::start(&mut self.strip, sw.at, StripVertex::new(sw.at, sw.height_m)),
            tests: 0,
            probe,
        };
        let height = grid.levels() - 1;
        let planes = if self.culling == Culling::Vertices { ALL_PLANES } else { 0 };
        for ((split, [b, d]), next) in ROOTS.into_iter().zip([Some(se), Some(ne), Some(nw), None]) {
            walk.visit(height, centre, split, c[b], c[d], planes);
            if let Some(next) = next {
                walk.append(next, 0);
            }
        }
        let tests = walk.tests;
        self.strip.push(StripVertex::new(sw.at, sw.height_m));
        tests
    }

    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle)) {
        for_each_in_strip(self.strip.iter().map(|v| GridPoint::new(v.x, v.y)), visit);
    }
}
