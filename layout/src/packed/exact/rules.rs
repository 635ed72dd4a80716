//! What follows from heights: errors and radii of the two finest levels, as a build makes them, and what others are expected to be.

use super::form::{Form, TOP_FINE_ERROR};
use crate::grid::Grid;
use crate::grid::record::{Compact, RecordCodec, RecordScale, f32_at_least};
use crate::packed::rules::filled;

/// Factors on errors and on radii that a build applies before it rounds up.
const ERROR_MARGIN: f64 = 1.0 + 1e-9;
const RADIUS_MARGIN: f64 = 1.0 + 1.0 / (1 << 19) as f64;

/// Largest radius code of a plain fine record.
const TOP_FINE_RADIUS: u32 = 62;

/// Numbers of one file.
#[derive(Debug)]
pub(crate) struct Rules {
    form: Form,
    step_m: f64,
    base_m: f64,
    spacing_m: [f64; 2],
    flat_m: Vec<f64>,
    /// Of fine records.
    codec: Option<Box<Compact>>,
    fine: Option<Fine>,
}

/// Codes of fine records by differences of their heights, which are whole numbers of 16 bits. Cost: half a megabyte.
#[derive(Debug)]
struct Fine {
    /// Error code by |2v - b - d|.
    step: Box<[u16; 1 << 17]>,
    /// Radius codes of level 1 by the difference to a child beside, and to one north or south: those of the least and the largest rise that rounding may make of it.
    radius: [Box<[[u8; 2]; 1 << 16]>; 2],
}

/// What sums of heights of up to 2^17 steps and of the base may be off, of their largest.
const OFF: f64 = 1.0 / (1u64 << 48) as f64;

impl Rules {
    pub(crate) fn new(form: Form, grid: &Grid, scale: &RecordScale) -> Self {
        let plain = Self {
            form,
            step_m: scale.height_step_m,
            base_m: scale.height_base_m,
            spacing_m: grid.spacing_m(),
            flat_m: (0..grid.levels()).map(|level| grid.flat_radius_m(level)).collect(),
            codec: (form == Form::Fine).then(|| Compact::new(grid, scale).into()),
            fine: None,
        };
        let fine = (form == Form::Fine).then(|| Fine {
            step: filled(|apart| plain.step_of(0.5 * apart as f64) as u16),
            radius: grid.spacing_m().map(|spacing_m| {
                filled(|apart| {
                    let rise_m = apart as f64 * plain.step_m;
                    let off_m = OFF * (plain.base_m.abs() + f64::from(1u32 << 17) * plain.step_m);
                    [(rise_m - off_m).max(0.0), rise_m + off_m]
                        .map(|rise_m| plain.radius_at_least(1, plain.radius_m(spacing_m, rise_m)) as u8)
                })
            }),
        });
        Self { fine, ..plain }
    }

    pub(crate) fn form(&self) -> Form {
        self.form
    }

    /// The code of the smallest error that is at least `metres`.
    #[inline(always)]
    fn error_at_least(&self, metres: f64) -> u32 {
        match &self.codec {
            Some(codec) => {
                let raw = codec.encode_plain(0, 0.0, metres, 0.0);
                raw.map_or(TOP_FINE_ERROR, |raw| Compact::fine_codes(raw).0.into())
            }
            None => self.bits_at_least(metres),
        }
    }

    /// The code of the smallest radius of a level that is at least `metres`.
    #[inline(always)]
    fn radius_at_least(&self, level: usize, metres: f64) -> u32 {
        match &self.codec {
            Some(codec) => {
                let raw = codec.encode_plain(level as u32, 0.0, 0.0, metres);
                raw.map_or(TOP_FINE_RADIUS, |raw| Compact::fine_codes(raw).1.into())
            }
            None => self.bits_at_least(metres),
        }
    }

    /// The bits of the smallest error or radius of exact records that is at least `metres`.
    #[inline(always)]
    fn bits_at_least(&self, metres: f64) -> u32 {
        // What heights beyond all numbers lead to counts as 0.
        let bits = if metres.is_nan() { 0 } else { f32_at_least(metres).to_bits() & !(1 << 31) };
        match self.form {
            Form::Single => bits.div_ceil(0x1_0000),
            Form::Fine | Form::Double => bits,
        }
    }

    /// Metres of an exact record's code without its sign.
    #[inline(always)]
    fn metres(&self, code: u32) -> f64 {
        let code = code & !self.form.sign();
        f64::from(match self.form {
            Form::Single => f32::from_bits(code << 16),
            Form::Fine | Form::Double => f32::from_bits(code),
        })
    }

    /// The error code of a vertex alone: how far it is from the middle of its edge.
    #[inline(always)]
    pub(super) fn step(&self, v: f64, b: f64, d: f64) -> u32 {
        match &self.fine {
            // Whole numbers this small are exact.
            Some(fine) => fine.step[(2.0 * v - b - d).abs() as usize & ((1 << 17) - 1)].into(),
            None => self.step_of((v - 0.5 * (b + d)).abs()),
        }
    }

