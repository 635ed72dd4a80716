//! Finds the speed at which a flight has a wanted incoherence: the percentage of a frame's triangles that the
//! frame before did not have (Bao et al. 2004, section 5, which gives 0.61, 1.36 and 5.29 %).
//!
//! Incoherence grows about as a power of the speed, so the search is false position in the logarithms of both,
//! with the Illinois correction, and with halving where noise stalls it. **Every trial lies inside the bracket of those
//! before it.** So a measure that is not quite monotone costs more trials, and the result is still right. Cost: at most 24 trials
//! of 24 pairs of frames, and a check with other pairs; two more trials where an error has to state the range.

use super::generate::{FlightPlan, GenerateError, Ground, generate};
use super::{Flight, FlightFrame};
use terrasoar_layout::portable::{exp, ln, ln_1p};

/// Most trial speeds.
pub const MAX_TRIALS: usize = 24;
/// Most pairs of frames measured a trial.
pub(crate) const MAX_PAIRS: usize = 24;
/// Relative deviation from the wanted incoherence at which the search ends.
pub const TOLERANCE: f64 = 0.02;
/// Relative deviation up to which the best speed found still is an answer.
const ACCEPTED: f64 = 0.10;
/// Slowest and fastest speed tried, as parts of the terrain's longer extent a frame.
const SPEEDS: [f64; 2] = [1e-9, 0.25];
/// First speed tried, likewise: about 12 m a frame on 160 km.
const FIRST_SPEED: f64 = 7.5e-5;
/// Percentages below this count as this much, so that they have a logarithm.
const LEAST_PERCENT: f64 = 1e-9;

/// A speed tried and the mean incoherence measured at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Metres a frame.
    pub speed_m_per_frame: f64,
    /// Mean incoherence over the sampled pairs, in percent.
    pub percent: f64,
}

/// The flight found.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The speed and the incoherence measured at it; within 2 % of the wanted one where the measure allows, never
    /// off by more than 10 % of it.
    pub best: Trial,
    /// Mean incoherence of other pairs of the same flight, in percent: how far the sample speaks for the whole.
    pub checked_percent: f64,
    /// All speeds tried, in order.
    pub trials: Vec<Trial>,
    /// The flight at the speed found.
    pub flight: Flight,
}

/// Why there is no such speed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError<E: std::error::Error + 'static> {
    /// The wanted incoherence is none.
    #[error(
        "an incoherence of {wanted_percent} % cannot be asked for; give a percentage above 0 and up to 100"
    )]
    Wanted {
        /// The percentage given.
        wanted_percent: f64,
    },
    /// A flight with one frame has no pair to measure.
    #[error("a flight of {frames} frame has no incoherence; give it two frames or more")]
    TooShort {
        /// Its frames.
        frames: u64,
    },
    /// No speed tried reaches it.
    #[error(
        "no speed gives an incoherence of {wanted_percent} %: this flight reached {lowest_percent:.3} to {highest_percent:.3} % at {slowest_m:.4} to {fastest_m:.1} m a frame; ask for a percentage in between, or change the flight or the tolerance"
    )]
    Unreachable {
        /// The percentage wanted.
        wanted_percent: f64,
        /// Lowest percentage found.
        lowest_percent: f64,
        /// Highest percentage found.
        highest_percent: f64,
        /// Slowest speed tried, in metres a frame.
        slowest_m: f64,
        /// Fastest speed tried, in metres a frame.
        fastest_m: f64,
    },
    /// The measure jumps over it.
    #[error(
        "no speed found gives an incoherence of {wanted_percent} %: it jumps from {below_percent:.3} to {above_percent:.3} % at about {speed_m:.4} m a frame; ask for one of these, or give the flight more frames"
    )]
    Jumps {
        /// The percentage wanted.
        wanted_percent: f64,
        /// Closest percentage below it.
        below_percent: f64,
        /// Closest percentage above it.
        above_percent: f64,
        /// Speed at which it jumps, in metres a frame.
        speed_m: f64,
    },
    /// The measure gave no percentage.
    #[error(
        "the incoherence measured at {speed_m} m a frame is {found} %, which is no percentage; this is a fault of the engine measured"
    )]
    Measured {
        /// The speed, in metres a frame.
        speed_m: f64,
        /// What was measured.
        found: f64,
    },
    /// The flight cannot be made.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// Measuring failed.
    #[error("cannot measure the incoherence at {speed_m} m a frame: {source}")]
    Measure {
        /// The speed, in metres a frame.
        speed_m: f64,
        /// Why.
        source: E,
    },
}

