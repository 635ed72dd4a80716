//! The pages that an editor works on, the terrain's own until they are written to, and what was overwritten.
//!
//! Pages are read when they are touched. Those that are not committed stay. Of all others, which can be read again from the file, a bounded number is kept. A page that
//! cannot be read does not stop the work halfway through. The first error is kept until the end of the batch, which then is taken back.
//!
//! Invariants: the log holds every record that was overwritten since the batch began, each once and as it was then, so that it takes the batch back. A page that was
//! written to since the last commit has a copy from before, which takes everything back. While a commit is under way the copies from before it are kept until it has succeeded.

use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::file::entries::Entry;
use crate::grid::GridPoint;
use crate::grid::order::slot_of;
use crate::grid::record::RecordCodec;
use crate::read::page_map::PageMap;
use crate::read::prefetch::prefetch;
use crate::read::store::{byte_in_page, page_of};
use crate::read::terrain::Terrain;
use std::collections::HashMap;
use std::sync::Arc;

/// Pages kept that can be read again, unless another number is asked for: 64 MiB.
const CLEAN_PAGES: usize = 16_384;

/// Bytes of a line of the processor's caches.
const LINE_BYTES: usize = 64;

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

/// A page that something was asked of.
#[derive(Debug)]
struct Touched {
    logical: u64,
    /// What it holds, if that is here.
    held: Option<Box<Page>>,
    /// [`EDITED`], [`UNCOMMITTED`], [`TAKEN`].
    flags: u8,
    /// Where its marks are, counted from 1; 0 if the batch did not write to it.
    marked: u32,
}

/// Pages with edits.
#[derive(Debug)]
pub(crate) struct Pages<C: RecordCodec> {
    terrain: Arc<Terrain>,
    k: u32,
    /// Where in `touched` each logical page is, counted from 1; 0 for those that nothing was asked of.
    places: PageMap,
    touched: Vec<Touched>,
    /// Where pages lie that commits have moved.
    moved: HashMap<u64, Entry>,
    /// Pages here that can be read again, and how many of them are kept.
    clean: usize,
    most_clean: usize,
    log: Vec<Overwritten<C::Raw>>,
    /// Marks of pages that the batch wrote to, by their place in `touched`.
    marks: Vec<(usize, Marks)>,
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
        Self {
            k: terrain.grid().k(),
            places: PageMap::new(terrain.page_count()),
            terrain,
            touched: Vec::new(),
            moved: HashMap::new(),
            clean: 0,
            most_clean: CLEAN_PAGES,
            log: Vec::new(),
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
        let [a, b] = slots;
        if page_of::<C>(a) != page_of::<C>(b) {
            return [self.raw(a), self.raw(b)];
        }
        let page = self.page_at(a);
        let read = |slot: u64| C::read(&page[byte_in_page::<C>(slot)..][..C::BYTES]);
        [read(a), read(b)]
    }

    /// The record of a slot whose page is here.
    #[inline(always)]
    pub(crate) fn raw_if_held(&self, slot: u64) -> Option<C::Raw> {
        let page = self.held(page_of::<C>(slot))?;
        let within = byte_in_page::<C>(slot);
        Some(C::read(&page[within..within + C::BYTES]))
    }

    /// The record of a grid point.
    #[inline(always)]
    pub(crate) fn raw_at(&mut self, p: GridPoint) -> C::Raw {
        self.raw(slot_of(self.k, p))
    }

    /// Asks memory for the records of `count` slots from one on, as far as they lie in its page and that is here.
    #[inline(always)]
    pub(crate) fn prefetch_row(&self, slot: u64, count: u64) {
        if let Some(page) = self.held(page_of::<C>(slot)) {
            let first = byte_in_page::<C>(slot);
            let last = first + (count as usize - 1) * C::BYTES;
            for at in (first..last).step_by(LINE_BYTES).chain([last]) {
                prefetch(&page[..], at);
            }
        }
    }

    /// What was asked of a page, if anything was.
    #[inline(always)]
    fn known(&self, logical: u64) -> Option<&Touched> {
        self.touched.get((self.places.get(logical)? as usize).wrapping_sub(1))
    }

    #[inline(always)]
    fn held(&self, logical: u64) -> Option<&Page> {
        self.known(logical)?.held.as_deref()
    }

    /// Place of a page in `touched`.
    #[inline(always)]
    fn place(&mut self, logical: u64) -> usize {
        match self.places.at(logical) {
            0 => self.touch(logical),
            place => place as usize - 1,
        }
    }

    #[cold]
    fn touch(&mut self, logical: u64) -> usize {
        self.touched.push(Touched { logical, held: None, flags: 0, marked: 0 });
        self.places.set(logical, self.touched.len() as u32);
        self.touched.len() - 1
    }

    fn touched(&mut self, logical: u64) -> &mut Touched {
        let place = self.place(logical);
        &mut self.touched[place]
    }

    /// The page of a slot.
    #[inline(always)]
    pub(crate) fn page_at(&mut self, slot: u64) -> &mut Page {
        let logical = page_of::<C>(slot);
        let place = self.place(logical);
        self.page_in(place, logical)
    }

    /// The page that is at a place in `touched`.
    #[inline(always)]
    fn page_in(&mut self, place: usize, logical: u64) -> &mut Page {
        let Self { terrain, touched, clean, failure, moved, .. } = self;
        touched[place].held.get_or_insert_with(|| {
            *clean += 1;
            load(terrain, moved.get(&logical), logical, failure)
        })
    }

