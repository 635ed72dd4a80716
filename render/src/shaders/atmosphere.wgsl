// The sky, and what air does to things far away. Both take the colour of the air from one function, so a terrain that ends in
// haze ends in the sky behind it.

// Light of the air in a direction; below the horizon as at the horizon.
fn air(direction: vec3<f32>) -> vec3<f32> {
    let up = clamp(direction.z, 0.0, 1.0);
    let down = (1.0 - up) * (1.0 - up);
    let height = 1.0 - down * down;
    let base = mix(frame.horizon.rgb, frame.zenith.rgb, height);
    // Forward scattering: the air is brighter and of the sun's colour around it, more so when the sun is low.
    let flat_direction = normalize(vec3(direction.xy, max(direction.z, 0.0)) + vec3(0.0, 0.0, 1e-6));
    let towards = max(dot(flat_direction, frame.sun.xyz), 0.0);
    let low = 1.0 - clamp(frame.sun.z, 0.0, 1.0);
    let t3 = towards * towards * towards;
    let t6 = t3 * t3;
    let t24 = t6 * t6 * t6 * t6;
    let glow = 0.22 * t6 * low + 0.25 * t24 * t24;
    return base + glow * frame.sun_colour.rgb * clamp(frame.sun.w, 0.0, 1.0);
}

fn sky(direction: vec3<f32>) -> vec3<f32> {
    let towards = dot(direction, frame.sun.xyz);
    let disc = smoothstep(0.99985, 0.99993, towards) * step(0.0, direction.z) * clamp(frame.sun.w, 0.0, 1.0);
    return air(direction) + disc * vec3(1.0, 0.96, 0.88);
}

// Metres of the densest air that so many metres of a straight line through ever thinner air amount to: density falls by e
// with every scale height above the lowest ground.
fn air_m(direction: vec3<f32>, distance_m: f32) -> f32 {
    let start = frame.air.x;
    let rise = direction.z * distance_m * frame.air.y;
    // Densities at both ends, not their ratio: from a great height that is larger than any number. No ground lies far below the lowest.
    let here = exp(-start);
    let there = exp(-max(start + rise, -2.0));
    return distance_m * select((here - there) / rise, here * (1.0 - 0.5 * rise), abs(rise) < 1e-3);
}

// What is left of `colour` after so many metres, and the air's own light added. Blue is scattered soonest.
fn through_air(colour: vec3<f32>, direction: vec3<f32>, distance_m: f32) -> vec3<f32> {
    let left = exp(-air_m(direction, distance_m) * frame.horizon.w * vec3(0.75, 1.0, 1.4));
    return mix(air(direction), colour, left);
}
