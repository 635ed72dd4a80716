//! Triangles that padding deforms: how far the surface moves when their vertex is split.
//!
//! Where a diagonal edge crosses the data's border, its folded midpoint leaves the folded edge, so the two triangles of the
//! diamond and their four children cover the same ground with differently placed edges. Both surfaces are piecewise
//! linear and equal at the diamond's corners; their largest difference is at the new vertex or where the old edge crosses
//! a new one.

/// A folded point: x, y in metres, z in any unit.
type Point = [f64; 3];

/// Twice the signed area of the triangle `a`, `b`, `c` in the plane.
fn area(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Height at `p` of the plane through a triangle of non-zero area that contains it.
fn height_in(triangle: [Point; 3], p: Point) -> Option<f64> {
    let [a, b, c] = triangle;
    let whole = area(a, b, c);
    if whole == 0.0 {
        return None;
    }
    let weights = [area(p, b, c) / whole, area(a, p, c) / whole, area(a, b, p) / whole];
    weights.iter().all(|w| *w >= -1e-9).then(|| weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2])
}

/// Heights of the segments `p`-`q` and `r`-`s` where they cross properly.
fn heights_at_crossing([p, q]: [Point; 2], [r, s]: [Point; 2]) -> Option<(f64, f64)> {
    let (at_p, at_q) = (area(r, s, p), area(r, s, q));
    let (at_r, at_s) = (area(p, q, r), area(p, q, s));
    if at_p * at_q >= 0.0 || at_r * at_s >= 0.0 {
        return None;
    }
    let (t, u) = (at_p / (at_p - at_q), at_r / (at_r - at_s));
    Some((p[2] + t * (q[2] - p[2]), r[2] + u * (s[2] - r[2])))
}

/// Largest vertical distance between the triangles (apex; base) and those that inserting `vertex` makes of them; 0 if none has area.
pub(crate) fn deviation(vertex: Point, base: [Point; 2], apexes: &[Point]) -> f64 {
    let mut deviation = 0.0f64;
    for &apex in apexes {
        if let Some(height) = height_in([apex, base[0], base[1]], vertex) {
            deviation = deviation.max((vertex[2] - height).abs());
        }
        if let Some((old, new)) = heights_at_crossing(base, [vertex, apex]) {
            deviation = deviation.max((old - new).abs());
        }
    }
    deviation
}

/// Whether any of the triangles (apex; base) has area.
pub(crate) fn has_area(base: [Point; 2], apexes: &[Point]) -> bool {
    apexes.iter().any(|apex| area(*apex, base[0], base[1]) != 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_on_its_edge_deviates_by_its_distance_from_it() {
        let base = [[0.0, 0.0, 10.0], [4.0, 0.0, 30.0]];
        let apexes = [[2.0, 2.0, 5.0], [2.0, -2.0, 7.0]];
        assert!((deviation([2.0, 0.0, 26.0], base, &apexes) - 6.0).abs() < 1e-12);
        assert!((deviation([3.0, 0.0, 26.0], base, &apexes) - 1.0).abs() < 1e-12);
        assert!(has_area(base, &apexes) && !has_area(base, &[[9.0, 0.0, 1.0]]));
    }

    /// Against brute force: both surfaces sampled densely on a diamond whose far end is folded.
    #[test]
    fn a_folded_diagonal_deviates_as_sampling_says() {
        let base = [[0.0, 0.0, 3.0], [3.0, 4.0, 9.0]]; // (4, 4) folded to x = 3
        let apexes = [[3.0, 0.0, -2.0], [0.0, 4.0, 6.0]];
        let vertex = [2.0, 2.0, 1.0];
        let children: Vec<[Point; 3]> =
            apexes.iter().flat_map(|a| [[vertex, base[0], *a], [vertex, *a, base[1]]]).collect();
        let mut sampled = 0.0f64;
        for i in 0..=300 {
            for j in 0..=400 {
                let p = [f64::from(i) / 100.0, f64::from(j) / 100.0, 0.0];
                let old = apexes.iter().find_map(|a| height_in([*a, base[0], base[1]], p));
                let new = children.iter().find_map(|t| height_in(*t, p));
                sampled = sampled.max((old.unwrap() - new.unwrap()).abs());
            }
        }
        let exact = deviation(vertex, base, &apexes);
        assert!(sampled <= exact + 1e-9 && sampled > exact * 0.97, "{sampled} {exact}");
    }
}
