//! Materials: a function of the embedder's gives the ground's colour, in pixels that arithmetic says.

use glam::DVec3;
use terrasoar_render::{Gpu, Haze, Layer, Layers, Look, Material, RenderError, View, wgpu};
use wgpu::util::DeviceExt;

use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("materials::bands_of_height_and_slope", bands),
        ("materials::places_and_distances_are_told", places),
        ("materials::textures_tile_in_metres", tiling),
        ("materials::ground_far_away_has_the_mean_of_a_texture", mean),
        ("materials::layers_lie_over_each_other", layers),
        ("materials::exaggeration_changes_no_material", exaggeration),
        ("materials::a_share_and_taking_off", share),
        ("materials::own_buffers_are_read", buffers),
        ("materials::a_frame_of_another_material_is_refused", stale),
    ]
}

/// Metres from sample to sample.
const SPACING_M: f64 = 10.0;
/// Pixels a side of a picture.
const SIDE: u32 = 128;

/// Bare colours, so that a pixel is what the material gave.
fn bare() -> Look {
    Look::default().shading(0.0).haze(Haze::Off).morph(false)
}

/// From 800 m up, straight down with north at the top: 663 m of level ground across.
fn above(east_m: f64, north_m: f64) -> View {
    let eye = DVec3::new(east_m, north_m, 800.0);
    View::new(eye, 0.0, -90.0).viewport([SIDE, SIDE])
}

/// Flat in the west; from the middle on it rises eastwards as much as it goes: 45 degrees.
fn ramp(x: f64, _: f64) -> f64 {
    SPACING_M * (x - 32.0).max(0.0)
}

fn seen(
    gpu: &Gpu,
    square: &Square,
    view: &View,
    look: &Look,
    material: &Material,
) -> Result<Picture, String> {
    let mut scene = dressed(gpu, square, view, material)?;
    Ok(scene.draw(view, look))
}

fn dressed<'a>(
    gpu: &'a Gpu,
    square: &'a Square,
    view: &View,
    material: &Material,
) -> Result<Scene<'a>, String> {
    let mut scene = Scene::new(gpu, square);
    scene.show(&square.down_to(0));
    scene.give_tiles(view);
    scene.renderer.set_material(Some(material)).map_err(|e| e.to_string())?;
    Ok(scene)
}

/// The place on ground of a height that a pixel of `above` shows.
fn ground_at(view: &View, px: [u32; 2], height_m: impl Fn(f64) -> f64) -> [f64; 2] {
    let per_pixel = 2.0 * (0.5 * view.vertical_fov_rad).tan() / f64::from(SIDE);
    let [right, up] =
        [f64::from(px[0]) + 0.5, f64::from(SIDE - 1 - px[1]) + 0.5].map(|p| p - 0.5 * f64::from(SIDE));
    // Along the line of sight until it meets the ground: a few steps do for heights that change slowly.
    let mut east_m = view.eye_m.x;
    for _ in 0..60 {
        east_m = view.eye_m.x + right * per_pixel * (view.eye_m.z - height_m(east_m));
    }
    [east_m, view.eye_m.y + up * per_pixel * (view.eye_m.z - height_m(east_m))]
}

fn pixel(picture: &Picture, [x, y]: [u32; 2]) -> [u8; 3] {
    let at = 4 * (y * SIDE + x) as usize;
    [picture.rgba[at], picture.rgba[at + 1], picture.rgba[at + 2]]
}

fn is_near(a: [u8; 3], b: [u8; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= 2)
}

/// All pixels whose place `expected` tells a colour of.
fn all_are(
    picture: &Picture,
    view: &View,
    height_m: impl Fn(f64) -> f64 + Copy,
    expected: impl Fn([f64; 2]) -> Option<[u8; 3]>,
) -> Outcome {
    let mut looked_at = 0;
    for y in 0..SIDE {
        for x in 0..SIDE {
            let place = ground_at(view, [x, y], height_m);
            let Some(expected) = expected(place) else { continue };
            looked_at += 1;
            let is = pixel(picture, [x, y]);
            ensure(is_near(is, expected), || format!("at {place:.1?} m {is:?} is seen, not {expected:?}"))?;
        }
    }
    ensure(looked_at > SIDE * SIDE / 4, || format!("only {looked_at} pixels could be told"))
}

const RED: [u8; 3] = [188, 0, 0];
const GREEN: [u8; 3] = [0, 188, 0];
const BLUE: [u8; 3] = [0, 0, 188];

