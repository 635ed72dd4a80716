//! What the benchmark of unpacking looks at.

use super::PackedSource;
use crate::error::LayoutError;
use crate::file::source::Source;
use crate::packed::model::DecodeTables;
use crate::packed::places::TilePlace;
use crate::packed::rules::Rules;
use crate::packed::shape::{TileId, TileShape};
use crate::packed::way::Way;
use crate::packed::wide::Width;

impl PackedSource {
    pub(in crate::packed) fn set_width(&mut self, width: Width) {
        self.width = width;
    }

    pub(in crate::packed) fn width(&self) -> Width {
        self.width
    }

    pub(in crate::packed) fn packed(&self) -> &dyn Source {
        &*self.inner
    }

    /// `None` where records are exact.
    pub(in crate::packed) fn rules(&self) -> Option<&Rules> {
        match &self.way {
            Way::Compact(rules) => Some(rules),
            Way::Exact(_) => None,
        }
    }

    pub(in crate::packed) fn tables(&self) -> &DecodeTables {
        &self.tables
    }

    /// Record pages that are present.
    pub(in crate::packed) fn record_pages(&self) -> u64 {
        self.header.stored_pages
    }

    pub(in crate::packed) fn tiles_unpacked(&self) -> u64 {
        self.meter.so_far().tiles
    }

    /// All tiles that are present.
    pub(in crate::packed) fn all_tiles(&self) -> Result<Vec<(TileId, TileShape, TilePlace)>, LayoutError> {
        let mut all = Vec::new();
        for leaf in 0..self.groups.leaves {
            for (within, id) in self.groups.tiles_in(leaf).enumerate() {
                let place = self.tile_place(leaf, within)?;
                if place.is_present() {
                    all.push((id, self.groups.shape(id), place));
                }
            }
        }
        Ok(all)
    }
}
