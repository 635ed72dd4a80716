//! The resident pool: pages of a terrain file in memory of a fixed size, for terrains larger than memory.
//!
//! The pool reads nothing. A [`Loader`](super::loader::Loader) loads pages, which are put into the pool between two frames. A frame then finds a record or is told that its
//! page is not there, and never waits. Since nothing is mapped, a file that shrinks or a disk that fails cannot raise a signal here.
//!
//! Invariants: pages take at most the stated number of bytes, whatever the system's own cache does. The inert page and page 0 stay. A full
//! pool drops a page that was not read since the last round of the hand (second chance, after F. Corbato, "A Paging Experiment with the Multics
//! System", 1968). Cost: one look in a table of pages, a load more than a mapped file a record.

use super::page_map::PageMap;
use super::prefetch::prefetch;
use super::store::{RawOf, RecordShape, RecordStore, byte_in_page, page_of};
use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::file::entries::ENTRIES_PER_LEAF;
use crate::file::structure::inert_page;
use crate::grid::record::RecordCodec;
use std::sync::atomic::{AtomicBool, Ordering};

/// Least pages of a pool beside those that stay.
const LEAST_PAGES: usize = 16;
/// Frames that stay: the inert page, and page 0.
const STAYING: usize = 2;
/// The page is away.
const AWAY: u32 = u32::MAX;
/// The frame has no logical page.
const NO_PAGE: u64 = u64::MAX;

/// Pages of one terrain, resident in memory.
#[derive(Debug)]
pub struct PagePool<C> {
    shape: RecordShape<C>,
    /// Page frames, one after the other.
    bytes: Vec<u8>,
    /// Frame of each logical page, or [`AWAY`].
    frames: PageMap,
    /// Logical page of each frame, or [`NO_PAGE`].
    held: Vec<u64>,
    /// Whether a frame was read since the hand passed it.
    recent: Vec<AtomicBool>,
    /// Most frames.
    capacity: usize,
    hand: usize,
}

impl<C: RecordCodec> PagePool<C> {
    /// A pool for `terrain` of at most `cache_bytes`, 72 KiB at the least, holding page 0. Reads that page. Over packed terrain up to a quarter of them is for what pages are unpacked from.
    ///
    /// # Errors
    /// As [`Terrain::checked_page`].
    pub fn new(terrain: &Terrain, shape: RecordShape<C>, cache_bytes: u64) -> Result<Self, LayoutError> {
        let cache_bytes = cache_bytes - terrain.source().take_share(cache_bytes).min(cache_bytes);
        let most = usize::try_from(terrain.page_count()).unwrap_or(usize::MAX).saturating_add(STAYING);
        let capacity = usize::try_from(cache_bytes / PAGE_BYTES as u64).unwrap_or(usize::MAX);
        let capacity = capacity.clamp(STAYING + LEAST_PAGES, most.max(STAYING + LEAST_PAGES));
        // Page 0 stays, so its leaf is read first.
        let first = terrain.checked_page(0)?;
        let mut pool = Self {
            shape,
            // Zeroed lazily by the system: memory is taken as pages come.
            bytes: vec![0; capacity * PAGE_BYTES],
            frames: frames_of(terrain),
            held: Vec::with_capacity(capacity),
            recent: (0..capacity).map(|_| AtomicBool::new(false)).collect(),
            capacity,
            hand: STAYING,
        };
        // The inert page is no logical page; nothing looks it up.
        pool.held.push(NO_PAGE);
        pool.bytes[..PAGE_BYTES].copy_from_slice(&inert_page(terrain.header().record_kind)[..]);
        pool.install(0, &first)?;
        Ok(pool)
    }

    /// Whether a logical page is here. Absent pages are, as soon as it is known that they are absent; pages past the last one never.
    #[inline(always)]
    pub fn is_resident(&self, logical_page: u64) -> bool {
        self.frames.get(logical_page).is_some_and(|frame| frame != AWAY)
    }

    /// Takes a page in; gives up another if the pool is full.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if the terrain has no such page.
    pub fn install(&mut self, logical_page: u64, page: &Page) -> Result<(), LayoutError> {
        let Some(known) = self.frames.get(logical_page) else {
            return Err(LayoutError::Usage(format!(
                "page {logical_page} does not exist; the terrain has {}",
                self.frames.count()
            )));
        };
        if known == AWAY && self.bytes[..PAGE_BYTES] == page[..] {
            // An absent page whose directory leaf had not been read.
            self.frames.set(logical_page, 0);
            return Ok(());
        }
        let frame = match known {
            AWAY if self.held.len() < self.capacity => {
                self.held.push(NO_PAGE);
                self.held.len() - 1
            }
            AWAY => self.give_up_one(),
            0 => return Ok(()),
            here => here as usize,
        };
        self.bytes[frame * PAGE_BYTES..][..PAGE_BYTES].copy_from_slice(page);
        self.held[frame] = logical_page;
        self.frames.set(logical_page, frame as u32);
        *self.recent[frame].get_mut() = true;
        Ok(())
    }

