//! Whether a vertex belongs to the mesh of a view: the nested-sphere error test and the culling test, and how far the eye may move before
//! either changes its answer.
//!
//! Based on: P. Lindstrom, V. Pascucci, "Visualization of Large Terrains Made Easy", IEEE Visualization 2001, section 3;
//! X. Bao, R. Pajarola, M. Shafae, "SMART", section 3.2 (eq. 3) and 4.
//! H. Qiu, L.-T. Chen, G.-P. Qiu, H. Yang, "An Effective Visualization Method for Large-scale Terrain Dataset", section 3: errors along the line of sight.
//!
//! With e the error, r the radius of the nested sphere, D the distance and g the distance over the ground from the eye, k = nu e, a vertex is selected
//!
//! * by [`ErrorMetric::Ball`] if D < k + r: the eye is nearer than k to some point of the sphere;
//! * by [`ErrorMetric::Sight`] if D^2 < R (R + k) + k g with R = r + e. An error of height at a point shows by less than the tolerance where the eye is outside the torus
//!   g^2 + z^2 = k g around the point, a tube of radius k / 2 about a ring of radius k / 2. The test asks whether the eye is inside such a torus around any point of the
//!   sphere grown by e, which holds all that lies between a sample and the surface that is drawn for it. So the angle between the two, seen from the eye, is below the tolerance, not in
//!   first order only. All such tori together are the tube of radius k / 2 + R about the same ring: the margin is a distance.
//!
//! Spheres, radii and errors nest, so what either selects nests too, and the mesh has no cracks. Errors of fringe vertices are lengths over the ground, which show from above as well: `Sight`
//! puts D for g there, which nests with the rest since g <= D.
//!
//! Every engine decides by this file, with the same operations in the same order. So all decide alike to
//! the last bit. It is the only file that knows the projection. Cost: some ten floating-point operations a test, five more along the line of sight.

mod foresight;
pub(crate) mod pair;

use crate::view::{ErrorMetric, View};
use terrasoar_layout::grid::record::Vertex;

/// Number of side planes of the view pyramid.
pub(crate) const PLANES: usize = 4;
/// Mask of planes that a sphere may still cross: all of them.
pub(crate) const ALL_PLANES: u8 = (1 << PLANES) - 1;

/// A view as the tests need it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Metric {
    eye_m: [f64; 3],
    /// alpha / tau: metres of distance a metre of error is visible over.
    nu: f64,
    /// Vertical exaggeration: what heights and errors are multiplied by.
    exaggeration: f64,
    /// What radii are multiplied by, so that spheres stay nested when heights are stretched.
    radius_factor: f64,
    normals: [[f64; 3]; PLANES],
    kind: ErrorMetric,
}

/// A side plane of the view pyramid in single precision, moved outwards by more than the rounding of a test: a corner is beyond it if
/// `normal . corner + offset` is above 0.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BoxPlane {
    /// Metres a unit of each axis, signed.
    pub normal: [f32; 3],
    /// Metres.
    pub offset: f32,
}

/// A vertex relative to the eye: what both tests work on.
#[derive(Debug, Clone, Copy)]
pub struct Sighting {
    /// From the eye to the vertex, metres.
    offset_m: [f64; 3],
    /// Squared distance.
    distance2: f64,
    /// From no farther away than this the vertex is selected: nu e + r, or nu e + R.
    reach_m: f64,
    radius_m: f64,
    /// r, or R.
    span_m: f64,
    /// Radius of the ring whose tube is where the vertex is selected, nu e / 2; 0 for a ball.
    ring_m: f64,
    is_selected: bool,
}

impl Metric {
    /// The tests of `view`.
    pub fn new(view: &View) -> Self {
        Self {
            eye_m: view.eye_m.to_array(),
            nu: view.nu(),
            exaggeration: view.vertical_exaggeration,
            radius_factor: view.vertical_exaggeration.max(1.0),
            normals: view.side_normals().map(|n| n.to_array()),
            kind: view.metric,
        }
    }

