//! Sums of a flight's counts and costs, under the names that reports use.
//!
//! Means, medians and sums leave the first frame out, which starts from nothing. For a flight of one frame they are the figures of that frame. Totals over all
//! frames say so in their names. What was not measured or is not known is `None`.

use super::kernel::Faults;
use super::{FrameIo, PAGE_BYTES, Pooled, Run, Timed, UpdateCost};
use serde::Serialize;
use terrasoar::stats::TimeSpread;
use terrasoar::stream::StreamFrame;
use terrasoar_layout::read::loader::LoaderStats;

/// All figures of a flight, and with what means they were taken.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IoBench {
    /// The terrain's name.
    pub terrain: String,
    /// The flight's name.
    pub flight: String,
    /// Tolerance in pixels.
    pub tolerance_px: f64,
    /// How errors were measured.
    pub metric: String,
    /// Size of the picture, wide and high.
    pub viewport_px: [u32; 2],
    /// Heights were multiplied by this.
    pub exaggeration: f64,
    /// What was left out of view.
    pub culling: String,
    /// Bytes a page.
    pub page_bytes: u64,
    /// The counting run's cache, MiB.
    pub cache_mib: u64,
    /// Pages that the counting run's disk delivers between two frames.
    pub disk_pages_per_frame: u64,
    /// Pace of flights over the pool; 0 for as fast as frames are made.
    pub frames_per_second: f64,
    /// What reads pages into the pool.
    pub reads: String,
    /// How far the frustum is moved back for preloading, in metres.
    pub block_m: f64,
    /// The cap on the program's memory, if it has one.
    pub cap: Option<Cap>,
    /// Why it has none though one was asked for.
    pub cap_note: Option<String>,
    /// Whether the kernel tells of faults and reads here.
    pub kernel_known: bool,
    /// The figures.
    pub runs: Vec<IoRun>,
    /// How they were made, if that is said.
    pub made: Option<crate::made::Made>,
}

/// A cap on memory, page cache included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Cap {
    /// MiB.
    pub mib: u64,
    /// Version of the control group that sets it.
    pub control_group_version: u32,
}

/// Figures of one reader, layout and way of preloading over a flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IoRun {
    /// Engine's name, or `mesh`: all that a frame's mesh needs.
    pub engine: String,
    /// Layout's name.
    pub layout: String,
    /// Where records come from: `map`, the whole file, or `pool`, pages that are read into memory by the time they are needed.
    pub source: String,
    /// Way of preloading.
    pub prefetch: String,
    /// Frames flown.
    pub frames: u64,
    /// Bytes a record.
    pub record_bytes: u64,
    /// Size of a file in this layout, MB.
    pub file_mb: f64,
    /// Records read a frame, every read counted.
    pub reads_per_frame_mean: f64,
    /// Bytes of them.
    pub record_bytes_per_frame_mean: f64,
    /// Distinct 4 KiB pages a frame.
    pub distinct_pages_per_frame_mean: f64,
    /// Distinct 64-byte cache lines a frame; `None` over a pool, where they are not counted.
    pub distinct_lines_per_frame_mean: Option<f64>,
    /// Distinct 64 KiB units a frame; `None` over a pool.
    pub distinct_units_per_frame_mean: Option<f64>,
    /// MB of the distinct pages a frame needs, mean.
    pub needed_mb: f64,
    /// MB of a packed file that the records a frame needs take, whole segments of tiles, mean; `None` for what is not counted over a packed file.
    pub packed_needed_mb: Option<f64>,
    /// Distinct tiles of it a frame.
    pub packed_tiles_per_frame_mean: Option<f64>,
    /// MB of those that were not in the cache when the frame needed them, mean.
    pub realtime_mb: f64,
    /// MB loaded ahead a frame, mean.
    pub preloaded_mb: f64,
    /// The same for the worst frame.
    pub realtime_mb_max: f64,
    /// MB that the first frame needed, all of it in real time.
    pub first_frame_mb: f64,
    /// Pages that a frame needed and that were not there, sum.
    pub late_pages: u64,
    /// Frames that had any such page.
    pub late_frames: u64,
    /// Sum over all frames of the distinct pages of each.
    pub pages_touched_total: u64,
    /// Sum over all frames.
    pub record_bytes_touched_total: u64,
    /// Median time of an update over the mapped file in memory, milliseconds.
    pub update_ms: Option<f64>,
    /// Whether the cold pass was cold: storage delivered at least nine tenths of what the first frame needs. Else the file lies on no disk, or someone else had it mapped
    /// and it could not be dropped from memory.
    pub was_cold: Option<bool>,
    /// Median time of an update with the file cold at the start.
    pub update_ms_cold: Option<f64>,
    /// 99th percentile of an update in memory, milliseconds.
    pub update_ms_p99: Option<f64>,
    /// The same with the file cold at the start.
    pub update_ms_p99_cold: Option<f64>,
    /// 99th percentile of what a frame waited for storage: its cold time beyond its warm one, milliseconds.
    pub io_ms_p99: Option<f64>,
    /// What the first frame waited for storage, milliseconds.
    pub first_frame_io_ms: Option<f64>,
    /// Major faults of the flying thread, cold, sum.
    pub frame_thread_major_faults: Option<u64>,
    /// Minor faults of it, cold, sum.
    pub frame_thread_minor_faults: Option<u64>,
    /// Major faults of the first frame, cold.
    pub first_frame_major_faults: Option<u64>,
    /// MB that storage delivered, cold, sum over all frames.
    pub disk_read_mb_total: Option<f64>,
    /// Most memory the program held during the cold pass, touched pages of the map included, MB.
    pub peak_rss_mb: Option<f64>,
    /// MB of the file that the system held in memory after the cold pass.
    pub resident_mb: Option<f64>,
    /// What streaming did, of runs over a pool.
    pub stream: Option<StreamCost>,
    /// The pages of this run read from a scratch file through a map.
    pub scratch_map: Option<ScratchCost>,
    /// The same by plain reads.
    pub scratch_pread: Option<ScratchCost>,
}

