//! Replays: a recorded flight through an engine, frame by frame, with what each frame cost.
//!
//! A replay makes two passes. The first only times the updates. The second counts tests, pages and triangles through a probe, and
//! compares each frame with the one before. Everything but the times is the same in every replay.
#![cfg(feature = "files")]

mod edits;
mod mesh;
mod passes;
mod quality;
mod sets;

/// One frame's drawn triangles.
pub use crate::mesh::IndexedMesh as FrameMesh;
pub use edits::TimedBatch;
pub use quality::Quality;

use crate::flight::FlightFrame;
use crate::refine::kinetic::{Budget, Kinetic, alone};
use crate::refine::naive::Naive;
use crate::refine::smart::Smart;
use crate::refine::soar::Soar;
use crate::refine::{Engine, Unobserved};
use crate::stats::FrameStats;
use crate::view::Viewport;
use edits::{Changing, Ground, Still};
use mesh::collect_mesh;
use passes::{FrameTimes, count_frames, time_updates};
use sets::{FrameSets, not_in};
use std::sync::Arc;
use std::time::Duration;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::store::{CompleteStore, PagesRead};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// The engines, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum EngineKind {
    /// Brute force.
    Naive,
    /// Full refinement every frame.
    Soar,
    /// Live ranges, looked at every frame.
    Smart,
    /// Live ranges in a queue: only what is over is looked at.
    #[default]
    Kinetic,
}

impl EngineKind {
    /// All engines.
    pub const ALL: [Self; 4] = [Self::Naive, Self::Soar, Self::Smart, Self::Kinetic];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Naive => "naive",
            Self::Soar => "soar",
            Self::Smart => "smart",
            Self::Kinetic => "kinetic",
        }
    }
}

impl std::str::FromStr for EngineKind {
    type Err = ReplayError;

    fn from_str(word: &str) -> Result<Self, ReplayError> {
        Self::ALL
            .into_iter()
            .find(|e| e.name() == word)
            .ok_or_else(|| ReplayError::UnknownEngine(word.to_owned()))
    }
}

/// Why a replay cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// No engine has that name.
    #[error("there is no engine called {0:?}; the engines are naive, soar, smart and kinetic")]
    UnknownEngine(String),
    /// The tolerance is not usable.
    #[error("a tolerance is a number of pixels from 0.01 to 10000, not {0}")]
    Tolerance(f64),
    /// The viewport is not usable.
    #[error("a viewport is 1 to 65536 pixels wide and high, not {}x{}", .0.width_px, .0.height_px)]
    Viewport(Viewport),
    /// The vertical exaggeration is not usable.
    #[error("a vertical exaggeration is a number from 0.01 to 100, not {0}")]
    Exaggeration(f64),
    /// The terrain cannot be read, or not be edited as asked.
    #[error(transparent)]
    Terrain(#[from] LayoutError),
    /// Brute force would take minutes a frame, however little of the square is no void.
    #[error(
        "the engine naive tests every vertex of a square of up to {} steps a side, this one has {steps}; use another engine",
        crate::refine::naive::MOST_STEPS
    )]
    TooLargeForNaive {
        /// Steps a side.
        steps: u32,
    },
    /// The frame asked for is not in the flight.
    #[error("the flight has frames 0 to {last}, not {asked}")]
    NoSuchFrame {
        /// Frame asked for.
        asked: usize,
        /// Last frame.
        last: usize,
    },
}

/// Runs `$body` with `$engine` bound to a new engine of `$kind` over `$records`, as `$quality` wants it.
macro_rules! with_engine {
    ($kind:expr, $records:expr, $quality:expr, $engine:ident => $body:expr) => {
        match $kind {
            EngineKind::Naive => {
                let $engine = Naive::new($records, $quality.culling);
                $body
            }
            EngineKind::Soar => {
                let $engine = Soar::new($records, $quality.culling);
                $body
            }
            EngineKind::Smart => {
                let $engine = Smart::new($records, $quality.culling);
                $body
            }
            EngineKind::Kinetic => {
                let mut $engine = Kinetic::new($records, $quality.culling);
                $engine.set_budget(Budget { tests: $quality.budget_tests, time: None });
                $body
            }
        }
    };
}

