//! Functions of numbers that give the same bits on every machine.
//!
//! Rust's own sine, logarithm and hypotenuse are the system's C library's, and the last bit of these differs from one library to another. What is written to a file, changes the ground or decides about a mesh
//! takes these instead: plain arithmetic, which IEEE 754 fixes to the bit, from crate `libm`. Addition, multiplication, division and the square root need no such care, nor do rounding and comparison.
//! `tests/determinism` sees to it that no code beside this takes the system's. They are called a few times a frame, and never for a vertex.

/// Sine and cosine of an angle in radians.
#[inline]
pub fn sin_cos(angle_rad: f64) -> (f64, f64) {
    libm::sincos(angle_rad)
}

/// Tangent of an angle in radians.
#[inline]
pub fn tan(angle_rad: f64) -> f64 {
    libm::tan(angle_rad)
}

/// Arc sine in radians, of a number from -1 to 1.
#[inline]
pub fn asin(sine: f64) -> f64 {
    libm::asin(sine)
}

/// The angle in radians of the point (`x`, `y`) about the origin, counter-clockwise from the x axis.
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// The length of (`a`, `b`), without overflow on the way.
#[inline]
pub fn hypot(a: f64, b: f64) -> f64 {
    libm::hypot(a, b)
}

/// e to a power.
#[inline]
pub fn exp(power: f64) -> f64 {
    libm::exp(power)
}

/// Natural logarithm.
#[inline]
pub fn ln(value: f64) -> f64 {
    libm::log(value)
}

/// Natural logarithm of one more than a value, exact near 0.
#[inline]
pub fn ln_1p(value: f64) -> f64 {
    libm::log1p(value)
}

/// Logarithm to base 2.
#[inline]
pub fn log2(value: f64) -> f64 {
    libm::log2(value)
}

/// A number to a power.
#[inline]
pub fn pow(base: f64, power: f64) -> f64 {
    libm::pow(base, power)
}

/// `2^exponent`, exactly, for exponents from -1022 to 1023; others are cut to these.
pub fn power_of_two(exponent: i32) -> f64 {
    f64::from_bits(((1023 + exponent.clamp(-1022, 1023)) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bits of some values, once and for all. Each is the true value rounded to the nearest, or its neighbour.
    #[test]
    fn values_have_the_bits_that_they_have() {
        let (sin, cos) = sin_cos(1.0);
        let is = [sin, cos, tan(0.5), asin(0.3), atan2(1.0, -3.0), hypot(30.0, 47.5), exp(-1.7), ln(10.0)];
        let more = [ln_1p(1e-3), log2(10.0), pow(0.37, 2.4), sin_cos(1e9).0];
        let shown: Vec<String> = is.iter().chain(&more).map(|v| format!("{:016x}", v.to_bits())).collect();
        assert_eq!(shown, BITS);
    }

    const BITS: [&str; 12] = [
        "3feaed548f090cee",
        "3fe14a280fb5068c",
        "3fe17b4f5bf3474a",
        "3fd380159e14f6ff",
        "40068f095fdf593c",
        "404c171b09bd3b2a",
        "3fc7622c78a98a07",
        "40026bb1bbb55516",
        "3f5060354f8c3ebf",
        "400a934f0979a371",
        "3fb78bdf65eb6922",
        "3fe1778cae83c69b",
    ];

    #[test]
    fn whole_powers_and_squares_are_exact() {
        for i in -300..300 {
            let power = if i < 0 { 1.0 / 2f64.powi(-i) } else { 2f64.powi(i) };
            assert_eq!((log2(power), power_of_two(i)), (f64::from(i), power));
        }
        assert_eq!([hypot(3.0, 4.0), hypot(5.0, 12.0), hypot(7.0, 0.0)], [5.0, 13.0, 7.0]);
        assert!(hypot(1e300, 1e300).is_finite());
    }
}
