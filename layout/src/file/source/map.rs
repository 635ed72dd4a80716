//! The terrain file as a read-only memory map. memmap2 is used in this file only.
//!
//! Contract: while a map is open no program may truncate the file; otherwise the process gets SIGBUS when it touches a
//! missing page. Opening takes a shared advisory lock, and writers of this crate rename a new file over the old one, which leaves the mapped one
//! intact, or append behind what a reader reaches and rewrite a header page that is never read through a map (FORMAT.md, section 8.5). Programs that
//! do otherwise are outside the contract; use [`PreadSource`](super::PreadSource) for files on storage others may truncate.

use super::{PreadSource, Source};
use crate::error::LayoutError;
use memmap2::{Mmap, MmapOptions};
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
        let length = crate::file::bytes::to_usize(file.byte_count())?;
        #[expect(unsafe_code, reason = "mapping a file is unsafe for what others may do to it")]
        // SAFETY: the map is read-only. Nobody changes bytes that are read through it: writers of this crate replace files by
        // renaming or append behind what this reader's header counts (FORMAT.md, section 8.5), and the shared lock taken at opening
        // keeps out those that ask. Truncation by others raises SIGBUS, which is
        // the documented contract of this type; any bytes decode to some record, so changed bytes are no undefined
        // behaviour of ours beyond what the operating system itself does.
        let map = unsafe { MmapOptions::new().len(length).map(file.file()) }
            .map_err(|e| LayoutError::io(file.path(), "cannot map the file into memory", e))?;
        // Advice is only that: a kernel without it still reads correctly, and Windows takes none for maps.
        #[cfg(unix)]
        let _ = map.advise(memmap2::Advice::Random);
        Ok(Self { file, map })
    }
}

/// Bytes of the file at `path` that the system holds in memory, whoever had them read, in whole pages; `None` where it does not tell. Touches none of them.
///
/// # Errors
/// As [`MapSource::open`].
pub fn resident_bytes(path: &Path) -> Result<Option<u64>, LayoutError> {
    let source = MapSource::open(path)?;
    Ok(source.resident_bytes())
}

impl MapSource {
    #[cfg(target_os = "linux")]
    fn resident_bytes(&self) -> Option<u64> {
        let page_bytes = rustix::param::page_size();
        let mut pages = vec![0u8; self.map.len().div_ceil(page_bytes)];
        #[expect(unsafe_code, reason = "the call fills an array of the caller's")]
        // SAFETY: address and length are those of a live map, which begins on a page; the array has a byte for each page that the map begins. The map is only asked about.
        let answer =
            unsafe { libc::mincore(self.map.as_ptr().cast_mut().cast(), self.map.len(), pages.as_mut_ptr()) };
        let resident = pages.iter().filter(|page| **page & 1 == 1).count();
        (answer == 0).then_some(resident as u64 * page_bytes as u64)
    }

    #[cfg(not(target_os = "linux"))]
    fn resident_bytes(&self) -> Option<u64> {
        None
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_file_just_written_is_in_memory() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, vec![7; 100_001]).unwrap();
        let resident = resident_bytes(&path).unwrap().unwrap();
        // A file system without a cache of its own holds nothing.
        assert!(resident == 0 || resident >= 100_001, "{resident}");
        assert!(resident <= 100_001u64.next_multiple_of(65_536), "{resident}");
        assert!(resident_bytes(&folder.path().join("none")).is_err());
    }
}
