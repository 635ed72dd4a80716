//! All records of a terrain of any source: a page is read when one of its records is first asked for, and kept in memory of a fixed size.
//!
//! To an engine it is as complete as [`Records`](super::records::Records): every record has an answer, so that meshes and counts are those of mapped terrain, frame by frame, however small
//! the memory. What is not in memory is read there and then, and a frame waits for it. So it is for replays and pictures, whose frames are to be whole; a window takes a [`PagePool`](super::pool::PagePool).
//!
//! Invariants: pages take at most the stated bytes. A page lies in one of eight places, and takes that which was not asked for since the last round. Asked by one thread, the same questions read the
//! same pages. A page that cannot be read gives inert records, the first error is kept, and nothing is read after it. Cost: a look at the eight places and a second one at the page's, no lock.
//!
//! Based on: words that are read without a lock and dropped if their place was written meanwhile, as H.-J. Boehm, "Can Seqlocks Get Along With Programming Language Memory Models?", MSPC 2012.

use super::prefetch::prefetch;
use super::store::{CompleteStore, PagesRead, RawOf, RecordShape, RecordStore, byte_in_page, page_of};
use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::grid::GridPoint;
use crate::grid::record::RecordCodec;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering, fence};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Places that a page may lie in.
const WAYS: usize = 8;
/// Least sets of places.
const LEAST_SETS: u64 = 2;
/// Words a page.
const WORDS: usize = PAGE_BYTES / 4;
/// Low bits of a tag, which count how often its place was written: a reader would have to sleep through as many times as they count to take another page's words. The page, counted from 1, lies above
/// them; the largest square has 2^33 pages.
const VERSION_BITS: u32 = 24;
/// Spreads pages that lie side by side over the sets: 2^64 over the golden ratio.
const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;
/// Bytes of the largest record.
const RECORD_BYTES: usize = 16;

/// Records of one terrain, read when they are asked for. Clones share what is in memory.
#[derive(Debug)]
pub struct PagedRecords<'t, C> {
    inner: Arc<Inner<'t, C>>,
}

impl<C> Clone for PagedRecords<'_, C> {
    fn clone(&self) -> Self {
        Self { inner: Arc::clone(&self.inner) }
    }
}

#[derive(Debug)]
struct Inner<'t, C> {
    terrain: &'t Terrain,
    shape: RecordShape<C>,
    /// Whether it is packed terrain with bounds of errors.
    has_bounds: bool,
    sets: u64,
    /// Page and version of each place; 0 for an empty one.
    tags: Vec<AtomicU64>,
    /// Pages, one place after the other.
    words: Vec<AtomicU32>,
    /// Whether a place was asked for since the hand passed it.
    recent: Vec<AtomicBool>,
    /// The hand of each set, which one thread at a time moves and writes behind.
    hands: Mutex<Vec<u8>>,
    failure: Mutex<Failure>,
    pages_read: AtomicU64,
    nanoseconds: AtomicU64,
}

/// What kept records from being read.
#[derive(Debug, Default)]
struct Failure {
    has_failed: bool,
    error: Option<LayoutError>,
}

impl<'t, C: RecordCodec> PagedRecords<'t, C> {
    pub(crate) fn new(terrain: &'t Terrain, shape: RecordShape<C>, cache_bytes: u64) -> Self {
        const { assert!(C::BYTES <= RECORD_BYTES && C::BYTES.is_multiple_of(4)) };
        let share = terrain.source().take_share(cache_bytes).min(cache_bytes);
        let set_bytes = (WAYS * PAGE_BYTES) as u64;
        // No more than the terrain has, whatever is allowed.
        let most = terrain.page_count().saturating_mul(2).div_ceil(WAYS as u64);
        let sets = ((cache_bytes - share) / set_bytes).min(most).max(LEAST_SETS);
        let places = usize::try_from(sets).unwrap_or(usize::MAX).saturating_mul(WAYS);
        let inner = Inner {
            terrain,
            shape,
            has_bounds: terrain.source().unpacking().is_some_and(|unpacking| unpacking.has_bounds()),
            sets,
            tags: (0..places).map(|_| AtomicU64::new(0)).collect(),
            // Zeroed lazily by the system: memory is taken as pages come.
            words: bytemuck::zeroed_vec(places.saturating_mul(WORDS)),
            recent: (0..places).map(|_| AtomicBool::new(false)).collect(),
            hands: Mutex::new(vec![0; places / WAYS]),
            failure: Mutex::default(),
            pages_read: AtomicU64::new(0),
            nanoseconds: AtomicU64::new(0),
        };
        Self { inner: Arc::new(inner) }
    }
}

