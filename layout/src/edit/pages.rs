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
/// The page is not here.
const AWAY: u32 = u32::MAX;

/// A page in memory.
#[derive(Debug)]
struct Held {
    logical: u64,
    /// Whether it differs, or once differed, from the terrain's.
    edited: bool,
    bytes: Box<Page>,
    /// What it held at the last commit, if it was written to since.
    committed: Option<Box<Page>>,
}

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
    /// Index in `held` of each logical page, or [`AWAY`].
    index: Vec<u32>,
    held: Vec<Held>,
    clean: usize,
    log: Vec<Overwritten<C::Raw>>,
    uncommitted: Vec<u64>,
    failure: Option<LayoutError>,
}

impl<C: RecordCodec> Pages<C> {
    /// Binary logarithm of the records a page.
    const SHIFT: u32 = (PAGE_BYTES / C::BYTES).trailing_zeros();

    pub(super) fn new(terrain: Arc<Terrain>) -> Self {
        Self {
            k: terrain.grid().k(),
            index: vec![AWAY; terrain.entries().len()],
            terrain,
            held: Vec::new(),
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
        C::read(&self.page_of(slot).bytes[within..within + C::BYTES])
    }

    /// The record of a slot whose page is here.
    #[inline(always)]
    pub(super) fn raw_if_held(&self, slot: u64) -> Option<C::Raw> {
        let page = self.held.get(self.index[(slot >> Self::SHIFT) as usize] as usize)?;
        let within = Self::within(slot);
        Some(C::read(&page.bytes[within..within + C::BYTES]))
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
        if let Some(page) = self.held.get(self.index[(slot >> Self::SHIFT) as usize] as usize) {
            prefetch(&page.bytes[..], Self::within(slot));
        }
    }

    #[inline(always)]
    fn page_of(&mut self, slot: u64) -> &mut Held {
        let logical = slot >> Self::SHIFT;
        let mut at = self.index[logical as usize];
        if at == AWAY {
            at = self.load(logical);
        }
        &mut self.held[at as usize]
    }

    #[cold]
    fn load(&mut self, logical: u64) -> u32 {
        let bytes = self.terrain.checked_page(logical).unwrap_or_else(|error| {
            self.failure.get_or_insert(error);
            crate::opening::inert_page(self.terrain.header().record_kind)
        });
        let at = self.held.len() as u32;
        self.index[logical as usize] = at;
        self.clean += 1;
        self.held.push(Held { logical, edited: false, bytes, committed: None });
        at
    }

    /// Overwrites a record.
    pub(super) fn write(&mut self, point: GridPoint, slot: u64, raw: C::Raw) {
        let within = Self::within(slot);
        let page = self.page_of(slot);
        let old = C::read(&page.bytes[within..within + C::BYTES]);
        if page.committed.is_none() {
            page.committed = Some(page.bytes.clone());
            let was_edited = std::mem::replace(&mut page.edited, true);
            let logical = page.logical;
            self.clean -= usize::from(!was_edited);
            self.uncommitted.push(logical);
        }
        C::write(raw, &mut self.page_of(slot).bytes[within..within + C::BYTES]);
        self.log.push(Overwritten { point, slot, old });
    }

    /// Puts other contents into a page, which counts as committed; returns the old ones.
    pub(super) fn replace(&mut self, logical: u64, bytes: Box<Page>) -> Result<Box<Page>, LayoutError> {
        if self.index.get(to_usize(logical)?).is_none() {
            let pages = self.index.len();
            return Err(LayoutError::Usage(format!(
                "page {logical} does not exist; the terrain has {pages}"
            )));
        }
        let page = self.page_of(logical << Self::SHIFT);
        let old = std::mem::replace(&mut page.bytes, bytes);
        let was_edited = std::mem::replace(&mut page.edited, true);
        self.clean -= usize::from(!was_edited);
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
            C::write(old, &mut self.page_of(slot).bytes[within..within + C::BYTES]);
        }
    }

    /// Between batches: puts back what the pages held at the last commit; returns what they held until now.
    pub(super) fn roll_back(&mut self) -> Vec<(u64, Box<Page>)> {
        let mut until_now = Vec::with_capacity(self.uncommitted.len());
        for logical in std::mem::take(&mut self.uncommitted) {
            let page = self.held.get_mut(self.index[logical as usize] as usize);
            if let Some((page, committed)) = page.and_then(|p| p.committed.take().map(|c| (p, c))) {
                until_now.push((logical, std::mem::replace(&mut page.bytes, committed)));
            }
        }
        until_now
    }

    /// Logical pages written to since the last commit, ascending.
    pub(super) fn uncommitted(&self) -> Vec<u64> {
        let mut pages = self.uncommitted.clone();
        pages.sort_unstable();
        pages
    }

    /// Everything so far counts as committed.
    pub(super) fn mark_committed(&mut self) {
        for logical in std::mem::take(&mut self.uncommitted) {
            if let Some(page) = self.held.get_mut(self.index[logical as usize] as usize) {
                page.committed = None;
            }
        }
    }

    /// Whether anything was written to since the last commit.
    pub(super) fn is_committed(&self) -> bool {
        self.uncommitted.is_empty()
    }

    /// A page that was edited.
    pub(super) fn edited(&self, logical: u64) -> Option<&Page> {
        let at = *self.index.get(usize::try_from(logical).ok()?)?;
        self.held.get(at as usize).filter(|page| page.edited).map(|page| &*page.bytes)
    }

    /// All pages that were edited, in no order.
    pub(super) fn all_edited(&self) -> impl Iterator<Item = (u64, &Page)> {
        self.held.iter().filter(|page| page.edited).map(|page| (page.logical, &*page.bytes))
    }

    /// Drops pages that can be read again.
    #[cold]
    fn drop_clean(&mut self) {
        self.held.retain(|page| page.edited);
        self.index.fill(AWAY);
        for (at, page) in self.held.iter().enumerate() {
            self.index[page.logical as usize] = at as u32;
        }
        self.clean = 0;
    }
}
