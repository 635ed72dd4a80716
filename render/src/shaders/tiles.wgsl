// The finest resident tile at a place that is not finer than needed, found through the table of those that are here.

@group(0) @binding(3) var tile_table: texture_2d<u32>;
@group(0) @binding(4) var tile_layers: texture_2d_array<f32>;
@group(0) @binding(5) var smooth_sampler: sampler;

// Level at which a cell covers about a pixel; wanted.rs computes the same.
fn needed_level(from_eye_m: vec3<f32>) -> f32 {
    let distance_m = max(length(from_eye_m), 1e-6);
    let steepness = clamp(abs(from_eye_m.z) / distance_m, 0.15, 1.0);
    let sample_m = sqrt(frame.spacing.x * frame.spacing.y);
    return log2(distance_m / (frame.lod_more.z * sample_m * sqrt(steepness)));
}

// The layer of a tile and 1, or 0 where it is not resident. A tile stands in the slot that its hash gives or in the first free one after that;
// tiles/table.rs does the same.
fn layer_in(slots: texture_2d<u32>, tile: vec2<i32>, level: u32) -> u32 {
    let last = (textureDimensions(slots).y << 6u) - 1u;
    let key = vec3(vec2<u32>(tile), level);
    let parts = key * vec3(0x9e3779b1u, 0x85ebca77u, 0xc2b2ae3du);
    let mixed = parts.x ^ parts.y ^ parts.z;
    var slot = ((mixed ^ (mixed >> 15u)) * 0x2c1b3c6du) >> countLeadingZeros(last);
    // Some slots are free, so the search ends; the bound is for a device that has lost them.
    for (var looked_at = 0u; looked_at <= last; looked_at++) {
        let entry = textureLoad(slots, vec2<i32>(vec2(slot & 63u, slot >> 6u)), 0);
        if entry.w == 0u || all(entry.xyz == key) {
            return entry.w;
        }
        slot = (slot + 1u) & last;
    }
    return 0u;
}

// Slopes east and north, and 1 if a tile was found.
fn tile_at(cell: vec2<i32>, last_inside: vec2<i32>, within: vec2<f32>, from_level: u32) -> vec3<f32> {
    for (var level = from_level; level < frame.tiles.x; level++) {
        let shift = frame.tiles.y + level;
        // The last sample belongs to the last tile; its neighbours beyond do not exist.
        let tile = min(cell, last_inside) >> vec2(shift);
        let entry = layer_in(tile_table, tile, level);
        if entry != 0u {
            let samples = vec2<f32>(cell - (tile << vec2(shift))) + within;
            let texel = samples * exp2(-f32(level)) + 0.5;
            let at = texel / f32(frame.tiles.z);
            return vec3(textureSampleLevel(tile_layers, smooth_sampler, at, entry - 1u, 0.0).rg, 1.0);
        }
    }
    return vec3(0.0);
}

// Slopes at a place given in samples from the eye's cell.
fn slopes_at(cells: vec2<f32>, from_eye_m: vec3<f32>) -> vec3<f32> {
    if !TILES {
        return vec3(0.0);
    }
    let last = vec2<i32>(frame.terrain.xy) - 1;
    let whole = floor(cells);
    let unclamped = frame.grid.xy + vec2<i32>(whole);
    let cell = clamp(unclamped, vec2(0), last);
    let within = select(cells - whole, vec2(0.0), (unclamped != cell) | (cell == last));
    let level = clamp(needed_level(from_eye_m), 0.0, f32(frame.tiles.x - 1u));
    var slopes = tile_at(cell, last - 1, within, u32(level));
    // The last third of a level passes into the next. A loop, not a branch: software drivers leave a loop that no pixel
    // needs, but run both sides of a branch.
    let blend = smoothstep(0.67, 1.0, fract(level));
    for (var i = 0; i < i32(ceil(blend)); i++) {
        slopes = mix(slopes, tile_at(cell, last - 1, within, min(u32(level) + 1u, frame.tiles.x - 1u)), blend);
    }
    return slopes;
}
