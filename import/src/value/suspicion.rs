//! What looks wrong in the samples themselves: numbers that commonly mean "no data" and are not declared, heights beyond the Earth's, a range that feet would explain.
//!
//! Samples are looked at while they are read. Cost: the lowest and the highest of each window; a second look where one of them is such a number.

use std::sync::{Mutex, PoisonError};
use terrasoar_layout::dem::Warning;
use terrasoar_layout::remedy::Remedy;
use terrasoar_layout::words::number;

/// Numbers that commonly mean "no data". -10,000 is black where heights are packed into colours as Mapbox has it.
const COMMON: [f64; 13] = [
    -10_000.0,
    -32768.0,
    -32767.0,
    -9999.0,
    -99999.0,
    -999_999.0,
    32767.0,
    65535.0,
    99999.0,
    999_999.0,
    -2_147_483_648.0,
    2_147_483_647.0,
    1e20,
];
/// Raw numbers between such a value and the others, at least.
const GAP: f64 = 5000.0;
/// Highest and lowest place on the Earth's solid surface in metres, with room to spare.
const EARTH_M: [f64; 2] = [-11_500.0, 9_000.0];
/// Everest in feet.
const EVEREST_FEET: f64 = 29_100.0;

#[derive(Debug, Clone, Copy)]
struct Seen {
    counts: [u64; COMMON.len()],
    low: f64,
    high: f64,
}

/// What was seen.
#[derive(Debug)]
pub(crate) struct Suspicion {
    seen: Mutex<Seen>,
}

impl Suspicion {
    pub(crate) fn new() -> Self {
        Self {
            seen: Mutex::new(Seen { counts: [0; COMMON.len()], low: f64::INFINITY, high: f64::NEG_INFINITY }),
        }
    }

    /// Looks at raw samples, voids NaN.
    pub(crate) fn look(&self, samples: &[f64]) {
        let extremes = |samples: &mut dyn Iterator<Item = f64>| {
            samples.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            })
        };
        let [mut low, mut high] = extremes(&mut samples.iter().copied());
        if low > high {
            return;
        }
        let mut counts = [0; COMMON.len()];
        if COMMON.contains(&low) || COMMON.contains(&high) {
            for (count, common) in counts.iter_mut().zip(COMMON) {
                *count = samples.iter().filter(|value| **value == common).count() as u64;
            }
            [low, high] = extremes(&mut samples.iter().copied().filter(|value| !COMMON.contains(value)));
        }
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.counts.iter_mut().zip(counts).for_each(|(all, more)| *all += more);
        seen.low = seen.low.min(low);
        seen.high = seen.high.max(high);
    }

    /// What looks wrong, where a raw number is `scale_m` metres and 0 lies at `offset_m`; `is_earth` where these are heights on the Earth.
    pub(crate) fn warnings(
        &self,
        scale_m: f64,
        offset_m: f64,
        is_earth: bool,
        unit_is_known: bool,
    ) -> Vec<Warning> {
        let seen = *self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let mut warnings = Vec::new();
        let mut range = [seen.low, seen.high];
        for (common, count) in COMMON.into_iter().zip(seen.counts).filter(|(_, count)| *count > 0) {
            let gap = if common < seen.low { seen.low - common } else { common - seen.high };
            let is_apart = seen.low <= seen.high && gap >= GAP.max(0.5 * (seen.high - seen.low));
            if is_apart {
                warnings.push(
                    Warning::new(format!(
                        "{count} {} {} and the others lie from {} to {}; it looks like a mark for \"no data\" that the file does not declare, and was taken as a height",
                        if count == 1 { "sample is" } else { "samples are" },
                        number(common),
                        number(seen.low),
                        number(seen.high)
                    ))
                    .mended_by(Remedy::Nodata, number(common)),
                );
            } else {
                range = [range[0].min(common), range[1].max(common)];
            }
        }
        if range[0] > range[1] {
            return warnings;
        }
        let metres = range.map(|raw| raw * scale_m + offset_m);
        let [low, high] = [metres[0].min(metres[1]), metres[0].max(metres[1])];
        if is_earth && (low < EARTH_M[0] || high > EARTH_M[1]) {
            let could_be_feet = !unit_is_known && high <= EVEREST_FEET && low >= EARTH_M[0] / 0.3048;
            let words = format!(
                "heights go from {} to {} m, beyond any on the Earth{}",
                number((low * 10.0).round() / 10.0),
                number((high * 10.0).round() / 10.0),
                if could_be_feet { "; feet would explain them" } else { "; check their unit and factor" }
            );
            warnings.push(match could_be_feet {
                true => Warning::new(words).mended_by(Remedy::HeightUnit, "ft"),
                false => Warning::new(words).mended_by(Remedy::HeightFactor, "S"),
            });
        }
        warnings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(samples: &[f64], scale_m: f64) -> Vec<Warning> {
        let suspicion = Suspicion::new();
        samples.chunks(3).for_each(|window| suspicion.look(window));
        suspicion.warnings(scale_m, 0.0, true, false)
    }

    #[test]
    fn marks_that_stand_apart_are_named_and_depths_are_not() {
        let marked = of(&[100.0, -32768.0, 430.0, f64::NAN, 200.0, -32768.0], 1.0);
        assert_eq!(marked.len(), 1);
        assert!(marked[0].words.starts_with("2 samples are -32768"), "{}", marked[0].words);
        assert_eq!(marked[0].mended_by, Some((Remedy::Nodata, "-32768".into())));
        assert!(of(&[-9999.0, -10_000.0, -9_500.0, 100.0], 1.0).is_empty());
        assert!(of(&[100.0, 200.0, 300.0], 1.0).is_empty());
        assert_eq!(of(&[-9999.0, 12.0, 80.0], 1.0).len(), 1);
        assert_eq!(of(&[-10_000.0, 12.0, 80.0], 1.0).len(), 1);
        assert!(of(&[-10_000.0, -9_800.0, -4_000.0], 1.0).is_empty(), "the floor of a trench");
        assert!(of(&[f64::NAN], 1.0).is_empty());
    }

    #[test]
    fn heights_beyond_the_earth_are_told() {
        let feet = of(&[100.0, 14_000.0], 1.0);
        assert_eq!(feet[0].mended_by, Some((Remedy::HeightUnit, "ft".into())));
        assert!(of(&[100.0, 14_000.0], 0.1).is_empty());
        assert_eq!(of(&[100.0, 140_000.0], 1.0)[0].mended_by.as_ref().unwrap().0, Remedy::HeightFactor);
        assert_eq!(of(&[-20_000.0, 1.0], 1.0).len(), 1);
    }
}
