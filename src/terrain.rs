//! Opening a terrain file: to be streamed, or mapped as a whole.
//!
//! [`Terrain`] reads what it needs and maps nothing: a file of any size, on any storage, and one that can be edited while it is flown over. [`MappedTerrain`] gives all
//! records at once, for engines that need them all and for measuring. While it is open, other programs must not shorten the file.

use crate::ground::{Ground, PictureEngine, StreamOptions};
use crate::refine::Culling;
#[cfg(feature = "files")]
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::source::{MemorySource, Source};
use terrasoar_layout::grid::Grid;
use terrasoar_layout::read::terrain::Terrain as TerrainFile;

/// A terrain file that is read, never mapped. Clones share it.
#[derive(Debug, Clone)]
pub struct Terrain {
    file: Arc<TerrainFile>,
}

impl Terrain {
    /// Opens the terrain file at `path`. Reads its header and the root of its directory, 16 bytes a mebibyte; what they lead to is read and checked when it is needed.
    ///
    /// # Errors
    /// Not a terrain file, another version, truncated or damaged; I/O.
    #[cfg(feature = "files")]
    pub fn open(path: impl AsRef<Path>) -> Result<Self, LayoutError> {
        Ok(Self { file: Arc::new(TerrainFile::open_unmapped(path.as_ref())?) })
    }

    /// Opens the terrain file `base` with the edits in the file `overlay`. Edits go to the overlay then.
    ///
    /// # Errors
    /// As [`Terrain::open`] of either; an overlay of another terrain, or of one that was written anew since.
    #[cfg(feature = "files")]
    pub fn open_with_overlay(base: impl AsRef<Path>, overlay: impl AsRef<Path>) -> Result<Self, LayoutError> {
        let file = TerrainFile::open_with_overlay_unmapped(base.as_ref(), overlay.as_ref())?;
        Ok(Self { file: Arc::new(file) })
    }

    /// Opens a terrain file that comes from anywhere: from memory or a network, for example.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    pub fn from_source(source: Box<dyn Source>) -> Result<Self, LayoutError> {
        Ok(Self { file: Arc::new(TerrainFile::from_source(source)?) })
    }

    /// Ground to fly over: pages are read by threads into memory of a fixed size.
    ///
    /// It is the ground as it was when the terrain was opened. Edits that another ground has made since are seen when the terrain is opened again; until then this one
    /// takes no edits of its own ([`Ground::edit`] says so).
    ///
    /// # Errors
    /// The first page cannot be read; the system gives no thread.
    pub fn stream(&self, options: StreamOptions) -> Result<Ground<'static>, LayoutError> {
        Ground::streamed(Arc::clone(&self.file), &options)
    }

    /// Height in metres at a place in metres east and north of the south-west sample, read from the file as it was opened; bilinear between four samples.
    /// `None` outside the data and at voids. [`Ground::height_at`] is far faster, and knows of edits.
    ///
    /// # Errors
    /// Damage and I/O.
    pub fn height_m(&self, east_m: f64, north_m: f64) -> Result<Option<f64>, LayoutError> {
        self.file.height_m(east_m, north_m)
    }

    /// Samples and spacing.
    pub fn grid(&self) -> &Grid {
        self.file.grid()
    }

    /// Metres from the first to the last sample, east and north.
    pub fn extent_m(&self) -> [f64; 2] {
        self.grid().extent_m()
    }

    /// Lowest and highest height in metres.
    pub fn height_range_m(&self) -> [f64; 2] {
        self.file.header().height_range_m
    }

    /// The file beneath, with all that it says.
    pub fn file(&self) -> &Arc<TerrainFile> {
        &self.file
    }
}

impl From<Arc<TerrainFile>> for Terrain {
    fn from(file: Arc<TerrainFile>) -> Self {
        Self { file }
    }
}

/// A terrain file that is mapped, so that all its records are at hand.
///
/// **While it is open no program may truncate the file**: otherwise, on Unix, the system ends this program with the signal SIGBUS when it touches what is gone. Programs of this
/// project only append to terrain files and replace them under their name, which does no harm; so does copying a new file over the name with `mv`, but not
/// with `cp`. A failing disk has the same effect. Where that cannot be promised, [`Terrain`] is the one to take: it has words for all of it.
#[derive(Debug)]
pub struct MappedTerrain {
    file: TerrainFile,
}

impl MappedTerrain {
    /// Checks the front of the file at `path` by plain reads, then maps it. What that leads to is checked when it is needed.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    #[cfg(feature = "files")]
    pub fn open(path: impl AsRef<Path>) -> Result<Self, LayoutError> {
        Ok(Self { file: TerrainFile::open(path.as_ref())? })
    }

    /// A terrain file whose `bytes` are in memory, called `name` in messages. No other program can change them.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    pub fn from_bytes(name: &str, bytes: Vec<u8>) -> Result<Self, LayoutError> {
        Ok(Self { file: TerrainFile::from_source(Box::new(MemorySource::new(name, bytes)))? })
    }

    /// Ground to fly over with all records in memory: no page is ever late. It cannot be edited.
    ///
    /// # Errors
    /// Damage of the directory, all of which is read; packed terrain that cannot be unpacked as a whole.
    pub fn ground(&self, engine: PictureEngine, culling: Culling) -> Result<Ground<'_>, LayoutError> {
        Ground::mapped(&self.file, engine, culling)
    }

    /// The file beneath, with all that it says: for [`replay`](crate::flyover::replay), for example.
    pub fn file(&self) -> &TerrainFile {
        &self.file
    }
}
