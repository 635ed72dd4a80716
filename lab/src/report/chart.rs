//! A chart as data, independent of how it is drawn: its series, and the limits and ticks of its axes.
//!
//! Limits always span something and all coordinates are finite, whatever the data: values that are not finite,
//! or not above 0 on a logarithmic axis, are left out.

use super::number::{exact, grouped};

/// How an axis spaces its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    /// Equal steps are equal factors.
    Logarithmic,
}

/// Where an axis has its ticks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ticks {
    /// At round values.
    Round,
    /// At the values the data have.
    AtData,
}

/// An axis: its name with unit, its spacing, and values it shows at least.
#[derive(Debug, Clone)]
pub(super) struct AxisPlan {
    pub(super) name: String,
    pub(super) scale: Scale,
    pub(super) ticks: Ticks,
    pub(super) shows: Vec<f64>,
}

/// A line of the chart.
#[derive(Debug, Clone)]
pub(super) struct Series {
    pub(super) name: String,
    /// Number of its colour and marker.
    pub(super) look: usize,
    /// Points by rising x; those that cannot be drawn interrupt the line.
    pub(super) points: Vec<[f64; 2]>,
}

/// A chart. Text that comes from outside stands in it as it came.
#[derive(Debug, Clone)]
pub(super) struct Chart {
    /// File name without ending.
    pub(super) stem: &'static str,
    pub(super) title: String,
    pub(super) subtitle: String,
    /// A sentence for the page.
    pub(super) caption: String,
    pub(super) x: AxisPlan,
    pub(super) y: AxisPlan,
    pub(super) series: Vec<Series>,
    /// Horizontal lines with their names.
    pub(super) references: Vec<(f64, String)>,
    /// Whether points have markers.
    pub(super) marked: bool,
}

/// An axis with limits: maps values to 0..=1.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    /// Values of the ticks and their labels.
    pub(super) ticks: Vec<(f64, String)>,
}

impl Axis {
    /// The axis of `plan` for `data`. A linear one starts at 0 if `from_zero` and no value is below, and ends at a tick.
    pub(super) fn of(plan: &AxisPlan, data: impl Iterator<Item = f64>, from_zero: bool) -> Self {
        let mut values: Vec<f64> =
            data.chain(plan.shows.iter().copied()).filter(|v| drawable(plan.scale, *v)).collect();
        values.sort_unstable_by(f64::total_cmp);
        values.dedup();
        let (mut low, mut high) = match (values.first(), values.last()) {
            (Some(low), Some(high)) => (*low, *high),
            _ if plan.scale == Scale::Logarithmic => (1.0, 10.0),
            _ => (0.0, 1.0),
        };
        match (plan.scale, from_zero) {
            (Scale::Linear, true) => {
                low = low.min(0.0);
                if high - low <= f64::EPSILON * high.abs() || high <= low {
                    high = low + 1.0;
                }
                let step = round_step(high - low);
                low = (low / step).floor() * step;
                high = ((high - low) * 1.02 / step).ceil() * step + low;
            }
            (Scale::Linear, false) => {
                if high - low < 1e-9 * high.abs().max(1.0) {
                    let pad = 0.5 * high.abs().max(1.0);
                    (low, high) = (low - pad, high + pad);
                }
            }
            (Scale::Logarithmic, true) => {
                (low, high) = (decade_step(low, false), decade_step(high * 1.02, true))
            }
            (Scale::Logarithmic, false) => {
                let pad = (high / low).powf(0.05).max(1.05);
                (low, high) = (low / pad, high * pad);
            }
        }
        let ticks = match plan.ticks {
            Ticks::AtData if !values.is_empty() && values.len() <= 16 => {
                values.iter().map(|v| (*v, exact(*v))).collect()
            }
            _ if plan.scale == Scale::Logarithmic => log_ticks(low, high),
            _ => linear_ticks(low, high),
        };
        Self { scale: plan.scale, low, high, ticks }
    }

    /// Where `value` lies, 0 at the axis's start and 1 at its end; `None` if it cannot be drawn.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        if !drawable(self.scale, value) {
            return None;
        }
        let place = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Logarithmic => (value / self.low).ln() / (self.high / self.low).ln(),
        };
        (-1e-9..=1.0 + 1e-9).contains(&place).then(|| place.clamp(0.0, 1.0))
    }
}

/// Beyond 1e15 neither limits nor labels make sense.
fn drawable(scale: Scale, value: f64) -> bool {
    value.abs() <= 1e15 && (scale == Scale::Linear || value > 1e-12)
}

/// 1, 2 or 5 times a power of ten that divides `span` into 4 to 10 parts.
fn round_step(span: f64) -> f64 {
    let rough = span / 7.0;
    let power = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= rough * 0.999).unwrap_or(10.0);
    factor * power
}

