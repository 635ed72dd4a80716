//! No page of one state has two uses. Otherwise a small file could claim to be a large terrain, and reading, drawing or rewriting it would take time and memory out of proportion.
//!
//! A bit for each page of the file says whether it is taken. The states of an edited file share pages with one another, so each state is looked at by itself.
//! Invariant: an accepted state has no more pages, and no more tiles, than the file. Cost: one bit for 32,768 bits of the file, and a
//! nanosecond a page. Reading and checking a leaf costs more.

use super::{ENTRY_BYTES, Entry};
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, to_usize};
use crate::file::header::{Header, INERT_PAGE};
use crate::file::source::Source;

const PAGE: u64 = PAGE_BYTES as u64;

/// Pages of a file that are in use.
#[derive(Debug, Clone)]
pub(crate) struct PageUses {
    /// A bit a page.
    taken: Vec<u64>,
    /// Pages of the file, the last one begun perhaps.
    pages: u64,
}

impl PageUses {
    /// Of the pages that a header counts, those of the header slots, also of an overlay's, and the inert page are in use.
    pub(crate) fn new(source: &dyn Source, file_bytes: u64) -> Result<Self, LayoutError> {
        let pages = file_bytes.div_ceil(PAGE);
        // Zeroed by the system where it is touched, so a file with holes costs what is in it.
        let mut uses = Self { taken: vec![0; to_usize(pages.div_ceil(64))?], pages };
        let slots = source.own_start() / PAGE;
        let _ = uses.take(0, u64::from(INERT_PAGE) + 1).and_then(|()| uses.take(slots, 2));
        Ok(uses)
    }

    /// Takes `count` pages from `first` on; says what is wrong with the first of them that is in use already or lies outside the file.
    pub(crate) fn take(&mut self, first: u64, count: u64) -> Result<(), String> {
        self.take_free(first, count).map_err(|page| {
            if page < self.pages {
                format!("file page {page} has another use as well")
            } else {
                "it lies outside the file".into()
            }
        })
    }

    /// The first page that cannot be taken, on failure.
    fn take_free(&mut self, first: u64, count: u64) -> Result<(), u64> {
        let end = first.saturating_add(count);
        if end > self.pages {
            return Err(self.pages.max(first));
        }
        let mut page = first;
        while page < end {
            let bit = page % 64;
            let here = (64 - bit).min(end - page);
            let mask = (u64::MAX >> (64 - here)) << bit;
            let word = usize::try_from(page / 64).ok().and_then(|i| self.taken.get_mut(i)).ok_or(page)?;
            if *word & mask != 0 {
                return Err(page - bit + u64::from((*word & mask).trailing_zeros()));
            }
            *word |= mask;
            page += here;
        }
        Ok(())
    }

    /// Gives pages back that were taken.
    fn give_back(&mut self, first: u64, count: u64) {
        for page in first..first.saturating_add(count).min(self.pages) {
            if let Some(word) = usize::try_from(page / 64).ok().and_then(|i| self.taken.get_mut(i)) {
                *word &= !(1 << (page % 64));
            }
        }
    }

    /// Gives back what [`PageUses::take_root`] took.
    pub(crate) fn give_back_root(&mut self, header: &Header, root: &[Entry]) {
        self.give_back(header.root_page.into(), root_pages(header));
        self.give_back_entries(root);
    }

    /// Gives back what [`PageUses::take_entries`] or [`PageUses::take_leaves`] took.
    pub(crate) fn give_back_entries(&mut self, entries: &[Entry]) {
        let present = entries.iter().filter(|entry| entry.is_present());
        present.for_each(|entry| self.give_back(entry.page.into(), 1));
    }

    /// Takes the pages of the root that `header` names and of the nodes or leaves that it leads to.
    pub(crate) fn take_root(
        &mut self,
        source: &dyn Source,
        header: &Header,
        root: &[Entry],
    ) -> Result<(), LayoutError> {
        let taken = self.take(header.root_page.into(), root_pages(header));
        taken.map_err(|problem| {
            LayoutError::damaged_terrain(source.path(), "directory root".into(), problem)
        })?;
        let what = if header.directory().has_nodes() { "directory node" } else { "directory leaf" };
        self.take_all(source, what, 0, root)
    }

    /// Takes the pages of the leaves that a node leads to, the first of which is leaf `first`: all of them, or on an error none.
    pub(crate) fn take_leaves(
        &mut self,
        source: &dyn Source,
        first: u64,
        entries: &[Entry],
    ) -> Result<(), LayoutError> {
        self.take_all(source, "directory leaf", first, entries)
    }

    /// Takes the record pages of a leaf whose first entry is that of logical page `first`.
    pub(crate) fn take_entries(
        &mut self,
        source: &dyn Source,
        first: u64,
        entries: &[Entry],
    ) -> Result<(), LayoutError> {
        self.take_all(source, "directory entry of record page", first, entries)
    }

    fn take_all(
        &mut self,
        source: &dyn Source,
        what: &str,
        first: u64,
        entries: &[Entry],
    ) -> Result<(), LayoutError> {
        for (i, entry) in entries.iter().enumerate().filter(|(_, entry)| entry.is_present()) {
            if let Err(problem) = self.take(entry.page.into(), 1) {
                self.give_back_entries(&entries[..i]);
                let place = format!("{what} {}", first + i as u64);
                return Err(LayoutError::damaged_terrain(source.path(), place, problem));
            }
        }
        Ok(())
    }
}

/// Pages of the root, the last one begun perhaps.
fn root_pages(header: &Header) -> u64 {
    (header.directory().root_entries() * ENTRY_BYTES as u64).div_ceil(PAGE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::source::MemorySource;

    #[test]
    fn a_page_is_taken_once() {
        let mut uses = PageUses::new(&MemorySource::new("memory", Vec::new()), 1000 * PAGE).unwrap();
        assert_eq!(uses.take_free(2, 1), Err(2), "the inert page");
        assert_eq!(uses.take_free(3, 1), Ok(()));
        assert_eq!(uses.take_free(3, 1), Err(3));
        assert_eq!(uses.take_free(60, 140), Ok(()));
        for (first, count, twice) in [(50, 11, 60), (199, 1, 199), (190, 300, 190), (4, 500, 60)] {
            assert_eq!(uses.take_free(first, count), Err(twice));
        }
        assert_eq!(uses.take_free(200, 64), Ok(()));
        assert_eq!(uses.take_free(990, 11), Err(1000), "beyond the file");
        assert_eq!(uses.take_free(u64::from(u32::MAX), 1), Err(u64::from(u32::MAX)));
        assert_eq!(uses.take_free(u64::MAX, 2), Err(u64::MAX));
        assert_eq!(uses.take_free(999, 1), Ok(()));
        assert_eq!(uses.take(999, 1), Err("file page 999 has another use as well".into()));
        assert_eq!(uses.take(1000, 1), Err("it lies outside the file".into()));
    }
}