/// sRGB 188 is half of white's light, to a thousandth.
const TWO_BANDS: &str = "
fn material(at: GroundPoint) -> vec4<f32> {
    if at.slope_deg < 20.0 { return vec4(0.0, 0.0, 0.5, 1.0); }
    return vec4(select(vec3(0.5, 0.0, 0.0), vec3(0.0, 0.5, 0.0), at.height_m > 200.0), 1.0);
}";

fn ramp_m(east_m: f64) -> f64 {
    (east_m - 320.0).max(0.0)
}

fn bands(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], ramp);
    let view = above(400.0, 320.0);
    let material = Material::new(TWO_BANDS).map_err(|e| e.to_string())?;
    let picture = seen(gpu, &square, &view, &bare(), &material)?;
    let expected = |[east_m, north_m]: [f64; 2]| {
        let inside = (20.0..620.0).contains(&east_m) && (20.0..620.0).contains(&north_m);
        // Slopes are of samples; between two of them they pass from level to steep.
        let is_clear = (east_m - 320.0).abs() > 1.5 * SPACING_M && (east_m - 520.0).abs() > 6.0;
        (inside && is_clear).then_some(match east_m {
            e if e < 320.0 => BLUE,
            e if e < 520.0 => RED,
            _ => GREEN,
        })
    };
    all_are(&picture, &view, ramp_m, expected)?;
    // The same in layers.
    let [red, green, blue] = [0xbc0000, 0x00bc00, 0x0000bc].map(|rgb| Layer::plain(2, rgb));
    let material = Layers::new(2)
        .over(red)
        .over(green.heights_m([200.0, f32::INFINITY], 0.0))
        .over(blue.slopes_deg([f32::NEG_INFINITY, 20.0], 0.0))
        .material()
        .map_err(|e| e.to_string())?;
    all_are(&seen(gpu, &square, &view, &bare(), &material)?, &view, ramp_m, expected)
}

fn places(gpu: &Gpu) -> Outcome {
    // Far from the corner, where single precision steps by centimetres.
    let square = Square::new(6, [400_000, 300_000], [SPACING_M; 2], |_, _| 0.0);
    let view = above(4_000_320.0, 3_000_320.0);
    // Stripes of 64 m, by the precise place, and a disc by distance: 820 m of sight are 180 m on the ground.
    let text = "
fn material(at: GroundPoint) -> vec4<f32> {
    if at.distance_m < 820.0 { return vec4(0.0, 0.0, 0.5, 1.0); }
    let is_even = fract(at.tiled_m.x / 128.0) < 0.5;
    let is_there = all(abs(at.place_m - vec2(4000320.0, 3000320.0)) < vec2(400.0));
    return vec4(select(vec3(0.5, 0.0, 0.0), vec3(0.0, 0.5, 0.0), is_even), select(0.0, 1.0, is_there));
}";
    let material = Material::new(text).map_err(|e| e.to_string())?;
    let picture = seen(gpu, &square, &view, &bare(), &material)?;
    all_are(
        &picture,
        &view,
        |_| 0.0,
        |[east_m, north_m]| {
            let [dx, dy] = [east_m - 4_000_320.0, north_m - 3_000_320.0];
            let from_rim = dx.hypot(dy) - (820.0f64.powi(2) - 800.0f64.powi(2)).sqrt();
            let in_stripe = east_m.rem_euclid(64.0);
            let is_even = east_m.rem_euclid(128.0) < 64.0;
            let inside = dx.abs().max(dy.abs()) < 310.0;
            let is_clear = from_rim < -10.0 || (from_rim > 10.0 && in_stripe > 8.0 && in_stripe < 56.0);
            let colour = if from_rim < 0.0 {
                BLUE
            } else if is_even {
                GREEN
            } else {
                RED
            };
            (inside && is_clear).then_some(colour)
        },
    )
}

/// Left half of a texture red, right half green.
fn halves(side: u32) -> Vec<u8> {
    let row =
        [[188, 0, 0, 255].repeat(side as usize / 2), [0, 188, 0, 255].repeat(side as usize / 2)].concat();
    row.repeat(side as usize)
}

