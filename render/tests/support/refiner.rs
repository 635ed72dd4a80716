//! A mesh by brute force: longest-edge bisection over a square of (2^k + 1)^2 heights, the whole hierarchy in arrays.
//!
//! Written from the definition of the mesh, for small squares. The slot of a vertex is `y * side + x`, so a mesh at one
//! eye and a mesh at another have slots in common, as a caller's have.

use glam::DVec3;
use terrasoar::view::ErrorMetric;
use terrasoar_render::{MeshVertex, TerrainShape, View};

/// All vertices of a square, and what refinement needs to know of them.
pub struct Square {
    /// Samples a side.
    pub side: u32,
    /// Grid column and row of the square's south-west sample.
    pub corner: [u32; 2],
    /// The terrain that the square is all of, or a part of.
    pub terrain: TerrainShape,
    /// Vertices by slot.
    pub vertices: Vec<MeshVertex>,
}

/// A mesh: slots of the vertices in it, and its triangles, counter-clockwise.
#[derive(Default)]
pub struct Mesh {
    pub slots: Vec<u32>,
    pub triangles: Vec<[u32; 3]>,
}

impl Square {
    /// A square of `2^k` cells a side with its corner at `corner`; `height` is given the column and row from there.
    pub fn new(k: u32, corner: [u32; 2], spacing_m: [f64; 2], height: impl Fn(f64, f64) -> f64) -> Self {
        let side = (1 << k) + 1;
        let vertices: Vec<MeshVertex> = (0..side * side)
            .map(|slot| {
                let [x, y] = [slot % side, slot / side];
                MeshVertex {
                    x: corner[0] + x,
                    y: corner[1] + y,
                    height_m: height(f64::from(x), f64::from(y)) as f32,
                    error_m: 0.0,
                    radius_m: 0.0,
                    ends: [slot; 2],
                    flags: MeshVertex::NO_LEVEL,
                }
            })
            .collect();
        let heights = || vertices.iter().map(|v| f64::from(v.height_m));
        let terrain = TerrainShape {
            spacing_m,
            samples: corner.map(|c| c + side),
            height_range_m: [heights().fold(f64::MAX, f64::min), heights().fold(f64::MIN, f64::max)],
        };
        let mut square = Self { side, corner, terrain, vertices };
        // Both triangles at a vertex add to its error: until each has seen what the other's descendants have.
        loop {
            let before = square.vertices.clone();
            for [a, b, d] in square.roots() {
                square.describe(2 * k - 1, a, b, d);
            }
            if before == square.vertices {
                return square;
            }
        }
    }

    fn roots(&self) -> [[u32; 3]; 4] {
        let n = self.side - 1;
        let [sw, se, nw, ne] = [0, n, n * self.side, n * self.side + n];
        let centre = (n / 2) * self.side + n / 2;
        [[centre, sw, se], [centre, se, ne], [centre, ne, nw], [centre, nw, sw]]
    }

    fn split(&self, b: u32, d: u32) -> u32 {
        let middle = |f: fn(u32, u32) -> u32| (f(b, self.side) + f(d, self.side)) / 2;
        middle(|s, side| s / side) * self.side + middle(|s, side| s % side)
    }

    fn place(&self, slot: u32) -> DVec3 {
        let v = &self.vertices[slot as usize];
        let [dx, dy] = self.terrain.spacing_m;
        DVec3::new(f64::from(v.x) * dx, f64::from(v.y) * dy, f64::from(v.height_m))
    }

    /// Error, radius and ends of all vertices below a triangle; returns its split vertex's error and radius.
    fn describe(&mut self, levels: u32, a: u32, b: u32, d: u32) -> (u32, f32, f32) {
        let v = self.split(b, d);
        let middle = 0.5 * (self.place(b).z + self.place(d).z);
        let own = (self.place(v).z - middle).abs() as f32;
        let (mut error, mut radius) =
            (own.max(self.vertices[v as usize].error_m), self.vertices[v as usize].radius_m);
        // The legs of the smallest triangles are single cells.
        if levels > 1 {
            for [b, d] in [[a, b], [d, a]] {
                let (child, e, r) = self.describe(levels - 1, v, b, d);
                error = error.max(e);
                radius = radius.max(1.000_001 * (r + self.place(v).distance(self.place(child)) as f32));
            }
        }
        let vertex = &mut self.vertices[v as usize];
        vertex.error_m = error;
        vertex.radius_m = radius;
        vertex.ends = [b, d];
        vertex.flags = levels - 1;
        (v, error, radius)
    }

    /// Whether a vertex is in the mesh of a view.
    pub fn active(&self, slot: u32, view: &View) -> bool {
        let g = view.vertical_exaggeration;
        let v = &self.vertices[slot as usize];
        let place = self.place(slot) * DVec3::new(1.0, 1.0, g);
        let reach = view.nu() * f64::from(v.error_m) * g + f64::from(v.radius_m) * g.max(1.0);
        let away = place - view.eye_m;
        match view.metric {
            ErrorMetric::Ball => away.length() < reach,
            ErrorMetric::Sight => {
                let error = f64::from(v.error_m) * g;
                let (seen, span) = (view.nu() * error, f64::from(v.radius_m) * g.max(1.0) + error);
                away.length_squared() < span * span + seen * (away.truncate().length() + span)
            }
        }
    }

    /// The mesh of a view, not culled.
    pub fn refine(&self, view: &View) -> Mesh {
        self.refine_where(|slot, _| self.active(slot, view))
    }

    /// The mesh of all vertices of at least some level (0 for the full mesh).
    pub fn down_to(&self, level: u32) -> Mesh {
        self.refine_where(|_, l| l >= level)
    }

    fn refine_where(&self, active: impl Fn(u32, u32) -> bool) -> Mesh {
        let mut mesh = Mesh::default();
        let mut seen = vec![false; self.vertices.len()];
        let levels = 2 * (self.side - 1).ilog2() - 1;
        let mut open: Vec<_> = self.roots().map(|t| (levels, t)).to_vec();
        while let Some((levels, [a, b, d])) = open.pop() {
            let v = self.split(b, d);
            if levels > 0 && active(v, levels - 1) {
                open.push((levels - 1, [v, a, b]));
                open.push((levels - 1, [v, d, a]));
            } else {
                for slot in [a, b, d] {
                    self.mark(&mut seen, slot);
                }
                mesh.triangles.push([b, d, a]);
            }
        }
        mesh.slots = (0..).zip(&seen).filter(|(_, s)| **s).map(|(slot, _)| slot).collect();
        mesh
    }

    /// A vertex and the ends it morphs from must be on the device.
    fn mark(&self, seen: &mut [bool], slot: u32) {
        if !std::mem::replace(&mut seen[slot as usize], true) {
            for end in self.vertices[slot as usize].ends {
                self.mark(seen, end);
            }
        }
    }

    /// Vertex entries of a patch.
    pub fn entries(&self, slots: &[u32]) -> Vec<(u32, MeshVertex)> {
        slots.iter().map(|s| (*s, self.vertices[*s as usize])).collect()
    }

    /// Height at a sample given from the square's corner, the nearest inside if outside.
    pub fn height_at(&self, x: i64, y: i64) -> f32 {
        let inside = |c: i64| c.clamp(0, i64::from(self.side) - 1) as u32;
        self.vertices[(inside(y) * self.side + inside(x)) as usize].height_m
    }
}
