//! The hot path from a slot to a vertex: a codec, the page table and the bytes of a terrain, resolved once, so that a vertex costs one table lookup, one load and a decode.
//!
//! Invariant: every page number in the table lies inside the bytes.

use super::page_map::PageMap;
use super::prefetch::prefetch;
use super::store::{CompleteStore, RecordShape, RecordStore, byte_in_page, page_of};
use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::file::header::INERT_PAGE;
use crate::grid::order::slot_of;
use crate::grid::record::{RecordCodec, Vertex};
use crate::grid::{Grid, GridPoint};

/// The bytes of a source: one slice, or two.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slices<'a> {
    pub(crate) first: &'a [u8],
    /// Offset of the second, and it.
    pub(crate) behind: (u64, &'a [u8]),
}

impl Slices<'_> {
    /// The record at an offset. A second slice costs the first nothing: it takes the place of the end of a check of bounds.
    #[inline(always)]
    fn record<C: RecordCodec>(&self, at: usize) -> C::Raw {
        match self.first.get(at..at + C::BYTES) {
            Some(bytes) => C::read(bytes),
            None => self.record_behind::<C>(at),
        }
    }

    #[cold]
    #[inline(never)]
    fn record_behind<C: RecordCodec>(&self, at: usize) -> C::Raw {
        let (start, bytes) = self.behind;
        let at = at - start as usize;
        C::read(&bytes[at..at + C::BYTES])
    }
}

/// The records of a terrain, of kind `C`: the hot path from slot to vertex.
#[derive(Debug, Clone)]
pub struct Records<'a, C: RecordCodec> {
    bytes: Slices<'a>,
    /// Counted from the inert page; the first of them in one row.
    pages: &'a PageMap,
    row: &'a [u32],
    shape: RecordShape<C>,
}

impl<'a, C: RecordCodec> Records<'a, C> {
    /// # Errors
    /// As [`Terrain::check_directory`].
    pub(crate) fn new(terrain: &'a Terrain, bytes: Slices<'a>, codec: C) -> Result<Self, LayoutError> {
        let pages = terrain.pages()?;
        Ok(Self { bytes, pages, row: pages.row(), shape: terrain.shape(codec) })
    }

    /// Grid shape and spacing.
    #[inline(always)]
    pub fn grid(&self) -> &Grid {
        &self.shape.grid
    }

    /// Lowest and highest height in metres.
    pub fn height_range_m(&self) -> [f64; 2] {
        self.shape.height_range_m
    }

    /// Whether any sample is void.
    pub fn has_voids(&self) -> bool {
        self.shape.has_voids
    }

    /// Logical pages.
    pub fn page_count(&self) -> u64 {
        self.pages.count()
    }

    /// File page of a logical page.
    #[inline(always)]
    fn page(&self, logical: u64) -> usize {
        let page = match self.row.get(usize::try_from(logical).unwrap_or(usize::MAX)) {
            Some(page) => *page,
            None => self.pages.behind(logical),
        };
        page as usize + INERT_PAGE as usize
    }

    /// Bytes a record.
    pub const fn record_bytes(&self) -> usize {
        C::BYTES
    }

    /// The record at `slot`, not yet decoded. Reading records early, before they are needed, hides the time memory takes.
    ///
    /// # Panics
    /// For a slot past the last page.
    #[inline(always)]
    pub fn raw(&self, slot: u64) -> C::Raw {
        let page = self.page(page_of::<C>(slot));
        let within = byte_in_page::<C>(slot);
        self.bytes.record::<C>(page * PAGE_BYTES + within)
    }

    /// Reads records of which one after the other lie in one page.
    pub(crate) fn near(&self) -> Near<'_, C> {
        Near { records: self, page: u64::MAX, bytes: &[0; PAGE_BYTES] }
    }

    /// Asks memory for the record at `slot`. A hint: reads nothing, and does nothing for a slot past the last page.
    #[inline(always)]
    pub fn prefetch(&self, slot: u64) {
        if let Some(page) = self.pages.get(page_of::<C>(slot)) {
            let within = byte_in_page::<C>(slot);
            prefetch(self.bytes.first, (page + INERT_PAGE) as usize * PAGE_BYTES + within);
        }
    }

    /// The vertex of a record at `level` (0 for corners).
    #[inline(always)]
    pub fn decode(&self, raw: C::Raw, level: u32) -> Vertex {
        self.shape.codec.decode(raw, level)
    }

    /// The vertex at `slot`, whose level is `level` (0 for corners).
    ///
    /// # Panics
    /// For a slot past the last page.
    #[inline(always)]
    pub fn vertex(&self, slot: u64, level: u32) -> Vertex {
        self.decode(self.raw(slot), level)
    }

    /// The vertex at a grid point.
    pub fn vertex_at(&self, p: GridPoint) -> Vertex {
        let level = if self.grid().is_corner(p) { 0 } else { self.grid().level(p) };
        self.vertex(slot_of(self.grid().k(), p), level)
    }
}

/// Records of the page that was read last, which is not looked up again.
pub(crate) struct Near<'r, C: RecordCodec> {
    records: &'r Records<'r, C>,
    page: u64,
    bytes: &'r [u8; PAGE_BYTES],
}

impl<C: RecordCodec> Near<'_, C> {
    /// As [`Records::raw`].
    #[inline(always)]
    pub(crate) fn raw(&mut self, slot: u64) -> C::Raw {
        let page = page_of::<C>(slot);
        if page != self.page && !self.turn_to(page) {
            return self.records.raw(slot);
        }
        let within = byte_in_page::<C>(slot);
        C::read(&self.bytes[within..within + C::BYTES])
    }

    /// Whether the page lies in the first slice.
    #[inline(always)]
    fn turn_to(&mut self, page: u64) -> bool {
        let first = self.records.page(page) * PAGE_BYTES;
        let bytes = self.records.bytes.first.get(first..).and_then(|bytes| bytes.first_chunk());
        let Some(bytes) = bytes else { return false };
        (self.page, self.bytes) = (page, bytes);
        true
    }
}

impl<C: RecordCodec> CompleteStore for Records<'_, C> {
    fn page_count(&self) -> u64 {
        Records::page_count(self)
    }
}

impl<C: RecordCodec> RecordStore for Records<'_, C> {
    type Codec = C;

    const IS_COMPLETE: bool = true;

    #[inline(always)]
    fn shape(&self) -> &RecordShape<C> {
        &self.shape
    }

    #[inline(always)]
    fn get(&self, slot: u64) -> Option<C::Raw> {
        Some(self.raw(slot))
    }

    /// One look into the table of pages and one check of bounds for both, where they lie in one page.
    #[inline(always)]
    fn pair(&self, slots: [u64; 2]) -> [C::Raw; 2] {
        if page_of::<C>(slots[0]) == page_of::<C>(slots[1]) {
            let page = self.page(page_of::<C>(slots[0]));
            let first = self.bytes.first.get(page * PAGE_BYTES..);
            if let Some(bytes) = first.and_then(|bytes| bytes.first_chunk::<PAGE_BYTES>()) {
                return slots.map(|slot| {
                    let within = byte_in_page::<C>(slot);
                    C::read(&bytes[within..within + C::BYTES])
                });
            }
        }
        slots.map(|slot| self.raw(slot))
    }

    #[inline(always)]
    fn prefetch(&self, slot: u64) {
        Records::prefetch(self, slot);
    }
}
