//! Radii of fine records: what they have above that of flat ground, as a share of it, in numbers of three bits behind the leading one (FORMAT.md, section 3.4).
//!
//! Where ground is gentle a radius is hardly larger than flat ground's. Steps of the whole radius would round that up as coarsely as on a cliff, and so would all that lies above.

use crate::portable::power_of_two;

/// Plain codes there are.
const COUNT: u8 = 63;
/// Codes an octave.
const STEPS: u8 = 8;

/// Factors on the radius of flat ground, by code.
#[derive(Debug, Clone)]
pub(super) struct ExcessCodes {
    /// 2 to the power of the first octave, turned over.
    per_first: f64,
    /// Those of all codes, then infinity.
    factors: [f64; COUNT as usize + 1],
}

impl ExcessCodes {
    /// Steps of an eighth of 2^`first_octave` up to there, and of eighths of octaves from there on. All are exact in double precision.
    pub(super) fn new(first_octave: i32) -> Self {
        let first = power_of_two(first_octave);
        let mut factors = [f64::INFINITY; COUNT as usize + 1];
        for code in 0..COUNT {
            let (octave, part) = (code / STEPS, f64::from(code % STEPS) / f64::from(STEPS));
            let share = match octave {
                0 => part,
                _ => (1.0 + part) * f64::from(1u32 << (octave - 1)),
            };
            factors[usize::from(code)] = 1.0 + first * share;
        }
        Self { per_first: 1.0 / first, factors }
    }

    /// The factor of a code.
    pub(super) fn factor(&self, code: u8) -> f64 {
        self.factors[usize::from(code.min(COUNT))]
    }

    /// The first code whose factor `reaches`, from what a factor is at least, less a little; `None` if none does.
    #[inline(always)]
    pub(super) fn first_at_least(&self, factor: f64, reaches: impl Fn(f64) -> bool) -> Option<u8> {
        let share = (factor - 1.0) * self.per_first;
        let mut code = if share < 1.0 {
            (share.max(0.0) * f64::from(STEPS)) as u64
        } else {
            // Exponent and three bits behind the leading one. What is no number lies behind all codes.
            (share.to_bits() >> 49).saturating_sub(1022 * u64::from(STEPS))
        };
        loop {
            let factor =
                *self.factors.get(usize::try_from(code).ok()?).filter(|factor| factor.is_finite())?;
            if reaches(factor) {
                return u8::try_from(code).ok();
            }
            code += 1;
        }
    }
}
