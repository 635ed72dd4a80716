//! One vertex's record from its own error and its children's records: classes, saturated error, nested radius.
//!
//! The radius is computed from decoded heights and decoded child radii, and rounded up with a margin, so that nesting holds on what
//! the file says and survives the rounding of the engine's arithmetic (FORMAT.md, section 3).

use super::band::Band;
use super::levels::{LevelShape, Levels};
use super::padding::{deviation, has_area};
use super::scan::{FIRST_SCANNED, OwnErrors};
use crate::error::LayoutError;
use crate::grid::{Grid, GridPoint};
use crate::header::ErrorKind;
use crate::record::{RecordCodec, RecordScale, VertexClass};

/// Factor on nested radii: twice the margin that FORMAT.md promises.
const MARGIN: f64 = 1.0 + 1.0 / (1 << 19) as f64;

/// Makes records; one for a whole build.
pub(super) struct Saturator<C> {
    pub(super) grid: Grid,
    pub(super) codec: C,
    pub(super) scale: RecordScale,
    pub(super) error_kind: ErrorKind,
    pub(super) has_voids: bool,
}

impl<C: RecordCodec> Saturator<C> {
    /// The records of one row of a level. Children rows are done, rows of codes around it are in the band.
    pub(super) fn row(
        &self,
        shape: &LevelShape,
        row: usize,
        band: &Band,
        own: &OwnErrors,
        records: &Levels<C::Raw>,
    ) -> Result<Box<[C::Raw]>, LayoutError> {
        let (y, step) = (shape.row_y(row), shape.step());
        let [wide, high] = self.grid.samples();
        let voids_near = self.has_voids
            && band.may_have_voids(y.saturating_sub(step).min(high - 1)..=(y + step).min(high - 1));
        let own_row = if shape.level() >= FIRST_SCANNED { own.row(shape.level(), row) } else { None };
        let child_shape = (shape.level() > 0).then(|| LevelShape::new(&self.grid, shape.level() - 1));
        (0..shape.columns(row))
            .map(|column| {
                let v = shape.point(row, column);
                let folded = v.x() + step >= wide || y + step >= high;
                let own_m = match (self.error_kind, own_row) {
                    (ErrorKind::Bounded, Some(cells)) if !folded => {
                        f64::from(f32::from_bits(cells[column].load(std::sync::atomic::Ordering::Relaxed)))
                    }
                    _ => self.own_error_m(v, shape, band, folded),
                };
                self.record(v, shape, child_shape.as_ref(), own_m, folded, voids_near, band, records)
            })
            .collect()
    }

    /// Position in metres and height in metres of a grid point, folded.
    fn point_m(&self, p: GridPoint, band: &Band) -> [f64; 3] {
        let [x, y] = self.grid.position_m(p);
        [x, y, band.code(p) * self.scale.height_step_m]
    }

    /// The vertex's own vertical distance from the triangles it splits, in metres.
    fn own_error_m(&self, v: GridPoint, shape: &LevelShape, band: &Band, folded: bool) -> f64 {
        if !folded {
            let [b, d] = self.edge_ends(v, shape).map(|p| band.code(p));
            return (band.code(v) - 0.5 * (b + d)).abs() * self.scale.height_step_m * (1.0 + 1e-9);
        }
        let base = self.grid.edge_ends(v).map(|p| self.point_m(p, band));
        let apexes: Vec<[f64; 3]> = self.grid.apexes(v).map(|p| self.point_m(p, band)).collect();
        let vertex = self.point_m(v, band);
        match self.error_kind {
            ErrorKind::Bounded => deviation(vertex, base, &apexes) * (1.0 + 1e-9),
            ErrorKind::Step if has_area(base, &apexes) => (vertex[2] - 0.5 * (base[0][2] + base[1][2])).abs(),
            ErrorKind::Step => 0.0,
        }
    }

