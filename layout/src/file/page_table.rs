//! The directory in memory: where each logical page lies (FORMAT.md, section 5). The root is read when a file is opened; nodes, of squares that have them, and leaves are read and checked when one of their
//! pages is first looked up.
//!
//! Invariant: every page number that is handed out lies inside the file as its header counts it, and root, nodes and the leaves of nodes that were read are pages of their own, so no more are read than the
//! file has pages.
//! [`PageTable::check`] reads all leaves and finds what none of them shows alone: pages with two uses, and another number of pages than the header says. Cost: 40 bytes a leaf of which a node
//! holds any, and 3 KiB for each that was read; nothing for nodes that are absent.

mod change;
mod read;

pub(crate) use read::{read_leaf, read_node, read_root};

use super::bytes::{PAGE_BYTES, to_usize};
use super::directory_shape::DirectoryShape;
use super::entries::{ENTRIES_PER_LEAF, Entry, PageUses};
use super::header::Header;
use super::source::Source;
use crate::error::LayoutError;
use read::{damaged_leaf, is_in_file, parse_leaf};
use std::array;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Leaves read at once, at most: 8 MiB.
const RUN_LEAVES: usize = 2048;
const PER_LEAF: u64 = ENTRIES_PER_LEAF as u64;

/// The entries of a leaf, or of a node; those past the last logical page are absent.
pub(crate) type Leaf = [Entry; ENTRIES_PER_LEAF];

/// Leaves side by side: those of a node, and as many of a root that leads to leaves itself.
#[derive(Debug, Clone)]
struct Node {
    /// Where they lie.
    entries: Leaf,
    /// Those that were read.
    leaves: [OnceLock<Arc<Leaf>>; ENTRIES_PER_LEAF],
}

impl Node {
    fn new(entries: Leaf) -> Box<Self> {
        Box::new(Self { entries, leaves: array::from_fn(|_| OnceLock::new()) })
    }
}

/// The directory of one state of a file.
#[derive(Debug)]
pub(crate) struct PageTable {
    /// Of the state that it is of.
    header: Header,
    shape: DirectoryShape,
    /// As it lies in the file.
    root: Vec<Entry>,
    /// Those that are present and known.
    nodes: Vec<OnceLock<Box<Node>>>,
    /// Pages of the root, of nodes, and of leaves of nodes that were read, where there are nodes.
    uses: Option<Mutex<PageUses>>,
    checked: OnceLock<()>,
}

impl Clone for PageTable {
    fn clone(&self) -> Self {
        // No node is read meanwhile.
        let uses = self.uses.as_ref().map(|uses| uses.lock().unwrap_or_else(PoisonError::into_inner));
        Self {
            header: self.header.clone(),
            shape: self.shape,
            root: self.root.clone(),
            nodes: self.nodes.clone(),
            uses: uses.map(|uses| Mutex::new(uses.clone())),
            checked: self.checked.clone(),
        }
    }
}

impl PageTable {
    /// Reads the root that `header` names, and checks where what it leads to lies.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the root, or the node or leaf that lies outside the file or where something else lies; I/O.
    pub(crate) fn open(source: &dyn Source, header: &Header) -> Result<Self, LayoutError> {
        let root = read_root(source, header)?;
        let mut uses = PageUses::new(source, header.file_bytes)?;
        uses.take_root(source, header, &root)?;
        let shape = header.directory();
        let mut nodes: Vec<OnceLock<Box<Node>>> = Vec::new();
        nodes.resize_with(to_usize(shape.nodes())?, OnceLock::new);
        if !shape.has_nodes() {
            let chunks = nodes.iter_mut().zip(root.chunks(ENTRIES_PER_LEAF));
            for (node, chunk) in chunks.filter(|(_, chunk)| chunk.iter().any(|here| here.is_present())) {
                let entries = array::from_fn(|i| chunk.get(i).copied().unwrap_or_default());
                *node = OnceLock::from(Node::new(entries));
            }
        }
        let uses = shape.has_nodes().then(|| Mutex::new(uses));
        Ok(Self { header: header.clone(), shape, root, nodes, uses, checked: OnceLock::new() })
    }

