//! Two vertices tested at once, for a walk that always meets them in twos.
//!
//! Based on: nothing but [`Metric`]'s own tests. Invariant: the same operations in the same order on every vertex, so the answers are those of [`Metric`]
//! to the last bit. Cost: the arithmetic of one test for two vertices, and of two planes for four.

use super::{ALL_PLANES, Metric, PLANES};
use crate::view::ErrorMetric;
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::grid::{Grid, GridPoint};
use wide::{f64x2, f64x4, i32x4};

/// The tests of a view over a grid, two vertices at once; `SIGHT` is whether errors are measured along the line of sight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PairMetric<const SIGHT: bool> {
    /// East and north.
    eye_m: f64x2,
    eye_height_m: f64x2,
    nu: f64x2,
    exaggeration: f64x2,
    radius_factor: f64x2,
    /// Last column and row: what lies beyond is padding and folded onto it.
    last: f64x2,
    spacing_m: f64x2,
    /// The planes' normals, an axis each.
    normals: [f64x4; 3],
}

/// Two vertices relative to the eye.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SightedPair {
    /// East and north, of each vertex.
    offset_m: [f64x2; 2],
    /// Up, of both.
    height_m: f64x2,
    radius_m: f64x2,
    /// A bit a vertex.
    selected: u32,
}

impl<const SIGHT: bool> PairMetric<SIGHT> {
    pub(crate) fn new(metric: &Metric, grid: &Grid) -> Self {
        debug_assert_eq!(SIGHT, metric.kind == ErrorMetric::Sight);
        Self {
            eye_m: f64x2::new([metric.eye_m[0], metric.eye_m[1]]),
            eye_height_m: f64x2::splat(metric.eye_m[2]),
            nu: f64x2::splat(metric.nu),
            exaggeration: f64x2::splat(metric.exaggeration),
            radius_factor: f64x2::splat(metric.radius_factor),
            last: f64x2::new(grid.samples().map(|n| f64::from(n - 1))),
            spacing_m: f64x2::new(grid.spacing_m()),
            normals: [0, 1, 2]
                .map(|axis| f64x4::new(std::array::from_fn(|i: usize| metric.normals[i][axis]))),
        }
    }

    /// The vertices at two grid points as seen from the eye: [`Metric::sight`] and whether they are selected.
    #[inline(always)]
    pub(crate) fn sight(&self, points: [GridPoint; 2], vertices: &[Vertex; 2]) -> SightedPair {
        let both = |get: fn(&Vertex) -> f64| f64x2::new(vertices.each_ref().map(get));
        let offset_m = points.map(|p| {
            // Coordinates are far below 2^31, so their words are as well signed.
            let steps = f64x2::from_i32x4_lower2(i32x4::new([p.x() as i32, p.y() as i32, 0, 0]));
            steps.fast_min(self.last) * self.spacing_m - self.eye_m
        });
        let height_m = both(|v| v.height_m) * self.exaggeration - self.eye_height_m;
        let radius_m = both(|v| v.radius_m) * self.radius_factor;
        let error_m = both(|v| v.error_m) * self.exaggeration;
        let seen_m = self.nu * error_m;
        let [x2, y2] = f64x2::transpose(offset_m.map(|xy| xy * xy));
        let across2 = x2 + y2;
        let distance2 = across2 + height_m * height_m;
        let selected = if SIGHT {
            let span_m = radius_m + error_m;
            let reach_m = seen_m + span_m;
            let is_plain = both(|v| if v.class.is_plain() { 1.0 } else { 0.0 }).simd_gt(f64x2::ZERO);
            let (tube_m, ring2_m) = (is_plain.select(span_m, reach_m), is_plain.select(seen_m, f64x2::ZERO));
            let beyond2 = distance2 - tube_m * reach_m;
            let is_in_tube = (beyond2 * beyond2).simd_lt(ring2_m * ring2_m * across2);
            (beyond2.simd_lt(f64x2::ZERO) | is_in_tube).to_bitmask()
        } else {
            let reach_m = seen_m + radius_m;
            distance2.simd_lt(reach_m * reach_m).to_bitmask()
        };
        SightedPair { offset_m, height_m, radius_m, selected }
    }

