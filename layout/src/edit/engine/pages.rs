//! The pages that an editor works on, the terrain's own until they are written to, and what was overwritten.
//!
//! Pages are read when they are touched. Those that are not committed stay. Of all others, which can be read again from the file, a bounded number is kept. A page that
//! cannot be read does not stop the work halfway through. The first error is kept until the end of the batch, which then is taken back.
//!
//! Invariants: the log holds every record that was overwritten since the batch began, each once and as it was then, so that it takes the batch back. A page that was
//! written to since the last commit has a copy from before, which takes everything back. While a commit is under way the copies from before it are kept until it has succeeded.

use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, to_usize};
use crate::file::entries::Entry;
use crate::grid::GridPoint;
use crate::grid::order::slot_of;
use crate::grid::record::RecordCodec;
use crate::read::prefetch::prefetch;
use crate::read::store::{byte_in_page, page_of, records_per_page};
use crate::read::terrain::Terrain;
use std::collections::HashMap;
use std::sync::Arc;

/// Pages kept that can be read again, unless another number is asked for: 64 MiB.
const CLEAN_PAGES: usize = 16_384;

/// The page differs, or once differed, from the terrain's.
const EDITED: u8 = 1;
/// It was written to since the last commit began.
const UNCOMMITTED: u8 = 2;
/// It is in the commit that is under way.
const TAKEN: u8 = 4;

/// A record that was overwritten.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Overwritten<R> {
    pub(crate) point: GridPoint,
    pub(crate) slot: u64,
    pub(crate) old: R,
}

/// Bits for the records of a page that the batch wrote to.
type Marks = [u64; PAGE_BYTES / 4 / 64];

/// Pages with edits.
#[derive(Debug)]
pub(crate) struct Pages<C: RecordCodec> {
    terrain: Arc<Terrain>,
    k: u32,
    /// What each logical page holds, as far as it is here.
    held: Vec<Option<Box<Page>>>,
    /// [`EDITED`], [`UNCOMMITTED`], [`TAKEN`] of each logical page.
    flags: Vec<u8>,
    /// Where pages lie that commits have moved.
    moved: HashMap<u64, Entry>,
    /// Pages here that can be read again, and how many of them are kept.
    clean: usize,
    most_clean: usize,
    log: Vec<Overwritten<C::Raw>>,
    /// Where the marks of a page are, counted from 1; 0 for pages that the batch did not write to.
    marked: Vec<u32>,
    marks: Vec<(u64, Marks)>,
    /// Pages written to since the last commit began, and what they held then.
    uncommitted: Vec<(u64, Box<Page>)>,
    /// How many of them were written to by batches that stay; those behind are the batch's that is under way.
    kept: usize,
    /// Pages in the commit that is under way, and what they held before.
    taken: Vec<(u64, Box<Page>)>,
    failure: Option<LayoutError>,
}

impl<C: RecordCodec> Pages<C> {
    pub(crate) fn new(terrain: Arc<Terrain>) -> Self {
        let count = usize::try_from(terrain.page_count()).unwrap_or(usize::MAX);
        Self {
            k: terrain.grid().k(),
            terrain,
            held: vec![None; count],
            flags: vec![0; count],
            moved: HashMap::new(),
            clean: 0,
            most_clean: CLEAN_PAGES,
            log: Vec::new(),
            marked: vec![0; count],
            marks: Vec::new(),
            uncommitted: Vec::new(),
            kept: 0,
            taken: Vec::new(),
            failure: None,
        }
    }

    pub(crate) fn terrain(&self) -> &Arc<Terrain> {
        &self.terrain
    }

    /// Whether any sample is void.
    pub(crate) fn has_voids(&self) -> bool {
        self.terrain.header().has_voids
    }

    /// The record of a slot; inert if its page cannot be read, which [`Pages::check`] tells.
    #[inline(always)]
    pub(crate) fn raw(&mut self, slot: u64) -> C::Raw {
        let within = byte_in_page::<C>(slot);
        C::read(&self.page_at(slot)[within..within + C::BYTES])
    }

    /// The records of two slots, most often of one page.
    #[inline(always)]
    pub(crate) fn raw_pair(&mut self, slots: [u64; 2]) -> [C::Raw; 2] {
        let pages = slots.map(page_of::<C>);
        if pages[0] != pages[1] {
            return slots.map(|slot| self.raw(slot));
        }
        let page = self.page_at(slots[0]);
        slots.map(|slot| {
            let within = byte_in_page::<C>(slot);
            C::read(&page[within..within + C::BYTES])
        })
    }

    /// The record of a slot whose page is here.
    #[inline(always)]
    pub(crate) fn raw_if_held(&self, slot: u64) -> Option<C::Raw> {
        let page = self.held[page_of::<C>(slot) as usize].as_ref()?;
        let within = byte_in_page::<C>(slot);
        Some(C::read(&page[within..within + C::BYTES]))
    }

