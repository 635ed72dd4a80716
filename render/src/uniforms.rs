//! A frame's numbers as the shaders read them; `shaders/frame.wgsl` has the same fields in the same order.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::frame::DepthRange;
use crate::look::{Haze, Look};
use crate::material::TILED_M;
use crate::ramps::linear_of;
use crate::tiles::{Imagery, Pyramid, TILE_CELLS};
use crate::view::{LocalView, TerrainShape, clip_from_eye, near_m, whole_and_rest};
use terrasoar::view::{ErrorMetric, View};
use terrasoar_layout::imagery::{BORDER_TEXELS, INNER_TEXELS, TILE_TEXELS};

#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Uniforms {
    clip_from_eye: [[f32; 4]; 4],
    ray_right: [f32; 4],
    ray_up: [f32; 4],
    ray_forward: [f32; 4],
    grid: [i32; 4],
    spacing: [f32; 4],
    height: [f32; 4],
    lod: [f32; 4],
    lod_more: [f32; 4],
    sun: [f32; 4],
    sun_colour: [f32; 4],
    ambient: [f32; 4],
    zenith: [f32; 4],
    horizon: [f32; 4],
    air: [f32; 4],
    tint: [f32; 4],
    rock: [f32; 4],
    contour: [f32; 4],
    contour_colour: [f32; 4],
    wire: [f32; 4],
    wire_colour: [f32; 4],
    tiles: [u32; 4],
    terrain: [u32; 4],
    image: [u32; 4],
    image_eye: [i32; 4],
    image_scale: [f32; 4],
    image_share: [f32; 4],
    eye_m: [f32; 4],
    material: [f32; 4],
}

/// What the uniforms are made of.
pub(crate) struct Inputs<'a> {
    pub terrain: &'a TerrainShape,
    pub pyramid: &'a Pyramid,
    pub view: &'a View,
    pub refined_for: &'a View,
    pub look: &'a Look,
    pub imagery: Option<&'a Imagery>,
    pub wall_bottom_m: f32,
    pub depth_range: DepthRange,
}

