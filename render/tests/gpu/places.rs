//! Things are where they should be: far from the origin, at every depth, and while they move.

use glam::DVec3;
use terrasoar_render::{Frame, Gpu, Haze, Look, View};

use crate::support::landscape::hills;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("places::same_picture_a_thousand_km_from_the_origin", far_away),
        ("places::depth_is_that_of_a_plane", plane),
        ("places::depth_is_that_of_a_ray_cast", ray_cast),
        ("places::morph_has_smaller_pops", pops),
        ("places::depth_is_little_worse_while_vertices_move", tolerance),
        ("places::settled_vertices_are_where_they_belong", settled),
    ]
}

/// Byte by byte, at eyes millimetres apart.
fn far_away(gpu: &Gpu) -> Outcome {
    let spacing_m = [25.0, 16.0];
    let look = Look::default().haze(Haze::Distance(50_000.0));
    let corner = [65_536 - 256, 65_536 - 256];
    let [near, far] = [[0, 0], corner].map(|corner| Square::new(8, corner, spacing_m, hills));
    for step in 0..4 {
        // Dyadic, so that double precision adds it without rounding.
        let offset = DVec3::new(1500.0, 700.0, 1350.0) + DVec3::splat(f64::from(step) / 256.0);
        let pictures = [&near, &far].map(|square| {
            let start = DVec3::new(
                f64::from(square.corner[0]) * spacing_m[0],
                f64::from(square.corner[1]) * spacing_m[1],
                0.0,
            );
            let eye = start + offset;
            let mut view = View::look_at(eye, eye + DVec3::new(0.5, 1.0, -0.25), [200, 150].into());
            view.tolerance_px = 2.0;
            let mut scene = Scene::new(gpu, square);
            scene.show(&square.refine(&view));
            let bare = scene.draw(&view, &look);
            scene.give_tiles(&view);
            (bare, scene.draw(&view, &look))
        });
        let [(near_bare, near_tiled), (far_bare, far_tiled)] = pictures;
        ensure(near_bare == far_bare, || format!("step {step}: pictures differ"))?;
        // The far square's pyramid has coarser tiles beside it, so its coarsest levels are others.
        let difference = near_tiled.difference(&far_tiled);
        ensure(difference < 0.01, || format!("step {step}: with tiles they differ by {difference}"))?;
    }
    Ok(())
}

fn plane(gpu: &Gpu) -> Outcome {
    let (a, b, c) = (0.21, -0.13, 900.0);
    let square = Square::new(6, [0, 0], [50.0, 40.0], |x, y| a * x * 50.0 + b * y * 40.0 + c);
    let mut scene = Scene::new(gpu, &square);
    for exaggeration in [1.0, 2.0] {
        let eye = DVec3::new(1500.0, 300.0, 2300.0 * exaggeration);
        let mut view =
            View::look_at(eye, DVec3::new(1700.0, 1700.0, 900.0 * exaggeration), [160, 120].into());
        view.vertical_exaggeration = exaggeration;
        scene.show(&square.refine(&view));
        scene.draw(&view, &Look::default());
        let depth = scene.depth_m();
        let mut compared = 0;
        for (i, depth) in depth.iter().enumerate() {
            let ray = ray(&view, i as u32 % 160, i as u32 / 160);
            let normal = DVec3::new(-a * exaggeration, -b * exaggeration, 1.0);
            let t = (c * exaggeration - normal.dot(eye)) / normal.dot(ray);
            let at = eye + ray * t;
            if t > 0.0 && (10.0..3190.0).contains(&at.x) && (10.0..2550.0).contains(&at.y) {
                compared += 1;
                let off = (f64::from(*depth) - t).abs() / t;
                ensure(off < 2e-5, || format!("pixel {i}: {depth} instead of {t}"))?;
            }
        }
        ensure(compared > 6000, || format!("only {compared} pixels see the plane"))?;
    }
    Ok(())
}

/// A fine mesh against a march through the full heights.
fn ray_cast(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let eye = DVec3::new(2000.0, 500.0, 1400.0);
    let mut view = View::look_at(eye, DVec3::new(2500.0, 2600.0, 500.0), [200, 150].into());
    view.tolerance_px = 0.25;
    scene.show(&square.refine(&view));
    scene.draw(&view, &Look::default().morph(false));
    let (mut compared, mut off) = (0, 0);
    for (i, depth) in scene.depth_m().iter().enumerate().filter(|(i, _)| i % 3 == 0) {
        let ray = ray(&view, i as u32 % 200, i as u32 / 200);
        let Some(t) = march(&square, eye, ray) else { continue };
        compared += 1;
        // A ray along a crest may pass on either side; those are few.
        off += u32::from((f64::from(*depth) - t).abs() * ray.length() > 20.0);
    }
    ensure(compared > 4000 && off * 200 < compared, || {
        format!("{off} of {compared} pixels are off by a sample")
    })
}