/// Flies `frames` over `terrain` with one engine. `done` hears the number of frame passes finished, twice the frames in all.
///
/// The figures of a terrain whose pages are read on the way ([`Quality::cache_bytes`]) are those of one whose records are at hand, and tell what was read besides.
///
/// # Errors
/// [`ReplayError`] for a tolerance or viewport that cannot be used; damage and I/O.
pub fn replay(
    terrain: &Terrain,
    frames: &[FlightFrame],
    quality: Quality,
    kind: EngineKind,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<FrameStats>, ReplayError> {
    let quality = quality.check(terrain, kind)?;
    if let Some(cache_bytes) = terrain.cache_bytes(quality.cache_bytes) {
        return over_pages(terrain, frames, quality, kind, cache_bytes, None, done);
    }
    with_records!(terrain.records()?, records => {
        let times = with_engine!(kind, records.clone(), quality, engine => time_updates(engine, &mut Still, frames, quality, done))?;
        let stats = with_engine!(kind, records.clone(), quality, engine => count_frames(engine, &mut Still, &records, frames, quality, done))?;
        Ok(timed(stats, times, kind))
    })
}

/// Edits on the way, and the terrain that they change in memory.
type Edits<'e> = (&'e Arc<Terrain>, &'e [TimedBatch]);

/// A replay over pages that are read into memory of a fixed size. Each pass begins with none. The counting one shares no work, so that what it reads repeats.
fn over_pages(
    terrain: &Terrain,
    frames: &[FlightFrame],
    quality: Quality,
    kind: EngineKind,
    cache_bytes: u64,
    edits: Option<Edits<'_>>,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<FrameStats>, ReplayError> {
    let times = with_records!(terrain.paged(cache_bytes), records => {
        with_engine!(kind, EditedRecords::new(records), quality, engine => {
            time_updates(engine, &mut *ground_of(edits)?, frames, quality, done)
        })?
    });
    let stats = with_records!(terrain.paged(cache_bytes), records => {
        alone(|| with_engine!(kind, EditedRecords::new(records.clone()), quality, engine => {
            count_frames(engine, &mut *ground_of(edits)?, &records, frames, quality, done)
        }))?
    });
    Ok(timed(stats, times, kind))
}

/// The ground as it is, or edited.
fn ground_of<'e, S: CompleteStore, E: Engine<Store = EditedRecords<S>>>(
    edits: Option<Edits<'e>>,
) -> Result<Box<dyn Ground<E> + 'e>, ReplayError> {
    Ok(match edits {
        None => Box::new(Still),
        Some((terrain, batches)) => Box::new(Changing::new(terrain, batches)?),
    })
}

/// As [`replay`], over ground that is edited on the way. The edits stay in memory; the time they take is told apart from the engine's.
///
/// ```no_run
/// use std::{path::Path, sync::Arc};
/// use terrasoar::flyover::{EngineKind, Quality, TimedBatch, replay_edited};
/// use terrasoar_layout::edit::{Crater, Edit};
/// use terrasoar_layout::read::terrain::Terrain;
///
/// let terrain = Arc::new(Terrain::open(Path::new("alps.iqt"))?);
/// let crater = Crater { centre_m: [5e3, 4e3], direction_deg: 90.0, radius_m: 40.0, depth_m: 12.0 };
/// let batches = [TimedBatch { frame: 10, edits: vec![Edit::Crater(crater)] }];
/// # let frames: Vec<terrasoar::flight::FlightFrame> = Vec::new();
/// let stats = replay_edited(&terrain, &frames, Quality::default(), EngineKind::Kinetic, &batches, &mut |_| {})?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`replay`]; [`ReplayError::Terrain`] for edits that cannot be made.
pub fn replay_edited(
    terrain: &Arc<Terrain>,
    frames: &[FlightFrame],
    quality: Quality,
    kind: EngineKind,
    batches: &[TimedBatch],
    done: &mut dyn FnMut(u64),
) -> Result<Vec<FrameStats>, ReplayError> {
    let quality = quality.check(terrain, kind)?;
    let edits = Some((terrain, batches));
    if let Some(cache_bytes) = terrain.cache_bytes(quality.cache_bytes) {
        return over_pages(terrain, frames, quality, kind, cache_bytes, edits, done);
    }
    with_records!(terrain.records()?, records => {
        let store = || EditedRecords::new(records.clone());
        let times = with_engine!(kind, store(), quality, engine => {
            time_updates(engine, &mut *ground_of(edits)?, frames, quality, done)
        })?;
        let stats = with_engine!(kind, store(), quality, engine => {
            count_frames(engine, &mut *ground_of(edits)?, &records, frames, quality, done)
        })?;
        Ok(timed(stats, times, kind))
    })
}

