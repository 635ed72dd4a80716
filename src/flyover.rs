//! Replays: a recorded flight through an engine, frame by frame, with what each frame cost.
//!
//! A replay makes two passes. The first times the updates and looks at nothing else; the second counts tests, pages and triangles through a probe and
//! compares each frame with the one before. Everything but the times is the same in every replay.

use crate::flight::FlightFrame;
use crate::mesh::{Triangle, TriangleKey, is_drawn};
use crate::refine::naive::Naive;
use crate::refine::smart::Smart;
use crate::refine::soar::Soar;
use crate::refine::{Engine, Probe, Unobserved};
use crate::stats::FrameStats;
use crate::view::Viewport;
use std::collections::HashMap;
use std::time::Instant;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::record::RecordCodec;
use terrasoar_layout::terrain::{Records, Terrain};
use terrasoar_layout::with_records;

/// The engines, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum EngineKind {
    /// Brute force.
    Naive,
    /// Full refinement every frame.
    Soar,
    /// Live ranges.
    Smart,
}

impl EngineKind {
    /// All engines.
    pub const ALL: [Self; 3] = [Self::Naive, Self::Soar, Self::Smart];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Naive => "naive",
            Self::Soar => "soar",
            Self::Smart => "smart",
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
    #[error("there is no engine called {0:?}; the engines are naive, soar and smart")]
    UnknownEngine(String),
    /// The tolerance is not usable.
    #[error("a tolerance is a number of pixels from 0.01 to 10000, not {0}")]
    Tolerance(f64),
    /// The viewport is not usable.
    #[error("a viewport is 1 to 65536 pixels wide and high, not {}x{}", .0.width_px, .0.height_px)]
    Viewport(Viewport),
    /// The terrain's source does not lend its bytes.
    #[error("{0}: refinement needs a mapped or in-memory terrain")]
    NotInAddressSpace(String),
    /// The frame asked for is not in the flight.
    #[error("the flight has frames 0 to {last}, not {asked}")]
    NoSuchFrame {
        /// Frame asked for.
        asked: usize,
        /// Last frame.
        last: usize,
    },
}

/// Picture and precision of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Size of the picture.
    pub viewport: Viewport,
    /// Tolerance in pixels, 0.01 to 10,000.
    pub tolerance_px: f64,
}

impl Quality {
    fn check(self) -> Result<Self, ReplayError> {
        if !(0.01..=10_000.0).contains(&self.tolerance_px) {
            return Err(ReplayError::Tolerance(self.tolerance_px));
        }
        let Viewport { width_px, height_px } = self.viewport;
        if [width_px, height_px].iter().any(|p| !(1..=65_536).contains(p)) {
            return Err(ReplayError::Viewport(self.viewport));
        }
        Ok(self)
    }
}

/// Runs `$body` with `$engine` bound to a new engine of `$kind` over `$records`.
macro_rules! with_engine {
    ($kind:expr, $records:expr, $engine:ident => $body:expr) => {
        match $kind {
            EngineKind::Naive => {
                let $engine = Naive::new($records);
                $body
            }
            EngineKind::Soar => {
                let $engine = Soar::new($records);
                $body
            }
            EngineKind::Smart => {
                let $engine = Smart::new($records);
                $body
            }
        }
    };
}

/// Flies `frames` over `terrain` with one engine. `done` hears the number of frame passes finished, twice the frames in all.
///
/// # Errors
/// [`ReplayError`] for a tolerance, viewport or source that cannot be used.
pub fn replay(
    terrain: &Terrain,
    frames: &[FlightFrame],
    quality: Quality,
    kind: EngineKind,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<FrameStats>, ReplayError> {
    let quality = quality.check()?;
    with_records!(records_of(terrain)?, records => {
        let times = with_engine!(kind, records.clone(), engine => time_updates(engine, frames, quality, done));
        let mut stats = with_engine!(kind, records.clone(), engine => count_frames(engine, &records, frames, quality, done));
        for (stats, update_ms) in stats.iter_mut().zip(times) {
            stats.update_ms = update_ms;
        }
        Ok(stats)
    })
}

fn records_of(terrain: &Terrain) -> Result<terrasoar_layout::terrain::AnyRecords<'_>, ReplayError> {
    terrain.records().ok_or_else(|| ReplayError::NotInAddressSpace(terrain.path().display().to_string()))
}

fn time_updates(
    mut engine: impl Engine,
    frames: &[FlightFrame],
    quality: Quality,
    done: &mut dyn FnMut(u64),
) -> Vec<f64> {
    let mut times_ms = Vec::with_capacity(frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let view = frame.view(quality.viewport, quality.tolerance_px);
        let start = Instant::now();
        engine.update(&view, &mut Unobserved);
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
        done(i as u64 + 1);
    }
    times_ms
}

fn count_frames<C: RecordCodec>(
    mut engine: impl Engine,
    records: &Records<'_, C>,
    frames: &[FlightFrame],
    quality: Quality,
    done: &mut dyn FnMut(u64),
) -> Vec<FrameStats> {
    let mut before = FrameSets::default();
    let mut stats = Vec::with_capacity(frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let mut counter = Counter::<C>::default();
        let vertex_tests = engine.update(&frame.view(quality.viewport, quality.tolerance_px), &mut counter);
        let pages_touched = distinct(&mut counter.pages);
        let sets = FrameSets::of(&engine, records, counter.split);
        stats.push(FrameStats {
            frame: i as u64,
            triangles: sets.triangles.len() as u64,
            new_triangles: not_in(&sets.triangles, &before.triangles),
            vertex_tests,
            splits: not_in(&sets.split, &before.split),
            merges: not_in(&before.split, &sets.split),
            pages_touched,
            record_bytes_touched: counter.reads * C::BYTES as u64,
            update_ms: 0.0,
            mesh_hash: sets.hash(),
        });
        before = sets;
        done((frames.len() + i + 1) as u64);
    }
    stats
}

