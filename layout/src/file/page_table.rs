//! The directory in memory: where each logical page lies (FORMAT.md, section 5). The root is read when a file is opened, leaves are read and checked when one of their pages is first looked up.
//!
//! Invariant: every page number that is handed out lies inside the file as its header counts it, and root and leaves are pages of their own, so no more leaves are read than the file has pages.
//! [`PageTable::check`] reads all leaves and finds what none of them shows alone: pages with two uses, and another number of pages than the header says. Cost: 28 bytes a leaf, and 3 KiB for each that was read;
//! nothing for leaves that are absent.

use super::bytes::{PAGE_BYTES, Page, checksum, to_usize};
use super::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, PageUses};
use super::header::{Header, INERT_PAGE};
use super::source::Source;
use crate::error::LayoutError;
use std::sync::{Arc, OnceLock};

/// Leaves read at once, at most: 8 MiB.
const RUN_LEAVES: usize = 2048;

/// The entries of a leaf; those past the last logical page are absent.
pub(crate) type Leaf = [Entry; ENTRIES_PER_LEAF];

/// The directory of one state of a file.
#[derive(Debug, Clone)]
pub(crate) struct PageTable {
    /// Of the state that it is of.
    header: Header,
    root: Vec<Entry>,
    /// Leaves that were read.
    leaves: Vec<OnceLock<Arc<Leaf>>>,
    checked: OnceLock<()>,
}

impl PageTable {
    /// Reads the root that `header` names, and checks where the leaves lie.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the root, or the leaf that lies outside the file or where something else lies; I/O.
    pub(crate) fn open(source: &dyn Source, header: &Header) -> Result<Self, LayoutError> {
        let root = read_root(source, header)?;
        PageUses::new(source, header.file_bytes)?.take_root(source, header, &root)?;
        Ok(Self {
            header: header.clone(),
            leaves: (0..root.len()).map(|_| OnceLock::new()).collect(),
            root,
            checked: OnceLock::new(),
        })
    }

    /// As [`PageTable::open`], of a state beside one of the same file: leaves that both have are those of `known`.
    pub(crate) fn open_beside(
        source: &dyn Source,
        header: &Header,
        known: &Self,
    ) -> Result<Self, LayoutError> {
        let mut this = Self::open(source, header)?;
        for ((i, here), place) in this.root.iter().enumerate().zip(&mut this.leaves) {
            if here.is_present()
                && known.root.get(i) == Some(here)
                && let Some(leaf) = known.leaves.get(i).and_then(OnceLock::get)
            {
                *place = OnceLock::from(Arc::clone(leaf));
            }
        }
        Ok(this)
    }

    /// Logical pages.
    pub(crate) fn pages(&self) -> u64 {
        self.header.record_pages()
    }

    /// Where the leaves lie.
    pub(crate) fn root(&self) -> &[Entry] {
        &self.root
    }

    /// Where a logical page lies; absent for one that there is not. Reads its leaf if that was not read yet.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the leaf, or the entry in it that leads out of the file; I/O.
    pub(crate) fn entry(&self, source: &dyn Source, page: u64) -> Result<Entry, LayoutError> {
        if page >= self.pages() {
            return Ok(Entry::default());
        }
        let (leaf, within) = split(page);
        Ok(self.leaf(source, leaf)?.map_or_else(Entry::default, |leaf| leaf[within]))
    }

    /// Where a logical page lies, if that is known without reading.
    pub(crate) fn known(&self, page: u64) -> Option<Entry> {
        let (leaf, within) = split(page);
        match self.root.get(leaf).filter(|here| page < self.pages() && here.is_present()) {
            Some(_) => self.leaves[leaf].get().map(|leaf| leaf[within]),
            None => Some(Entry::default()),
        }
    }

    /// A leaf; `None` if it is absent.
    ///
    /// # Errors
    /// As [`PageTable::entry`].
    pub(crate) fn leaf(&self, source: &dyn Source, i: usize) -> Result<Option<&Leaf>, LayoutError> {
        let Some(here) = self.root.get(i).filter(|here| here.is_present()) else { return Ok(None) };
        let place = &self.leaves[i];
        if place.get().is_none() {
            let leaf = read_leaf(source, &self.header, i, *here)?;
            // Another thread may have been as quick; both read the same.
            let _ = place.set(Arc::new(leaf));
        }
        Ok(place.get().map(|leaf| &**leaf))
    }

