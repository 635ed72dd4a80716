// How far each vertex has moved from its coarse to its own height.
//
// A vertex enters the mesh when its distance to the eye falls below nu * e + r. There its weight is 0 and it lies on the edge it
// splits; at half the way to r, nu * e / 2 + r, it is 1. Along the line of sight the same holds of the error that shows: at the tolerance its weight is 0, at twice that 1. The weight depends on the vertex and the eye alone, so all
// triangles at a vertex agree and the mesh conforms while it moves. The edge's ends may be moving themselves, so heights are found in steps:
// each takes the ends' heights of the step before, and n steps are exact where at most n generations move at once. An ancestor of twice
// the error has arrived before its descendant starts, so few do.

@group(0) @binding(2) var<storage, read_write> weights: array<f32>;
@group(0) @binding(3) var<storage, read> heights_before: array<f32>;
@group(0) @binding(4) var<storage, read_write> heights_after: array<f32>;

fn slot_of(id: vec3<u32>, groups: vec3<u32>) -> u32 {
    return id.y * groups.x * 64u + id.x;
}

@compute @workgroup_size(64)
fn morph_start(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = slot_of(id, groups);
    if slot >= arrayLength(&weights) {
        return;
    }
    let v = vertices[slot];
    let true_place = metres_from_eye(cells_from_eye(v), own(v));
    let distance_m = length(true_place - frame.lod.xyz);
    let reach = frame.lod.w * v.error_m * frame.height.z;
    let inside = reach + v.radius_m * frame.lod_more.x - distance_m;
    var share = clamp(inside / max(0.5 * reach, 1e-6), 0.0, 1.0);
    if frame.lod_more.y > 0.0 {
        share = clamp(2.0 - 2.0 / max(excess_along_sight(v), 1e-6), 0.0, 1.0);
    }
    // An endless error has no middle of the way.
    weights[slot] = select(share, 1.0, reach > 1e30);
    heights_after[slot] = own(v);
}

@compute @workgroup_size(64)
fn morph_step(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let slot = slot_of(id, groups);
    if slot >= arrayLength(&weights) {
        return;
    }
    let v = vertices[slot];
    let coarse = 0.5 * (heights_before[v.end_b] + heights_before[v.end_d]);
    let weight = weights[slot];
    // Exactly its own height on arrival, whatever the rounding of a mixture.
    heights_after[slot] = select(mix(coarse, own(v), weight), own(v), weight >= 1.0);
}
