//! Heights by formula.

/// Hills of several sizes, ridged, without any randomness but the formula's: metres for cells.
pub fn hills(x: f64, y: f64) -> f64 {
    let mut height = 0.0;
    let mut size = 420.0;
    let mut wave = 1.0 / 61.0;
    let (mut u, mut v) = (x + 13.7, y - 5.3);
    for i in 0..6 {
        let ridge = 1.0 - noise(u * wave, v * wave, i).abs() * 2.0;
        height += size * ridge.powf(1.4);
        size *= 0.47;
        wave *= 2.03;
        // Turned a little each time, so that no direction is favoured.
        (u, v) = (0.8 * u - 0.6 * v, 0.6 * u + 0.8 * v);
    }
    height + 300.0
}

/// Smooth noise from -0.5 to 0.5.
fn noise(x: f64, y: f64, seed: i64) -> f64 {
    let at = |i: f64, j: f64| {
        let mut h = (i as i64).wrapping_mul(374_761_393)
            ^ (j as i64).wrapping_mul(668_265_263)
            ^ seed.wrapping_mul(69_069);
        h = (h ^ (h >> 13)).wrapping_mul(1_274_126_177);
        ((h ^ (h >> 16)) & 0xffff) as f64 / 65_535.0 - 0.5
    };
    let (i, j) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    let (s, t) = (smooth(x - i), smooth(y - j));
    let low = at(i, j) * (1.0 - s) + at(i + 1.0, j) * s;
    let high = at(i, j + 1.0) * (1.0 - s) + at(i + 1.0, j + 1.0) * s;
    low * (1.0 - t) + high * t
}