    /// The record of a grid point.
    #[inline(always)]
    pub(crate) fn raw_at(&mut self, p: GridPoint) -> C::Raw {
        self.raw(slot_of(self.k, p))
    }

    /// Asks memory for the record of a slot, if its page is here.
    #[inline(always)]
    pub(crate) fn prefetch(&self, slot: u64) {
        if let Some(Some(page)) = self.held.get(page_of::<C>(slot) as usize) {
            prefetch(&page[..], byte_in_page::<C>(slot));
        }
    }

    #[inline(always)]
    fn page_at(&mut self, slot: u64) -> &mut Page {
        let Self { terrain, held, clean, failure, moved, .. } = self;
        let logical = page_of::<C>(slot);
        held[logical as usize].get_or_insert_with(|| {
            *clean += 1;
            load(terrain, moved.get(&logical), logical, failure)
        })
    }

    /// A page as it is now.
    pub(crate) fn page(&mut self, logical: u64) -> Result<&Page, LayoutError> {
        self.check_index(logical)?;
        let at = to_usize(logical)?;
        if self.held[at].is_none() {
            let page = match self.moved.get(&logical) {
                Some(entry) => self.terrain.checked_page_at(logical, *entry)?,
                None => self.terrain.checked_page(logical)?,
            };
            self.held[at] = Some(page);
            self.clean += 1;
        }
        Ok(&*self.page_at(logical * records_per_page::<C>()))
    }

    /// What a page holds at another place in the file.
    pub(crate) fn read_at(&self, logical: u64, entry: Entry) -> Result<Box<Page>, LayoutError> {
        self.check_index(logical)?;
        self.terrain.checked_page_at(logical, entry)
    }

    fn check_index(&self, logical: u64) -> Result<(), LayoutError> {
        let pages = self.held.len();
        if logical < pages as u64 {
            return Ok(());
        }
        Err(LayoutError::Usage(format!("page {logical} does not exist; the terrain has {pages}")))
    }

    /// Overwrites a record.
    #[inline(always)]
    pub(crate) fn write(&mut self, point: GridPoint, slot: u64, raw: C::Raw) {
        let (logical, within) = (page_of::<C>(slot) as usize, byte_in_page::<C>(slot));
        if self.marked[logical] == 0 {
            self.begin_writing(slot);
        }
        let place = &mut self.page_at(slot)[within..within + C::BYTES];
        let old = C::read(place);
        C::write(raw, place);
        let record = within / C::BYTES;
        let word = &mut self.marks[self.marked[logical] as usize - 1].1[record / 64];
        let bit = 1 << (record % 64);
        if *word & bit == 0 {
            *word |= bit;
            self.log.push(Overwritten { point, slot, old });
        }
    }

    /// Before the batch's first record in the page of a slot.
    #[inline(never)]
    fn begin_writing(&mut self, slot: u64) {
        let logical = page_of::<C>(slot);
        let at = logical as usize;
        self.marks.push((logical, [0; _]));
        self.marked[at] = self.marks.len() as u32;
        if self.flags[at] & UNCOMMITTED == 0 {
            let committed = Box::new(*self.page_at(slot));
            self.uncommitted.push((logical, committed));
            self.clean -= usize::from(self.flags[at] & TAKEN == 0);
            self.flags[at] |= EDITED | UNCOMMITTED;
        }
    }

    /// Ends the batch's marks.
    fn unmark(&mut self) {
        self.marks.drain(..).for_each(|(logical, _)| self.marked[logical as usize] = 0);
    }

    /// Puts what the file has at another place into a page that is here and committed.
    pub(crate) fn replace(&mut self, logical: u64, entry: Entry, bytes: Box<Page>) {
        let at = logical as usize;
        self.clean += usize::from(self.held[at].is_none());
        self.held[at] = Some(bytes);
        self.flags[at] |= EDITED;
        self.moved.insert(logical, entry);
    }

    /// Keeps at most so many pages that can be read again.
    pub(crate) fn keep_at_most(&mut self, pages: usize) {
        self.most_clean = pages;
    }

    /// The first error since this was last asked.
    pub(crate) fn check(&mut self) -> Result<(), LayoutError> {
        self.failure.take().map_or(Ok(()), Err)
    }

    /// Notes an error that is not a page's.
    pub(crate) fn fail(&mut self, error: LayoutError) {
        self.failure.get_or_insert(error);
    }

    /// Whether something went wrong since [`Pages::check`].
    pub(crate) fn has_failed(&self) -> bool {
        self.failure.is_some()
    }

    /// What was overwritten since the batch began, each record once.
    pub(crate) fn overwritten(&self) -> &[Overwritten<C::Raw>] {
        &self.log
    }

    /// Ends a batch that is to stay.
    pub(crate) fn keep(&mut self) {
        self.log.clear();
        self.unmark();
        self.kept = self.uncommitted.len();
        if self.clean > self.most_clean {
            self.drop_clean();
        }
    }

