//! SOAR: visit the active tree top-down every frame, test each triangle's split vertex, emit one triangle strip.
//!
//! Based on: P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made Easy", IEEE Visualization 2001, and "Terrain
//! Simplification Simplified", IEEE TVCG 8(3), 2002: nested spheres, inherited culling flags, strips by parity, slots by index arithmetic.
//!
//! Where a store has bounds of errors, a vertex that is certain not to show is left unread (`Foresight`): the mesh is the same.
//!
//! Cost: 2T - 1 nodes for T triangles, a record read and a test each. Allocates nothing once the strip has grown.

use super::change::GroundChange;
use super::listener::Listener;
use super::strip::{Strip, StripBuilder};
use super::{Culling, Engine, Probe};
use crate::mesh::{Triangle, for_each_in_strip};
use crate::metric::pair::{PairMetric, SightedPair};
use crate::metric::{ALL_PLANES, Metric};
use crate::view::{ErrorMetric, View};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, child_slots, corners};
use terrasoar_layout::grid::record::{RecordCodec, Vertex};
use terrasoar_layout::read::store::{CompleteStore, RawOf, RecordStore};

/// A vertex of the strip: 12 bytes, ready to be uploaded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C)]
pub struct StripVertex {
    /// Column.
    pub x: u32,
    /// Row.
    pub y: u32,
    /// Height in metres.
    pub height_m: f32,
}

/// Full refinement every frame.
#[derive(Debug)]
pub struct Soar<S: RecordStore> {
    records: S,
    culling: Culling,
    strip: Strip<StripVertex>,
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
        Self { records, culling, strip: Strip::default() }
    }

    /// The strip of the last update. Consecutive triples are triangles; repeated vertices turn it.
    pub fn strip(&self) -> &[StripVertex] {
        self.strip.as_slice()
    }

    /// Refines for a view whose errors are measured along the line of sight, or not.
    #[inline(always)]
    fn refine<const HEARD: bool, const SIGHT: bool>(&mut self, view: &View, probe: Listener<'_>) -> u64 {
        // Next to voids what is drawn depends on records of vertices that do not show.
        if self.records.has_bounds() && !self.records.shape().has_voids {
            self.refine_with::<HEARD, Parent, SIGHT>(view, probe)
        } else {
            self.refine_with::<HEARD, (), SIGHT>(view, probe)
        }
    }

    fn refine_with<const HEARD: bool, F: Foresight, const SIGHT: bool>(
        &mut self,
        view: &View,
        mut probe: Listener<'_>,
    ) -> u64 {
        let grid = *self.records.grid();
        let c = corners(grid.k());
        let read = |slot: u64, level: u32, at: GridPoint| {
            let vertex = self.records.vertex(slot, level);
            (Apex { slot, at, height_m: vertex.height_m as f32 }, vertex)
        };
        let [sw, se, ne, nw] = [0, 1, 2, 3].map(|i| read(i as u64, 0, c[i]).0);
        let height = grid.levels() - 1;
        let (centre, _) = read(CENTRE_SLOT, height, c[0].midpoint(c[2]));
        (0..=CENTRE_SLOT).for_each(|slot| probe.read(slot));
        let first = StripVertex { x: sw.at.x(), y: sw.at.y(), height_m: sw.height_m };
        let plain = Metric::new(view);
        let mut walk = Walk::<'_, '_, S, HEARD, SIGHT> {
            records: &self.records,
            metric: PairMetric::<SIGHT>::new(&plain, &grid),
            plain,
            strip: self.strip.start(sw.at, first),
            tests: 0,
            probe,
        };
        for ((slot, [b, d]), next) in ROOTS.into_iter().zip([Some(se), Some(ne), Some(nw), None]) {
            let base = [c[b], c[d]];
            let (split, vertex) = read(slot, height - 1, base[0].midpoint(base[1]));
            walk.hear(slot);
            walk.tests += 1;
            let pair = walk.metric.sight([split.at; 2], &[vertex; 2]);
            match self.culling {
                Culling::Vertices => {
                    walk.visit::<F, true>(height, centre, split, (0, &pair, &[vertex; 2]), base, ALL_PLANES)
                }
                Culling::Clusters => {
                    walk.visit::<F, false>(height, centre, split, (0, &pair, &[vertex; 2]), base, 0);
                }
            }
            if let Some(next) = next {
                walk.append(next, 0);
            }
        }
        let tests = walk.tests;
        walk.strip.finish(first, &mut self.strip);
        tests
    }
}

