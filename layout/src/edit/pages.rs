//! The pages that an editor works on, the terrain's own until they are written to, and what was overwritten.
//!
//! Pages come when they are touched and stay once they are edited; of those that are not, a bounded number is kept. A page that cannot be read does not stop
//! the work halfway through: the first error is kept for whoever ends the batch, and takes it back.
//!
//! Invariants: the log holds every record that was overwritten since the batch began, in order, so that going back through it takes the batch back; a page that was
//! written to since the last commit has a copy from before, which takes everything back.

use crate::bytes::{PAGE_BYTES, Page, to_usize};
use crate::error::LayoutError;
use crate::grid::GridPoint;
use crate::order::slot_of;
use crate::prefetch::prefetch;
use crate::record::RecordCodec;
use crate::terrain::Terrain;
use std::sync::Arc;

/// Pages kept that are as in the file: 64 MiB.
const CLEAN_PAGES: usize = 16_384;

/// The page differs, or once differed, from the terrain's.
const EDITED: u8 = 1;
/// It was written to since the last commit.
const UNCOMMITTED: u8 = 2;

/// A record that was overwritten.
#[derive(Debug, Clone, Copy)]
pub(super) struct Overwritten<R> {
    pub(super) point: GridPoint,
    pub(super) slot: u64,
    pub(super) old: R,
}

/// Pages with edits.
#[derive(Debug)]
pub(super) struct Pages<C: RecordCodec> {
    terrain: Arc<Terrain>,
    k: u32,
    /// What each logical page holds, as far as it is here.
    held: Vec<Option<Box<Page>>>,
    /// [`EDITED`], [`UNCOMMITTED`] of each logical page.
    flags: Vec<u8>,
    /// Pages here that are as in the file.
    clean: usize,
    log: Vec<Overwritten<C::Raw>>,
    /// Pages written to since the last commit, and what they held then.
    uncommitted: Vec<(u64, Box<Page>)>,
    failure: Option<LayoutError>,
}

impl<C: RecordCodec> Pages<C> {
    /// Binary logarithm of the records a page.
    const SHIFT: u32 = (PAGE_BYTES / C::BYTES).trailing_zeros();

    pub(super) fn new(terrain: Arc<Terrain>) -> Self {
        let count = terrain.entries().len();
        Self {
            k: terrain.grid().k(),
            terrain,
            held: vec![None; count],
            flags: vec![0; count],
            clean: 0,
            log: Vec::new(),
            uncommitted: Vec::new(),
            failure: None,
        }
    }

    pub(super) fn terrain(&self) -> &Arc<Terrain> {
        &self.terrain
    }

    /// The record of a slot; inert if its page cannot be read, which [`Pages::check`] tells.
    #[inline(always)]
    pub(super) fn raw(&mut self, slot: u64) -> C::Raw {
        let within = Self::within(slot);
        C::read(&self.page_of(slot)[within..within + C::BYTES])
    }

    /// The record of a slot whose page is here.
    #[inline(always)]
    pub(super) fn raw_if_held(&self, slot: u64) -> Option<C::Raw> {
        let page = self.held[(slot >> Self::SHIFT) as usize].as_ref()?;
        let within = Self::within(slot);
        Some(C::read(&page[within..within + C::BYTES]))
    }

    /// The record of a grid point.
    #[inline(always)]
    pub(super) fn raw_at(&mut self, p: GridPoint) -> C::Raw {
        self.raw(slot_of(self.k, p))
    }

    /// Byte of a slot in its page.
    #[inline(always)]
    fn within(slot: u64) -> usize {
        (slot as usize & ((1 << Self::SHIFT) - 1)) * C::BYTES
    }

    /// Asks memory for the record of a slot, if its page is here.
    #[inline(always)]
    pub(super) fn prefetch(&self, slot: u64) {
        if let Some(Some(page)) = self.held.get((slot >> Self::SHIFT) as usize) {
            prefetch(&page[..], Self::within(slot));
        }
    }

    #[inline(always)]
    fn page_of(&mut self, slot: u64) -> &mut Page {
        let Self { terrain, held, clean, failure, .. } = self;
        let logical = slot >> Self::SHIFT;
        held[logical as usize].get_or_insert_with(|| {
            *clean += 1;
            load(terrain, logical, failure)
        })
    }

