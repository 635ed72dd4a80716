//! What no error of a segment's records exceeds, in a byte that is told before the segment is read (FORMAT.md, section 9.2).
//!
//! An engine that knows a vertex's parent, and this of the vertex, can often tell that the vertex does not show, and leaves its segment unread. Invariant: a bound in metres is at least each error, so a reader
//! may be told too much and never too little.

use super::shape::{SEGMENTS, TileShape};
use super::tile::TileRecords;
use crate::file::bytes::checksum;
use crate::grid::octave::OctaveTable;
use crate::grid::record::AnyCodec;

/// Bounds of a tile's segments.
pub(crate) type Bounds = [u8; SEGMENTS];
/// Bytes of these.
pub(crate) const BOUND_BYTES: usize = SEGMENTS;
/// Bytes of the checksum behind the bounds of a leaf.
pub(crate) const SUM_BYTES: usize = 4;

/// Nothing is known.
pub(crate) const UNKNOWN: u8 = 255;

/// Steps of a bound in an octave.
const STEPS: u32 = 8;
/// Bounds a metre of bound 0.
const LEAST: f64 = (1u32 << 18) as f64;

/// What bounds stand for.
#[derive(Debug)]
pub(crate) struct BoundTable(OctaveTable);

impl BoundTable {
    pub(crate) fn new() -> Self {
        Self(OctaveTable::new(STEPS))
    }

    /// The bound of an error in metres.
    pub(crate) fn of(&self, error_m: f64) -> u8 {
        self.0.index_at_least(error_m * LEAST).unwrap_or(UNKNOWN)
    }

    /// Metres that no error exceeds; infinite if nothing is known.
    pub(crate) fn metres(&self, bound: u8) -> f64 {
        if bound == UNKNOWN { f64::INFINITY } else { self.0.power(bound) / LEAST }
    }

    /// Bounds of the records that a tile gives, down to the finest that there are.
    pub(crate) fn of_tile(&self, codec: &AnyCodec, shape: &TileShape, records: &TileRecords) -> Bounds {
        let mut most_m = [0.0f64; SEGMENTS];
        for octave in records.finest..shape.delivered() {
            let most_m = &mut most_m[TileShape::segment_of(octave)];
            let levels = [1, 0].map(|white| 2 * (shape.stride_log + octave) + white);
            records.for_each_given(shape, octave, |is_black, words| {
                let mut bytes = [0; 16];
                bytes.as_chunks_mut().0.iter_mut().zip(words).for_each(|(to, word)| *to = word.to_le_bytes());
                *most_m = most_m.max(codec.decode(&bytes, levels[usize::from(is_black)]).error_m);
            });
        }
        most_m.map(|error_m| self.of(error_m))
    }
}

/// The bounds of a leaf of so many tiles, of what was read for it: its entries, bounds and checksum. `None` if they do not match that.
pub(crate) fn bounds_of(leaf: &[u8], tiles: usize) -> Option<&[Bounds]> {
    let (content, sum) = leaf.split_last_chunk::<SUM_BYTES>()?;
    let at = content.len().checked_sub(tiles * BOUND_BYTES)?;
    (checksum(content) == u32::from_le_bytes(*sum)).then(|| content[at..].as_chunks().0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bound_is_not_below_its_error_and_little_above() {
        let table = BoundTable::new();
        for i in 0..3000 {
            let error_m = 1e-5 * 1.007f64.powi(i);
            let bound_m = table.metres(table.of(error_m));
            assert!(bound_m >= error_m, "{error_m}");
            assert!(bound_m < error_m * 1.0906 || error_m > 14_000.0, "{error_m}: {bound_m}");
        }
        assert_eq!(table.metres(table.of(0.0)), 1.0 / LEAST);
        assert_eq!(table.of(f64::INFINITY), UNKNOWN);
        assert_eq!(table.metres(UNKNOWN), f64::INFINITY);
    }

    #[test]
    fn a_leaf_that_was_changed_has_no_bounds() {
        let mut leaf: Vec<u8> = (0..2 * 24 + 2 * BOUND_BYTES as u8).collect();
        leaf.extend(checksum(&leaf).to_le_bytes());
        assert_eq!(bounds_of(&leaf, 2), Some(&[[48, 49, 50], [51, 52, 53]][..]));
        for at in 0..leaf.len() {
            let mut changed = leaf.clone();
            changed[at] ^= 4;
            assert_eq!(bounds_of(&changed, 2), None, "{at}");
        }
        assert_eq!(bounds_of(&leaf[..3], 2), None);
    }
}
