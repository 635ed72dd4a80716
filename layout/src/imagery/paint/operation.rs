//! What paint does to a texel: operations, their bounds, and the function from an old colour to a new one.
//!
//! Colours are mixed in linear light with integers, and places need additions, products and square roots only. So equal paint gives equal texels on every machine. A texel's
//! place is that of its centre. Cost of a scorched texel: a square root, a division and ten hashes.

use super::super::linear::{Linear, TABLES};
use super::super::shape::ImageryShape;
use super::blocks::Rect;
use super::burn::Burn;
use super::burn::{Scorch, WHOLE};
use crate::error::LayoutError;
use crate::numbers::{checked, checked_centre, checked_fraction, checked_radius};

/// One change of the picture over the terrain. Positions are metres east and north of the south-west sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Paint {
    /// Burnt ground.
    Scorch(Scorch),
    /// One colour.
    Fill(Fill),
    /// The picture as it was before all paint. Whole blocks of 4 x 4 texels that the region touches go back to their own bytes, and so does all of the coarser
    /// levels over which nothing is painted any more.
    Restore(Region),
}

/// A region in one colour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fill {
    /// Where.
    pub region: Region,
    /// Red, green, blue of sRGB.
    pub colour: [u8; 3],
    /// How much of the old colour goes, 0 to 1.
    pub opacity: f64,
    /// Metres from the region's edge inwards over which it fades in; 0 for a hard edge.
    pub falloff_m: f64,
}

/// A part of the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Region {
    /// All within a radius.
    Disc {
        /// Its centre in metres.
        centre_m: [f64; 2],
        /// Radius in metres.
        radius_m: f64,
    },
    /// A rectangle.
    Rect {
        /// South-west corner in metres.
        from_m: [f64; 2],
        /// North-east corner in metres.
        to_m: [f64; 2],
    },
}

impl Paint {
    /// Checks that all numbers are usable.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] that names the one that is not.
    pub fn check(&self) -> Result<(), LayoutError> {
        match self {
            Self::Scorch(Scorch { centre_m, radius_m, direction_deg, strength }) => {
                checked_centre("scorch", *centre_m)?;
                checked_radius("scorch", *radius_m)?;
                let is_allowed = direction_deg.abs() <= 1e9;
                checked("scorch", "direction", *direction_deg, is_allowed, "degrees clockwise from north")?;
                checked_fraction("scorch", "strength", *strength)
            }
            Self::Fill(Fill { region, opacity, falloff_m, .. }) => {
                region.check("fill")?;
                checked_fraction("fill", "opacity", *opacity)?;
                let is_allowed = (0.0..=1e7).contains(falloff_m);
                checked("fill", "falloff", *falloff_m, is_allowed, "metres from 0 to 1e7")
            }
            Self::Restore(region) => region.check("restore"),
        }
    }

    /// Texels of level 0 that it may change, those whose centre lies in it; `None` if there are none in the picture.
    pub(super) fn texels(&self, shape: &ImageryShape) -> Option<Rect> {
        let (from_m, to_m) = match self {
            Self::Scorch(Scorch { centre_m, radius_m, .. }) => around(*centre_m, *radius_m),
            Self::Fill(Fill { region, .. }) | Self::Restore(region) => match region {
                Region::Disc { centre_m, radius_m } => around(*centre_m, *radius_m),
                Region::Rect { from_m, to_m } => (*from_m, *to_m),
            },
        };
        let texel = |m: f64, axis: usize| (m - shape.origin_m[axis]) / shape.texel_m[axis] - 0.5;
        let mut ends = [[0; 2]; 2];
        for axis in [0, 1] {
            let last = f64::from(shape.texels[axis] - 1);
            let [from, to] = [texel(from_m[axis], axis).ceil(), texel(to_m[axis], axis).floor()];
            if from > last || to < 0.0 || from > to {
                return None;
            }
            ends[0][axis] = from.max(0.0) as i32;
            ends[1][axis] = to.min(last) as i32;
        }
        Some(Rect { from: ends[0], to: ends[1] })
    }

    /// Makes it ready to be asked for many texels; `None` for what changes no colour of its own.
    pub(super) fn brush(&self) -> Option<Brush> {
        match self {
            Self::Scorch(scorch) => Some(Brush::Burn(Box::new(Burn::of(scorch)))),
            Self::Fill(fill) => {
                let [r, g, b] = fill.colour;
                Some(Brush::Fill(*fill, TABLES.linear([r, g, b, 255])))
            }
            Self::Restore(_) => None,
        }
    }

    /// The region to restore.
    pub(super) fn restored(&self) -> Option<&Region> {
        match self {
            Self::Restore(region) => Some(region),
            Self::Scorch(_) | Self::Fill(_) => None,
        }
    }
}

impl Region {
    fn check(&self, what: &str) -> Result<(), LayoutError> {
        match self {
            Self::Disc { centre_m, radius_m } => {
                checked_centre(what, *centre_m)?;
                checked_radius(what, *radius_m)
            }
            Self::Rect { from_m, to_m } => {
                checked_centre(what, *from_m)?;
                checked_centre(what, *to_m)?;
                let [east, north] = [to_m[0] - from_m[0], to_m[1] - from_m[1]];
                let allowed = "corners from south-west to north-east";
                checked(what, "width in metres", east, east > 0.0, allowed)?;
                checked(what, "height in metres", north, north > 0.0, allowed)
            }
        }
    }