    /// Tests the sphere of the pair's `i`-th vertex against the planes of `mask`: [`Metric::cull`].
    #[inline(always)]
    pub(crate) fn cull(&self, pair: &SightedPair, i: usize, mask: u8) -> Option<u8> {
        let [x, y] = pair.offset_m[i].to_array().map(f64x4::splat);
        let [z, radius_m] = [pair.height_m, pair.radius_m].map(|both| f64x4::splat(both.to_array()[i]));
        let [a, b, c] = self.normals;
        let height = a * x + b * y + c * z;
        if height.simd_gt(radius_m).to_bitmask() & u32::from(mask) != 0 {
            return None;
        }
        Some(mask & !(height.simd_lt(-radius_m).to_bitmask() as u8))
    }
}

impl SightedPair {
    /// Whether the pair's `i`-th vertex is near enough for its error to show.
    #[inline(always)]
    pub(crate) fn is_selected(&self, i: usize) -> bool {
        self.selected & 1 << i != 0
    }
}

const _: () = assert!(PLANES == 4 && ALL_PLANES == 0b1111);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::{View, Viewport};
    use terrasoar_layout::grid::record::VertexClass;

    /// Against the definition, bit for bit, on vertices near the borders of both tests too.
    #[test]
    fn pairs_decide_as_the_metric_does() {
        decide::<false>(ErrorMetric::Ball);
        decide::<true>(ErrorMetric::Sight);
    }

    fn decide<const SIGHT: bool>(kind: ErrorMetric) {
        let grid = Grid::new([700, 1025], [10.0, 3.7]).unwrap();
        let mut random = 1u64;
        let mut next = |below: f64| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1u64 << 53) as f64 * below
        };
        let mut decided = [0; 4];
        for round in 0..20_000 {
            let view = View::new([next(7000.0), next(3700.0), next(900.0)], next(360.0), -next(80.0))
                .viewport(Viewport { width_px: 800, height_px: 600 })
                .exaggeration([1.0, 0.3, 2.5][round % 3])
                .metric(kind);
            let metric = Metric::new(&view);
            let points = [0, 1].map(|_| GridPoint::new(next(1025.0) as u32, next(1025.0) as u32));
            let mut vertices = [0, 1].map(|_| Vertex {
                height_m: next(1000.0),
                error_m: [next(20.0), 0.0, f64::INFINITY][next(2.05) as usize],
                radius_m: next(500.0),
                class: [VertexClass::Plain, VertexClass::Fringe, VertexClass::FringeVoid][next(3.0) as usize],
            });
            if round % 4 == 0 {
                // Half of these reach exactly as far as the vertex lies: not selected, and the other half one bit farther.
                let sighting = metric.sight(grid.position_m(points[0]), &vertices[0]);
                vertices[0].error_m = 0.0;
                vertices[0].radius_m = sighting.distance_m();
            }
            let pairs = PairMetric::<SIGHT>::new(&metric, &grid);
            let pair = pairs.sight(points, &vertices);
            for i in 0..2 {
                let sighting = metric.sight(grid.position_m(points[i]), &vertices[i]);
                assert_eq!(pair.is_selected(i), sighting.is_selected());
                let mask = (next(16.0)) as u8;
                let expected = metric.cull(&sighting, mask);
                assert_eq!(pairs.cull(&pair, i, mask), expected);
                decided[usize::from(sighting.is_selected()) + 2 * usize::from(expected.is_some())] += 1;
            }
        }
        assert!(decided.iter().all(|n| *n > 100), "{decided:?}: all cases are met");
    }
}