    /// Entries of the pages that are present, of all leaves that were read, in logical order: of the whole directory once [`PageTable::check`] has found it sound.
    pub(crate) fn present(&self) -> impl Iterator<Item = (u64, Entry)> + '_ {
        self.listed().filter(|(_, entry)| entry.is_present())
    }

    /// The entries of every leaf as far as they were read, none for absent ones.
    #[cfg(feature = "files")]
    pub(crate) fn leaves(&self) -> impl Iterator<Item = &[Entry]> + Clone + '_ {
        self.leaves.iter().map(|leaf| leaf.get().map_or(&[][..], |leaf| &leaf[..]))
    }

    /// All entries that are there, absent pages between them included, in logical order, as [`PageTable::present`] says.
    pub(crate) fn listed(&self) -> impl Iterator<Item = (u64, Entry)> + '_ {
        let leaves = (0u64..).zip(&self.leaves).filter_map(|(i, leaf)| Some((i, leaf.get()?)));
        let entries = leaves.flat_map(|(i, leaf)| (i * ENTRIES_PER_LEAF as u64..).zip(leaf.iter().copied()));
        entries.filter(|(page, _)| *page < self.pages())
    }

    /// Whether [`PageTable::check`] has found it sound.
    pub(crate) fn is_checked(&self) -> bool {
        self.checked.get().is_some()
    }

    /// Reads all leaves that were not read yet, and checks what is to be checked of all of them.
    ///
    /// # Errors
    /// As [`PageTable::entry`]; [`LayoutError::Damaged`] for a page with two uses, and for another number of pages than the header says.
    pub(crate) fn check(&self, source: &dyn Source) -> Result<(), LayoutError> {
        if self.is_checked() {
            return Ok(());
        }
        self.read_all(source)?;
        let mut uses = PageUses::new(source, self.header.file_bytes)?;
        uses.take_root(source, &self.header, &self.root)?;
        let mut stored = 0;
        for (i, leaf) in self.leaves.iter().enumerate().filter_map(|(i, leaf)| Some((i, leaf.get()?))) {
            uses.take_entries(source, i * ENTRIES_PER_LEAF, &leaf[..])?;
            stored += present(&leaf[..]);
        }
        if stored != self.header.stored_pages {
            let problem = "it holds another number of pages than the header says";
            return Err(LayoutError::damaged_terrain(source.path(), "directory".into(), problem));
        }
        let _ = self.checked.set(());
        Ok(())
    }

    /// Reads all leaves that were not read yet: those that lie one after the other at once.
    fn read_all(&self, source: &dyn Source) -> Result<(), LayoutError> {
        let is_wanted = |i: &usize| self.root[*i].is_present() && self.leaves[*i].get().is_none();
        let wanted: Vec<usize> = (0..self.root.len()).filter(is_wanted).collect();
        let follows = |a: &usize, b: &usize| self.root[*a].page.checked_add(1) == Some(self.root[*b].page);
        let mut bytes = Vec::new();
        for run in wanted.chunk_by(follows).flat_map(|run| run.chunks(RUN_LEAVES)) {
            bytes.resize(run.len() * PAGE_BYTES, 0);
            source.read_at(u64::from(self.root[run[0]].page) * PAGE_BYTES as u64, &mut bytes)?;
            for (i, page) in run.iter().zip(bytes.as_chunks::<PAGE_BYTES>().0) {
                if !is_in_file(&self.header, self.root[*i].page) {
                    return Err(damaged_leaf(source, *i, "it lies outside the file"));
                }
                let leaf = parse_leaf(source, &self.header, *i, self.root[*i], page)?;
                let _ = self.leaves[*i].set(Arc::new(leaf));
            }
        }
        Ok(())
    }

    /// A leaf that was read, or one without pages.
    #[cfg(feature = "files")]
    pub(crate) fn read_leaf(&self, i: usize) -> Leaf {
        self.leaves.get(i).and_then(OnceLock::get).map_or([Entry::default(); ENTRIES_PER_LEAF], |leaf| **leaf)
    }

    /// Puts another leaf in place of one.
    #[cfg(feature = "files")]
    pub(crate) fn set_leaf(&mut self, i: usize, here: Entry, leaf: Leaf) {
        self.root[i] = here;
        self.leaves[i] = OnceLock::from(Arc::new(leaf));
    }

    /// Makes this, of which all was read, that of the state after a commit with this header: logical pages, and leaves, that lie elsewhere now.
    #[cfg(feature = "files")]
    pub(crate) fn update(&mut self, header: &Header, entries: &[(usize, Entry)], leaves: &[(usize, Entry)]) {
        for of_leaf in entries.chunk_by(|a, b| a.0 / ENTRIES_PER_LEAF == b.0 / ENTRIES_PER_LEAF) {
            let at = of_leaf[0].0 / ENTRIES_PER_LEAF;
            let mut leaf = self.read_leaf(at);
            of_leaf.iter().for_each(|(page, entry)| leaf[page % ENTRIES_PER_LEAF] = *entry);
            self.leaves[at] = OnceLock::from(Arc::new(leaf));
        }
        leaves.iter().for_each(|(leaf, entry)| self.root[*leaf] = *entry);
        self.header = header.clone();
    }

    /// Logical pages whose entries are others in `other`, and their entries there. All of both was read.
    #[cfg(feature = "files")]
    pub(crate) fn differing(&self, other: &Self) -> Vec<(usize, Entry)> {
        let mut differing = Vec::new();
        for i in (0..self.root.len()).filter(|i| self.root.get(*i) != other.root.get(*i)) {
            let (ours, theirs) = (self.read_leaf(i), other.read_leaf(i));
            let pairs = (i * ENTRIES_PER_LEAF..).zip(ours.iter().zip(&theirs));
            differing.extend(pairs.filter(|(_, (a, b))| a != b).map(|(page, (_, theirs))| (page, *theirs)));
        }
        differing
    }
}

