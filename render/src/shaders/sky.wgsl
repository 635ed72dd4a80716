// One triangle over the whole picture, at infinite distance.

struct SkyPoint {
    @builtin(position) position: vec4<f32>,
    @location(0) ndc: vec2<f32>,
}

@vertex
fn sky_vertex(@builtin(vertex_index) i: u32) -> SkyPoint {
    let ndc = vec2(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0);
    return SkyPoint(vec4(ndc, FARTHEST, 1.0), ndc);
}

@fragment
fn sky_fragment(at: SkyPoint) -> @location(0) vec4<f32> {
    let ray = frame.ray_forward.xyz + at.ndc.x * frame.ray_right.xyz + at.ndc.y * frame.ray_up.xyz;
    return to_target(sky(normalize(ray)), at.position.xy);
}
