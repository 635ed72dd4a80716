//! Which charts a measurement of reading has: pages a frame by layout and by engine, and what preloading leaves to be read in real time.

use super::IoReport;
use crate::iobench::{FrameIo, LayoutKind, Prefetch, Reader, Run};
use crate::report::chart::{Chart, Series};
use crate::report::figures::{frame_axis, scaled_axis};
use crate::report::number::exact;

/// The charts of a report, in the order shown.
pub(crate) fn all(report: &IoReport<'_>) -> Vec<Chart> {
    let runs: Vec<&Run> = report.runs.iter().map(|(run, _)| run).collect();
    let Some(first) = runs.first() else { return Vec::new() };
    // Flights over a pool count what is late, not what is read.
    let plain = |run: &&Run| run.preload == Prefetch::None && run.reader != Reader::Pool;
    let layouts: Vec<&Run> =
        runs.iter().copied().filter(plain).filter(|run| run.reader == first.reader).collect();
    // Engines are compared in the terrain file, or in the last layout named.
    let layout = match runs.iter().any(|run| run.layout == LayoutKind::Ours) {
        true => LayoutKind::Ours,
        false => runs.last().map_or(first.layout, |run| run.layout),
    };
    let engines: Vec<&Run> = runs.iter().copied().filter(|run| run.layout == layout).collect();
    let mut charts = Vec::new();
    if !layouts.is_empty() {
        charts.push(chart(
            report,
            "plot-io-layouts",
            format!("Pages that {} reads, by layout", first.reader.name()),
            "Distinct 4 KiB pages a frame",
            "Pages that each frame's records lie on, the same records under every layout; the first frame is left out.",
            layouts.into_iter().map(|run| (run.layout.name().to_owned(), run)),
            |f| f.pages,
        ));
        charts.push(chart(
            report,
            "plot-io-engines",
            format!("Pages read in layout {}, by engine", layout.name()),
            "Distinct 4 KiB pages a frame",
            "Pages that each frame's reads lie on; mesh is all that the frame's mesh needs, whoever has it in memory already. The first frame is left out.",
            engines.iter().copied().filter(plain).map(|run| (run.reader.name().to_owned(), run)),
            |f| f.pages,
        ));
    }
    // Flights over a pool are what preloading is for; without any, the first reader's counts show it.
    let pooled = engines.iter().any(|run| run.reader == Reader::Pool);
    let reader = if pooled { Reader::Pool } else { first.reader };
    let preloads: Vec<&Run> = engines.into_iter().filter(|run| run.reader == reader).collect();
    if preloads.iter().any(|run| run.preload != Prefetch::None) {
        charts.push(chart(
            report,
            "plot-io-realtime",
            format!("Pages that {} lacks, in layout {}", reader.name(), layout.name()),
            "4 KiB pages a frame that were not at hand",
            "What preloading leaves: pages that a frame needed and that were not there. The first frame is left out.",
            preloads.into_iter().map(|run| (run.preload.name().to_owned(), run)),
            |f| f.realtime_pages,
        ));
    }
    charts
}

fn chart<'r>(
    report: &IoReport<'_>,
    stem: &'static str,
    title: String,
    y_name: &str,
    caption: &str,
    runs: impl Iterator<Item = (String, &'r Run)>,
    figure: fn(&FrameIo) -> u64,
) -> Chart {
    let points = |run: &Run| -> Vec<[f64; 2]> {
        run.frames.iter().skip(1).map(|f| [f.frame as f64, figure(f) as f64]).collect()
    };
    let series: Vec<Series> =
        runs.enumerate().map(|(look, (name, run))| Series { name, look, points: points(run) }).collect();
    let y = scaled_axis(y_name, &series);
    let bench = report.bench;
    let [wide, high] = bench.viewport_px;
    Chart {
        stem,
        title,
        subtitle: format!(
            "{}; {}; tolerance {} px; {wide} × {high} px; cache {} MiB",
            bench.terrain,
            bench.flight,
            exact(bench.tolerance_px),
            bench.cache_mib
        ),
        caption: caption.into(),
        x: frame_axis(),
        y,
        series,
        references: Vec::new(),
        marked: false,
    }
}
