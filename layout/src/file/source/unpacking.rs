//! What reading a packed file takes beyond the bytes of its pages: tiles that are read and unpacked.

use crate::error::LayoutError;
use crate::grid::GridPoint;
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
    /// Bytes of the bounds that are read with the directory of these tiles, and of those that were foreseen.
    pub bound_bytes: u64,
}

/// A source that unpacks what it gives.
pub trait Unpacking {
    /// What it did so far.
    fn unpacked(&self) -> Unpacked;

    /// What the records at `slots` take, in whatever order they are named, however often, where those at `foreseen` are left unread for what their bounds say. Slots of no vertex take nothing, nor do
    /// records that are inert by whole tiles, nor what was appended to the file since it was packed.
    ///
    /// # Errors
    /// A tile directory that is damaged; I/O.
    fn need_of(&self, slots: &[u64], foreseen: &[u64]) -> Result<PackedNeed, LayoutError>;

    /// Whether bounds of errors were packed with the tiles.
    fn has_bounds(&self) -> bool;

    /// What no error of the record of the vertex at `p` exceeds, in metres, as it was packed, told without reading it; infinite where that is not known.
    fn bound_m(&self, p: GridPoint) -> f64;

    /// Whether a page of the terrain file is a record page as it was packed, and none that was appended since.
    fn is_packed_record_page(&self, page: u64) -> bool;

    /// Whether the directory root that begins with this page leads to nothing but such pages.
    fn is_packed_root(&self, page: u64) -> bool;

    /// Where bounds are not those of their tiles, and what is wrong with them. It unpacks all tiles.
    ///
    /// # Errors
    /// I/O.
    #[cfg(feature = "files")]
    fn wrong_bounds(&self) -> Result<Vec<(String, String)>, LayoutError>;
}
