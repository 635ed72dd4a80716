//! What is drawn is the terrain: depth against rays cast through every sample of the DEM.

use super::rig::{Rig, puget_sound, view};
use super::{Outcome, Test, ensure};
use glam::DVec3;
use terrasoar::view::View;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::with_records;
use terrasoar_render::{Gpu, Look};

pub const TESTS: &[Test] = &[("depth::agrees_with_the_dem", agrees_with_the_dem)];

const SIZE_PX: [u32; 2] = [400, 300];
const PIXELS: u32 = 10_000;

/// All heights, in the triangles that the finest mesh has.
struct Dem {
    side: usize,
    spacing_m: f64,
    heights_m: Vec<f64>,
}

impl Dem {
    fn of_puget_sound() -> Self {
        let terrain = puget_sound();
        let [side, _] = terrain.grid().samples();
        let points = (0..side).flat_map(|y| (0..side).map(move |x| GridPoint::new(x, y)));
        let heights_m = with_records!(terrain.records().unwrap(), records => {
            points.map(|p| records.vertex_at(p).height_m).collect()
        });
        Self { side: side as usize, spacing_m: terrain.grid().spacing_m()[0], heights_m }
    }

    /// Height of the ground; none outside.
    fn height_m(&self, at: DVec3) -> Option<f64> {
        let [x, y] = [at.x / self.spacing_m, at.y / self.spacing_m];
        let [i, j] = [x.floor(), y.floor()];
        let last = (self.side - 1) as f64;
        if !(0.0..last).contains(&x) || !(0.0..last).contains(&y) {
            return None;
        }
        let [fx, fy] = [x - i, y - j];
        let (i, j) = (i as usize, j as usize);
        let [a, b, c, d] =
            [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(u, v)| self.heights_m[(j + v) * self.side + i + u]);
        // Diagonals run through the points that have both coordinates even or both odd.
        Some(if (i + j) % 2 == 0 {
            if fx > fy { a + fx * (b - a) + fy * (d - b) } else { a + fy * (c - a) + fx * (d - c) }
        } else if fx + fy < 1.0 {
            a + fx * (b - a) + fy * (c - a)
        } else {
            d + (1.0 - fx) * (c - d) + (1.0 - fy) * (b - d)
        })
    }

    /// Length of `ray` to the ground, in units of the ray; infinite where it misses it.
    fn cast(&self, eye_m: DVec3, ray: DVec3) -> f64 {
        let step = 0.2 * self.spacing_m / ray.length();
        let above = |t: f64| {
            let at = eye_m + ray * t;
            self.height_m(at).map(|h| at.z - h)
        };
        let mut t = 0.0;
        while let Some(height_m) = above(t) {
            if height_m < 0.0 {
                let (mut low, mut high) = (t - step, t);
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    if above(middle).is_some_and(|h| h < 0.0) { high = middle } else { low = middle }
                }
                return high;
            }
            // Far above the highest summit nothing can be hit for a while.
            t += step * (1.0 + ((eye_m.z + ray.z * t - 4400.0) / self.spacing_m).max(0.0));
        }
        f64::INFINITY
    }
}

/// A ray whose length along the line of sight is 1, through a place in the picture in pixels.
fn ray(view: &View, [x, y]: [f64; 2]) -> DVec3 {
    let [right, up, forward] = view.axes();
    let [_, tan_y] = view.half_tangents();
    let per_px = 2.0 * tan_y / f64::from(SIZE_PX[1]);
    let [half_x, half_y] = SIZE_PX.map(|s| 0.5 * f64::from(s));
    forward + right * ((x - half_x) * per_px) + up * ((half_y - y) * per_px)
}

/// Each random pixel's depth is that of its ray within one sample spacing. At a silhouette, where a quarter of a pixel decides between two
/// mountains, it lies between those of the rays half a pixel around, of which there may be few.
fn agrees_with_the_dem(gpu: &Gpu) -> Outcome {
    let dem = Dem::of_puget_sound();
    let mut rig = Rig::plain(gpu, SIZE_PX);
    let mut random = 1_u64;
    let mut next = |below: u32| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((random >> 33) % u64::from(below)) as u32
    };
    let views = [
        view([80.0, 70.0, 7.0], [20.0, -45.0, 0.0], 50.0, SIZE_PX),
        view([98.0, 52.0, 3.6], [75.0, -14.0, 10.0], 45.0, SIZE_PX),
    ];
    for (number, view) in views.into_iter().enumerate() {
        let view = View { tolerance_px: 0.25, ..view };
        rig.shoot(&view, &Look::default().morph(number == 1));
        let depths = rig.depth_m();
        let mut at_silhouettes = 0;
        for _ in 0..PIXELS / 2 {
            let [x, y] = SIZE_PX.map(&mut next);
            let depth_m = f64::from(depths[(y * SIZE_PX[0] + x) as usize]);
            let cast = |[dx, dy]: [f64; 2]| {
                dem.cast(view.eye_m, ray(&view, [f64::from(x) + 0.5 + dx, f64::from(y) + 0.5 + dy]))
            };
            let there = cast([0.0, 0.0]);
            if depth_m == there || (depth_m - there).abs() <= dem.spacing_m {
                continue;
            }
            at_silhouettes += 1;
            let around =
                [[-0.5, 0.0], [0.5, 0.0], [0.0, -0.5], [0.0, 0.5]].map(cast).into_iter().chain([there]);
            let (near, far) =
                around.fold((f64::INFINITY, 0.0_f64), |(low, high), d| (low.min(d), high.max(d)));
            ensure((near - dem.spacing_m..=far + dem.spacing_m).contains(&depth_m), || {
                format!(
                    "view {number}, pixel {x},{y}: {depth_m} m drawn, {there} m by the DEM, {near} to {far} m around"
                )
            })?;
        }
        println!("view {number}: {at_silhouettes} of {} pixels at silhouettes", PIXELS / 2);
        ensure(at_silhouettes < PIXELS / 50, || format!("view {number}: {at_silhouettes} pixels are off"))?;
    }
    Ok(())
}
