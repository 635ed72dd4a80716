// What all stages know of the frame. The same fields stand in uniforms.rs.

struct Frame {
    clip_from_eye: mat4x4<f32>,
    // Through the picture's right and top edge, and along the line of sight.
    ray_right: vec4<f32>,
    ray_up: vec4<f32>,
    ray_forward: vec4<f32>,
    // Column and row of the cell the eye is over; flags; unused.
    grid: vec4<i32>,
    // Metres a sample east and north; the eye's place in its cell.
    spacing: vec4<f32>,
    // Height origin, eye above the exaggerated origin, exaggeration, metres of the near plane.
    height: vec4<f32>,
    // Eye the mesh was refined for, from the eye; nu.
    lod: vec4<f32>,
    // Factor on radii; 1 where errors are measured along the line of sight, else 0; pixels a radian; bottom of side walls, metres before exaggeration.
    lod_more: vec4<f32>,
    // Towards the sun; strength of its light.
    sun: vec4<f32>,
    sun_colour: vec4<f32>,
    // Light of the sky on level ground; share of shading that shows (0 leaves the bare tint).
    ambient: vec4<f32>,
    zenith: vec4<f32>,
    // Colour at the horizon; 1 over the haze's distance.
    horizon: vec4<f32>,
    // Eye above the lowest ground in scale heights of the air; 1 over a scale height.
    air: vec4<f32>,
    // Lowest height, 1 over the range; steepness from which rock shows, strength of it.
    tint: vec4<f32>,
    rock: vec4<f32>,
    // Interval, lines from index line to index line, width in pixels, opacity.
    contour: vec4<f32>,
    contour_colour: vec4<f32>,
    // Width in pixels, opacity.
    wire: vec4<f32>,
    wire_colour: vec4<f32>,
    // Levels, log2 of the cells of a tile, texels of a layer.
    tiles: vec4<u32>,
    // Samples east and north.
    terrain: vec4<u32>,
    // Levels of the image, texels of a tile without and with its border, width of the border.
    image: vec4<u32>,
    // The texel that the eye is over; texels east and north.
    image_eye: vec4<i32>,
    // Texels a metre east and north; the eye's place in its texel.
    image_scale: vec4<f32>,
    // Share of the image in the ground's colour; 1 where its colours are not yet multiplied by alpha.
    image_share: vec4<f32>,
    // The eye, metres east and north: what is left beyond whole stretches of TILED_M; from the south-west sample.
    eye_m: vec4<f32>,
    // Share of the material in the ground's colour.
    material: vec4<f32>,
}

const PI: f32 = 3.14159265;
// Metres after which tiled textures are where they were; material/mod.rs has the same.
const TILED_M: f32 = 4096.0;

// Fixed when a pipeline is made, so that what a look does not show costs nothing: software drivers run both sides of a branch.
override SURFACE: u32 = 0u;
override CONTOURS: bool = false;
override TILES: bool = true;
override IMAGE: bool = false;
override MATERIAL: bool = false;
override MORPH: bool = true;
// Whether the target encodes sRGB itself.
override ENCODES: bool = true;
// Depth infinitely far: 0 where depth is reversed, else 1.
override FARTHEST: f32 = 0.0;

@group(0) @binding(0) var<uniform> frame: Frame;

fn encode_srgb(linear: vec3<f32>) -> vec3<f32> {
    let c = clamp(linear, vec3(0.0), vec3(1.0));
    return select(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, c <= vec3(0.0031308));
}

// A hash without pattern over pixels, for noise below the quantisation step: smooth skies show no bands.
fn dither(at: vec2<f32>) -> f32 {
    return fract(52.9829189 * fract(dot(floor(at), vec2(0.06711056, 0.00583715)))) - 0.5;
}

fn to_target(linear: vec3<f32>, at: vec2<f32>) -> vec4<f32> {
    // Shoulder: highlights approach 1 instead of being cut off.
    let knee = 0.8;
    let over = max(linear - knee, vec3(0.0));
    let soft = min(linear, vec3(knee)) + (1.0 - knee) * (over / (over + (1.0 - knee)));
    let step = dither(at) / 255.0;
    if ENCODES {
        // A step of the code is about twice the root of linear light.
        return vec4(soft + 2.0 * step * sqrt(max(soft, vec3(0.0))), 1.0);
    }
    return vec4(encode_srgb(soft) + step, 1.0);
}
