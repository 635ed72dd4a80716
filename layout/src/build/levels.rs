//! Rows of values for the vertices of each level: what the build keeps while it works its way north and up the levels.
//!
//! Row and column of a level count only its own vertices, so a level of spacing 2^t costs 4^t times less than the finest. Rows are made, used
//! and dropped from south to north; memory is a few rows a level.

use crate::grid::{Grid, GridPoint};
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
}

impl LevelShape {
    pub(super) fn new(grid: &Grid, level: u32) -> Self {
        let reach = grid.reach_steps(level);
        let limit = grid.samples().map(|s| (s - 1 + reach - 1).min(grid.side_steps()));
        Self { level, t: level / 2, white: level & 1 == 1, limit }
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

#[derive(Debug)]
struct Rows<T> {
    first: usize,
    rows: VecDeque<Box<[T]>>,
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
    pub(super) fn row(&self, level: u32, row: usize) -> Option<&[T]> {
        let rows = &self.levels[level as usize];
        rows.rows.get(row.checked_sub(rows.first)?).map(|r| &**r)
    }

    /// Number of the next row to be pushed.
    pub(super) fn next_row(&self, level: u32) -> usize {
        let rows = &self.levels[level as usize];
        rows.first + rows.rows.len()
    }

    pub(super) fn push(&mut self, level: u32, row: Box<[T]>) {
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
