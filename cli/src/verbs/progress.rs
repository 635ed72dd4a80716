//! Progress on standard error: stage, rate and time left. Hidden where standard error is not a terminal.

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::time::Duration;
use terrasoar_layout::progress::Progress;

/// A bar that counts `unit`s.
pub(super) struct Meter {
    bar: ProgressBar,
    unit: &'static str,
}

impl Meter {
    /// A bar of no stage yet.
    pub(super) fn new(unit: &'static str) -> Self {
        Self { bar: ProgressBar::new(0), unit }
    }

    /// Starts a stage of `total` units.
    pub(super) fn begin(&self, stage: impl Into<String>, total: u64) {
        let unit = self.unit;
        let template =
            if total > 0 { "{stage:24} [{bar:30}] {percent:>3}%  {rate}  {left}" } else { "{stage:24}" };
        let stage = terrasoar_layout::printable::line(&stage.into()).into_owned();
        // A template that indicatif cannot read would show as its default bar.
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        let style = style
            .progress_chars("=> ")
            .with_key("stage", move |_: &ProgressState, w: &mut dyn Write| {
                let _ = w.write_str(&stage);
            })
            .with_key("rate", move |state: &ProgressState, w: &mut dyn Write| {
                let _ = write!(w, "{} {unit}/s", short(state.per_sec()));
            })
            .with_key("left", |state: &ProgressState, w: &mut dyn Write| {
                let left = Duration::from_secs(state.eta().as_secs());
                let _ = write!(w, "{} left", HumanDuration(left));
            });
        self.bar.reset();
        self.bar.set_length(total);
        self.bar.set_style(style);
    }

    /// More units are done.
    pub(super) fn add(&self, units: u64) {
        self.bar.inc(units);
    }

    /// So many units are done.
    pub(super) fn set(&self, units: u64) {
        self.bar.set_position(units);
    }

    /// Prints a line above the bar, also where the bar is hidden.
    pub(super) fn note(&self, line: &str) {
        self.bar.suspend(|| super::output::complain(line));
    }
}

impl Drop for Meter {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Meter {
    fn stage(&self, name: &'static str, samples: u64) {
        self.begin(name, samples);
    }

    fn advance(&self, samples: u64) {
        self.add(samples);
    }
}

/// A rate in three digits or so.
pub(super) fn short(value: f64) -> String {
    match value {
        v if v >= 1e9 => format!("{:.1} G", v / 1e9),
        v if v >= 1e6 => format!("{:.1} M", v / 1e6),
        v if v >= 1e3 => format!("{:.1} k", v / 1e3),
        v => format!("{v:.1}"),
    }
}