    /// Eye position in metres.
    pub fn eye_m(&self) -> [f64; 3] {
        self.eye_m
    }

    /// How errors are measured.
    pub fn kind(&self) -> ErrorMetric {
        self.kind
    }

    /// alpha / tau.
    pub fn nu(&self) -> f64 {
        self.nu
    }

    /// Vertical exaggeration.
    pub fn exaggeration(&self) -> f64 {
        self.exaggeration
    }

    /// Outward normals of the side planes.
    pub fn normals(&self) -> &[[f64; 3]; PLANES] {
        &self.normals
    }

    /// The vertex at horizontal position `at_m` as seen from the eye.
    #[inline(always)]
    pub fn sight(&self, at_m: [f64; 2], vertex: &Vertex) -> Sighting {
        let ball = self.sight_ball(at_m, vertex.height_m, vertex.error_m, vertex.radius_m);
        if self.kind == ErrorMetric::Ball {
            return ball;
        }
        let Sighting { offset_m, distance2, radius_m, .. } = ball;
        let [x, y, _] = offset_m;
        let across2 = x * x + y * y;
        let error_m = vertex.error_m * self.exaggeration;
        let seen_m = self.nu * error_m;
        let span_m = radius_m + error_m;
        let reach_m = seen_m + span_m;
        // On the fringe of a void the same tests make a ball.
        let (tube_m, ring2_m) = if vertex.class.is_plain() { (span_m, seen_m) } else { (reach_m, 0.0) };
        let beyond2 = distance2 - tube_m * reach_m;
        // beyond2 < ring2_m g, without the root.
        let is_selected = beyond2 < 0.0 || beyond2 * beyond2 < ring2_m * ring2_m * across2;
        // An endless error has no ring.
        let ring_m = if ring2_m < f64::INFINITY { 0.5 * ring2_m } else { 0.0 };
        Sighting { offset_m, distance2, reach_m, radius_m, span_m, ring_m, is_selected }
    }

    /// As [`Metric::sight`], by [`ErrorMetric::Ball`], of a vertex of that height, error and radius.
    #[inline(always)]
    pub(crate) fn sight_ball(&self, at_m: [f64; 2], height_m: f64, error_m: f64, radius_m: f64) -> Sighting {
        let height_m = height_m * self.exaggeration;
        let offset_m = [at_m[0] - self.eye_m[0], at_m[1] - self.eye_m[1], height_m - self.eye_m[2]];
        let [x, y, z] = offset_m;
        let radius_m = radius_m * self.radius_factor;
        let distance2 = x * x + y * y + z * z;
        let reach_m = self.nu * (error_m * self.exaggeration) + radius_m;
        let is_selected = distance2 < reach_m * reach_m;
        Sighting { offset_m, distance2, reach_m, radius_m, span_m: radius_m, ring_m: 0.0, is_selected }
    }

    /// Signed distance of the vertex from plane `i`, positive outside.
    #[inline(always)]
    pub fn height_over_plane(&self, i: usize, sighting: &Sighting) -> f64 {
        let [a, b, c] = self.normals[i];
        let [x, y, z] = sighting.offset_m;
        a * x + b * y + c * z
    }

    /// Tests a sphere against the planes of `mask`: `None` if it lies wholly outside one (culled), else the planes it still crosses. A sphere
    /// wholly inside a plane has all its descendants inside, which need not ask again.
    #[inline(always)]
    pub(crate) fn cull(&self, sighting: &Sighting, mask: u8) -> Option<u8> {
        let mut crossing = mask;
        for i in 0..PLANES {
            if mask & 1 << i != 0 {
                let h = self.height_over_plane(i, sighting);
                if h > sighting.radius_m {
                    return None;
                }
                if h < -sighting.radius_m {
                    crossing &= !(1 << i);
                }
            }
        }
        Some(crossing)
    }

