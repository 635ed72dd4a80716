// What the ground looks like: bare colour, light, lines, air.

@group(0) @binding(6) var ramp: texture_2d<f32>;

const PLAIN: u32 = 1u;
const SLOPE: u32 = 2u;
const LEVEL: u32 = 3u;
const SCREEN_ERROR: u32 = 4u;

struct Ground {
    // Metres from the eye, as drawn.
    from_eye_m: vec3<f32>,
    // Samples from the eye's cell.
    cells: vec2<f32>,
    // Height before exaggeration.
    height_m: f32,
    // How the height changes from pixel to pixel.
    height_step_m: f32,
    // Upward unit normal of the drawn triangle.
    facet: vec3<f32>,
    // Level and screen error over tolerance of the finest corner, for the views that show them.
    level: f32,
    demand: f32,
    // Nearness to an edge of the triangle, 1 on it.
    edge: f32,
}

fn ramp_at(t: f32) -> vec3<f32> {
    return textureLoad(ramp, vec2(i32(clamp(t, 0.0, 1.0) * 1023.0 + 0.5), 0), 0).rgb;
}

fn hue(t: f32) -> vec3<f32> {
    return 0.5 + 0.5 * cos(2.0 * PI * (t + vec3(0.0, 0.33, 0.67)));
}

fn bare_colour(g: Ground, normal: vec3<f32>) -> vec3<f32> {
    if SURFACE == PLAIN {
        return vec3(0.52, 0.51, 0.49);
    }
    if SURFACE == SLOPE {
        return ramp_at(acos(clamp(normal.z, -1.0, 1.0)) / (PI / 3.0));
    }
    if SURFACE == LEVEL {
        // Neighbouring levels are far apart on the circle of hues, by the golden ratio.
        return 0.16 + 0.6 * hue(g.level * 0.382);
    }
    if SURFACE == SCREEN_ERROR {
        return ramp_at(0.25 * g.demand);
    }
    let tint = ramp_at((g.height_m - frame.tint.x) * frame.tint.y);
    // Rock shows where nothing holds on; a share of the tint stays so that bands remain readable.
    let steep = smoothstep(frame.tint.z, frame.tint.z + 0.28, 1.0 - normal.z);
    return mix(tint, mix(frame.rock.rgb, tint, 0.25), steep * frame.tint.w);
}

// Light of sun and sky on a surface.
fn light(normal: vec3<f32>) -> vec3<f32> {
    let direct = max(dot(normal, frame.sun.xyz), 0.0) * frame.sun.w * clamp(frame.sun.z * 12.0 + 0.6, 0.0, 1.0);
    // The upper half of the sky lights more than the horizon, and the ground opposite sends a little back.
    let open = 0.5 + 0.5 * normal.z;
    let bounce = (1.0 - open) * 0.35 * vec3(1.0, 0.9, 0.75);
    return direct * frame.sun_colour.rgb + frame.ambient.rgb * (open * open + bounce);
}

fn lit(colour: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    return colour * mix(vec3(1.0), light(normal), frame.ambient.w);
}

// A photograph brings the light of its own hour. Lit like bare ground, a slope that it shows at a share r of level ground's light would be seen at
// r * r when the sun stands as it did. So light counts relative to level ground's, which a photograph shows as it is, and
// by its root: at r * sqrt(r) shadows are deepened by half of what they are, not doubled, and when the sun moves the form still follows it, at
// half the contrast of bare ground. Level ground is the photograph itself by day, and dims as the sun goes down.
fn lit_again(photo: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    let level = light(vec3(0.0, 0.0, 1.0));
    let relief = sqrt(light(normal) / max(level, vec3(1e-4)));
    return photo * mix(vec3(1.0), relief * min(level, vec3(1.0)), frame.ambient.w);
}

// 1 where the height changes from pixel to pixel by more than rounding, else 0: level ground at the height of a line is no line.
fn rises(height_m: f32, step_m: f32) -> f32 {
    let rounding_m = 1e-6 * abs(height_m - frame.height.x) + 1.2e-7 * abs(height_m) + 1e-9;
    return clamp(step_m / rounding_m - 1.0, 0.0, 1.0);
}

// Coverage of the nearest line among multiples of `interval`, fading where lines would run together. Where they fade does not depend on the width, but for lines thinner than
// `plain_px`: wide lines become narrower instead, so that two fifths of the room between two is theirs at most, and `plain_px` at least.
fn line(height_m: f32, step_m: f32, interval_m: f32, width_px: f32, plain_px: f32) -> f32 {
    let in_intervals = height_m / interval_m;
    let apart_px = interval_m / max(step_m, 1e-9);
    let away_px = abs(fract(in_intervals + 0.5) - 0.5) * apart_px;
    let least_px = min(width_px, plain_px);
    let drawn_px = clamp(0.4 * apart_px, least_px, width_px);
    let crowded = smoothstep(0.12, 0.45, step_m * least_px / interval_m);
    return clamp(0.5 * drawn_px + 0.5 - away_px, 0.0, 1.0) * (1.0 - crowded) * rises(height_m, step_m);
}

// What a material is told. The normal that light sees is of exaggerated ground, and a material's is not.
fn ground_point(g: Ground, normal: vec3<f32>, colour: vec3<f32>, photo: vec4<f32>) -> GroundPoint {
    let own = normalize(vec3(normal.xy, normal.z * max(frame.height.z, 1e-6)));
    let picture = vec4(photo.rgb / max(photo.a, 1e-6), photo.a);
    let east_north = g.from_eye_m.xy;
    return GroundPoint(
        frame.eye_m.zw + east_north,
        frame.eye_m.xy + east_north,
        g.height_m,
        degrees(atan2(length(own.xy), own.z)),
        own,
        length(g.from_eye_m),
        colour,
        picture,
    );
}

fn ground(g: Ground, at: vec2<f32>) -> vec4<f32> {
    let slopes = slopes_at(g.cells, g.from_eye_m);
    let drape = normalize(vec3(-slopes.xy * frame.height.z, 1.0));
    let normal = select(g.facet, drape, slopes.z > 0.5);
    var colour = bare_colour(g, normal);
    var photo = image_at(g.from_eye_m, normal) * frame.image_share.x;
    if MATERIAL {
        let own = material(ground_point(g, normal, colour, photo));
        let share = clamp(own.a, 0.0, 1.0) * frame.material.x;
        colour = mix(colour, max(own.rgb, vec3(0.0)), share);
        photo = photo * (1.0 - share);
    }
    if CONTOURS {
        let plain = line(g.height_m, g.height_step_m, frame.contour.x, frame.contour.z, 1.0);
        let index = line(g.height_m, g.height_step_m, frame.contour.x * frame.contour.y, 2.0 * frame.contour.z, 2.0);
        let opacity = max(0.7 * plain, index) * frame.contour.w;
        colour = mix(colour, frame.contour_colour.rgb, opacity);
        photo = vec4(mix(photo.rgb, frame.contour_colour.rgb * photo.a, opacity), photo.a);
    }
    colour = lit(colour, normal);
    if IMAGE {
        colour = colour * (1.0 - photo.a) + lit_again(photo.rgb, normal);
    }
    colour = mix(colour, frame.wire_colour.rgb, g.edge * frame.wire.y);
    let distance_m = length(g.from_eye_m);
    return to_target(through_air(colour, g.from_eye_m / max(distance_m, 1e-6), distance_m), at);
}
