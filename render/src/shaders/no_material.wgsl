// Stands in where there is no material.

fn material(at: GroundPoint) -> vec4<f32> {
    return vec4(0.0);
}
