//! Records into pages, pages into the file. The parts of each planned page are gathered once their last row is known. At the end the gaps that
//! pages of nothing but voids left are closed, and directory and header are written.
//!
//! Pages are gathered in parallel and written to places fixed by the plan, so neither threads nor order change the bytes. No page is ever made
//! for an ocean.

use super::gather::gather;
use super::levels::{LevelShape, Levels};
use super::plan::{LevelPlan, Plan, PlannedLeaf, place_of};
use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::bytes::{PAGE_BYTES, Page, checksum};
use crate::file::directory::{page_at, put_directory};
use crate::file::disk::Disk;
use crate::file::entries::Entry;
use crate::file::header::{Header, INERT_PAGE};
use crate::file::structure::inert_page;
use crate::grid::Grid;
use crate::grid::record::{RecordCodec, RecordKind};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

const PAGE: u64 = PAGE_BYTES as u64;
/// Parts gathered before their pages are written.
const PAGES_AT_ONCE: usize = 1024;

/// Writes the pages of one file.
pub(super) struct PageWriter<'a, C: RecordCodec> {
    file: &'a AtomicFile,
    disk: &'a dyn Disk,
    grid: Grid,
    levels: Vec<LevelPlan>,
    /// Next part of each level.
    next: Vec<usize>,
    /// Place of each planned page as planned, then as written, and the parts that it still lacks; by leaf of the directory.
    leaves: Leaves,
    /// Pages of which some parts are known.
    open: HashMap<u64, Box<Page>>,
    inert: Box<Page>,
    /// Complete pages on their way to the thread that writes them.
    outgoing: Option<SyncSender<PlacedPages>>,
    codec: std::marker::PhantomData<C>,
}

/// Leaves of the directory by number.
type Leaves = BTreeMap<u64, Box<PlannedLeaf>>;

/// Pages and their places in the file.
pub(super) type PlacedPages = Vec<(u32, Box<Page>)>;

/// The two ends of the way from gathering pages to writing them. One batch may wait while another is written.
pub(super) fn page_queue() -> (SyncSender<PlacedPages>, Receiver<PlacedPages>) {
    sync_channel(1)
}

/// Writes pages as they arrive, until there are no more. It runs on a thread of its own, so that no other thread waits for the disk.
pub(super) fn write_pages(
    file: &AtomicFile,
    disk: &dyn Disk,
    batches: Receiver<PlacedPages>,
) -> Result<(), LayoutError> {
    for (place, page) in batches.into_iter().flatten() {
        disk.write_at(file.file(), &page[..], u64::from(place) * PAGE).map_err(|e| failed(file, e))?;
    }
    Ok(())
}

fn failed(file: &AtomicFile, e: std::io::Error) -> LayoutError {
    let when_full = "cannot write the terrain file, for which there is no room; make some on its disk, or name an output on another";
    LayoutError::write(file.target(), "cannot write the terrain file", when_full, e)
}

impl<'a, C: RecordCodec> PageWriter<'a, C> {
    pub(super) fn new(
        file: &'a AtomicFile,
        disk: &'a dyn Disk,
        grid: Grid,
        plan: Plan,
        kind: RecordKind,
        outgoing: SyncSender<PlacedPages>,
    ) -> Result<Self, LayoutError> {
        let mut page = INERT_PAGE;
        let Plan { levels, mut leaves } = plan;
        for leaf in leaves.values_mut() {
            for (entry, _) in leaf.entries.iter_mut().zip(leaf.parts).filter(|(_, parts)| *parts > 0) {
                page = page_at(file.target(), (u64::from(page) + 1) * PAGE)?;
                entry.page = page;
            }
        }
        Ok(Self {
            file,
            disk,
            grid,
            next: vec![0; levels.len()],
            levels,
            leaves,
            open: HashMap::new(),
            inert: inert_page(kind),
            outgoing: Some(outgoing),
            codec: std::marker::PhantomData,
        })
    }

    /// Gathers the parts of `level` that are complete now that all its rows up to `done_y` are, and writes the pages that are; returns the
    /// least y whose rows later parts need.
    pub(super) fn advance(
        &mut self,
        level: u32,
        done_y: i64,
        records: &Levels<C::Raw>,
    ) -> Result<i64, LayoutError> {
        let shape = LevelShape::new(&self.grid, level);
        let plan = &self.levels[level as usize];
        let waiting = &plan.parts[self.next[level as usize]..];
        let ready = waiting.partition_point(|p| i64::from(p.y[1]) <= done_y);
        // Batches bound the memory of pages on their way to the file.
        for batch in waiting[..ready].chunks(PAGES_AT_ONCE) {
            let gathered: Vec<Option<Vec<u8>>> = batch
                .par_iter()
                .with_min_len(16)
                .map(|part| gather::<C>(&self.grid, part, &shape, records))
                .collect();
            let mut complete = Vec::new();
            for (part, bytes) in batch.iter().zip(gathered) {
                complete.extend(put(
                    &mut self.open,
                    &mut self.leaves,
                    &self.inert,
                    C::BYTES,
                    part.first(),
                    bytes.as_deref(),
                ));
            }
            send_pages(self.outgoing.as_ref(), &mut self.leaves, &self.inert, complete)?;
        }
        self.next[level as usize] += ready;
        let later = waiting.get(ready).map(|p| i64::from(p.y[1]) - i64::from(plan.span));
        Ok(later.unwrap_or(i64::MAX))
    }

