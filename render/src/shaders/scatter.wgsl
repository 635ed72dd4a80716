// Puts the entries of a patch into their slots. Slots are distinct, so no two invocations write one place.

@group(0) @binding(0) var<storage, read> entries: array<u32>;
@group(0) @binding(1) var<storage, read_write> vertices: array<u32>;
@group(0) @binding(2) var<storage, read_write> triangles: array<u32>;

@compute @workgroup_size(64)
fn scatter_vertices(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = id.x * 9u;
    if first + 9u > arrayLength(&entries) {
        return;
    }
    let place = entries[first] * 8u;
    for (var i = 0u; i < 8u; i++) {
        vertices[place + i] = entries[first + 1u + i];
    }
}

@compute @workgroup_size(64)
fn scatter_triangles(@builtin(global_invocation_id) id: vec3<u32>) {
    let first = id.x * 4u;
    if first + 4u > arrayLength(&entries) {
        return;
    }
    let place = entries[first] * 3u;
    for (var i = 0u; i < 3u; i++) {
        triangles[place + i] = entries[first + 1u + i];
    }
}
