//! The two passes of a replay: one timed, one counted.

use super::edits::Ground;
use super::sets::{FrameSets, not_in};
use super::{Quality, ReplayError};
use crate::flight::FlightFrame;
use crate::refine::{Engine, Phase, Probe};
use crate::stats::FrameStats;
use std::time::Instant;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::store::{CompleteStore, PagesRead, RecordStore, page_of};

/// Times of one frame.
pub(super) struct FrameTimes {
    pub(super) update_ms: f64,
    /// Scan, test, apply.
    pub(super) phases_us: [f64; 3],
    pub(super) edit_ms: f64,
    /// What reading took of the update.
    pub(super) read: Option<PagesRead>,
}

/// Reads the clock at the seams of an update.
struct PhaseTimer {
    since: Instant,
    /// Scan, test, apply.
    phase: usize,
    phases_us: [f64; 3],
}

impl Probe for PhaseTimer {
    const HEARS_READS: bool = false;

    fn phase(&mut self, phase: Phase) {
        let now = Instant::now();
        if let Some(spent) = self.phases_us.get_mut(self.phase) {
            *spent += (now - self.since).as_secs_f64() * 1e6;
        }
        self.since = now;
        self.phase = phase as usize;
    }
}

/// Flies and times.
pub(super) fn time_updates<E: Engine>(
    mut engine: E,
    ground: &mut dyn Ground<E>,
    frames: &[FlightFrame],
    quality: Quality,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<FrameTimes>, ReplayError>
where
    E::Store: CompleteStore,
{
    let mut times = Vec::with_capacity(frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let view = quality.view(frame);
        let edit_ms = ground.edit(i)?.edit_ms;
        let before = engine.store_mut().read_so_far();
        let start = Instant::now();
        ground.tell(&mut engine)?;
        let mut timer = PhaseTimer { since: start, phase: Phase::Done as usize, phases_us: [0.0; 3] };
        engine.update(&view, &mut timer);
        let update_ms = start.elapsed().as_secs_f64() * 1e3;
        let read = read_since(&mut engine, before)?;
        times.push(FrameTimes { update_ms, phases_us: timer.phases_us, edit_ms, read });
        done(i as u64 + 1);
    }
    Ok(times)
}

/// What an engine's store has read since `before`.
///
/// # Errors
/// What it could not read: the engine's mesh is not to be used then.
fn read_since<E: Engine>(engine: &mut E, before: Option<PagesRead>) -> Result<Option<PagesRead>, ReplayError>
where
    E::Store: CompleteStore,
{
    let store = engine.store_mut();
    let now = store.read_so_far();
    match store.take_error() {
        Some(error) => Err(error.into()),
        None => Ok(now.zip(before).map(|(now, before)| now.since(before))),
    }
}

/// Flies and counts. `records` tell which triangles are drawn.
pub(super) fn count_frames<E: Engine>(
    mut engine: E,
    ground: &mut dyn Ground<E>,
    records: &impl CompleteStore,
    frames: &[FlightFrame],
    quality: Quality,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<FrameStats>, ReplayError>
where
    E::Store: CompleteStore,
{
    let mut before = FrameSets::default();
    let mut stats = Vec::with_capacity(frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let edited_records = ground.edit(i)?.records;
        ground.tell(&mut engine)?;
        let before_update = engine.store_mut().read_so_far();
        let mut counter = Counter::<CodecOf<E>>::default();
        let vertex_tests = engine.update(&quality.view(frame), &mut counter);
        let read = read_since(&mut engine, before_update)?;
        let pages_touched = distinct(&mut counter.pages);
        let sets = FrameSets::of(&engine, records);
        records.take_error().map_or(Ok(()), Err)?;
        let work = engine.work();
        stats.push(FrameStats {
            frame: i as u64,
            triangles: sets.triangles.len() as u64,
            new_triangles: not_in(&sets.triangles, &before.triangles),
            vertex_tests,
            splits: not_in(&sets.split, &before.split),
            merges: not_in(&before.split, &sets.split),
            expired: Some(work.expired),
            slots_written: Some(work.slots_written),
            patch_bytes: Some(work.patch_bytes),
            late: work.late,
            late_error_px: work.late_error_px,
            pages_touched,
            record_bytes_touched: counter.reads * CodecOf::<E>::BYTES as u64,
            pages_read: read.map(|read| read.pages),
            tiles_unpacked: read.and_then(|read| Some(read.unpacked?.tiles)),
            tile_bytes_read: read.and_then(|read| Some(read.unpacked?.bytes)),
            edited_records,
            mesh_hash: sets.hash(),
            ..FrameStats::default()
        });
        before = sets;
        done((frames.len() + i + 1) as u64);
    }
    Ok(stats)
}

/// How the records of an engine's store are coded.
type CodecOf<E> = <<E as Engine>::Store as RecordStore>::Codec;

/// Counts reads and remembers pages.
struct Counter<C> {
    reads: u64,
    pages: Vec<u64>,
    codec: std::marker::PhantomData<C>,
}

impl<C> Default for Counter<C> {
    fn default() -> Self {
        Self { reads: 0, pages: Vec::new(), codec: std::marker::PhantomData }
    }
}

impl<C: RecordCodec> Probe for Counter<C> {
    fn read(&mut self, slot: u64) {
        self.reads += 1;
        let page = page_of::<C>(slot);
        // Neighbours in the walk are often neighbours in the file.
        if self.pages.last() != Some(&page) {
            self.pages.push(page);
        }
    }
}

fn distinct(values: &mut Vec<u64>) -> u64 {
    values.sort_unstable();
    values.dedup();
    values.len() as u64
}
