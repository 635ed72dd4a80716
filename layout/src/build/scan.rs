//! The bounded error of every vertex before saturation: the largest distance of any sample from the two triangles
//! the vertex splits, by brute force, tile by tile.
//!
//! A tile scans the triangles inside it level by level and adds its samples to the larger triangles it lies in. Tiles share
//! only maxima, kept in atomics, so they run in parallel and in any order. Cost: each sample is compared with one or two planes a level,
//! about two nanoseconds of one core each. Triangles that padding deforms are left to [`crate::bound`].

use super::band::Band;
use super::land::Land;
use super::levels::{Levels, index_in};
use crate::bound::{
    Plane, Samples, farthest_diagonal, farthest_level, farthest_upright, larger, scanned_error_m,
};
use crate::grid::order::corners;
use crate::grid::{Grid, GridPoint};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Own errors in metres, as the bits of non-negative singles, whose order is that of the numbers.
pub(super) type OwnErrors = Levels<AtomicU32>;

/// Scans the tiles of one row of tiles, whose south border is row `tile_y * side`.
pub(super) fn scan_tile_row(
    grid: &Grid,
    land: &Land,
    band: &Band<'_>,
    own: &OwnErrors,
    tile_y: u32,
    side: u32,
    step_m: f64,
) {
    let [wide, high] = grid.samples();
    let y0 = tile_y * side;
    debug_assert!(y0 < high);
    let last = (wide - 1).div_ceil(side).max(1) - 1;
    let mut tiles: Vec<u32> = land
        .runs(y0..=(y0 + side).min(high - 1))
        .into_iter()
        // A tile's border is its neighbour's as well.
        .flat_map(|run| run.start.saturating_sub(1) / side..=((run.end - 1) / side).min(last))
        .collect();
    tiles.dedup();
    tiles.into_par_iter().for_each_init(Vec::new, |buffer, tile_x| {
        let Some(tile) = Tile::load(grid, band, tile_x * side, y0, side, buffer) else { return };
        tile.scan_inside(own, step_m);
        tile.scan_around(own, step_m);
    });
}

struct Tile<'a> {
    grid: &'a Grid,
    band: &'a Band<'a>,
    x0: u32,
    y0: u32,
    side: u32,
    /// Samples of the tile that exist, east and north.
    samples: [u32; 2],
    /// Filled codes with NaN at voids, rows of `side + 1`.
    codes: &'a [f64],
}

impl Samples for Tile<'_> {
    #[inline(always)]
    fn corner(&self, x: u32, y: u32) -> (GridPoint, f64) {
        let inside = x < self.samples[0] && y < self.samples[1];
        let at = || self.codes[y as usize * (self.side as usize + 1) + x as usize];
        (GridPoint::new(self.x0 + x, self.y0 + y), if inside { at() } else { f64::NAN })
    }

    #[inline(always)]
    fn row(&self, plane: &Plane, from: u32, to: u32, y: u32) -> f64 {
        let at = y as usize * (self.side as usize + 1);
        plane.farthest_in_row(self.x0 + from, self.y0 + y, &self.codes[at + from as usize..=at + to as usize])
    }
}

impl<'a> Tile<'a> {
    /// The tile with its south-west corner at (`x0`, `y0`); `None` if it is wholly void and has nothing to say.
    fn load(
        grid: &'a Grid,
        band: &'a Band<'a>,
        x0: u32,
        y0: u32,
        side: u32,
        buffer: &'a mut Vec<f64>,
    ) -> Option<Self> {
        let samples = [0, 1].map(|i| (grid.samples()[i] - [x0, y0][i]).min(side + 1));
        buffer.clear();
        buffer.resize((side as usize + 1) * (side as usize + 1), f64::NAN);
        let rows = buffer.chunks_exact_mut(side as usize + 1).zip(y0..y0 + samples[1]);
        let mut any = false;
        for (to, y) in rows {
            any |= band.copy_heights(y, x0, &mut to[..samples[0] as usize]);
        }
        if !any {
            return None;
        }
        Some(Self { grid, band, x0, y0, side, samples, codes: buffer })
    }

    /// Scans all triangles whose split vertex has a level of at least [`FIRST_SCANNED`] and that lie inside the tile.
    fn scan_inside(&self, own: &OwnErrors, step_m: f64) {
        let mut s = 2;
        while s < self.side {
            // Most triangles are of the smallest three sizes; with the size known to the compiler their rows are no loops.
            match s {
                2 => self.scan_size(own, 2, step_m),
                4 => self.scan_size(own, 4, step_m),
                8 => self.scan_size(own, 8, step_m),
                _ => self.scan_size(own, s, step_m),
            }
            s *= 2;
        }
    }

    #[inline(always)]
    fn scan_size(&self, own: &OwnErrors, s: u32, step_m: f64) {
        self.scan_black(own, s, step_m);
        self.scan_white(own, s, step_m);
    }

    /// Triangles on axis-aligned edges of length 2s.
    #[inline(always)]
    fn scan_black(&self, own: &OwnErrors, s: u32, step_m: f64) {
        for y in (0..self.samples[1]).step_by(s as usize) {
            let odd_row = (y / s) & 1 == 1;
            let first = if odd_row { 0 } else { s };
            for x in (first..self.samples[0].min(self.side + 1)).step_by(2 * s as usize) {
                let farthest =
                    if odd_row { farthest_upright(self, x, y, s) } else { farthest_level(self, x, y, s) };
                self.raise(own, 2 * s.trailing_zeros(), x, y, farthest, step_m);
            }
        }
    }