    /// The error code of so many steps.
    #[inline(always)]
    fn step_of(&self, apart: f64) -> u32 {
        self.error_at_least(apart * self.step_m * ERROR_MARGIN)
    }

    #[inline(always)]
    fn radius_m(&self, spacing_m: f64, rise_m: f64) -> f64 {
        (spacing_m * spacing_m + rise_m * rise_m).sqrt() * RADIUS_MARGIN
    }

    /// The radius code of a vertex of level 1, from its height and those of its children beside, and north and south.
    #[inline(always)]
    pub(super) fn radius(&self, v: f64, beside: [f64; 2], along: [f64; 2]) -> u32 {
        if let Some(fine) = &self.fine {
            let mut ends = [0; 2];
            for (codes, children) in fine.radius.iter().zip([beside, along]) {
                let farthest = (v - children[0]).abs().max((v - children[1]).abs());
                let of_axis = codes[farthest as usize & 0xffff];
                ends = [0, 1].map(|i| of_axis[i].max(ends[i]));
            }
            // Rounding, of which the base has a part, makes no difference but near a code's end.
            if ends[0] == ends[1] {
                return ends[0].into();
            }
        }
        self.exact_radius(v, beside, along)
    }

    #[inline(never)]
    fn exact_radius(&self, v: f64, beside: [f64; 2], along: [f64; 2]) -> u32 {
        let mut radius_m = 0.0f64;
        for (spacing_m, children) in self.spacing_m.into_iter().zip([beside, along]) {
            for child in children {
                let child_m = self.base_m + child * self.step_m - self.base_m;
                let rise_m = v * self.step_m - child_m;
                radius_m = radius_m.max(self.radius_m(spacing_m, rise_m));
            }
        }
        self.radius_at_least(1, radius_m)
    }

    /// The error code that a range of heights would have.
    #[inline(always)]
    pub(super) fn of_range(&self, range: f64) -> u32 {
        self.error_at_least(range * self.step_m)
    }

    /// How steep a range of heights is over the steps of an octave.
    #[inline(always)]
    pub(super) fn slope(&self, range: f64, octave: u32) -> f64 {
        range * self.step_m / (f64::from(1u32 << octave) * self.spacing_m[0])
    }

    /// The radius code that a slope makes of flat ground at a level.
    #[inline(always)]
    pub(super) fn slope_radius(&self, level: usize, slope: f64) -> u32 {
        let flat_m = self.flat_m.get(level).copied().unwrap_or(0.0);
        self.radius_at_least(level, flat_m * (1.0 + slope * slope).sqrt())
    }

    /// The radius code expected at a level: that of the parents' larger radius over flat ground's, which fine records have as their code; without parents, of the slope.
    #[inline(always)]
    pub(super) fn expected_radius(&self, level: usize, parents: Option<u32>, slope: f64) -> u32 {
        if let (Some(code), true) = (parents, self.form == Form::Fine) {
            return code;
        }
        let flat_m = self.flat_m.get(level).copied().unwrap_or(0.0);
        let radius_m = match (parents, self.flat_m.get(level + 1)) {
            (Some(code), Some(above_m)) => self.metres(code) * (flat_m / above_m),
            _ => flat_m * (1.0 + slope * slope).sqrt(),
        };
        if radius_m.is_finite() { self.radius_at_least(level, radius_m) } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::record::RadiusCodes;
    use crate::mix::Random;

    /// What is looked up is what is computed, whatever base and step are.
    #[test]
    fn codes_that_are_looked_up_are_those_that_are_computed() {
        let grid = Grid::new([1025, 900], [10.0, 12.5]).unwrap();
        for (height_base_m, height_step_m) in
            [(0.0, 1.0), (-431.7, 0.1), (1.0e7 / 3.0, 0.013), (8000.25, 1.0 / 3.0), (-1e12, 0.25)]
        {
            let scale = RecordScale {
                height_base_m,
                height_step_m,
                error_top_m: 3000.0,
                radius_codes: RadiusCodes::Excess { first_octave: -4 },
            };
            let rules = Rules::new(Form::Fine, &grid, &scale);
            let mut random = Random::new(height_base_m.to_bits() ^ 7);
            for i in 0..200_000u32 {
                let spread = 1u64 << (1 + i % 16);
                let base = random.below(65_536 - spread + 1);
                let mut any = || (base + random.below(spread)) as f64;
                let [v, a, b, c, d] = [any(), any(), any(), any(), any()];
                assert_eq!(rules.step(v, a, b), rules.step_of((v - 0.5 * (a + b)).abs()), "{v} {a} {b}");
                let found = rules.radius(v, [a, b], [c, d]);
                assert_eq!(found, rules.exact_radius(v, [a, b], [c, d]), "{v} {a} {b} {c} {d}");
            }
        }
    }
}
