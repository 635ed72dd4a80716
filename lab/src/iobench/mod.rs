//! How much of a file a flight touches: which pages its reads need, under which layout, and what reading them costs.
//!
//! | part | what |
//! |---|---|
//! | [`layouts`] | where a record lies under four layouts |
//! | [`count()`] | a flight's reads, counted: pages, lines, what a cache of a stated size misses, with and without preloading |
//! | [`fly_pooled`] | a flight over pages read by threads into a pool |
//! | [`time()`], [`kernel`] | a flight over the mapped file, cold and warm, and what the kernel says about it |
//! | [`scratch`] | other layouts on a real disk |
//! | [`IoBench`], [`IoRun`] | sums of all that, in the field names of reports |
//!
//! Counts repeat to the last page; times, faults and bytes are the machine's. A MB is 10^6 bytes, a page 4 KiB.

mod count;
pub mod kernel;
pub mod layouts;
mod pooled;
pub mod scratch;
mod summary;
mod timed;

pub use count::{CountOptions, count};
pub use layouts::LayoutKind;
pub use pooled::{PoolOptions, Pooled, ReadBy, fly_pooled};
pub use summary::{Cap, IoBench, IoRun, ScratchCost, StreamCost};
pub use timed::{Timed, UpdateCost, time};

pub use terrasoar::stream::Prefetch;

use serde::Serialize;
use std::path::PathBuf;
use terrasoar::flyover::EngineKind;
use terrasoar_layout::{LayoutError, Remedy};

/// Bytes a page.
const PAGE_BYTES: u64 = terrasoar_layout::file::bytes::PAGE_BYTES as u64;

/// Who reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reader {
    /// An engine, its own reads: one that remembers vertices reads them once.
    Engine(EngineKind),
    /// Kinetic over pages that are read into a pool by the time they are needed.
    Pool,
    /// The mesh itself: every record that a refinement of the frame from nothing looks at, even if an engine has it in memory. SOAR reads just these.
    Mesh,
}

impl Reader {
    /// The word that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Engine(engine) => engine.name(),
            Self::Pool => EngineKind::Kinetic.name(),
            Self::Mesh => "mesh",
        }
    }

    /// The engine whose reads they are.
    const fn engine(self) -> EngineKind {
        match self {
            Self::Engine(engine) => engine,
            Self::Pool => EngineKind::Kinetic,
            Self::Mesh => EngineKind::Soar,
        }
    }

    /// Where its records come from, in the word that reports use.
    pub const fn source(self) -> &'static str {
        match self {
            Self::Pool => "pool",
            Self::Engine(_) | Self::Mesh => "map",
        }
    }
}

/// Why nothing can be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoBenchError {
    /// The reader does not know when it will need what.
    #[error("preloading by deadline needs the engine kinetic over a pool; preload {} by frustum or not at all", reader.name())]
    NoDeadlines {
        /// The reader.
        reader: Reader,
    },
    /// The disk is too full for a scratch file.
    #[error("{}: a scratch file of {:.1} GB {}; name a folder on another disk, or fewer layouts", folder.display(), *bytes as f64 / 1e9, room(*free))]
    NoRoom {
        /// The folder.
        folder: PathBuf,
        /// Bytes it takes.
        bytes: u64,
        /// Bytes that are free; `None` where not known.
        free: Option<u64>,
    },
    /// A trace leads out of the scratch file.
    #[error("page {page} lies outside the scratch file; this is a fault of terrasoar, please report it")]
    OutsideScratch {
        /// The page.
        page: u64,
    },
    /// The terrain file.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// Something else on a disk.
    #[error("{}: {doing}: {source}", path.display())]
    Io {
        /// What failed.
        doing: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}

impl IoBenchError {
    /// What would mend it, if that can be asked for.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::NoRoom { .. } => Some(Remedy::ScratchFolder),
            Self::Layout(error) => error.remedy(),
            _ => None,
        }
    }
}

fn room(free: Option<u64>) -> String {
    match free {
        Some(free) => format!("does not fit with room to spare, {:.1} GB are free", free as f64 / 1e9),
        None => "cannot be made, for this system does not say how much room there is".into(),
    }
}

/// What one frame's reads touched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct FrameIo {
    /// Frame number, from 0.
    pub frame: u64,
    /// Records read, every read counted.
    pub reads: u64,
    /// Bytes of these records.
    pub record_bytes: u64,
    /// Distinct 4 KiB pages they lie on: what the frame needs.
    pub pages: u64,
    /// Distinct cache lines of 64 bytes.
    pub lines: u64,
    /// Distinct units of 64 KiB.
    pub units: u64,
    /// Pages needed that were not in the cache.
    pub realtime_pages: u64,
    /// Pages loaded ahead since the frame before.
    pub preloaded_pages: u64,
    /// Distinct tiles of a packed file that they lie in; 0 for files that are not packed.
    pub tiles: u64,
    /// Bytes of these tiles' segments in the file, without what an engine leaves unread for what bounds of errors say, and of the bounds that are read with them.
    pub tile_bytes: u64,
}

/// The counts of one flight: a reader, a layout, a way of preloading.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Who read.
    pub reader: Reader,
    /// The layout.
    pub layout: LayoutKind,
    /// What was loaded ahead.
    pub preload: Prefetch,
    /// Bytes a record.
    pub record_bytes: u64,
    /// Bytes of a file in this layout.
    pub file_bytes: u64,
    /// Whether tiles of a packed file are counted.
    pub counts_tiles: bool,
    /// The frames.
    pub frames: Vec<FrameIo>,
    /// Pages of each frame in the order they were first read, if asked for; with [`Prefetch::None`] only.
    pub trace: Option<Vec<Vec<u64>>>,
}

impl Run {
    /// Whether cache lines and larger units are counted: over a pool, whose pages lie elsewhere in memory, they are not.
    pub const fn counts_lines(&self) -> bool {
        !matches!(self.reader, Reader::Pool)
    }
}
