//! Records into pages, pages into the file: gathers each planned page once its last row is known, then closes the gaps that
//! all-void pages left and writes directory and header.
//!
//! Pages are gathered in parallel and land at places fixed by the plan, so threads and order do not show in the bytes.

use super::levels::{LevelShape, Levels};
use super::plan::{LevelPlan, Plan};
use crate::atomic_file::{AtomicFile, read_at, write_at};
use crate::bytes::{PAGE_BYTES, Page, checksum};
use crate::directory::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, leaf_page};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::header::{Header, INERT_PAGE};
use crate::order::point_of;
use crate::record::RecordCodec;
use crate::terrain::inert_page;
use rayon::prelude::*;
use std::collections::BTreeMap;

const PAGE: u64 = PAGE_BYTES as u64;

/// Writes the pages of one file.
pub(super) struct PageWriter<'a, C: RecordCodec> {
    file: &'a AtomicFile,
    grid: Grid,
    levels: Vec<LevelPlan>,
    next: Vec<[usize; 2]>,
    /// Place of each logical page as planned, then as written.
    entries: Vec<Entry>,
    /// Pages shared by several levels, until all is known.
    shared: BTreeMap<u64, Box<Page>>,
    inert: Box<Page>,
    codec: std::marker::PhantomData<C>,
}

impl<'a, C: RecordCodec> PageWriter<'a, C> {
    pub(super) fn new(file: &'a AtomicFile, grid: Grid, plan: Plan, kind: crate::record::RecordKind) -> Self {
        let mut page = INERT_PAGE;
        let entries = plan
            .present
            .iter()
            .map(|present| {
                page += u32::from(*present);
                Entry { page: if *present { page } else { 0 }, ..Entry::default() }
            })
            .collect();
        Self {
            file,
            grid,
            next: vec![[0; 2]; plan.levels.len()],
            levels: plan.levels,
            entries,
            shared: BTreeMap::new(),
            inert: inert_page(kind),
            codec: std::marker::PhantomData,
        }
    }

    fn failed(&self, e: std::io::Error) -> LayoutError {
        LayoutError::io(self.file.target(), "cannot write the terrain file", e)
    }

    /// Writes the pages of `level` that are complete now that all its rows up to `done_y` are; returns the least y whose rows later pages
    /// need.
    pub(super) fn advance(
        &mut self,
        level: u32,
        done_y: i64,
        records: &Levels<C::Raw>,
    ) -> Result<i64, LayoutError> {
        let shape = LevelShape::new(&self.grid, level);
        let plan = &self.levels[level as usize];
        let [next_page, next_slot] = self.next[level as usize];
        let pages = plan.pages[next_page..].partition_point(|t| i64::from(t.y[1]) <= done_y);
        let slots = plan.slots[next_slot..].partition_point(|t| i64::from(t.y) <= done_y);
        // The checksum of each page written; none for one that is inert after all.
        let written: Vec<(u64, Option<u32>)> = plan.pages[next_page..next_page + pages]
            .par_iter()
            .with_min_len(16)
            .map(|task| {
                let page = self.gather(task.page, &shape, records);
                if *page == *self.inert {
                    return Ok((task.page, None));
                }
                let place = self.entries[task.page as usize].page;
                write_at(self.file.file(), &page[..], u64::from(place) * PAGE).map_err(|e| self.failed(e))?;
                Ok((task.page, Some(checksum(&page[..]))))
            })
            .collect::<Result<_, LayoutError>>()?;
        for task in &plan.slots[next_slot..next_slot + slots] {
            let raw = self.record(task.slot, &shape, records);
            put_shared::<C>(&mut self.shared, &self.inert, task.slot, raw);
        }
        for (page, sum) in written {
            if let Some(sum) = sum {
                let entry = &mut self.entries[page as usize];
                (entry.checksum, entry.generation) = (sum, 1);
            }
        }
        self.next[level as usize] = [next_page + pages, next_slot + slots];
        let plan = &self.levels[level as usize];
        let waiting_page =
            plan.pages.get(next_page + pages).map(|t| i64::from(t.y[1]) - i64::from(plan.span));
        let waiting_slot = plan.slots.get(next_slot + slots).map(|t| i64::from(t.y));
        Ok(waiting_page.into_iter().chain(waiting_slot).min().unwrap_or(i64::MAX))
    }