    /// Triangles on the diagonals of squares of side 2s.
    #[inline(always)]
    fn scan_white(&self, own: &OwnErrors, s: u32, step_m: f64) {
        for y in (s..self.samples[1].min(self.side)).step_by(2 * s as usize) {
            for x in (s..self.samples[0].min(self.side)).step_by(2 * s as usize) {
                let v = GridPoint::new(self.x0 + x, self.y0 + y);
                let [b, d] = self.grid.edge_ends(v);
                // Rising: the diagonal climbs from south-west to north-east.
                let rising = (b.x() < d.x()) == (b.y() < d.y());
                let farthest = farthest_diagonal(self, x, y, s, rising);
                self.raise(own, 2 * s.trailing_zeros() + 1, x, y, farthest, step_m);
            }
        }
    }

    /// Adds the tile's samples to every larger triangle that contains one of its four quarters.
    fn scan_around(&self, own: &OwnErrors, step_m: f64) {
        if self.side == self.grid.side_steps() || self.samples.iter().any(|s| *s < 2) {
            return;
        }
        let half = self.side / 2;
        // Doubled coordinates of a point inside each quarter: south, east, north, west.
        let (cx, cy) = (2 * self.x0 + self.side, 2 * self.y0 + self.side);
        let quarters = [(cx, cy - half), (cx + half, cy), (cx, cy + half), (cx - half, cy)];
        for (quarter, (px, py)) in quarters.into_iter().enumerate() {
            for_each_triangle_around(self.grid, px, py, self.side, |split, triangle| {
                if triangle.iter().any(|p| self.grid.is_padding(*p)) {
                    return;
                }
                let codes = triangle.map(|p| self.band.coarse_code(p));
                let [Some(a), Some(b), Some(d)] = codes else { return };
                let plane = Plane::of([(triangle[0], a), (triangle[1], b), (triangle[2], d)]);
                let mut farthest = 0.0f64;
                for row in 0..self.samples[1] {
                    let (south, north) = (row, self.side - row);
                    let (from, to) = match quarter {
                        0 if south <= half => (south, self.side - south),
                        2 if north <= half => (north, self.side - north),
                        1 => (self.side - south.min(north), self.side),
                        3 => (0, south.min(north)),
                        _ => continue,
                    };
                    farthest = larger(farthest, self.row(&plane, from, to, row));
                }
                own.raise(split, farthest, step_m);
            });
        }
    }

    #[inline(always)]
    fn raise(&self, own: &OwnErrors, level: u32, x: u32, y: u32, farthest: f64, step_m: f64) {
        if farthest <= 0.0 {
            return;
        }
        let v = GridPoint::new(self.x0 + x, self.y0 + y);
        let Some(cell) = own.cell(level, v) else { return };
        let bits = scanned_error_m(farthest, step_m).to_bits();
        // What lies on the border is the next tile's as well; nobody else has to do with what lies inside.
        if x > 0 && y > 0 && x < self.side && y < self.side {
            cell.store(bits, Ordering::Relaxed);
        } else {
            cell.fetch_max(bits, Ordering::Relaxed);
        }
    }
}

/// Calls `visit(split vertex, [apex, base, base])` for the bin-tree triangles that contain the point (`px`, `py`), in half steps, and
/// whose split vertex lies on a coarser grid than tiles of `side` steps hold.
fn for_each_triangle_around(
    grid: &Grid,
    px: u32,
    py: u32,
    side: u32,
    mut visit: impl FnMut(GridPoint, [GridPoint; 3]),
) {
    let n = grid.side_steps();
    let c = corners(grid.k());
    let centre = GridPoint::new(n / 2, n / 2);
    let contains = |[a, b, d]: [GridPoint; 3]| {
        let cross = |p: GridPoint, q: GridPoint| {
            (2 * i64::from(q.x()) - 2 * i64::from(p.x())) * (i64::from(py) - 2 * i64::from(p.y()))
                - (2 * i64::from(q.y()) - 2 * i64::from(p.y())) * (i64::from(px) - 2 * i64::from(p.x()))
        };
        let signs = [cross(a, b), cross(b, d), cross(d, a)];
        signs.iter().all(|s| *s >= 0) || signs.iter().all(|s| *s <= 0)
    };
    // The centre's own triangles: the two halves of the square along the diagonal it splits.
    let [b, d] = grid.edge_ends(centre);
    for apex in grid.apexes(centre) {
        if contains([apex, b, d]) {
            visit(centre, [apex, b, d]);
            break;
        }
    }
    let roots = [[centre, c[0], c[1]], [centre, c[1], c[2]], [centre, c[2], c[3]], [centre, c[3], c[0]]];
    let Some(mut triangle) = roots.into_iter().find(|t| contains(*t)) else { return };
    let first_level = 2 * side.trailing_zeros();
    loop {
        let [a, b, d] = triangle;
        let v = b.midpoint(d);
        if grid.level(v) < first_level {
            return;
        }
        visit(v, triangle);
        triangle = if contains([v, b, a]) { [v, b, a] } else { [v, a, d] };
    }
}

impl OwnErrors {
    /// The own error of a vertex of this level.
    #[inline(always)]
    fn cell(&self, level: u32, v: GridPoint) -> Option<&AtomicU32> {
        let (row, column) = index_in(level, v);
        self.row(level, row)?.get(column)
    }

    /// Raises the own error of `v` to at least `codes` height codes.
    fn raise(&self, v: GridPoint, codes: f64, step_m: f64) {
        if let Some(cell) = self.cell(self.grid().level(v), v) {
            cell.fetch_max(scanned_error_m(codes, step_m).to_bits(), Ordering::Relaxed);
        }
    }
}