/// What streaming a flight did, cold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StreamCost {
    /// Largest error on the screen that anything late may have left, in pixels; 0 if none exceeded the tolerance.
    pub late_error_px_max: f64,
    /// Pages that came, sum.
    pub pages_come: u64,
    /// Pages asked for, sum.
    pub pages_asked: u64,
    /// Pages that could not be read, sum.
    pub failures: u64,
    /// Largest lead, in frames.
    pub lead_frames_max: f64,
    /// Reads, the first frame's included.
    pub reads: u64,
    /// Mean time of a read, or of a batch of them, milliseconds.
    pub read_ms_mean: f64,
    /// Longest, milliseconds.
    pub read_ms_max: f64,
    /// Tiles of a packed file that were unpacked, the first frame's included; `None` for one that is not packed.
    pub tiles_unpacked: Option<u64>,
    /// MB of them in the file.
    pub tiles_mb: Option<f64>,
    /// Mean time of unpacking one, in a loader's thread, milliseconds.
    pub unpack_ms_mean: Option<f64>,
}

impl StreamCost {
    /// The sums of a flight.
    pub fn of(pooled: &Pooled) -> Self {
        let frames = later(&pooled.frames);
        let sum = |figure: fn(&StreamFrame) -> u64| frames.iter().map(figure).sum::<u64>();
        let most = |figure: fn(&StreamFrame) -> f64| frames.iter().map(figure).fold(0.0, f64::max);
        let LoaderStats { reads, time, longest, .. } = pooled.loader;
        Self {
            late_error_px_max: most(|f| f.work.late_error_px),
            pages_come: sum(|f| f.pages_come),
            pages_asked: sum(|f| f.pages_asked),
            failures: sum(|f| f.failures),
            lead_frames_max: most(|f| f64::from(f.lead_frames)),
            reads,
            read_ms_mean: time.as_secs_f64() * 1e3 / reads.max(1) as f64,
            read_ms_max: longest.as_secs_f64() * 1e3,
            tiles_unpacked: pooled.unpacked.map(|unpacked| unpacked.tiles),
            tiles_mb: pooled.unpacked.map(|unpacked| unpacked.bytes as f64 / 1e6),
            unpack_ms_mean: pooled
                .unpacked
                .map(|unpacked| unpacked.time.as_secs_f64() * 1e3 / unpacked.tiles.max(1) as f64),
        }
    }
}

/// What reading the pages of a flight from a scratch file cost, cold at the start.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScratchCost {
    /// Median time a frame, milliseconds.
    pub frame_ms: f64,
    /// 99th percentile, milliseconds.
    pub frame_ms_p99: f64,
    /// First frame, milliseconds.
    pub first_frame_ms: f64,
    /// Major faults, sum.
    pub major_faults: Option<u64>,
    /// MB that storage delivered, sum over all frames.
    pub disk_read_mb_total: Option<f64>,
}

