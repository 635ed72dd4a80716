//! Colour ramps from low to high.
//!
//! Stops are sRGB; between them colours are interpolated in Oklab (B. Ottosson, *A perceptual color space for image processing*, 2020),
//! so that equal steps of height look like equal steps and mixtures do not go grey.

/// A colour ramp.
#[derive(Debug, PartialEq)]
pub struct Ramp {
    /// How it is called.
    pub name: &'static str,
    /// One line about it.
    pub about: &'static str,
    /// Positions from 0 to 1, ascending, and sRGB colours 0xRRGGBB.
    pub stops: &'static [(f32, u32)],
    /// Metres of height from end to end that the colours need to mean what they say, such as snow; 0 where they mean nothing but lower and higher.
    pub least_span_m: f32,
}

/// All ramps; the first is the default.
pub const RAMPS: &[Ramp] = &[
    Ramp {
        name: "alpine",
        about: "meadow, forest, heath, rock, snow",
        stops: &[
            (0.00, 0x6f8f5a),
            (0.16, 0x87a063),
            (0.34, 0xb2b37a),
            (0.52, 0xbfa981),
            (0.68, 0xa3907c),
            (0.82, 0xb3aaa3),
            (0.91, 0xe3e2e2),
            (1.00, 0xfafbfd),
        ],
        least_span_m: 1000.0,
    },
    Ramp {
        name: "atlas",
        about: "the greens, yellows and browns of a school atlas",
        stops: &[
            (0.00, 0x3f8a55),
            (0.15, 0x84b46b),
            (0.30, 0xcfd593),
            (0.45, 0xeedfa0),
            (0.60, 0xdcb676),
            (0.75, 0xb88453),
            (0.90, 0x8f5d3f),
            (1.00, 0xefe6e0),
        ],
        least_span_m: 1000.0,
    },
    Ramp {
        name: "desert",
        about: "sand to red rock",
        stops: &[(0.00, 0xe8d3a2), (0.25, 0xd9b27c), (0.50, 0xc28a5a), (0.75, 0x9a5b42), (1.00, 0x6f4038)],
        least_span_m: 0.0,
    },
    Ramp {
        name: "arctic",
        about: "tundra to ice",
        stops: &[(0.00, 0x5d6f6a), (0.25, 0x8b9c96), (0.50, 0xb9c7cb), (0.75, 0xdde8f0), (1.00, 0xffffff)],
        least_span_m: 1000.0,
    },
    Ramp {
        name: "mars",
        about: "dark dust to pale dust",
        stops: &[(0.00, 0x5b2f25), (0.30, 0x94502f), (0.60, 0xc07a4a), (0.85, 0xddaa7a), (1.00, 0xf0d6b5)],
        least_span_m: 0.0,
    },
    Ramp {
        name: "viridis",
        about: "even steps of lightness, safe for colour-blind eyes (S. van der Walt and N. Smith)",
        stops: &[
            (0.000, 0x440154),
            (0.125, 0x482878),
            (0.250, 0x3e4989),
            (0.375, 0x31688e),
            (0.500, 0x26828e),
            (0.625, 0x1f9e89),
            (0.750, 0x35b779),
            (0.875, 0x6ece58),
            (1.000, 0xfde725),
        ],
        least_span_m: 0.0,
    },
    Ramp {
        name: "heat",
        about: "pale to dark red: slopes",
        stops: &[(0.00, 0xf6f3e6), (0.25, 0xf5d78e), (0.50, 0xee8f4c), (0.75, 0xc23a3a), (1.00, 0x5a1240)],
        least_span_m: 0.0,
    },
    Ramp {
        name: "grey",
        about: "dark to light",
        stops: &[(0.0, 0x5a5a5a), (1.0, 0xf4f4f4)],
        least_span_m: 0.0,
    },
];

impl Ramp {
    /// Heights in metres of the two ends over ground from `low_m` to `high_m`: the ground's own, or more where it is flatter than the colours allow.
    pub fn range_m(&self, [low_m, high_m]: [f32; 2]) -> [f32; 2] {
        [low_m, high_m.max(low_m + self.least_span_m)]
    }

