//! Rows of values for the vertices of each level: what the build keeps while it works its way north and up the levels.
//!
//! Row and column of a level count only its own vertices, so a level of spacing 2^t costs 4^t times less than the finest. Rows are made, used
//! and dropped from south to north; memory is a few rows a level. A row has values near heights alone, in runs of columns.

use crate::grid::{Grid, GridPoint};
use std::borrow::Cow;
use std::collections::VecDeque;

/// Where the vertices of one level lie: rows and columns of those not beyond the data.
#[derive(Debug, Clone, Copy)]
pub(super) struct LevelShape {
    level: u32,
    /// Binary logarithm of the spacing from the nearest ancestors.
    t: u32,
    white: bool,
    /// Largest x and y of a vertex that is not beyond the data.
    limit: [u32; 2],
    /// How far the diamonds of a vertex and of its descendants reach, in steps along either axis.
    reach: u32,
}

impl LevelShape {
    pub(super) fn new(grid: &Grid, level: u32) -> Self {
        let reach = grid.reach_steps(level);
        let limit = grid.samples().map(|s| (s - 1 + reach - 1).min(grid.side_steps()));
        Self { level, t: level / 2, white: level & 1 == 1, limit, reach }
    }

    pub(super) fn level(&self) -> u32 {
        self.level
    }

    /// Distance of the vertices from their nearest ancestors in steps.
    pub(super) fn step(&self) -> u32 {
        1 << self.t
    }

    /// Largest x and y of a vertex that is not beyond the data.
    pub(super) fn limit(&self) -> [u32; 2] {
        self.limit
    }

    /// How far the diamonds of a vertex and of its descendants reach, in steps along either axis.
    pub(super) fn reach(&self) -> u32 {
        self.reach
    }

    /// First column of a row at or east of x = `west`, and the one behind the last that is not east of `east`; that may be past the row's end.
    pub(super) fn columns_between(&self, row: usize, west: u32, east: u32) -> (usize, usize) {
        let (first, pitch) = (self.first_x(row), 2 << self.t);
        let from = west.saturating_sub(first).div_ceil(pitch) as usize;
        (from, east.checked_sub(first).map_or(0, |width| (width / pitch) as usize + 1))
    }

    pub(super) fn is_white(&self) -> bool {
        self.white
    }

    /// Whether the vertex is beyond the data: not kept here, inert in the file.
    #[inline(always)]
    pub(super) fn is_beyond(&self, p: GridPoint) -> bool {
        p.x() > self.limit[0] || p.y() > self.limit[1]
    }

    /// Row and column of a vertex of this level.
    #[inline(always)]
    pub(super) fn index(&self, p: GridPoint) -> (usize, usize) {
        index_in(self.level, p)
    }

    /// y of a row.
    pub(super) fn row_y(&self, row: usize) -> u32 {
        if self.white { (2 * row as u32 + 1) << self.t } else { (row as u32) << self.t }
    }

    /// x of the first vertex of a row.
    fn first_x(&self, row: usize) -> u32 {
        if self.white || row & 1 == 0 { 1 << self.t } else { 0 }
    }

    /// The vertex at a row and column.
    #[inline(always)]
    pub(super) fn point(&self, row: usize, column: usize) -> GridPoint {
        GridPoint::new(self.first_x(row) + ((column as u32) << (self.t + 1)), self.row_y(row))
    }

    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        let y = self.limit[1] >> self.t;
        if self.white { y.div_ceil(2) as usize } else { y as usize + 1 }
    }

    /// Number of columns of a row.
    pub(super) fn columns(&self, row: usize) -> usize {
        match self.limit[0].checked_sub(self.first_x(row)) {
            Some(width) => (width >> (self.t + 1)) as usize + 1,
            None => 0,
        }
    }
}

/// Row and column of a vertex in its level.
#[inline(always)]
pub(super) fn index_in(level: u32, p: GridPoint) -> (usize, usize) {
    let (t, is_white) = (level / 2, level & 1);
    ((p.y() >> (t + is_white)) as usize, (p.x() >> (t + 1)) as usize)
}

/// Values of a row's vertices where the DEM is not void far around. All others are what the level is made of elsewhere.
#[derive(Debug)]
pub(super) struct LevelRow<T> {
    /// Vertices of the row.
    columns: usize,
    /// First columns and values, from the west.
    runs: Vec<(usize, Box<[T]>)>,
}

impl<T> LevelRow<T> {
    /// A row of so many vertices, and the values of those that have any.
    pub(super) fn new(columns: usize, runs: Vec<(usize, Box<[T]>)>) -> Self {
        Self { columns, runs }
    }