/// Counts reads and remembers pages and split triangles.
struct Counter<C> {
    reads: u64,
    pages: Vec<u64>,
    split: Vec<TriangleKey>,
    codec: std::marker::PhantomData<C>,
}

impl<C> Default for Counter<C> {
    fn default() -> Self {
        Self { reads: 0, pages: Vec::new(), split: Vec::new(), codec: std::marker::PhantomData }
    }
}

impl<C: RecordCodec> Probe for Counter<C> {
    fn read(&mut self, slot: u64) {
        self.reads += 1;
        let page = Records::<C>::page_of(slot);
        // Neighbours in the walk are often neighbours in the file.
        if self.pages.last() != Some(&page) {
            self.pages.push(page);
        }
    }

    fn split(&mut self, apex: GridPoint, b: GridPoint, d: GridPoint) {
        self.split.push(TriangleKey::new(apex, b, d));
    }
}

fn distinct(values: &mut Vec<u64>) -> u64 {
    values.sort_unstable();
    values.dedup();
    values.len() as u64
}

/// How many of sorted `a` are not in sorted `b`.
fn not_in(a: &[TriangleKey], b: &[TriangleKey]) -> u64 {
    let mut rest = b;
    let mut count = 0;
    for key in a {
        let skip = rest.iter().position(|k| k >= key).unwrap_or(rest.len());
        rest = &rest[skip..];
        count += u64::from(rest.first() != Some(key));
    }
    count
}

/// Drawn and split triangles of a frame, sorted.
#[derive(Debug, Default)]
struct FrameSets {
    triangles: Vec<TriangleKey>,
    split: Vec<TriangleKey>,
}

impl FrameSets {
    fn of<C: RecordCodec>(
        engine: &impl Engine,
        records: &Records<'_, C>,
        mut split: Vec<TriangleKey>,
    ) -> Self {
        let mut triangles = Vec::new();
        engine.for_each_triangle(&mut |t| {
            if is_drawn(records, t) {
                triangles.push(TriangleKey::of(t));
            }
        });
        triangles.sort_unstable();
        split.sort_unstable();
        Self { triangles, split }
    }

    fn hash(&self) -> u64 {
        self.triangles.iter().fold(self.triangles.len() as u64, |sum, key| sum.wrapping_add(key.hash()))
    }
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
    let quality = quality.check()?;
    with_records!(records_of(terrain)?, records => {
        let mut engine = Soar::new(records.clone());
        let mut sets = |frame: &FlightFrame| {
            engine.update(&frame.view(quality.viewport, quality.tolerance_px), &mut Unobserved);
            FrameSets::of(&engine, &records, Vec::new())
        };
        let mut sum = 0.0;
        for (first, second) in pairs {
            let (first, second) = (sets(first), sets(second));
            sum += 100.0 * not_in(&second.triangles, &first.triangles) as f64 / second.triangles.len().max(1) as f64;
        }
        Ok(sum / pairs.len().max(1) as f64)
    })
}

/// One frame's drawn triangles with shared vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct FrameMesh {
    /// Vertices in metres east, north and up.
    pub positions: Vec<[f64; 3]>,
    /// Triangles, counter-clockwise seen from above, as indices into `positions`.
    pub triangles: Vec<[u32; 3]>,
}

/// The mesh that an engine draws in frame `frame` after flying all frames before it.
///
/// # Errors
/// As [`replay`], and [`ReplayError::NoSuchFrame`].
pub fn frame_mesh(
    terrain: &Terrain,
    frames: &[FlightFrame],
    frame: usize,
    quality: Quality,
    kind: EngineKind,
) -> Result<FrameMesh, ReplayError> {
    let quality = quality.check()?;
    let Some(flown) = frames.get(..=frame) else {
        return Err(ReplayError::NoSuchFrame { asked: frame, last: frames.len().saturating_sub(1) });
    };
    with_records!(records_of(terrain)?, records => with_engine!(kind, records.clone(), engine => {
        let mut engine = engine;
        for frame in flown {
            engine.update(&frame.view(quality.viewport, quality.tolerance_px), &mut Unobserved);
        }
        Ok(collect_mesh(&engine, &records))
    }))
}

fn collect_mesh<C: RecordCodec>(engine: &impl Engine, records: &Records<'_, C>) -> FrameMesh {
    let mut mesh = FrameMesh::default();
    let mut indices: HashMap<u64, u32> = HashMap::new();
    let grid = *records.grid();
    engine.for_each_triangle(&mut |t: Triangle| {
        if !is_drawn(records, t) {
            return;
        }
        mesh.triangles.push(t.map(|p| {
            // Folded points coincide; they become one vertex.
            *indices.entry(grid.fold(p).packed()).or_insert_with(|| {
                let [x, y] = grid.position_m(p);
                mesh.positions.push([x, y, records.vertex_at(p).height_m]);
                mesh.positions.len() as u32 - 1
            })
        }));
    });
    mesh
}
