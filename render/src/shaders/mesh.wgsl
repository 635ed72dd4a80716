// Vertices of the mesh, and where they are from the eye.

struct Vertex {
    x: u32,
    y: u32,
    height_m: f32,
    error_m: f32,
    radius_m: f32,
    end_b: u32,
    end_d: u32,
    bits: u32,
}

@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;

// Columns and rows from the eye's cell: whole numbers, exact.
fn cells_from_eye(v: Vertex) -> vec2<f32> {
    return vec2<f32>(vec2<i32>(i32(v.x), i32(v.y)) - frame.grid.xy);
}

// Metres from the eye, at a height (before exaggeration) relative to the height origin.
fn metres_from_eye(cells: vec2<f32>, height_from_origin_m: f32) -> vec3<f32> {
    return vec3(
        cells * frame.spacing.xy - frame.spacing.zw,
        height_from_origin_m * frame.height.z - frame.height.y,
    );
}

// Heights are relative to the height origin, so that small differences survive.
fn own(v: Vertex) -> f32 {
    return v.height_m - frame.height.x;
}

// Error that shows along the line of sight over the tolerance, at most: 1 where the vertex enters the mesh.
fn excess_along_sight(v: Vertex) -> f32 {
    let from_eye_m = metres_from_eye(cells_from_eye(v), own(v)) - frame.lod.xyz;
    let distance_m = length(from_eye_m);
    let error_m = v.error_m * frame.height.z;
    let span_m = v.radius_m * frame.lod_more.x + error_m;
    let from_the_side = frame.lod.w * error_m / max(distance_m - span_m, 1e-3);
    return from_the_side * (length(from_eye_m.xy) + span_m) / (distance_m + span_m);
}
