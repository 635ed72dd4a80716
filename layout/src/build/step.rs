//! Heights in steps of metres that were asked for, and the steps that compact records would take where heights are kept exactly.
//!
//! Heights become whole multiples of the step, counted from 0 m. Where the samples are such multiples already, their own numbers are counted, and nothing is rounded. Cost: none a sample.

use super::room::{LARGEST_CODE, codes_below, reach_steps, rounding_step};
use super::spool::{CANDIDATE_STEPS, SampleStats};
use super::survey::HeightCode;
use crate::dem::DemInfo;
use crate::error::LayoutError;
use crate::file::header::Header;
use crate::grid::record::RecordKind;
use crate::remedy::Remedy;
use crate::words::number;

/// How far from a whole number a ratio of two steps may be to count as one.
const WHOLE: f64 = 1e-9;

/// Whether a step is one, and goes with the kind of records that was asked for.
pub(super) fn check(step_m: Option<f64>, asked: Option<RecordKind>) -> Result<(), LayoutError> {
    let Some(step_m) = step_m else { return Ok(()) };
    let refused = |words: String| Err(LayoutError::Usage(words).mended_by(Remedy::HeightStep));
    if !(step_m.is_finite() && step_m > 0.0) {
        return refused(format!(
            "a step between heights is a number of metres above 0, not {}",
            number(step_m)
        ));
    }
    if asked.is_some_and(|kind| !kind.has_height_codes()) {
        return refused(
            "exact records keep heights as they are, in no steps; leave out one of the two".into(),
        );
    }
    Ok(())
}

/// Codes of heights in whole multiples of `step_m`, which [`check`] let pass.
///
/// # Errors
/// [`LayoutError::Usage`] where the range of heights has more steps than records count, with the smallest step that fits.
pub(super) fn in_steps(
    info: &DemInfo,
    z_scale: f64,
    stats: &SampleStats,
    step_m: f64,
    has_room: bool,
) -> Result<HeightCode, LayoutError> {
    let scale_m = info.height_scale * z_scale;
    let metres = |raw: f64| (info.height_offset_m + raw * info.height_scale) * z_scale;
    let ends = stats.range.map(metres);
    let [low_m, high_m] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    let range_m = high_m - low_m;
    // Signed: codes go up as heights do, whichever way raw numbers go.
    let raw_step = step_m / scale_m;
    let is_kept = keeps_samples(info, stats, raw_step.abs());
    let most = if is_kept { LARGEST_CODE } else { most_steps(has_room) };
    if range_m / step_m > most {
        let enough = readable_above(smallest_step_m(range_m, has_room));
        return Err(LayoutError::Usage(format!(
            "heights from {} to {} m take {:.0} steps of {} m, and compact records count at most {most:.0} of them{}; the smallest step that fits is {} m",
            number(low_m),
            number(high_m),
            range_m / step_m,
            number(step_m),
            if most < LARGEST_CODE { ", which leaves room for edits" } else { "" },
            number(enough)
        ))
        .mended_by(Remedy::HeightStep));
    }
    // The steps that the data have themselves are those of a build without any.
    let own = HeightCode::choose(info, z_scale, stats, Some(RecordKind::Compact), has_room);
    if is_kept && !own.rounds && (own.step_m - step_m).abs() <= WHOLE * step_m {
        return Ok(own);
    }
    let lowest = if is_kept {
        let raw_low = if scale_m < 0.0 { stats.range[1] } else { stats.range[0] };
        metres((raw_low / raw_step).round() * raw_step)
    } else {
        (low_m / step_m).round() * step_m
    };
    let range_steps = ((high_m - lowest) / step_m).round();
    let below = if has_room { codes_below(range_steps) } else { 0.0 };
    let base_m = if is_kept { lowest - below * step_m } else { ((lowest / step_m).round() - below) * step_m };
    Ok(HeightCode {
        kind: RecordKind::Compact,
        raw_base: (base_m / z_scale - info.height_offset_m) / info.height_scale,
        raw_step,
        rounds: !is_kept,
        base_m,
        step_m,
        reach_steps: if has_room { reach_steps(range_steps) } else { 0.0 },
    })
}

/// Whether every sample is a whole multiple of `raw_step`, in raw units.
fn keeps_samples(info: &DemInfo, stats: &SampleStats, raw_step: f64) -> bool {
    let is_multiple = |step: f64| {
        let steps = step / raw_step;
        steps > 0.5 && (steps - steps.round()).abs() <= WHOLE * steps
    };
    if info.sample_type.is_integer() {
        return is_multiple(1.0);
    }
    CANDIDATE_STEPS.into_iter().zip(stats.steps).any(|(step, holds)| holds && is_multiple(step))
}

/// Steps that a range of heights may have where they are rounded: one less than codes, because both ends may be rounded away from each other.
fn most_steps(has_room: bool) -> f64 {
    if has_room { (1.0 / rounding_step(1.0, true)).floor() } else { LARGEST_CODE - 1.0 }
}

/// The smallest step in metres whose multiples count heights that are `range_m` apart.
fn smallest_step_m(range_m: f64, has_room: bool) -> f64 {
    range_m / most_steps(has_room)
}

/// The smallest number of two digits that is at least `value`, which is above 0.
fn readable_above(value: f64) -> f64 {
    // By its text, so that it is the number that a person types.
    let near = format!("{value:.1e}");
    let Some((digits, exponent)) = near.split_once('e') else { return value };
    let tenths = digits.replace('.', "").parse::<u32>().unwrap_or(99);
    let of_tenths = |tenths: u32| format!("{}.{}e{exponent}", tenths / 10, tenths % 10).parse::<f64>();
    [tenths, tenths + 1]
        .into_iter()
        .filter_map(|tenths| of_tenths(tenths).ok())
        .find(|step| *step >= value)
        .unwrap_or(value)
}

/// The smallest step of two digits, in metres, to which compact records could round the heights of a terrain that has exact ones, with room for edits.
///
/// `None` for compact records, and for heights that are all the same.
pub fn compact_step_m(header: &Header) -> Option<f64> {
    let [low, high] = header.height_range_m;
    let step_m = smallest_step_m(high - low, true);
    (!header.record_kind.has_height_codes() && step_m.is_finite() && step_m > 0.0)
        .then(|| readable_above(step_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_that_are_named_are_short_and_enough() {
        for (value, named) in [
            (0.000_76, 0.000_76),
            (0.000_761, 0.000_77),
            (1.0, 1.0),
            (0.991, 1.0),
            (12.01, 13.0),
            (99.9, 100.0),
            (3e-9, 3e-9),
        ] {
            assert_eq!(readable_above(value), named, "{value}");
        }
        let mut value = 1e-7;
        while value < 1e7 {
            let named = readable_above(value);
            assert!(named >= value && named <= value * 1.1 + 1e-12, "{value} {named}");
            value *= 1.037;
        }
    }

    #[test]
    fn what_is_rounded_fits_the_codes() {
        for range_m in [0.3, 50.0, 8848.0, 1e7] {
            for has_room in [false, true] {
                let steps = range_m / readable_above(smallest_step_m(range_m, has_room));
                assert!(steps.ceil() + 1.0 <= LARGEST_CODE, "{range_m} {steps}");
            }
        }
    }
}
