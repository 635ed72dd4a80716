//! A batch of edits on its way to the disk: everything that changed goes behind the file's end in one write, and when it is there, a header that leads to it (FORMAT.md, section 7).
//!
//! Nothing that a header leads to is ever written over. Killed at any moment the file holds a whole number of batches; readers that have it open keep what they opened.
//! Cost: the pages that changed, the directory leaves and nodes that lead to them, the root; two syncs.

use super::bases::Bases;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum};
use crate::file::directory::{page_at, put_leaf, root_bytes};
use crate::file::disk::Disk;
use crate::file::entries::{ENTRIES_PER_LEAF, Entry};
use crate::file::header::{Header, History};
use crate::file::journal::{Lineage, State};
use crate::file::page_table::PageTable;
use crate::file::tail::{Attempt, NextHeader, Tail};
use crate::imagery::PaintedSection;
use std::sync::Arc;

/// What a commit is about.
pub(crate) struct Content<'c> {
    /// Logical pages that changed, ascending, and what they hold now.
    pub(crate) pages: Vec<(u64, &'c Page)>,
    /// Range of heights and error top now.
    pub(crate) header: &'c Header,
    /// Painted tiles, to lie at the tail's begin.
    pub(crate) section: Option<PaintedSection>,
    pub(crate) edits: u64,
    pub(crate) label: &'c str,
}

/// A commit that is ready to be written, on any thread. Dropped without having run it wrote nothing, and the session finds that out.
#[derive(Debug)]
pub struct CommitJob {
    pub(crate) tail: Tail,
    /// What goes behind the file's end.
    data: Vec<u8>,
    /// What its pages differ little from, in a packed file.
    bases: Option<Bases>,
    pub(crate) next: NextHeader,
    /// Directory entries that change with it: (logical page, leaf or node, entry).
    pub(crate) entries: Vec<(usize, Entry)>,
    pub(crate) leaves: Vec<(usize, Entry)>,
    pub(crate) nodes: Vec<(usize, Entry)>,
    /// Painted tiles in it, without their bytes.
    pub(crate) section: Option<PaintedSection>,
}

impl CommitJob {
    /// Record pages that it writes.
    pub fn pages(&self) -> u64 {
        self.entries.len() as u64
    }

    /// Bytes by which the file grows; of a packed one by which it has grown.
    pub fn bytes(&self) -> u64 {
        self.tail.packed_growth().unwrap_or(self.data.len() as u64)
    }

    /// How far it has come.
    pub(crate) fn attempt(&self) -> Arc<Attempt> {
        Arc::clone(&self.next.attempt)
    }