/// Leaf of a logical page, and its place there.
fn split(page: u64) -> (usize, usize) {
    let per_leaf = ENTRIES_PER_LEAF as u64;
    (usize::try_from(page / per_leaf).unwrap_or(usize::MAX), (page % per_leaf) as usize)
}

/// Entries that are present.
pub(crate) fn present(entries: &[Entry]) -> u64 {
    entries.iter().filter(|entry| entry.is_present()).count() as u64
}

/// The directory's root: where the leaves lie.
pub(crate) fn read_root(source: &dyn Source, header: &Header) -> Result<Vec<Entry>, LayoutError> {
    let root_bytes = to_usize(header.root_entries() * ENTRY_BYTES as u64)?;
    let mut root = vec![0; root_bytes];
    source.read_at(u64::from(header.root_page) * PAGE_BYTES as u64, &mut root)?;
    if checksum(&root) != header.root_checksum {
        return Err(LayoutError::damaged_terrain(
            source.path(),
            "directory root".into(),
            "the checksum does not match",
        ));
    }
    Ok((0..header.root_entries() as usize).map(|i| Entry::read(&root, i)).collect())
}

/// Leaf `i`, which the root says lies at `here`; without pages if it is absent.
pub(crate) fn read_leaf(
    source: &dyn Source,
    header: &Header,
    i: usize,
    here: Entry,
) -> Result<Leaf, LayoutError> {
    if !here.is_present() {
        return Ok([Entry::default(); ENTRIES_PER_LEAF]);
    }
    if !is_in_file(header, here.page) {
        return Err(damaged_leaf(source, i, "it lies outside the file"));
    }
    let mut leaf = [0; PAGE_BYTES];
    source.read_at(u64::from(here.page) * PAGE_BYTES as u64, &mut leaf)?;
    parse_leaf(source, header, i, here, &leaf)
}

/// Whether a page may be a leaf or a record page.
fn is_in_file(header: &Header, page: u32) -> bool {
    page > INERT_PAGE && (u64::from(page) + 1) * PAGE_BYTES as u64 <= header.file_bytes
}

fn damaged_leaf(source: &dyn Source, i: usize, problem: &str) -> LayoutError {
    LayoutError::damaged_terrain(source.path(), format!("directory leaf {i}"), problem)
}

/// The entries of a leaf that was read.
fn parse_leaf(
    source: &dyn Source,
    header: &Header,
    i: usize,
    here: Entry,
    page: &Page,
) -> Result<Leaf, LayoutError> {
    if checksum(page) != here.checksum {
        return Err(damaged_leaf(source, i, "the checksum does not match"));
    }
    let mut leaf = [Entry::default(); ENTRIES_PER_LEAF];
    let first = (i * ENTRIES_PER_LEAF) as u64;
    let count = header.record_pages().saturating_sub(first).min(ENTRIES_PER_LEAF as u64) as usize;
    for (j, place) in leaf[..count].iter_mut().enumerate() {
        *place = Entry::read(page, j);
        if place.is_present() && !is_in_file(header, place.page) {
            let place = format!("directory entry of record page {}", first + j as u64);
            return Err(LayoutError::damaged_terrain(source.path(), place, "the page lies outside the file"));
        }
    }
    Ok(leaf)
}
