//! One vertex's record from its own error and its children's records: classes, saturated error, nested radius.
//!
//! The radius is computed from decoded heights and decoded radii of children, and rounded up with a margin. So nesting holds for the numbers in
//! the file, and still holds after the rounding of the engine's arithmetic (FORMAT.md, section 3).

use super::padding::{deviation, has_area};
use super::{larger, smaller};
use crate::file::header::ErrorKind;
use crate::grid::record::{RecordCodec, RecordScale, Vertex, VertexClass, f32_at_least};
use crate::grid::{Grid, GridPoint};

/// Factor on nested radii: twice the margin that FORMAT.md promises.
const MARGIN: f64 = 1.0 + 1.0 / (1 << 19) as f64;

/// Factor on distances: their rounding is below 2^-40 of them and of the heights they came from.
const DISTANCE_MARGIN: f64 = 1.0 + 1e-9;

/// First level whose own error needs a look at more samples than its vertex. At levels 0 and 1 every sample in the diamond is the vertex, a corner, or a child's
/// vertex on the edge it splits.
pub(crate) const FIRST_SCANNED: u32 = 2;

/// What all records of a file are made by.
#[derive(Debug, Clone)]
pub(crate) struct Rules<C> {
    pub(crate) grid: Grid,
    pub(crate) codec: C,
    pub(crate) scale: RecordScale,
    pub(crate) error_kind: ErrorKind,
}

impl<C: RecordCodec> Rules<C> {
    /// Position in metres and height in metres of a grid point with this height code, folded.
    fn point_m(&self, p: GridPoint, code: f64) -> [f64; 3] {
        let [x, y] = self.grid.position_m(p);
        [x, y, code * self.scale.height_step_m]
    }

    /// Metres of a vertex with height code `code` above the middle of the edge it splits, whose ends have the codes `ends`.
    #[inline(always)]
    pub(crate) fn step_error_m(&self, code: f64, [b, d]: [f64; 2]) -> f64 {
        (code - 0.5 * (b + d)).abs() * self.scale.height_step_m * DISTANCE_MARGIN
    }

    /// Own error in metres of a vertex that lies `codes` height codes, the farthest sample's distance, from its triangles.
    #[inline(always)]
    pub(crate) fn scanned_error_m(&self, codes: f64) -> f32 {
        scanned_error_m(codes, self.scale.height_step_m)
    }

    /// The vertex's own vertical distance from the triangles it splits, in metres, `code` giving the height code of a grid point, padding folded. That is all
    /// of the own error below [`FIRST_SCANNED`], of step errors, and where padding deforms (`folded`).
    pub(crate) fn own_error_m(
        &self,
        v: GridPoint,
        ends: [GridPoint; 2],
        folded: bool,
        mut code: impl FnMut(GridPoint) -> f64,
    ) -> f64 {
        let vertex_code = code(v);
        if !folded {
            return self.step_error_m(vertex_code, ends.map(code));
        }
        let base = self.grid.edge_ends(v).map(|p| self.point_m(p, code(p)));
        let mut apexes = [[0.0; 3]; 2];
        let mut count = 0;
        for p in self.grid.apexes(v) {
            apexes[count] = self.point_m(p, code(p));
            count += 1;
        }
        let (apexes, vertex) = (&apexes[..count], self.point_m(v, vertex_code));
        match self.error_kind {
            ErrorKind::Bounded => deviation(vertex, base, apexes) * DISTANCE_MARGIN,
            ErrorKind::Step if has_area(base, apexes) => (vertex[2] - 0.5 * (base[0][2] + base[1][2])).abs(),
            ErrorKind::Step => 0.0,
        }
    }

    /// An own error in metres as a record of this level and class says it: rounded up, and no larger than errors get.
    pub(crate) fn stored_error_m(&self, level: u32, class: VertexClass, own_m: f64) -> f64 {
        self.recorded_error_m(level, class, smaller(self.largest_error_m(), own_m))
    }

    /// An error in metres as a record of this level and class says it: rounded up. Fringe children may have larger errors than own ones get, and those are not cut.
    pub(crate) fn recorded_error_m(&self, level: u32, class: VertexClass, error_m: f64) -> f64 {
        let raw = self.codec.encode(level, 0.0, class, error_m, 0.0);
        raw.map_or(f64::INFINITY, |raw| self.codec.decode(raw, level).error_m)
    }

    /// What own errors are cut to: no triangle is farther from a sample than the range of heights, which lies a millionth below the top.
    #[inline(always)]
    fn largest_error_m(&self) -> f64 {
        self.scale.error_top_m * (1.0 - 1e-7)
    }

