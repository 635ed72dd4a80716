//! The page of a measurement of reading: two tables, what is needed and what it cost, and the plots.

use crate::iobench::{IoBench, IoRun};
use crate::report::PlotFile;
use crate::report::html::{begin, escaped, figures, made, push};
use crate::report::number::{exact, grouped, rounded};

/// The whole page.
pub(crate) fn page(bench: &IoBench, plots: &[PlotFile]) -> String {
    let mut out = String::new();
    let [wide, high] = bench.viewport_px;
    let of = format!(
        "Tolerance {} px by {}, picture {wide} × {high} px, cache {} MiB, disk {} pages between frames",
        exact(bench.tolerance_px),
        bench.metric,
        bench.cache_mib,
        bench.disk_pages_per_frame
    );
    begin(&mut out, &escaped(&format!("Reading: {}, {}", bench.terrain, bench.flight)), &of);
    made(&mut out, bench.made.as_ref());
    let cap = match (bench.cap, &bench.cap_note) {
        (Some(cap), _) => format!(
            "Measured with memory capped at {} MiB, page cache included (control group version {}).",
            cap.mib, cap.control_group_version
        ),
        (None, Some(note)) => format!("Measured without a cap on memory: {}.", escaped(note)),
        (None, None) => "Measured without a cap on memory.".into(),
    };
    push(
        &mut out,
        format_args!("<p>{cap} Figures leave the first frame out; a MB is 10<sup>6</sup> bytes.</p>\n"),
    );
    needed(&mut out, &bench.runs);
    measured(&mut out, bench);
    streamed(&mut out, bench);
    figures(&mut out, plots);
    push(
        &mut out,
        format_args!(
            "<h2>Files</h2>\n<ul>\n<li><a href=\"frames.csv\">frames.csv</a>: every frame</li>\n\
<li><a href=\"summary.json\">summary.json</a>: sums</li>\n</ul>\n</body>\n</html>\n"
        ),
    );
    out
}

fn table(out: &mut String, heads: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    push(out, format_args!("<div class=\"wide\"><table>\n<thead><tr>"));
    heads.iter().for_each(|head| push(out, format_args!("<th>{head}</th>")));
    push(out, format_args!("</tr></thead>\n<tbody>\n"));
    for row in rows {
        push(out, format_args!("<tr>"));
        row.iter().for_each(|cell| push(out, format_args!("<td>{}</td>", escaped(cell))));
        push(out, format_args!("</tr>\n"));
    }
    push(out, format_args!("</tbody>\n</table></div>\n"));
}

fn needed(out: &mut String, runs: &[IoRun]) {
    push(
        out,
        format_args!(
            "<h2>Needed</h2>\n<p>Counted, a frame. <b>mesh</b> is all that a frame's mesh needs, whoever has it in memory already.</p>\n"
        ),
    );
    let heads = [
        "Engine",
        "Layout",
        "From",
        "Preloading",
        "File, MB",
        "Records",
        "Record bytes",
        "64 B lines",
        "4 KiB pages",
        "64 KiB units",
        "Needed, MB",
        "In real time, MB",
        "Worst, MB",
        "Preloaded, MB",
        "Late pages, sum",
    ];
    let row = |r: &IoRun| {
        let counted =
            |value: Option<f64>, decimals| value.map_or_else(|| "–".into(), |v| grouped(v, decimals));
        vec![
            r.engine.clone(),
            r.layout.clone(),
            r.source.clone(),
            r.prefetch.clone(),
            grouped(r.file_mb, 0),
            grouped(r.reads_per_frame_mean, 0),
            grouped(r.record_bytes_per_frame_mean, 0),
            counted(r.distinct_lines_per_frame_mean, 0),
            grouped(r.distinct_pages_per_frame_mean, 1),
            counted(r.distinct_units_per_frame_mean, 1),
            rounded(r.needed_mb),
            rounded(r.realtime_mb),
            rounded(r.realtime_mb_max),
            rounded(r.preloaded_mb),
            grouped(r.late_pages as f64, 0),
        ]
    };
    table(out, &heads, runs.iter().map(row));
}

