//! Logarithmic tables that are bit for bit the same on every machine.
//!
//! `2^(1/steps)` comes from repeated square roots and the powers from repeated multiplication, both exactly rounded by
//! IEEE 754, where `exp2` may differ in the last bit from one C library to another. Cost: a lookup to decode, a lookup and
//! at most three comparisons to encode.

/// `2^(1 / steps)` for a power of two, by repeated square roots.
pub(crate) fn root_of_two(steps: u32) -> f64 {
    (0..steps.trailing_zeros()).fold(2.0, |root: f64, _| root.sqrt())
}

/// Powers `2^(i / steps)` for `i` in 0..=255.
#[derive(Debug, Clone)]
pub struct OctaveTable {
    steps: u32,
    /// 256 powers, then infinity three times, so that a search may look ahead.
    powers: [f64; 259],
    /// For each 64th of an octave, the first index whose power is not below it.
    firsts: [u16; 64],
}

impl OctaveTable {
    /// The table with `steps` entries an octave, a power of two from 1 to 64.
    pub fn new(steps: u32) -> Self {
        debug_assert!(steps.is_power_of_two() && steps <= 64);
        let root = root_of_two(steps);
        let mut powers = [1.0; 259];
        for i in 1..256 {
            // Whole octaves are set exactly, so that errors do not add up beyond one.
            powers[i] = if (i as u32).is_multiple_of(steps) {
                2.0 * powers[i - steps as usize]
            } else {
                powers[i - 1] * root
            };
        }
        powers[256..].fill(f64::INFINITY);
        let first = |i: usize| {
            let part = 1.0 + i as f64 / 64.0;
            powers.iter().position(|p| *p >= part).map_or(0, |index| index as u16)
        };
        Self { steps, powers, firsts: std::array::from_fn(first) }
    }

    /// `2^(index / steps)`.
    #[inline(always)]
    pub fn power(&self, index: u8) -> f64 {
        self.powers[usize::from(index)]
    }

    /// The smallest index whose power is at least `value`; `None` if even the last is smaller (or `value` is NaN).
    #[inline]
    pub fn index_at_least(&self, value: f64) -> Option<u8> {
        if value <= 1.0 {
            return Some(0);
        }
        if value.is_nan() {
            return None;
        }
        // Exponent and leading bits of the mantissa find a 64th of an octave, which holds at most two powers; comparing with three
        // and adding up the answers costs less than a branch that is guessed wrong.
        let bits = value.to_bits();
        let octave = (bits >> 52) as usize - 1023;
        let first = octave * self.steps as usize + usize::from(self.firsts[(bits >> 46) as usize & 63]);
        let ahead = self.powers.get(first..first + 3)?;
        let index = first + ahead.iter().map(|p| usize::from(*p < value)).sum::<usize>();
        u8::try_from(index).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_is_the_smallest_that_suffices() {
        for steps in [1, 2, 4, 8, 16, 32, 64] {
            let table = OctaveTable::new(steps);
            for i in 0..2000 {
                let value = 0.5 * 1.013f64.powi(i);
                let naive = (0..=255u8).find(|i| table.power(*i) >= value);
                assert_eq!(table.index_at_least(value), naive, "{steps} steps, {value}");
            }
            for i in 0..=255u8 {
                assert!((table.power(i).log2() * f64::from(steps) - f64::from(i)).abs() < 1e-9);
                assert_eq!(table.index_at_least(table.power(i)), Some(i));
            }
            assert_eq!(table.index_at_least(f64::NAN), None);
            assert_eq!(table.index_at_least(f64::INFINITY), None);
        }
    }
}
