//! Triangles of a refined mesh: their identity, which of them are drawn, and strips of them.
//!
//! A triangle is named by its longest edge and the side its apex lies on ([`TriangleKey`]), so meshes of different engines compare as
//! sets. Triangles that padding leaves without area are not drawn, nor are triangles that a void touches (FORMAT.md,
//! section 1).

use terrasoar_layout::grid::{Grid, GridPoint};
use terrasoar_layout::mix::Random;
use terrasoar_layout::read::store::RecordStore;

/// A triangle's corners in counter-clockwise order seen from above.
pub type Triangle = [GridPoint; 3];

/// Identity of a bin-tree triangle: the doubled midpoint of its longest edge and the side of its apex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TriangleKey(u64);

impl TriangleKey {
    /// The key of a triangle (apex; base).
    #[inline]
    pub fn new(apex: GridPoint, b: GridPoint, d: GridPoint) -> Self {
        let (x2, y2) = (u64::from(b.x() + d.x()), u64::from(b.y() + d.y()));
        let (ax2, ay2) = (2 * u64::from(apex.x()), 2 * u64::from(apex.y()));
        let side = ay2 > y2 || (ay2 == y2 && ax2 > x2);
        // A column of 18 bits is all that squares of less than 2^17 steps have; what larger ones have besides lies above the row's 22.
        let (low, high) = (x2 & 0x3_ffff, x2 >> 18);
        Self(high << 44 | (y2 << 18 | low) << 1 | u64::from(side))
    }

    /// The key of a triangle whose apex is not known: the corner opposite the longest edge.
    pub fn of(triangle: Triangle) -> Self {
        let [apex, b, d] = with_apex_first(triangle);
        Self::new(apex, b, d)
    }

    /// A well-mixed hash of the key; sums of these identify sets.
    #[inline]
    pub fn hash(self) -> u64 {
        Random::new(self.0).bits()
    }
}

/// Triangles with shared vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct IndexedMesh {
    /// Vertices in metres east, north and up.
    pub positions: Vec<[f64; 3]>,
    /// Triangles, counter-clockwise seen from above, as indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
}

/// Rotates a bin-tree triangle so that the corner opposite its longest edge comes first.
pub fn with_apex_first([p, q, r]: Triangle) -> Triangle {
    let length2 = |a: GridPoint, b: GridPoint| {
        let (dx, dy) = (i64::from(a.x()) - i64::from(b.x()), i64::from(a.y()) - i64::from(b.y()));
        dx * dx + dy * dy
    };
    let (pq, qr, rp) = (length2(p, q), length2(q, r), length2(r, p));
    if qr > pq && qr > rp {
        [p, q, r]
    } else if rp > pq {
        [q, r, p]
    } else {
        [r, p, q]
    }
}

/// The triangle that a bin-tree triangle is a half of; `None` for the four that have the square's centre for apex, and for what is no bin-tree triangle, as strips have them over
/// records that are not nested.
pub fn parent(grid: &Grid, [apex, b, d]: Triangle) -> Option<Triangle> {
    let n = grid.side_steps();
    if apex == GridPoint::new(n / 2, n / 2) || grid.is_corner(apex) || !is_right_isosceles([apex, b, d]) {
        return None;
    }
    // The apex is the middle of the parent's longest edge, one of whose ends is a corner here; the other corner is the parent's apex.
    let ends = grid.edge_ends(apex);
    let other = |end: GridPoint| if ends[0] == end { ends[1] } else { ends[0] };
    if ends.contains(&b) { Some([d, other(b), b]) } else { ends.contains(&d).then(|| [b, d, other(d)]) }
}

/// Whether the legs from the apex, which comes first, are as long as each other and at a right angle, in grid steps.
fn is_right_isosceles([apex, b, d]: Triangle) -> bool {
    let leg = |p: GridPoint| [i64::from(p.x()) - i64::from(apex.x()), i64::from(p.y()) - i64::from(apex.y())];
    let ([bx, by], [dx, dy]) = (leg(b), leg(d));
    bx * dx + by * dy == 0 && bx * bx + by * by == dx * dx + dy * dy
}

/// Twice the signed area in grid steps, padding not folded; positive if counter-clockwise.
pub fn twice_area([a, b, c]: Triangle) -> i64 {
    let (ax, ay) = (i64::from(a.x()), i64::from(a.y()));
    (i64::from(b.x()) - ax) * (i64::from(c.y()) - ay) - (i64::from(b.y()) - ay) * (i64::from(c.x()) - ax)
}

/// Whether a triangle keeps area when padding is folded onto the data.
pub fn has_area(grid: &Grid, triangle: Triangle) -> bool {
    twice_area(triangle.map(|p| grid.fold(p))) != 0
}

