//! Errors of plain vertices in 4-byte records: 0, and steps of octaves up to the largest.

use crate::grid::octave::root_of_two;

/// Codes of errors, found by the leading bits of a number.
#[derive(Debug, Clone)]
pub(super) struct ErrorCodes {
    /// Metres of each code, then infinity twice, so that a search may look ahead.
    metres: Box<[f64]>,
    /// Bits of a double behind those that errors are found by.
    shift: u32,
    /// Leading bits of the least error.
    first: u64,
    /// For each part of an octave, the first code that stands for at least where it begins. A part holds one error at most.
    codes: Box<[u16]>,
}

impl ErrorCodes {
    /// So many codes, the first of which stands for 0 and the last for `top_m`, in `steps` an octave: a power of two from 1 to 64.
    pub(super) fn new(count: u16, steps: u32, top_m: f64) -> Self {
        let root = root_of_two(steps);
        // The powers of the codes from 1 on; whole octaves are exact, so that rounding does not add up beyond one.
        let mut powers = vec![1.0f64; usize::from(count) - 1];
        let octave = steps as usize;
        for i in 1..powers.len() {
            powers[i] = if i % octave == 0 { 2.0 * powers[i - octave] } else { powers[i - 1] * root };
        }
        let bottom_m = top_m / powers.last().copied().unwrap_or(1.0);
        let mut metres = vec![0.0];
        metres.extend(powers.iter().map(|power| bottom_m * power));
        metres.extend([f64::INFINITY; 2]);
        // Parts are a quarter of a step of an octave, or less.
        let shift = 52 - (steps.trailing_zeros() + 2);
        let first = metres[1].to_bits() >> shift;
        let parts = (powers.len() / octave + 2) << (52 - shift);
        let mut code = 1;
        let codes = (0..parts as u64).map(|part| {
            let begins = f64::from_bits((first + part) << shift);
            while code < count && metres[usize::from(code)] < begins {
                code += 1;
            }
            code
        });
        let codes = codes.collect();
        Self { metres: metres.into(), shift, first, codes }
    }

    /// Metres of a code.
    pub(super) fn metres(&self, code: u16) -> f64 {
        self.metres[usize::from(code)]
    }

    /// The first code that stands for at least `error_m`; `None` if none does.
    #[inline(always)]
    pub(super) fn at_least(&self, error_m: f64) -> Option<u16> {
        if error_m <= self.metres[1] {
            return Some(u16::from(error_m > 0.0));
        }
        // Infinity and what is not a number lie behind all parts.
        let part = (error_m.to_bits() >> self.shift).wrapping_sub(self.first) as usize;
        let code = *self.codes.get(part)?;
        let code = code + u16::from(self.metres[usize::from(code)] < error_m);
        (usize::from(code) + 2 < self.metres.len()).then_some(code)
    }
}