    /// Largest signed distance over all planes: the sphere is culled if it exceeds the radius.
    #[inline(always)]
    pub fn outermost(&self, sighting: &Sighting) -> f64 {
        (0..PLANES).map(|i| self.height_over_plane(i, sighting)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// The planes as boxes are tested against them: in grid steps east and north and metres of height, none of which exceeds `largest`.
    pub(crate) fn box_planes(&self, spacing_m: [f64; 2], largest: f64) -> [BoxPlane; PLANES] {
        let factors = [spacing_m[0], spacing_m[1], self.exaggeration];
        self.normals.map(|n| {
            let normal = [0, 1, 2].map(|i| n[i] * factors[i]);
            let offset: f64 = -(0..3).map(|i| n[i] * self.eye_m[i]).sum::<f64>();
            // Four roundings of sums no larger than this, each by half a unit in the last of 24 bits.
            let size: f64 = normal.iter().map(|n| n.abs() * largest).sum::<f64>() + offset.abs();
            let slack = size * 4.0 * f64::from(f32::EPSILON);
            BoxPlane { normal: normal.map(|n| n as f32), offset: (offset - slack) as f32 }
        })
    }
}

impl Sighting {
    /// Whether the vertex is near enough for its error to show.
    #[inline(always)]
    pub(crate) fn is_selected(&self) -> bool {
        self.is_selected
    }

    /// Metres that the eye can move in any direction before the answer changes: positive if selected, nu e + r - |P - p| for a ball (SMART, eq. 6).
    #[inline(always)]
    pub fn margin_m(&self) -> f64 {
        if self.ring_m == 0.0 {
            self.reach_m - self.distance2.sqrt()
        } else {
            self.tube_m() - self.ring2().sqrt()
        }
    }

    /// Radius of the tube about the ring in which the vertex is selected.
    #[inline(always)]
    pub(crate) fn tube_m(&self) -> f64 {
        self.reach_m - self.ring_m
    }

    /// Radius of that ring, which lies level around the vertex; 0 where it is the vertex itself.
    #[inline(always)]
    pub(crate) fn ring_m(&self) -> f64 {
        self.ring_m
    }

    /// Squared distance of the eye from the ring.
    #[inline(always)]
    pub(crate) fn ring2(&self) -> f64 {
        let out_m = self.across_m() - self.ring_m;
        out_m * out_m + self.offset_m[2] * self.offset_m[2]
    }

    /// Distance over the ground from the eye.
    #[inline(always)]
    pub(crate) fn across_m(&self) -> f64 {
        let [x, y, _] = self.offset_m;
        (x * x + y * y).sqrt()
    }

    /// From the eye to the vertex, metres.
    #[inline(always)]
    pub fn offset_m(&self) -> [f64; 3] {
        self.offset_m
    }

    /// Squared distance from the eye.
    #[inline(always)]
    pub(crate) fn distance2(&self) -> f64 {
        self.distance2
    }

    /// Distance from the eye.
    #[inline(always)]
    pub fn distance_m(&self) -> f64 {
        self.distance2.sqrt()
    }

    /// From no farther away than this the vertex is selected: nu e + r for a ball.
    #[inline(always)]
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Radius of the nested sphere.
    #[inline(always)]
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// The error of a vertex as it may show on the screen, in pixels, seen from `nearest_m` at the least: inside the vertex's sphere the ground may be as near as
    /// can be. `tolerance_px` is the metric's.
    pub fn error_px(&self, tolerance_px: f64, nearest_m: f64) -> f64 {
        let distance_m = self.distance_m();
        let from_the_side =
            (self.reach_m - self.span_m) / (distance_m - self.span_m).max(nearest_m) * tolerance_px;
        if self.ring_m == 0.0 {
            return from_the_side;
        }
        from_the_side * (self.across_m() + self.span_m) / (distance_m + self.span_m)
    }

    /// A bound on twice the rounding error of the margins: a status cannot change while the exact margin exceeds it.
    #[inline(always)]
    pub(crate) fn guard_m(&self) -> f64 {
        const ULPS: f64 = 1.0 / (1u64 << 48) as f64;
        const LEAST_M: f64 = 1.0 / (1u64 << 30) as f64;
        (self.distance2.sqrt() + self.reach_m + self.radius_m) * ULPS + LEAST_M
    }
}
