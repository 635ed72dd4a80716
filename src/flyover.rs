//! Replays: a recorded flight through an engine, frame by frame, with what each frame cost.
//!
//! A replay makes two passes. The first times the updates and looks at nothing else; the second counts tests, pages and triangles through a probe and
//! compares each frame with the one before. Everything but the times is the same in every replay.

use crate::flight::FlightFrame;
use crate::mesh::{Triangle, TriangleKey, is_drawn, parent, with_apex_first};
use crate::refine::kinetic::{Budget, Kinetic};
use crate::refine::naive::Naive;
use crate::refine::smart::Smart;
use crate::refine::soar::Soar;
use crate::refine::{Culling, Engine, Phase, Probe, Unobserved};
use crate::stats::FrameStats;
use crate::view::{View, Viewport};
use std::collections::{HashMap, HashSet};
use std::hash::{BuildHasherDefault, Hasher};
use std::time::Instant;
use terrasoar_layout::record::RecordCodec;
use terrasoar_layout::terrain::{Records, Terrain};
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
    /// What heights are multiplied by, 0.01 to 100.
    pub vertical_exaggeration: f64,
    /// Where what lies out of view is left out.
    pub culling: Culling,
    /// Vertex tests of one frame that [`EngineKind::Kinetic`] may make; other engines know no bounds.
    pub budget_tests: Option<u64>,
}

impl Default for Quality {
    fn default() -> Self {
        Self {
            viewport: Viewport::default(),
            tolerance_px: 1.0,
            vertical_exaggeration: 1.0,
            culling: Culling::default(),
            budget_tests: None,
        }
    }
}

impl Quality {
    fn check(self) -> Result<Self, ReplayError> {
        if !(0.01..=10_000.0).contains(&self.tolerance_px) {
            return Err(ReplayError::Tolerance(self.tolerance_px));
        }
        if !(0.01..=100.0).contains(&self.vertical_exaggeration) {
            return Err(ReplayError::Exaggeration(self.vertical_exaggeration));
        }
        let Viewport { width_px, height_px } = self.viewport;
        if [width_px, height_px].iter().any(|p| !(1..=65_536).contains(p)) {
            return Err(ReplayError::Viewport(self.viewport));
        }
        Ok(self)
    }

    fn view(self, frame: &FlightFrame) -> View {
        let view = frame.view(self.viewport, self.tolerance_px);
        View { vertical_exaggeration: self.vertical_exaggeration, ..view }
    }
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
        let times = with_engine!(kind, records.clone(), quality, engine => time_updates(engine, frames, quality, done));
        let mut stats = with_engine!(kind, records.clone(), quality, engine => count_frames(engine, &records, frames, quality, done));
        for (stats, times) in stats.iter_mut().zip(times) {
            stats.update_ms = times.update_ms;
            [stats.scan_us, stats.test_us, stats.apply_us] = times.phases_us;
        }
        Ok(stats)
    })
}

fn records_of(terrain: &Terrain) -> Result<terrasoar_layout::terrain::AnyRecords<'_>, ReplayError> {
    terrain.records().ok_or_else(|| ReplayError::NotInAddressSpace(terrain.path().display().to_string()))
}

/// Times of one frame.
struct FrameTimes {
    update_ms: f64,
    /// Scan, test, apply.
    phases_us: [f64; 3],
}

/// Reads the clock at the seams of an update.
struct PhaseTimer {
    since: Instant,
    /// Scan, test, apply.
    phase: usize,
    phases_us: [f64; 3],
}

impl Probe for PhaseTimer {
    fn phase(&mut self, phase: Phase) {
        let now = Instant::now();
        if let Some(spent) = self.phases_us.get_mut(self.phase) {
            *spent += (now - self.since).as_secs_f64() * 1e6;
        }
        self.since = now;
        self.phase = phase as usize;
    }
}

fn time_updates(
    mut engine: impl Engine,
    frames: &[FlightFrame],
    quality: Quality,
    done: &mut dyn FnMut(u64),
) -> Vec<FrameTimes> {
    let mut times = Vec::with_capacity(frames.len());
    for (i, frame) in frames.iter().enumerate() {
        let view = quality.view(frame);
        let start = Instant::now();
        let mut timer = PhaseTimer { since: start, phase: Phase::Done as usize, phases_us: [0.0; 3] };
        engine.update(&view, &mut timer);
        times.push(FrameTimes { update_ms: start.elapsed().as_secs_f64() * 1e3, phases_us: timer.phases_us });
        done(i as u64 + 1);
    }
    times
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
        let vertex_tests = engine.update(&quality.view(frame), &mut counter);
        let pages_touched = distinct(&mut counter.pages);
        let sets = FrameSets::of(&engine, records);
        let work = engine.work();
        stats.push(FrameStats {
            frame: i as u64,
            triangles: sets.triangles.len() as u64,
            new_triangles: not_in(&sets.triangles, &before.triangles),
            vertex_tests,
            splits: not_in(&sets.split, &before.split),
            merges: not_in(&before.split, &sets.split),
            expired: work.expired,
            slots_written: work.slots_written,
            patch_bytes: work.patch_bytes,
            late: work.late,
            late_error_px: work.late_error_px,
            pages_touched,
            record_bytes_touched: counter.reads * C::BYTES as u64,
            mesh_hash: sets.hash(),
            ..FrameStats::default()
        });
        before = sets;
        done((frames.len() + i + 1) as u64);
    }
    stats
}

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
        let page = Records::<C>::page_of(slot);
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

/// Hands on the hash that a key has of its own.
#[derive(Default)]
struct KeyHasher(u64);

impl Hasher for KeyHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.0 = self.0.rotate_left(8) ^ u64::from(*b));
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = value.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    }
}

impl FrameSets {
    fn of<C: RecordCodec>(engine: &impl Engine, records: &Records<'_, C>) -> Self {
        let mut triangles = Vec::new();
        // What is split are the ancestors of what is not.
        let mut split: HashSet<TriangleKey, BuildHasherDefault<KeyHasher>> = HashSet::default();
        engine.for_each_triangle(&mut |t| {
            if is_drawn(records, t) {
                triangles.push(TriangleKey::of(t));
            }
            let mut above = parent(records.grid(), with_apex_first(t));
            while let Some([apex, b, d]) = above
                && split.insert(TriangleKey::new(apex, b, d))
            {
                above = parent(records.grid(), [apex, b, d]);
            }
        });
        let mut split: Vec<TriangleKey> = split.into_iter().collect();
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
        let mut engine = Soar::new(records.clone(), quality.culling);
        let mut sets = |frame: &FlightFrame| {
            engine.update(&quality.view(frame), &mut Unobserved);
            FrameSets::of(&engine, &records)
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
    with_records!(records_of(terrain)?, records => with_engine!(kind, records.clone(), quality, engine => {
        let mut engine = engine;
        for frame in flown {
            engine.update(&quality.view(frame), &mut Unobserved);
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
