//! Logarithmic tables that every machine computes bit for bit alike.
//!
//! `2^(1/steps)` comes from repeated square roots and the powers from repeated multiplication, both exactly rounded by
//! IEEE 754, where `exp2` may differ in the last bit from one C library to another. Cost: a lookup to decode, a lookup and
//! at most three comparisons to encode.

/// Powers `2^(i / steps)` for `i` in 0..=255.
#[derive(Debug, Clone)]
pub struct OctaveTable {
    steps: u32,
    powers: [f64; 256],
}

impl OctaveTable {
    /// The table with `steps` entries an octave, a power of two from 1 to 64.
    pub fn new(steps: u32) -> Self {
        debug_assert!(steps.is_power_of_two() && steps <= 64);
        let mut root = 2.0f64;
        for _ in 0..steps.trailing_zeros() {
            root = root.sqrt();
        }
        let mut powers = [1.0; 256];
        for i in 1..powers.len() {
            // Whole octaves are set exactly, so that errors do not add up beyond one.
            powers[i] = if (i as u32).is_multiple_of(steps) {
                2.0 * powers[i - steps as usize]
            } else {
                powers[i - 1] * root
            };
        }
        Self { steps, powers }
    }

    /// Entries an octave.
    pub fn steps(&self) -> u32 {
        self.steps
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
        // The exponent and the leading bits of the mantissa give a lower bound, for log2(1 + m) >= m on 0..=1.
        let bits = value.to_bits();
        let octave = (bits >> 52) as i64 - 1023;
        let shift = 52 - self.steps.trailing_zeros();
        let within = (bits >> shift) & u64::from(self.steps - 1);
        let guess = octave * i64::from(self.steps) + within as i64;
        let mut index = usize::try_from(guess).ok().filter(|i| *i < 256)?;
        while self.powers[index] < value {
            index += 1;
            if index == 256 {
                return None;
            }
        }
        Some(index as u8)
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
