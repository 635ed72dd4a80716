//! What is certain of a vertex before its record is read.
//!
//! A child's ball lies inside its parent's, and its error is at most the parent's. With e and r the parent's error and radius, a child at a point c is selected only if its distances from the eye
//! and from the parent add up to less than nu e + r. Where c lies over the ground is known, its height is not. Over all heights that sum is least where a mirror, upright over the child, shows the
//! parent to the eye: the square root of (g + h)^2 + z^2, with g and h the distances over the ground from the eye and from the parent, z the height between these two. What lies
//! outside a plane is found likewise.
//!
//! Invariant: what is not foreseen to show is not selected, or is culled, by [`Metric`]'s tests of the record itself. Roundings are allowed for many times over. Cost: some thirty operations.

use super::{Metric, PLANES};
use crate::view::ErrorMetric;
use terrasoar_layout::grid::record::Vertex;

/// Roundings, as a part of the lengths that take part.
const GUARD: f64 = 1.0 / (1u64 << 40) as f64;

impl Metric {
    /// Whether a child of the vertex at `parent_m` may be selected and cross or lie inside the planes of `mask`. Those are planes that the parent's sphere crosses; the child lies at `at_m`.
    pub(crate) fn may_show(&self, at_m: [f64; 2], parent_m: [f64; 2], parent: &Vertex, mask: u8) -> bool {
        let [x, y] = [0, 1].map(|axis| at_m[axis] - self.eye_m[axis]);
        let z = parent.height_m * self.exaggeration - self.eye_m[2];
        let [dx, dy] = [0, 1].map(|axis| at_m[axis] - parent_m[axis]);
        let aside_m = (dx * dx + dy * dy).sqrt();
        let away_m = (x * x + y * y).sqrt() + aside_m;
        let radius_m = parent.radius_m * self.radius_factor;
        let guard_m = (away_m + z.abs() + radius_m) * GUARD;
        let error_m = parent.error_m * self.exaggeration;
        // What is selected along the line of sight is nearer than nu e + r + e.
        let more_m = if self.kind == ErrorMetric::Sight { error_m } else { 0.0 };
        let reach_m = self.nu * error_m + more_m + radius_m;
        if (away_m * away_m + z * z).sqrt() >= reach_m + guard_m {
            return false;
        }
        (0..PLANES).filter(|i| mask & 1 << i != 0).all(|i| {
            let [a, b, c] = self.normals[i];
            let least_m = a * x + b * y + c * z + aside_m * (1.0 - c * c).max(0.0).sqrt();
            least_m <= radius_m + guard_m
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::ALL_PLANES;
    use crate::view::{View, Viewport};
    use terrasoar_layout::grid::record::VertexClass;
    use terrasoar_layout::mix::Random;

    /// Children as near to what their parents allow as records say, and farther inside.
    #[test]
    fn what_shows_is_foreseen_to() {
        let mut random = Random::new(11);
        let mut next = |below: f64| random.bits() as f64 / u64::MAX as f64 * below;
        let mut seen = [[0; 2]; 2];
        for round in 0..200_000usize {
            let kind = [ErrorMetric::Ball, ErrorMetric::Sight][round % 2];
            let view = View::new([next(7000.0), next(3700.0), next(1900.0)], next(360.0), -next(80.0))
                .viewport(Viewport { width_px: 800, height_px: 600 })
                .exaggeration([1.0, 0.3, 2.5][round % 3])
                .metric(kind);
            let metric = Metric::new(&view);
            let parent_m = [next(7000.0), next(3700.0)];
            let at_m = parent_m.map(|v| v + next(400.0) - 200.0);
            let class = [VertexClass::Plain, VertexClass::Fringe][round / 3 % 2];
            let child = Vertex {
                height_m: next(1000.0),
                error_m: [next(3.0), 0.0][next(1.2) as usize],
                radius_m: [next(300.0), 0.0][next(1.5) as usize],
                class,
            };
            let height_m = child.height_m + next(60.0) - 30.0;
            let [x, y] = [0, 1].map(|axis| at_m[axis] - parent_m[axis]);
            let z = child.height_m - height_m;
            let apart_m = (x * x + y * y + z * z).sqrt();
            let more = [1.0, 1.0, 1.2][next(3.0) as usize];
            let parent = Vertex {
                height_m,
                error_m: child.error_m * more,
                radius_m: (1.0 + 1.0 / f64::from(1 << 20)) * (apart_m + child.radius_m) * more,
                class,
            };
            let sight = metric.sight(parent_m, &parent);
            let Some(mask) = metric.cull(&sight, ALL_PLANES) else { continue };
            let sighting = metric.sight(at_m, &child);
            let shows = sighting.is_selected() && metric.cull(&sighting, mask).is_some();
            let may_show = metric.may_show(at_m, parent_m, &parent, mask);
            assert!(may_show || !shows, "{round}: {child:?} below {parent:?}");
            seen[usize::from(shows)][usize::from(may_show)] += 1;
        }
        assert!(seen[1][1] > 1000 && seen[0][0] > 20_000, "{seen:?}: both are met");
        // Of what does not show, all but a part is foreseen.
        assert!(seen[0][0] > 2 * seen[0][1], "{seen:?}");
    }
}
