//! Which charts a report has: those of the SMART paper (Bao, Pajarola and Shafae 2004, figures 8 to 10) and two of what frames cost.
//!
//! An engine has the same colour in all of them.

use super::chart::{AxisPlan, Chart, Scale, Series, Ticks};
use super::number::exact;
use super::{ComparisonReport, SweepPoint};
use terrasoar::stats::{FrameStats, median};

/// Medians further apart than this factor share a logarithmic axis.
const WIDE: f64 = 12.0;

/// The charts of a report, in the order shown.
pub(super) fn all(report: &ComparisonReport<'_>) -> Vec<Chart> {
    let mut charts = vec![vertex_tests(report)];
    if !report.tolerance_sweep.is_empty() {
        charts.push(speedup(
            report,
            report.tolerance_sweep,
            "plot-speedup-by-tolerance",
            "tolerance",
            "Tolerance on the screen, pixels",
            &format!(
                "Figure 9 of the SMART paper, redone: its pure mesh computation. Flown are the middle {} frames of the flight; the way is kept, so the incoherence varies with the tolerance.",
                swept(report.tolerance_sweep)
            ),
        ));
    }
    if !report.incoherence_sweep.is_empty() {
        charts.push(speedup(
            report,
            report.incoherence_sweep,
            "plot-speedup-by-incoherence",
            "incoherence",
            "Triangles changed from frame to frame, % of the frame's",
            &format!(
                "Figure 10 of the SMART paper, redone: its pure mesh computation. Flown are flights of the same kind at other speeds, of {} frames each.",
                swept(report.incoherence_sweep)
            ),
        ));
    }
    charts.push(per_frame(
        report,
        "plot-update-times",
        "Time of the mesh update along the flight",
        "Update time, ms",
        "Time each frame's mesh update took; the first frame, which builds the mesh, is left out.",
        logarithmic,
        |f| f.update_ms,
    ));
    charts.push(per_frame(
        report,
        "plot-pages",
        "Pages of the file read along the flight",
        "Distinct 4 KiB pages read a frame",
        "Pages of the terrain file that each frame's update read; the first frame is left out.",
        scaled_axis,
        |f| f.pages_touched as f64,
    ));
    charts
}

/// Frames of a sweep's points.
fn swept(points: &[SweepPoint]) -> u64 {
    points.iter().map(|point| point.frames).max().unwrap_or(0)
}

fn base_name<'a>(report: &ComparisonReport<'a>) -> &'a str {
    report.runs.first().map_or("the base engine", |(name, _)| name.as_str())
}

fn subtitle(report: &ComparisonReport<'_>, with_tolerance: bool) -> String {
    let title = report.title;
    // Shortened, so that a long name leaves room for the figures behind it.
    let short = |name: &str| match name.char_indices().nth(45) {
        Some((end, _)) => format!("{}…", name.get(..end).unwrap_or_default().trim_end()),
        None => name.to_owned(),
    };
    let (terrain, flight) = (short(&title.terrain), short(&title.flight));
    let picture = format!("{} × {} px", title.viewport.width_px, title.viewport.height_px);
    if with_tolerance {
        format!("{terrain}; {flight}; tolerance {} px; {picture}", exact(title.tolerance_px))
    } else {
        format!("{terrain}; {flight}; {picture}")
    }
}

pub(super) fn frame_axis() -> AxisPlan {
    AxisPlan {
        name: "Frame of the flight".into(),
        scale: Scale::Linear,
        ticks: Ticks::Round,
        shows: vec![0.0],
    }
}

/// An axis for `series`, logarithmic where their medians lie wide apart and nothing is 0.
pub(super) fn scaled_axis(name: &str, series: &[Series]) -> AxisPlan {
    let medians = series.iter().map(|s| median(&mut s.points.iter().map(|p| p[1]).collect::<Vec<_>>()));
    let (low, high) = medians.fold((f64::INFINITY, 0.0f64), |(l, h), m| (l.min(m), h.max(m)));
    let all_above_zero = series.iter().flat_map(|s| &s.points).all(|p| p[1] > 0.0);
    let mut axis = y_axis(name.into(), &[]);
    if high > WIDE * low && all_above_zero {
        axis.scale = Scale::Logarithmic;
        axis.name.push_str(" (logarithmic)");
    }
    axis
}

