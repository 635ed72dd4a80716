//! What a commit's pages differ little from: the same pages as they were packed.
//!
//! A commit to a packed file holds each page as the difference to the page of the same meaning that is packed, which is never written over. So a page is read with one other, however often it was
//! edited. Cost: the root as it was packed is read, and of each leaf that changes the one as it was.

use crate::error::LayoutError;
use crate::file::entries::{ENTRIES_PER_LEAF, Entry};
use crate::file::header::Header;
use crate::file::journal::State;
use crate::file::page_table::{Leaf, read_leaf, read_root};
use crate::file::source::Source;
use crate::file::tail::Tail;
use crate::read::terrain::Terrain;
use std::sync::Arc;

/// A page number for each page of a commit.
#[derive(Debug)]
pub(crate) struct Bases {
    terrain: Arc<Terrain>,
    /// First page that is not packed.
    first: u64,
    /// As it was before all commits.
    original: Header,
    root: Vec<Entry>,
    /// The leaf that was asked for last.
    leaf: Option<(usize, Box<Leaf>)>,
    pages: Vec<u32>,
}

impl Bases {
    /// For a commit to the end `tail` of the file of `terrain`, whose header is `header`; `None` if that is not packed.
    pub(crate) fn new(
        tail: &Tail,
        terrain: Arc<Terrain>,
        header: &Header,
        original: &State,
    ) -> Result<Option<Self>, LayoutError> {
        let Some(end) = tail.packed_end() else { return Ok(None) };
        let original = Header { history: None, ..original.put_into(header) };
        let root = read_root(terrain.source(), &original)?;
        let first = end.first;
        Ok(Some(Self { terrain, first, original, root, leaf: None, pages: Vec::new() }))
    }

    /// The next page is like this one, if that is packed.
    fn push(&mut self, page: u32) {
        self.pages.push(if u64::from(page) < self.first { page } else { 0 });
    }

    /// The next `count` pages are like none.
    pub(crate) fn none(&mut self, count: usize) {
        self.pages.resize(self.pages.len() + count, 0);
    }

    /// The next page is that of a logical page.
    pub(crate) fn record_page(&mut self, logical: usize) -> Result<(), LayoutError> {
        let (at, within) = (logical / ENTRIES_PER_LEAF, logical % ENTRIES_PER_LEAF);
        if self.leaf.as_ref().is_none_or(|(known, _)| *known != at) {
            let here = self.root.get(at).copied().unwrap_or_default();
            let entries = read_leaf(self.terrain.source(), &self.original, at, here)?;
            self.leaf = Some((at, Box::new(entries)));
        }
        let entry = self.leaf.as_ref().map(|(_, entries)| entries[within]);
        self.push(entry.unwrap_or_default().page);
        Ok(())
    }

    /// The next page is a leaf.
    pub(crate) fn leaf(&mut self, at: usize) {
        self.push(self.root.get(at).map_or(0, |entry| entry.page));
    }

    /// The next `count` pages are the root.
    pub(crate) fn root(&mut self, count: usize) {
        let first = self.original.root_page;
        (0..count as u32).for_each(|page| self.push(first + page));
    }

    pub(crate) fn pages(&self) -> &[u32] {
        &self.pages
    }

    pub(crate) fn source(&self) -> &dyn Source {
        self.terrain.source()
    }
}
