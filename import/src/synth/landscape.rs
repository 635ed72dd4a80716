//! The large forms: sea, lowlands, ranges and volcanoes on a fixed lattice of 513 x 513 points.
//!
//! Places are fractions of the extent, heights those of a landscape 164 km wide. Beside the height every
//! point has a roughness, the strength of the detail added later: high in the mountains, low in the
//! plains. Cost: 0.3 s of one core, whatever the size of the terrain.

use rayon::prelude::*;
use terrasoar_layout::portable::{atan2, exp, hypot, pow, sin_cos};

use super::noise::{fractal, hash, ridged, signed_unit, smoothstep};

/// Lattice cells along a side.
pub(super) const CELLS: u32 = 512;
/// Lattice points along a side.
pub(super) const POINTS: usize = CELLS as usize + 1;

/// Height of the highest lattice point.
const SUMMIT_M: f64 = 4392.0;
/// Share of the lattice below sea level.
const SEA_SHARE: f64 = 0.12;

/// Heights and roughness at the lattice points, rows from north to south.
pub(super) struct Landscape {
    /// Metres above the sea, below it negative.
    pub(super) heights_m: Vec<f32>,
    /// Strength of the detail, about 0..1.5.
    pub(super) roughness: Vec<f32>,
}

impl Landscape {
    /// The landscape of `seed`.
    pub(super) fn new(seed: u32) -> Self {
        let plan = Plan::new(seed);
        let points: Vec<(f64, f32)> = (0..POINTS * POINTS)
            .into_par_iter()
            .map(|point| {
                plan.at(
                    (point % POINTS) as f64 / f64::from(CELLS),
                    (point / POINTS) as f64 / f64::from(CELLS),
                )
            })
            .collect();
        let mut sorted: Vec<f64> = points.iter().map(|point| point.0).collect();
        sorted.sort_by(f64::total_cmp);
        let sea_m = sorted[(sorted.len() as f64 * SEA_SHARE) as usize];
        let summit_m = sorted[sorted.len() - 1];
        let scale = SUMMIT_M / (summit_m - sea_m);
        Self {
            heights_m: points.iter().map(|point| ((point.0 - sea_m) * scale) as f32).collect(),
            roughness: points.iter().map(|point| point.1).collect(),
        }
    }
}

/// Where the features of one seed lie.
struct Plan {
    seed: u32,
    range_west: f64,
    island: (f64, f64),
    volcanoes: [(f64, f64, f64); 2],
}

impl Plan {
    fn new(seed: u32) -> Self {
        let shift = |number: u32, width: f64| f64::from(signed_unit(hash(seed, number, 77))) * width;
        Self {
            seed,
            range_west: 0.54 + shift(1, 0.03),
            island: (0.16 + shift(2, 0.03), 0.42 + shift(3, 0.10)),
            volcanoes: [
                (0.70 + shift(4, 0.04), 0.74 + shift(5, 0.08), 2900.0),
                (0.80 + shift(6, 0.05), 0.22 + shift(7, 0.08), 1500.0),
            ],
        }
    }

    /// Height in metres before the sea is put in, and roughness.
    fn at(&self, east: f64, south: f64) -> (f64, f32) {
        let seed = |number: u32| hash(self.seed, number, 1);
        // Bent coordinates make the noise's grain disappear.
        let bend_x = fractal(seed(1), east * 3.0, south * 3.0, 4, 0.5);
        let bend_y = fractal(seed(2), east * 3.0, south * 3.0, 4, 0.5);
        let (x, y) = (east + 0.05 * bend_x, south + 0.05 * bend_y);

        let range = smoothstep(self.range_west, self.range_west + 0.34, x + 0.06 * bend_y);
        let (dx, dy) = ((x - self.island.0) / 0.19, (y - self.island.1) / 0.24);
        let island = smoothstep(1.1, 0.1, hypot(dx, dy) + 0.2 * bend_x);
        let mountains = range.max(0.85 * island);

        let crests = ridged(seed(3), x * 11.0, y * 11.0, 6, 0.5);
        let broad = fractal(seed(4), x * 2.0, y * 2.0, 3, 0.5);
        let hills = fractal(seed(5), x * 9.0, y * 9.0, 6, 0.72);

        // An inlet winds from north to south between the ranges, with arms.
        let arms = ridged(seed(6), x * 6.0, y * 2.5, 4, 0.5);
        let inlet = smoothstep(0.16, 0.02, (x - 0.44 + 0.05 * sin_cos(y * 9.0).0).abs())
            * smoothstep(0.35, 0.75, arms);
        let plain = 130.0 + 110.0 * broad + 85.0 * hills - 330.0 * inlet * (1.0 - mountains);

        let relief = mountains * (150.0 + 450.0 * (broad + 0.3).max(0.0) + 1500.0 * pow(crests, 1.2));
        let mut height = plain + relief;
        let mut cones = 0.0;
        for (number, (vx, vy, tall_m)) in (0..).zip(self.volcanoes) {
            let (dx, dy) = (x - vx, y - vy);
            let ribs = fractal(seed(20 + number), atan2(dy, dx) * 2.2, hypot(dx, dy) * 30.0, 3, 0.6);
            let distance = hypot(dx, dy) * (1.0 + 0.25 * ribs);
            let near = exp(-distance / 0.035);
            height = height * (1.0 - 0.45 * near) + tall_m * exp(-distance / 0.024);
            cones += near;
        }
        let roughness = 0.30 + mountains * (0.30 + 0.9 * crests) + 0.3 * cones.min(1.0);
        (height, roughness as f32)
    }
}
