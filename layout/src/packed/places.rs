//! Where tiles lie in a packed file, and their checksums (FORMAT.md, section 9.2).

use super::bounds::{Bounds, UNKNOWN};
use super::leaves::present_numbers;
#[cfg(feature = "files")]
use super::leaves::runs_of;
use super::shape::SEGMENTS;
use crate::file::bytes::{get_u16, get_u32, get_u64, put_u16, put_u32};

/// Bytes of a tile's entry.
pub(crate) const PLACE_BYTES: usize = 24;
/// Bytes of a leaf's entry in the root.
pub(crate) const LEAF_BYTES: usize = 12;

/// Where leaves of the tile directory lie: the packed file's root, without what is absent.
#[derive(Debug)]
pub(crate) struct TileRoot {
    /// Numbers of leaves that are listed, ascending.
    numbers: Vec<u32>,
    /// First byte and checksum of each.
    places: Vec<(u64, u32)>,
}

impl TileRoot {
    /// From the section of a file with so many leaves, which lists them all, or as runs of those that it lists. `None` if it is neither.
    pub(crate) fn parse(bytes: &[u8], leaves: usize, has_runs: bool) -> Option<Self> {
        let place = |entry: &[u8; LEAF_BYTES]| (get_u64(entry, 0), get_u32(entry, 8));
        if !has_runs {
            let (entries, rest) = bytes.as_chunks::<LEAF_BYTES>();
            let listed = (0u32..).zip(entries.iter().map(place)).filter(|(_, (offset, _))| *offset > 0);
            let (numbers, places) = listed.unzip();
            return (rest.is_empty() && entries.len() == leaves).then_some(Self { numbers, places });
        }
        let count = get_u32(bytes.get(..4)?, 0) as usize;
        let runs = bytes.len().checked_sub(count.checked_mul(LEAF_BYTES)?)?;
        let numbers = present_numbers(bytes.get(4..runs)?, leaves as u64, count as u64)?;
        Some(Self { numbers, places: bytes[runs..].as_chunks().0.iter().map(place).collect() })
    }

    /// The section without the places of its leaves, which follow: those with these numbers, ascending, of so many.
    #[cfg(feature = "files")]
    pub(crate) fn begin(leaves: usize, numbers: &[usize], has_runs: bool) -> Vec<u8> {
        if !has_runs {
            return Vec::new();
        }
        let numbers: Vec<u64> = numbers.iter().map(|number| *number as u64).collect();
        let mut bytes = (numbers.len() as u32).to_le_bytes().to_vec();
        bytes.extend(runs_of(leaves as u64, &numbers));
        bytes
    }

    /// Leaves that are listed.
    pub(crate) fn count(&self) -> usize {
        self.numbers.len()
    }

    /// The leaves that are listed and not absent, each with whether its bytes are its own: `bytes_of` says how many a leaf has.
    #[cfg(feature = "files")]
    pub(crate) fn leaves(&self, bytes_of: impl Fn(usize) -> usize) -> Vec<(usize, bool)> {
        let listed = self.numbers.iter().zip(&self.places).filter(|(_, (offset, _))| *offset > 0);
        let mut leaves: Vec<(u64, usize)> =
            listed.map(|(number, (offset, _))| (*offset, *number as usize)).collect();
        leaves.sort_unstable();
        let mut end = 0;
        let is_own = |(offset, leaf): (u64, usize)| {
            let is_own = offset >= end;
            end = end.max(offset.saturating_add(bytes_of(leaf) as u64));
            (leaf, is_own)
        };
        leaves.into_iter().map(is_own).collect()
    }

    /// Which of those that are listed a leaf is, its first byte and its checksum.
    pub(crate) fn find(&self, leaf: usize) -> Option<(usize, u64, u32)> {
        let at = self.numbers.binary_search(&u32::try_from(leaf).ok()?).ok()?;
        let (offset, checksum) = self.places[at];
        (offset > 0).then_some((at, offset, checksum))
    }
}

/// Where a tile lies; all zero if all that it gives is inert.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TilePlace {
    /// First byte, below 2^48.
    pub(crate) offset: u64,
    /// Bytes of each segment.
    pub(crate) lengths: [u16; SEGMENTS],
    pub(crate) checksums: [u32; SEGMENTS],
    /// Those of its segments, if it has any.
    pub(crate) bounds: Bounds,
}

impl Default for TilePlace {
    fn default() -> Self {
        let (lengths, checksums) = Default::default();
        Self { offset: 0, lengths, checksums, bounds: [UNKNOWN; SEGMENTS] }
    }
}

impl TilePlace {
    /// The entry at index `i` of a leaf, without bounds.
    pub(crate) fn read(bytes: &[u8], i: usize) -> Self {
        let at = i * PLACE_BYTES;
        let offset = u64::from(get_u32(bytes, at)) | u64::from(get_u16(bytes, at + 4)) << 32;
        Self {
            offset,
            lengths: std::array::from_fn(|s| get_u16(bytes, at + 6 + 2 * s)),
            checksums: std::array::from_fn(|s| get_u32(bytes, at + 12 + 4 * s)),
            bounds: [UNKNOWN; SEGMENTS],
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

#[cfg(all(test, feature = "files"))]
mod tests {
    use super::*;

    #[test]
    fn leaves_that_lie_in_one_another_are_told() {
        let root = TileRoot {
            numbers: vec![0, 2, 5, 6, 9],
            places: vec![(100, 1), (0, 0), (148, 2), (150, 3), (200, 4)],
        };
        let bytes_of = |leaf| if leaf == 5 { 40 } else { 48 };
        assert_eq!(root.leaves(bytes_of), [(0, true), (5, true), (6, false), (9, true)]);
    }
}
