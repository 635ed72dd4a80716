//! The records of a row of vertices, from the rows of heights around it and its children's rows of records.
//!
//! Nearly all vertices lie away from borders and voids. A row of these is looked up once and worked through as a whole. The others are made one by one.

use super::band::Band;
use super::levels::{LevelRow, LevelShape, Levels, Piece};
use super::scan::OwnErrors;
use crate::bound::{Below, FIRST_SCANNED, Rules};
use crate::error::LayoutError;
use crate::file::header::ErrorKind;
use crate::grid::record::{RecordCodec, VertexClass};
use crate::grid::{Grid, GridPoint};
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Makes records; one for a whole build.
pub(super) struct Saturator<C> {
    pub(super) rules: Rules<C>,
    pub(super) has_voids: bool,
}

impl<C: RecordCodec> Saturator<C> {
    /// The records of one row of a level, `columns` of it. Children rows are done, rows of codes around it are in the band.
    pub(super) fn row(
        &self,
        shape: &LevelShape,
        row: usize,
        columns: &[Range<usize>],
        around: Around<'_, C>,
    ) -> Result<LevelRow<C::Raw>, LayoutError> {
        let (y, step, level) = (shape.row_y(row), shape.step(), shape.level());
        let [_, high] = self.rules.grid.samples();
        let voids_near = self.has_voids
            && around.band.may_have_voids(y.saturating_sub(step).min(high - 1)..=(y + step).min(high - 1));
        let scanned = if self.rules.error_kind == ErrorKind::Bounded && level >= FIRST_SCANNED {
            around.own.row(level, row)
        } else {
            None
        };
        let surroundings = Surroundings { shape, band: around.band, records: around.records };
        let mut runs = Vec::with_capacity(columns.len());
        for (i, columns) in columns.iter().enumerate() {
            let cells = scanned.map(|row| row.run(i).unwrap_or_default());
            runs.push((columns.start, self.run(row, columns.clone(), &surroundings, cells, voids_near)?));
        }
        Ok(LevelRow::new(shape.columns(row), runs))
    }

    /// The records of vertices side by side.
    fn run(
        &self,
        row: usize,
        columns: Range<usize>,
        around: &Surroundings<'_, C>,
        scanned: Option<&[AtomicU32]>,
        voids_near: bool,
    ) -> Result<Box<[C::Raw]>, LayoutError> {
        let Surroundings { shape, band, .. } = *around;
        let (y, step) = (shape.row_y(row), shape.step());
        let [wide, high] = self.rules.grid.samples();
        let mut made = Vec::with_capacity(columns.len());
        let is_inside = y >= step && y + step < high;
        let ends = [columns.start, columns.end - 1].map(|column| shape.point(row, column).x());
        let open_row =
            (is_inside && !voids_near).then(|| OpenRow::new(&self.rules, around, y, ends)).flatten();
        let void_row =
            (is_inside && voids_near).then(|| VoidRow::new(&self.rules.grid, around, y, ends)).flatten();
        for column in columns.clone() {
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
                Some(cells) if !folded => cells
                    .get(column - columns.start)
                    .map_or(0.0, |cell| f64::from(f32::from_bits(cell.load(Ordering::Relaxed)))),
                _ => f64::NAN,
            };
            // Nearly every vertex: all around it is there, nothing folds, nothing is void.
            if let Some(open) = open_row.as_ref().filter(|_| is_inside)
                && let Some(raw) = open.record(v.x(), column, own_m)
            {
                made.push(raw);
                continue;
            }
            let own_m = if own_m.is_nan() {
                self.rules.own_error_m(v, self.edge_ends(v, shape), folded, |p| band.code(p))
            } else {
                own_m
            };
            made.push(self.record(v, around, own_m, folded, voids_near)?);
        }
        Ok(made.into())
    }

    /// As [`Grid::edge_ends`], without finding the level again.
    #[inline(always)]
    fn edge_ends(&self, v: GridPoint, shape: &LevelShape) -> [GridPoint; 2] {
        let (s, x, y) = (shape.step(), v.x(), v.y());
        if shape.is_white() {
            return self.rules.grid.edge_ends(v);
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
                && self
                    .rules
                    .grid
                    .edge_ends(v)
                    .into_iter()
                    .chain(self.rules.grid.apexes(v))
                    .any(|p| band.is_void(p));
        } else {
            let child_shape = LevelShape::new(&self.rules.grid, level - 1);
            let height_m = code * self.rules.scale.height_step_m;
            for child in children(v, shape, self.rules.grid.side_steps()).into_iter().flatten() {
                if child_shape.is_beyond(child) {
                    continue;
                }
                let (row, column) = child_shape.index(child);
                let Some(row) = records.row(level - 1, row).filter(|row| column < row.columns()) else {
                    return Err(internal(child));
                };
                let raw = row.get(column).copied().unwrap_or(C::INERT);
                let ground2 = self.rules.ground2(v, child);
                below.add(
                    &self.rules.codec.decode(raw, level - 1),
                    ground2,
                    height_m,
                    self.rules.scale.height_base_m,
                );
            }
        }
        self.rules.record(level, code, is_void, own_m, folded, &below).ok_or_else(|| internal(v))
    }
}

/// Where rows find what they depend on.
pub(super) struct Around<'r, C: RecordCodec> {
    pub(super) band: &'r Band<'r>,
    pub(super) own: &'r OwnErrors,
    pub(super) records: &'r Levels<C::Raw>,
}

/// Where the vertices of one level find what they depend on.
struct Surroundings<'r, C: RecordCodec> {
    shape: &'r LevelShape,
    band: &'r Band<'r>,
    records: &'r Levels<C::Raw>,
}

