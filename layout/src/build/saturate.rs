//! One vertex's record from its own error and its children's records: classes, saturated error, nested radius.
//!
//! The radius is computed from decoded heights and decoded child radii, and rounded up with a margin, so that nesting holds on what
//! the file says and survives the rounding of the engine's arithmetic (FORMAT.md, section 3).

use super::band::Band;
use super::extremes::{larger, smaller};
use super::levels::{LevelShape, Levels};
use super::padding::{deviation, has_area};
use super::scan::{FIRST_SCANNED, OwnErrors};
use crate::error::LayoutError;
use crate::grid::{Grid, GridPoint};
use crate::header::ErrorKind;
use crate::record::{RecordCodec, RecordScale, Vertex, VertexClass};
use std::sync::atomic::Ordering;

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
        let (y, step, level) = (shape.row_y(row), shape.step(), shape.level());
        let [wide, high] = self.grid.samples();
        let voids_near = self.has_voids
            && band.may_have_voids(y.saturating_sub(step).min(high - 1)..=(y + step).min(high - 1));
        let scanned = if self.error_kind == ErrorKind::Bounded && level >= FIRST_SCANNED {
            own.row(level, row)
        } else {
            None
        };
        let around = Surroundings { shape, band, records };
        let columns = shape.columns(row);
        let mut made = Vec::with_capacity(columns);
        let is_inside = y >= step && y + step < high;
        let open_row = (is_inside && !voids_near).then(|| OpenRow::new(self, &around, y)).flatten();
        let void_row = (is_inside && voids_near).then(|| VoidRow::new(self, &around, y)).flatten();
        for column in 0..columns {
            let v = shape.point(row, column);
            let folded = v.x() + step >= wide || y + step >= high;
            let is_inside = !folded && v.x() >= step;
            // The rest of an ocean.
            if let Some(void) = void_row.as_ref().filter(|_| is_inside)
                && void.is_inert(v.x(), column)
            {
                made.push(C::INERT);
                continue;
            }
            let own_m = match scanned {
                Some(cells) if !folded => f64::from(f32::from_bits(cells[column].load(Ordering::Relaxed))),
                _ => f64::NAN,
            };
            // Nearly every vertex: all around it is there, nothing folds, nothing is void.
            if let Some(open) = open_row.as_ref().filter(|_| is_inside)
                && let Some(raw) = open.record(v.x(), column, own_m)
            {
                made.push(raw);
                continue;
            }
            let own_m = if own_m.is_nan() { self.own_error_m(v, shape, band, folded) } else { own_m };
            made.push(self.record(v, &around, own_m, folded, voids_near)?);
        }
        Ok(made.into())
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

    /// The record of any vertex, wherever it lies.
    fn record(
        &self,
        v: GridPoint,
        around: &Surroundings<'_, C>,
        own_m: f64,
        folded: bool,
        voids_near: bool,
    ) -> Result<C::Raw, LayoutError> {
        let Surroundings { shape, band, records } = *around;
        let level = shape.level();
        let code = band.code(v);
        let is_void = voids_near && band.is_void(v);
        let mut below = Below::default();
        if level == 0 {
            below.fringe = voids_near
                && self.grid.edge_ends(v).into_iter().chain(self.grid.apexes(v)).any(|p| band.is_void(p));
        } else {
            let child_shape = LevelShape::new(&self.grid, level - 1);
            let [x, y] = self.grid.position_m(v);
            let height_m = code * self.scale.height_step_m;
            for child in children(v, shape, self.grid.side_steps()).into_iter().flatten() {
                if child_shape.is_beyond(child) {
                    continue;
                }
                let (row, column) = child_shape.index(child);
                let Some(raw) = records.row(level - 1, row).and_then(|r| r.get(column)) else {
                    return Err(internal(child));
                };
                let [cx, cy] = self.grid.position_m(child);
                let ground2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
                below.add(&self.codec.decode(*raw, level - 1), ground2, height_m, self.scale.height_base_m);
            }
        }
        let class = match (is_void, below.any_alive, below.fringe) {
            (true, false, _) => VertexClass::Inert,
            (true, true, _) => VertexClass::FringeVoid,
            (false, _, true) => VertexClass::Fringe,
            (false, _, false) => VertexClass::Plain,
        };
        // A deformed diamond's children are drawn in other places than their parents: the bound is the sum.
        let own_m =
            if folded && self.error_kind == ErrorKind::Bounded { own_m + below.error_m } else { own_m };
        self.encode(level, code, class, own_m, &below).ok_or_else(|| internal(v))
    }

    #[inline(always)]
    fn encode(&self, level: u32, code: f64, class: VertexClass, own_m: f64, below: &Below) -> Option<C::Raw> {
        // No triangle is farther from a sample than the range of heights, which lies a millionth below the top.
        let error_m = larger(below.error_m, smaller(self.scale.error_top_m * (1.0 - 1e-7), own_m));
        self.codec.encode(level, code, class, error_m, below.radius_m)
    }
}

