//! What follows from heights alone: error and radius codes of the two finest levels, and what steep ground makes of a radius (FORMAT.md, section 9.6).
//!
//! All of it is a function of whole numbers, made of the same products and roots that compact records are decoded with: the same on every machine. Cost: 256 KiB a file.

use crate::grid::Grid;
use crate::grid::octave::OctaveTable;
use crate::grid::record::{Compact, RadiusCodes, RecordCodec, RecordScale, VertexClass};

/// Factor on errors, and on radii, that a build applies before it rounds up.
const ERROR_MARGIN: f64 = 1.0 + 1e-9;
const RADIUS_MARGIN: f64 = 1.0 + 1.0 / (1 << 19) as f64;
/// Largest plain error code and radius code.
pub(crate) const TOP_ERROR: u8 = 247;
const TOP_RADIUS: u8 = 254;
/// Steps an octave of differences in heights that tell slopes apart.
const SLOPE_STEPS: u32 = 16;

/// Codes that follow from heights, of one file.
#[derive(Debug)]
pub(crate) struct Rules {
    /// Error code by |2v - b - d|.
    step: Box<[u8; 1 << 17]>,
    /// Radius code at level 1 by the difference to a child beside, and to one north or south.
    radius: [Box<[u8; 1 << 16]>; 2],
    /// Radius code of a slope by octave and steps of the difference across it.
    slope: Vec<[u8; 256]>,
}

impl Rules {
    pub(crate) fn new(grid: &Grid, scale: &RecordScale) -> Self {
        let codec = Compact::new(grid, scale);
        let step_m = scale.height_step_m;
        let error = |apart: usize| {
            let error_m = apart as f64 * 0.5 * step_m * ERROR_MARGIN;
            let raw = codec.encode(0, 0.0, VertexClass::Plain, error_m, 0.0);
            raw.map_or(TOP_ERROR, |raw| raw.to_le_bytes()[2])
        };
        let radius = |spacing_m: f64| {
            filled(|apart| {
                let rise_m = apart as f64 * step_m;
                let radius_m = (spacing_m * spacing_m + rise_m * rise_m).sqrt() * RADIUS_MARGIN;
                let raw = codec.encode(1, 0.0, VertexClass::Plain, 0.0, radius_m);
                raw.map_or(TOP_RADIUS, |raw| raw.to_le_bytes()[3])
            })
        };
        // Fine records go the way of exact ones.
        let steps = match scale.radius_codes {
            RadiusCodes::Octaves(steps) => steps,
            RadiusCodes::Excess { .. } => 64,
        };
        let powers = OctaveTable::new(steps);
        let slope = |octave: u32| {
            std::array::from_fn(|i| {
                let (octaves, part) = (i as u32 / SLOPE_STEPS, i as u32 % SLOPE_STEPS);
                let apart =
                    f64::from(1u32 << octaves) * f64::from(SLOPE_STEPS + part) / f64::from(SLOPE_STEPS);
                let rise = apart * step_m / (2.0 * f64::from(1u32 << octave) * grid.spacing_m()[0]);
                powers.index_at_least((1.0 + rise * rise).sqrt()).unwrap_or(u8::MAX)
            })
        };
        Self {
            step: filled(error),
            radius: grid.spacing_m().map(radius),
            slope: (0..grid.k()).map(slope).collect(),
        }
    }

    /// Error codes of vertices alone, by how far twice their height is from the sum of the heights at their edge's ends.
    #[inline(always)]
    pub(crate) fn steps(&self) -> &[u8; 1 << 17] {
        &self.step
    }

    /// Radius codes that vertices of level 1 have for their largest differences to children beside them (0), or north and south (1).
    #[inline(always)]
    pub(crate) fn radii(&self, axis: usize) -> &[u8; 1 << 16] {
        &self.radius[axis]
    }

    /// Radius codes that slopes make at an octave.
    pub(crate) fn slopes(&self, octave: u32) -> &[u8; 256] {
        &self.slope[octave as usize]
    }
}

/// Place of a difference among those of [`Rules::slopes`].
#[inline(always)]
pub(crate) fn slope_place(apart: i32) -> usize {
    // Exponent and four bits behind the leading one; whole numbers this small are exact.
    let bits = (apart.clamp(1, 65_535) as f32).to_bits() >> 19;
    bits.wrapping_sub(127 * SLOPE_STEPS) as usize & 255
}

/// A rising function of 0.., asked some 20 times for each value it has.
pub(super) fn filled<T: Copy + Default + PartialEq, const COUNT: usize>(
    code: impl Fn(usize) -> T,
) -> Box<[T; COUNT]> {
    let mut table = Box::new([T::default(); COUNT]);
    let mut from = 0;
    while from < COUNT {
        let here = code(from);
        let (mut same, mut other) = (from, COUNT);
        while same + 1 < other {
            let middle = (same + other) / 2;
            if code(middle) == here { same = middle } else { other = middle }
        }
        table[from..=same].fill(here);
        from = same + 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_hold_what_is_asked_of_every_number() {
        let squares = |i: usize| ((i as f64).sqrt() / 2.0) as u8;
        assert_eq!(filled::<u8, 9000>(squares).to_vec(), (0..9000).map(squares).collect::<Vec<_>>());
        assert_eq!(slope_place(0), 0);
        for apart in 1..65_536u32 {
            let octaves = apart.ilog2();
            let part = (apart << 4 >> octaves) % SLOPE_STEPS;
            assert_eq!(slope_place(apart as i32), (octaves * SLOPE_STEPS + part) as usize);
        }
        assert_eq!(slope_place(65_535), 255);
        assert!((0..65_535).all(|apart| slope_place(apart) <= slope_place(apart + 1)));
    }
}
