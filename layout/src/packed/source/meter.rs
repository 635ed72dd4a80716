//! What unpacking took, and what records would take: for reports.

use super::PackedSource;
use crate::error::LayoutError;
use crate::file::source::{PackedNeed, Unpacked, Unpacking};
use crate::grid::order::point_of;
use crate::packed::shape::{TileId, TileShape};
use std::collections::HashMap;
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

    fn need_of(&self, slots: &[u64]) -> Result<PackedNeed, LayoutError> {
        // Segments of each tile: a finer one is read by way of all that are coarser.
        let mut segments: HashMap<TileId, usize> = HashMap::new();
        for slot in slots {
            let Some(p) = point_of(self.header.grid.k(), *slot) else { continue };
            let octave = self.groups.octave(p);
            let (id, _) = self.groups.tile_of(p, octave);
            let shape = self.groups.shape(id);
            let within = octave.saturating_sub(shape.stride_log).min(shape.tile_log.saturating_sub(1));
            let most = segments.entry(id).or_default();
            *most = (*most).max(TileShape::segment_of(within) + 1);
        }
        let mut need = PackedNeed::default();
        for (id, segments) in segments {
            let Some((leaf, within)) = self.groups.leaf_of(id) else { continue };
            let place = self.tile_place(leaf, within)?;
            if place.is_present() {
                need.tiles += 1;
                need.bytes += place.bytes(segments) as u64;
            }
        }
        Ok(need)
    }
}
