// A material of layers: textures in bands of height and slope, each over those before it.

struct OwnLayer {
    // Lowest and highest height, width of the soft edges, width of the texture; metres.
    heights: vec4<f32>,
    // Least and greatest slope, width of the soft edges, degrees; share at most.
    slopes: vec4<f32>,
}

@group(1) @binding(0) var own_textures: texture_2d_array<f32>;
@group(1) @binding(1) var own_sampler: sampler;
@group(1) @binding(2) var<uniform> own_layers: array<OwnLayer, OWN_LAYERS>;

fn material(at: GroundPoint) -> vec4<f32> {
    var colour = vec3(0.0);
    var covered = 0.0;
    for (var i = 0u; i < OWN_LAYERS; i++) {
        let layer = own_layers[i];
        let texel = textureSample(own_textures, own_sampler, tiled(at, layer.heights.w), i).rgb;
        let at_height = band(at.height_m, layer.heights.x, layer.heights.y, layer.heights.z);
        let share = layer.slopes.w * at_height * band(at.slope_deg, layer.slopes.x, layer.slopes.y, layer.slopes.z);
        colour = colour * (1.0 - share) + texel * share;
        covered = covered + share * (1.0 - covered);
    }
    // Colours are those of layers alone; where they cover in part, the look's own shows through.
    return vec4(colour / max(covered, 1e-6), covered);
}