    /// Sets the records of the corners, slots 0 to 3.
    pub(super) fn set_corners(&mut self, corners: [C::Raw; 4]) -> Result<(), LayoutError> {
        let mut bytes = vec![0; 4 * C::BYTES];
        for (raw, place) in corners.into_iter().zip(bytes.chunks_exact_mut(C::BYTES)) {
            C::write(raw, place);
        }
        let complete = put(&mut self.open, &mut self.leaves, &self.inert, C::BYTES, 0, Some(&bytes));
        send_pages(self.outgoing.as_ref(), &mut self.leaves, &self.inert, complete.into_iter().collect())
    }

    /// No more pages will come.
    pub(super) fn close_queue(&mut self) {
        self.outgoing = None;
    }

    /// Writes what remains, closes gaps, and gives `header` its places.
    pub(super) fn finish(mut self, header: &mut Header) -> Result<(), LayoutError> {
        let first = self.close_gaps()?;
        let leaves = self.leaves.iter().map(|(number, leaf)| (*number, &leaf.entries[..]));
        let stored =
            leaves.clone().flat_map(|(_, leaf)| leaf).filter(|entry| entry.is_present()).count() as u64;
        let shape = header.directory();
        let (root, page) = put_directory(self.file.target(), shape, leaves, first, |page, bytes| {
            self.disk
                .write_at(self.file.file(), bytes, u64::from(page) * PAGE)
                .map_err(|e| failed(self.file, e))
        })?;
        header.root_page = page;
        header.root_checksum = root.checksum;
        header.stored_pages = stored;
        header.file_bytes = u64::from(page) * PAGE + root.bytes.len() as u64;
        header.generation = 1;
        let (file, disk) = (self.file.file(), self.disk);
        disk.write_at(file, &root.bytes, u64::from(page) * PAGE)
            .and_then(|()| disk.write_at(file, &[0; PAGE_BYTES], PAGE))
            .and_then(|()| disk.write_at(file, &self.inert[..], u64::from(INERT_PAGE) * PAGE))
            .and_then(|()| disk.write_at(file, &header.to_page()[..], 0))
            .and_then(|()| disk.set_len(file, header.file_bytes))
            .map_err(|e| failed(self.file, e))
    }

    /// Moves pages down over those planned that turned out inert; returns the first free page.
    fn close_gaps(&mut self) -> Result<u32, LayoutError> {
        let mut free = INERT_PAGE + 1;
        let mut page = Box::new([0; PAGE_BYTES]);
        let (file, disk) = (self.file.file(), self.disk);
        for entry in self.leaves.values_mut().flat_map(|leaf| &mut leaf.entries) {
            if entry.generation == 0 {
                *entry = Entry::default();
                continue;
            }
            if entry.page != free {
                disk.read_at(file, &mut page[..], u64::from(entry.page) * PAGE)
                    .and_then(|()| disk.write_at(file, &page[..], u64::from(free) * PAGE))
                    .map_err(|e| failed(self.file, e))?;
                entry.page = free;
            }
            free += 1;
        }
        Ok(free)
    }
}

/// Puts the bytes of records of `record` bytes from slot `first` into their page, unless they are all inert; returns the page if that completes
/// it and anything was ever put there.
fn put(
    open: &mut HashMap<u64, Box<Page>>,
    leaves: &mut Leaves,
    inert: &Page,
    record: usize,
    first: u64,
    bytes: Option<&[u8]>,
) -> Option<(u64, Box<Page>)> {
    let per_page = (PAGE_BYTES / record) as u64;
    let number = first / per_page;
    if let Some(bytes) = bytes {
        let at = (first % per_page) as usize * record;
        let page = open.entry(number).or_insert_with(|| Box::new(*inert));
        page[at..at + bytes.len()].copy_from_slice(bytes);
    }
    let (leaf, within) = place_of(number);
    let lacking = &mut leaves.get_mut(&leaf)?.parts[within];
    *lacking -= 1;
    if *lacking > 0 {
        return None;
    }
    open.remove(&number).map(|page| (number, page))
}

/// Sends complete pages to be written and notes their checksums; pages that are inert after all are left out.
fn send_pages(
    outgoing: Option<&SyncSender<PlacedPages>>,
    leaves: &mut Leaves,
    inert: &Page,
    pages: Vec<(u64, Box<Page>)>,
) -> Result<(), LayoutError> {
    let sums: Vec<Option<u32>> =
        pages.par_iter().map(|(_, page)| (**page != *inert).then(|| checksum(&page[..]))).collect();
    let mut placed = Vec::with_capacity(pages.len());
    for ((number, page), sum) in pages.into_iter().zip(sums) {
        let (leaf, within) = place_of(number);
        if let Some(sum) = sum
            && let Some(leaf) = leaves.get_mut(&leaf)
        {
            let entry = &mut leaf.entries[within];
            (entry.checksum, entry.generation) = (sum, 1);
            placed.push((entry.page, page));
        }
    }
    // The writer hangs up only after an error, which it reports itself.
    if !placed.is_empty() && outgoing.is_none_or(|queue| queue.send(placed).is_err()) {
        return Err(LayoutError::Usage("the terrain file could not be written".into()));
    }
    Ok(())
}