    /// Moves everything to another pool. This one has no pages then, not even those that stay: it is to be dropped, and panics when it is asked for a record.
    pub fn take(&mut self) -> Self {
        Self {
            shape: self.shape.clone(),
            bytes: std::mem::take(&mut self.bytes),
            frames: std::mem::take(&mut self.frames),
            held: std::mem::take(&mut self.held),
            recent: std::mem::take(&mut self.recent),
            capacity: std::mem::take(&mut self.capacity),
            hand: self.hand,
        }
    }

    /// States whether a page is in the file now. One that has come to be there is away until it is installed; one that is no longer there is inert. Others, and pages that the terrain has
    /// not, are as they were.
    pub fn set_present(&mut self, logical_page: u64, is_present: bool) {
        let Some(frame) = self.frames.get(logical_page) else { return };
        match (frame, is_present) {
            (0, true) => self.frames.set(logical_page, AWAY),
            (0, false) | (_, true) => {}
            (AWAY, false) => self.frames.set(logical_page, 0),
            (here, false) => {
                self.frames.set(logical_page, 0);
                // Free for the next page that comes past the hand.
                self.held[here as usize] = NO_PAGE;
                *self.recent[here as usize].get_mut() = false;
            }
        }
    }

    /// States the lowest and highest height in metres that there is now.
    pub fn set_height_range_m(&mut self, range_m: [f64; 2]) {
        self.shape.height_range_m = range_m;
    }

    /// Frees the frame that was not read for longest, by and large.
    fn give_up_one(&mut self) -> usize {
        loop {
            self.hand = if self.hand + 1 < self.capacity { self.hand + 1 } else { STAYING };
            if !std::mem::replace(self.recent[self.hand].get_mut(), false) {
                // A frame whose page is no longer in the file holds none.
                if self.held[self.hand] != NO_PAGE {
                    self.frames.set(self.held[self.hand], AWAY);
                }
                return self.hand;
            }
        }
    }

    /// Pages held, those that stay included.
    pub fn pages_held(&self) -> usize {
        self.held.len()
    }
}

/// Frames of all logical pages while none is here: absent ones read as inert, of others, and where a directory leaf was not read yet, it is not known.
fn frames_of(terrain: &Terrain) -> PageMap {
    let mut frames = PageMap::new(terrain.page_count());
    let table = terrain.table();
    for leaf in table.maybe_present() {
        let known = table.known_leaf(leaf);
        frames.set_leaf_to_ones(leaf);
        let entries = (leaf * ENTRIES_PER_LEAF as u64..).zip(known.into_iter().flatten());
        let absent = entries.filter(|(page, entry)| *page < frames.count() && !entry.is_present());
        absent.collect::<Vec<_>>().into_iter().for_each(|(page, _)| frames.set(page, 0));
    }
    frames
}

impl<C: RecordCodec> RecordStore for PagePool<C> {
    type Codec = C;

    const IS_COMPLETE: bool = false;

    #[inline(always)]
    fn shape(&self) -> &RecordShape<C> {
        &self.shape
    }

    #[inline(always)]
    fn get(&self, slot: u64) -> Option<RawOf<Self>> {
        let frame = self.frames.at(page_of::<C>(slot));
        if frame == AWAY {
            return None;
        }
        let frame = frame as usize;
        // A plain load first: most are set already, and a store would take the cache line from other threads.
        let recent = &self.recent[frame];
        if !recent.load(Ordering::Relaxed) {
            recent.store(true, Ordering::Relaxed);
        }
        let within = byte_in_page::<C>(slot);
        let at = frame * PAGE_BYTES + within;
        Some(C::read(&self.bytes[at..at + C::BYTES]))
    }

    #[inline(always)]
    fn prefetch(&self, slot: u64) {
        if let Some(frame) = self.frames.get(page_of::<C>(slot)).filter(|f| *f != AWAY) {
            let within = byte_in_page::<C>(slot);
            prefetch(&self.bytes, frame as usize * PAGE_BYTES + within);
        }
    }
}