    /// As [`PageTable::open`], of a state beside one of the same file: what both have is that of `known`.
    pub(crate) fn open_beside(
        source: &dyn Source,
        header: &Header,
        known: &Self,
    ) -> Result<Self, LayoutError> {
        let this = Self::open(source, header)?;
        for (i, theirs) in (0u64..).zip(&known.nodes) {
            let Some(theirs) = theirs.get() else { continue };
            if let Some(uses) = this.uses.as_ref().filter(|_| known.is_node_of(&this, i)) {
                let mut uses = uses.lock().unwrap_or_else(PoisonError::into_inner);
                uses.take_leaves(source, i * PER_LEAF, &theirs.entries)?;
                let _ = this.nodes[i as usize].set(theirs.clone());
                continue;
            }
            let Some(ours) = this.node(source, i)? else { continue };
            let pairs = ours.entries.iter().zip(&theirs.entries);
            let same = pairs.map(|(a, b)| a == b && a.is_present());
            for (same, (ours, theirs)) in same.zip(ours.leaves.iter().zip(&theirs.leaves)) {
                if let Some(leaf) = theirs.get().filter(|_| same) {
                    let _ = ours.set(Arc::clone(leaf));
                }
            }
        }
        Ok(this)
    }

    /// Whether another state has the same node, which is present.
    fn is_node_of(&self, other: &Self, i: u64) -> bool {
        let here = self.root.get(i as usize).filter(|here| here.is_present());
        here.is_some() && here == other.root.get(i as usize)
    }

    /// Logical pages.
    pub(crate) fn pages(&self) -> u64 {
        self.header.record_pages()
    }

    /// As it lies in the file: where the nodes lie, or the leaves.
    pub(crate) fn root(&self) -> &[Entry] {
        &self.root
    }

    /// Where a logical page lies; absent for one that there is not. Reads its node and its leaf if they were not read yet.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the node or leaf, or the entry in it that leads out of the file; I/O.
    pub(crate) fn entry(&self, source: &dyn Source, page: u64) -> Result<Entry, LayoutError> {
        if page >= self.pages() {
            return Ok(Entry::default());
        }
        let (leaf, within) = split(page);
        Ok(self.leaf(source, leaf)?.map_or_else(Entry::default, |leaf| leaf[within]))
    }

    /// Where a logical page lies, if that is known without reading.
    pub(crate) fn known(&self, page: u64) -> Option<Entry> {
        if page >= self.pages() {
            return Some(Entry::default());
        }
        let (leaf, within) = split(page);
        let (node, of_node) = split(leaf);
        match self.known_node(node)? {
            Some(node) if node.entries[of_node].is_present() => {
                node.leaves[of_node].get().map(|leaf| leaf[within])
            }
            _ => Some(Entry::default()),
        }
    }

    /// A node, if it is known without reading which there is: `None` if it is absent.
    fn known_node(&self, i: u64) -> Option<Option<&Node>> {
        let Some(place) = self.nodes.get(to_usize(i).unwrap_or(usize::MAX)) else { return Some(None) };
        match place.get() {
            Some(node) => Some(Some(node)),
            None => (!self.is_unread(i)).then_some(None),
        }
    }

    /// Whether the root leads to a node that was not read yet.
    fn is_unread(&self, i: u64) -> bool {
        let i = i as usize;
        self.shape.has_nodes()
            && self.root.get(i).is_some_and(|here| here.is_present())
            && self.nodes[i].get().is_none()
    }

    /// A node; `None` if it is absent.
    fn node(&self, source: &dyn Source, i: u64) -> Result<Option<&Node>, LayoutError> {
        if let Some(uses) = self.uses.as_ref().filter(|_| self.is_unread(i)) {
            // One thread reads it: its leaves are taken once.
            let mut uses = uses.lock().unwrap_or_else(PoisonError::into_inner);
            if self.is_unread(i) {
                let entries = read_node(source, &self.header, i, self.root[i as usize])?;
                uses.take_leaves(source, i * PER_LEAF, &entries)?;
                let _ = self.nodes[i as usize].set(Node::new(entries));
            }
        }
        Ok(self.known_node(i).flatten())
    }

