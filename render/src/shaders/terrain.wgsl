// The mesh drawn with shared vertices (indexed), or with three of its own for every triangle, where edges or
// levels are to be seen; and the walls along its border.

@group(0) @binding(2) var<storage, read> triangles: array<u32>;
@group(0) @binding(7) var<storage, read> moved_heights: array<f32>;

// Height of a vertex as drawn, relative to the height origin.
fn moved(slot: u32) -> f32 {
    if MORPH {
        return moved_heights[slot];
    }
    return own(vertices[slot]);
}

struct SharedPoint {
    @builtin(position) position: vec4<f32>,
    @location(0) from_eye_m: vec3<f32>,
    @location(1) cells: vec2<f32>,
    @location(2) height_from_origin_m: f32,
}

fn place(slot: u32) -> SharedPoint {
    let v = vertices[slot];
    let height = moved(slot);
    let cells = cells_from_eye(v);
    let from_eye_m = metres_from_eye(cells, height);
    return SharedPoint(frame.clip_from_eye * vec4(from_eye_m, 1.0), from_eye_m, cells, height);
}

@vertex
fn shared_vertex(@builtin(vertex_index) slot: u32) -> SharedPoint {
    return place(slot);
}

// Upward normal of the triangle a pixel lies in, from its own derivatives.
fn facet(from_eye_m: vec3<f32>) -> vec3<f32> {
    let n = cross(dpdx(from_eye_m), dpdy(from_eye_m));
    let up = n * select(-1.0, 1.0, n.z >= 0.0);
    return up / max(length(up), 1e-20);
}

fn ground_at(p: SharedPoint) -> Ground {
    let step_m = length(vec2(dpdx(p.height_from_origin_m), dpdy(p.height_from_origin_m)));
    return Ground(p.from_eye_m, p.cells, p.height_from_origin_m + frame.height.x, step_m, facet(p.from_eye_m), 0.0, 0.0, 0.0);
}

@fragment
fn shared_fragment(p: SharedPoint) -> @location(0) vec4<f32> {
    return ground(ground_at(p), p.position.xy);
}

struct OwnPoint {
    @builtin(position) position: vec4<f32>,
    @location(0) from_eye_m: vec3<f32>,
    @location(1) cells: vec2<f32>,
    @location(2) height_from_origin_m: f32,
    @location(3) corner: vec3<f32>,
    @location(4) @interpolate(flat) level: f32,
    @location(5) @interpolate(flat) demand: f32,
}

// Screen error over tolerance that would show without the vertex, on a scale of octaves.
fn demand_of(v: Vertex) -> f32 {
    let true_place = metres_from_eye(cells_from_eye(v), own(v));
    if frame.lod_more.y > 0.0 {
        return clamp(log2(max(excess_along_sight(v), 1e-6)), 0.0, 4.0);
    }
    let nearest_m = length(true_place - frame.lod.xyz) - v.radius_m * frame.lod_more.x;
    return clamp(log2(frame.lod.w * v.error_m * frame.height.z / max(nearest_m, 1e-3)), 0.0, 4.0);
}

@vertex
fn own_vertex(@builtin(vertex_index) i: u32) -> OwnPoint {
    let first = i - i % 3u;
    var finest = vertices[triangles[first]];
    for (var k = 1u; k < 3u; k++) {
        let other = vertices[triangles[first + k]];
        if (other.bits & 255u) < (finest.bits & 255u) {
            finest = other;
        }
    }
    let p = place(triangles[i]);
    let corner = vec3(f32(i % 3u == 0u), f32(i % 3u == 1u), f32(i % 3u == 2u));
    return OwnPoint(p.position, p.from_eye_m, p.cells, p.height_from_origin_m, corner, f32(finest.bits & 255u), demand_of(finest));
}

@fragment
fn own_fragment(p: OwnPoint) -> @location(0) vec4<f32> {
    var g = ground_at(SharedPoint(p.position, p.from_eye_m, p.cells, p.height_from_origin_m));
    // Products, not powers: of negative numbers those are undefined, and graphics cards make no number of them.
    let east = dpdx(p.corner);
    let down = dpdy(p.corner);
    let a_pixel = sqrt(east * east + down * down);
    let away_px = p.corner / max(a_pixel, vec3(1e-9));
    let nearest_px = min(away_px.x, min(away_px.y, away_px.z));
    // Half of a line lies on either side of the edge.
    g.edge = clamp(0.5 * frame.wire.x + 0.5 - nearest_px, 0.0, 1.0);
    g.level = p.level;
    g.demand = p.demand;
    return ground(g, p.position.xy);
}

struct WallPoint {
    @builtin(position) position: vec4<f32>,
    @location(0) from_eye_m: vec3<f32>,
    @location(1) height_m: f32,
    @location(2) depth_m: f32,
}

// Two triangles below each border edge, whose upper corners move with the mesh.
@vertex
fn wall_vertex(
    @builtin(vertex_index) corner: u32,
    @location(0) ends: vec2<u32>,
) -> WallPoint {
    // 0 1 2, 2 1 3 with the upper corners even.
    var corners = array<u32, 6>(0u, 1u, 2u, 2u, 1u, 3u);
    let which = corners[corner];
    let slot = select(ends.x, ends.y, which >= 2u);
    let v = vertices[slot];
    let top = moved(slot);
    let bottom = min(frame.lod_more.w - frame.height.x, top);
    let height = select(top, bottom, (which & 1u) == 1u);
    let from_eye_m = metres_from_eye(cells_from_eye(v), height);
    return WallPoint(frame.clip_from_eye * vec4(from_eye_m, 1.0), from_eye_m, height + frame.height.x, top - height);
}

@fragment
fn wall_fragment(p: WallPoint) -> @location(0) vec4<f32> {
    let n = normalize(cross(dpdx(p.from_eye_m), dpdy(p.from_eye_m)));
    // Towards the eye, whichever side is seen.
    let normal = n * select(1.0, -1.0, dot(n, p.from_eye_m) > 0.0);
    let colour = lit(vec3(0.30, 0.26, 0.22), normalize(vec3(normal.xy, 0.25)));
    let distance_m = length(p.from_eye_m);
    return to_target(through_air(colour, p.from_eye_m / max(distance_m, 1e-6), distance_m), p.position.xy);
}
