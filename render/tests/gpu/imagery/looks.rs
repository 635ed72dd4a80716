//! Colour, light and what is transparent, whatever the format.

use glam::DVec3;
use terrasoar_render::{
    Contours, DeviceWatch, Gpu, Haze, ImageryShape, Look, Sun, Surface, TileFormat, View, Wireframe, wgpu,
};

use super::{SIZE_PX, bare, chart, down, level_ground, pixel, show_all};
use crate::support::image::{Image, drape, encoded, in_565, linear_of};
use crate::support::landscape::hills;
use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("imagery::no_image_shows_the_tint", transparent),
        ("imagery::half_transparent_is_half_the_light", half_transparent),
        ("imagery::blocks_look_as_their_texels", blocks),
        ("imagery::a_device_without_blocks_takes_texels", without_blocks),
        ("imagery::light_does_not_double", light),
        ("imagery::lines_and_edges_lie_over_it", lines),
    ]
}

/// East of the middle the image is transparent, and it ends before the ground does.
fn transparent(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let shape = ImageryShape {
        origin_m: [100.0, 100.0],
        texels: [2160, 2160],
        ..Image::shape_over(&square.terrain, 0.5)
    };
    let image =
        Image::new(shape, |level, x, _| if (x << level) < 1080 { [60, 60, 200, 255] } else { [0; 4] });
    drape(&mut scene, &image, 64);
    let view = View::look_at(DVec3::new(640.0, 640.0, 2400.0), DVec3::new(640.0, 640.0, 0.0), SIZE_PX.into());
    show_all(&mut scene, &image, &view);
    scene.give_tiles(&view);
    let look = Look::default().haze(Haze::Off).morph(false);
    let tint = scene.draw(&view, &look);
    let photo = scene.draw(&view, &look.imagery(1.0));
    let half = scene.draw(&view, &look.imagery(0.5));
    let depth = scene.depth_m();
    let ([right, up, forward], [tan_x, tan_y]) = (view.axes(), view.half_tangents());
    let [mut inside, mut outside] = [0, 0];
    for (i, depth_m) in (0..).zip(&depth) {
        let (x, y) = (i % SIZE_PX[0], i / SIZE_PX[0]);
        let across = |p: u32, n: u32, tan: f64| tan * (2.0 * (f64::from(p) + 0.5) / f64::from(n) - 1.0);
        let at = view.eye_m
            + f64::from(*depth_m)
                * (forward + right * across(x, SIZE_PX[0], tan_x) - up * across(y, SIZE_PX[1], tan_y));
        let [a, b, c] = [&tint, &photo, &half].map(|p| pixel(p, x, y));
        let margin_m = 30.0;
        let [east, north] = [at.x - 100.0, at.y - 100.0];
        if *depth_m == 0.0 || !(-80.0..1150.0).contains(&east) || !(-80.0..1150.0).contains(&north) {
            continue;
        }
        let along = (margin_m..1080.0 - margin_m).contains(&north);
        if (margin_m..540.0 - margin_m).contains(&east) && along {
            inside += 1;
            let between =
                (0..3).all(|i| c[i] + 1 >= a[i].min(b[i]) && c[i] <= a[i].max(b[i]).saturating_add(1));
            ensure(b[2] > b[0] && b != a && c != a && c != b && between, || {
                format!("pixel {x}, {y} of the image is {b:?}, {c:?} at half, {a:?} without")
            })?;
        } else if east < -margin_m
            || east > 540.0 + margin_m
            || north < -margin_m
            || north > 1080.0 + margin_m
        {
            outside += 1;
            ensure(a == b && a == c, || format!("pixel {x}, {y} beside the image is {b:?}, not {a:?}"))?;
        }
    }
    ensure(inside > 1000 && outside > 1000, || format!("{inside} pixels inside, {outside} outside"))
}

/// Of every format that has such texels, BC7 of squares of one colour.
fn half_transparent(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let view = down(640.0, 640.0, 1500.0);
    // A height whose colour is too dark for the shoulder.
    let look = bare().tint_range_m([0.0, 9000.0]).rock(0.0);
    let tint = scene.draw(&view, &look.imagery(0.0));
    let colour = [151, 75, 201, 129];
    for format in gpu.capabilities.imagery_formats().iter().filter(|f| **f != TileFormat::Bc1) {
        let shape = ImageryShape { format: *format, ..Image::shape_over(&square.terrain, 1.0) };
        let image = Image::new(shape, move |_, _, _| colour);
        drape(&mut scene, &image, 16);
        show_all(&mut scene, &image, &view);
        let shown = scene.draw(&view, &look);
        let share = 129.0 / 255.0;
        let photo = linear_of(colour);
        for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
            let below = linear_of(pixel(&tint, x, y));
            for (channel, code) in pixel(&shown, x, y).iter().take(3).enumerate() {
                let expected = encoded(share * photo[channel] + (1.0 - share) * below[channel]);
                ensure((expected - f64::from(*code)).abs() < 3.0, || {
                    format!("{format:?}: pixel {x}, {y} is {code} in channel {channel}, not {expected:.1}")
                })?;
            }
        }
    }
    Ok(())
}