fn linear_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let step = round_step(high - low);
    let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let first = (low / step - 1e-6).ceil();
    (0..32)
        .map(|i| (first + f64::from(i)) * step)
        .take_while(|v| *v <= high + 1e-6 * step)
        .map(|v| (v, grouped(v, decimals)))
        .collect()
}

/// The nearest of 1, 2, 5 times a power of ten that is not above (or, if `up`, not below) `value`.
fn decade_step(value: f64, up: bool) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|f| f * power);
    let found = if up {
        steps.into_iter().find(|s| *s >= value * (1.0 - 1e-9))
    } else {
        steps.into_iter().rev().find(|s| *s <= value * (1.0 + 1e-9))
    };
    found.unwrap_or(value)
}

fn log_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let decades = (high / low).log10();
    let factors: &[f64] = if decades > 4.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let first = low.log10().floor() as i32;
    let last = high.log10().ceil() as i32;
    (first..=last)
        .flat_map(|power| factors.iter().map(move |f| f * 10f64.powi(power)))
        .filter(|v| *v >= low * (1.0 - 1e-9) && *v <= high * (1.0 + 1e-9))
        .map(|v| (v, exact(v)))
        .collect()
}

/// `points` with at most four to each of `columns` equal stretches of x: the first, lowest, highest and last. What
/// is drawn looks the same and a long flight makes no larger file than a short one.
pub(super) fn thinned(points: &[[f64; 2]], columns: usize) -> Vec<[f64; 2]> {
    if points.len() <= 4 * columns {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(4 * columns);
    for chunk in points.chunks(points.len().div_ceil(columns)) {
        let extreme = |lowest: bool| {
            let by = |a: &(usize, &[f64; 2]), b: &(usize, &[f64; 2])| a.1[1].total_cmp(&b.1[1]);
            let all = chunk.iter().enumerate().filter(|(_, p)| p[1].is_finite());
            if lowest { all.min_by(by) } else { all.max_by(by) }.map_or(0, |(i, _)| i)
        };
        let mut indices = [0, extreme(true), extreme(false), chunk.len() - 1];
        indices.sort_unstable();
        for (n, i) in indices.into_iter().enumerate() {
            if n == 0 || i != indices[n - 1] {
                kept.push(chunk[i]);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plan(scale: Scale, ticks: Ticks) -> AxisPlan {
        AxisPlan { name: String::new(), scale, ticks, shows: Vec::new() }
    }

    #[test]
    fn ticks_are_round() {
        let axis = Axis::of(&plan(Scale::Linear, Ticks::Round), [3.0, 23.0].into_iter(), true);
        let labels: Vec<&str> = axis.ticks.iter().map(|t| t.1.as_str()).collect();
        assert_eq!(labels, ["0", "5", "10", "15", "20", "25"]);
        let axis = Axis::of(&plan(Scale::Logarithmic, Ticks::Round), [1.3, 26.0].into_iter(), true);
        let labels: Vec<&str> = axis.ticks.iter().map(|t| t.1.as_str()).collect();
        assert_eq!(labels, ["1", "2", "5", "10", "20", "50"]);
        let axis =
            Axis::of(&plan(Scale::Logarithmic, Ticks::AtData), [0.5, 8.0, 2.0, 2.0].into_iter(), false);
        let labels: Vec<&str> = axis.ticks.iter().map(|t| t.1.as_str()).collect();
        assert_eq!(labels, ["0.5", "2", "8"]);
    }

    proptest! {
        #[test]
        fn every_axis_spans_something_and_shows_its_data(
            values in prop::collection::vec(prop_oneof![
                any::<f64>(), Just(0.0), Just(7.0), 0.0..1e4f64, 1e-9..1e-3f64,
            ], 0..12),
            log in any::<bool>(), at_data in any::<bool>(), from_zero in any::<bool>(),
        ) {
            let scale = if log { Scale::Logarithmic } else { Scale::Linear };
            let ticks = if at_data { Ticks::AtData } else { Ticks::Round };
            let axis = Axis::of(&plan(scale, ticks), values.iter().copied(), from_zero);
            prop_assert!(axis.low < axis.high && axis.low.is_finite() && axis.high.is_finite(), "{axis:?}");
            prop_assert!(axis.ticks.len() <= 64);
            for v in values.into_iter().filter(|v| drawable(scale, *v)) {
                prop_assert!(axis.place(v).is_some(), "{v} on {axis:?}");
            }
        }

        #[test]
        fn thinning_keeps_extremes(values in prop::collection::vec(-5.0..5.0f64, 0..900)) {
            let points: Vec<[f64; 2]> = values.iter().enumerate().map(|(i, v)| [i as f64, *v]).collect();
            let thin = thinned(&points, 20);
            prop_assert!(thin.len() <= 80 && thin.windows(2).all(|w| w[0][0] < w[1][0]));
            let top = |p: &[[f64; 2]]| p.iter().map(|p| p[1]).fold(f64::MIN, f64::max);
            prop_assert_eq!(top(&thin), top(&points));
        }
    }
}
