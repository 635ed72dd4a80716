//! Triangles cut at the sides of a rectangle of samples.
//!
//! Sides are cut one after the other (I. Sutherland, G. Hodgman, "Reentrant polygon clipping", CACM 17(1), 1974), in one order, and a cut is computed from the edge's ends in one order too: the
//! two triangles of an edge get the same point to the last bit, so that no crack opens.

use terrasoar_layout::grid::GridPoint;

/// A point: column and row in samples, height in metres.
pub(super) type Corner = [f64; 3];

/// Columns and rows from the first to the last, both included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rectangle {
    pub(super) from: [u32; 2],
    pub(super) to: [u32; 2],
}

impl Rectangle {
    /// Whether a triangle may share area with it: whether what lies around both does.
    pub(super) fn meets(&self, triangle: [GridPoint; 3]) -> bool {
        let [a, b, c] = triangle;
        let meets = |axis: usize, at: [u32; 3]| {
            let (low, high) = (at[0].min(at[1]).min(at[2]), at[0].max(at[1]).max(at[2]));
            low < self.to[axis] && high > self.from[axis]
        };
        meets(0, [a.x(), b.x(), c.x()]) && meets(1, [a.y(), b.y(), c.y()])
    }

    /// Whether all of a triangle lies in it.
    pub(super) fn holds(&self, triangle: &[Corner; 3]) -> bool {
        let is_in = |corner: &Corner, axis: usize| {
            (f64::from(self.from[axis])..=f64::from(self.to[axis])).contains(&corner[axis])
        };
        triangle.iter().all(|corner| is_in(corner, 0) && is_in(corner, 1))
    }

    /// The polygon that a triangle shares with it, turning as the triangle does; nothing if they share no area.
    pub(super) fn clip(&self, triangle: &[Corner; 3]) -> Vec<Corner> {
        let mut polygon = triangle.to_vec();
        for axis in 0..2 {
            for (side, sign) in [(self.from[axis], 1.0), (self.to[axis], -1.0)] {
                polygon = cut(&polygon, axis, f64::from(side), sign);
            }
        }
        polygon.dedup_by(|a, b| a[..2] == b[..2]);
        if polygon.len() > 1 && polygon[0][..2] == polygon[polygon.len() - 1][..2] {
            polygon.pop();
        }
        if polygon.len() < 3 || twice_area(&polygon) <= 0.0 { Vec::new() } else { polygon }
    }
}

/// What of a polygon lies where `sign * (coordinate - side)` is 0 or more.
fn cut(polygon: &[Corner], axis: usize, side: f64, sign: f64) -> Vec<Corner> {
    let within = |corner: &Corner| sign * (corner[axis] - side) >= 0.0;
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, corner) in polygon.iter().enumerate() {
        let next = &polygon[(i + 1) % polygon.len()];
        if within(corner) {
            kept.push(*corner);
        }
        if within(corner) != within(next) {
            kept.push(crossing(corner, next, axis, side));
        }
    }
    kept
}

/// Where an edge crosses a side.
fn crossing(a: &Corner, b: &Corner, axis: usize, side: f64) -> Corner {
    let (low, high) = if a[..2] <= b[..2] { (a, b) } else { (b, a) };
    let share = (side - low[axis]) / (high[axis] - low[axis]);
    let mut point: Corner = std::array::from_fn(|i| low[i] + share * (high[i] - low[i]));
    point[axis] = side;
    point
}

fn twice_area(polygon: &[Corner]) -> f64 {
    let next = |i: usize| polygon[(i + 1) % polygon.len()];
    (0..polygon.len()).map(|i| polygon[i][0] * next(i)[1] - next(i)[0] * polygon[i][1]).sum()
}
