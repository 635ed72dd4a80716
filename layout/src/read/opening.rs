//! Opening a terrain file without reading it: [`Opening`] says which bytes it needs next, whoever has the file gives them, and at the end the terrain is there. So a file may come from anywhere, a
//! network for example, by whatever way of waiting there is.
//!
//! A file takes two turns, or three if it is packed and large: its front, the directory's root or the rest of a packed front, and of a file that was edited what leads to these.
//! Everything else is read when it is needed. Files on the disk are opened in the same way. Cost: what was given is gone through again with each turn, and dropped at the end.
//!
//! ```
//! # #[cfg(feature = "files")]
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # use terrasoar_layout::build::{BuildOptions, build};
//! # use terrasoar_layout::dem::{MemoryDem, SampleType};
//! # use terrasoar_layout::progress::Silent;
//! use terrasoar_layout::file::source::MemorySource;
//! use terrasoar_layout::read::opening::{Opening, Step};
//! use terrasoar_layout::read::terrain::Terrain;
//!
//! # let dem = MemoryDem::from_fn([65, 65], SampleType::I16, |x, y| f64::from(x * y / 8));
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("slope.iqt");
//! # build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 30.0]), &Silent)?;
//! # let file = std::fs::read(&path)?;
//! let mut opening = Opening::new("slope.iqt", file.len() as u64);
//! while let Step::Need(ranges) = opening.next()? {
//!     for range in ranges {
//!         let bytes = file[range.start as usize..range.end as usize].to_vec();
//!         opening.give(range.start, bytes);
//!     }
//! }
//! // What was not needed to open it is read from the source, when it is needed.
//! let terrain = Terrain::opened(opening, Box::new(MemorySource::new("slope.iqt", file)))?;
//! assert_eq!(terrain.height_m(30.0 * 64.0, 30.0 * 64.0)?, Some(512.0));
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "files"))]
//! # fn main() {}
//! ```

use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::file::header::Header;
use crate::file::page_table::PageTable;
use crate::file::source::Source;
use crate::file::structure::read_structure;
use crate::file::version::is_packed;
use crate::packed::source::{FIRST_READ, PackedSource};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What [`Opening::next`] says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Step {
    /// These bytes of the file are needed. Each range lies in the file, and is given whole.
    Need(Vec<Range<u64>>),
    /// All is there.
    Done,
}

/// A terrain file that is being opened.
#[derive(Debug)]
pub struct Opening {
    known: Arc<Known>,
    found: Option<Found>,
}

/// What a file turned out to be, its front checked.
pub(crate) enum Found {
    Plain(Header, PageTable),
    Packed(Box<PackedSource>, Header, PageTable),
}

impl std::fmt::Debug for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Plain(..) => f.write_str("Plain"),
            Self::Packed(..) => f.write_str("Packed"),
        }
    }
}

impl Opening {
    /// Of a file of so many bytes, which messages call `name`.
    pub fn new(name: impl AsRef<Path>, byte_count: u64) -> Self {
        let known = Known {
            path: name.as_ref().to_owned(),
            byte_count: AtomicU64::new(byte_count),
            gathered: Mutex::default(),
        };
        Self { known: Arc::new(known), found: None }
    }

    /// States the file's length anew. Whoever opens a file that others append to asks for its length once more when the first bytes have been given: what a header counts was in the file before the
    /// header was.
    pub fn grown_to(&mut self, byte_count: u64) {
        self.known.byte_count.store(byte_count, Ordering::Relaxed);
    }

    /// What is needed next, if anything.
    ///
    /// # Errors
    /// As FORMAT.md, sections 6 and 9.7: not a terrain file, another version, truncated or damaged.
    #[allow(clippy::should_implement_trait, reason = "it says what is needed, and may fail")]
    pub fn next(&mut self) -> Result<Step, LayoutError> {
        if self.found.is_some() {
            return Ok(Step::Done);
        }
        self.known.lock().missing = None;
        let outcome = look(&self.known);
        // Whatever was said without these bytes does not count.
        if let Some(missing) = self.known.lock().missing.take() {
            return Ok(Step::Need(vec![missing]));
        }
        self.found = Some(outcome?);
        Ok(Step::Done)
    }