    /// As [`Grid::edge_ends`], without finding the level again.
    #[inline(always)]
    fn edge_ends(&self, v: GridPoint, shape: &LevelShape) -> [GridPoint; 2] {
        let (s, x, y) = (shape.step(), v.x(), v.y());
        if shape.is_white() {
            return self.grid.edge_ends(v);
        }
        if y & s == 0 {
            [GridPoint::new(x - s, y), GridPoint::new(x + s, y)]
        } else {
            [GridPoint::new(x, y - s), GridPoint::new(x, y + s)]
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "one vertex's whole surroundings; a struct would be built for every vertex"
    )]
    #[inline]
    fn record(
        &self,
        v: GridPoint,
        shape: &LevelShape,
        child_shape: Option<&LevelShape>,
        own_m: f64,
        folded: bool,
        voids_near: bool,
        band: &Band,
        records: &Levels<C::Raw>,
    ) -> Result<C::Raw, LayoutError> {
        let level = shape.level();
        let code = band.code(v);
        let is_void = voids_near && band.is_void(v);
        let mut fringe = false;
        let mut all_inert = true;
        let (mut error_m, mut radius_m) = (0.0f64, 0.0f64);
        match child_shape {
            None => {
                fringe = voids_near
                    && self.grid.edge_ends(v).into_iter().chain(self.grid.apexes(v)).any(|p| band.is_void(p));
            }
            Some(child_shape) => {
                let [x, y] = self.grid.position_m(v);
                let height_m = code * self.scale.height_step_m;
                for child in children(v, shape, self.grid.side_steps()).into_iter().flatten() {
                    if child_shape.is_beyond(child) {
                        continue;
                    }
                    let (row, column) = child_shape.index(child);
                    let Some(raw) = records.row(child_shape.level(), row).and_then(|r| r.get(column)) else {
                        return Err(internal(child));
                    };
                    let c = self.codec.decode(*raw, child_shape.level());
                    match c.class {
                        VertexClass::Inert => {
                            fringe = true;
                            continue;
                        }
                        VertexClass::Plain => {}
                        VertexClass::Fringe | VertexClass::FringeVoid => fringe = true,
                    }
                    all_inert = false;
                    let [cx, cy] = self.grid.position_m(child);
                    let dz = height_m - (c.height_m - self.scale.height_base_m);
                    let distance_m = ((x - cx) * (x - cx) + (y - cy) * (y - cy) + dz * dz).sqrt();
                    radius_m = radius_m.max((distance_m + c.radius_m) * MARGIN);
                    error_m = error_m.max(c.error_m);
                }
            }
        }
        let class = match (is_void, all_inert, fringe) {
            (true, true, _) => VertexClass::Inert,
            (true, false, _) => VertexClass::FringeVoid,
            (false, _, true) => VertexClass::Fringe,
            (false, _, false) => VertexClass::Plain,
        };
        // A deformed diamond's children are drawn in other places than their parents: the bound is the sum.
        let own_m = if folded && self.error_kind == ErrorKind::Bounded { own_m + error_m } else { own_m };
        // No triangle is farther from a sample than the range of heights, which lies a millionth below the top.
        let error_m = error_m.max(own_m.min(self.scale.error_top_m * (1.0 - 1e-7)));
        self.codec.encode(level, code, class, error_m, radius_m).ok_or_else(|| internal(v))
    }
}

/// Something the build guarantees did not hold: the user can only report it.
fn internal(v: GridPoint) -> LayoutError {
    LayoutError::Usage(format!(
        "internal error: no record for the vertex at ({}, {}); please report it with the elevation model",
        v.x(),
        v.y()
    ))
}

/// The children inside the square, without finding the level again.
#[inline(always)]
fn children(v: GridPoint, shape: &LevelShape, n: u32) -> [Option<GridPoint>; 4] {
    let (x, y) = (v.x(), v.y());
    let at = |x: Option<u32>, y: Option<u32>| match (x, y) {
        (Some(x), Some(y)) if x <= n && y <= n => Some(GridPoint::new(x, y)),
        _ => None,
    };
    if shape.is_white() {
        let s = shape.step();
        [
            at(Some(x + s), Some(y)),
            at(Some(x), Some(y + s)),
            at(x.checked_sub(s), Some(y)),
            at(Some(x), y.checked_sub(s)),
        ]
    } else {
        let h = shape.step() / 2;
        let (w, e, s, north) = (x.checked_sub(h), Some(x + h), y.checked_sub(h), Some(y + h));
        [at(e, north), at(w, north), at(w, s), at(e, s)]
    }
}
