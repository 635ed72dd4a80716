//! Where tiles lie in a packed file, and their checksums (FORMAT.md, section 9.2).

use super::shape::SEGMENTS;
use crate::file::bytes::{get_u16, get_u32, put_u16, put_u32};

/// Bytes of a tile's entry.
pub(crate) const PLACE_BYTES: usize = 24;
/// Bytes of a leaf's entry in the root.
pub(crate) const LEAF_BYTES: usize = 12;

/// Where a tile lies; all zero if all that it gives is inert.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct TilePlace {
    /// First byte, below 2^48.
    pub(crate) offset: u64,
    /// Bytes of each segment.
    pub(crate) lengths: [u16; SEGMENTS],
    pub(crate) checksums: [u32; SEGMENTS],
}

impl TilePlace {
    /// The entry at index `i` of a leaf.
    pub(crate) fn read(bytes: &[u8], i: usize) -> Self {
        let at = i * PLACE_BYTES;
        let offset = u64::from(get_u32(bytes, at)) | u64::from(get_u16(bytes, at + 4)) << 32;
        Self {
            offset,
            lengths: std::array::from_fn(|s| get_u16(bytes, at + 6 + 2 * s)),
            checksums: std::array::from_fn(|s| get_u32(bytes, at + 12 + 4 * s)),
        }
    }

    /// Stores the entry at index `i` of a leaf.
    pub(crate) fn write(&self, bytes: &mut [u8], i: usize) {
        let at = i * PLACE_BYTES;
        put_u32(bytes, at, self.offset as u32);
        put_u16(bytes, at + 4, (self.offset >> 32) as u16);
        for s in 0..SEGMENTS {
            put_u16(bytes, at + 6 + 2 * s, self.lengths[s]);
            put_u32(bytes, at + 12 + 4 * s, self.checksums[s]);
        }
    }

    /// Whether there is anything.
    pub(crate) fn is_present(&self) -> bool {
        self.lengths[0] > 0
    }

    /// Bytes of the first `segments`.
    pub(crate) fn bytes(&self, segments: usize) -> usize {
        self.lengths[..segments].iter().map(|length| usize::from(*length)).sum()
    }
}