    /// Puts `content` behind the end of a file with the current header `old` and this directory.
    pub(crate) fn new(
        tail: Tail,
        old: &Header,
        directory: &PageTable,
        lineage: &Lineage,
        mut bases: Option<Bases>,
        mut content: Content<'_>,
    ) -> Result<Self, LayoutError> {
        let (begin, generation) = (tail.begin(), tail.generation());
        let mut data = content.section.as_mut().map_or_else(Vec::new, |s| std::mem::take(&mut s.bytes));
        let next_page = |data: &Vec<u8>| page_at(tail.path(), begin + data.len() as u64);
        let mut entries = Vec::with_capacity(content.pages.len());
        bases.iter_mut().for_each(|bases| bases.none(data.len() / PAGE_BYTES));
        for (logical, page) in &content.pages {
            bases.as_mut().map_or(Ok(()), |bases| bases.record_page(*logical))?;
            let entry = Entry { page: next_page(&data)?, checksum: checksum(&page[..]), generation };
            entries.push((*logical as usize, entry));
            data.extend_from_slice(&page[..]);
        }
        let mut leaves = Vec::new();
        for of_leaf in entries.chunk_by(|a, b| a.0 / ENTRIES_PER_LEAF == b.0 / ENTRIES_PER_LEAF) {
            let leaf = of_leaf[0].0 / ENTRIES_PER_LEAF;
            let mut all = directory.read_leaf(leaf as u64);
            of_leaf.iter().for_each(|(logical, entry)| all[logical % ENTRIES_PER_LEAF] = *entry);
            bases.as_mut().map_or(Ok(()), |bases| bases.leaf(leaf as u64))?;
            let entry = put_leaf(&all, next_page(&data)?, generation, |bytes| {
                data.extend_from_slice(bytes);
                Ok(())
            })?;
            leaves.push((leaf, entry));
        }
        let added = entries
            .iter()
            .filter(|(logical, _)| !directory.known(*logical as u64).is_some_and(|old| old.is_present()))
            .count();
        let mut nodes = Vec::new();
        let has_nodes = old.directory().has_nodes();
        for of_node in leaves.chunk_by(|a, b| a.0 / ENTRIES_PER_LEAF == b.0 / ENTRIES_PER_LEAF) {
            if !has_nodes {
                break;
            }
            let node = of_node[0].0 / ENTRIES_PER_LEAF;
            let mut all = directory.node_entries(node as u64);
            of_node.iter().for_each(|(leaf, entry)| all[leaf % ENTRIES_PER_LEAF] = *entry);
            bases.iter_mut().for_each(|bases| bases.node(node));
            let entry = put_leaf(&all, next_page(&data)?, generation, |bytes| {
                data.extend_from_slice(bytes);
                Ok(())
            })?;
            nodes.push((node, entry));
        }
        let mut root = directory.root().to_vec();
        let listed = if has_nodes { &nodes } else { &leaves };
        listed.iter().for_each(|(place, entry)| root[*place] = *entry);
        let root = root_bytes(&root);
        let state = State {
            root_page: next_page(&data)?,
            root_checksum: root.checksum,
            stored_pages: old.stored_pages + added as u64,
            height_range_m: content.header.height_range_m,
            error_top_m: content.header.scale.error_top_m,
            imagery: content.section.as_ref().map_or(old.imagery, |section| Some(section.place)),
        };
        bases.iter_mut().for_each(|bases| bases.root(root.bytes.len() / PAGE_BYTES));
        data.extend_from_slice(&root.bytes);
        let commit_page = next_page(&data)?;
        data.extend_from_slice(&lineage.commit(state, content.edits, content.label).to_page()[..]);
        bases.iter_mut().for_each(|bases| bases.none(1));
        let next = tail.next_header(Header {
            file_bytes: begin + data.len() as u64,
            history: Some(History { commit_page, tip_page: commit_page }),
            ..state.put_into(old)
        })?;
        Ok(Self { tail, data, bases, next, entries, leaves, nodes, section: content.section })
    }

    /// A header alone: another state that is in the file already.
    pub(crate) fn turn(tail: Tail, header: Header) -> Result<Self, LayoutError> {
        let next = tail.next_header(header)?;
        Ok(Self {
            tail,
            data: Vec::new(),
            bases: None,
            next,
            entries: Vec::new(),
            leaves: Vec::new(),
            nodes: Vec::new(),
            section: None,
        })
    }

    /// Brings it to the disk.
    ///
    /// # Errors
    /// [`LayoutError::Io`], or [`LayoutError::Usage`] if the file was replaced under its name. The file reads as before then, or as after if only the last sync failed; the commit
    /// may be tried again.
    pub fn run(&self) -> Result<(), LayoutError> {
        self.run_on(&crate::file::disk::SystemDisk)
    }

    /// As [`CommitJob::run`], on another disk than the system's.
    ///
    /// # Errors
    /// As [`CommitJob::run`].
    pub fn run_on(&self, disk: &dyn Disk) -> Result<(), LayoutError> {
        match &self.bases {
            Some(bases) => self.tail.write_pages(disk, &self.data, bases.pages(), bases.source())?,
            None if self.data.is_empty() => {}
            None => self.tail.write(disk, &self.data, self.tail.begin())?,
        }
        self.tail.flip(disk, &self.next)
    }
}
