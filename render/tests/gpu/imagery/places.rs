//! Texels are where they belong, to a fraction of their size, in every level and from every side.

use glam::DVec3;
use terrasoar_render::{Gpu, ImageryShape, TileFormat, View};

use super::{SIZE_PX, bare, chart, down, level_ground, pixel, show_all};
use crate::support::image::{Image, drape, encoded, linear_of};
use crate::support::landscape::hills;
use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("imagery::a_checkerboard_lands_on_the_right_metre", checkerboard),
        ("imagery::levels_agree_with_a_filter_on_the_cpu", between_levels),
        ("imagery::same_picture_a_thousand_km_from_the_origin", far_away),
        ("imagery::no_seam_between_tiles", seams),
        ("imagery::flat_views_are_sharp_across_and_calm_along", anisotropy),
    ]
}

/// Where the line of sight through the middle of a pixel meets the level ground, and from how far.
fn ground_of(view: &View, x: u32, y: u32) -> (DVec3, f64) {
    let [tan_x, tan_y] = view.half_tangents();
    let [wide, high] = view.viewport.size_px().map(f64::from);
    let [right, up, forward] = view.axes();
    let ray = forward
        + right * (tan_x * (2.0 * (f64::from(x) + 0.5) / wide - 1.0))
        + up * (tan_y * (1.0 - 2.0 * (f64::from(y) + 0.5) / high));
    let at = view.eye_m + ray * ((100.0 - view.eye_m.z) / ray.z);
    (at, at.distance(view.eye_m))
}

/// At an odd place, with texels of odd size and shape, seen so that a texel is some pixels wide and across a tile's border.
fn checkerboard(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let texel_m = [0.73, 0.61];
    let image = chart(ImageryShape {
        format: TileFormat::Rgba8,
        texels: [1100, 1301],
        levels: 9,
        origin_m: [210.3, -40.7],
        texel_m,
    });
    drape(&mut scene, &image, 16);
    let view = down(210.3 + 504.0 * 0.73 + 1.1, 504.0 * 0.61 - 47.0, 60.0);
    show_all(&mut scene, &image, &view);
    let picture = scene.draw(&view, &bare());
    let right = off(&picture, &view, &image, [0.0; 2]);
    // Graphics cards have 256 steps between two texels; in dark colours a step of light is several of 255.
    let most = if gpu.capabilities.software { 3.0 } else { 8.0 };
    ensure(right < most, || format!("the picture is off by up to {right:.1} of 255"))?;
    // Edges are four pixels wide, so the test sees far less than half a texel.
    for moved in [[0.1, 0.0], [0.0, 0.1], [-0.1, 0.0], [0.0, -0.1]] {
        let wrong = off(&picture, &view, &image, moved);
        ensure(wrong > 2.0 * right + 3.0, || {
            format!("moved by {moved:?} texels it is off by {wrong:.1} alone")
        })?;
    }
    Ok(())
}

/// A texel between one and four pixels large, seen through two levels at once.
fn between_levels(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    // Rings, filtered by their own formula: every level holds the mean of the one below, in linear light.
    let image = Image::new(Image::shape_over(&square.terrain, 0.5), |level, x, y| {
        let size = f64::from(1 << level);
        let [u, v] = [x, y].map(|c| ((c as f64 + 0.5) * size - 1280.0) / 9.0);
        let fade = (-0.5 * (size / 30.0).powi(2)).exp();
        let wave = 0.35 + 0.3 * fade * (u.hypot(v)).sin();
        // A step of blue from level to level, so that it matters how much of either shows.
        [encoded(wave).round() as u8, encoded(0.7 - wave).round() as u8, 40 + 25 * level as u8, 255]
    });
    drape(&mut scene, &image, 64);
    for above_m in [90.0, 150.0, 240.0, 430.0] {
        let view = down(640.0, 650.0, above_m);
        show_all(&mut scene, &image, &view);
        let picture = scene.draw(&view, &bare());
        let right = off(&picture, &view, &image, [0.0; 2]);
        ensure(right < 4.0, || format!("{above_m} m above it is off by up to {right:.1} of 255"))?;
        let half = off(&picture, &view, &image, [0.5, 0.0]);
        ensure(half > right, || format!("{above_m} m above half a texel makes no difference"))?;
    }
    Ok(())
}

/// Largest difference from a picture of the level ground computed here, its texels moved by `moved` for comparison.
fn off(picture: &Picture, view: &View, image: &Image, moved: [f64; 2]) -> f64 {
    let shape = &image.shape;
    let texel_m = (shape.texel_m[0] * shape.texel_m[1]).sqrt();
    let mut most = 0.0_f64;
    for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
        let (at, distance_m) = ground_of(view, x, y);
        let texels = [0, 1].map(|i| (at[i] - shape.origin_m[i]) / shape.texel_m[i] + moved[i]);
        let level = (distance_m / view.pixels_per_radian() / texel_m).log2().max(0.0);
        let [fine, coarse] = [level as u32, level as u32 + 1]
            .map(|l| image.bilinear(l, texels.map(|t| t / f64::from(1 << l))));
        for (i, shown) in pixel(picture, x, y).iter().take(3).enumerate() {
            let expected = fine[i] + (coarse[i] - fine[i]) * level.fract();
            most = most.max((encoded(expected) - f64::from(*shown)).abs());
        }
    }
    most
}