    /// Overwrites a record.
    pub(super) fn write(&mut self, point: GridPoint, slot: u64, raw: C::Raw) {
        let (logical, within) = ((slot >> Self::SHIFT) as usize, Self::within(slot));
        let page = self.page_of(slot);
        let place = &mut page[within..within + C::BYTES];
        let old = C::read(place);
        if self.flags[logical] & UNCOMMITTED == 0 {
            let committed = Box::new(*self.page_of(slot));
            self.uncommitted.push((logical as u64, committed));
            self.clean -= usize::from(self.flags[logical] & EDITED == 0);
            self.flags[logical] |= EDITED | UNCOMMITTED;
        }
        C::write(raw, &mut self.page_of(slot)[within..within + C::BYTES]);
        self.log.push(Overwritten { point, slot, old });
    }

    /// Puts other contents into a page, which counts as committed; returns the old ones.
    pub(super) fn replace(&mut self, logical: u64, bytes: Box<Page>) -> Result<Box<Page>, LayoutError> {
        let at = to_usize(logical)?;
        if at >= self.held.len() {
            let pages = self.held.len();
            return Err(LayoutError::Usage(format!(
                "page {logical} does not exist; the terrain has {pages}"
            )));
        }
        let old = Box::new(std::mem::replace(self.page_of(logical << Self::SHIFT), *bytes));
        self.clean -= usize::from(self.flags[at] & EDITED == 0);
        self.flags[at] |= EDITED;
        self.check()?;
        Ok(old)
    }

    /// The first error since this was last asked.
    pub(super) fn check(&mut self) -> Result<(), LayoutError> {
        self.failure.take().map_or(Ok(()), Err)
    }

    /// Notes an error that is not a page's.
    pub(super) fn fail(&mut self, error: LayoutError) {
        self.failure.get_or_insert(error);
    }

    /// Whether something went wrong since [`Pages::check`].
    pub(super) fn has_failed(&self) -> bool {
        self.failure.is_some()
    }

    /// What was overwritten since the batch began.
    pub(super) fn overwritten(&self) -> &[Overwritten<C::Raw>] {
        &self.log
    }

    /// Ends a batch that is to stay.
    pub(super) fn keep(&mut self) {
        self.log.clear();
        if self.clean > CLEAN_PAGES {
            self.drop_clean();
        }
    }

    /// Ends a batch that is not.
    pub(super) fn take_back(&mut self) {
        while let Some(Overwritten { slot, old, .. }) = self.log.pop() {
            let within = Self::within(slot);
            C::write(old, &mut self.page_of(slot)[within..within + C::BYTES]);
        }
    }

    /// Between batches: puts back what the pages held at the last commit; returns what they held until now.
    pub(super) fn roll_back(&mut self) -> Vec<(u64, Box<Page>)> {
        let mut until_now = Vec::with_capacity(self.uncommitted.len());
        for (logical, committed) in std::mem::take(&mut self.uncommitted) {
            self.flags[logical as usize] &= !UNCOMMITTED;
            if let Some(page) = &mut self.held[logical as usize] {
                until_now.push((logical, std::mem::replace(page, committed)));
            }
        }
        until_now
    }

    /// Logical pages written to since the last commit, ascending.
    pub(super) fn uncommitted(&self) -> Vec<u64> {
        let mut pages: Vec<u64> = self.uncommitted.iter().map(|(logical, _)| *logical).collect();
        pages.sort_unstable();
        pages
    }

    /// Everything so far counts as committed.
    pub(super) fn mark_committed(&mut self) {
        for (logical, _) in self.uncommitted.drain(..) {
            self.flags[logical as usize] &= !UNCOMMITTED;
        }
    }

    /// Whether nothing was written to since the last commit.
    pub(super) fn is_committed(&self) -> bool {
        self.uncommitted.is_empty()
    }

    /// A page that was edited.
    pub(super) fn edited(&self, logical: u64) -> Option<&Page> {
        let at = usize::try_from(logical).ok()?;
        let is_edited = self.flags.get(at)? & EDITED != 0;
        self.held[at].as_deref().filter(|_| is_edited)
    }

    /// All pages that were edited, ascending.
    pub(super) fn all_edited(&self) -> impl Iterator<Item = (u64, &Page)> {
        (0..self.held.len() as u64).filter_map(|logical| Some((logical, self.edited(logical)?)))
    }

    /// Drops pages that can be read again.
    #[cold]
    fn drop_clean(&mut self) {
        let pages = self.held.iter_mut().zip(&self.flags);
        pages.filter(|(_, flags)| **flags & EDITED == 0).for_each(|(page, _)| *page = None);
        self.clean = 0;
    }
}

/// A page of the terrain; an inert one if it cannot be read, which `failure` tells.
#[cold]
fn load(terrain: &Terrain, logical: u64, failure: &mut Option<LayoutError>) -> Box<Page> {
    terrain.checked_page(logical).unwrap_or_else(|error| {
        failure.get_or_insert(error);
        crate::opening::inert_page(terrain.header().record_kind)
    })
}
