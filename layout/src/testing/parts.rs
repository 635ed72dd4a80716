//! Where the parts of a file lie, as far as its header slots and its journal lead to them. Links that lead nowhere are left out.

use super::image::{Image, JOURNAL_MAGIC, SECTION_MAGIC};
use crate::file::bytes::{PAGE_BYTES, get_u32};
use crate::file::directory_shape::DirectoryShape;
use crate::file::entries::ENTRY_BYTES;
use std::collections::BTreeSet;

/// Journal pages that are followed.
const MOST_COMMITS: usize = 64;
/// Tiles of a section that are looked at.
const MOST_TILES: usize = 4096;

/// What a part is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum What {
    Header,
    Root,
    Node,
    Leaf,
    Records,
    Journal,
    Section,
    TileDirectory,
    Tile,
}

/// A part of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Part {
    pub(super) what: What,
    /// First byte.
    pub(super) at: usize,
    pub(super) bytes: usize,
}

/// A directory of record pages that a header or a journal page leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Root {
    pub(super) page: u32,
    /// As the header says.
    pub(super) entries: usize,
    /// Entries of all leaves, as the header says.
    pub(super) record_pages: u64,
    /// Whether it leads to nodes.
    pub(super) has_nodes: bool,
    /// Where root page, checksum and pages stored are said.
    pub(super) page_at: usize,
    pub(super) checksum_at: usize,
    pub(super) stored_at: usize,
}

impl Root {
    /// Distinct pages of leaves that lie in the file.
    pub(super) fn leaves(&self, image: &Image<'_>) -> BTreeSet<u32> {
        let below = entry_pages(image, self.page as usize * PAGE_BYTES, self.entries);
        if !self.has_nodes {
            return below;
        }
        let of_node = |node| entry_pages(image, node as usize * PAGE_BYTES, PAGE_BYTES / ENTRY_BYTES);
        below.into_iter().flat_map(of_node).collect()
    }
}

/// A directory of tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct TileDirectory {
    pub(super) at: usize,
    pub(super) tiles: usize,
}

/// Where everything is.
#[derive(Debug, Default)]
pub(super) struct Parts {
    pub(super) roots: BTreeSet<Root>,
    /// First bytes of imagery sections.
    pub(super) sections: BTreeSet<usize>,
    /// Journal pages.
    pub(super) journal: Vec<u32>,
}

impl Parts {
    /// Follows headers and journal.
    pub(super) fn of(image: &Image<'_>) -> Self {
        let mut parts = Self::default();
        let (mut entries, mut record_pages, mut has_nodes) = (0, 0, false);
        for at in image.headers() {
            let most = image.end() / ENTRY_BYTES;
            entries = (image.u32_at(at + 0x07c) as usize).min(most);
            record_pages = image.u64_at(at + 0x068);
            has_nodes = DirectoryShape::new(image.u32_at(at + 0x010) & 0xff, record_pages).has_nodes();
            parts.roots.insert(Root {
                page: image.u32_at(at + 0x078),
                entries,
                record_pages,
                has_nodes,
                page_at: at + 0x078,
                checksum_at: at + 0x080,
                stored_at: at + 0x070,
            });
            parts.note_section(image, at + 0x090);
            [0x0e8, 0x0ec].into_iter().for_each(|of| parts.note_commit(image, image.u32_at(at + of)));
        }
        let mut next = 0;
        while let Some(page) = parts.journal.get(next).copied() {
            let at = page as usize * PAGE_BYTES;
            for state in [at + 0x040, at + 0x080] {
                parts.roots.insert(Root {
                    page: image.u32_at(state),
                    entries,
                    record_pages,
                    has_nodes,
                    page_at: state,
                    checksum_at: state + 0x04,
                    stored_at: state + 0x08,
                });
                parts.note_section(image, state + 0x28);
            }
            parts.note_commit(image, image.u32_at(at + 0x010));
            next += 1;
        }
        parts
    }