    /// The ramp of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        RAMPS.iter().find(|ramp| ramp.name == name)
    }

    /// Colour at a place from 0 to 1, linear light.
    pub(crate) fn linear_at(&self, t: f32) -> [f32; 3] {
        let after = self.stops.partition_point(|(at, _)| *at <= t);
        let colour = |i: usize| self.stops.get(i).map_or(0, |s| s.1);
        if after == 0 || after == self.stops.len() {
            return linear_of(colour(after.saturating_sub(1)));
        }
        let (low, high) = (self.stops[after - 1], self.stops[after]);
        let share = (t - low.0) / (high.0 - low.0).max(1e-9);
        let [a, b] = [low.1, high.1].map(|c| oklab_of(linear_of(c)));
        linear_of_oklab([0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * share))
    }

    /// Evenly spaced colours in linear light, opaque.
    pub(crate) fn linear(&self, count: usize) -> Vec<[f32; 4]> {
        let last = count.saturating_sub(1).max(1) as f32;
        let opaque = |[r, g, b]: [f32; 3]| [r, g, b, 1.0];
        (0..count).map(|i| opaque(self.linear_at(i as f32 / last))).collect()
    }

    /// Evenly spaced RGBA pixels in sRGB, as a legend shows them.
    pub fn pixels(&self, count: usize) -> Vec<[u8; 4]> {
        let last = count.saturating_sub(1).max(1) as f32;
        (0..count)
            .map(|i| {
                let [r, g, b] = self.linear_at(i as f32 / last).map(|c| (255.0 * encode(c) + 0.5) as u8);
                [r, g, b, 255]
            })
            .collect()
    }
}

/// Linear light of an sRGB colour 0xRRGGBB.
pub fn linear_of(srgb: u32) -> [f32; 3] {
    [16, 8, 0].map(|shift| {
        let c = ((srgb >> shift) & 255) as f32 / 255.0;
        if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
}

pub(crate) fn encode(linear: f32) -> f32 {
    let c = linear.clamp(0.0, 1.0);
    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}

fn times(m: [[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn oklab_of(linear: [f32; 3]) -> [f32; 3] {
    let cones = times(
        [
            [0.412_221_46, 0.536_332_55, 0.051_445_995],
            [0.211_903_5, 0.680_699_5, 0.107_396_96],
            [0.088_302_46, 0.281_718_85, 0.629_978_7],
        ],
        linear,
    );
    times(
        [
            [0.210_454_26, 0.793_617_8, -0.004_072_047],
            [1.977_998_5, -2.428_592_2, 0.450_593_7],
            [0.025_904_037, 0.782_771_77, -0.808_675_77],
        ],
        cones.map(f32::cbrt),
    )
}

fn linear_of_oklab(lab: [f32; 3]) -> [f32; 3] {
    let roots = times(
        [
            [1.0, 0.396_337_78, 0.215_803_76],
            [1.0, -0.105_561_346, -0.063_854_17],
            [1.0, -0.089_484_18, -1.291_485_5],
        ],
        lab,
    );
    times(
        [
            [4.076_741_7, -3.307_711_6, 0.230_969_94],
            [-1.268_438, 2.609_757_4, -0.341_319_4],
            [-0.004_196_086_3, -0.703_418_6, 1.707_614_7],
        ],
        roots.map(|c| c * c * c),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_are_ordered_and_complete() {
        for ramp in RAMPS {
            assert!(ramp.stops.is_sorted_by(|a, b| a.0 < b.0), "{}", ramp.name);
            assert_eq!((ramp.stops[0].0, ramp.stops[ramp.stops.len() - 1].0), (0.0, 1.0), "{}", ramp.name);
            assert_eq!(Ramp::named(ramp.name), Some(ramp));
        }
        assert_eq!(Ramp::named("none such"), None);
    }

    #[test]
    fn stops_keep_their_colours() {
        for ramp in RAMPS {
            for (at, colour) in ramp.stops {
                let got = ramp.linear_at(*at).map(|c| (255.0 * encode(c) + 0.5) as u32);
                let want = [16, 8, 0].map(|s| (colour >> s) & 255);
                for i in 0..3 {
                    assert!(got[i].abs_diff(want[i]) <= 1, "{} at {at}: {got:?} {want:?}", ramp.name);
                }
            }
        }
    }
}