/// A vertex that the walk has tested: where it lies in the file, on the grid and in height.
#[derive(Clone, Copy)]
struct Apex {
    slot: u64,
    at: GridPoint,
    height_m: f32,
}

/// What is kept of a vertex that is split, to foresee its children.
trait Foresight: Copy {
    /// Whether anything is foreseen.
    const FORESEES: bool;

    fn of(at: GridPoint, vertex: &Vertex) -> Self;

    /// Whether the record of the child at `p` is to be read. `planes` are those that the parent crosses.
    fn is_read<S: RecordStore>(
        self,
        records: &S,
        metric: &Metric,
        slot: u64,
        p: GridPoint,
        planes: u8,
    ) -> bool;
}

/// Nothing: all is read.
impl Foresight for () {
    const FORESEES: bool = false;

    #[inline(always)]
    fn of(_: GridPoint, _: &Vertex) -> Self {}

    #[inline(always)]
    fn is_read<S: RecordStore>(self, _: &S, _: &Metric, _: u64, _: GridPoint, _: u8) -> bool {
        true
    }
}

/// The vertex itself.
#[derive(Clone, Copy)]
struct Parent {
    at: GridPoint,
    vertex: Vertex,
}

impl Foresight for Parent {
    const FORESEES: bool = true;

    fn of(at: GridPoint, vertex: &Vertex) -> Self {
        Self { at, vertex: *vertex }
    }

    fn is_read<S: RecordStore>(
        self,
        records: &S,
        metric: &Metric,
        slot: u64,
        p: GridPoint,
        planes: u8,
    ) -> bool {
        let bound_m = records.error_bound_m(slot, p);
        let parent = Vertex { error_m: self.vertex.error_m.min(bound_m), ..self.vertex };
        let [at_m, parent_m] = [p, self.at].map(|p| records.grid().position_m(p));
        metric.may_show(at_m, parent_m, &parent, planes)
    }
}

/// One frame's walk.
struct Walk<'w, 'p, S: RecordStore, const HEARD: bool, const SIGHT: bool> {
    records: &'w S,
    metric: PairMetric<SIGHT>,
    /// The same, a vertex at a time.
    plain: Metric,
    strip: StripBuilder<StripVertex>,
    tests: u64,
    /// Told of reads if it is `HEARD`.
    probe: Listener<'p>,
}

impl<S: RecordStore, const HEARD: bool, const SIGHT: bool> Walk<'_, '_, S, HEARD, SIGHT> {
    /// The record at a slot was read.
    #[inline(always)]
    fn hear(&mut self, slot: u64) {
        if HEARD {
            self.probe.read(slot);
        }
    }