fn tiling(gpu: &Gpu) -> Outcome {
    let layers = Layers::new(64).over(Layer::new(halves(64), 256.0)).material().map_err(|e| e.to_string())?;
    // The eye on both sides of a line where one more whole stretch is taken off: the picture stays on the ground.
    let line_m = 977.0 * 4096.0;
    let corner = [((line_m - 320.0) / SPACING_M).round() as u32, 300_000];
    let square = Square::new(6, corner, [SPACING_M; 2], |_, _| 0.0);
    for east_m in [line_m - 1.0, line_m + 1.0] {
        let view = above(east_m, 3_000_320.0);
        let picture = seen(gpu, &square, &view, &bare(), &layers)?;
        all_are(
            &picture,
            &view,
            |_| 0.0,
            |[east_m, north_m]| {
                let in_half = east_m.rem_euclid(128.0);
                let inside = (east_m - line_m).abs() < 300.0 && (north_m - 3_000_320.0).abs() < 300.0;
                let colour = if east_m.rem_euclid(256.0) < 128.0 { RED } else { GREEN };
                (inside && in_half > 16.0 && in_half < 112.0).then_some(colour)
            },
        )?;
    }
    Ok(())
}

fn mean(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], |_, _| 0.0);
    // Two metres a texture, five a pixel: half of the light of each colour, which is sRGB 137 for 188.
    let layers = Layers::new(64).over(Layer::new(halves(64), 2.0)).material().map_err(|e| e.to_string())?;
    let view = above(320.0, 320.0);
    let picture = seen(gpu, &square, &view, &bare(), &layers)?;
    all_are(
        &picture,
        &view,
        |_| 0.0,
        |[east_m, north_m]| {
            let inside = (east_m - 320.0).abs().max((north_m - 320.0).abs()) < 300.0;
            inside.then_some([137, 137, 0])
        },
    )
}

fn layers(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], ramp);
    let view = above(400.0, 320.0);
    // Half of a second layer over the first, and where a soft edge is in its middle half of a third: light 0.25 and 0.25, sRGB 137.
    let [red, green, blue] = [0xbc0000, 0x00bc00, 0x0000bc].map(|rgb| Layer::plain(4, rgb));
    let material = Layers::new(4)
        .over(red)
        .over(green.opacity(0.5))
        .over(blue.heights_m([150.0, f32::INFINITY], 100.0))
        .material()
        .map_err(|e| e.to_string())?;
    let picture = seen(gpu, &square, &view, &bare(), &material)?;
    let light = |srgb: f64| if srgb <= 0.0 { 0.0 } else { ((srgb / 255.0 + 0.055) / 1.055).powf(2.4) };
    let code = |light: f64| match light {
        l if l <= 0.003_130_8 => 255.0 * 12.92 * l,
        l => 255.0 * (1.055 * l.powf(1.0 / 2.4) - 0.055),
    };
    all_are(&picture, &view, ramp_m, |[east_m, north_m]| {
        let inside = (20.0..620.0).contains(&east_m) && (20.0..620.0).contains(&north_m);
        let t = ((ramp_m(east_m) - 150.0) / 100.0 + 0.5).clamp(0.0, 1.0);
        let share = t * t * (3.0 - 2.0 * t);
        let half = code(0.5 * light(188.0) * (1.0 - share)).round() as u8;
        // A pixel is 8 m wide: where the curve is steep that shows.
        let is_clear = !(0.02..0.98).contains(&share);
        (inside && is_clear).then(|| [half, half, code(light(188.0) * share).round() as u8])
    })
}

fn exaggeration(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], ramp);
    let mut view = above(400.0, 320.0);
    view.eye_m.z = 1600.0;
    view.vertical_exaggeration = 2.0;
    // 63 degrees as drawn, 45 on the ground; 600 m as drawn, 300 on the ground.
    let text = "
fn material(at: GroundPoint) -> vec4<f32> {
    let is_ramp = abs(at.slope_deg - 45.0) < 1.0 && abs(at.normal.x + 0.7071) < 0.01;
    return vec4(select(vec3(0.0, 0.0, 0.5), vec3(0.5, 0.0, 0.0), is_ramp && at.height_m < 301.0), 1.0);
}";
    let material = Material::new(text).map_err(|e| e.to_string())?;
    let picture = seen(gpu, &square, &view, &bare(), &material)?;
    let drawn_m = |east_m: f64| 2.0 * ramp_m(east_m);
    let mut view_of_drawn = view;
    view_of_drawn.vertical_exaggeration = 1.0;
    let (mut red, mut blue) = (0, 0);
    for y in 0..SIDE {
        for x in 0..SIDE {
            let [east_m, north_m] = ground_at(&view_of_drawn, [x, y], drawn_m);
            if !(60.0..580.0).contains(&north_m)
                || !(30.0..600.0).contains(&east_m)
                || (east_m - 320.0).abs() < 40.0
            {
                continue;
            }
            let expected = if east_m > 320.0 { RED } else { BLUE };
            let is = pixel(&picture, [x, y]);
            ensure(is_near(is, expected), || format!("at {east_m:.0} m {is:?}, not {expected:?}"))?;
            *(if east_m > 320.0 { &mut red } else { &mut blue }) += 1;
        }
    }
    ensure(red > 100 && blue > 100, || format!("{red} and {blue} pixels were looked at"))
}

