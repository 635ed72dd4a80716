//! What unpacking took, and what records would take: for reports.

use super::PackedSource;
use crate::error::LayoutError;
use crate::file::source::{PackedNeed, Unpacked, Unpacking};
use crate::grid::GridPoint;
use crate::grid::order::point_of;
use crate::packed::shape::TileId;
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Counts tiles that are unpacked, by several threads.
#[derive(Debug, Default)]
pub(super) struct Meter {
    tiles: AtomicU64,
    bytes: AtomicU64,
    nanoseconds: AtomicU64,
}

impl Meter {
    /// A tile of so many bytes was unpacked.
    pub(super) fn count(&self, bytes: usize, time: Duration) {
        self.tiles.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
        self.nanoseconds.fetch_add(time.as_nanos() as u64, Ordering::Relaxed);
    }

    pub(super) fn so_far(&self) -> Unpacked {
        Unpacked {
            tiles: self.tiles.load(Ordering::Relaxed),
            bytes: self.bytes.load(Ordering::Relaxed),
            time: Duration::from_nanos(self.nanoseconds.load(Ordering::Relaxed)),
        }
    }
}

impl Unpacking for PackedSource {
    fn unpacked(&self) -> Unpacked {
        self.meter.so_far()
    }

    fn need_of(&self, slots: &[u64], foreseen: &[u64]) -> Result<PackedNeed, LayoutError> {
        let segment_of = |slot: &u64| Some(self.segment_of(point_of(self.header.grid.k(), *slot)?));
        // Segments of each tile: a finer one is read by way of all that are coarser.
        let mut segments: HashMap<TileId, usize> = HashMap::new();
        for (id, segment) in slots.iter().filter_map(segment_of) {
            let most = segments.entry(id).or_default();
            *most = (*most).max(segment + 1);
        }
        // Of what was foreseen, bounds alone.
        for (id, _) in foreseen.iter().filter_map(segment_of) {
            segments.entry(id).or_default();
        }
        let mut need = PackedNeed::default();
        let mut leaves = HashSet::new();
        for (id, segments) in segments {
            let Some((leaf, within)) = self.groups.leaf_of(id) else { continue };
            let place = self.tile_place(leaf, within)?;
            if self.tile_root.find(leaf).is_some() && leaves.insert(leaf) {
                need.bound_bytes += self.bounds_bytes(self.groups.leaf_size(leaf)) as u64;
            }
            if place.is_present() && segments > 0 {
                need.tiles += 1;
                need.bytes += place.bytes(segments) as u64;
            }
        }
        Ok(need)
    }

    fn has_bounds(&self) -> bool {
        self.container.has_bounds()
    }

    fn bound_m(&self, p: GridPoint) -> f64 {
        self.bound_m(p)
    }

    fn is_packed_record_page(&self, page: u64) -> bool {
        self.is_packed_record_page(page)
    }

    fn is_packed_root(&self, page: u64) -> bool {
        self.root_page == page
    }

    #[cfg(feature = "files")]
    fn wrong_bounds(&self) -> Result<Vec<(String, String)>, LayoutError> {
        self.wrong_bounds()
    }
}
