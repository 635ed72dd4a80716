//! Where pages lie now: where the terrain's directory says, except those that were committed elsewhere since it was opened.
//!
//! Invariant: the newest place counts. Cost: some 24 bytes a page that lies elsewhere; one that is back where it was, in a directory leaf that was read, costs nothing.

use crate::file::entries::Entry;
use crate::read::terrain::Terrain;
use std::collections::HashMap;

/// Entries other than the directory's.
#[derive(Debug, Default)]
pub(super) struct Places(HashMap<u64, Entry>);

impl Places {
    /// Where a logical page of `terrain` lies; absent for pages that it has not, `None` while its directory leaf was not read.
    pub(super) fn of(&self, terrain: &Terrain, page: u64) -> Option<Entry> {
        self.0.get(&page).copied().or_else(|| terrain.known_entry(page))
    }

    /// A page lies there from now on.
    pub(super) fn set(&mut self, terrain: &Terrain, page: u64, entry: Entry) {
        if page >= terrain.page_count() {
            return;
        }
        if terrain.known_entry(page) == Some(entry) {
            self.0.remove(&page);
        } else {
            self.0.insert(page, entry);
        }
    }
}