    /// Visits the two children of the triangle (apex; b, d), which is split at `here`; `height` is the level of `here` and one.
    ///
    /// The split vertices of both children are read and tested before either is visited: they lie side by side in the file, so two reads are under
    /// way at once, and the arithmetic of two tests fits the same instructions. `CULLS` says whether `planes`, those which all ancestors cross, are
    /// any: below a vertex that lies wholly inside the view nothing asks again.
    fn split<F: Foresight, const CULLS: bool>(
        &mut self,
        height: u32,
        apex: Apex,
        (here, foresight): (Apex, F),
        [b, d]: [GridPoint; 2],
        planes: u8,
    ) {
        if height == 1 {
            // The smallest triangles have no vertex to split at.
            self.append(here, 0);
            self.append(apex, 1);
            self.append(here, 0);
            return;
        }
        let level = height - 2;
        let slots = child_slots(apex.slot, here.slot);
        let points = [b.midpoint(apex.at), d.midpoint(apex.at)];
        let raws = if F::FORESEES {
            [0, 1].map(|i| self.read_foreseen(slots[i], points[i], foresight, planes))
        } else {
            slots.into_iter().for_each(|slot| self.hear(slot));
            self.records.pair(slots)
        };
        let vertices = raws.map(|raw| self.records.decode(raw, level));
        let pair = self.metric.sight(points, &vertices);
        self.tests += 2;
        let child = |i: usize| Apex { slot: slots[i], at: points[i], height_m: vertices[i].height_m as f32 };
        self.visit::<F, CULLS>(height - 1, here, child(0), (0, &pair, &vertices), [b, apex.at], planes);
        self.append(apex, height & 1);
        self.visit::<F, CULLS>(height - 1, here, child(1), (1, &pair, &vertices), [apex.at, d], planes);
    }

    /// The record at a slot; an inert one, which no test selects, if it is certain that its vertex does not show.
    #[inline(always)]
    fn read_foreseen<F: Foresight>(&mut self, slot: u64, at: GridPoint, parent: F, planes: u8) -> RawOf<S> {
        let at_hand = if HEARD && self.probe.hears_foreseen() { None } else { self.records.at_hand(slot) };
        if let Some(raw) = at_hand {
            self.hear(slot);
            return raw;
        }
        self.foresee(slot, at, parent, planes)
    }

    #[inline(never)]
    fn foresee<F: Foresight>(&mut self, slot: u64, at: GridPoint, parent: F, planes: u8) -> RawOf<S> {
        if parent.is_read(self.records, &self.plain, slot, at, planes) {
            self.hear(slot);
            return self.records.get(slot).unwrap_or(S::Codec::INERT);
        }
        if HEARD {
            self.probe.foreseen(slot);
        }
        S::Codec::INERT
    }

    /// Visits the triangle (apex; base), whose split vertex is `split`, one of a pair.
    /// Inlined, so that only triangles that are split cost a call.
    #[inline(always)]
    fn visit<F: Foresight, const CULLS: bool>(
        &mut self,
        height: u32,
        apex: Apex,
        split: Apex,
        (i, pair, vertices): (usize, &SightedPair, &[Vertex; 2]),
        base: [GridPoint; 2],
        planes: u8,
    ) {
        if pair.is_selected(i) {
            let here = (split, F::of(split.at, &vertices[i]));
            if !CULLS {
                return self.split::<F, false>(height, apex, here, base, 0);
            }
            match self.metric.cull(pair, i, planes) {
                None => {}
                Some(0) => return self.split::<F, false>(height, apex, here, base, 0),
                Some(planes) => return self.split::<F, true>(height, apex, here, base, planes),
            }
        }
        self.append(apex, height & 1);
    }

    /// Continues the strip to `apex`.
    #[inline(always)]
    fn append(&mut self, apex: Apex, parity: u32) {
        let Apex { at, height_m, .. } = apex;
        self.strip.append(at, parity, StripVertex { x: at.x(), y: at.y(), height_m });
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
        let is_heard = P::HEARS_READS || P::HEARS_FORESEEN;
        let probe = Listener::new(probe);
        match (is_heard, view.metric) {
            (false, ErrorMetric::Ball) => self.refine::<false, false>(view, probe),
            (false, ErrorMetric::Sight) => self.refine::<false, true>(view, probe),
            (true, ErrorMetric::Ball) => self.refine::<true, false>(view, probe),
            (true, ErrorMetric::Sight) => self.refine::<true, true>(view, probe),
        }
    }

    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle)) {
        for_each_in_strip(self.strip().iter().map(|v| GridPoint::new(v.x, v.y)), visit);
    }
}
