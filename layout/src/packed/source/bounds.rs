//! What is known of errors before records are read, and whether it is true.

use super::{FIRST_PAGE, PackedSource};
use crate::error::LayoutError;
use crate::grid::GridPoint;
use crate::grid::record::AnyCodec;
use crate::packed::bounds::{BOUND_BYTES, SUM_BYTES, bounds_of};
use crate::packed::places::PLACE_BYTES;
use crate::packed::shape::{SEGMENTS, TileId, TileShape};

impl PackedSource {
    /// Bytes behind the entries of a leaf of so many tiles.
    pub(super) fn bounds_bytes(&self, tiles: usize) -> usize {
        if self.container.has_bounds() { tiles * BOUND_BYTES + SUM_BYTES } else { 0 }
    }

    /// The tile that gives the record of a vertex, and the segment.
    pub(super) fn segment_of(&self, p: GridPoint) -> (TileId, usize) {
        let octave = self.groups.octave(p);
        let (id, _) = self.groups.tile_of(p, octave);
        let shape = self.groups.shape(id);
        let within = octave.saturating_sub(shape.stride_log).min(shape.tile_log.saturating_sub(1));
        (id, TileShape::segment_of(within))
    }

    /// What no error of the packed record at `p` exceeds, in metres.
    pub(super) fn bound_m(&self, p: GridPoint) -> f64 {
        let (id, segment) = self.segment_of(p);
        // Who cannot read where a tile lies will be told so when its records are read.
        let place = self.groups.leaf_of(id).and_then(|(leaf, within)| self.tile_place(leaf, within).ok());
        place.map_or(f64::INFINITY, |place| self.bounds.metres(place.bounds[segment]))
    }

    /// Whether a page of the terrain file is a record page that is packed.
    pub(super) fn is_packed_record_page(&self, page: u64) -> bool {
        (FIRST_PAGE..FIRST_PAGE + self.container.pages).contains(&page)
    }

    /// Bounds that are not those of their tiles: where, and what is wrong.
    #[cfg(feature = "files")]
    pub(super) fn wrong_bounds(&self) -> Result<Vec<(String, String)>, LayoutError> {
        use rayon::prelude::*;
        if !self.container.has_bounds() {
            return Ok(Vec::new());
        }
        let bytes_of = |leaf| {
            let tiles = self.groups.leaf_size(leaf);
            tiles * PLACE_BYTES + self.bounds_bytes(tiles)
        };
        let wrong = |(leaf, is_own): (usize, bool)| {
            // Else a small file could name the same tiles as often as it likes.
            let problem = "another one lies where it does";
            let is_shared = vec![(format!("tile directory leaf {leaf}"), problem.into())];
            if is_own { self.wrong_bounds_in(leaf) } else { Ok(is_shared) }
        };
        let wrong = self.tile_root.leaves(bytes_of).into_par_iter().map(wrong);
        Ok(wrong.collect::<Result<Vec<_>, LayoutError>>()?.concat())
    }

    /// The same in a leaf of the tile directory. What keeps a tile from being read is found by reading its records.
    #[cfg(feature = "files")]
    fn wrong_bounds_in(&self, leaf: usize) -> Result<Vec<(String, String)>, LayoutError> {
        let bytes = match self.leaf_bytes(leaf) {
            Err(LayoutError::Damaged { .. }) => return Ok(Vec::new()),
            bytes => bytes?,
        };
        let Some(bounds) = bounds_of(&bytes, self.groups.leaf_size(leaf)) else {
            let problem = "the checksum of its bounds does not match; the ground is read without them";
            return Ok(vec![(format!("tile directory leaf {leaf}"), problem.into())]);
        };
        let codec = AnyCodec::new(self.header.record_kind, &self.header.grid, &self.header.scale);
        let mut wrong = Vec::new();
        for ((within, id), bounds) in (0..).zip(self.groups.tiles_in(leaf)).zip(bounds) {
            let (place, shape) = (self.tile_place(leaf, within)?, self.groups.shape(id));
            if !place.is_present() {
                continue;
            }
            let records = match self.unpack(id, &shape, &place, SEGMENTS) {
                Err(LayoutError::Damaged { .. }) => continue,
                records => records?,
            };
            let needed = self.bounds.of_tile(&codec, &shape, &records);
            if needed.iter().zip(bounds).any(|(needed, bound)| needed > bound) {
                let ([x, y], stride) = (id.at, 1u64 << shape.stride_log);
                let problem = "a bound is below the error of a record: that ground may be left coarse; pack the terrain again";
                wrong.push((format!("tile {x}, {y} of stride {stride}"), problem.into()));
            }
        }
        Ok(wrong)
    }
}