impl Uniforms {
    pub(crate) fn new(inputs: &Inputs<'_>) -> Self {
        let Inputs { terrain, pyramid, view, refined_for, look, .. } = *inputs;
        let local = LocalView::new(view, terrain);
        let near_m = near_m(terrain);
        let (axes, tangents) = (view.axes(), view.half_tangents());
        let ([right, up, forward], [tan_x, tan_y]) = (axes, tangents);
        let with = |v: Vec3, w: f32| v.extend(w).to_array();
        let rgb = |[r, g, b]: [f32; 3], a: f32| [r, g, b, a];
        let scaled = |c: [f32; 3], by: f32| c.map(|c| c * by);
        let g = view.vertical_exaggeration;

        let (sin_azimuth, cos_azimuth) = look.sun.azimuth_rad.sin_cos();
        let (sin_elevation, cos_elevation) = look.sun.elevation_rad.sin_cos();
        let to_sun = Vec3::new(sin_azimuth * cos_elevation, cos_azimuth * cos_elevation, sin_elevation);
        // The lower the sun, the more air its light has crossed; below the horizon the sky darkens too.
        let low = (1.0 - sin_elevation / 0.5).clamp(0.0, 1.0);
        let sun_colour = [1.0, 0.96 - 0.22 * low, 0.88 - 0.42 * low];
        let day = (sin_elevation * 6.0 + 0.7).clamp(0.06, 1.0);
        let [zenith, horizon] = look.sky.map(|c| scaled(c, day));
        let horizon_warm = [horizon[0], horizon[1] * (1.0 - 0.10 * low), horizon[2] * (1.0 - 0.28 * low)];
        // The sky's light is its colour, half as saturated, at the given strength.
        let strongest = zenith.iter().fold(1e-6_f32, |m, c| m.max(*c));
        let sky_light = zenith.map(|c| look.sun.ambient * day * (0.74 + 0.26 * c / strongest));
        let hazy_m = |haze: Haze| haze.distance_m(terrain.diagonal_m());
        let haze = if look.haze == Haze::Off { 0.0 } else { 1.0 };
        let haze_m = hazy_m(look.haze).or(hazy_m(Haze::Auto)).unwrap_or(f64::INFINITY).max(1e-3);
        let scale_height_m = Haze::scale_height_m(haze_m);
        let eye_in_air = ((view.eye_m.z - g * terrain.height_range_m[0]) / scale_height_m).clamp(-2.0, 1e6);

        let [low_m, high_m] = look.tint_range_m.unwrap_or(terrain.height_range_m.map(|h| h as f32));
        let contour = look.contours.unwrap_or_default();
        let wire = look.wireframe.unwrap_or_default();
        let along_sight = if refined_for.metric == ErrorMetric::Sight { 1.0 } else { 0.0 };
        let image = inputs.imagery.map_or_else(Image::default, |imagery| Image::new(imagery, view));
        Self {
            clip_from_eye: clip_from_eye(axes, tangents, near_m, inputs.depth_range).to_cols_array_2d(),
            ray_right: with((right * tan_x).as_vec3(), 0.0),
            ray_up: with((up * tan_y).as_vec3(), 0.0),
            ray_forward: with(forward.as_vec3(), 0.0),
            grid: [local.origin[0], local.origin[1], 0, 0],
            spacing: [
                terrain.spacing_m[0] as f32,
                terrain.spacing_m[1] as f32,
                local.eye_in_cell_m[0],
                local.eye_in_cell_m[1],
            ],
            height: [local.height_origin_m, local.eye_above_origin_m, g as f32, near_m as f32],
            lod: with((refined_for.eye_m - view.eye_m).as_vec3(), refined_for.nu() as f32),
            lod_more: [g.max(1.0) as f32, along_sight, view.pixels_per_radian() as f32, inputs.wall_bottom_m],
            sun: with(to_sun, look.sun.strength),
            sun_colour: rgb(sun_colour, 0.0),
            ambient: rgb(sky_light, look.shading.clamp(0.0, 1.0)),
            zenith: rgb(zenith, 0.0),
            horizon: rgb(horizon_warm, haze / haze_m as f32),
            air: [eye_in_air as f32, (1.0 / scale_height_m) as f32, 0.0, 0.0],
            tint: [low_m, 1.0 / (high_m - low_m).max(1e-6), 0.17, look.rock.clamp(0.0, 1.0)],
            rock: rgb(linear_of(0x7d756c), 0.0),
            contour: [
                contour.interval_m,
                contour.index_every.max(1) as f32,
                contour.width_px,
                contour.opacity,
            ],
            contour_colour: rgb(contour.colour, 0.0),
            wire: [wire.width_px, if look.wireframe.is_some() { wire.opacity } else { 0.0 }, 0.0, 0.0],
            wire_colour: rgb(wire.colour, 0.0),
            tiles: [pyramid.levels(), TILE_CELLS.ilog2(), TILE_CELLS + 1, 0],
            terrain: [terrain.samples[0], terrain.samples[1], 0, 0],
            image: [image.levels, INNER_TEXELS, TILE_TEXELS, BORDER_TEXELS],
            image_eye: image.eye,
            image_scale: image.scale,
            image_share: [look.imagery.clamp(0.0, 1.0), image.straight, 0.0, 0.0],
            eye_m: [
                view.eye_m.x.rem_euclid(TILED_M) as f32,
                view.eye_m.y.rem_euclid(TILED_M) as f32,
                view.eye_m.x as f32,
                view.eye_m.y as f32,
            ],
            material: [look.material.clamp(0.0, 1.0), 0.0, 0.0, 0.0],
        }
    }
}

/// An image in numbers that single precision holds: the eye as a whole texel and a remainder, as with the grid.
#[derive(Default)]
struct Image {
    levels: u32,
    eye: [i32; 4],
    scale: [f32; 4],
    straight: f32,
}

impl Image {
    fn new(imagery: &Imagery, view: &View) -> Self {
        let shape = &imagery.shape;
        let eye = [0, 1].map(|i| whole_and_rest((view.eye_m[i] - shape.origin_m[i]) / shape.texel_m[i]));
        let [wide, high] = shape.texels.map(|n| n as i32);
        let [east, north] = shape.texel_m.map(|m| (1.0 / m) as f32);
        Self {
            levels: imagery.pool.pyramid.levels(),
            eye: [eye[0].0, eye[1].0, wide, high],
            scale: [east, north, eye[0].1 as f32, eye[1].1 as f32],
            straight: f32::from(u8::from(imagery.is_straight())),
        }
    }
}