    /// Metres from a place inside to the edge; below 0 outside.
    fn depth_m(&self, at_m: [f64; 2]) -> f64 {
        match self {
            Self::Disc { centre_m, radius_m } => {
                let [east, north] = [at_m[0] - centre_m[0], at_m[1] - centre_m[1]];
                radius_m - (east * east + north * north).sqrt()
            }
            Self::Rect { from_m, to_m } => {
                let inside = |axis: usize| (at_m[axis] - from_m[axis]).min(to_m[axis] - at_m[axis]);
                inside(0).min(inside(1))
            }
        }
    }

    /// Whether a place lies in it.
    pub(super) fn contains(&self, at_m: [f64; 2]) -> bool {
        self.depth_m(at_m) >= 0.0
    }
}

fn around(centre_m: [f64; 2], radius_m: f64) -> ([f64; 2], [f64; 2]) {
    (centre_m.map(|m| m - radius_m), centre_m.map(|m| m + radius_m))
}

/// A paint ready to be asked for texels.
#[derive(Debug)]
pub(super) enum Brush {
    Burn(Box<Burn>),
    Fill(Fill, Linear),
}

impl Brush {
    /// The new colour of a texel of level 0 whose centre lies at `at_m`.
    #[inline]
    pub(super) fn texel(&self, [x, y]: [i32; 2], at_m: [f64; 2], old: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Burn(burn) => {
                let taken = if old[3] == 0 { 0 } else { burn.taken(at_m, [x, y]) };
                if taken == 0 { old } else { mixed(old, [0, 0, 0, 65535], taken, true) }
            }
            Self::Fill(fill, colour) => {
                let depth_m = fill.region.depth_m(at_m);
                if depth_m < 0.0 {
                    return old;
                }
                let share = if fill.falloff_m > 0.0 { (depth_m / fill.falloff_m).min(1.0) } else { 1.0 };
                let weight = (fill.opacity * share * f64::from(WHOLE)).round() as u32;
                if weight == 0 { old } else { mixed(old, *colour, weight, false) }
            }
        }
    }
}

/// `new` over `old` with a weight of [`WHOLE`] parts, in linear light; alpha stays as it is if told.
#[inline(always)]
fn mixed(old: [u8; 4], new: Linear, weight: u32, keeps_alpha: bool) -> [u8; 4] {
    let linear = TABLES.linear(old);
    let mix = |old: u16, new: u16| {
        let sum = u64::from(old) * u64::from(WHOLE - weight) + u64::from(new) * u64::from(weight);
        ((sum + u64::from(WHOLE / 2)) >> 16) as u16
    };
    let mut texel: Linear = std::array::from_fn(|c| mix(linear[c], new[c]));
    if keeps_alpha {
        texel[3] = linear[3];
    }
    TABLES.srgb(texel)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(radius_m: f64) -> Region {
        Region::Disc { centre_m: [50.0, 40.0], radius_m }
    }

    #[test]
    fn numbers_that_cannot_be_used_are_named() {
        let scorch = Scorch { centre_m: [1.0; 2], radius_m: 5.0, direction_deg: 9.0, strength: 0.5 };
        let fill = Fill { region: disc(3.0), colour: [1; 3], opacity: 1.0, falloff_m: 0.0 };
        let rect = |from_m, to_m| Region::Rect { from_m, to_m };
        let nan = f64::NAN;
        let wrong = [
            (Paint::Scorch(Scorch { centre_m: [nan, 0.0], ..scorch }), "centre"),
            (Paint::Scorch(Scorch { radius_m: 0.0, ..scorch }), "radius"),
            (Paint::Scorch(Scorch { direction_deg: nan, ..scorch }), "direction"),
            (Paint::Scorch(Scorch { strength: 1.1, ..scorch }), "strength"),
            (Paint::Fill(Fill { region: disc(-1.0), ..fill }), "radius"),
            (Paint::Fill(Fill { opacity: nan, ..fill }), "opacity"),
            (Paint::Fill(Fill { falloff_m: -1.0, ..fill }), "falloff"),
            (Paint::Restore(rect([3.0, 0.0], [2.0, 1.0])), "width"),
            (Paint::Restore(rect([1.0, 5.0], [2.0, 5.0])), "height"),
        ];
        for (paint, field) in wrong {
            let said = paint.check().unwrap_err().to_string();
            assert!(said.contains(field), "{field}: {said}");
        }
        for paint in [Paint::Scorch(scorch), Paint::Fill(fill), Paint::Restore(disc(2.0))] {
            paint.check().unwrap();
        }
        let crater =
            crate::edit::Crater { centre_m: [7.0, 8.0], direction_deg: 30.0, radius_m: 10.0, depth_m: 2.0 };
        let Paint::Scorch(scorch) = Paint::scorch_of(&crater) else { panic!("no scorch") };
        assert_eq!((scorch.centre_m, scorch.radius_m, scorch.direction_deg), ([7.0, 8.0], 15.0, 30.0));
    }

    #[test]
    fn colours_mix_in_linear_light() {
        let fill = |opacity, falloff_m| {
            Paint::Fill(Fill { region: disc(10.0), colour: [255; 3], opacity, falloff_m }).brush().unwrap()
        };
        let centre = [50.0, 40.0];
        // Half of the light of white is 188.
        assert_eq!(fill(0.5, 0.0).texel([0; 2], centre, [0, 0, 0, 255]), [188, 188, 188, 255]);
        assert_eq!(fill(0.5, 20.0).texel([0; 2], centre, [0, 0, 0, 255]), [137, 137, 137, 255]);
        assert_eq!(fill(0.5, 0.0).texel([0; 2], centre, [0; 4]), [255, 255, 255, 128]);
        assert_eq!(fill(1.0, 0.0).texel([0; 2], [61.0, 40.0], [9, 8, 7, 6]), [9, 8, 7, 6]);
    }
}