    /// Ends a batch that is not.
    pub(crate) fn take_back(&mut self) {
        while let Some(Overwritten { slot, old, .. }) = self.log.pop() {
            let within = byte_in_page::<C>(slot);
            C::write(old, &mut self.page_at(slot)[within..within + C::BYTES]);
        }
        self.unmark();
        // Pages that this batch alone wrote to are as they were: there is nothing to commit of them.
        for (logical, _) in self.uncommitted.drain(self.kept..) {
            let flags = &mut self.flags[logical as usize];
            *flags &= !UNCOMMITTED;
            self.clean += usize::from(*flags & TAKEN == 0);
        }
    }

    /// Between batches: puts back what the pages held when the last commit began; returns what they held until now.
    pub(crate) fn roll_back(&mut self) -> Vec<(u64, Box<Page>)> {
        let mut until_now = Vec::with_capacity(self.uncommitted.len());
        self.kept = 0;
        for (logical, committed) in std::mem::take(&mut self.uncommitted) {
            let flags = &mut self.flags[logical as usize];
            *flags &= !UNCOMMITTED;
            self.clean += usize::from(*flags & TAKEN == 0);
            if let Some(page) = &mut self.held[logical as usize] {
                until_now.push((logical, std::mem::replace(page, committed)));
            }
        }
        until_now
    }

    /// Logical pages written to since the last commit began, ascending.
    pub(crate) fn uncommitted(&self) -> Vec<u64> {
        let mut pages: Vec<u64> = self.uncommitted.iter().map(|(logical, _)| *logical).collect();
        pages.sort_unstable();
        pages
    }

    /// Everything so far is on its way into the file.
    pub(crate) fn begin_commit(&mut self) {
        debug_assert!(self.taken.is_empty());
        self.taken = std::mem::take(&mut self.uncommitted);
        self.kept = 0;
        for (logical, _) in &self.taken {
            let flags = &mut self.flags[*logical as usize];
            *flags = *flags & !UNCOMMITTED | TAKEN;
        }
    }

    /// It is in the file, each page at a place of its own.
    pub(crate) fn end_commit(&mut self, places: &[(u64, Entry)]) {
        for (logical, _) in self.taken.drain(..) {
            let flags = &mut self.flags[logical as usize];
            *flags &= !TAKEN;
            self.clean += usize::from(*flags & UNCOMMITTED == 0);
        }
        self.moved.extend(places.iter().copied());
    }

    /// It is not: the copies from before it are those to go back to again.
    pub(crate) fn fail_commit(&mut self) {
        let since: HashMap<u64, usize> =
            self.uncommitted.iter().map(|(logical, _)| *logical).zip(0..).collect();
        for (logical, before) in std::mem::take(&mut self.taken) {
            let flags = &mut self.flags[logical as usize];
            *flags = *flags & !TAKEN | UNCOMMITTED;
            match since.get(&logical) {
                Some(at) => self.uncommitted[*at].1 = before,
                None => self.uncommitted.push((logical, before)),
            }
        }
        self.kept = self.uncommitted.len();
    }

    /// Whether nothing was written to since the last commit, and none is under way.
    pub(crate) fn is_committed(&self) -> bool {
        self.uncommitted.is_empty() && self.taken.is_empty()
    }

    /// Pages in memory, copies from before commits counted.
    pub(crate) fn held_pages(&self) -> usize {
        self.held.iter().flatten().count() + self.uncommitted.len() + self.taken.len()
    }

    /// A page that was edited, if it is here.
    pub(crate) fn edited(&self, logical: u64) -> Option<&Page> {
        let at = usize::try_from(logical).ok()?;
        let is_edited = self.flags.get(at)? & EDITED != 0;
        self.held[at].as_deref().filter(|_| is_edited)
    }

    /// All pages that were edited, ascending.
    pub(crate) fn all_edited(&self) -> Vec<u64> {
        (0u64..).zip(&self.flags).filter(|(_, flags)| **flags & EDITED != 0).map(|(page, _)| page).collect()
    }

    /// Drops pages that can be read again.
    #[cold]
    fn drop_clean(&mut self) {
        let pages = self.held.iter_mut().zip(&self.flags);
        pages.filter(|(_, flags)| **flags & (UNCOMMITTED | TAKEN) == 0).for_each(|(page, _)| *page = None);
        self.clean = 0;
    }
}

/// A page of the terrain; an inert one if it cannot be read, which `failure` tells.
#[cold]
fn load(
    terrain: &Terrain,
    moved: Option<&Entry>,
    logical: u64,
    failure: &mut Option<LayoutError>,
) -> Box<Page> {
    let read = match moved {
        Some(entry) => terrain.checked_page_at(logical, *entry),
        None => terrain.checked_page(logical),
    };
    read.unwrap_or_else(|error| {
        failure.get_or_insert(error);
        crate::file::structure::inert_page(terrain.header().record_kind)
    })
}