/// Pixel centre's ray, of length 1 along the line of sight.
fn ray(view: &View, x: u32, y: u32) -> DVec3 {
    let [tan_x, tan_y] = view.half_tangents();
    let [width, height] = view.viewport.size_px().map(f64::from);
    let right = 2.0 * (f64::from(x) + 0.5) / width - 1.0;
    let up = 1.0 - 2.0 * (f64::from(y) + 0.5) / height;
    let [to_right, to_top, forward] = view.axes();
    forward + to_right * right * tan_x + to_top * up * tan_y
}

/// First place where a ray is below the bilinear surface.
fn march(square: &Square, eye: DVec3, ray: DVec3) -> Option<f64> {
    let last = f64::from(square.side - 1) * 20.0;
    let above = |t: f64| {
        let p = eye + ray * t;
        if !(0.0..=last).contains(&p.x) || !(0.0..=last).contains(&p.y) {
            return None;
        }
        let (x, y) = (p.x / 20.0, p.y / 20.0);
        let (i, j) = (x.floor(), y.floor());
        let h = |di: i64, dj: i64| f64::from(square.height_at(i as i64 + di, j as i64 + dj));
        let (s, t) = (x - i, y - j);
        let low = h(0, 0) * (1.0 - s) + h(1, 0) * s;
        let high = h(0, 1) * (1.0 - s) + h(1, 1) * s;
        Some(p.z - (low * (1.0 - t) + high * t))
    };
    let step = 2.0;
    let mut t = step;
    while above(t)? > 0.0 {
        t += step;
    }
    let (mut low, mut high) = (t - step, t);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if above(middle)? > 0.0 { low = middle } else { high = middle }
    }
    Some(high)
}

/// Drawn from a fixed eye while the mesh is refined for one that comes nearer: all that changes is the mesh.
fn pops(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    // Straight down, so that nothing hides anything.
    let fixed = DVec3::new(1280.0, 1280.0, 4000.0);
    let view = View::look_at(fixed, fixed - DVec3::Z, [150, 150].into());
    let [mut with, mut without] = [0.0_f64; 2];
    for (morph, largest) in [(true, &mut with), (false, &mut without)] {
        let mut scene = Scene::new(gpu, &square);
        let look = Look::default().morph(morph).tile_normals(false);
        let mut before: Option<Vec<f32>> = None;
        for step in 0..24 {
            let mut moving = view;
            moving.eye_m.z += 1500.0 - 6.0 * f64::from(step);
            moving.tolerance_px = 6.0;
            scene.show(&square.refine(&moving));
            scene.draw_frame(Frame { view: &view, refined_for: Some(&moving), look: &look });
            let depth = scene.depth_m();
            if let Some(before) = before {
                let changes = depth.iter().zip(&before).map(|(a, b)| f64::from((a - b).abs()));
                *largest = changes.filter(|c| c.is_finite()).fold(*largest, f64::max);
            }
            before = Some(depth);
        }
    }
    ensure(with > 0.0 && 4.0 * with < without, || {
        format!("depth changes by {with:.3} m a frame with morph, {without:.3} m without")
    })
}

/// Once the eye is near enough, moved and unmoved vertices are the same.
fn settled(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let eye = DVec3::new(640.0, 640.0, 1500.0);
    let mut view = View::look_at(eye, eye - DVec3::Z, [120, 90].into());
    view.tolerance_px = 1e-6;
    let pictures = [true, false].map(|morph| scene.draw(&view, &Look::default().morph(morph)));
    ensure(pictures[0] == pictures[1], || "pictures differ".to_owned())
}

/// Vertices on their way are off by little more than what they were off before they came.
fn tolerance(gpu: &Gpu) -> Outcome {
    let square = Square::new(8, [0, 0], [20.0, 20.0], hills);
    let eye = DVec3::new(2560.0, 2560.0, 5000.0);
    let mut view = View::look_at(eye, eye - DVec3::Z, [200, 150].into());
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    scene.draw(&view, &Look::default().morph(false));
    let exact = scene.depth_m();
    view.tolerance_px = 3.0;
    let mesh = square.refine(&view);
    scene.show(&mesh);
    let [still_px, moving_px] = [false, true].map(|morph| {
        scene.draw(&view, &Look::default().morph(morph));
        let depth = scene.depth_m();
        let off_px =
            depth.iter().zip(&exact).map(|(a, b)| f64::from((a - b).abs() / b) * view.pixels_per_radian());
        off_px.fold(0.0, f64::max)
    });
    // The mesh has the papers' step error here, whose steps add up even without movement.
    ensure(still_px < 9.0 && moving_px < 1.5 * still_px, || {
        format!("heights are off by {still_px:.2} px, on their way by {moving_px:.2} px")
    })
}