    fn record(&self, slot: u64, shape: &LevelShape, records: &Levels<C::Raw>) -> C::Raw {
        point_of(self.grid.k(), slot)
            .filter(|p| !shape.is_beyond(*p))
            .and_then(|p| {
                let (row, column) = shape.index(p);
                records.row(shape.level(), row)?.get(column).copied()
            })
            .unwrap_or(C::INERT)
    }

    fn gather(&self, page: u64, shape: &LevelShape, records: &Levels<C::Raw>) -> Box<Page> {
        let mut bytes = Box::new([0; PAGE_BYTES]);
        let first = page * (PAGE_BYTES / C::BYTES) as u64;
        for (i, place) in bytes.chunks_exact_mut(C::BYTES).enumerate() {
            C::write(self.record(first + i as u64, shape, records), place);
        }
        bytes
    }

    /// Sets a record outside the levels: a corner's.
    pub(super) fn set(&mut self, slot: u64, raw: C::Raw) {
        put_shared::<C>(&mut self.shared, &self.inert, slot, raw);
    }

    /// Writes what remains, closes gaps, and gives `header` its places.
    pub(super) fn finish(mut self, header: &mut Header) -> Result<(), LayoutError> {
        let shared = std::mem::take(&mut self.shared);
        for (page, bytes) in shared {
            let entry = &mut self.entries[page as usize];
            if *bytes != *self.inert {
                (entry.checksum, entry.generation) = (checksum(&bytes[..]), 1);
                let place = u64::from(entry.page) * PAGE;
                write_at(self.file.file(), &bytes[..], place).map_err(|e| self.failed(e))?;
            }
        }
        let end = self.close_gaps()?;
        let mut root = vec![0; self.entries.len().div_ceil(ENTRIES_PER_LEAF) * ENTRY_BYTES];
        let mut page = end;
        for (i, entries) in self.entries.chunks(ENTRIES_PER_LEAF).enumerate() {
            if entries.iter().any(|e| e.is_present()) {
                let leaf = leaf_page(entries);
                Entry { page, checksum: checksum(&leaf), generation: 1 }.write(&mut root, i);
                write_at(self.file.file(), &leaf, u64::from(page) * PAGE).map_err(|e| self.failed(e))?;
                page += 1;
            }
        }
        header.root_page = page;
        header.root_checksum = checksum(&root);
        header.stored_pages = self.entries.iter().filter(|e| e.is_present()).count() as u64;
        root.resize(root.len().next_multiple_of(PAGE_BYTES), 0);
        header.file_bytes = u64::from(page) * PAGE + root.len() as u64;
        header.generation = 1;
        let file = self.file.file();
        write_at(file, &root, u64::from(page) * PAGE)
            .and_then(|()| write_at(file, &[0; PAGE_BYTES], PAGE))
            .and_then(|()| write_at(file, &self.inert[..], u64::from(INERT_PAGE) * PAGE))
            .and_then(|()| write_at(file, &header.to_page()[..], 0))
            .and_then(|()| file.set_len(header.file_bytes))
            .map_err(|e| self.failed(e))
    }

    /// Moves pages down over those planned that turned out inert; returns the first free page.
    fn close_gaps(&mut self) -> Result<u32, LayoutError> {
        let mut free = INERT_PAGE + 1;
        let mut page = Box::new([0; PAGE_BYTES]);
        for i in 0..self.entries.len() {
            let entry = self.entries[i];
            if entry.generation == 0 {
                self.entries[i] = Entry::default();
                continue;
            }
            if entry.page != free {
                read_at(self.file.file(), &mut page[..], u64::from(entry.page) * PAGE)
                    .and_then(|()| write_at(self.file.file(), &page[..], u64::from(free) * PAGE))
                    .map_err(|e| self.failed(e))?;
                self.entries[i].page = free;
            }
            free += 1;
        }
        Ok(free)
    }
}

/// Sets the record of a slot in a shared page.
fn put_shared<C: RecordCodec>(shared: &mut BTreeMap<u64, Box<Page>>, inert: &Page, slot: u64, raw: C::Raw) {
    let per_page = (PAGE_BYTES / C::BYTES) as u64;
    let page = shared.entry(slot / per_page).or_insert_with(|| Box::new(*inert));
    C::write(raw, &mut page[(slot % per_page) as usize * C::BYTES..]);
}