    /// A leaf; `None` if it is absent.
    ///
    /// # Errors
    /// As [`PageTable::entry`].
    pub(crate) fn leaf(&self, source: &dyn Source, leaf: u64) -> Result<Option<&Leaf>, LayoutError> {
        let (node, within) = split(leaf);
        let Some(node) = self.node(source, node)?.filter(|node| node.entries[within].is_present()) else {
            return Ok(None);
        };
        let place = &node.leaves[within];
        if place.get().is_none() {
            let leaf = read_leaf(source, &self.header, leaf, node.entries[within])?;
            // Another thread may have been as quick; both read the same.
            let _ = place.set(Arc::new(leaf));
        }
        Ok(place.get().map(|leaf| &**leaf))
    }

    /// Where a leaf lies. Reads its node if that was not read yet.
    ///
    /// # Errors
    /// As [`PageTable::entry`].
    #[cfg(feature = "files")]
    pub(crate) fn leaf_entry(&self, source: &dyn Source, leaf: u64) -> Result<Entry, LayoutError> {
        let (node, within) = split(leaf);
        Ok(self.node(source, node)?.map_or_else(Entry::default, |node| node.entries[within]))
    }

    /// Numbers of leaves that may be present, as far as that is known without reading.
    pub(crate) fn maybe_present(&self) -> impl Iterator<Item = u64> + '_ {
        (0u64..self.nodes.len() as u64).flat_map(move |i| {
            let node = self.known_node(i);
            let count = if matches!(node, Some(None)) { 0 } else { ENTRIES_PER_LEAF };
            let is_present =
                move |within: &usize| node.flatten().is_none_or(|node| node.entries[*within].is_present());
            (0..count).filter(is_present).map(move |within| i * PER_LEAF + within as u64)
        })
    }

    /// A leaf that was read.
    pub(crate) fn known_leaf(&self, leaf: u64) -> Option<&Leaf> {
        let (node, within) = split(leaf);
        self.known_node(node)??.leaves[within].get().map(|leaf| &**leaf)
    }

    /// Numbers and places of all leaves that are present, of all nodes that were read, in order.
    fn leaf_entries(&self) -> impl Iterator<Item = (u64, Entry)> + '_ {
        let nodes = (0u64..).zip(&self.nodes).filter_map(|(i, node)| Some((i, node.get()?)));
        let entries = nodes.flat_map(|(i, node)| (i * PER_LEAF..).zip(node.entries));
        entries.filter(|(_, here)| here.is_present())
    }

    /// Nodes and leaves that are present. Reads nodes that were not read yet.
    ///
    /// # Errors
    /// As [`PageTable::entry`].
    pub(crate) fn pages_below_root(&self, source: &dyn Source) -> Result<u64, LayoutError> {
        self.read_nodes(source)?;
        let nodes = if self.shape.has_nodes() { present(&self.root) } else { 0 };
        Ok(nodes + self.leaf_entries().count() as u64)
    }

    /// Entries of the pages that are present, of all leaves that were read, in logical order: of the whole directory once [`PageTable::check`] has found it sound.
    pub(crate) fn present(&self) -> impl Iterator<Item = (u64, Entry)> + '_ {
        self.listed().filter(|(_, entry)| entry.is_present())
    }

    /// Leaves that were read, by number, in order.
    pub(crate) fn leaves(&self) -> impl Iterator<Item = (u64, &Leaf)> + Clone + '_ {
        let nodes = (0u64..).zip(&self.nodes).filter_map(|(i, node)| Some((i, node.get()?)));
        let leaves = nodes.flat_map(|(i, node)| (i * PER_LEAF..).zip(&node.leaves));
        leaves.filter_map(|(i, leaf)| Some((i, &**leaf.get()?)))
    }

    /// All entries that are there, absent pages between them included, in logical order, as [`PageTable::present`] says.
    pub(crate) fn listed(&self) -> impl Iterator<Item = (u64, Entry)> + '_ {
        let entries = self.leaves().flat_map(|(i, leaf)| (i * PER_LEAF..).zip(leaf.iter().copied()));
        entries.filter(|(page, _)| *page < self.pages())
    }

    /// Whether [`PageTable::check`] has found it sound.
    pub(crate) fn is_checked(&self) -> bool {
        self.checked.get().is_some()
    }

    /// Reads all nodes and leaves that were not read yet, and checks what is to be checked of all of them.
    ///
    /// # Errors
    /// As [`PageTable::entry`]; [`LayoutError::Damaged`] for a page with two uses, and for another number of pages than the header says.
    pub(crate) fn check(&self, source: &dyn Source) -> Result<(), LayoutError> {
        if self.is_checked() {
            return Ok(());
        }
        self.read_all(source)?;
        let mut uses = PageUses::new(source, self.header.file_bytes)?;
        if self.take_all(source, &mut uses)? != self.header.stored_pages {
            let problem = "it holds another number of pages than the header says";
            return Err(LayoutError::damaged_terrain(source.path(), "directory".into(), problem));
        }
        let _ = self.checked.set(());
        Ok(())
    }

    /// Takes all pages that this, of which all was read, leads to; how many of them are of records.
    pub(crate) fn take_all(&self, source: &dyn Source, uses: &mut PageUses) -> Result<u64, LayoutError> {
        uses.take_root(source, &self.header, &self.root)?;
        if self.shape.has_nodes() {
            for (i, node) in (0u64..).zip(&self.nodes).filter_map(|(i, node)| Some((i, node.get()?))) {
                uses.take_leaves(source, i * PER_LEAF, &node.entries)?;
            }
        }
        let mut stored = 0;
        for (i, leaf) in self.leaves() {
            uses.take_entries(source, i * PER_LEAF, leaf)?;
            stored += present(leaf);
        }
        Ok(stored)
    }

    fn read_nodes(&self, source: &dyn Source) -> Result<(), LayoutError> {
        (0u64..self.nodes.len() as u64).try_for_each(|i| self.node(source, i).map(drop))
    }

    /// Reads all nodes and leaves that were not read yet: leaves that lie one after the other at once.
    fn read_all(&self, source: &dyn Source) -> Result<(), LayoutError> {
        self.read_nodes(source)?;
        let wanted: Vec<(u64, Entry)> =
            self.leaf_entries().filter(|(leaf, _)| self.known_leaf(*leaf).is_none()).collect();
        let follows = |a: &(u64, Entry), b: &(u64, Entry)| a.1.page.checked_add(1) == Some(b.1.page);
        let mut bytes = Vec::new();
        for run in wanted.chunk_by(follows).flat_map(|run| run.chunks(RUN_LEAVES)) {
            bytes.resize(run.len() * PAGE_BYTES, 0);
            source.read_at(u64::from(run[0].1.page) * PAGE_BYTES as u64, &mut bytes)?;
            for ((leaf, here), page) in run.iter().zip(bytes.as_chunks::<PAGE_BYTES>().0) {
                if !is_in_file(&self.header, here.page) {
                    return Err(damaged_leaf(source, *leaf, "it lies outside the file"));
                }
                let entries = parse_leaf(source, &self.header, *leaf, *here, page)?;
                let (node, within) = split(*leaf);
                if let Some(Some(node)) = self.known_node(node) {
                    let _ = node.leaves[within].set(Arc::new(entries));
                }
            }
        }
        Ok(())
    }
}

/// Leaf of a logical page, or node of a leaf, and its place there.
fn split(number: u64) -> (u64, usize) {
    (number / PER_LEAF, (number % PER_LEAF) as usize)
}

/// Entries that are present.
pub(crate) fn present(entries: &[Entry]) -> u64 {
    entries.iter().filter(|entry| entry.is_present()).count() as u64
}
