//! From a place in the new grid to a place among the old samples: the new grid's coordinates, another system's, the old grid's columns and rows.
//!
//! The projection is computed at the nodes of a mesh, and places between them are interpolated where that is right to a five-hundredth of a step. Otherwise it is computed everywhere.
//! Cost: a microsecond a node.

use crate::crs::Ground;

/// The way between two systems.
#[derive(Debug, Clone)]
pub(crate) struct Projections {
    pub(crate) old: Ground,
    pub(crate) new: Ground,
}

/// From the new grid to the old one.
#[derive(Debug, Clone)]
pub(crate) struct Mapping {
    /// Columns and rows of the new grid to coordinates.
    pub(super) new_map: [f64; 6],
    /// Coordinates to columns and rows of the old grid.
    old_inverse: [f64; 6],
    projections: Option<Projections>,
    /// A full turn in the old system's unit, and the middle of the old grid.
    turn: Option<(f64, f64)>,
}

/// The affine map the other way.
pub(super) fn inverse([x, a, b, y, d, e]: [f64; 6]) -> [f64; 6] {
    let determinant = a * e - b * d;
    let [ia, ib, id, ie] = [e / determinant, -b / determinant, -d / determinant, a / determinant];
    [-(ia * x + ib * y), ia, ib, -(id * x + ie * y), id, ie]
}

pub(crate) fn apply(map: &[f64; 6], [u, v]: [f64; 2]) -> [f64; 2] {
    [map[0] + map[1] * u + map[2] * v, map[3] + map[4] * u + map[5] * v]
}

/// Nodes of the mesh on each side of a cell.
const CELL: usize = 16;
/// Farthest that an interpolated place may be off, in old steps.
const OFF_STEPS: f64 = 0.002;

impl Mapping {
    pub(crate) fn new(
        new_map: [f64; 6],
        old_map: [f64; 6],
        old_columns: u32,
        projections: Option<Projections>,
    ) -> Self {
        let middle = old_map[0] + old_map[1] * f64::from(old_columns - 1) / 2.0;
        let turn = projections.as_ref().and_then(|both| both.old.turn()).map(|turn| (turn, middle));
        Self { new_map, old_inverse: inverse(old_map), projections, turn }
    }

    /// Column and row of the old grid at a column and row of the new one; NaN where there is no such place.
    pub(super) fn place(&self, at: [f64; 2]) -> [f64; 2] {
        let mut point = apply(&self.new_map, at);
        if let Some(both) = &self.projections {
            match both.new.across_to(&both.old, point) {
                Some(found) => point = found,
                None => return [f64::NAN; 2],
            }
        }
        if let Some((turn, middle)) = self.turn {
            point[0] += turn * ((middle - point[0]) / turn).round();
        }
        apply(&self.old_inverse, point)
    }

    /// The places of a block of the new grid from `first` on, row by row.
    pub(crate) fn places(&self, first: [f64; 2], size: [usize; 2]) -> Vec<[f64; 2]> {
        let [wide, high] = size;
        let mut places = vec![[f64::NAN; 2]; wide * high];
        if self.projections.is_none() {
            for (i, place) in places.iter_mut().enumerate() {
                *place = self.place([first[0] + (i % wide) as f64, first[1] + (i / wide) as f64]);
            }
            return places;
        }
        for top in (0..high).step_by(CELL) {
            for left in (0..wide).step_by(CELL) {
                let (right, bottom) = ((left + CELL).min(wide), (top + CELL).min(high));
                self.cell(first, wide, [left, right], [top, bottom], &mut places);
            }
        }
        places
    }

    fn cell(
        &self,
        first: [f64; 2],
        wide: usize,
        [left, right]: [usize; 2],
        [top, bottom]: [usize; 2],
        places: &mut [[f64; 2]],
    ) {
        let at = |x: f64, y: f64| self.place([first[0] + x, first[1] + y]);
        let (x0, x1) = (left as f64, (right - 1).max(left) as f64);
        let (y0, y1) = (top as f64, (bottom - 1).max(top) as f64);
        let corners = [at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1)];
        let between = |s: f64, t: f64| -> [f64; 2] {
            std::array::from_fn(|i| {
                let [a, b, c, d] = corners.map(|corner| corner[i]);
                (1.0 - t) * ((1.0 - s) * a + s * b) + t * ((1.0 - s) * c + s * d)
            })
        };
        let is_near =
            [(0.5, 0.5), (0.5, 0.0), (0.0, 0.5), (1.0, 0.5), (0.5, 1.0)].into_iter().all(|(s, t)| {
                let [guess, true_place] = [between(s, t), at(x0 + s * (x1 - x0), y0 + t * (y1 - y0))];
                let off = (guess[0] - true_place[0]).abs().max((guess[1] - true_place[1]).abs());
                off <= OFF_STEPS
            });
        for y in top..bottom {
            for x in left..right {
                places[y * wide + x] = if is_near {
                    let s = if x1 > x0 { (x as f64 - x0) / (x1 - x0) } else { 0.0 };
                    let t = if y1 > y0 { (y as f64 - y0) / (y1 - y0) } else { 0.0 };
                    between(s, t)
                } else {
                    at(x as f64, y as f64)
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_have_inverses() {
        let map = [500.0, 8.0, 5.0, 900.0, 4.0, -7.0];
        let there = apply(&map, [3.0, 4.0]);
        let back = apply(&inverse(map), there);
        assert!((back[0] - 3.0).abs() < 1e-12 && (back[1] - 4.0).abs() < 1e-12);
    }
}
