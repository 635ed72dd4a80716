//! What reading a packed file takes beyond the bytes of its pages: tiles that are read and unpacked.

use crate::error::LayoutError;
use std::time::Duration;

/// What was read and unpacked of a packed file since it was opened. A tile that was still in memory counts for nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Unpacked {
    /// Tiles, each time one was unpacked.
    pub tiles: u64,
    /// Bytes of them in the file.
    pub bytes: u64,
    /// Time spent in unpacking, over all threads, reading left out.
    pub time: Duration,
}

/// What some records take to be read from a packed file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PackedNeed {
    /// Distinct tiles that they lie in.
    pub tiles: u64,
    /// Bytes of the segments of these that hold them, and of the coarser segments before.
    pub bytes: u64,
}

/// A source that unpacks what it gives.
pub trait Unpacking {
    /// What it did so far.
    fn unpacked(&self) -> Unpacked;

    /// What the records at `slots` take, in whatever order they are named, however often. Slots of no vertex take nothing, nor do records that are inert by whole tiles, nor what was
    /// appended to the file since it was packed.
    ///
    /// # Errors
    /// A tile directory that is damaged; I/O.
    fn need_of(&self, slots: &[u64]) -> Result<PackedNeed, LayoutError>;
}
