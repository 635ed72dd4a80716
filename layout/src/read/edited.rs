//! The records of a terrain with some of its pages replaced. Engines that need all records fly over this while the ground is edited.
//!
//! Pages are the file's until they are installed, and then this store's own. Cost over the records beneath: a branch a record, and 4 bytes a logical page.

use super::page_map::PageMap;
use super::prefetch::prefetch;
use super::store::{CompleteStore, PagesRead, RawOf, RecordShape, RecordStore, byte_in_page, page_of};
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::grid::record::RecordCodec;

/// The page is the file's. Zero, so that pages that are never replaced take no memory.
const FILES: u32 = 0;

/// Records of a terrain, some of them others than the file's, which `S` has.
#[derive(Debug, Clone)]
pub struct EditedRecords<S: RecordStore> {
    records: S,
    shape: RecordShape<S::Codec>,
    /// Which own page each logical page is, counted from 1, or [`FILES`].
    own: PageMap,
    /// Own pages, one after the other.
    bytes: Vec<u8>,
}

impl<S: CompleteStore> EditedRecords<S> {
    /// The records as the file has them.
    pub fn new(records: S) -> Self {
        let own = PageMap::new(records.page_count());
        Self { shape: records.shape().clone(), records, own, bytes: Vec::new() }
    }

    /// Replaces a page.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if the terrain has no such page.
    pub fn install(&mut self, logical_page: u64, page: &Page) -> Result<(), LayoutError> {
        let count = self.own.count();
        let Some(own) = self.own.get(logical_page) else {
            return Err(LayoutError::Usage(format!(
                "page {logical_page} does not exist; the terrain has {count}"
            )));
        };
        if own == FILES {
            self.own.set(logical_page, (self.bytes.len() / PAGE_BYTES) as u32 + 1);
            self.bytes.extend_from_slice(page);
        } else {
            self.bytes[(own as usize - 1) * PAGE_BYTES..][..PAGE_BYTES].copy_from_slice(page);
        }
        Ok(())
    }

    /// States the lowest and highest height in metres that there is now.
    pub fn set_height_range_m(&mut self, range_m: [f64; 2]) {
        self.shape.height_range_m = range_m;
    }

    /// Own page and byte in it of a slot; `None` if it is the file's.
    #[inline(always)]
    fn place(&self, slot: u64) -> Option<usize> {
        let own = self.own.get(page_of::<S::Codec>(slot))?;
        let within = byte_in_page::<S::Codec>(slot);
        (own != FILES).then(|| (own as usize - 1) * PAGE_BYTES + within)
    }
}

impl<S: CompleteStore> CompleteStore for EditedRecords<S> {
    fn page_count(&self) -> u64 {
        self.own.count()
    }

    fn read_so_far(&self) -> Option<PagesRead> {
        self.records.read_so_far()
    }

    fn take_error(&self) -> Option<LayoutError> {
        self.records.take_error()
    }
}

impl<S: CompleteStore> RecordStore for EditedRecords<S> {
    type Codec = S::Codec;

    const IS_COMPLETE: bool = true;

    #[inline(always)]
    fn shape(&self) -> &RecordShape<S::Codec> {
        &self.shape
    }

    #[inline(always)]
    fn get(&self, slot: u64) -> Option<RawOf<Self>> {
        match self.place(slot) {
            Some(at) => Some(S::Codec::read(&self.bytes[at..at + S::Codec::BYTES])),
            None => self.records.get(slot),
        }
    }

    #[inline(always)]
    fn prefetch(&self, slot: u64) {
        match self.place(slot) {
            Some(at) => prefetch(&self.bytes, at),
            None => self.records.prefetch(slot),
        }
    }
}