impl<C: RecordCodec> Inner<'_, C> {
    /// First place of the set that a page lies in.
    #[inline(always)]
    fn set_of(&self, page: u64) -> usize {
        let spread = page.wrapping_mul(SPREAD) >> 32;
        (spread.wrapping_mul(self.sets) >> 32) as usize * WAYS
    }

    /// A record of a page that is in memory.
    #[inline(always)]
    fn find(&self, page: u64, within: usize) -> Option<C::Raw> {
        let first = self.set_of(page);
        let tags = self.tags.get(first..)?.first_chunk::<WAYS>()?;
        let way = tags.iter().position(|tag| tag.load(Ordering::Relaxed) >> VERSION_BITS == page + 1)?;
        let seen = tags[way].load(Ordering::Acquire);
        let at = (first + way) * WORDS + within / 4;
        let mut bytes = [0; RECORD_BYTES];
        let words = self.words.get(at..at + C::BYTES / 4)?;
        for (to, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *to = word.load(Ordering::Relaxed).to_le_bytes();
        }
        // If a word was of another page, its tag was written before, and is seen now.
        fence(Ordering::Acquire);
        if seen >> VERSION_BITS != page + 1 || tags[way].load(Ordering::Relaxed) != seen {
            return None;
        }
        let recent = &self.recent[first + way];
        if !recent.load(Ordering::Relaxed) {
            recent.store(true, Ordering::Relaxed);
        }
        Some(C::read(&bytes[..C::BYTES]))
    }

    /// A record of a page that was not in memory.
    #[cold]
    #[inline(never)]
    fn read(&self, page: u64, within: usize) -> C::Raw {
        let begun = Instant::now();
        let raw = if self.failure().has_failed { C::INERT } else { self.read_page(page, within) };
        self.nanoseconds.fetch_add(begun.elapsed().as_nanos() as u64, Ordering::Relaxed);
        raw
    }

    /// Reads a page and keeps it. Threads read side by side, and at worst the same page.
    fn read_page(&self, page: u64, within: usize) -> C::Raw {
        match self.terrain.checked_page(page) {
            Ok(bytes) => {
                self.pages_read.fetch_add(1, Ordering::Relaxed);
                let mut hands = self.hands.lock().unwrap_or_else(PoisonError::into_inner);
                // Nothing is written while the lock is held, unless another thread was before.
                if self.find(page, within).is_none() {
                    self.keep(page, &bytes, &mut hands);
                }
                C::read(&bytes[within..])
            }
            Err(error) => {
                let mut failure = self.failure();
                if !std::mem::replace(&mut failure.has_failed, true) {
                    failure.error = Some(error);
                }
                C::INERT
            }
        }
    }

    fn failure(&self) -> MutexGuard<'_, Failure> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a page where another was, or none.
    fn keep(&self, page: u64, bytes: &Page, hands: &mut [u8]) {
        let first = self.set_of(page);
        let hand = &mut hands[first / WAYS];
        let way = loop {
            let way = usize::from(*hand) % WAYS;
            *hand = hand.wrapping_add(1);
            if !self.recent[first + way].swap(false, Ordering::Relaxed) {
                break way;
            }
        };
        let (place, tag) = (first + way, &self.tags[first + way]);
        let version = tag.load(Ordering::Relaxed).wrapping_add(1) & ((1 << VERSION_BITS) - 1);
        tag.store(version, Ordering::Relaxed);
        // Who reads one of these words sees that the place is no longer what it was.
        fence(Ordering::Release);
        let words = &self.words[place * WORDS..][..WORDS];
        for (word, from) in words.iter().zip(bytes.as_chunks::<4>().0) {
            word.store(u32::from_le_bytes(*from), Ordering::Relaxed);
        }
        tag.store((page + 1) << VERSION_BITS | version, Ordering::Release);
        self.recent[place].store(true, Ordering::Relaxed);
    }
}

impl<C: RecordCodec> CompleteStore for PagedRecords<'_, C> {
    fn page_count(&self) -> u64 {
        self.inner.terrain.page_count()
    }

    fn read_so_far(&self) -> Option<PagesRead> {
        Some(PagesRead {
            pages: self.inner.pages_read.load(Ordering::Relaxed),
            time: Duration::from_nanos(self.inner.nanoseconds.load(Ordering::Relaxed)),
            unpacked: self.inner.terrain.source().unpacking().map(|unpacking| unpacking.unpacked()),
        })
    }

    fn take_error(&self) -> Option<LayoutError> {
        self.inner.failure().error.take()
    }
}

impl<C: RecordCodec> RecordStore for PagedRecords<'_, C> {
    type Codec = C;

    const IS_COMPLETE: bool = true;

    #[inline(always)]
    fn shape(&self) -> &RecordShape<C> {
        &self.inner.shape
    }

    #[inline(always)]
    fn get(&self, slot: u64) -> Option<RawOf<Self>> {
        let (page, within) = (page_of::<C>(slot), byte_in_page::<C>(slot));
        Some(self.inner.find(page, within).unwrap_or_else(|| self.inner.read(page, within)))
    }

    #[inline(always)]
    fn at_hand(&self, slot: u64) -> Option<RawOf<Self>> {
        self.inner.find(page_of::<C>(slot), byte_in_page::<C>(slot))
    }

    #[inline(always)]
    fn has_bounds(&self) -> bool {
        self.inner.has_bounds
    }

    fn error_bound_m(&self, slot: u64, p: GridPoint) -> f64 {
        self.inner.terrain.error_bound_m(page_of::<C>(slot), p)
    }

    #[inline(always)]
    fn prefetch(&self, slot: u64) {
        let first = self.inner.set_of(page_of::<C>(slot));
        prefetch(&self.inner.tags, first);
    }
}