impl IoRun {
    /// The figures of `run`, its counts alone.
    pub fn of(run: &Run) -> Self {
        let frames = &run.frames;
        let mean = |figure: fn(&FrameIo) -> u64| {
            let later = later(frames);
            later.iter().map(figure).sum::<u64>() as f64 / later.len().max(1) as f64
        };
        let pages_mb = |pages: f64| pages * PAGE_BYTES as f64 / 1e6;
        let realtime = later(frames).iter().map(|f| f.realtime_pages);
        Self {
            engine: run.reader.name().into(),
            layout: run.layout.name().into(),
            source: run.reader.source().into(),
            prefetch: run.preload.name().into(),
            frames: frames.len() as u64,
            record_bytes: run.record_bytes,
            file_mb: run.file_bytes as f64 / 1e6,
            reads_per_frame_mean: mean(|f| f.reads),
            record_bytes_per_frame_mean: mean(|f| f.record_bytes),
            distinct_pages_per_frame_mean: mean(|f| f.pages),
            distinct_lines_per_frame_mean: run.counts_lines().then(|| mean(|f| f.lines)),
            distinct_units_per_frame_mean: run.counts_lines().then(|| mean(|f| f.units)),
            needed_mb: pages_mb(mean(|f| f.pages)),
            packed_needed_mb: run.counts_tiles.then(|| mean(|f| f.tile_bytes) / 1e6),
            packed_tiles_per_frame_mean: run.counts_tiles.then(|| mean(|f| f.tiles)),
            realtime_mb: pages_mb(mean(|f| f.realtime_pages)),
            preloaded_mb: pages_mb(mean(|f| f.preloaded_pages)),
            realtime_mb_max: pages_mb(realtime.clone().max().unwrap_or(0) as f64),
            first_frame_mb: pages_mb(frames.first().map_or(0, |f| f.pages) as f64),
            late_pages: realtime.clone().sum(),
            late_frames: realtime.filter(|pages| *pages > 0).count() as u64,
            pages_touched_total: frames.iter().map(|f| f.pages).sum(),
            record_bytes_touched_total: frames.iter().map(|f| f.record_bytes).sum(),
            update_ms: None,
            was_cold: None,
            update_ms_cold: None,
            update_ms_p99: None,
            update_ms_p99_cold: None,
            resident_mb: None,
            stream: None,
            io_ms_p99: None,
            first_frame_io_ms: None,
            frame_thread_major_faults: None,
            frame_thread_minor_faults: None,
            first_frame_major_faults: None,
            disk_read_mb_total: None,
            peak_rss_mb: None,
            scratch_map: None,
            scratch_pread: None,
        }
    }

    /// With what the flight cost over the mapped file.
    #[must_use]
    pub fn with_times(mut self, timed: &Timed) -> Self {
        let waits: Vec<f64> =
            timed.cold.iter().zip(&timed.warm).map(|(c, w)| (c.ms - w.ms).max(0.0)).collect();
        let spread = |values: &[f64]| TimeSpread::of(later(values).iter().copied());
        let ms = |costs: &[UpdateCost]| costs.iter().map(|c| c.ms).collect::<Vec<f64>>();
        let warm = spread(&ms(&timed.warm));
        (self.update_ms, self.update_ms_p99) = (Some(warm.p50), Some(warm.p99));
        // Without forgetting, nothing was cold.
        if timed.was_forgotten {
            let cold = spread(&ms(&timed.cold));
            (self.update_ms_cold, self.update_ms_p99_cold) = (Some(cold.p50), Some(cold.p99));
            self.io_ms_p99 = Some(spread(&waits).p99);
            self.first_frame_io_ms = waits.first().copied();
            self.frame_thread_major_faults = faults(later(&timed.cold), |f| f.major);
            self.frame_thread_minor_faults = faults(later(&timed.cold), |f| f.minor);
            self.first_frame_major_faults = timed.cold.first().and_then(|c| c.faults).map(|f| f.major);
            self.disk_read_mb_total = read_mb(&timed.cold);
            self.was_cold = self.disk_read_mb_total.map(|mb| mb >= 0.9 * self.first_frame_mb);
        }
        self.resident_mb = timed.resident_bytes.map(|bytes| bytes as f64 / 1e6);
        self.peak_rss_mb = timed.peak_memory_bytes.map(|bytes| bytes as f64 / 1e6);
        self
    }

    /// With what streaming did: threads read between frames as well, so what storage delivered is told for all of the flight.
    #[must_use]
    pub fn with_stream(mut self, pooled: &Pooled) -> Self {
        self.stream = Some(StreamCost::of(pooled));
        self.disk_read_mb_total = pooled.storage_bytes.map(|bytes| bytes as f64 / 1e6);
        self.was_cold = pooled.storage_bytes.map(|bytes| bytes as f64 >= 0.9 * pooled.loader.bytes as f64);
        self
    }
}

impl ScratchCost {
    /// The sums of `costs`, a frame each.
    pub fn of(costs: &[UpdateCost]) -> Self {
        let spread = TimeSpread::of(later(costs).iter().map(|c| c.ms));
        Self {
            frame_ms: spread.p50,
            frame_ms_p99: spread.p99,
            first_frame_ms: costs.first().map_or(0.0, |c| c.ms),
            major_faults: faults(later(costs), |f| f.major),
            disk_read_mb_total: read_mb(costs),
        }
    }
}