/// Slow colours, so that a step between neighbours can only be a seam: straight down, aslant, and where levels pass into another.
fn seams(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = Image::new(Image::shape_over(&square.terrain, 0.4), |level, x, y| {
        let [u, v] = [x, y].map(|c| (c as f64 + 0.5) * f64::from(1 << level) / 3200.0);
        [encoded(0.05 + 0.6 * u).round() as u8, encoded(0.05 + 0.6 * v).round() as u8, 40, 255]
    });
    drape(&mut scene, &image, 100);
    let look = bare();
    let middle = 3.0 * 504.0 * 0.4;
    let eye = DVec3::new(middle - 30.0, middle - 260.0, 160.0);
    let aslant = View::look_at(eye, DVec3::new(middle, middle, 100.0), SIZE_PX.into());
    for (name, view) in [
        ("near", down(middle, middle, 40.0)),
        ("two levels", down(middle, middle, 300.0)),
        ("aslant", aslant),
    ] {
        show_all(&mut scene, &image, &view);
        let picture = scene.draw(&view, &look);
        let mut most = 0;
        for y in 0..SIZE_PX[1] - 1 {
            for x in 0..SIZE_PX[0] - 1 {
                if ground_of(&view, x, y).0.truncate().cmplt(DVec3::splat(1270.0).truncate()).all()
                    && ground_of(&view, x, y).1 < 900.0
                    && ground_of(&view, x, y).0.truncate().min_element() > 5.0
                {
                    let here = pixel(&picture, x, y);
                    for there in [pixel(&picture, x + 1, y), pixel(&picture, x, y + 1)] {
                        most = most.max((0..3).map(|i| here[i].abs_diff(there[i])).max().unwrap_or(0));
                    }
                }
            }
        }
        let allowed = if name == "aslant" { 6 } else { 3 };
        ensure(most <= allowed, || format!("{name}: neighbours differ by {most}"))?;
    }
    Ok(())
}

fn far_away(gpu: &Gpu) -> Outcome {
    let corner = [65_536 - 64, 65_536 - 64];
    let pictures = [[0, 0], corner].map(|corner| {
        let square = Square::new(6, corner, [16.0, 16.0], hills);
        let start = DVec3::new(f64::from(corner[0]) * 16.0, f64::from(corner[1]) * 16.0, 0.0);
        let image = chart(ImageryShape {
            format: TileFormat::Rgba8,
            texels: [1024, 1024],
            levels: 9,
            origin_m: [start.x + 64.0, start.y + 32.0],
            texel_m: [0.75, 0.5],
        });
        let mut scene = Scene::new(gpu, &square);
        scene.show(&square.down_to(0));
        drape(&mut scene, &image, 16);
        [0.0, 1.0 / 256.0, 0.5].map(|further_m| {
            let eye = start + DVec3::new(400.0 + further_m, 300.0, 900.0);
            let view = View::look_at(eye, eye + DVec3::new(0.125, 0.25, -0.5), SIZE_PX.into());
            show_all(&mut scene, &image, &view);
            scene.draw(&view, &bare())
        })
    });
    for (near, far) in pictures[0].iter().zip(&pictures[1]) {
        ensure(near == far, || format!("the pictures differ by {}", near.difference(far)))?;
    }
    ensure(pictures[0][0] != pictures[0][2], || "half a metre makes no difference".into())
}

/// Stripes along the line of sight stay, stripes across it become their mean, on ground that is seen at some ten degrees.
fn anisotropy(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [80.0, 80.0], |_, _| 100.0);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let eye = DVec3::new(2560.0, 60.0, 170.0);
    let view = View::look_at(eye, eye + DVec3::new(0.0, 400.0, -70.0), SIZE_PX.into());
    // At 400 m a texel is a pixel wide, and a pixel six texels long.
    let texel_m = 400.0 / view.pixels_per_radian();
    let shape = Image::shape_over(&square.terrain, texel_m);
    let spread = |picture: &Picture| {
        let row = |y: u32| (60..180).map(move |x| (x, y));
        let shown: Vec<f64> =
            (88..93).flat_map(row).map(|(x, y)| linear_of(pixel(picture, x, y))[1]).collect();
        let mean = shown.iter().sum::<f64>() / shown.len() as f64;
        let most = shown.iter().map(|v| (v - mean).abs()).fold(0.0, f64::max);
        (mean, most)
    };
    let stripes = |along: bool, texels: i64| {
        Image::new(shape, move |level, x, y| {
            let wide = texels >> level;
            let at = if along { x } else { y };
            let value = if wide == 0 { 0.35 } else { 0.1 + 0.5 * (at / wide % 2) as f64 };
            let code = encoded(value).round() as u8;
            [code, code, code, 255]
        })
    };
    let mut measured = Vec::new();
    for (along, texels) in [(true, 4), (false, 1)] {
        let image = stripes(along, texels);
        drape(&mut scene, &image, 64);
        show_all(&mut scene, &image, &view);
        measured.push(spread(&scene.draw(&view, &bare())));
    }
    let [(_, across), (mean, calm)] = [measured[0], measured[1]];
    println!("stripes along: +-{across:.3}; across: {mean:.3} +-{calm:.3}");
    ensure(across > 0.2, || format!("stripes along the line of sight are left at {across:.3} of 0.25"))?;
    ensure(calm < 0.06 && (mean - 0.35).abs() < 0.03, || {
        format!("stripes across it show as {mean:.3} +-{calm:.3} where 0.35 is meant")
    })
}
