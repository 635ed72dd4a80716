// The photograph draped over the ground: which level a pixel needs, and the mean of the texels that it covers.
//
// A pixel covers an ellipse on the ground, longer the flatter it is looked at. The level follows its width, so the picture stays
// sharp, and taps along what its length has in excess keep it calm; only where that is more than there are taps the level rises instead. Width
// and length come from the distance and the normal of the slope tiles, not from triangles, so nothing shimmers as these change.

@group(0) @binding(8) var image_table: texture_2d<u32>;
@group(0) @binding(9) var image_layers: texture_2d_array<f32>;

// Twice the border of a tile: the taps of a pixel on its edge all lie within.
const MOST_TAPS: f32 = 8.0;

struct Footprint {
    // Finest texel, and the place in it.
    cell: vec2<i32>,
    within: vec2<f32>,
    // How far the taps reach, in finest texels.
    reach: vec2<f32>,
}

// From the finest resident tile that is not finer than a level; colours multiplied by alpha.
fn image_tile(f: Footprint, from_level: u32) -> vec4<f32> {
    for (var level = from_level; level < frame.image.x; level++) {
        let side = i32(frame.image.y << level);
        let tile = f.cell / side;
        let entry = layer_in(image_table, tile, level);
        if entry != 0u {
            let scale = exp2(-f32(level));
            let at = (vec2<f32>(f.cell - tile * side) + f.within) * scale + f32(frame.image.w);
            // The finer of two levels has texels of half a width, and less weight the more its taps fall short.
            let texels = max(length(f.reach) * scale, 1e-6);
            let taps = ceil(clamp(texels, 1.0, MOST_TAPS));
            let step = f.reach * scale * min(1.0, MOST_TAPS / texels) / taps;
            var sum = vec4(0.0);
            for (var i = 0.5; i < taps; i += 1.0) {
                let tap = clamp(at + step * (i - 0.5 * taps), vec2(0.5), vec2(f32(frame.image.z) - 0.5));
                let texel = textureSampleLevel(image_layers, smooth_sampler, tap / f32(frame.image.z), entry - 1u, 0.0);
                sum += vec4(texel.rgb * mix(1.0, texel.a, frame.image_share.y), texel.a);
            }
            return sum / taps;
        }
    }
    return vec4(0.0);
}

// Colour times alpha, and alpha: 0 where there is no image.
fn image_at(from_eye_m: vec3<f32>, normal: vec3<f32>) -> vec4<f32> {
    if !IMAGE {
        return vec4(0.0);
    }
    let from_cell = from_eye_m.xy * frame.image_scale.xy + frame.image_scale.zw;
    let whole = floor(from_cell);
    let unclamped = frame.image_eye.xy + vec2<i32>(whole);
    let cell = clamp(unclamped, vec2(0), frame.image_eye.zw - 1);
    let from_corner = vec2<f32>(unclamped - cell) + (from_cell - whole);

    let distance_m = max(length(from_eye_m), 1e-6);
    let sight = from_eye_m / distance_m;
    let cosine = dot(sight, normal);
    let along = sight - cosine * normal;
    let wide_m = distance_m / frame.lod_more.z;
    let long_m = along.xy / max(length(along), 1e-4) * (wide_m / max(abs(cosine), 0.02));
    let wide = wide_m * sqrt(frame.image_scale.x * frame.image_scale.y);
    let long = long_m * frame.image_scale.xy;
    let excess = sqrt(max(1.0 - wide * wide / max(dot(long, long), 1e-12), 0.0));
    let f = Footprint(cell, clamp(from_corner, vec2(0.0), vec2(1.0)), long * excess);
    let level = clamp(log2(max(wide, length(long) / MOST_TAPS)), 0.0, f32(frame.image.x - 1u));
    var colour = image_tile(f, u32(level));
    // A loop, not a branch, as in slopes_at.
    let blend = fract(level);
    for (var i = 0; i < i32(ceil(blend)); i++) {
        colour = mix(colour, image_tile(f, min(u32(level) + 1u, frame.image.x - 1u)), blend);
    }
    // The outermost texels fade over their own width, outwards.
    let outside = max(max(-from_corner, from_corner - 1.0), vec2(0.0));
    return colour * (1.0 - clamp(max(outside.x, outside.y) * exp2(-level), 0.0, 1.0));
}
