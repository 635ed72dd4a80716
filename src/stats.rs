//! What a frame cost, and what a flight cost as a whole: plain figures, under the names that reports use.

use serde::Serialize;

/// Figures of one frame of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct FrameStats {
    /// Frame number, from 0.
    pub frame: u64,
    /// Triangles drawn.
    pub triangles: u64,
    /// Triangles drawn that the frame before did not draw; all of them in frame 0.
    pub new_triangles: u64,
    /// Vertex tests: evaluations of a vertex's error or culling test, or both at once.
    pub vertex_tests: u64,
    /// Bin-tree nodes that were split in this frame and not in the one before.
    pub splits: u64,
    /// Bin-tree nodes that were split in the frame before and are no longer.
    pub merges: u64,
    /// Live ranges that were over; `None` for engines that keep none in a queue.
    pub expired: Option<u64>,
    /// Triangle slots written; `None` for engines that keep no slots.
    pub slots_written: Option<u64>,
    /// Bytes of vertices and triangles that a GPU receives; `None` for engines that make no patches.
    pub patch_bytes: Option<u64>,
    /// Vertices left for later frames for want of budget.
    pub late: u64,
    /// Largest error on the screen that they leave, in pixels; 0 if none exceeds the tolerance.
    pub late_error_px: f64,
    /// Distinct 4 KiB record pages read.
    pub pages_touched: u64,
    /// Bytes of records read, every read counted.
    pub record_bytes_touched: u64,
    /// Pages that were read for the update, each as often as it was; this and the next four are `None` for records that lie in memory or are mapped.
    pub pages_read: Option<u64>,
    /// Of packed terrain, tiles that were unpacked for it, each as often as it was; `None` for terrain that is not packed, as are the next and the last of these.
    pub tiles_unpacked: Option<u64>,
    /// Bytes of these tiles in the file.
    pub tile_bytes_read: Option<u64>,
    /// Time that the update waited for pages, in milliseconds; over all threads, where the first frame or one after a jump is made by several.
    pub read_ms: Option<f64>,
    /// The part of it spent on unpacking tiles.
    pub unpack_ms: Option<f64>,
    /// Time the mesh update took, in milliseconds. Times are the only figures that differ between two replays.
    pub update_ms: f64,
    /// The part of it spent on finding what is over, in microseconds; this and the next two are `None` for engines without such parts.
    pub scan_us: Option<f64>,
    /// The part of it spent on testing, in microseconds.
    pub test_us: Option<f64>,
    /// The part of it spent on splitting, merging and telling, in microseconds.
    pub apply_us: Option<f64>,
    /// Records that edits changed before this frame.
    pub edited_records: u64,
    /// Time these edits took before the update, in milliseconds; that in which the engine hears of them is part of the update's.
    pub edit_ms: f64,
    /// Hash of the set of triangles drawn, independent of their order.
    pub mesh_hash: u64,
}

/// Spread of the update times of a flight, in milliseconds, the first frame left out.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct TimeSpread {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Slowest frame.
    pub max: f64,
    /// Arithmetic mean.
    pub mean: f64,
}

/// Figures of one engine over a whole flight.
///
/// **What is called a total is the sum of a column over all frames, the first included,** which makes the whole mesh from nothing. Incoherence, times and ratios leave the first
/// frame out. `None` where a figure does not apply to an engine, or where there is no frame to take it from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReplaySummary {
    /// Engine's name.
    pub engine: String,
    /// Frames flown.
    pub frames: u64,
    /// Triangles drawn a frame, averaged over all frames.
    pub triangles_mean: f64,
    /// Triangles of a frame that the frame before did not have, in percent of the frame's, averaged over all
    /// frames but the first.
    pub incoherence_percent: f64,
    /// Sum over all frames.
    pub vertex_tests_total: u64,
    /// Sum over all frames.
    pub splits_total: u64,
    /// Sum over all frames.
    pub merges_total: u64,
    /// Sum over all frames; `None` for engines that keep no live ranges in a queue.
    pub expired_total: Option<u64>,
    /// Sum over all frames; `None` for engines that keep no slots.
    pub slots_written_total: Option<u64>,
    /// Sum over all frames; `None` for engines that make no patches.
    pub patch_bytes_total: Option<u64>,
    /// Sum over all frames.
    pub late_total: u64,
    /// Largest of all frames, in pixels.
    pub late_error_px_max: f64,
    /// Spread of the update times.
    pub update_ms: TimeSpread,
    /// Median over all frames but the first, in microseconds; this and the next two are `None` for engines without such parts.
    pub scan_us_p50: Option<f64>,
    /// Median, in microseconds.
    pub test_us_p50: Option<f64>,
    /// Median, in microseconds.
    pub apply_us_p50: Option<f64>,
    /// Sum over all frames.
    pub edited_records_total: u64,
    /// Longest of all frames, in milliseconds.
    pub edit_ms_max: f64,
    /// Hash over all frames, 16 hexadecimal digits.
    pub mesh_hash: String,
    /// Sum over all frames of the distinct pages of each.
    pub pages_touched_total: u64,
    /// Sum over all frames.
    pub record_bytes_touched_total: u64,
    /// Sum over all frames; this and the next four are `None` as those of [`FrameStats`] are.
    pub pages_read_total: Option<u64>,
    /// Sum over all frames.
    pub tiles_unpacked_total: Option<u64>,
    /// Sum over all frames.
    pub tile_bytes_read_total: Option<u64>,
    /// Sum over all frames, in milliseconds.
    pub read_ms_total: Option<f64>,
    /// Sum over all frames, in milliseconds.
    pub unpack_ms_total: Option<f64>,
}