    /// A page as it is now.
    pub(crate) fn page(&mut self, logical: u64) -> Result<&Page, LayoutError> {
        self.check_index(logical)?;
        let place = self.place(logical);
        if self.touched[place].held.is_none() {
            let page = match self.moved.get(&logical) {
                Some(entry) => self.terrain.checked_page_at(logical, *entry)?,
                None => self.terrain.checked_page(logical)?,
            };
            self.touched[place].held = Some(page);
            self.clean += 1;
        }
        Ok(&*self.page_in(place, logical))
    }

    /// What a page holds at another place in the file.
    pub(crate) fn read_at(&self, logical: u64, entry: Entry) -> Result<Box<Page>, LayoutError> {
        self.check_index(logical)?;
        self.terrain.checked_page_at(logical, entry)
    }

    fn check_index(&self, logical: u64) -> Result<(), LayoutError> {
        let pages = self.places.count();
        if logical < pages {
            return Ok(());
        }
        Err(LayoutError::Usage(format!("page {logical} does not exist; the terrain has {pages}")))
    }

    /// Overwrites a record, which is `old`.
    #[inline(always)]
    pub(crate) fn write(&mut self, point: GridPoint, slot: u64, old: C::Raw, raw: C::Raw) {
        let (logical, within) = (page_of::<C>(slot), byte_in_page::<C>(slot));
        let at = self.place(logical);
        if self.touched[at].marked == 0 {
            self.begin_writing(at, logical);
        }
        let place = &mut self.page_in(at, logical)[within..within + C::BYTES];
        debug_assert!(C::read(place) == old, "what is taken back would be another record");
        C::write(raw, place);
        let record = within / C::BYTES;
        let word = &mut self.marks[self.touched[at].marked as usize - 1].1[record / 64];
        let bit = 1 << (record % 64);
        if *word & bit == 0 {
            *word |= bit;
            self.log.push(Overwritten { point, slot, old });
        }
    }

    /// Before the batch's first record in the page at a place in `touched`.
    #[inline(never)]
    fn begin_writing(&mut self, at: usize, logical: u64) {
        self.marks.push((at, [0; _]));
        self.touched[at].marked = self.marks.len() as u32;
        if self.touched[at].flags & UNCOMMITTED == 0 {
            let committed = Box::new(*self.page_in(at, logical));
            self.uncommitted.push((logical, committed));
            let flags = &mut self.touched[at].flags;
            self.clean -= usize::from(*flags & TAKEN == 0);
            *flags |= EDITED | UNCOMMITTED;
        }
    }

    /// Ends the batch's marks.
    fn unmark(&mut self) {
        self.marks.drain(..).for_each(|(place, _)| self.touched[place].marked = 0);
    }

    /// Puts what the file has at another place into a page that is here and committed.
    pub(crate) fn replace(&mut self, logical: u64, entry: Entry, bytes: Box<Page>) {
        let page = self.touched(logical);
        page.flags |= EDITED;
        let is_new = page.held.replace(bytes).is_none();
        self.clean += usize::from(is_new);
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
        for (logical, _) in self.uncommitted.split_off(self.kept) {
            let flags = &mut self.touched(logical).flags;
            *flags &= !UNCOMMITTED;
            let is_clean = *flags & TAKEN == 0;
            self.clean += usize::from(is_clean);
        }
    }

    /// Between batches: puts back what the pages held when the last commit began; returns what they held until now.
    pub(crate) fn roll_back(&mut self) -> Vec<(u64, Box<Page>)> {
        let mut until_now = Vec::with_capacity(self.uncommitted.len());
        self.kept = 0;
        for (logical, committed) in std::mem::take(&mut self.uncommitted) {
            let Touched { flags, held, .. } = self.touched(logical);
            *flags &= !UNCOMMITTED;
            let is_clean = *flags & TAKEN == 0;
            if let Some(page) = held {
                until_now.push((logical, std::mem::replace(page, committed)));
            }
            self.clean += usize::from(is_clean);
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
        let taken: Vec<u64> = self.taken.iter().map(|(logical, _)| *logical).collect();
        for logical in taken {
            let flags = &mut self.touched(logical).flags;
            *flags = *flags & !UNCOMMITTED | TAKEN;
        }
    }

    /// It is in the file, each page at a place of its own.
    pub(crate) fn end_commit(&mut self, places: &[(u64, Entry)]) {
        for (logical, _) in std::mem::take(&mut self.taken) {
            let flags = &mut self.touched(logical).flags;
            *flags &= !TAKEN;
            let is_clean = *flags & UNCOMMITTED == 0;
            self.clean += usize::from(is_clean);
        }
        self.moved.extend(places.iter().copied());
    }

    /// It is not: the copies from before it are those to go back to again.
    pub(crate) fn fail_commit(&mut self) {
        let since: HashMap<u64, usize> =
            self.uncommitted.iter().map(|(logical, _)| *logical).zip(0..).collect();
        for (logical, before) in std::mem::take(&mut self.taken) {
            let flags = &mut self.touched(logical).flags;
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
        self.touched.iter().filter(|page| page.held.is_some()).count()
            + self.uncommitted.len()
            + self.taken.len()
    }

    /// A page that was edited, if it is here.
    pub(crate) fn edited(&self, logical: u64) -> Option<&Page> {
        self.known(logical).filter(|page| page.flags & EDITED != 0)?.held.as_deref()
    }

    /// All pages that were edited, ascending.
    pub(crate) fn all_edited(&self) -> Vec<u64> {
        let edited = self.touched.iter().filter(|page| page.flags & EDITED != 0);
        let mut pages: Vec<u64> = edited.map(|page| page.logical).collect();
        pages.sort_unstable();
        pages
    }

    /// Drops pages that can be read again.
    #[cold]
    fn drop_clean(&mut self) {
        let clean = self.touched.iter_mut().filter(|page| page.flags & (UNCOMMITTED | TAKEN) == 0);
        clean.for_each(|page| page.held = None);
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