/// Finds the speed at which the flight of `plan`, whose own speed is ignored, has a mean incoherence of
/// `wanted_percent` (above 0, at most 100). `measure` gives the mean percentage over pairs of consecutive frames.
///
/// # Errors
/// [`SolveError`]; those of `measure` end the search.
pub fn solve<E: std::error::Error + 'static>(
    ground: &dyn Ground,
    plan: &FlightPlan,
    wanted_percent: f64,
    mut measure: impl FnMut(&[(FlightFrame, FlightFrame)]) -> Result<f64, E>,
) -> Result<Solution, SolveError<E>> {
    if !(wanted_percent > 0.0 && wanted_percent <= 100.0) {
        return Err(SolveError::Wanted { wanted_percent });
    }
    if plan.frames < 2 {
        return Err(SolveError::TooShort { frames: plan.frames });
    }
    let flight_at = |speed_m_per_frame| generate(ground, &FlightPlan { speed_m_per_frame, ..*plan });
    let mut measured = |speed_m: f64, pairs: &[(FlightFrame, FlightFrame)]| {
        let found = measure(pairs).map_err(|source| SolveError::Measure { speed_m, source })?;
        if found.is_finite() && found >= 0.0 {
            Ok(found)
        } else {
            Err(SolveError::Measured { speed_m, found })
        }
    };
    let [width, length] = ground.extent_m();
    let mut search = Search::new(width.max(length), wanted_percent);
    let mut trials: Vec<Trial> = Vec::new();
    while let Some(speed) = search.next_speed().filter(|_| trials.len() < MAX_TRIALS) {
        let percent = measured(speed, &sampled_pairs(&flight_at(speed)?.frames, 0.0))?;
        trials.push(Trial { speed_m_per_frame: speed, percent });
        search.learn(speed, percent);
    }
    let off = |t: &Trial| (t.percent / wanted_percent - 1.0).abs();
    let Some(best) = trials.iter().copied().min_by(|a, b| off(a).total_cmp(&off(b))) else {
        // The first speed is always tried.
        return Err(SolveError::Wanted { wanted_percent });
    };
    if off(&best) > ACCEPTED {
        // The range that an error states has to be the flight's, not that of the side searched.
        for speed in search.limits_m().into_iter().filter(|_| search.is_one_sided()) {
            let percent = measured(speed, &sampled_pairs(&flight_at(speed)?.frames, 0.0))?;
            trials.push(Trial { speed_m_per_frame: speed, percent });
        }
        return Err(search.failure(&trials, wanted_percent));
    }
    let flight = flight_at(best.speed_m_per_frame)?;
    let checked_percent = measured(best.speed_m_per_frame, &sampled_pairs(&flight.frames, 0.5))?;
    Ok(Solution { best, checked_percent, trials, flight })
}

/// At most [`MAX_PAIRS`] pairs of consecutive frames, evenly spread; `shift` moves all by a part of their distance.
fn sampled_pairs(frames: &[FlightFrame], shift: f64) -> Vec<(FlightFrame, FlightFrame)> {
    let pairs = frames.len().saturating_sub(1);
    let count = pairs.min(MAX_PAIRS);
    (0..count)
        .filter_map(|i| {
            let at = ((i as f64 + shift) * pairs as f64 / count as f64) as usize;
            Some((*frames.get(at)?, *frames.get(at + 1)?))
        })
        .collect()
}

/// One end of the bracket: logarithm of the speed, and of measured over wanted percentage.
#[derive(Debug, Clone, Copy)]
struct End {
    speed: f64,
    excess: f64,
}

/// The search over speeds, all in logarithms.
#[derive(Debug)]
struct Search {
    limits: [f64; 2],
    wanted: f64,
    low: Option<End>,
    high: Option<End>,
    next: Option<f64>,
    /// Which end the last trial replaced, and how often in a row.
    side: Option<(bool, u32)>,
}

impl Search {
    fn new(extent_m: f64, wanted_percent: f64) -> Self {
        let limits = SPEEDS.map(|part| ln(part * extent_m));
        Self {
            limits,
            wanted: ln(wanted_percent),
            low: None,
            high: None,
            next: Some(ln(FIRST_SPEED * extent_m)),
            side: None,
        }
    }

    /// The next speed to try in metres a frame; `None` when there is nothing left to learn.
    fn next_speed(&self) -> Option<f64> {
        self.next.map(exp)
    }