    fn note_commit(&mut self, image: &Image<'_>, page: u32) {
        let is_one = page_of(image, page).is_some_and(|bytes| bytes[..8] == JOURNAL_MAGIC);
        if is_one && !self.journal.contains(&page) && self.journal.len() < MOST_COMMITS {
            self.journal.push(page);
        }
    }

    fn note_section(&mut self, image: &Image<'_>, place_at: usize) {
        let Ok(at) = usize::try_from(image.u64_at(place_at)) else { return };
        if at != 0 && image.get(at, PAGE_BYTES).is_some_and(|page| page[..8] == SECTION_MAGIC) {
            self.sections.insert(at);
        }
    }

    /// Every part, without those that lie in a base.
    pub(super) fn list(&self, image: &Image<'_>) -> Vec<Part> {
        let mut list = BTreeSet::new();
        let mut note = |what: What, at: usize, bytes: usize| {
            if at >= image.start() && bytes > 0 && image.get(at, bytes).is_some() {
                list.insert(Part { what, at, bytes });
            }
        };
        image.headers().into_iter().for_each(|at| note(What::Header, at, PAGE_BYTES));
        self.journal.iter().for_each(|page| note(What::Journal, *page as usize * PAGE_BYTES, PAGE_BYTES));
        for root in &self.roots {
            let at = root.page as usize * PAGE_BYTES;
            note(What::Root, at, root.entries * ENTRY_BYTES);
            if root.has_nodes {
                for node in entry_pages(image, at, root.entries) {
                    note(What::Node, node as usize * PAGE_BYTES, PAGE_BYTES);
                }
            }
            for leaf in root.leaves(image) {
                let at = leaf as usize * PAGE_BYTES;
                note(What::Leaf, at, PAGE_BYTES);
                for page in entry_pages(image, at, PAGE_BYTES / ENTRY_BYTES) {
                    note(What::Records, page as usize * PAGE_BYTES, PAGE_BYTES);
                }
            }
        }
        for at in &self.sections {
            note(What::Section, *at, PAGE_BYTES);
            let Some(directory) = tile_directory(image, *at) else { continue };
            note(What::TileDirectory, directory.at, directory.tiles * ENTRY_BYTES);
            for i in 0..directory.tiles.min(MOST_TILES) {
                let entry = directory.at + i * ENTRY_BYTES;
                let (page, bytes) = (image.u32_at(entry), image.u32_at(entry + 4));
                note(What::Tile, page as usize * PAGE_BYTES, bytes as usize);
            }
        }
        list.into_iter().collect()
    }
}

/// A page that is there.
pub(super) fn page_of<'i>(image: &'i Image<'_>, page: u32) -> Option<&'i [u8]> {
    image.get((page as usize).checked_mul(PAGE_BYTES)?, PAGE_BYTES)
}

/// Distinct pages that lie in the file of `entries` directory entries at `at`; none if the entries do not.
pub(super) fn entry_pages(image: &Image<'_>, at: usize, entries: usize) -> BTreeSet<u32> {
    let Some(bytes) = image.get(at, entries * ENTRY_BYTES) else { return BTreeSet::new() };
    let pages = (0..entries).map(|i| get_u32(bytes, i * ENTRY_BYTES));
    pages.filter(|page| *page != 0 && page_of(image, *page).is_some()).collect()
}

/// The directory of the section at `at`, if it lies in the file.
pub(super) fn tile_directory(image: &Image<'_>, at: usize) -> Option<TileDirectory> {
    let directory = (image.u32_at(at + 0x058) as usize).checked_mul(PAGE_BYTES)?;
    let tiles = usize::try_from(image.u64_at(at + 0x040)).ok()?;
    image.get(directory, tiles.checked_mul(ENTRY_BYTES)?)?;
    Some(TileDirectory { at: directory, tiles })
}
