//! The terrain file as a read-only memory map. memmap2 is used in this file only.
//!
//! Contract: while a map is open nobody may truncate the file or the process gets SIGBUS at the next touch of a
//! missing page. Opening takes a shared advisory lock, and writers of this crate rename a new file over the old one, which leaves the mapped one
//! intact, or append behind what a reader reaches and rewrite a header page that is never read through a map (FORMAT.md, section 8.5). Programs that
//! do otherwise are outside the contract; use [`PreadSource`](super::PreadSource) for files on storage others may truncate.

use super::{PreadSource, Source};
use crate::error::LayoutError;
use memmap2::{Advice, Mmap, MmapOptions};
use std::path::Path;

/// A memory-mapped terrain file.
#[derive(Debug)]
pub struct MapSource {
    file: PreadSource,
    map: Mmap,
}

impl MapSource {
    /// Maps the file at `path`, advising the kernel of random access: its default read-ahead would load the whole file.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if the file cannot be opened or mapped.
    pub fn open(path: &Path) -> Result<Self, LayoutError> {
        Self::map(PreadSource::open(path)?)
    }

    /// Maps an opened file over the length it had when it was opened.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if the file cannot be mapped.
    pub fn map(file: PreadSource) -> Result<Self, LayoutError> {
        let length = crate::bytes::to_usize(file.byte_count())?;
        #[expect(unsafe_code, reason = "mapping a file is unsafe for what others may do to it")]
        // SAFETY: the map is read-only. Nobody changes bytes that are read through it: writers of this crate replace files by
        // renaming or append behind what this reader's header counts (FORMAT.md, section 8.5), and the shared lock taken at opening
        // keeps out those that ask. Truncation by others raises SIGBUS, which is
        // the documented contract of this type; any bytes decode to some record, so changed bytes are no undefined
        // behaviour of ours beyond what the operating system itself does.
        let map = unsafe { MmapOptions::new().len(length).map(file.file()) }
            .map_err(|e| LayoutError::io(file.path(), "cannot map the file into memory", e))?;
        // Advice is only that: a kernel without it still reads correctly.
        let _ = map.advise(Advice::Random);
        Ok(Self { file, map })
    }
}

impl Source for MapSource {
    fn path(&self) -> &Path {
        self.file.path()
    }

    fn byte_count(&self) -> u64 {
        self.file.byte_count()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.file.read_at(offset, buffer)
    }

    fn bytes(&self) -> Option<&[u8]> {
        Some(&self.map)
    }
}