/// Squares of two colours a block and transparent ones, stored both ways.
fn blocks(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let view =
        View::look_at(DVec3::new(300.0, 100.0, 900.0), DVec3::new(700.0, 900.0, 500.0), SIZE_PX.into());
    scene.show(&square.refine(&view));
    scene.give_tiles(&view);
    let texel = |_: u32, x: i64, y: i64| {
        // Tiles begin at multiples of 504 less 4, so blocks lie the same in all of them.
        let [i, j] = [x.div_euclid(4), y.div_euclid(4)];
        let hash = |seed: i64| ((i * 7919 + j * 104_729 + seed * 31).wrapping_mul(2_654_435_761) >> 7) as u8;
        match (x + 2 * y).rem_euclid(3) {
            0 if hash(9) < 60 => [0; 4],
            0 => in_565([hash(1), hash(2), hash(3)]),
            _ => in_565([hash(4), hash(5), hash(6)]),
        }
    };
    let shape = Image::shape_over(&square.terrain, 1.5);
    let look = Look::default().imagery(1.0);
    let mut pictures = Vec::new();
    for format in [TileFormat::Bc1, TileFormat::Rgba8] {
        let image = Image::new(ImageryShape { format, ..shape }, texel);
        drape(&mut scene, &image, 32);
        show_all(&mut scene, &image, &view);
        let stats = scene.renderer.imagery_stats();
        ensure(stats.uploaded_bytes >= stats.uploads * format.tile_bytes() as u64, || format!("{stats:?}"))?;
        pictures.push(scene.draw(&view, &look));
    }
    let most = pictures[0].rgba.iter().zip(&pictures[1].rgba).map(|(a, b)| a.abs_diff(*b)).max();
    ensure(most <= Some(3), || format!("the pictures differ by up to {most:?}"))?;
    // Squares of one colour, in blocks of the other kind.
    let plain = |_: u32, x: i64, y: i64| {
        let [i, j] = [x.div_euclid(4), y.div_euclid(4)];
        [(i * 37 % 200) as u8 | 1, (j * 53 % 200) as u8 | 1, ((i + j) * 11 % 200) as u8 | 1, 255]
    };
    let [seven, raw] = [TileFormat::Bc7, TileFormat::Rgba8].map(|format| {
        let image = Image::new(ImageryShape { format, ..shape }, plain);
        drape(&mut scene, &image, 32);
        show_all(&mut scene, &image, &view);
        scene.draw(&view, &look)
    });
    let most = seven.rgba.iter().zip(&raw.rgba).map(|(a, b)| a.abs_diff(*b)).max();
    ensure(most <= Some(3), || format!("the pictures of BC7 differ by up to {most:?}"))?;
    let plain = scene.draw(&view, &Look::default());
    ensure(plain.difference(&pictures[0]) > 0.05, || "there is no image to see".into())
}

/// As some phones are: made here by not asking for the feature. The picture is the other device's.
fn without_blocks(gpu: &Gpu) -> Outcome {
    // An adapter of its own: on OpenGL devices of one adapter share what they are made of.
    let Gpu { adapter, mut capabilities, .. } = Gpu::headless_blocking().map_err(|e| e.to_string())?;
    capabilities.texture_compression_bc = false;
    let request = adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("no blocks"),
        required_limits: adapter.limits(),
        ..Default::default()
    });
    let (device, queue) = pollster::block_on(request).map_err(|e| e.to_string())?;
    let watch = DeviceWatch::install(&device);
    let plain = Gpu { adapter, device, queue, capabilities, watch };
    ensure(plain.capabilities.imagery_formats() == [TileFormat::Rgba8], || "it takes blocks".into())?;
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let view =
        View::look_at(DVec3::new(300.0, 100.0, 900.0), DVec3::new(700.0, 900.0, 500.0), SIZE_PX.into());
    let image = chart(Image::shape_over(&square.terrain, 4.0));
    let pictures = [gpu, &plain].map(|gpu| {
        let mut scene = Scene::new(gpu, &square);
        scene.show(&square.refine(&view));
        drape(&mut scene, &image, 32);
        show_all(&mut scene, &image, &view);
        scene.draw(&view, &Look::default().imagery(1.0))
    });
    ensure(pictures[0] == pictures[1], || {
        format!("they differ by {}", pictures[0].difference(&pictures[1]))
    })?;
    let mut scene = Scene::new(&plain, &square);
    for format in [TileFormat::Bc1, TileFormat::Bc7] {
        let refused = scene.renderer.set_imagery(&image.shape, format, 1 << 22);
        ensure(refused.is_err_and(|e| e.to_string().contains("RGBA8")), || format!("{format:?} is taken"))?;
    }
    Ok(())
}

