//! Pages that edits have changed, kept beside a pool: the file may hold what was there before, or hold it at another place by now.
//!
//! Such a page never comes from storage; where the mesh wants one that the pool has given up it is brought from here. Cost: 4 KiB a page that was ever edited.

use std::collections::HashMap;
use terrasoar_layout::bytes::Page;
use terrasoar_layout::pool::PagePool;
use terrasoar_layout::record::RecordCodec;

/// Edited pages.
#[derive(Debug, Default)]
pub(super) struct EditedPages {
    pages: HashMap<u64, Box<Page>>,
    /// Those that are to go into the pool.
    to_bring: Vec<u64>,
}

impl EditedPages {
    /// Keeps what a page holds now.
    pub(super) fn keep(&mut self, logical: u64, bytes: &Page) {
        match self.pages.get_mut(&logical) {
            Some(page) => page.copy_from_slice(bytes),
            None => {
                self.pages.insert(logical, Box::new(*bytes));
            }
        }
    }

    /// What an edited page holds.
    pub(super) fn get(&self, logical: u64) -> Option<&Page> {
        self.pages.get(&logical).map(|page| &**page)
    }

    /// Whether a page is here; it is put into the pool then.
    pub(super) fn bring(&mut self, logical: u64) -> bool {
        let is_here = !self.pages.is_empty() && self.pages.contains_key(&logical);
        if is_here {
            self.to_bring.push(logical);
        }
        is_here
    }

    /// Puts what is wanted into the pool; tells how many pages that were.
    pub(super) fn install<C: RecordCodec>(&mut self, pool: &mut PagePool<C>) -> u64 {
        let mut installed = 0;
        for logical in self.to_bring.drain(..) {
            if let Some(page) = self.pages.get(&logical).filter(|_| !pool.is_resident(logical)) {
                // Only pages that the terrain has were kept.
                installed += u64::from(pool.install(logical, page).is_ok());
            }
        }
        installed
    }
}
