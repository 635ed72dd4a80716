//! A flight over pages that are read into a pool: what came too late, what a frame cost, and what reading took, at a stated pace.
//!
//! Cold begins after the system was asked to forget the file; warm flies again from an empty pool over what the system then holds. The first frame waits for its pages,
//! no other does. What comes too late depends on the machine and its storage: only flights over a model disk (`crate::stream::ModelDisk`) repeat.

use super::timed::{forget, observed};
use super::{FrameIo, IoBenchError, LayoutKind, Reader, Run, Timed, kernel};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use terrasoar::refine::{Culling, Unobserved};
use terrasoar::stream::{Prefetch, StreamFrame, Streamed, ThreadFetch};
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::source::{Unpacked, resident_bytes};
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::loader::{Loader, LoaderStats};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Longest that the first frame waits for its pages.
const FIRST_WAIT: Duration = Duration::from_secs(60);

/// What reads the pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ReadBy {
    /// Four threads, a read each; of packed terrain no more than leave a processor to the thread that flies.
    #[default]
    Threads,
    /// One thread with an io_uring.
    Ring,
}

impl ReadBy {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Threads, Self::Ring];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Threads => "threads",
            Self::Ring => "ring",
        }
    }

    fn open(self, path: &Path) -> Result<Terrain, LayoutError> {
        match self {
            Self::Threads => Terrain::open_unmapped(path),
            #[cfg(target_os = "linux")]
            Self::Ring => {
                Terrain::from_source(Box::new(terrasoar_layout::file::source::UringSource::open(path)?))
            }
            #[cfg(not(target_os = "linux"))]
            Self::Ring => Err(LayoutError::Usage("io_uring is Linux's; read by threads here".into())),
        }
    }

    const fn threads(self) -> usize {
        match self {
            Self::Threads => 4,
            Self::Ring => 1,
        }
    }
}

/// How a flight is flown.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PoolOptions {
    /// Memory for pages.
    pub cache_bytes: u64,
    /// How pages are asked for before they are needed.
    pub prefetch: Prefetch,
    /// Where what lies out of view is left out.
    pub culling: Culling,
    /// How far the frustum is moved back for preloading, in metres; a sixteenth of the terrain's side without it.
    pub block_m: Option<f64>,
    /// What reads.
    pub read_by: ReadBy,
    /// Frames a second; 0 flies as fast as frames are made, which leaves storage no time.
    pub frames_per_second: f64,
}

impl Default for PoolOptions {
    /// 128 MiB, by threads, 60 frames a second.
    fn default() -> Self {
        Self {
            cache_bytes: 128 << 20,
            prefetch: Prefetch::default(),
            culling: Culling::default(),
            block_m: None,
            read_by: ReadBy::default(),
            frames_per_second: 60.0,
        }
    }
}

impl PoolOptions {
    /// These options with so many bytes of memory for pages.
    pub fn cache_bytes(self, cache_bytes: u64) -> Self {
        Self { cache_bytes, ..self }
    }

    /// These options with another way of asking ahead.
    pub fn prefetch(self, prefetch: Prefetch) -> Self {
        Self { prefetch, ..self }
    }

    /// These options with another way of culling.
    pub fn culling(self, culling: Culling) -> Self {
        Self { culling, ..self }
    }

    /// These options with the frustum moved back so many metres for preloading.
    pub fn block_m(self, block_m: impl Into<Option<f64>>) -> Self {
        Self { block_m: block_m.into(), ..self }
    }

    /// These options with another reader.
    pub fn read_by(self, read_by: ReadBy) -> Self {
        Self { read_by, ..self }
    }

    /// These options with another pace.
    pub fn frames_per_second(self, frames_per_second: f64) -> Self {
        Self { frames_per_second, ..self }
    }
}

/// A flight, cold and warm.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Pooled {
    /// What frames cost the thread that flew; the first waited for its pages.
    pub timed: Timed,
    /// What each frame had to do with storage, cold.
    pub frames: Vec<StreamFrame>,
    /// What reading took, cold, the first frame included.
    pub loader: LoaderStats,
    /// What was unpacked meanwhile; `None` for a file that is not packed.
    pub unpacked: Option<Unpacked>,
    /// Bytes that storage delivered meanwhile; `None` where not known.
    pub storage_bytes: Option<u64>,
}

