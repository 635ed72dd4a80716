//! The packed tiles that are in use, unpacked. A few are kept, those used last.
//!
//! Cells are read from north to south. So a tile is needed for its own cell, for the cell of its neighbour, and as the northern neighbour of the next row. When two threads
//! need the same tile, it is unpacked once.

use super::tile::Tile;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};
use terrasoar_layout::error::LayoutError;

/// Tiles that are kept.
const KEPT: usize = 3;
/// Threads that read from packed tiles; each may hold one more that is kept no longer.
pub(super) const WORKERS: usize = 2;

type Slot = Arc<Mutex<Option<Arc<Vec<u8>>>>>;

/// Unpacked tiles by their number.
#[derive(Debug, Default)]
pub(super) struct Unpacked {
    slots: Mutex<VecDeque<(usize, Slot)>>,
}

impl Unpacked {
    /// Most tiles that are in memory at once.
    pub(super) const MOST: usize = KEPT + WORKERS;

    /// The bytes of the packed `tile`, whose number is `number`.
    pub(super) fn bytes(&self, number: usize, tile: &Tile) -> Result<Arc<Vec<u8>>, LayoutError> {
        let slot = {
            let mut slots = self.slots.lock().unwrap_or_else(PoisonError::into_inner);
            let known = slots.iter().position(|(known, _)| *known == number).and_then(|at| slots.remove(at));
            let entry = known.unwrap_or_else(|| (number, Slot::default()));
            let slot = Arc::clone(&entry.1);
            slots.push_front(entry);
            slots.truncate(KEPT);
            slot
        };
        let mut held = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bytes) = &*held {
            return Ok(Arc::clone(bytes));
        }
        let bytes = Arc::new(tile.unpack()?);
        *held = Some(Arc::clone(&bytes));
        Ok(bytes)
    }

    /// Forgets all.
    pub(super) fn clear(&self) {
        self.slots.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}