/// Level ground is the photograph by day; hills have about half the contrast of bare ones, in whatever sun.
fn light(gpu: &Gpu) -> Outcome {
    let sun = |elevation_deg: f32| Sun::default().elevation_rad(elevation_deg.to_radians());
    let grey = |shape| Image::new(shape, |_, _, _| [120, 120, 120, 255]);
    let look = bare().shading(1.0).surface(Surface::Plain);
    let flat = level_ground();
    let mut scene = Scene::new(gpu, &flat);
    scene.show(&flat.down_to(0));
    let image = grey(Image::shape_over(&flat.terrain, 2.0));
    drape(&mut scene, &image, 16);
    let view = down(640.0, 640.0, 500.0);
    show_all(&mut scene, &image, &view);
    for elevation_deg in [35.0, 50.0, 85.0] {
        let shown = pixel(&scene.draw(&view, &look.sun(sun(elevation_deg))), 100, 90);
        ensure(shown[..3].iter().all(|c| c.abs_diff(120) <= 1), || {
            format!("level ground is {shown:?} under a sun at {elevation_deg} degrees")
        })?;
    }
    let low = pixel(&scene.draw(&view, &look.sun(sun(3.0))), 100, 90);
    ensure(low[0] < 100 && low[0] > 30, || format!("at sunset it is {low:?}"))?;

    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = grey(Image::shape_over(&square.terrain, 2.0));
    drape(&mut scene, &image, 16);
    let view = View::look_at(DVec3::new(640.0, 640.0, 1500.0), DVec3::new(640.0, 640.0, 0.0), SIZE_PX.into());
    show_all(&mut scene, &image, &view);
    scene.give_tiles(&view);
    for azimuth_deg in [0.0_f32, 120.0, 250.0] {
        let sun = Sun::default().azimuth_rad(azimuth_deg.to_radians());
        // Spread of the logarithm of light over the picture.
        let [bare, photo] = [0.0, 1.0].map(|imagery| {
            let picture = scene.draw(&view, &look.imagery(imagery).sun(sun));
            let logs: Vec<f64> = picture
                .rgba
                .chunks_exact(4)
                .map(|p| linear_of([p[0], p[1], p[2], p[3]])[1].max(1e-3).ln())
                .collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt()
        });
        ensure(photo > 0.4 * bare && photo < 0.65 * bare, || {
            format!("sun from {azimuth_deg}: contrast {photo:.3} on the image, {bare:.3} on bare ground")
        })?;
    }
    Ok(())
}

/// Edges that nobody sees change nothing though triangles have vertices of their own; contours are as dark as on bare ground.
fn lines(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = Image::new(Image::shape_over(&square.terrain, 1.0), |_, _, _| [150, 140, 130, 255]);
    drape(&mut scene, &image, 16);
    let view = View::look_at(DVec3::new(640.0, 640.0, 1500.0), DVec3::new(640.0, 640.0, 0.0), SIZE_PX.into());
    show_all(&mut scene, &image, &view);
    let look = bare();
    let plain = scene.draw(&view, &look);
    let unseen = Wireframe::default().opacity(0.0);
    let edges = scene.draw(&view, &look.wireframe(unseen));
    ensure(edges.difference(&plain) < 0.001, || format!("unseen edges: {}", edges.difference(&plain)))?;
    let black = Contours::default().colour([0.0; 3]).opacity(1.0).interval_m(40.0);
    let contours = Some(black);
    let on_image = scene.draw(&view, &look.contours(contours));
    let on_tint = scene.draw(&view, &look.contours(contours).imagery(0.0));
    let dark = |p: &Picture| p.rgba.chunks_exact(4).filter(|p| p[..3].iter().all(|c| *c < 20)).count();
    let [on_image, on_tint, none] = [&on_image, &on_tint, &plain].map(dark);
    ensure(on_tint > 100 && on_image.abs_diff(on_tint) * 20 < on_tint && none == 0, || {
        format!("{on_image} pixels of lines on the image, {on_tint} on bare ground, {none} without")
    })
}