/// All but the first, or the only one.
fn later<T>(frames: &[T]) -> &[T] {
    match frames {
        [_, rest @ ..] if !rest.is_empty() => rest,
        _ => frames,
    }
}

fn faults(costs: &[UpdateCost], figure: fn(&Faults) -> u64) -> Option<u64> {
    costs.iter().map(|c| c.faults.as_ref().map(figure)).sum()
}

fn read_mb(costs: &[UpdateCost]) -> Option<f64> {
    let bytes: Option<u64> = costs.iter().map(|c| c.read_bytes).sum();
    bytes.map(|bytes| bytes as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::super::{LayoutKind, Prefetch, Reader};
    use super::*;

    fn run(realtime: &[u64]) -> Run {
        let frame = |(i, realtime): (usize, &u64)| FrameIo {
            frame: i as u64,
            reads: 100,
            record_bytes: 400,
            pages: 10,
            lines: 50,
            units: 4,
            realtime_pages: *realtime,
            preloaded_pages: 1,
            tiles: 3,
            tile_bytes: 2_000,
        };
        Run {
            reader: Reader::Mesh,
            layout: LayoutKind::Ours,
            preload: Prefetch::None,
            record_bytes: 4,
            file_bytes: 1_000_000,
            counts_tiles: true,
            frames: realtime.iter().enumerate().map(frame).collect(),
            trace: None,
        }
    }

    #[test]
    fn the_first_frame_is_left_out_of_means() {
        let sums = IoRun::of(&run(&[10, 0, 4, 2]));
        assert_eq!((sums.late_pages, sums.late_frames), (6, 2));
        assert_eq!(sums.realtime_mb, 2.0 * 4096.0 / 1e6);
        assert_eq!((sums.packed_needed_mb, sums.packed_tiles_per_frame_mean), (Some(0.002), Some(3.0)));
        let plain = Run { counts_tiles: false, ..run(&[10, 0, 4, 2]) };
        assert_eq!(IoRun::of(&plain).packed_needed_mb, None);
        assert_eq!(sums.realtime_mb_max, 4.0 * 4096.0 / 1e6);
        assert_eq!(sums.first_frame_mb, 10.0 * 4096.0 / 1e6);
        assert_eq!((sums.pages_touched_total, sums.record_bytes_touched_total), (40, 1600));
        assert_eq!(IoRun::of(&run(&[10])).late_pages, 10);
        assert_eq!(IoRun::of(&run(&[])).needed_mb, 0.0);
    }

    #[test]
    fn what_is_not_known_is_not_0() {
        let cost = |ms, major: Option<u64>| UpdateCost {
            ms,
            faults: major.map(|major| Faults { minor: 1, major }),
            read_bytes: major.map(|m| m * 4096),
        };
        let known = Timed {
            was_forgotten: true,
            cold: vec![cost(50.0, Some(9)), cost(3.0, Some(2)), cost(1.0, Some(0))],
            warm: vec![cost(5.0, Some(0)), cost(1.0, Some(0)), cost(2.0, Some(0))],
            peak_memory_bytes: None,
            resident_bytes: None,
        };
        let sums = IoRun::of(&run(&[1, 1, 1])).with_times(&known);
        assert_eq!((sums.io_ms_p99, sums.first_frame_io_ms), (Some(2.0), Some(45.0)));
        assert_eq!((sums.frame_thread_major_faults, sums.first_frame_major_faults), (Some(2), Some(9)));
        assert_eq!(sums.disk_read_mb_total, Some(11.0 * 4096.0 / 1e6));
        assert_eq!((sums.peak_rss_mb, sums.was_cold), (None, Some(true)));
        let held = UpdateCost { read_bytes: Some(0), ..cost(1.0, Some(0)) };
        let held = Timed { cold: vec![held; 3], ..known.clone() };
        assert_eq!(IoRun::of(&run(&[1, 1, 1])).with_times(&held).was_cold, Some(false));
        let unknown = Timed { cold: vec![cost(3.0, None); 2], was_forgotten: true, ..known.clone() };
        assert_eq!(IoRun::of(&run(&[1])).with_times(&unknown).frame_thread_major_faults, None);
        let warm_only = Timed { was_forgotten: false, ..known };
        let sums = IoRun::of(&run(&[1])).with_times(&warm_only);
        assert_eq!((sums.io_ms_p99, sums.update_ms), (None, Some(1.0)));
        assert_eq!(ScratchCost::of(&[cost(7.0, Some(3)), cost(1.0, None)]).major_faults, None);
    }
}