/// Where a row's vertices find what they depend on.
struct Surroundings<'r, C: RecordCodec> {
    shape: &'r LevelShape,
    band: &'r Band,
    records: &'r Levels<C::Raw>,
}

/// What a vertex's children add up to.
#[derive(Debug, Default)]
struct Below {
    error_m: f64,
    radius_m: f64,
    /// Whether a child is next to a void or void throughout.
    fringe: bool,
    /// Whether a child can ever be refined.
    any_alive: bool,
}

impl Below {
    /// Adds a child `ground2` square metres away over the ground from a vertex at `height_m` above `base_m`.
    #[inline(always)]
    fn add(&mut self, child: &Vertex, ground2: f64, height_m: f64, base_m: f64) {
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

/// The rows of records that hold the children of a row's vertices.
struct ChildRows<'r, C: RecordCodec> {
    /// Distance of the vertices from their nearest ancestors in steps.
    step: usize,
    /// Whether the vertices are white.
    is_white: bool,
    /// Rows south of, level with and north of the vertices.
    rows: [&'r [C::Raw]; 3],
}

impl<'r, C: RecordCodec> ChildRows<'r, C> {
    /// The children of the vertices at `y`, a row away from the data's borders above level 0.
    fn new(grid: &Grid, around: &Surroundings<'r, C>, y: u32) -> Option<Self> {
        let Surroundings { shape, records, .. } = *around;
        let (s, level) = (shape.step(), shape.level());
        let child = |y: u32| {
            let shape = LevelShape::new(grid, level - 1);
            records.row(level - 1, shape.index(GridPoint::new(0, y)).0)
        };
        let rows = match (level, shape.is_white()) {
            (0, _) => [&[][..]; 3],
            (_, true) => [child(y - s)?, child(y)?, child(y + s)?],
            (_, false) => [child(y - s / 2)?, &[], child(y + s / 2)?],
        };
        Some(Self { step: s as usize, is_white: shape.is_white(), rows })
    }

    /// The four children of the vertex at `x`: those beside it before those north and south, where that makes a difference.
    #[inline(always)]
    fn of(&self, x: usize, column: usize) -> Option<[C::Raw; 4]> {
        let [south, beside, north] = self.rows;
        if self.is_white {
            return Some([
                *beside.get(column)?,
                *beside.get(column + 1)?,
                *south.get(column)?,
                *north.get(column)?,
            ]);
        }
        let west = (x - self.step / 2) >> self.step.trailing_zeros();
        let (south, north) = (south.get(west..west + 2)?, north.get(west..west + 2)?);
        Some([south[0], south[1], north[0], north[1]])
    }
}

/// A row away from the data's borders, with voids.
struct VoidRow<'r, C: RecordCodec> {
    voids: &'r [bool],
    /// `None` at level 0.
    children: Option<ChildRows<'r, C>>,
}

impl<'r, C: RecordCodec> VoidRow<'r, C> {
    /// `None` if the row itself has no voids or is no longer in the band.
    fn new(saturator: &Saturator<C>, around: &Surroundings<'r, C>, y: u32) -> Option<Self> {
        let voids = around.band.find_row_voids(y).filter(|voids| !voids.is_empty())?;
        let has_children = around.shape.level() > 0;
        let children = if has_children { Some(ChildRows::new(&saturator.grid, around, y)?) } else { None };
        Some(Self { voids, children })
    }

