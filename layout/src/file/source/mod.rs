//! Where the bytes of a terrain file come from: one trait under everything, so that a map, plain reads, many reads at once, memory, counting and
//! failing sources interchange.
//!
//! A source's length is fixed when it is opened. A source may lend its bytes as one slice (a map, memory); the refinement's hot path
//! needs that, everything else reads.

#[cfg(feature = "files")]
mod layered;
#[cfg(feature = "files")]
mod map;
mod memory;
#[cfg(feature = "files")]
mod pread;
#[cfg(any(test, feature = "testing"))]
mod testing;
mod unpacking;
#[cfg(all(feature = "files", target_os = "linux"))]
mod uring;

#[cfg(feature = "files")]
pub(crate) use layered::{LayeredSource, split_of};
#[cfg(feature = "files")]
pub use map::{MapSource, resident_bytes};
pub use memory::MemorySource;
#[cfg(feature = "files")]
pub use pread::PreadSource;
#[cfg(any(test, feature = "testing"))]
pub use testing::{CountingSource, FailingSource, Fault, HostileSource, Hostility};
pub use unpacking::{PackedNeed, Unpacked, Unpacking};

#[cfg(all(feature = "files", target_os = "linux"))]
pub use uring::UringSource;

use super::packed_end::PackedEnd;
use crate::error::LayoutError;
use std::path::Path;

/// For a look through a source that is needed on.
impl<S: Source + ?Sized> Source for &S {
    fn path(&self) -> &Path {
        (**self).path()
    }

    fn base_path(&self) -> Option<&Path> {
        (**self).base_path()
    }

    fn base_has_grown(&self) -> bool {
        (**self).base_has_grown()
    }

    fn byte_count(&self) -> u64 {
        (**self).byte_count()
    }

    fn packed_bytes(&self) -> Option<u64> {
        (**self).packed_bytes()
    }

    fn packed_end(&self) -> Option<&PackedEnd> {
        (**self).packed_end()
    }

    fn unpacking(&self) -> Option<&dyn Unpacking> {
        (**self).unpacking()
    }

    fn take_share(&self, cache_bytes: u64) -> u64 {
        (**self).take_share(cache_bytes)
    }

    fn own_start(&self) -> u64 {
        (**self).own_start()
    }

    fn read_end(&self, buffer: &mut [u8]) -> Result<bool, LayoutError> {
        (**self).read_end(buffer)
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        (**self).read_at(offset, buffer)
    }
}

/// One of several reads that are made together.
#[derive(Debug)]
pub struct ReadJob<'b> {
    /// Where it begins.
    pub offset: u64,
    /// What it fills.
    pub buffer: &'b mut [u8],
    /// What became of it.
    pub outcome: Result<(), LayoutError>,
}

impl<'b> ReadJob<'b> {
    /// A read of `buffer` at `offset` that is yet to be made.
    pub fn new(offset: u64, buffer: &'b mut [u8]) -> Self {
        Self { offset, buffer, outcome: Ok(()) }
    }
}

/// Random access to the bytes of one terrain file.
pub trait Source: Send + Sync {
    /// Name for messages.
    fn path(&self) -> &Path;

    /// The file under an overlay of edits, whose own name [`Source::path`] is.
    fn base_path(&self) -> Option<&Path> {
        None
    }

    /// Whether that file was edited or draped after the overlay was made, which shows it as it was.
    fn base_has_grown(&self) -> bool {
        false
    }

    /// Length in bytes when it was opened.
    fn byte_count(&self) -> u64;

    /// Length in bytes of the packed file that the terrain file is unpacked from as it is read; `None` for one that is not packed.
    fn packed_bytes(&self) -> Option<u64> {
        None
    }

    /// Where a packed file grows; `None` for one that is not packed.
    fn packed_end(&self) -> Option<&PackedEnd> {
        None
    }

    /// What unpacking takes, of a source that unpacks what it gives; `None` for all others.
    fn unpacking(&self) -> Option<&dyn Unpacking> {
        None
    }

    /// Takes the length as it is now for that when it was opened.
    ///
    /// # Errors
    /// [`LayoutError::Io`].
    fn measure_again(&mut self) -> Result<(), LayoutError> {
        Ok(())
    }

    /// Bytes, of the `cache_bytes` that a pool of pages is given, that this source takes for itself: what it unpacks is kept in them. The pool that was made last decides, and finds nothing kept.
    fn take_share(&self, cache_bytes: u64) -> u64 {
        let _ = cache_bytes;
        0
    }

    /// Offset at which the header slots lie: 0, or where an overlay begins behind its base.
    fn own_start(&self) -> u64 {
        0
    }

    /// Fills `buffer` with the last bytes of the file itself, packed or not, as long as it was when it was opened; of two files, of the one with the header slots. Whether it has so many.
    ///
    /// # Errors
    /// As [`Source::read_at`].
    fn read_end(&self, buffer: &mut [u8]) -> Result<bool, LayoutError> {
        let Some(at) = self.byte_count().checked_sub(buffer.len() as u64) else { return Ok(false) };
        self.read_at(at, buffer)?;
        Ok(true)
    }

    /// Fills `buffer` with the bytes at `offset`.
    ///
    /// # Errors
    /// [`LayoutError::Io`], or [`LayoutError::Damaged`] if the file has become shorter.
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError>;

    /// Makes several reads; each is told its own outcome. One after the other, unless the source can have many under way.
    fn read_many(&self, jobs: &mut [ReadJob<'_>]) {
        for job in jobs {
            job.outcome = self.read_at(job.offset, job.buffer);
        }
    }

    /// Reads that are worth making together; 1 for sources that make one at a time.
    fn depth(&self) -> usize {
        1
    }

    /// All bytes, if the source has them in its address space: in one slice, or from the start up to those that [`Source::bytes_behind`] has.
    fn bytes(&self) -> Option<&[u8]> {
        None
    }

    /// Whether the source has its bytes in its address space, or will bring them there when it is asked for them. Costs nothing.
    fn lends(&self) -> bool {
        self.bytes().is_some()
    }

    /// As [`Source::bytes`], of a source that brings its bytes there first; `None` for one that never does.
    ///
    /// # Errors
    /// What kept it from that: damage, I/O, too little memory.
    fn lend(&self) -> Result<Option<&[u8]>, LayoutError> {
        Ok(self.bytes())
    }

    /// Bytes that follow in another slice, and the offset of the first of them; `None` for all sources but those of two files.
    fn bytes_behind(&self) -> Option<(u64, &[u8])> {
        None
    }
}