    /// Slowest and fastest speed that may be tried, in metres a frame.
    fn limits_m(&self) -> [f64; 2] {
        self.limits.map(exp)
    }

    /// Whether all speeds tried were on the same side of the wanted percentage.
    fn is_one_sided(&self) -> bool {
        self.low.is_none() || self.high.is_none()
    }

    fn learn(&mut self, speed_m: f64, percent: f64) {
        let end = End { speed: ln(speed_m), excess: ln(percent.max(LEAST_PERCENT)) - self.wanted };
        if end.excess.abs() <= ln_1p(TOLERANCE) {
            self.next = None;
            return;
        }
        let above = end.excess > 0.0;
        let repeated = match self.side {
            Some((side, times)) if side == above => times + 1,
            _ => 1,
        };
        self.side = Some((above, repeated));
        *(if above { &mut self.high } else { &mut self.low }) = Some(end);
        self.next = match (&mut self.low, &mut self.high) {
            (Some(low), Some(high)) => {
                // Illinois: an end that stays put loses weight.
                if repeated > 1 {
                    let stale = if above { &mut *low } else { &mut *high };
                    stale.excess *= 0.5;
                }
                let gap = high.speed - low.speed;
                let part = if repeated > 3 { 0.5 } else { -low.excess / (high.excess - low.excess) };
                (gap.abs() > 1e-6).then(|| low.speed + gap * part.clamp(0.02, 0.98))
            }
            _ => {
                // Not bracketed yet: go where a power law puts it and half as far again, doubling with each miss.
                let stride =
                    (1.5 * end.excess.abs()).clamp(0.3, 4.0) * f64::from(1u32 << (repeated - 1).min(4));
                let target = if above { end.speed - stride } else { end.speed + stride };
                let target = target.clamp(self.limits[0], self.limits[1]);
                ((target - end.speed).abs() > 1e-9).then_some(target)
            }
        };
    }