/// A logarithmic axis, whatever the series: reports of different flights look the same.
fn logarithmic(name: &str, _: &[Series]) -> AxisPlan {
    AxisPlan { scale: Scale::Logarithmic, ..y_axis(format!("{name} (logarithmic)"), &[]) }
}

fn y_axis(name: String, shows: &[f64]) -> AxisPlan {
    AxisPlan { name, scale: Scale::Linear, ticks: Ticks::Round, shows: shows.to_vec() }
}

/// Figure 8: vertex tests of each frame in percent of the base engine's.
fn vertex_tests(report: &ComparisonReport<'_>) -> Chart {
    let base = report.runs.first().map_or(&[][..], |(_, frames)| frames);
    let series = report.runs.iter().enumerate().skip(1).map(|(look, (name, frames))| {
        let percent = |(b, f): (&FrameStats, &FrameStats)| {
            [f.frame as f64, 100.0 * f.vertex_tests as f64 / b.vertex_tests.max(1) as f64]
        };
        Series { name: name.clone(), look, points: base.iter().zip(frames).skip(1).map(percent).collect() }
    });
    Chart {
        stem: "plot-vertex-tests",
        title: format!("Vertex tests compared with {}", base_name(report)),
        subtitle: subtitle(report, true),
        caption: format!(
            "Figure 8 of the SMART paper, redone: vertex tests of each frame in percent of those of {}, first frame left out. Lines mark what the paper has at 1 px and an incoherence of 0.61 %: most frames below 10 %, the worst slightly beyond 20 %.",
            base_name(report)
        ),
        x: frame_axis(),
        y: y_axis(format!("Vertex tests, % of those of {}", base_name(report)), &[22.0]),
        series: series.collect(),
        references: vec![
            (10.0, "10 %: paper, most frames".into()),
            (20.0, "20 %: paper, worst frame".into()),
        ],
        marked: false,
    }
}

/// Figures 9 and 10: how many times faster than the base engine.
fn speedup(
    report: &ComparisonReport<'_>,
    points: &[SweepPoint],
    stem: &'static str,
    by: &str,
    x_name: &str,
    paper: &str,
) -> Chart {
    let base = base_name(report);
    let mut names: Vec<&str> = Vec::new();
    for point in points.iter().filter(|p| p.engine != base) {
        if !names.contains(&point.engine.as_str()) {
            names.push(&point.engine);
        }
    }
    let series = names.into_iter().enumerate().map(|(n, name)| {
        let known = report.runs.iter().position(|(engine, _)| engine == name);
        let mut line: Vec<[f64; 2]> =
            points.iter().filter(|p| p.engine == name).map(|p| [p.x, p.speedup_median]).collect();
        line.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Series { name: name.into(), look: known.unwrap_or(report.runs.len() + n), points: line }
    });
    Chart {
        stem,
        title: format!("Speed-up over {base} by {by}"),
        subtitle: subtitle(report, by != "tolerance"),
        caption: format!("{paper} Median over the frames of the time {base} takes over the engine's own."),
        x: AxisPlan {
            name: format!("{x_name} (logarithmic)"),
            scale: Scale::Logarithmic,
            ticks: Ticks::AtData,
            shows: Vec::new(),
        },
        y: y_axis(format!("Times as fast as {base}"), &[1.5]),
        series: series.collect(),
        references: vec![(1.0, format!("1: {base}"))],
        marked: true,
    }
}

/// A figure of each frame, one line an engine.
fn per_frame(
    report: &ComparisonReport<'_>,
    stem: &'static str,
    title: &str,
    y_name: &str,
    caption: &str,
    axis: fn(&str, &[Series]) -> AxisPlan,
    figure: fn(&FrameStats) -> f64,
) -> Chart {
    let later = |frames: &[FrameStats]| -> Vec<[f64; 2]> {
        frames.iter().skip(1).map(|f| [f.frame as f64, figure(f)]).collect()
    };
    let series: Vec<Series> = report
        .runs
        .iter()
        .enumerate()
        .map(|(look, (name, frames))| Series { name: name.clone(), look, points: later(frames) })
        .collect();
    let y = axis(y_name, &series);
    Chart {
        stem,
        title: title.into(),
        subtitle: subtitle(report, true),
        caption: caption.into(),
        x: frame_axis(),
        y,
        series,
        references: Vec::new(),
        marked: false,
    }
}
