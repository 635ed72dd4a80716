//! How burnt the ground is at a place: rays of ejecta and lumps, from hashes.
//!
//! With u the distance from the centre in radii, a ray of reach q (up to 1, longer ahead than behind) is burnt wholly up to 0.3 q, not at all from q on, and smoothly
//! between. Lumps move that edge, grain spares single texels in part. Rays turn with the direction. Hashes begin
//! with the scorch's centre, so scorches at different places look different, and the same scorch always looks the same.

use crate::mix::mixed_32;
use crate::portable;

/// Rays of ejecta all around.
const RAYS: u32 = 28;
/// Lumps along a radius.
const LUMPS: f64 = 5.0;
/// Share of a ray's reach that is burnt wholly.
const CORE: f64 = 0.3;
/// Light that is left where all is burnt.
const LEFT: f64 = 0.06;
/// How much of a texel's burn the grain takes back at most.
const GRAIN: f64 = 0.2;

/// A scorch with everything worked out that does not depend on the texel.
#[derive(Debug)]
pub(super) struct Burn {
    centre_m: [f64; 2],
    radius_m: f64,
    /// East and north, of length 1.
    ahead: [f64; 2],
    most: f64,
    seed: u32,
    /// Reach of each ray before its direction counts, 0 to 1.
    rays: [f64; RAYS as usize],
}

impl Burn {
    pub(super) fn of(scorch: &Scorch) -> Self {
        let (east, north) = portable::sin_cos(scorch.direction_deg.to_radians());
        let ahead = [east, north].map(|v| (v * 65536.0).round() / 65536.0);
        let millimetres = scorch.centre_m.map(|m| (m * 1000.0).round() as i64 as u32);
        let seed = mixed_32(mixed_32(millimetres[0]) ^ millimetres[1]);
        Self {
            centre_m: scorch.centre_m,
            radius_m: scorch.radius_m,
            ahead,
            most: scorch.strength * (1.0 - LEFT),
            seed,
            rays: std::array::from_fn(|ray| part(mixed_32(seed ^ ray as u32))),
        }
    }

    /// How much of the light is taken at a place, in parts of [`WHOLE`].
    #[inline]
    pub(super) fn taken(&self, at_m: [f64; 2], [x, y]: [i32; 2]) -> u32 {
        let [east, north] = [at_m[0] - self.centre_m[0], at_m[1] - self.centre_m[1]];
        let u = (east * east + north * north).sqrt() / self.radius_m;
        if u >= 1.0 {
            return 0;
        }
        let [ahead, left] = self.ahead;
        let [along, across] = [east * ahead + north * left, north * ahead - east * left];
        let sum = along.abs() + across.abs();
        let cosine = if sum > 0.0 { along / (u * self.radius_m) } else { 0.0 };
        let reach = 0.6 + self.ray(along, across, sum) * (0.28 + 0.12 * cosine);
        let lump = self.lump([east, north].map(|m| m / self.radius_m * LUMPS));
        let s = (u / reach * (0.8 + 0.4 * lump)).max(u);
        let t = ((1.0 - s) / (1.0 - CORE)).clamp(0.0, 1.0);
        let grain = part(mixed_32(self.seed ^ mixed_32(x as u32) ^ (y as u32).wrapping_mul(0x9e37_79b1)));
        let burnt = self.most * t * t * (3.0 - 2.0 * t) * (1.0 - GRAIN * grain);
        (burnt * f64::from(WHOLE)) as u32
    }

    /// Between the two rays next to a direction. The angle is that of a square around the centre instead of a circle, which takes no arc tangent.
    #[inline]
    fn ray(&self, along: f64, across: f64, sum: f64) -> f64 {
        if sum == 0.0 {
            return 0.0;
        }
        let quarter = across.abs() / sum;
        let half = if along >= 0.0 { quarter } else { 2.0 - quarter };
        let turn = if across >= 0.0 { half } else { 4.0 - half };
        let at = turn * (f64::from(RAYS) / 4.0);
        let (i, t) = (at as usize, at.fract());
        let [a, b] = [i, i + 1].map(|ray| self.rays[ray % RAYS as usize]);
        a + (b - a) * t
    }

    /// Noise between the points of a lattice, 0 to 1.
    #[inline]
    fn lump(&self, at: [f64; 2]) -> f64 {
        let [x, y] = at.map(|v| v.floor() as i32 as u32);
        let [s, t] = at.map(|v| {
            let t = v - v.floor();
            t * t * (3.0 - 2.0 * t)
        });
        let corner = |x: u32, y: u32| part(mixed_32(self.seed ^ mixed_32(x) ^ y.wrapping_mul(0x85eb_ca77)));
        let row = |y: u32| {
            let [a, b] = [corner(x, y), corner(x.wrapping_add(1), y)];
            a + (b - a) * s
        };
        let [south, north] = [row(y), row(y.wrapping_add(1))];
        south + (north - south) * t
    }
}

#[inline(always)]
fn part(hash: u32) -> f64 {
    f64::from(hash >> 8) * (1.0 / f64::from(1 << 24))
}

/// Ground burnt by an explosion: darkest in the middle, with rays of ejecta, the longest ahead, and a soft edge. What is transparent stays so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scorch {
    /// Its centre in metres.
    pub centre_m: [f64; 2],
    /// Radius in metres. No ray reaches farther.
    pub radius_m: f64,
    /// Where the ejecta fly, degrees clockwise from north.
    pub direction_deg: f64,
    /// How much of the light it takes in the middle, 0 to 1.
    pub strength: f64,
}

/// Weights are parts of this.
pub(super) const WHOLE: u32 = 1 << 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn burn(direction_deg: f64) -> Burn {
        Burn::of(&Scorch { centre_m: [300.0, 200.0], radius_m: 40.0, direction_deg, strength: 0.9 })
    }

    /// Mean burn of a ring of radius u, of the quarter around an azimuth in degrees.
    fn mean(burn: &Burn, u: f64, azimuth_deg: f64) -> f64 {
        let places = (-45..45).map(|i| {
            let (east, north) = (azimuth_deg + f64::from(i)).to_radians().sin_cos();
            f64::from(burn.taken([300.0 + 40.0 * u * east, 200.0 + 40.0 * u * north], [i, 7]))
        });
        places.sum::<f64>() / 90.0 / f64::from(WHOLE)
    }

    #[test]
    fn it_is_darkest_in_the_middle_and_ends_within_its_radius() {
        let burn = burn(30.0);
        assert!(f64::from(burn.taken([300.0, 200.0], [0; 2])) > 0.65 * f64::from(WHOLE));
        let rings = [0.05, 0.3, 0.5, 0.7, 0.85].map(|u| {
            [0.0, 90.0, 180.0, 270.0].map(|azimuth| mean(&burn, u, azimuth)).iter().sum::<f64>() / 4.0
        });
        assert!(rings.is_sorted_by(|a, b| a > b), "{rings:?}");
        assert_eq!(mean(&burn, 1.0, 0.0) + mean(&burn, 1.3, 90.0), 0.0);
    }

    #[test]
    fn ejecta_fly_ahead() {
        let mut further = 0;
        for direction in [0.0, 77.0, 145.0, 260.0] {
            let burn = burn(direction);
            further += i32::from(mean(&burn, 0.6, direction) > mean(&burn, 0.6, direction + 180.0));
        }
        assert!(further >= 3, "{further} of 4");
    }
}
