//! From statistics to a record kind and its scale, and from a pass over the rows to the steepest slope, which bounds the radii.

use super::room::{LARGEST_CODE, codes_below, reach_steps, rounding_step};
use super::spool::{CANDIDATE_STEPS, SampleStats, Spool};
use crate::bound::{larger, largest_difference};
use crate::dem::DemInfo;
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::grid::record::{RadiusCodes, RecordKind, RecordScale};
use crate::portable::{hypot, log2, pow, power_of_two};
use crate::remedy::Remedy;
use crate::words::number;
use rayon::prelude::*;

/// How raw samples become the heights of records.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HeightCode {
    pub(super) kind: RecordKind,
    /// Raw sample at code 0.
    pub(super) raw_base: f64,
    /// Raw units a code.
    pub(super) raw_step: f64,
    /// Whether heights change by it.
    pub(super) rounds: bool,
    /// Metres at code 0.
    pub(super) base_m: f64,
    /// Metres a code.
    pub(super) step_m: f64,
    /// The largest range of heights, in steps, that the records are to hold; 0 for no more than the terrain's.
    pub(super) reach_steps: f64,
}

impl HeightCode {
    /// The code for these samples with records of a kind: fine ones have the heights of compact ones.
    pub(super) fn of_kind(self, asked: Option<RecordKind>) -> Self {
        let is_fine = asked == Some(RecordKind::Fine) && self.kind == RecordKind::Compact;
        Self { kind: if is_fine { RecordKind::Fine } else { self.kind }, ..self }
    }

    /// Chooses the smallest record that keeps every height exactly, or what the user asked for. Whether compact records are to be fine ones is for [`HeightCode::of_kind`] to say.
    pub(super) fn choose(
        info: &DemInfo,
        z_scale: f64,
        stats: &SampleStats,
        asked: Option<RecordKind>,
        has_room: bool,
    ) -> Self {
        let [low, high] = stats.range;
        let range = high - low;
        let exact_kind = if stats.fits_f32 { RecordKind::Exact8 } else { RecordKind::Exact16 };
        let step = if info.sample_type.is_integer() {
            Some(1.0)
        } else {
            CANDIDATE_STEPS.into_iter().zip(stats.steps).find(|(_, holds)| *holds).map(|(step, _)| step)
        };
        let lossless = step.filter(|step| range / step <= LARGEST_CODE);
        let (kind, raw_base, raw_step, rounds) = match (asked.map(RecordKind::name), lossless) {
            (Some("exact"), _) => (exact_kind, 0.0, 1.0, false),
            (_, Some(step)) => (RecordKind::Compact, (low / step).round() * step, step, false),
            (Some(_), None) => (RecordKind::Compact, low, rounding_step(range, has_room), true),
            (None, None) => (exact_kind, 0.0, 1.0, false),
        };
        let scale_m = info.height_scale * z_scale;
        // Where raw numbers count downward, codes are counted from the other end, and go up as heights do.
        let (raw_base, raw_step) = match (scale_m < 0.0, kind) {
            (false, _) => (raw_base, raw_step),
            (true, RecordKind::Compact) if rounds => (high, -raw_step),
            (true, RecordKind::Compact) => ((high / raw_step).round() * raw_step, -raw_step),
            (true, _) => (0.0, -1.0),
        };
        let range_steps = (range / raw_step).abs();
        let (below, reach_steps) = match kind {
            kind if kind.has_height_codes() && has_room => {
                (codes_below(range_steps), reach_steps(range_steps))
            }
            _ => (0.0, 0.0),
        };
        let raw_base = raw_base - below * raw_step;
        Self {
            kind,
            raw_base,
            raw_step,
            rounds,
            base_m: (info.height_offset_m + raw_base * info.height_scale) * z_scale,
            step_m: raw_step * scale_m,
            reach_steps,
        }
    }

    /// The code of a raw sample; NaN stays NaN.
    #[inline]
    pub(super) fn code(&self, raw: f64) -> f64 {
        match self.kind {
            RecordKind::Compact | RecordKind::Fine => round_whole((raw - self.raw_base) / self.raw_step),
            RecordKind::Exact8 => f64::from((raw * self.raw_step) as f32),
            RecordKind::Exact16 => raw * self.raw_step,
        }
    }

    /// Metres of a code.
    pub(super) fn metres(&self, code: f64) -> f64 {
        self.base_m + code * self.step_m
    }
}

/// Checks that metres of height are sane numbers.
pub(super) fn check_heights(
    info: &DemInfo,
    code: &HeightCode,
    stats: &SampleStats,
) -> Result<[f64; 2], LayoutError> {
    let range_m = stats.range.map(|raw| code.metres(code.code(raw)));
    let range_m = if code.raw_step < 0.0 { [range_m[1], range_m[0]] } else { range_m };
    if range_m.iter().any(|h| h.is_nan() || h.abs() > 1e9) || code.step_m.is_nan() || code.step_m <= 0.0 {
        // Wider than any terrain, before any factor: a mark for "no data" is likely.
        let is_wide = stats.range.iter().any(|raw| raw.abs() > 1e9);
        let [low, high] = stats.range.map(number);
        let (hint, remedy) = if is_wide || !info.sample_type.is_integer() {
            ("is a no-data value not declared? name it", Remedy::Nodata)
        } else {
            ("check the factor on heights", Remedy::HeightFactor)
        };
        return Err(LayoutError::Usage(format!(
            "the heights {low} to {high} (raw) are not heights in metres of up to a million kilometres; {hint}"
        ))
        .mended_by(remedy));
    }
    Ok(range_m)
}