    /// Square metres over the ground from a vertex to its child. Multiples of the spacing, so that it does not depend on where they lie.
    #[inline(always)]
    pub(crate) fn ground2(&self, v: GridPoint, child: GridPoint) -> f64 {
        let (v, child) = (self.grid.fold(v), self.grid.fold(child));
        let [dx, dy] = self.grid.spacing_m();
        let (x, y) = (dx * f64::from(v.x().abs_diff(child.x())), dy * f64::from(v.y().abs_diff(child.y())));
        x * x + y * y
    }

    /// The record of any vertex; `None` if no record of the kind can say it.
    pub(crate) fn record(
        &self,
        level: u32,
        code: f64,
        is_void: bool,
        own_m: f64,
        folded: bool,
        below: &Below,
    ) -> Option<C::Raw> {
        let class = match (is_void, below.any_alive, below.fringe) {
            (true, false, _) => VertexClass::Inert,
            (true, true, _) => VertexClass::FringeVoid,
            (false, _, true) => VertexClass::Fringe,
            (false, _, false) => VertexClass::Plain,
        };
        // A deformed diamond's children are drawn in other places than their parents: the bound is the sum.
        let own_m =
            if folded && self.error_kind == ErrorKind::Bounded { own_m + below.error_m } else { own_m };
        self.encode(level, code, class, own_m, below)
    }

    /// The record of a plain vertex whose triangles padding does not deform.
    #[inline(always)]
    pub(crate) fn encode_plain(&self, level: u32, code: f64, own_m: f64, below: &Below) -> Option<C::Raw> {
        let error_m = larger(below.error_m, smaller(self.largest_error_m(), own_m));
        self.codec.encode_plain(level, code, error_m, below.radius_m)
    }

    /// The record of a vertex whose class is known and whose triangles padding does not deform.
    #[inline(always)]
    pub(crate) fn encode(
        &self,
        level: u32,
        code: f64,
        class: VertexClass,
        own_m: f64,
        below: &Below,
    ) -> Option<C::Raw> {
        let error_m = larger(below.error_m, smaller(self.largest_error_m(), own_m));
        self.codec.encode(level, code, class, error_m, below.radius_m)
    }
}

/// As [`Rules::scanned_error_m`], `step_m` being the metres a height code.
#[inline(always)]
pub(crate) fn scanned_error_m(codes: f64, step_m: f64) -> f32 {
    f32_at_least(codes * step_m * DISTANCE_MARGIN)
}

/// What a vertex's children add up to.
#[derive(Debug, Default)]
pub(crate) struct Below {
    pub(crate) error_m: f64,
    pub(crate) radius_m: f64,
    /// Whether a child is next to a void or void throughout.
    pub(crate) fringe: bool,
    /// Whether a child can ever be refined.
    pub(crate) any_alive: bool,
}

impl Below {
    /// Four children, `ground2` square metres away over the ground from a vertex at `height_m` above `base_m`.
    #[inline(always)]
    pub(crate) fn of(children: &[Vertex; 4], ground2: &[f64; 4], height_m: f64, base_m: f64) -> Self {
        if children.iter().all(|child| child.class == VertexClass::Plain) {
            return Self::of_plain(children, ground2, height_m, base_m);
        }
        let mut below = Self::default();
        for (child, ground2) in children.iter().zip(ground2) {
            below.add(child, *ground2, height_m, base_m);
        }
        below
    }

    /// [`Below::of`] of plain children.
    #[inline(always)]
    pub(crate) fn of_plain(children: &[Vertex; 4], ground2: &[f64; 4], height_m: f64, base_m: f64) -> Self {
        let mut below = Self::default();
        // Roots side by side.
        let mut radii_m = [0.0; 4];
        for i in 0..4 {
            let dz = height_m - (children[i].height_m - base_m);
            radii_m[i] = ((ground2[i] + dz * dz).sqrt() + children[i].radius_m) * MARGIN;
        }
        below.any_alive = true;
        below.radius_m = radii_m.into_iter().fold(0.0, larger);
        below.error_m = children.iter().map(|child| child.error_m).fold(0.0, larger);
        below
    }

    /// Adds a child `ground2` square metres away over the ground from a vertex at `height_m` above `base_m`.
    #[inline(always)]
    pub(crate) fn add(&mut self, child: &Vertex, ground2: f64, height_m: f64, base_m: f64) {
        if child.class != VertexClass::Plain {
            self.fringe = true;
            if child.class == VertexClass::Inert {
                return;
            }
        }
        self.any_alive = true;
        let dz = height_m - (child.height_m - base_m);
        self.radius_m = larger(self.radius_m, ((ground2 + dz * dz).sqrt() + child.radius_m) * MARGIN);
        self.error_m = larger(self.error_m, child.error_m);
    }
}