fn share(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], ramp);
    let view = above(400.0, 320.0);
    let without = {
        let mut scene = Scene::new(gpu, &square);
        scene.show(&square.down_to(0));
        scene.give_tiles(&view);
        scene.draw(&view, &bare())
    };
    // The look's own colour, which it is given, or nothing of it: no difference.
    for text in ["return vec4(at.colour, 1.0);", "return vec4(9.0, 0.0, 9.0, 0.0);"] {
        let text = format!("fn material(at: GroundPoint) -> vec4<f32> {{ {text} }}");
        let material = Material::new(&text).map_err(|e| e.to_string())?;
        let picture = seen(gpu, &square, &view, &bare(), &material)?;
        ensure(picture.difference(&without) < 1e-3, || format!("{text}: the picture differs"))?;
    }
    let material = Material::new(TWO_BANDS).map_err(|e| e.to_string())?;
    let mut scene = dressed(gpu, &square, &view, &material)?;
    ensure(scene.draw(&view, &bare()).difference(&without) > 0.1, || "it does not show".into())?;
    let off = scene.draw(&view, &bare().material(0.0));
    ensure(off == without, || "with a share of 0 it shows".into())?;
    scene.renderer.set_material(None).map_err(|e| e.to_string())?;
    ensure(scene.draw(&view, &bare()) == without, || "after it was taken off it shows".into())
}

const BOUND: &str = "
@group(1) @binding(3) var<uniform> own_colour: vec4<f32>;
@group(1) @binding(7) var<storage, read> own_shares: array<f32>;
fn material(at: GroundPoint) -> vec4<f32> { return vec4(own_colour.rgb, own_shares[1]); }";

fn buffers(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], |_, _| 0.0);
    let view = above(320.0, 320.0);
    let bare_text = Material::new(BOUND).map_err(|e| e.to_string())?;
    let mut scene = Scene::new(gpu, &square);
    let unbound = scene.renderer.set_material(Some(&bare_text));
    let said = unbound.map_or_else(|e| e.to_string(), |()| "no error".into());
    ensure(said.starts_with("line 2 of the material: ") && said.contains("Material::bindings"), || {
        said.clone()
    })?;

    let colour = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 16,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let bound = colour.clone();
    let material = bare_text.bindings(move |device, _, layout| {
        let shares = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: &[0.0_f32, 1.0].map(f32::to_le_bytes).concat(),
            usage: wgpu::BufferUsages::STORAGE,
        });
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 3, resource: bound.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 7, resource: shares.as_entire_binding() },
            ],
        })
    });
    let mut scene = dressed(gpu, &square, &view, &material)?;
    // Written from frame to frame.
    for (light, code) in [([0.5_f32, 0.0, 0.0, 0.0], RED), ([0.0, 0.0, 0.5, 0.0], BLUE)] {
        gpu.queue.write_buffer(&colour, 0, &light.map(f32::to_le_bytes).concat());
        let is = pixel(&scene.draw(&view, &bare()), [SIDE / 2, SIDE / 2]);
        ensure(is_near(is, code), || format!("{is:?}, not {code:?}"))?;
    }
    Ok(())
}

fn stale(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [SPACING_M; 2], ramp);
    let view = above(400.0, 320.0);
    let material = Material::new(TWO_BANDS).map_err(|e| e.to_string())?;
    let mut scene = dressed(gpu, &square, &view, &material)?;
    let format = terrasoar_render::PassFormat::new(wgpu::TextureFormat::Rgba8UnormSrgb);
    let look = bare();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let frame = terrasoar_render::Frame { view: &view, refined_for: None, look: &look };
    let prepared = scene.renderer.prepare(&mut encoder, &format, frame).map_err(|e| e.to_string())?;
    scene.renderer.set_material(Some(&material)).map_err(|e| e.to_string())?;
    let texture = |format| {
        gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
            view_formats: &[],
        })
    };
    let [colour, depth] =
        [format.colour, format.depth].map(|format| texture(format).create_view(&Default::default()));
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view: &colour,
            depth_slice: None,
            resolve_target: None,
            ops: Default::default(),
        })],
        depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
            view: &depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(0.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        }),
        ..Default::default()
    });
    let drawn = scene.renderer.draw(&mut pass, &prepared, true);
    ensure(matches!(drawn, Err(RenderError::Usage(_))), || format!("{drawn:?}"))
}