    /// Takes bytes of the file from byte `offset` on: those of a range that was asked for, or more.
    pub fn give(&mut self, offset: u64, bytes: Vec<u8>) {
        self.known.lock().parts.push((offset, bytes));
    }

    /// Opens `source` by reading from it.
    ///
    /// # Errors
    /// As [`Opening::next`]; I/O.
    pub(crate) fn of(source: &mut dyn Source) -> Result<Self, LayoutError> {
        let mut opening = Self::new(source.path(), source.byte_count());
        let mut is_first = true;
        while let Step::Need(ranges) = opening.next()? {
            for range in ranges {
                // Not more than the file has: it is asked for within its length.
                let mut bytes = vec![0; crate::file::bytes::to_usize(range.end - range.start)?];
                source.read_at(range.start, &mut bytes)?;
                opening.give(range.start, bytes);
            }
            if std::mem::replace(&mut is_first, false) {
                source.measure_again()?;
                opening.grown_to(source.byte_count());
            }
        }
        Ok(opening)
    }

    /// What was found.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] before all is there.
    pub(crate) fn into_found(self) -> Result<Found, LayoutError> {
        let path = self.known.path.clone();
        self.found.ok_or_else(|| {
            LayoutError::Usage(format!(
                "{}: it is not opened yet; give what is needed until nothing is",
                path.display()
            ))
        })
    }
}

/// Opens what is known of a file.
fn look(known: &Arc<Known>) -> Result<Found, LayoutError> {
    let source = Given(Arc::clone(known));
    if starts_packed(&source)? {
        let packed = Box::new(PackedSource::open(Box::new(source))?);
        let (header, table) = read_structure(&*packed)?;
        return Ok(Found::Packed(packed, header, table));
    }
    let (header, table) = read_structure(&source)?;
    Ok(Found::Plain(header, table))
}

/// Whether a source holds packed terrain, as either header slot says: one of them may be damaged.
pub(crate) fn starts_packed(source: &dyn Source) -> Result<bool, LayoutError> {
    for slot in [0, PAGE_BYTES as u64] {
        let mut start = [0; 16];
        let have = source.byte_count().saturating_sub(slot).min(start.len() as u64) as usize;
        if have > 0 {
            source.read_at(slot, &mut start[..have])?;
        }
        if is_packed(&start[..have]) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What is known of a file.
#[derive(Debug)]
struct Known {
    path: PathBuf,
    byte_count: AtomicU64,
    gathered: Mutex<Gathered>,
}

#[derive(Debug, Default)]
struct Gathered {
    /// Where each part begins, and it.
    parts: Vec<(u64, Vec<u8>)>,
    /// The first range that was read and is not known.
    missing: Option<Range<u64>>,
}

impl Known {
    /// No code that holds the lock can panic halfway through a change.
    fn lock(&self) -> MutexGuard<'_, Gathered> {
        self.gathered.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The file as far as it is known, as a source.
struct Given(Arc<Known>);

impl Source for Given {
    fn path(&self) -> &Path {
        &self.0.path
    }

    fn byte_count(&self) -> u64 {
        self.0.byte_count.load(Ordering::Relaxed)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        let byte_count = self.byte_count();
        let end = offset.saturating_add(buffer.len() as u64);
        if end > byte_count {
            let problem = format!("the file is cut short: it has {byte_count} bytes; copy it again");
            return Err(LayoutError::damaged(self.path(), format!("byte {byte_count}"), problem));
        }
        let mut gathered = self.0.lock();
        for (start, bytes) in &gathered.parts {
            let from = offset.checked_sub(*start).and_then(|from| usize::try_from(from).ok());
            if let Some(found) = from.and_then(|from| bytes.get(from..from.checked_add(buffer.len())?)) {
                buffer.copy_from_slice(found);
                return Ok(());
            }
        }
        // The front is asked for at once, for all that lies in it.
        let needed = if offset < FIRST_READ && gathered.parts.is_empty() {
            0..end.max(FIRST_READ.min(byte_count))
        } else {
            offset..end
        };
        gathered.missing.get_or_insert(needed);
        Err(LayoutError::Usage(format!("{}: more of the file is needed", self.path().display())))
    }
}
