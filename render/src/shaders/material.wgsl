// What a material is told of a place on the ground, and what it may call. The function `material` itself is the embedder's: docs/embedding/materials.md.

struct GroundPoint {
    // Metres east and north of the terrain's south-west sample.
    place_m: vec2<f32>,
    // The same without whole stretches of 4,096 m that lie below the eye: precise everywhere.
    tiled_m: vec2<f32>,
    // Metres, before exaggeration.
    height_m: f32,
    // Steepness, 0 for level ground, before exaggeration.
    slope_deg: f32,
    // Upward unit normal, before exaggeration.
    normal: vec3<f32>,
    // Metres from the eye.
    distance_m: f32,
    // Colour that the look gives, linear light.
    colour: vec3<f32>,
    // Colour of the draped picture, linear light, and how much of it is there: 0 where there is none.
    picture: vec4<f32>,
}

// Texture coordinates for a texture that is so many metres wide and repeats without a seam. Its width is rounded so that a whole number lies in 4,096 m.
fn tiled(at: GroundPoint, size_m: f32) -> vec2<f32> {
    return at.tiled_m * (max(round(TILED_M / size_m), 1.0) / TILED_M);
}

// 1 within a band, 0 outside, and smoothly from one to the other over `soft` about each end.
fn band(value: f32, low: f32, high: f32, soft: f32) -> f32 {
    let from_ends = min(value - low, high - value);
    let t = clamp(from_ends / max(soft, 1e-6) + 0.5, 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}
