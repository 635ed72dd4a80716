//! Tiles that were unpacked last.
//!
//! Neighbouring pages need the same tiles, for a page's vertices lie in a few. Invariant: tiles take no more than the stated bytes, or one tile. Cost: a lock and a look a tile and page.

use super::shape::TileId;
use super::tile::TileRecords;
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// Tiles in memory. A full cache drops one that was not asked for since the last round.
#[derive(Debug)]
pub(crate) struct Cache {
    most_bytes: AtomicUsize,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    tiles: HashMap<TileId, Kept>,
    round: VecDeque<TileId>,
    bytes: usize,
}

#[derive(Debug)]
struct Kept {
    tile: Arc<TileRecords>,
    is_recent: bool,
}

impl Cache {
    pub(crate) fn new(most_bytes: usize) -> Self {
        Self { most_bytes: AtomicUsize::new(most_bytes), inner: Mutex::default() }
    }

    /// Begins anew: nothing is kept, and from now on no more than so many bytes, one tile excepted.
    pub(crate) fn restart(&self, most_bytes: usize) {
        *self.inner.lock().unwrap_or_else(PoisonError::into_inner) = Inner::default();
        self.most_bytes.store(most_bytes, Ordering::Relaxed);
    }

    /// A tile that goes down to octave `finest`, counted from its own finest.
    pub(crate) fn get(&self, id: TileId, finest: u32) -> Option<Arc<TileRecords>> {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = inner.tiles.get_mut(&id).filter(|kept| kept.tile.finest <= finest)?;
        kept.is_recent = true;
        Some(Arc::clone(&kept.tile))
    }

    pub(crate) fn put(&self, id: TileId, tile: Arc<TileRecords>) {
        let mut guard = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        let inner = &mut *guard;
        inner.bytes += tile.bytes();
        match inner.tiles.insert(id, Kept { tile, is_recent: true }) {
            Some(before) => inner.bytes -= before.tile.bytes(),
            None => inner.round.push_back(id),
        }
        while inner.bytes > self.most_bytes.load(Ordering::Relaxed) && inner.round.len() > 1 {
            let Some(first) = inner.round.pop_front() else { break };
            match inner.tiles.get_mut(&first) {
                Some(kept) if kept.is_recent && first != id => {
                    kept.is_recent = false;
                    inner.round.push_back(first);
                }
                Some(_) if first == id => inner.round.push_back(first),
                Some(_) => inner.bytes -= inner.tiles.remove(&first).map_or(0, |kept| kept.tile.bytes()),
                None => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::shape::TileShape;

    #[test]
    fn tiles_take_no_more_than_they_may() {
        let shape = TileShape { stride_log: 0, tile_log: 6, is_top: false, is_last: [false; 2] };
        let tile = |finest| Arc::new(TileRecords::inert(&shape, finest));
        let mut most_bytes = 10 * tile(0).bytes();
        let cache = Cache::new(most_bytes);
        for i in 0..1000u32 {
            if i == 500 {
                most_bytes = 4 * tile(0).bytes();
                cache.restart(most_bytes);
                cache.put(TileId { group: 1, at: [0; 2] }, tile(0));
            }
            let id = TileId { group: 0, at: [i % 40, i / 40 % 3] };
            let finest = i % 3;
            if cache.get(id, finest).is_none() {
                cache.put(id, tile(finest));
            }
            assert!(cache.get(id, finest).is_some_and(|tile| tile.finest <= finest));
            let inner = cache.inner.lock().unwrap();
            assert!(inner.bytes <= most_bytes);
            assert_eq!(inner.bytes, inner.tiles.values().map(|kept| kept.tile.bytes()).sum::<usize>());
            assert_eq!(inner.round.len(), inner.tiles.len());
        }
    }
}
