//! sRGB and linear light: tables between bytes and 16-bit intensities (IEC 61966-2-1).
//!
//! A texel in linear light is red, green, blue multiplied by alpha, and alpha, each 0..=65535. The darkest step of sRGB is 20 of these
//! units, so the rounding of a level costs a fortieth of a step and never adds up. Integers, hence the same on every machine. Cost: a load a value.

use crate::portable::pow;
use std::sync::LazyLock;

/// A texel in linear light, colour multiplied by alpha.
pub(super) type Linear = [u16; 4];

/// The two tables.
pub(super) struct Tables {
    to_linear: [u16; 256],
    to_srgb: Box<[u8; 65536]>,
}

/// The tables, made when first used.
pub(super) static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

impl Tables {
    fn new() -> Self {
        let to_linear = std::array::from_fn(|byte| (65535.0 * linear(byte as f64 / 255.0)).round() as u16);
        let mut to_srgb = Box::new([0; 65536]);
        for (value, byte) in to_srgb.iter_mut().enumerate() {
            *byte = (255.0 * srgb(value as f64 / 65535.0)).round() as u8;
        }
        Self { to_linear, to_srgb }
    }

    /// An intensity of a byte of sRGB.
    #[inline(always)]
    pub(super) fn intensity(&self, byte: u8) -> u16 {
        self.to_linear[usize::from(byte)]
    }

    /// A texel as it comes from an image.
    #[inline(always)]
    pub(super) fn linear(&self, [r, g, b, a]: [u8; 4]) -> Linear {
        let alpha = u32::from(a) * 257;
        let times = |byte| scaled(u32::from(self.intensity(byte)), alpha, 65535);
        if a == 255 {
            return [self.intensity(r), self.intensity(g), self.intensity(b), 65535];
        }
        [times(r), times(g), times(b), alpha as u16]
    }

    /// A texel as it is stored.
    #[inline(always)]
    pub(super) fn srgb(&self, [r, g, b, a]: Linear) -> [u8; 4] {
        let byte = |value: u16| self.to_srgb[usize::from(value)];
        match a {
            65535 => [byte(r), byte(g), byte(b), 255],
            0 => [0; 4],
            _ => {
                let over = |value: u16| byte(scaled(u32::from(value), 65535, u32::from(a)));
                [over(r), over(g), over(b), ((u32::from(a) + 128) / 257) as u8]
            }
        }
    }
}

/// Mean of four texels: one of the next coarser level.
#[inline(always)]
pub(super) fn mean(four: [Linear; 4]) -> Linear {
    std::array::from_fn(|c| {
        let sum: u32 = four.iter().map(|texel| u32::from(texel[c])).sum();
        ((sum + 2) / 4) as u16
    })
}

/// value * factor / divisor, rounded, at most 65535.
#[inline(always)]
fn scaled(value: u32, factor: u32, divisor: u32) -> u16 {
    let product = (u64::from(value) * u64::from(factor) + u64::from(divisor) / 2) / u64::from(divisor);
    product.min(65535) as u16
}

/// Intensity 0..=1 of a value 0..=1 of sRGB.
pub(super) fn linear(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { pow((value + 0.055) / 1.055, 2.4) }
}

/// Value 0..=1 of sRGB of an intensity 0..=1.
pub(super) fn srgb(intensity: f64) -> f64 {
    if intensity <= 0.003_130_8 { intensity * 12.92 } else { 1.055 * pow(intensity, 1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back() {
        for byte in 0..=255 {
            let texel = [byte, 255 - byte, byte / 2, 255];
            assert_eq!(TABLES.srgb(TABLES.linear(texel)), texel);
            for alpha in [128, 200, 254] {
                let [r, .., a] = TABLES.srgb(TABLES.linear([byte, 0, 0, alpha]));
                assert!(r.abs_diff(byte) <= 1 && a == alpha, "{byte} {alpha}: {r} {a}");
            }
        }
    }
}
