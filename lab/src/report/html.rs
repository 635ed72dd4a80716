//! The report's page: one HTML file with the verdict, tables and plots. It refers only to
//! the data files beside it.
//!
//! All text that comes from outside is escaped.

use super::number::{exact, grouped, rounded};
use super::{ComparisonReport, FlightPicture, Made, PlotFile, SweepPoint};
use std::fmt::Write as _;

const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:#222;background:#fff;max-width:1200px;margin:2rem auto;padding:0 1.5rem}\
h1{font-size:1.7rem;margin:0 0 .2rem}h2{font-size:1.25rem;margin:2.2rem 0 .6rem}p{margin:.4rem 0}\
.of{color:#555}.verdict{padding:.6rem .9rem;border-left:5px solid #009e73;background:#f1f8f5;margin:1rem 0}\
.verdict.bad{border-color:#d55e00;background:#fdf3ec}\
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;min-width:50%}\
th,td{padding:.35rem .8rem;text-align:right;border-bottom:1px solid #ddd}th{font-weight:600;vertical-align:bottom}\
th:first-child,td:first-child{text-align:left}thead th{border-bottom:2px solid #888}\
figure{margin:1.2rem 0 2rem}figure svg,figure img{width:100%;height:auto;border:1px solid #e4e4e4}figcaption{color:#444}";

/// How every page of ours starts.
pub(super) const OPENING: &str = "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n<title>";
/// What stands below its heading.
pub(super) const OF: &str = "<p class=\"of\">";

/// The whole page.
pub(super) fn page(report: &ComparisonReport<'_>, frame_files: &[String], plots: &[PlotFile]) -> String {
    let mut out = String::new();
    let title = report.title;
    let heading = escaped(&format!("{}: {}", title.terrain, title.flight));
    let of = format!(
        "Tolerance {} px by {}, picture {} × {} px, heights × {}, culling by {}",
        exact(title.tolerance_px),
        title.metric.name(),
        title.viewport.width_px,
        title.viewport.height_px,
        exact(title.exaggeration),
        title.culling.name()
    );
    begin(&mut out, &heading, &of);
    made(&mut out, title.made.as_ref());
    verdict(&mut out, report);
    engines(&mut out, report);
    picture(&mut out, report.picture);
    sweep(&mut out, "By tolerance", "Tolerance, px", report.tolerance_sweep);
    sweep(&mut out, "By incoherence", "Incoherence, %", report.incoherence_sweep);
    figures(&mut out, plots);
    push(&mut out, format_args!("<h2>Files</h2>\n<ul>\n"));
    for ((engine, _), file) in report.runs.iter().zip(frame_files) {
        let engine = escaped(engine);
        push(&mut out, format_args!("<li><a href=\"{file}\">{file}</a>: every frame of {engine}</li>\n"));
    }
    push(
        &mut out,
        format_args!("<li><a href=\"summary.json\">summary.json</a>: sums, ratios and sweeps</li>\n"),
    );
    push(&mut out, format_args!("</ul>\n</body>\n</html>\n"));
    out
}

/// The page's start, up to what it is of; both texts escaped.
pub(super) fn begin(out: &mut String, heading: &str, of: &str) {
    push(out, format_args!("{OPENING}{heading}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"));
    push(out, format_args!("<h1>{heading}</h1>\n{OF}{of}</p>\n"));
}

/// How the figures were made, if that is said.
pub(super) fn made(out: &mut String, made: Option<&Made>) {
    let Some(made) = made else { return };
    let commit = made.commit.as_ref().map(|commit| format!(", commit {commit}")).unwrap_or_default();
    let by = escaped(&format!("{}{commit}, on {}, {}", made.program, made.machine, made.date));
    push(out, format_args!("<p class=\"of\">Made by {by}:<br><code>{}</code></p>\n", escaped(&made.command)));
}

/// The plots, or why there are none.
pub(super) fn figures(out: &mut String, plots: &[PlotFile]) {
    push(out, format_args!("<h2>Plots</h2>\n"));
    if plots.is_empty() {
        push(
            out,
            format_args!(
                "<p>This program was built without the feature <code>plots</code>; the figures are in the files below.</p>\n"
            ),
        );
    }
    for plot in plots {
        let (caption, svg, png) = (escaped(&plot.caption), &plot.svg, &plot.png);
        push(out, format_args!("<figure>\n{}\n<figcaption>{caption} ", plot.drawing.trim_end()));
        push(
            out,
            format_args!("<a href=\"{svg}\">SVG</a>, <a href=\"{png}\">PNG</a></figcaption>\n</figure>\n"),
        );
    }
}

fn verdict(out: &mut String, report: &ComparisonReport<'_>) {
    let (class, text) = match (report.comparison.same_mesh, report.runs) {
        (_, []) => ("verdict bad", "No engine was flown.".to_owned()),
        (_, [(only, _)]) => ("verdict", format!("One engine, {}: nothing to compare it with.", escaped(only))),
        (true, _) => ("verdict", "All engines drew the same triangles in every frame.".to_owned()),
        (false, _) => (
            "verdict bad",
            "The engines did not draw the same triangles in every frame: their figures are not of equal work."
                .to_owned(),
        ),
    };
    push(out, format_args!("<p class=\"{class}\">{text}</p>\n"));
}

fn picture(out: &mut String, picture: FlightPicture<'_>) {
    push(out, format_args!("<h2>Picture</h2>\n"));
    match picture {
        FlightPicture::Png { caption, .. } => {
            let (name, caption) = (FLIGHT_PICTURE, escaped(caption));
            push(
                out,
                format_args!("<figure>\n<a href=\"{name}\"><img src=\"{name}\" alt=\"{caption}\"></a>\n"),
            );
            push(out, format_args!("<figcaption>{caption}</figcaption>\n</figure>\n"));
        }
        FlightPicture::Missing(why) => push(out, format_args!("<p>None: {}.</p>\n", escaped(why))),
    }
}

fn engines(out: &mut String, report: &ComparisonReport<'_>) {
    let Some(base) = report.comparison.engines.first() else { return };
    let base = escaped(&base.summary.engine);
    push(
        out,
        format_args!(
            "<h2>Engines</h2>\n<p>Ratios are to <b>{base}</b>. Ratios, times and incoherence leave the first frame out. Times are wall-clock times; percentiles are by nearest rank; the incoherence is the mean of the frames' percentages.</p>\n"
        ),
    );
    push(out, format_args!("<div class=\"wide\"><table>\n<thead><tr><th>Engine</th>"));
    for head in [
        "Frames",
        "Triangles a frame",
        "Incoherence, %",
        "Vertex tests",
        "Tests, % of base",
        "Worst frame, %",
        "Speed-up, median",
        "Update p50, ms",
        "p95, ms",
        "p99, ms",
        "Slowest, ms",
        "Pages read",
        "MiB read",
        "Mesh hash",
    ] {
        push(out, format_args!("<th>{head}</th>"));
    }
    push(out, format_args!("</tr></thead>\n<tbody>\n"));
    for engine in &report.comparison.engines {
        let s = &engine.summary;
        push(out, format_args!("<tr><td>{}</td>", escaped(&s.engine)));
        for cell in [
            grouped(s.frames as f64, 0),
            grouped(s.triangles_mean, 0),
            grouped(s.incoherence_percent, 2),
            grouped(s.vertex_tests_total as f64, 0),
            rounded(100.0 * engine.vertex_tests_ratio),
            rounded(100.0 * engine.vertex_tests_ratio_worst_frame),
            rounded(engine.speedup_median),
            grouped(s.update_ms.p50, 3),
            grouped(s.update_ms.p95, 3),
            grouped(s.update_ms.p99, 3),
            grouped(s.update_ms.max, 3),
            grouped(s.pages_touched_total as f64, 0),
            grouped(s.record_bytes_touched_total as f64 / f64::from(1 << 20), 1),
            escaped(&s.mesh_hash),
        ] {
            push(out, format_args!("<td>{cell}</td>"));
        }
        push(out, format_args!("</tr>\n"));
    }
    push(out, format_args!("</tbody>\n</table></div>\n"));
}

fn sweep(out: &mut String, heading: &str, x_name: &str, points: &[SweepPoint]) {
    if points.is_empty() {
        return;
    }
    push(
        out,
        format_args!(
            "<h2>{heading}</h2>\n<div class=\"wide\"><table>\n<thead><tr><th>{x_name}</th><th>Engine</th>"
        ),
    );
    push(
        out,
        format_args!(
            "<th>Speed-up, median</th><th>Tests, % of base</th><th>Frames</th><th>Triangles a frame</th><th>Incoherence, %</th><th>Metres a frame</th></tr></thead>\n<tbody>\n"
        ),
    );
    for p in points {
        let (x, engine) = (exact(p.x), escaped(&p.engine));
        let (speedup, tests) = (rounded(p.speedup_median), rounded(100.0 * p.vertex_tests_ratio));
        push(out, format_args!("<tr><td>{x}</td><td>{engine}</td><td>{speedup}</td><td>{tests}</td>"));
        let speed = p.speed_m_per_frame.map_or("–".into(), rounded);
        let (frames, triangles) = (grouped(p.frames as f64, 0), grouped(p.triangles_mean, 0));
        let incoherence = grouped(p.incoherence_percent, 2);
        push(
            out,
            format_args!(
                "<td>{frames}</td><td>{triangles}</td><td>{incoherence}</td><td>{speed}</td></tr>\n"
            ),
        );
    }
    push(out, format_args!("</tbody>\n</table></div>\n"));
}

pub(super) fn push(out: &mut String, text: std::fmt::Arguments<'_>) {
    // Formatting into a string cannot fail.
    let _ = out.write_fmt(text);
}

/// `text` for use between tags and in quoted attributes.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in terrasoar_layout::printable::line(text).chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// The name that a picture of the flight has in a report.
pub const FLIGHT_PICTURE: &str = "flight.png";

#[cfg(test)]
mod tests {
    use super::super::tests::{made_up_runs, made_up_sweep, title};
    use super::*;
    use terrasoar::stats::Comparison;

    #[test]
    fn names_cannot_break_out_of_their_place() {
        let mut runs = made_up_runs(3);
        runs[1].0 = "<script>alert('x')</script>".into();
        let mut title = title();
        title.terrain = "a & b \"<c>\"".into();
        let mut sweep = made_up_sweep(&[1.0]);
        sweep[0].engine = "<img>".into();
        let report = ComparisonReport {
            title: &title,
            comparison: &Comparison::of(&runs),
            runs: &runs,
            tolerance_sweep: &sweep,
            incoherence_sweep: &[],
            picture: FlightPicture::Png { file: &[], caption: "<i>" },
        };
        let page = page(&report, &["a.csv".into(), "b.csv".into(), "c.csv".into()], &[]);
        assert!(
            !page.contains("<script")
                && !page.contains("<img>")
                && !page.contains("<i>")
                && !page.contains("<c>")
        );
        assert!(page.contains("a &amp; b &quot;&lt;c&gt;&quot;"));
        assert!(page.contains("without the feature"));
        for tag in ["table", "tr", "td", "th", "div", "p", "h2", "ul", "li"] {
            let opened =
                page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
}
