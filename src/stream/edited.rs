//! Pages that edits have changed and that are not in the file yet, kept beside a pool; and the changes that edits made, on their way from the editor to the renderer.
//!
//! Such a page is never read from storage. Where the mesh needs one that the pool has dropped, it comes from here. Once it is committed it is dropped here too, and is a page of
//! the file like any other, in a new place. Cost: 4 KiB for each page that differs from the file; where strokes are committed, as many as a stroke touches.

use std::collections::HashMap;
use terrasoar_layout::edit::{Changes, Editor, SampleRect};
use terrasoar_layout::file::bytes::Page;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::pool::PagePool;

/// What edits, an undo or a redo made of the ground, apart from the editor that did it: what one thread does another may show.
#[derive(Debug, Clone, Default)]
pub struct GroundPatch {
    /// Rectangles that hold all samples whose height changed.
    pub samples: Vec<SampleRect>,
    /// Logical pages that hold records which changed, and what they hold now.
    pub pages: Vec<(u64, Box<Page>)>,
    /// Lowest and highest height in metres that there is now.
    pub height_range_m: [f64; 2],
    /// Where those of the pages lie that are in the file as they are now. The others are kept in memory until [`Streamed::relocate`](super::Streamed::relocate) tells of them.
    pub places: Vec<(u64, Entry)>,
}

impl GroundPatch {
    /// What `editor` has just made, of which nothing is in the file.
    pub fn of(changes: &Changes, editor: &Editor) -> Self {
        let page = |page: &u64| Some((*page, Box::new(*editor.edited_page(*page)?)));
        Self {
            samples: changes.samples.clone(),
            pages: changes.pages.iter().filter_map(page).collect(),
            height_range_m: editor.header().height_range_m,
            places: Vec::new(),
        }
    }
}

/// Edited pages.
#[derive(Debug, Default)]
pub(super) struct EditedPages {
    pages: HashMap<u64, Box<Page>>,
    /// Those that are to go into the pool.
    to_bring: Vec<u64>,
}

impl EditedPages {
    /// Keeps what a page holds now.
    pub(super) fn keep(&mut self, logical: u64, bytes: Box<Page>) {
        self.pages.insert(logical, bytes);
    }

    /// Lets go of a page that is in the file.
    pub(super) fn forget(&mut self, logical: u64) {
        self.pages.remove(&logical);
        // A long stroke leaves no large table behind.
        if self.pages.is_empty() {
            self.pages = HashMap::new();
        }
    }

    /// Pages kept.
    pub(super) fn len(&self) -> usize {
        self.pages.len()
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