    /// Whether the vertex at `x` is known to be void with nothing but inert vertices below it.
    #[inline(always)]
    fn is_inert(&self, x: u32, column: usize) -> bool {
        let x = x as usize;
        self.voids[x]
            && self.children.as_ref().is_none_or(|children| {
                children.of(x, column).is_some_and(|raws| raws.iter().all(|raw| *raw == C::INERT))
            })
    }
}

/// A row away from the data's borders and from voids, with the rows it depends on at hand.
struct OpenRow<'r, C: RecordCodec> {
    saturator: &'r Saturator<C>,
    level: u32,
    step: usize,
    codes: &'r [f64],
    /// Rows of codes that hold the ends of the edges that this row's vertices split.
    ends: [&'r [f64]; 2],
    /// Offsets of those ends in x; white vertices have their own rule.
    end_offsets: [isize; 2],
    /// Whether the vertices are white: their diagonal edges alternate from cell to cell.
    alternates: bool,
    /// Whether the row's cells are the southern ones of their parents.
    south_cell: bool,
    children: ChildRows<'r, C>,
    /// Square metres over the ground to the children beside, and to those north and south.
    ground2: [f64; 2],
}

impl<'r, C: RecordCodec> OpenRow<'r, C> {
    /// `None` if the rows are no longer in the band, as for levels larger than a tile.
    fn new(saturator: &'r Saturator<C>, around: &Surroundings<'r, C>, y: u32) -> Option<Self> {
        let Surroundings { shape, band, .. } = *around;
        let (s, level) = (shape.step(), shape.level());
        let codes = band.find_row(y)?;
        let (ends, end_offsets) = if shape.is_white() || y & s != 0 {
            ([band.find_row(y - s)?, band.find_row(y + s)?], [0; 2])
        } else {
            ([codes; 2], [-(s as isize), s as isize])
        };
        let children = ChildRows::new(&saturator.grid, around, y)?;
        let [dx, dy] = saturator.grid.spacing_m().map(|d| d * f64::from(s));
        let ground2 = match (level, shape.is_white()) {
            (0, _) => [0.0; 2],
            (_, true) => [dx * dx, dy * dy],
            (_, false) => [(0.5 * dx) * (0.5 * dx) + (0.5 * dy) * (0.5 * dy); 2],
        };
        Some(Self {
            saturator,
            level,
            step: s as usize,
            codes,
            ends,
            end_offsets,
            alternates: shape.is_white(),
            south_cell: (y / s) & 2 == 0,
            children,
            ground2,
        })
    }

    /// Codes at the ends of the edge that the vertex at `x` splits.
    #[inline(always)]
    fn end_codes(&self, x: usize) -> [f64; 2] {
        if !self.alternates {
            return [0, 1].map(|i| self.ends[i][x.wrapping_add_signed(self.end_offsets[i])]);
        }
        // See Grid::edge_ends: the diagonal climbs where the cell is its parent's south-west or north-east one.
        let climbs = ((x / self.step) & 2 == 0) == self.south_cell;
        let (west, east) = (x - self.step, x + self.step);
        let [south, north] = self.ends;
        if climbs { [south[west], north[east]] } else { [south[east], north[west]] }
    }

    /// The record of the vertex at `x`; `None` if it is not an ordinary one after all. `own_m` is NaN where it is the distance from the
    /// edge.
    #[inline(always)]
    fn record(&self, x: u32, column: usize, own_m: f64) -> Option<C::Raw> {
        let x = x as usize;
        let code = self.codes[x];
        let scale = &self.saturator.scale;
        let own_m = if own_m.is_nan() {
            let [b, d] = self.end_codes(x);
            (code - 0.5 * (b + d)).abs() * scale.height_step_m * (1.0 + 1e-9)
        } else {
            own_m
        };
        let mut below = Below::default();
        if self.level > 0 {
            let height_m = code * scale.height_step_m;
            let children = self.children.of(x, column)?;
            for (i, raw) in children.into_iter().enumerate() {
                let child = self.saturator.codec.decode(raw, self.level - 1);
                below.add(&child, self.ground2[i / 2], height_m, scale.height_base_m);
            }
        }
        if below.fringe {
            return None;
        }
        self.saturator.encode(self.level, code, VertexClass::Plain, own_m, &below)
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
