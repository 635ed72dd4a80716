//! The height of the ground at a place, from the records that are in memory.
//!
//! If the four samples around the place are in memory, it is their bilinear mean, as [`Terrain::height_m`](terrasoar_layout::read::terrain::Terrain::height_m) gives it. If one is
//! missing, it is the height of the finest triangle around the place whose corners are in memory. That is off by no more than the error of the vertex that would split the triangle.
//! Cost: four records, or two a level of the way down to that triangle.

use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, child_slots, corners, slot_of};
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::store::RecordStore;

/// A height, and how good it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeightAt {
    /// Metres; none outside the data and at voids.
    pub height_m: Option<f64>,
    /// Whether it is the data's own: no record that bears on it is away.
    pub is_exact: bool,
}

/// Grid points of the cell around a place in grid steps, and the place within it; none outside the data.
fn cell(samples: [u32; 2], at: [f64; 2]) -> Option<([u32; 2], [f64; 2])> {
    let last = samples.map(|n| n - 1);
    let inside = |axis: usize| (0.0..=f64::from(last[axis])).contains(&at[axis]);
    if !(inside(0) && inside(1)) {
        return None;
    }
    // At the last sample the cell before it is as good.
    let low = [0, 1].map(|axis| (at[axis] as u32).min(last[axis] - 1));
    Some((low, [0, 1].map(|axis| at[axis] - f64::from(low[axis]))))
}

fn at_hand<S: RecordStore>(store: &S, point: GridPoint) -> Option<Vertex> {
    let grid = store.grid();
    let level = if grid.is_corner(point) { 0 } else { grid.level(point) };
    Some(store.decode(store.get(slot_of(grid.k(), point))?, level))
}

/// Height at a place in metres east and north of the south-west sample.
pub fn height_at<S: RecordStore>(store: &S, east_m: f64, north_m: f64) -> HeightAt {
    let grid = store.grid();
    let [dx, dy] = grid.spacing_m();
    let at = [east_m / dx, north_m / dy];
    let Some(([x, y], [fx, fy])) = cell(grid.samples(), at) else {
        return HeightAt { height_m: None, is_exact: true };
    };
    let mut height_m = Some(0.0);
    for (point, weight) in [
        (GridPoint::new(x, y), (1.0 - fx) * (1.0 - fy)),
        (GridPoint::new(x + 1, y), fx * (1.0 - fy)),
        (GridPoint::new(x, y + 1), (1.0 - fx) * fy),
        (GridPoint::new(x + 1, y + 1), fx * fy),
    ] {
        if weight == 0.0 {
            continue;
        }
        let Some(vertex) = at_hand(store, point) else {
            return HeightAt { height_m: coarse_m(store, at), is_exact: false };
        };
        height_m = height_m.filter(|_| !vertex.class.is_void()).map(|sum| sum + weight * vertex.height_m);
    }
    HeightAt { height_m, is_exact: true }
}

/// Pages that the exact height at a place needs and that are away.
pub fn pages_away<S: RecordStore>(store: &S, east_m: f64, north_m: f64, mut each: impl FnMut(u64)) {
    let grid = store.grid();
    let [dx, dy] = grid.spacing_m();
    let Some(([x, y], _)) = cell(grid.samples(), [east_m / dx, north_m / dy]) else { return };
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let slot = slot_of(grid.k(), GridPoint::new(x + i, y + j));
        if store.get(slot).is_none() {
            each(S::page_of(slot));
        }
    }
}

/// Height of the finest triangle at hand around a place in grid steps.
fn coarse_m<S: RecordStore>(store: &S, at: [f64; 2]) -> Option<f64> {
    let grid = *store.grid();
    let c = corners(grid.k());
    let centre = c[0].midpoint(c[2]);
    // The root whose side is nearest.
    let half = f64::from(grid.side_steps()) / 2.0;
    let [x, y] = at.map(|v| v - half);
    let root = if x.abs() >= y.abs() {
        if x < 0.0 { 3 } else { 1 }
    } else if y < 0.0 {
        0
    } else {
        2
    };
    let (mut split, [b, d]) = ROOTS[root];
    let (mut apex_slot, mut apex, mut b, mut d) = (CENTRE_SLOT, centre, c[b], c[d]);
    let mut height = grid.levels() - 1;
    while let Some(raw) = store.get(split) {
        let vertex = store.decode(raw, height - 1);
        let v = b.midpoint(d);
        if height == 1 || !vertex.class.is_plain() {
            break;
        }
        let [left, right] = child_slots(apex_slot, split);
        // The side of the line from the apex to the split vertex that the place lies on: that of b or of d.
        let on_b = side_of(apex, v, at) * side_of(apex, v, [f64::from(b.x()), f64::from(b.y())]) >= 0.0;
        let next = if on_b { (left, b, apex) } else { (right, apex, d) };
        (apex_slot, apex, (split, b, d)) = (split, v, next);
        height -= 1;
    }
    let heights = [apex, b, d].map(|p| at_hand(store, p).filter(|v| !v.class.is_void()).map(|v| v.height_m));
    let [Some(h_apex), Some(h_b), Some(h_d)] = heights else { return None };
    let to_point = |p: GridPoint| [f64::from(p.x()), f64::from(p.y())];
    let area = side_of(apex, b, to_point(d));
    let (of_d, of_b) = (side_of(apex, b, at) / area, side_of(d, apex, at) / area);
    Some(h_apex + of_b * (h_b - h_apex) + of_d * (h_d - h_apex))
}

/// Twice the signed area of the triangle of two points and a place.
fn side_of(p: GridPoint, q: GridPoint, at: [f64; 2]) -> f64 {
    let (px, py) = (f64::from(p.x()), f64::from(p.y()));
    (f64::from(q.x()) - px) * (at[1] - py) - (f64::from(q.y()) - py) * (at[0] - px)
}