impl Pooled {
    /// The flight as a run of counts. `mesh_pages` is what each frame's mesh needs, in memory or not.
    pub fn run(&self, terrain: &Terrain, prefetch: Prefetch, mesh_pages: &[u64]) -> Run {
        let frame = |(i, frame): (usize, &StreamFrame)| FrameIo {
            frame: i as u64,
            reads: frame.records_read,
            record_bytes: frame.records_read * terrain.header().record_kind.bytes() as u64,
            pages: mesh_pages.get(i).copied().unwrap_or(frame.pages_read),
            realtime_pages: frame.late_pages,
            preloaded_pages: frame.pages_come.saturating_sub(frame.late_pages),
            ..FrameIo::default()
        };
        Run {
            reader: Reader::Pool,
            layout: LayoutKind::Ours,
            preload: prefetch,
            record_bytes: terrain.header().record_kind.bytes() as u64,
            file_bytes: terrain.header().file_bytes,
            counts_tiles: false,
            frames: self.frames.iter().enumerate().map(frame).collect(),
            trace: None,
        }
    }
}

/// Flies `views` over the file at `path` twice. `done` hears the number of frame passes finished, twice the frames in all.
///
/// # Errors
/// The file cannot be opened or forgotten, its first page cannot be read, or the system gives no thread or ring.
pub fn fly_pooled(
    path: &Path,
    views: &[View],
    options: PoolOptions,
    done: &mut dyn FnMut(u64),
) -> Result<Pooled, IoBenchError> {
    let was_forgotten = forget(path)?;
    let (knows_peak, before) = (kernel::reset_peak_memory(), kernel::read_bytes());
    let (cold, frames, loader, unpacked) = pass(path, views, options, &mut |i| done(i))?;
    let storage_bytes = kernel::read_bytes().zip(before).map(|(now, then)| now - then);
    let peak_memory_bytes = if knows_peak { kernel::peak_memory_bytes() } else { None };
    let resident_bytes = resident_bytes(path)?;
    let (warm, ..) = pass(path, views, options, &mut |i| done(views.len() as u64 + i))?;
    Ok(Pooled {
        timed: Timed { resident_bytes, was_forgotten, cold, warm, peak_memory_bytes },
        frames,
        loader,
        unpacked,
        storage_bytes,
    })
}

type Pass = (Vec<super::UpdateCost>, Vec<StreamFrame>, LoaderStats, Option<Unpacked>);
type Flown = (Vec<super::UpdateCost>, Vec<StreamFrame>, LoaderStats);

fn pass(
    path: &Path,
    views: &[View],
    options: PoolOptions,
    done: &mut dyn FnMut(u64),
) -> Result<Pass, IoBenchError> {
    let terrain = Arc::new(options.read_by.open(path)?);
    let loader = ThreadFetch::from(Loader::start(Arc::clone(&terrain), options.read_by.threads())?);
    let (costs, frames, loader) = with_records!(terrain.pool(options.cache_bytes)?, pool => {
        let mut streamed = Streamed::new(pool, loader, options.culling, options.prefetch);
        options.block_m.into_iter().for_each(|block_m| streamed.set_block_m(block_m));
        fly(streamed, views, options.frames_per_second, done)
    });
    Ok((costs, frames, loader, terrain.source().unpacking().map(|unpacking| unpacking.unpacked())))
}

fn fly<C: RecordCodec>(
    mut streamed: Streamed<C, ThreadFetch>,
    views: &[View],
    frames_per_second: f64,
    done: &mut dyn FnMut(u64),
) -> Flown {
    let (mut costs, mut frames) = (Vec::with_capacity(views.len()), Vec::with_capacity(views.len()));
    let span = if frames_per_second > 0.0 {
        Duration::from_secs_f64(1.0 / frames_per_second)
    } else {
        Duration::ZERO
    };
    let mut next = Instant::now();
    for (i, view) in views.iter().enumerate() {
        let mut frame = StreamFrame::default();
        costs.push(observed(|| {
            if i == 0 {
                streamed.fill(view, FIRST_WAIT, &mut Unobserved);
            }
            frame = streamed.update(view, &mut Unobserved);
        }));
        frames.push(frame);
        done(i as u64 + 1);
        next += span;
        let now = Instant::now();
        // A frame that took too long makes the next ones no shorter.
        next = next.max(now);
        std::thread::sleep(next - now);
    }
    let stats = streamed.fetch().loader().stats();
    (costs, frames, stats)
}
