//! Bounds of the clusters, laid out for culling all of them every frame. Each number has a column of its own, so that a test against a plane is a pass over three columns.
//!
//! Single precision, with planes moved outwards by more than its rounding: a box is called outside only if it is. Cost: some two nanoseconds a box for all
//! four planes. The compiler turns the passes into vector instructions.

use crate::metric::{BoxPlane, PLANES};

/// A box around a cluster, in grid steps (padding folded) and metres of height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least column, row and height.
    pub least: [f32; 3],
    /// Largest column, row and height.
    pub largest: [f32; 3],
}

impl Bounds {
    /// The box around nothing.
    pub(crate) const EMPTY: Self = Self { least: [f32::INFINITY; 3], largest: [f32::NEG_INFINITY; 3] };

    /// Widens the box to contain a point.
    #[inline(always)]
    pub(crate) fn include(&mut self, p: [f32; 3]) {
        for (i, p) in p.into_iter().enumerate() {
            self.least[i] = self.least[i].min(p);
            self.largest[i] = self.largest[i].max(p);
        }
    }
}

/// The boxes of all clusters.
#[derive(Debug, Default)]
pub(crate) struct BoundsColumns {
    least: [Vec<f32>; 3],
    largest: [Vec<f32>; 3],
    /// Of each box, how far it is beyond the plane that it is farthest beyond.
    beyond: Vec<f32>,
}

impl BoundsColumns {
    pub(crate) fn get(&self, at: usize) -> Bounds {
        Bounds {
            least: [0, 1, 2].map(|axis| self.least[axis][at]),
            largest: [0, 1, 2].map(|axis| self.largest[axis][at]),
        }
    }

    pub(crate) fn set(&mut self, at: usize, bounds: Bounds) {
        for axis in 0..3 {
            self.least[axis][at] = bounds.least[axis];
            self.largest[axis][at] = bounds.largest[axis];
        }
    }

    pub(crate) fn push_empty(&mut self) {
        for axis in 0..3 {
            self.least[axis].push(f32::INFINITY);
            self.largest[axis].push(f32::NEG_INFINITY);
        }
        self.beyond.push(0.0);
    }

    pub(crate) fn pop(&mut self) {
        let shorter = self.beyond.len().saturating_sub(1);
        self.least
            .iter_mut()
            .chain(&mut self.largest)
            .chain([&mut self.beyond])
            .for_each(|c| c.truncate(shorter));
    }

    pub(crate) fn clear(&mut self) {
        self.least.iter_mut().chain(&mut self.largest).chain([&mut self.beyond]).for_each(Vec::clear);
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.least
            .iter()
            .chain(&self.largest)
            .chain([&self.beyond])
            .map(|c| c.capacity() * size_of::<f32>())
            .sum()
    }

    /// Says of each box whether it may be seen: whether it is not wholly beyond any plane.
    pub(crate) fn cull(&mut self, planes: &[BoxPlane; PLANES]) -> impl Fn(usize) -> bool + '_ {
        self.beyond.fill(f32::NEG_INFINITY);
        for BoxPlane { normal: [a, b, c], offset } in planes {
            // The corner farthest inside.
            let column = |axis: usize, n: f32| if n < 0.0 { &self.largest[axis] } else { &self.least[axis] };
            let (xs, ys, zs) = (column(0, *a), column(1, *b), column(2, *c));
            for (((beyond, x), y), z) in self.beyond.iter_mut().zip(xs).zip(ys).zip(zs) {
                let distance = a * x + b * y + c * z + offset;
                *beyond = if distance > *beyond { distance } else { *beyond };
            }
        }
        |at| self.beyond[at] <= 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Metric;
    use crate::view::{ErrorMetric, View, Viewport};
    use glam::DVec3;
    use proptest::prelude::*;

    proptest! {
        /// A box that is culled has no corner, seen in double precision, on the inner side of the plane that culls it; one well inside all planes is kept.
        #[test]
        fn what_is_culled_is_outside(
            eye in (-3e5f64..3e5, -3e5f64..3e5, -1e4f64..1e4), yaw in 0.0f64..6.3, pitch in -1.4f64..1.4, roll in -3.0f64..3.0, exaggeration in 0.1f64..5.0,
            boxes in prop::collection::vec((0u32..65_536, 0u32..65_536, -9000.0f32..9000.0, 0u32..3000, 0u32..3000, 0.0f32..500.0), 1..40),
        ) {
            let view = View {
                eye_m: DVec3::new(eye.0, eye.1, eye.2), yaw_rad: yaw, pitch_rad: pitch, roll_rad: roll, vertical_fov_rad: 0.8,
                viewport: Viewport::default(), tolerance_px: 1.0, vertical_exaggeration: exaggeration,
                metric: ErrorMetric::default(),
            };
            let metric = Metric::new(&view);
            let spacing_m = [10.0, 12.0];
            let mut columns = BoundsColumns::default();
            let all: Vec<Bounds> = boxes.iter().map(|(x, y, z, w, h, d)| Bounds {
                least: [*x as f32, *y as f32, *z],
                largest: [(x + w) as f32, (y + h) as f32, z + d],
            }).collect();
            for (i, bounds) in all.iter().enumerate() {
                columns.push_empty();
                columns.set(i, *bounds);
                assert_eq!(columns.get(i), *bounds);
            }
            let limits = all.iter().flat_map(|b| [b.least, b.largest]).flatten().fold(0.0, |m: f32, v| m.max(v.abs()));
            let is_seen = columns.cull(&metric.box_planes(spacing_m, f64::from(limits)));
            for (i, bounds) in all.iter().enumerate() {
                // How far the corner farthest inside is beyond each plane.
                let beyond = metric.normals().map(|n| {
                    (0..3).map(|axis| {
                        let factor = [spacing_m[0], spacing_m[1], exaggeration][axis];
                        let [low, high] = [bounds.least[axis], bounds.largest[axis]].map(|v| n[axis] * (f64::from(v) * factor - metric.eye_m()[axis]));
                        low.min(high)
                    }).sum::<f64>()
                });
                let outside = beyond.iter().any(|b| *b > 0.0);
                prop_assert!(outside || is_seen(i));
                prop_assert!(!is_seen(i) || beyond.iter().all(|b| *b < 5.0), "kept {beyond:?}");
            }
        }
    }
}
