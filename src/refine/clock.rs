//! Live ranges: how long a status holds, counted on the total length of the eye's path.
//!
//! Based on: X. Bao, R. Pajarola, M. Shafae, "SMART", section 4 (eq. 11 and 12), with a correction. The paper rounds each frame's movement down,
//! so slow flight never advances its clock and statuses become wrong. Here the total is kept in fixed point and rounded up.
//!
//! Claim: if a status is certain while the eye has moved less than `d - guard` metres, then `f < L` with `L = f0 + floor((d - guard) / q)`
//! implies it still holds. Proof: a rounding rho of the total has rho(x) - rho(y) > x - y - 1, so the path since is shorter than
//! floor((d - guard) / q) ticks.

use terrasoar_layout::portable;

/// Fixed-point units a metre: 2^20.
const UNITS_PER_M: f64 = (1u64 << 20) as f64;
/// Expiries are counted in so many bits; the rest of a word are status bits.
pub(super) const EXPIRY_BITS: u32 = 28;
/// Bits of a word that hold its expiry.
pub(super) const EXPIRY_MASK: u32 = (1 << EXPIRY_BITS) - 1;
/// Most ticks that one live range may last, and the tick at which words are swept.
const HORIZON: u64 = 1 << (EXPIRY_BITS - 1);

/// The clock of one engine.
#[derive(Debug, Clone)]
pub(super) struct PathClock {
    /// Length of the path so far, in units, rounded up.
    total: u64,
    /// Units a tick: 2^shift.
    shift: u32,
    /// Tick at the last sweep.
    base: u64,
    last_eye_m: Option<[f64; 3]>,
}

impl PathClock {
    /// A clock that ticks about every `tick_m` metres.
    pub(super) fn new(tick_m: f64) -> Self {
        let shift = portable::log2(tick_m * UNITS_PER_M).floor().clamp(0.0, 40.0) as u32;
        Self { total: 0, shift, base: 0, last_eye_m: None }
    }

    /// The eye is at `eye_m` now.
    pub(super) fn move_to(&mut self, eye_m: [f64; 3]) {
        if let Some(last) = self.last_eye_m
            && last != eye_m
        {
            let [x, y, z] = [0, 1, 2].map(|i| eye_m[i] - last[i]);
            // One unit more covers the rounding of the length itself, up to four million kilometres.
            let units = ((x * x + y * y + z * z).sqrt() * UNITS_PER_M).ceil();
            self.total = self.total.saturating_add((units as u64).saturating_add(1));
        }
        self.last_eye_m = Some(eye_m);
    }

    /// The current tick, counted from the last sweep. May exceed the horizon until [`PathClock::sweep`] is called.
    pub(super) fn now(&self) -> u64 {
        (self.total >> self.shift) - self.base
    }

    /// Whether words must be swept before they are compared.
    pub(super) fn needs_sweep(&self) -> bool {
        self.now() >= HORIZON
    }

    /// Moves all expiries back by the current tick and starts counting again.
    pub(super) fn sweep(&mut self, words: &mut [u32]) {
        let now = self.now();
        for word in words {
            let expiry = u64::from(*word & EXPIRY_MASK).saturating_sub(now);
            *word = (*word & !EXPIRY_MASK) | expiry as u32;
        }
        self.base += now;
    }

    /// Expiry of a status that holds while the eye moves less than `safe_m` metres; not positive means it has expired already.
    #[inline(always)]
    pub(super) fn expiry(&self, safe_m: f64) -> u32 {
        let ticks = safe_m * (UNITS_PER_M / (1u64 << self.shift) as f64);
        // A negative, infinite or NaN distance saturates as it should: to 0, to the horizon, to 0.
        let ticks = (ticks as u64).min(HORIZON);
        (self.now() + ticks) as u32
    }

    /// Sets the path's length, for tests of the sweep.
    #[cfg(test)]
    pub(super) fn set_total(&mut self, ticks: u64) {
        self.total = ticks << self.shift;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// However small the steps, a live word means that the path since is shorter than was safe.
        #[test]
        fn alive_implies_safe(steps in prop::collection::vec(0.0f64..0.3, 1..200), safe_m in 0.0f64..20.0, tick_m in 0.01f64..4.0) {
            let mut clock = PathClock::new(tick_m);
            let mut x = 0.0;
            clock.move_to([0.0; 3]);
            let expiry = clock.expiry(safe_m);
            let mut path_m = 0.0;
            for (i, step) in steps.iter().enumerate() {
                let next = x + if i % 3 == 0 { -step } else { *step };
                clock.move_to([next, 0.0, 0.0]);
                path_m += (next - x).abs();
                x = next;
                if clock.now() < u64::from(expiry) {
                    prop_assert!(path_m < safe_m, "{path_m} {safe_m}");
                }
            }
        }
    }

    #[test]
    fn slow_flight_advances_the_clock() {
        let mut clock = PathClock::new(1.0);
        for i in 0..4096 {
            clock.move_to([f64::from(i) / 1024.0, 0.0, 0.0]);
        }
        assert!(clock.now() >= 3);
    }

    #[test]
    fn a_sweep_keeps_what_remains() {
        let mut clock = PathClock::new(1.0);
        clock.move_to([0.0; 3]);
        clock.set_total(HORIZON + 5);
        let mut words = [1 << 30 | (HORIZON as u32 + 100), 3];
        assert!(clock.needs_sweep());
        clock.sweep(&mut words);
        assert_eq!(words, [1 << 30 | 95, 0]);
        assert_eq!(clock.now(), 0);
        clock.move_to([1e12, 0.0, 0.0]);
        clock.sweep(&mut words);
        assert_eq!(words, [1 << 30, 0]);
    }
}