fn measured(out: &mut String, bench: &IoBench) {
    push(out, format_args!("<h2>Measured</h2>\n"));
    if !bench.kernel_known {
        push(
            out,
            format_args!("<p>This system does not tell of page faults and reads: they are not known.</p>\n"),
        );
    }
    if bench.runs.iter().any(|r| r.was_cold == Some(false)) {
        push(
            out,
            format_args!(
                "<p>The file was not cold: it lies on no disk, or another program has it mapped. Cold figures are of a file in memory.</p>\n"
            ),
        );
    }
    let known = |value: Option<f64>, decimals| value.map_or("–".to_owned(), |v| grouped(v, decimals));
    let mut rows = Vec::new();
    for r in &bench.runs {
        if r.update_ms.is_some() {
            let count = |v: Option<u64>| known(v.map(|v| v as f64), 0);
            rows.push(vec![
                r.engine.clone(),
                r.layout.clone(),
                if r.source == "pool" {
                    format!("engine over a pool, {}", r.prefetch)
                } else {
                    "engine over the map".into()
                },
                known(r.update_ms, 3),
                known(r.update_ms_p99, 3),
                known(r.update_ms_cold, 3),
                known(r.update_ms_p99_cold, 3),
                known(r.io_ms_p99, 3),
                known(r.first_frame_io_ms, 1),
                count(r.frame_thread_major_faults),
                known(r.disk_read_mb_total, 1),
                known(r.peak_rss_mb, 1),
            ]);
        }
        for (how, cost) in [("pages by map", r.scratch_map), ("pages by read", r.scratch_pread)] {
            rows.extend(cost.map(|c| {
                vec![
                    r.engine.clone(),
                    r.layout.clone(),
                    how.into(),
                    "–".into(),
                    "–".into(),
                    grouped(c.frame_ms, 3),
                    grouped(c.frame_ms_p99, 3),
                    "–".into(),
                    grouped(c.first_frame_ms, 1),
                    known(c.major_faults.map(|v| v as f64), 0),
                    known(c.disk_read_mb_total, 1),
                    "–".into(),
                ]
            }));
        }
    }
    let heads = [
        "Engine",
        "Layout",
        "What",
        "Warm, ms a frame",
        "Warm p99, ms",
        "Cold, ms a frame",
        "Cold p99, ms",
        "Waiting p99, ms",
        "First frame waits, ms",
        "Major faults, sum",
        "Read, MB",
        "Peak memory, MB",
    ];
    table(out, &heads, rows.into_iter());
}

/// What flights over a pool did, if there are any.
fn streamed(out: &mut String, bench: &IoBench) {
    let row = |r: &IoRun| {
        let s = r.stream.as_ref()?;
        Some(vec![
            r.prefetch.clone(),
            grouped(r.late_pages as f64, 0),
            grouped(s.late_error_px_max, 2),
            grouped(s.pages_asked as f64, 0),
            grouped(s.pages_come as f64, 0),
            grouped(s.lead_frames_max, 0),
            grouped(s.reads as f64, 0),
            grouped(s.read_ms_mean, 3),
            grouped(s.read_ms_max, 1),
        ])
    };
    let rows: Vec<Vec<String>> = bench.runs.iter().filter_map(row).collect();
    if rows.is_empty() {
        return;
    }
    let pace = if bench.frames_per_second > 0.0 {
        format!("{} frames a second", exact(bench.frames_per_second))
    } else {
        "as fast as frames are made".into()
    };
    push(
        out,
        format_args!(
            "<h2>Streamed</h2>\n<p>Kinetic over pages that are read into {} MiB, {pace}, by {}; cold. No frame waits: what is late is drawn coarse.</p>\n",
            bench.cache_mib,
            escaped(&bench.reads)
        ),
    );
    let heads = [
        "Preloading",
        "Late pages, sum",
        "Largest late error, px",
        "Asked for, sum",
        "Come, sum",
        "Largest lead, frames",
        "Reads",
        "A read, ms",
        "Longest, ms",
    ];
    table(out, &heads, rows.into_iter());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::io::tests::made_up;

    #[test]
    fn the_page_is_whole_and_names_stay_in_their_place() {
        let (mut bench, _) = made_up();
        bench.cap = None;
        bench.cap_note = Some("no <rights>".into());
        bench.kernel_known = false;
        let page = page(&bench, &[]);
        assert!(page.contains("a &amp; b &lt;c&gt;") && page.contains("no &lt;rights&gt;"));
        assert!(page.contains("not known") && !page.contains("<c>"));
        for tag in ["table", "tr", "td", "th", "div", "p", "h2", "ul", "li"] {
            let opened =
                page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
}