/// Counts with the times of the other pass; without those that do not apply to the engine.
fn timed(mut stats: Vec<FrameStats>, times: Vec<FrameTimes>, kind: EngineKind) -> Vec<FrameStats> {
    for (stats, times) in stats.iter_mut().zip(times) {
        stats.update_ms = times.update_ms;
        if kind == EngineKind::Kinetic {
            [stats.scan_us, stats.test_us, stats.apply_us] = times.phases_us.map(Some);
        } else {
            // The others keep no queue and no slots, and their updates have no such parts.
            (stats.expired, stats.slots_written, stats.patch_bytes) = (None, None, None);
        }
        stats.edit_ms = times.edit_ms;
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        stats.read_ms = times.read.map(|read| ms(read.time));
        stats.unpack_ms = times.read.and_then(|read| Some(ms(read.unpacked?.time)));
    }
    stats
}

/// Mean over pairs of consecutive frames of the share of the second one's triangles that the first did not have, in percent.
///
/// # Errors
/// As [`replay`].
pub fn mean_incoherence_percent(
    terrain: &Terrain,
    pairs: &[(FlightFrame, FlightFrame)],
    quality: Quality,
) -> Result<f64, ReplayError> {
    let quality = quality.check(terrain, EngineKind::Soar)?;
    match terrain.cache_bytes(quality.cache_bytes) {
        None => with_records!(terrain.records()?, records => mean_incoherence_over(records, pairs, quality)),
        Some(bytes) => {
            with_records!(terrain.paged(bytes), records => mean_incoherence_over(records, pairs, quality))
        }
    }
}

fn mean_incoherence_over<S: CompleteStore + Clone>(
    records: S,
    pairs: &[(FlightFrame, FlightFrame)],
    quality: Quality,
) -> Result<f64, ReplayError> {
    let mut engine = Soar::new(records.clone(), quality.culling);
    let mut sets = |frame: &FlightFrame| {
        engine.update(&quality.view(frame), &mut Unobserved);
        FrameSets::of(&engine, &records)
    };
    let mut sum = 0.0;
    for (first, second) in pairs {
        let (first, second) = (sets(first), sets(second));
        records.take_error().map_or(Ok(()), Err)?;
        sum +=
            100.0 * not_in(&second.triangles, &first.triangles) as f64 / second.triangles.len().max(1) as f64;
    }
    Ok(sum / pairs.len().max(1) as f64)
}

/// The mesh that an engine draws in frame `frame` after flying all frames before it, over ground that is edited on the way as `batches` say.
///
/// # Errors
/// As [`replay_edited`], and [`ReplayError::NoSuchFrame`].
pub fn frame_mesh(
    terrain: &Arc<Terrain>,
    frames: &[FlightFrame],
    frame: usize,
    quality: Quality,
    kind: EngineKind,
    batches: &[TimedBatch],
) -> Result<FrameMesh, ReplayError> {
    frame_mesh_with_reads(terrain, frames, frame, quality, kind, batches).map(|(mesh, _)| mesh)
}

/// As [`frame_mesh`], and what was read for it and the frames before; `None` for a terrain whose records were taken where they lie.
///
/// # Errors
/// As [`frame_mesh`].
pub fn frame_mesh_with_reads(
    terrain: &Arc<Terrain>,
    frames: &[FlightFrame],
    frame: usize,
    quality: Quality,
    kind: EngineKind,
    batches: &[TimedBatch],
) -> Result<(FrameMesh, Option<PagesRead>), ReplayError> {
    let quality = quality.check(terrain, kind)?;
    let Some(flown) = frames.get(..=frame) else {
        return Err(ReplayError::NoSuchFrame { asked: frame, last: frames.len().saturating_sub(1) });
    };
    match terrain.cache_bytes(quality.cache_bytes) {
        None => with_records!(terrain.records()?, records => {
            frame_mesh_over(records, terrain, flown, quality, kind, batches)
        }),
        Some(bytes) => with_records!(terrain.paged(bytes), records => {
            frame_mesh_over(records, terrain, flown, quality, kind, batches)
        }),
    }
}

/// The mesh of the last frame.
fn frame_mesh_over<S: CompleteStore>(
    records: S,
    terrain: &Arc<Terrain>,
    frames: &[FlightFrame],
    quality: Quality,
    kind: EngineKind,
    batches: &[TimedBatch],
) -> Result<(FrameMesh, Option<PagesRead>), ReplayError> {
    let mut ground = Changing::new(terrain, batches)?;
    with_engine!(kind, EditedRecords::new(records), quality, engine => {
        let mut engine = engine;
        for (i, frame) in frames.iter().enumerate() {
            ground.edit_and_tell(i, &mut engine)?;
            engine.update(&quality.view(frame), &mut Unobserved);
            engine.store_mut().take_error().map_or(Ok(()), Err)?;
        }
        let read = engine.store_mut().read_so_far();
        Ok((collect_mesh(engine)?, read))
    })
}
