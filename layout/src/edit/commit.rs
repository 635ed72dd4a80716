//! A batch of edits on its way to the disk: everything that changed goes behind the file's end in one write, and when it is there, a header that leads to it (FORMAT.md, section 7).
//!
//! Nothing that a header leads to is ever written over. Killed at any moment the file holds a whole number of batches; readers that have it open keep what they opened.
//! Cost: the pages that changed, the directory leaves that lead to them, the root; two syncs.

use crate::bytes::{PAGE_BYTES, Page, checksum};
use crate::directory::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, leaf_page};
use crate::disk::Disk;
use crate::error::LayoutError;
use crate::header::{Header, History};
use crate::imagery::PaintedSection;
use crate::journal::{Commit, State};
use crate::lock::is_named;
use crate::slots::Slots;
use std::fs::File;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

const PAGE: u64 = PAGE_BYTES as u64;

/// A directory in memory.
#[derive(Debug, Clone)]
pub(super) struct Directory {
    /// One a logical record page.
    pub(super) entries: Vec<Entry>,
    /// One a leaf.
    pub(super) root: Vec<Entry>,
}

/// What a commit is about.
pub(super) struct Content<'c> {
    /// Logical pages that changed, ascending, and what they hold now.
    pub(super) pages: Vec<(u64, &'c Page)>,
    /// Range of heights and error top now.
    pub(super) header: &'c Header,
    /// Painted tiles, to lie at [`Place::end`].
    pub(super) section: Option<PaintedSection>,
    pub(super) edits: u64,
    pub(super) label: &'c str,
}

/// What a commit that failed may have left on the disk all the same, if its header was written to: the next one must not write over what that header leads to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Attempted {
    generation: u32,
    file_bytes: u64,
}

impl Attempted {
    /// Whether a header newer than this one may be on the disk.
    pub(super) fn is_after(&self, header: &Header) -> bool {
        self.generation > header.generation
    }

    /// Takes `job` into account, which was run.
    pub(super) fn note(&mut self, job: &CommitJob) {
        if job.header_begun.load(Ordering::Relaxed) {
            self.generation = self.generation.max(job.header.generation);
            self.file_bytes = self.file_bytes.max(job.header.file_bytes);
        }
    }
}

/// Where a file is written to.
#[derive(Debug)]
pub(super) struct Place {
    pub(super) path: PathBuf,
    pub(super) file: File,
    /// Offset of the file's first byte: 0, or where an overlay begins.
    pub(super) start: u64,
    pub(super) attempted: Attempted,
}

impl Place {
    /// Where what is written next goes: behind all that a header leads to.
    pub(super) fn end(&self, header: &Header) -> u64 {
        header.file_bytes.max(self.attempted.file_bytes).next_multiple_of(PAGE)
    }

    /// The generation after `header`'s.
    pub(super) fn next_generation(&self, header: &Header) -> Result<u32, LayoutError> {
        header.generation.max(self.attempted.generation).checked_add(1).ok_or_else(|| {
            LayoutError::Usage(format!(
                "{}: it was edited four thousand million times; `terrasoar compact` begins to count anew",
                self.path.display()
            ))
        })
    }
}

/// A commit that is ready to be written, on any thread.
#[derive(Debug)]
pub struct CommitJob {
    place: Place,
    /// What goes behind the file's end, and where that is in it.
    data: Vec<u8>,
    data_offset: u64,
    header_offset: u64,
    pub(super) header_page: Box<Page>,
    pub(super) header: Header,
    /// Directory entries that change with it: (logical page or leaf, entry).
    pub(super) entries: Vec<(usize, Entry)>,
    pub(super) leaves: Vec<(usize, Entry)>,
    /// Painted tiles in it, without their bytes.
    pub(super) section: Option<PaintedSection>,
    /// Record pages in it.
    pub(super) pages: u64,
    header_begun: AtomicBool,
}

impl CommitJob {
    /// Record pages that it writes.
    pub fn pages(&self) -> u64 {
        self.pages
    }

    /// Bytes by which the file grows.
    pub fn bytes(&self) -> u64 {
        self.data.len() as u64
    }

