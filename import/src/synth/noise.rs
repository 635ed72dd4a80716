//! Seeded noise on integer lattices: a hash, gradient noise (Ken Perlin, 1985 and 2002) and sums of its octaves.
//!
//! Invariant: pure functions of seed and place. Cost: a gradient sample is four hashes, about 10 ns.

use terrasoar_layout::mix::mixed_32;
use terrasoar_layout::portable::sin_cos;

/// Mixes a lattice point into 32 well-spread bits.
#[inline]
pub(super) fn hash(seed: u32, x: u32, y: u32) -> u32 {
    mixed_32(seed ^ x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77).rotate_left(15))
}

/// A hash as a number in -1..1.
#[inline]
pub(super) fn signed_unit(hash: u32) -> f32 {
    (hash as i32 as f32) * (1.0 / 2_147_483_648.0)
}

/// Gradient noise, about -0.7..0.7, zero on the lattice points.
pub(super) fn gradient(seed: u32, x: f64, y: f64) -> f64 {
    let (cell_x, cell_y) = (x.floor(), y.floor());
    let (fx, fy) = (x - cell_x, y - cell_y);
    let (ix, iy) = (cell_x as i64 as u32, cell_y as i64 as u32);
    let corner = |dx: u32, dy: u32| {
        let turn = f64::from(hash(seed, ix.wrapping_add(dx), iy.wrapping_add(dy)))
            * (std::f64::consts::TAU / 4_294_967_296.0);
        let (sin, cos) = sin_cos(turn);
        cos * (fx - f64::from(dx)) + sin * (fy - f64::from(dy))
    };
    let (wx, wy) = (fade(fx), fade(fy));
    let top = corner(0, 0) + wx * (corner(1, 0) - corner(0, 0));
    let bottom = corner(0, 1) + wx * (corner(1, 1) - corner(0, 1));
    top + wy * (bottom - top)
}

fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// Sum of octaves of gradient noise, each of twice the frequency and `gain` times the amplitude; about -1..1.
pub(super) fn fractal(seed: u32, x: f64, y: f64, octaves: u32, gain: f64) -> f64 {
    let (mut sum, mut amplitude, mut scale) = (0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += amplitude * gradient(seed.wrapping_add(octave.wrapping_mul(0x9E37)), x * scale, y * scale);
        amplitude *= gain;
        scale *= 2.0;
    }
    sum
}

/// Ridged multifractal (F. Kenton Musgrave, in "Texturing and Modeling", 1994): sharp crests, smooth
/// valleys; a crest makes the octaves on it stronger. About 0..1.
pub(super) fn ridged(seed: u32, x: f64, y: f64, octaves: u32, gain: f64) -> f64 {
    let (mut sum, mut amplitude, mut scale, mut weight, mut total) = (0.0, 1.0, 1.0, 1.0, 0.0);
    for octave in 0..octaves {
        let signal = 1.0
            - (1.6 * gradient(seed.wrapping_add(octave.wrapping_mul(0x85EB)), x * scale, y * scale)).abs();
        let signal = signal * signal;
        sum += amplitude * weight * signal;
        total += amplitude;
        weight = (1.4 * signal).clamp(0.0, 1.0);
        amplitude *= gain;
        scale *= 2.0;
    }
    sum / total
}

/// 0 below `from`, 1 above `to`, smooth between; `from` may be the larger.
pub(super) fn smoothstep(from: f64, to: f64, value: f64) -> f64 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