/// One engine of a comparison: its figures and their ratio to the first engine named, first frame left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EngineComparison {
    /// The engine's own figures.
    #[serde(flatten)]
    pub summary: ReplaySummary,
    /// Vertex tests of all frames but the first, over the first engine's.
    pub vertex_tests_ratio: f64,
    /// The largest such ratio of a single frame but the first.
    pub vertex_tests_ratio_worst_frame: f64,
    /// Median over all frames but the first of the first engine's time over this one's.
    pub speedup_median: f64,
}

/// A comparison of engines on one flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Whether all engines drew the same triangles in every frame.
    pub same_mesh: bool,
    /// The engines in the order named.
    pub engines: Vec<EngineComparison>,
}

/// The value below which the fraction `q` of `sorted` lies (nearest rank); 0 for no values.
fn percentile(sorted: &[f64], q: f64) -> f64 {
    let rank = (q * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or(0.0)
}

/// Median of `values`, which it sorts; 0 for no values.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    percentile(values, 0.5)
}

impl TimeSpread {
    /// The spread of `times_ms`.
    pub fn of(times_ms: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = times_ms.collect();
        sorted.sort_unstable_by(f64::total_cmp);
        Self {
            p50: percentile(&sorted, 0.5),
            p95: percentile(&sorted, 0.95),
            p99: percentile(&sorted, 0.99),
            max: sorted.last().copied().unwrap_or(0.0),
            mean: sorted.iter().sum::<f64>() / (sorted.len().max(1) as f64),
        }
    }
}

impl ReplaySummary {
    /// The sums of `frames`, flown by `engine`.
    pub fn of(engine: &str, frames: &[FrameStats]) -> Self {
        let later = frames.get(1..).unwrap_or_default();
        let sum = |f: fn(&FrameStats) -> u64| frames.iter().map(f).sum::<u64>();
        let median_of = |f: fn(&FrameStats) -> Option<f64>| {
            let mut values: Vec<f64> = later.iter().filter_map(f).collect();
            (!values.is_empty()).then(|| median(&mut values))
        };
        let mean = |total: f64, count: usize| total / (count.max(1) as f64);
        let incoherence =
            later.iter().map(|f| 100.0 * f.new_triangles as f64 / (f.triangles.max(1) as f64)).sum();
        // FNV-1a over the frames' hashes: the order of frames counts, that of triangles within one does not.
        let hash = frames.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, f| {
            (hash ^ f.mesh_hash).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(23)
        });
        Self {
            engine: engine.to_owned(),
            frames: frames.len() as u64,
            triangles_mean: mean(sum(|f| f.triangles) as f64, frames.len()),
            incoherence_percent: mean(incoherence, later.len()),
            vertex_tests_total: sum(|f| f.vertex_tests),
            splits_total: sum(|f| f.splits),
            merges_total: sum(|f| f.merges),
            // A sum of nothing but `None` is none.
            expired_total: frames.iter().map(|f| f.expired).sum(),
            slots_written_total: frames.iter().map(|f| f.slots_written).sum(),
            patch_bytes_total: frames.iter().map(|f| f.patch_bytes).sum(),
            late_total: sum(|f| f.late),
            late_error_px_max: frames.iter().map(|f| f.late_error_px).fold(0.0, f64::max),
            update_ms: TimeSpread::of(later.iter().map(|f| f.update_ms)),
            scan_us_p50: median_of(|f| f.scan_us),
            test_us_p50: median_of(|f| f.test_us),
            apply_us_p50: median_of(|f| f.apply_us),
            edited_records_total: frames.iter().map(|f| f.edited_records).sum(),
            edit_ms_max: frames.iter().map(|f| f.edit_ms).fold(0.0, f64::max),
            mesh_hash: format!("{hash:016x}"),
            pages_touched_total: sum(|f| f.pages_touched),
            record_bytes_touched_total: sum(|f| f.record_bytes_touched),
            pages_read_total: frames.iter().map(|f| f.pages_read).sum(),
            tiles_unpacked_total: frames.iter().map(|f| f.tiles_unpacked).sum(),
            tile_bytes_read_total: frames.iter().map(|f| f.tile_bytes_read).sum(),
            read_ms_total: frames.iter().map(|f| f.read_ms).sum(),
            unpack_ms_total: frames.iter().map(|f| f.unpack_ms).sum(),
        }
    }
}