    fn failure<E: std::error::Error>(&self, trials: &[Trial], wanted_percent: f64) -> SolveError<E> {
        let fold =
            |f: fn(f64, f64) -> f64, of: fn(&Trial) -> f64, start| trials.iter().map(of).fold(start, f);
        let percent = |t: &Trial| t.percent;
        let speed = |t: &Trial| t.speed_m_per_frame;
        let closest = |above: bool| {
            let side = trials.iter().filter(|t| (t.percent > wanted_percent) == above);
            side.map(percent).min_by(|a, b| (a - wanted_percent).abs().total_cmp(&(b - wanted_percent).abs()))
        };
        match (closest(false), closest(true), self.low) {
            (Some(below_percent), Some(above_percent), Some(low)) => {
                SolveError::Jumps { wanted_percent, below_percent, above_percent, speed_m: exp(low.speed) }
            }
            _ => SolveError::Unreachable {
                wanted_percent,
                lowest_percent: fold(f64::min, percent, f64::INFINITY),
                highest_percent: fold(f64::max, percent, 0.0),
                slowest_m: fold(f64::min, speed, f64::INFINITY),
                fastest_m: fold(f64::max, speed, 0.0),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::generate::FlightKind;
    use super::super::generate::tests::puget;
    use super::*;
    use proptest::prelude::*;
    use std::convert::Infallible;

    fn speed_of(pairs: &[(FlightFrame, FlightFrame)]) -> f64 {
        let steps = pairs.iter().map(|(a, b)| (a.eye_m[0] - b.eye_m[0]).hypot(a.eye_m[1] - b.eye_m[1]));
        steps.sum::<f64>() / pairs.len() as f64
    }

    fn solved(
        kind: FlightKind,
        wanted: f64,
        measure: impl Fn(f64) -> f64,
    ) -> Result<Solution, SolveError<Infallible>> {
        let plan = FlightPlan::new(kind, 500, 1.0);
        solve(&puget(), &plan, wanted, |pairs| {
            assert!(!pairs.is_empty() && pairs.len() <= MAX_PAIRS);
            Ok(measure(speed_of(pairs)))
        })
    }

    #[test]
    fn a_power_law_takes_few_trials() {
        for wanted in [0.05, 0.61, 1.36, 5.29, 40.0] {
            let solution = solved(FlightKind::Straight, wanted, |v| 0.06 * v.powf(0.9)).unwrap();
            assert!(
                (solution.best.percent / wanted - 1.0).abs() <= TOLERANCE,
                "{wanted}: {:?}",
                solution.best
            );
            assert!(solution.trials.len() <= 6, "{wanted}: {:?}", solution.trials);
            assert!((solution.checked_percent / wanted - 1.0).abs() < 0.05);
            let (a, b) = (solution.flight.frames[0], solution.flight.frames[1]);
            assert!((b.eye_m[0] - a.eye_m[0] - solution.best.speed_m_per_frame).abs() < 1e-6);
        }
    }

    #[test]
    fn what_cannot_be_reached_says_what_can() {
        let saturating = |v: f64| 0.2 + 30.0 * v / (v + 500.0);
        for kind in [FlightKind::Straight, FlightKind::Turn] {
            for wanted in [0.1, 60.0] {
                let error = solved(kind, wanted, saturating).unwrap_err();
                assert!(matches!(error, SolveError::Unreachable { .. }), "{error}");
                let text = error.to_string();
                assert!(text.contains("0.2") && text.contains("this flight reached"), "{text}");
            }
            assert!(solved(kind, 7.0, saturating).is_ok());
        }
        let error = solved(FlightKind::Straight, 3.0, |v| if v < 77.0 { 1.0 } else { 9.0 }).unwrap_err();
        assert!(error.to_string().contains("jumps from 1.000 to 9.000 % at about 7"), "{error}");
    }

    #[test]
    fn nonsense_is_refused() {
        for wanted in [0.0, -1.0, 100.5, f64::NAN] {
            assert!(matches!(solved(FlightKind::Orbit, wanted, |v| v), Err(SolveError::Wanted { .. })));
        }
        for found in [f64::NAN, f64::INFINITY, -1.0] {
            assert!(matches!(solved(FlightKind::Orbit, 1.0, |_| found), Err(SolveError::Measured { .. })));
        }
        let one = FlightPlan::new(FlightKind::Orbit, 1, 1.0);
        assert!(matches!(
            solve(&puget(), &one, 1.0, |_| Ok::<_, Infallible>(1.0)),
            Err(SolveError::TooShort { frames: 1 })
        ));
        let plan = FlightPlan::new(FlightKind::Orbit, 9, 1.0);
        let error = solve(&puget(), &plan, 1.0, |_| Err(std::io::Error::other("disk gone"))).unwrap_err();
        assert!(error.to_string().contains("disk gone"));
    }

    #[test]
    fn pairs_are_consecutive_and_spread() {
        let flight = generate(&puget(), &FlightPlan::new(FlightKind::Straight, 1000, 1.0)).unwrap();
        for shift in [0.0, 0.5] {
            let pairs = sampled_pairs(&flight.frames, shift);
            assert_eq!(pairs.len(), MAX_PAIRS);
            assert!(pairs.iter().all(|(a, b)| (b.time_s - a.time_s - 1.0 / 30.0).abs() < 1e-9));
            assert!(pairs.last().unwrap().0.time_s > 0.9 * 999.0 / 30.0);
        }
        assert_eq!(sampled_pairs(&flight.frames[..2], 0.5).len(), 1);
        assert!(sampled_pairs(&flight.frames[..1], 0.0).is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn monotone_measures_are_solved(
            scale in -3.0..1.0f64,
            power in 0.3..1.5f64,
            noise in 0.0..0.01f64,
            wanted in 0.2..20.0f64,
        ) {
            let law = |v: f64| {
                let wobble = 1.0 + noise * (v.to_bits() % 1000) as f64 / 500.0 - noise;
                (10f64.powf(scale) * v.powf(power) * wobble).min(100.0)
            };
            let fastest = 0.25 * 163_840.0;
            prop_assume!(law(fastest) > 1.2 * wanted && law(1e-9 * 163_840.0) < 0.8 * wanted);
            let solution = solved(FlightKind::Orbit, wanted, law).unwrap();
            prop_assert!((solution.best.percent / wanted - 1.0).abs() <= TOLERANCE + 1e-9, "{:?}", solution.trials);
        }

        #[test]
        fn noise_costs_trials_and_not_the_answer(seed in any::<u64>(), wanted in 0.2..20.0f64) {
            let law = |v: f64| {
                let mixed = (v.to_bits() ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                0.05 * v.powf(0.9) * (0.95 + 0.1 * (mixed >> 40) as f64 / f64::from(1 << 24))
            };
            let solution = solved(FlightKind::Orbit, wanted, law).unwrap();
            prop_assert!((solution.best.percent / wanted - 1.0).abs() <= ACCEPTED, "{:?}", solution.trials);
            prop_assert!(solution.trials.len() <= MAX_TRIALS);
        }
    }
}