/// The rows of records that hold the children of a row's vertices.
struct ChildRows<'r, C: RecordCodec> {
    /// Distance of the vertices from their nearest ancestors in steps.
    step: usize,
    /// Whether the vertices are white.
    is_white: bool,
    /// Rows south of, level with and north of the vertices.
    rows: [Piece<'r, C::Raw>; 3],
}

impl<'r, C: RecordCodec> ChildRows<'r, C> {
    /// The children of the vertices at `y`, a row away from the data's borders, from one x to another.
    fn new(grid: &Grid, around: &Surroundings<'r, C>, y: u32, [west, east]: [u32; 2]) -> Option<Self> {
        let Surroundings { shape, records, .. } = *around;
        let (s, level) = (shape.step(), shape.level());
        let child = |y: u32, west: u32, east: u32| {
            let shape = LevelShape::new(grid, level - 1);
            let (row, from) = shape.index(GridPoint::new(west, y));
            let (_, to) = shape.index(GridPoint::new(east, y));
            Some(records.row(level - 1, row)?.piece(from, to + 1, C::INERT))
        };
        let half = s / 2;
        let rows = match (level, shape.is_white()) {
            (0, _) => [Piece::none(), Piece::none(), Piece::none()],
            (_, true) => {
                [child(y - s, west, east)?, child(y, west - s, east + s)?, child(y + s, west, east)?]
            }
            (_, false) => {
                let west = west.saturating_sub(half);
                [child(y - half, west, east + half)?, Piece::none(), child(y + half, west, east + half)?]
            }
        };
        Some(Self { step: s as usize, is_white: shape.is_white(), rows })
    }

    /// The four children of the vertex at `x`: those beside it before those north and south, where that makes a difference.
    #[inline(always)]
    fn of(&self, x: usize, column: usize) -> Option<[C::Raw; 4]> {
        let [south, beside, north] = &self.rows;
        if self.is_white {
            return Some([
                beside.get(column)?,
                beside.get(column + 1)?,
                south.get(column)?,
                north.get(column)?,
            ]);
        }
        let west = (x - self.step / 2) >> self.step.trailing_zeros();
        Some([south.get(west)?, south.get(west + 1)?, north.get(west)?, north.get(west + 1)?])
    }
}

/// A row away from the data's borders, with voids.
struct VoidRow<'r, C: RecordCodec> {
    voids: Piece<'static, bool>,
    /// `None` at level 0.
    children: Option<ChildRows<'r, C>>,
}

impl<'r, C: RecordCodec> VoidRow<'r, C> {
    /// `None` if the row itself has no voids or is no longer in the band.
    fn new(grid: &Grid, around: &Surroundings<'r, C>, y: u32, ends: [u32; 2]) -> Option<Self> {
        let voids = around.band.find_voids(y, ends[0] as usize, ends[1] as usize + 1)?;
        let has_children = around.shape.level() > 0;
        let children = if has_children { Some(ChildRows::new(grid, around, y, ends)?) } else { None };
        Some(Self { voids, children })
    }

    /// Whether the vertex at `x` is known to be void with nothing but inert vertices below it.
    #[inline(always)]
    fn is_inert(&self, x: u32, column: usize) -> bool {
        let x = x as usize;
        self.voids.get(x).is_some_and(|is_void| is_void)
            && self.children.as_ref().is_none_or(|children| {
                children.of(x, column).is_some_and(|raws| raws.iter().all(|raw| *raw == C::INERT))
            })
    }
}

/// A row away from the data's borders and from voids, with the rows it depends on at hand.
struct OpenRow<'r, C: RecordCodec> {
    rules: &'r Rules<C>,
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
    /// Of vertices from one x to another. `None` if the rows are no longer in the band, as for levels larger than a tile.
    fn new(rules: &'r Rules<C>, around: &Surroundings<'r, C>, y: u32, ends_x: [u32; 2]) -> Option<Self> {
        let Surroundings { shape, band, .. } = *around;
        let (s, level) = (shape.step(), shape.level());
        let codes = band.find_row(y)?;
        let (ends, end_offsets) = if shape.is_white() || y & s != 0 {
            ([band.find_row(y - s)?, band.find_row(y + s)?], [0; 2])
        } else {
            ([codes; 2], [-(s as isize), s as isize])
        };
        let children = ChildRows::new(&rules.grid, around, y, ends_x)?;
        let [dx, dy] = rules.grid.spacing_m().map(|d| d * f64::from(s));
        let ground2 = match (level, shape.is_white()) {
            (0, _) => [0.0; 2],
            (_, true) => [dx * dx, dy * dy],
            (_, false) => [(0.5 * dx) * (0.5 * dx) + (0.5 * dy) * (0.5 * dy); 2],
        };
        Some(Self {
            rules,
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
        let rules = self.rules;
        let own_m = if own_m.is_nan() {
            let [b, d] = self.end_codes(x);
            rules.step_error_m(code, [b, d])
        } else {
            own_m
        };
        let mut below = Below::default();
        if self.level > 0 {
            let height_m = code * rules.scale.height_step_m;
            let children = self.children.of(x, column)?;
            for (i, raw) in children.into_iter().enumerate() {
                let child = rules.codec.decode(raw, self.level - 1);
                below.add(&child, self.ground2[i / 2], height_m, rules.scale.height_base_m);
            }
        }
        if below.fringe {
            return None;
        }
        rules.encode(self.level, code, VertexClass::Plain, own_m, &below)
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
