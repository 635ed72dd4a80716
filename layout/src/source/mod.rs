//! Where the bytes of a terrain file come from: one trait under everything, so that a map, plain reads, memory, counting and
//! failing sources interchange.
//!
//! A source's length is fixed when it is opened. A source may lend its bytes as one slice (a map, memory); the refinement's hot path
//! needs that, everything else reads.

mod map;
mod memory;
mod pread;
#[cfg(any(test, feature = "testing"))]
mod testing;

pub use map::MapSource;
pub use memory::MemorySource;
pub use pread::PreadSource;
#[cfg(any(test, feature = "testing"))]
pub use testing::{CountingSource, FailingSource, Fault, HostileSource, Hostility};

use crate::error::LayoutError;
use std::path::Path;

/// Random access to the bytes of one terrain file.
pub trait Source: Send + Sync {
    /// Name for messages.
    fn path(&self) -> &Path;

    /// Length in bytes when it was opened.
    fn byte_count(&self) -> u64;

    /// Fills `buffer` with the bytes at `offset`.
    ///
    /// # Errors
    /// [`LayoutError::Io`], or [`LayoutError::Damaged`] if the file has become shorter.
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError>;

    /// All bytes, if the source has them in its address space.
    fn bytes(&self) -> Option<&[u8]> {
        None
    }
}
