// Vertices of the mesh: where they are from the eye, and how far each has moved from its coarse to its own height.
//
// A vertex enters the mesh when its distance to the eye falls below nu * e + r. There its weight is 0 and it lies on the edge it
// splits; at half the way to r, nu * e / 2 + r, it is 1. The weight depends on the vertex and the eye alone, so all
// triangles at a vertex agree and the mesh conforms while it moves. The edge's ends may be moving themselves: their
// heights are evaluated alike, to a fixed depth. An ancestor with twice the error has arrived before its descendant starts, so few levels suffice.

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
@group(0) @binding(2) var<storage, read> triangles: array<u32>;

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

fn weight(v: Vertex) -> f32 {
    let true_place = metres_from_eye(cells_from_eye(v), v.height_m - frame.height.x);
    let distance_m = length(true_place - frame.lod.xyz);
    let reach = frame.lod.w * v.error_m * frame.height.z;
    let inside = reach + v.radius_m * frame.lod_more.x - distance_m;
    // An endless error has no middle of the way.
    if reach > 1e30 {
        return 1.0;
    }
    return clamp(inside / max(0.5 * reach, 1e-6), 0.0, 1.0);
}

// Heights are relative to the height origin, so that small differences survive.
fn own(v: Vertex) -> f32 {
    return v.height_m - frame.height.x;
}

fn ends_mean_0(v: Vertex) -> f32 {
    return 0.5 * (own(vertices[v.end_b]) + own(vertices[v.end_d]));
}

fn moved_1(slot: u32) -> f32 {
    let v = vertices[slot];
    let w = weight(v);
    if w >= 1.0 {
        return own(v);
    }
    return mix(ends_mean_0(v), own(v), w);
}

fn moved_2(slot: u32) -> f32 {
    let v = vertices[slot];
    let w = weight(v);
    if w >= 1.0 {
        return own(v);
    }
    return mix(0.5 * (moved_1(v.end_b) + moved_1(v.end_d)), own(v), w);
}

fn moved_3(slot: u32) -> f32 {
    let v = vertices[slot];
    let w = weight(v);
    if w >= 1.0 {
        return own(v);
    }
    return mix(0.5 * (moved_2(v.end_b) + moved_2(v.end_d)), own(v), w);
}

fn moved(v: Vertex) -> f32 {
    if !MORPH {
        return own(v);
    }
    let w = weight(v);
    if w >= 1.0 {
        return own(v);
    }
    return mix(0.5 * (moved_3(v.end_b) + moved_3(v.end_d)), own(v), w);
}