    /// Puts `content` behind the end of the file whose current header is that of `slots`.
    pub(super) fn new(
        place: Place,
        slots: &Slots,
        directory: &Directory,
        original: State,
        sequence: u32,
        mut content: Content<'_>,
    ) -> Result<Self, LayoutError> {
        let old = &slots.header;
        let generation = place.next_generation(old)?;
        let begin = place.end(old);
        let mut data = content.section.as_mut().map_or_else(Vec::new, |s| std::mem::take(&mut s.bytes));
        let page_at =
            |data: &Vec<u8>| u32::try_from((begin + data.len() as u64) / PAGE).map_err(|_| too_long(&place));
        let mut entries = Vec::with_capacity(content.pages.len());
        for (logical, page) in &content.pages {
            let entry = Entry { page: page_at(&data)?, checksum: checksum(&page[..]), generation };
            entries.push((*logical as usize, entry));
            data.extend_from_slice(&page[..]);
        }
        let mut leaves = Vec::new();
        for of_leaf in entries.chunk_by(|a, b| a.0 / ENTRIES_PER_LEAF == b.0 / ENTRIES_PER_LEAF) {
            let leaf = of_leaf[0].0 / ENTRIES_PER_LEAF;
            let first = leaf * ENTRIES_PER_LEAF;
            let last = (first + ENTRIES_PER_LEAF).min(directory.entries.len());
            let mut all = directory.entries[first..last].to_vec();
            of_leaf.iter().for_each(|(logical, entry)| all[logical - first] = *entry);
            let bytes = leaf_page(&all);
            leaves.push((leaf, Entry { page: page_at(&data)?, checksum: checksum(&bytes), generation }));
            data.extend_from_slice(&bytes);
        }
        let added = entries.iter().filter(|(logical, _)| !directory.entries[*logical].is_present()).count();
        let mut root = directory.root.clone();
        leaves.iter().for_each(|(leaf, entry)| root[*leaf] = *entry);
        let mut root_bytes = vec![0; root.len() * ENTRY_BYTES];
        root.iter().enumerate().for_each(|(i, entry)| entry.write(&mut root_bytes, i));
        let state = State {
            root_page: page_at(&data)?,
            root_checksum: checksum(&root_bytes),
            stored_pages: old.stored_pages + added as u64,
            height_range_m: content.header.height_range_m,
            error_top_m: content.header.scale.error_top_m,
            imagery: content.section.as_ref().map_or(old.imagery, |section| Some(section.place)),
        };
        root_bytes.resize(root_bytes.len().next_multiple_of(PAGE_BYTES), 0);
        data.extend_from_slice(&root_bytes);
        let commit_page = page_at(&data)?;
        let commit = Commit {
            parent: old.history.map_or(0, |history| history.commit_page),
            sequence,
            edits: content.edits,
            state,
            original,
            label: content.label.to_owned(),
        };
        data.extend_from_slice(&commit.to_page()[..]);
        let header = Header {
            generation,
            file_bytes: begin + data.len() as u64,
            history: Some(History { commit_page, tip_page: commit_page }),
            ..state.put_into(old)
        };
        let pages = entries.len() as u64;
        let data_offset = begin - place.start;
        let section = content.section;
        Ok(Self { data, data_offset, entries, leaves, section, pages, ..Self::turn(place, slots, header) })
    }

    /// A header alone: another state that is in the file already.
    pub(super) fn turn(place: Place, slots: &Slots, header: Header) -> Self {
        Self {
            data: Vec::new(),
            data_offset: 0,
            header_offset: slots.next_offset(),
            header_page: header.amended(&slots.current),
            header,
            entries: Vec::new(),
            leaves: Vec::new(),
            section: None,
            pages: 0,
            header_begun: AtomicBool::new(false),
            place,
        }
    }

    /// Brings it to the disk.
    ///
    /// # Errors
    /// [`LayoutError::Io`], or [`LayoutError::Usage`] if the file was replaced under its name. The file reads as before then, or as after if only the last sync failed; the commit
    /// may be tried again.
    pub fn run(&self) -> Result<(), LayoutError> {
        self.run_on(&crate::disk::SystemDisk)
    }

    /// As [`CommitJob::run`], on another disk than the system's.
    ///
    /// # Errors
    /// As [`CommitJob::run`].
    pub fn run_on(&self, disk: &dyn Disk) -> Result<(), LayoutError> {
        let Place { path, file, .. } = &self.place;
        let write = |bytes: &[u8], offset: u64| {
            let when_full = "cannot append the edits to the file, for which there is no room; make some on its disk, and try again";
            disk.write_at(file, bytes, offset)
                .map_err(|e| LayoutError::write(path, "cannot append the edits to the file", when_full, e))
        };
        let sync =
            || disk.sync(file).map_err(|e| LayoutError::io(path, "cannot bring the file to the disk", e));
        if !self.data.is_empty() {
            write(&self.data, self.data_offset)?;
            sync()?;
        }
        if !is_named(file, path) {
            return Err(LayoutError::Usage(format!(
                "{}: the file was replaced by another while it was edited; open it again, and edit again",
                path.display()
            )));
        }
        self.header_begun.store(true, Ordering::Relaxed);
        write(&self.header_page[..], self.header_offset)?;
        sync()
    }
}

fn too_long(place: &Place) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: with these edits the file would be longer than 16 TiB; `terrasoar compact` drops what edits replaced",
        place.path.display()
    ))
}
