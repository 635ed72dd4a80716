//! What a commit's pages differ little from: the same pages as they were packed.
//!
//! A commit to a packed file holds each page as the difference to the page of the same meaning that is packed, which is never written over. So a page is read with one other, however often it was
//! edited. Cost: the root as it was packed is read, and of each leaf that changes the one as it was.

use crate::error::LayoutError;
use crate::file::header::Header;
use crate::file::journal::State;
use crate::file::page_table::PageTable;
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
    /// The directory as it was before all commits.
    original: PageTable,
    root_page: u32,
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
        let (first, root_page) = (end.first, original.root_page);
        let original = PageTable::open(terrain.source(), &original)?;
        Ok(Some(Self { terrain, first, original, root_page, pages: Vec::new() }))
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
    pub(crate) fn record_page(&mut self, logical: u64) -> Result<(), LayoutError> {
        let entry = self.original.entry(self.terrain.source(), logical)?;
        self.push(entry.page);
        Ok(())
    }

    /// The next page is a leaf.
    pub(crate) fn leaf(&mut self, leaf: u64) -> Result<(), LayoutError> {
        let here = self.original.leaf_entry(self.terrain.source(), leaf)?;
        self.push(here.page);
        Ok(())
    }

    /// The next page is a node.
    pub(crate) fn node(&mut self, node: usize) {
        self.push(self.original.root().get(node).map_or(0, |here| here.page));
    }

    /// The next `count` pages are the root.
    pub(crate) fn root(&mut self, count: usize) {
        let first = self.root_page;
        (0..count as u32).for_each(|page| self.push(first + page));
    }

    pub(crate) fn pages(&self) -> &[u32] {
        &self.pages
    }

    pub(crate) fn source(&self) -> &dyn Source {
        self.terrain.source()
    }
}
