//! What `iobench` prints: a line a run, and under it what flights over a pool did and what other layouts cost.

use crate::verbs::output::{columns, grouped};
use terrasoar_lab::iobench::{IoBench, IoRun};

pub(super) fn text(bench: &IoBench) -> String {
    let known = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    let mut rows = vec![
        [
            "engine",
            "layout",
            "source",
            "prefetch",
            "pages",
            "lines",
            "record KB",
            "needed MB",
            "realtime MB",
            "late pages, sum",
            "update ms",
            "p99",
            "cold ms",
            "cold p99",
            "io ms p99",
            "major faults, sum",
        ]
        .map(str::to_owned)
        .to_vec(),
    ];
    for r in &bench.runs {
        rows.push(vec![
            r.engine.clone(),
            r.layout.clone(),
            r.source.clone(),
            r.prefetch.clone(),
            format!("{:.1}", r.distinct_pages_per_frame_mean),
            r.distinct_lines_per_frame_mean.map_or_else(|| "-".to_owned(), |lines| format!("{lines:.0}")),
            format!("{:.1}", r.record_bytes_per_frame_mean / 1e3),
            format!("{:.3}", r.needed_mb),
            format!("{:.4}", r.realtime_mb),
            grouped(r.late_pages),
            known(r.update_ms),
            known(r.update_ms_p99),
            known(r.update_ms_cold),
            known(r.update_ms_p99_cold),
            known(r.io_ms_p99),
            r.frame_thread_major_faults.map_or("-".to_owned(), grouped),
        ]);
    }
    let frames = bench.runs.first().map_or(0, |r| r.frames);
    let mut out = format!(
        "{}, {}, {} frames; means of a frame but for what is called a sum, the first frame left out; cache {} MiB\n",
        bench.terrain,
        bench.flight,
        grouped(frames),
        bench.cache_mib
    );
    out += &columns(&rows);
    if bench.runs.iter().any(|r| r.scratch_map.is_some()) {
        out += &scratch_text(bench);
    }
    out += &stream_text(bench);
    out += &packed_text(bench);
    out += &fitting_text(bench);
    if bench.runs.iter().any(|r| r.was_cold == Some(false)) {
        out += "the file was not cold: it lies on no disk, or another program has it mapped; cold figures are of a file in memory\n";
    }
    if let Some(cap) = bench.cap {
        out += &format!(
            "memory capped at {} MiB, page cache included (control group version {})\n",
            cap.mib, cap.control_group_version
        );
    }
    if let Some(note) = &bench.cap_note {
        out += &format!("memory not capped: {note}\n");
    }
    if !bench.kernel_known {
        out += "page faults and bytes read are not known on this system\n";
    }
    out
}

/// Which layouts fit into the cache whole.
fn fitting_text(bench: &IoBench) -> String {
    let cache_mb = bench.cache_mib as f64 * f64::from(1 << 20) / 1e6;
    let mut fitting: Vec<&str> = Vec::new();
    for run in bench.runs.iter().filter(|run| run.file_mb <= cache_mb) {
        if !fitting.contains(&run.layout.as_str()) {
            fitting.push(&run.layout);
        }
    }
    if fitting.is_empty() {
        return String::new();
    }
    format!(
        "the whole file fits into the cache ({}): each page is read once at most, and the flight is not out of core; --cache makes the cache smaller\n",
        fitting.join(", ")
    )
}

/// What flights over a pool did, if there are any.
fn stream_text(bench: &IoBench) -> String {
    let heads = [
        "prefetch",
        "late pages",
        "late error px",
        "asked",
        "come",
        "lead",
        "reads",
        "ms a read",
        "longest",
        "peak MB",
    ];
    let row = |r: &IoRun| {
        let s = r.stream.as_ref()?;
        Some(vec![
            r.prefetch.clone(),
            grouped(r.late_pages),
            format!("{:.2}", s.late_error_px_max),
            grouped(s.pages_asked),
            grouped(s.pages_come),
            format!("{:.0}", s.lead_frames_max),
            grouped(s.reads),
            format!("{:.3}", s.read_ms_mean),
            format!("{:.1}", s.read_ms_max),
            r.peak_rss_mb.map_or("-".to_owned(), |mb| format!("{mb:.0}")),
        ])
    };
    let rows: Vec<Vec<String>> = bench.runs.iter().filter_map(row).collect();
    if rows.is_empty() {
        return String::new();
    }
    let pace = if bench.frames_per_second > 0.0 {
        format!("{} frames a second", bench.frames_per_second)
    } else {
        "as fast as frames are made".to_owned()
    };
    let head = heads.map(str::to_owned).to_vec();
    format!(
        "over the pool, {pace}, read by {}; cold, sums and largest of all frames but the first\n{}",
        bench.reads,
        columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>())
    )
}

/// What a packed file takes to be read, if it is one.
fn packed_text(bench: &IoBench) -> String {
    let counted = bench.runs.iter().filter_map(|r| {
        let (mb, tiles) = (r.packed_needed_mb?, r.packed_tiles_per_frame_mean?);
        let share = mb / r.needed_mb.max(f64::MIN_POSITIVE);
        Some(format!(
            "  {} needs {tiles:.1} tiles, {mb:.3} MB a frame, {share:.2} of its pages unpacked\n",
            r.engine
        ))
    });
    let flown = bench.runs.iter().filter_map(|r| {
        let s = r.stream.as_ref()?;
        let (tiles, mb, ms) = (s.tiles_unpacked?, s.tiles_mb?, s.unpack_ms_mean?);
        Some(format!(
            "  {} over the pool, preloading {}: {} tiles of {mb:.2} MB were unpacked in all, {ms:.3} ms each\n",
            r.engine,
            r.prefetch,
            grouped(tiles)
        ))
    });
    let lines: Vec<String> = counted.chain(flown).collect();
    if lines.is_empty() { String::new() } else { format!("the file is packed\n{}", lines.concat()) }
}

fn scratch_text(bench: &IoBench) -> String {
    let heads = [
        "engine",
        "layout",
        "read by",
        "ms",
        "ms p99",
        "first frame ms",
        "major faults",
        "disk MB",
        "file MB",
    ];
    let mut rows = vec![heads.map(str::to_owned).to_vec()];
    for r in &bench.runs {
        for (how, cost) in [("map", r.scratch_map), ("pread", r.scratch_pread)] {
            rows.extend(cost.map(|c| {
                vec![
                    r.engine.clone(),
                    r.layout.clone(),
                    how.to_owned(),
                    format!("{:.3}", c.frame_ms),
                    format!("{:.3}", c.frame_ms_p99),
                    format!("{:.1}", c.first_frame_ms),
                    c.major_faults.map_or("-".to_owned(), grouped),
                    c.disk_read_mb_total.map_or("-".to_owned(), |v| format!("{v:.1}")),
                    format!("{:.0}", r.file_mb),
                ]
            }));
        }
    }
    format!("pages replayed against a scratch file, cold at the start\n{}", columns(&rows))
}