    /// Vertices of the row.
    pub(super) fn columns(&self) -> usize {
        self.columns
    }

    /// Values of the `i`-th run.
    pub(super) fn run(&self, i: usize) -> Option<&[T]> {
        self.runs.get(i).map(|(_, values)| &**values)
    }

    /// The value of a vertex, if it has one.
    #[inline(always)]
    pub(super) fn get(&self, column: usize) -> Option<&T> {
        let (first, values) = self.runs[..self.runs.partition_point(|run| run.0 <= column)].last()?;
        values.get(column - first)
    }
}

impl<T: Copy> LevelRow<T> {
    /// At least the values from column `from` to `to`, as far as the row goes; `missing` for those that have none.
    pub(super) fn piece(&self, from: usize, to: usize, missing: T) -> Piece<'_, T> {
        let to = to.min(self.columns).max(from);
        let covers = |run: &&(usize, Box<[T]>)| run.0 <= from && to <= run.0 + run.1.len();
        if let Some((first, values)) = self.runs.iter().find(covers) {
            return Piece { from: *first, values: Cow::Borrowed(values) };
        }
        let mut values = vec![missing; to - from];
        for (first, run) in &self.runs {
            let (west, east) = (from.max(*first), to.min(first + run.len()));
            if west < east {
                values[west - from..east - from].copy_from_slice(&run[west - first..east - first]);
            }
        }
        Piece { from, values: Cow::Owned(values) }
    }
}

/// Values side by side.
#[derive(Debug)]
pub(super) struct Piece<'r, T: Copy> {
    /// Column of the first.
    pub(super) from: usize,
    pub(super) values: Cow<'r, [T]>,
}

impl<T: Copy> Piece<'_, T> {
    /// No values.
    pub(super) fn none() -> Self {
        Self { from: 0, values: Cow::Borrowed(&[]) }
    }

    /// The value of a column, if it is here.
    #[inline(always)]
    pub(super) fn get(&self, column: usize) -> Option<T> {
        self.values.get(column.wrapping_sub(self.from)).copied()
    }
}

#[derive(Debug)]
struct Rows<T> {
    first: usize,
    rows: VecDeque<LevelRow<T>>,
}

/// A value for every vertex of every level, row by row.
#[derive(Debug)]
pub(super) struct Levels<T> {
    grid: Grid,
    levels: Vec<Rows<T>>,
}

impl<T> Levels<T> {
    pub(super) fn new(grid: Grid) -> Self {
        let levels = (0..grid.levels()).map(|_| Rows { first: 0, rows: VecDeque::new() }).collect();
        Self { grid, levels }
    }

    pub(super) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// A row that has been pushed and not dropped.
    #[inline(always)]
    pub(super) fn row(&self, level: u32, row: usize) -> Option<&LevelRow<T>> {
        let rows = &self.levels[level as usize];
        rows.rows.get(row.checked_sub(rows.first)?)
    }

    /// Number of the next row to be pushed.
    pub(super) fn next_row(&self, level: u32) -> usize {
        let rows = &self.levels[level as usize];
        rows.first + rows.rows.len()
    }

    pub(super) fn push(&mut self, level: u32, row: LevelRow<T>) {
        self.levels[level as usize].rows.push_back(row);
    }

    /// Drops rows before `row`.
    pub(super) fn drop_below(&mut self, level: u32, row: usize) {
        let rows = &mut self.levels[level as usize];
        while rows.first < row && rows.rows.pop_front().is_some() {
            rows.first += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_enumerate_each_vertex_once() {
        for samples in [[17, 17], [12, 17], [9, 5], [10, 3]] {
            let grid = Grid::new(samples, [1.0, 1.0]).unwrap();
            let n = grid.side_steps();
            let mut count = 0;
            for level in 0..grid.levels() {
                let shape = LevelShape::new(&grid, level);
                for row in 0..shape.rows() {
                    for column in 0..shape.columns(row) {
                        let p = shape.point(row, column);
                        assert_eq!(grid.level(p), level, "{p:?}");
                        assert_eq!(shape.index(p), (row, column));
                        assert!(!shape.is_beyond(p) && !grid.is_beyond(p, level));
                        count += 1;
                    }
                }
            }
            let expected = (0..=n)
                .flat_map(|y| (0..=n).map(move |x| GridPoint::new(x, y)))
                .filter(|p| !grid.is_corner(*p) && !grid.is_beyond(*p, grid.level(*p)))
                .count();
            assert_eq!(count, expected);
        }
    }
}