/// The nearest whole number, ties to even, of a number below 2^51; in two additions, where the library's rounding is a call.
#[inline(always)]
fn round_whole(value: f64) -> f64 {
    const LARGE: f64 = 6_755_399_441_055_744.0; // 1.5 * 2^52: the sum's last bit is worth 1
    (value + LARGE) - LARGE
}

/// Rows read at a time.
const ROWS: u32 = 64;

/// Steepest height differences in metres between neighbouring samples that are not void: in x, in y, and along either diagonal, which fine records alone ask for.
pub(super) fn steepest_steps_m(
    spool: &Spool<'_>,
    grid: &Grid,
    code: &HeightCode,
    advance: &(dyn Fn(u64) + Sync),
) -> Result<[f64; 3], LayoutError> {
    let [wide, high] = grid.samples();
    let has_diagonals = code.kind == RecordKind::Fine;
    let blocks: Vec<u32> = (0..high).step_by(ROWS as usize).collect();
    let steepest = blocks
        .into_par_iter()
        .map(|first| {
            let mut steepest = [0.0f64; 3];
            // The row below the block belongs to it, so that no pair of rows is left out.
            let rows = first.saturating_sub(1)..(first + ROWS).min(high);
            for run in spool.land().runs(rows.start..=rows.end - 1) {
                let mut last_row = vec![f64::NAN; run.len()];
                let mut row = last_row.clone();
                let mut follows_row = false;
                for y in rows.clone() {
                    if spool.is_void_row(y) {
                        follows_row = false;
                        continue;
                    }
                    spool.read_part(y, run.start, &mut row)?;
                    row.iter_mut().for_each(|v| *v = code.code(*v));
                    steepest[0] = larger(steepest[0], largest_difference(&row, &row[1..]));
                    if follows_row {
                        steepest[1] = larger(steepest[1], largest_difference(&row, &last_row));
                        if has_diagonals {
                            let climbing = largest_difference(&row[1..], &last_row);
                            let falling = largest_difference(&row, &last_row[1..]);
                            steepest[2] = larger(steepest[2], larger(climbing, falling));
                        }
                    }
                    std::mem::swap(&mut row, &mut last_row);
                    follows_row = true;
                }
            }
            advance(u64::from(ROWS.min(high - first)) * u64::from(wide));
            Ok(steepest)
        })
        .try_reduce(|| [0.0; 3], |a, b| Ok(std::array::from_fn(|i| a[i].max(b[i]))))?;
    Ok(steepest.map(|s| s * code.step_m))
}

/// The scale of records that holds every error and radius.
pub(super) fn record_scale(
    grid: &Grid,
    code: &HeightCode,
    range_m: [f64; 2],
    steepest_m: [f64; 3],
) -> RecordScale {
    let [dx, dy] = grid.spacing_m();
    let [gx, gy, diagonal] = steepest_m;
    // Largest |p_v - p_c| over its flat counterpart, for black and for white vertices.
    let black = |rise: f64| hypot(1.0, rise / hypot(dx, dy));
    let white = hypot(dx, gx).max(hypot(dy, gy)) / dx.max(dy);
    let radius_codes = match code.kind {
        RecordKind::Fine => excess_codes(black(diagonal).max(white)),
        _ => RadiusCodes::Octaves(steps_per_octave(black(gx + gy).max(white))),
    };
    let top_m = (range_m[1] - range_m[0]).max(code.reach_steps * code.step_m);
    RecordScale {
        height_base_m: code.base_m,
        height_step_m: code.step_m,
        error_top_m: (top_m * (1.0 + 1e-6)).max(code.step_m).max(1e-6),
        radius_codes,
    }
}

/// Radius codes of fine records that hold all radii, where no child is more than `stretch` times as far from its parent as on flat ground.
///
/// A radius over flat ground's lies between the stretches of what is below: it is a mean of the vertex's own and of its farthest child's. So rounding up does not add up over levels, beyond one code: the margin that keeps radii nested may lead from a code to the next, and no further.
fn excess_codes(stretch: f64) -> RadiusCodes {
    /// What the last code but one stands for, in first octaves.
    const LAST_BUT_ONE: f64 = 104.0;
    /// More than rounding adds to the sums of a radius.
    const SLACK: f64 = 1.0 + 1e-3;
    let holds = |octave: &i32| LAST_BUT_ONE * power_of_two(*octave) >= (stretch - 1.0) * SLACK;
    let first_octave = RadiusCodes::FIRST_OCTAVES.into_iter().find(holds);
    RadiusCodes::Excess { first_octave: first_octave.unwrap_or(*RadiusCodes::FIRST_OCTAVES.end()) }
}

/// Radius codes an octave of compact records that hold all radii, where no child is more than `stretch` times as far from its parent as on flat ground.
fn steps_per_octave(stretch: f64) -> u32 {
    [64, 32, 16]
        .into_iter()
        .find(|steps| {
            // Rounding up by q at each level adds up to the sum of a geometric series over levels that shrink by sqrt(2).
            let q = pow(2.0, 1.0 / f64::from(*steps)) * 1.001;
            let shrink = std::f64::consts::FRAC_1_SQRT_2;
            let growth = q * (1.0 - shrink) / (1.0 - q * shrink);
            // Levels of uneven spacing shrink unevenly; a factor of two covers them.
            log2(stretch * growth * 2.0) * f64::from(*steps) <= 254.0
        })
        .unwrap_or(8)
}
