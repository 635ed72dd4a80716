//! Where pages lie now: where the terrain's directory says, except those that were committed elsewhere since it was opened.
//!
//! Invariant: the newest place counts. Cost: some 24 bytes a page that lies elsewhere; one that is back where it was costs nothing.

use crate::file::entries::Entry;
use crate::read::terrain::Terrain;
use std::collections::HashMap;

/// Entries other than the directory's.
#[derive(Debug, Default)]
pub(super) struct Places(HashMap<u64, Entry>);

impl Places {
    /// Where a logical page of `terrain` lies; absent for pages that it has not.
    pub(super) fn of(&self, terrain: &Terrain, page: u64) -> Entry {
        self.0.get(&page).copied().unwrap_or_else(|| opened(terrain, page).unwrap_or_default())
    }

    /// A page lies there from now on.
    pub(super) fn set(&mut self, terrain: &Terrain, page: u64, entry: Entry) {
        match opened(terrain, page) {
            None => {}
            Some(first) if first == entry => {
                self.0.remove(&page);
            }
            Some(_) => {
                self.0.insert(page, entry);
            }
        }
    }
}

/// Where a page lay when the terrain was opened.
fn opened(terrain: &Terrain, page: u64) -> Option<Entry> {
    terrain.entries().get(usize::try_from(page).ok()?).copied()
}