impl Comparison {
    /// Compares replays of the same flight, each an engine's name and its frames, against the first.
    pub fn of(runs: &[(String, Vec<FrameStats>)]) -> Self {
        let Some((_, base)) = runs.first() else { return Self { same_mesh: true, engines: Vec::new() } };
        let hashes = |frames: &[FrameStats]| frames.iter().map(|f| f.mesh_hash).collect::<Vec<_>>();
        let engines = runs
            .iter()
            .map(|(engine, frames)| {
                let pairs = || base.iter().zip(frames).skip(1);
                let tests = |f: &FrameStats| f.vertex_tests as f64;
                let mut speedups: Vec<f64> =
                    pairs().map(|(b, f)| b.update_ms / f.update_ms.max(1e-6)).collect();
                EngineComparison {
                    summary: ReplaySummary::of(engine, frames),
                    vertex_tests_ratio: pairs().map(|(_, f)| tests(f)).sum::<f64>()
                        / pairs().map(|(b, _)| tests(b)).sum::<f64>().max(1.0),
                    vertex_tests_ratio_worst_frame: pairs()
                        .map(|(b, f)| tests(f) / tests(b).max(1.0))
                        .fold(0.0, f64::max),
                    speedup_median: median(&mut speedups),
                }
            })
            .collect();
        Self { same_mesh: runs.iter().all(|(_, frames)| hashes(frames) == hashes(base)), engines }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(tests: &[u64], times: &[f64], hash: u64) -> Vec<FrameStats> {
        tests
            .iter()
            .zip(times)
            .enumerate()
            .map(|(i, (tests, ms))| FrameStats {
                frame: i as u64,
                triangles: 200,
                new_triangles: if i == 0 { 200 } else { 4 },
                vertex_tests: *tests,
                update_ms: *ms,
                mesh_hash: hash + i as u64,
                ..Default::default()
            })
            .collect()
    }

    #[test]
    fn the_first_frame_is_left_out_of_ratios() {
        let a = frames(&[400, 400, 400], &[9.0, 2.0, 4.0], 7);
        let b = frames(&[400, 4, 40], &[9.0, 1.0, 1.0], 7);
        let c = Comparison::of(&[("a".into(), a.clone()), ("b".into(), b)]);
        assert!(c.same_mesh);
        assert_eq!(c.engines[1].vertex_tests_ratio, 44.0 / 800.0);
        assert_eq!(c.engines[1].vertex_tests_ratio_worst_frame, 0.1);
        assert_eq!(c.engines[1].speedup_median, 2.0);
        assert_eq!(c.engines[0].summary.incoherence_percent, 2.0);
        assert_eq!(c.engines[0].summary.update_ms.max, 4.0);
        assert!(
            !Comparison::of(&[("a".into(), a.clone()), ("b".into(), frames(&[1, 1, 1], &[1.0; 3], 8))])
                .same_mesh
        );
    }

    #[test]
    fn totals_count_every_frame_and_say_where_there_is_nothing_to_count() {
        let mut frames = frames(&[400, 4, 40], &[9.0, 1.0, 1.0], 7);
        frames.iter_mut().zip(1..).for_each(|(f, i)| f.splits = 10 * i);
        let plain = ReplaySummary::of("soar", &frames);
        assert_eq!((plain.vertex_tests_total, plain.splits_total), (444, 60));
        assert_eq!((plain.expired_total, plain.patch_bytes_total, plain.scan_us_p50), (None, None, None));
        frames.iter_mut().zip(1..).for_each(|(f, i)| {
            f.expired = Some(i);
            f.scan_us = Some(i as f64);
        });
        let queued = ReplaySummary::of("kinetic", &frames);
        assert_eq!((queued.expired_total, queued.scan_us_p50), (Some(6), Some(2.0)));
    }

    #[test]
    fn percentiles_use_the_nearest_rank() {
        let spread = TimeSpread::of((1..=100).map(f64::from));
        assert_eq!((spread.p50, spread.p95, spread.p99, spread.max), (50.0, 95.0, 99.0, 100.0));
        assert_eq!(TimeSpread::of(std::iter::empty()).p99, 0.0);
    }
}