/// Whether an unsplit triangle is drawn.
pub fn is_drawn(records: &impl RecordStore, triangle: Triangle) -> bool {
    let grid = records.grid();
    if grid.has_padding() && !has_area(grid, triangle) {
        return false;
    }
    if !records.shape().has_voids {
        return true;
    }
    let [_, b, d] = with_apex_first(triangle);
    // The longest edge of the smallest triangles is a cell's diagonal: its midpoint is no grid point. Nor is that of many triangles which are none of a bin tree.
    if (b.x() + d.x()) & 1 == 1 || (b.y() + d.y()) & 1 == 1 {
        triangle.iter().all(|p| !records.vertex_at(*p).class.is_void())
    } else {
        records.vertex_at(b.midpoint(d)).class.is_plain()
    }
}

/// Calls `visit` with the triangles of a strip in counter-clockwise order. Vertices repeated to turn the strip make no triangle.
pub(crate) fn for_each_in_strip(strip: impl Iterator<Item = GridPoint>, mut visit: impl FnMut(Triangle)) {
    let mut last: [Option<GridPoint>; 2] = [None; 2];
    let mut odd = true;
    for p in strip {
        if let [Some(a), Some(b)] = last
            && a != b
            && b != p
            && a != p
        {
            visit(if odd { [b, a, p] } else { [a, b, p] });
        }
        last = [last[1], Some(p)];
        odd = !odd;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parent_is_twice_as_large_and_turns_the_same_way() {
        let grid = Grid::new([17, 17], [1.0, 1.0]).unwrap();
        let mut triangle = [GridPoint::new(4, 5), GridPoint::new(3, 5), GridPoint::new(4, 4)];
        assert!(twice_area(triangle) > 0);
        let mut steps = 0;
        while let Some(above) = parent(&grid, with_apex_first(triangle)) {
            assert_eq!(twice_area(above), 2 * twice_area(triangle));
            assert_eq!(with_apex_first(above), above);
            triangle = above;
            steps += 1;
        }
        assert_eq!(steps, 7);
    }

    /// What strips over records of nonsense are made of.
    #[test]
    fn no_triangle_of_whatever_corners_is_too_much() {
        let terrain = crate::testing::square_terrain(3);
        let records = terrain.records().unwrap();
        terrasoar_layout::with_records!(records, records => {
            let grid = *terrain.grid();
            let points: Vec<GridPoint> = (0..9).flat_map(|y| (0..9).map(move |x| GridPoint::new(x, y))).collect();
            for (i, a) in points.iter().enumerate() {
                for (j, b) in points.iter().enumerate().filter(|(j, _)| (i + j) % 3 == 0) {
                    for (_, d) in points.iter().enumerate().filter(|(k, _)| (i + j + k) % 4 == 1) {
                        let triangle = [*a, *b, *d];
                        let _ = (is_drawn(&records, triangle), TriangleKey::of(triangle));
                        let mut above = parent(&grid, with_apex_first(triangle));
                        let mut steps = 0;
                        while let Some(triangle) = above {
                            assert_eq!(with_apex_first(triangle), triangle);
                            above = parent(&grid, triangle);
                            steps += 1;
                        }
                        assert!(steps <= 6, "{triangle:?}");
                    }
                }
            }
        });
    }

    /// Midpoints of edges of the largest square, whose doubled coordinates have 22 bits, each bit by itself and all together.
    #[test]
    fn keys_tell_triangles_of_the_largest_square_apart() {
        let ends: Vec<u32> = (0..=20).map(|bit| 1 << bit).chain([0, (1 << 20) - 1]).collect();
        let mut keys = std::collections::HashSet::new();
        for (x, y) in ends.iter().flat_map(|x| ends.iter().map(move |y| (*x, *y))) {
            let (b, d) = (GridPoint::new(x, y), GridPoint::new(x, y + 2));
            let apexes = [GridPoint::new(x + 1, y + 1), GridPoint::new(x.wrapping_sub(1), y + 1)];
            for apex in apexes.into_iter().filter(|apex| apex.x() <= 1 << 20) {
                assert!(keys.insert(TriangleKey::new(apex, b, d)), "{x} {y}");
            }
        }
        assert!(keys.len() > 2 * 22 * 22);
    }

    #[test]
    fn keys_do_not_depend_on_rotation_and_tell_sides_apart() {
        let [a, b, c] = [GridPoint::new(4, 4), GridPoint::new(0, 8), GridPoint::new(8, 8)];
        let keys = [[a, b, c], [b, c, a], [c, a, b]].map(TriangleKey::of);
        assert!(keys.iter().all(|k| *k == keys[0]));
        assert_eq!(keys[0], TriangleKey::new(a, b, c));
        assert_ne!(keys[0], TriangleKey::new(GridPoint::new(4, 12), b, c));
        assert_eq!(with_apex_first([b, c, a])[0], a);
    }
}
