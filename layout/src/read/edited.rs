//! The records of a mapped terrain with some of its pages replaced. Engines that need all records fly over this while the ground is edited.
//!
//! Pages are the file's until they are installed, and then this store's own. Cost over [`Records`]: a branch a record, and 4 bytes a logical page.

use super::page_map::PageMap;
use super::prefetch::prefetch;
use super::records::Records;
use super::store::{CompleteStore, RawOf, RecordShape, RecordStore, byte_in_page, page_of};
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::grid::record::RecordCodec;

/// The page is the file's. Zero, so that pages that are never replaced take no memory.
const FILES: u32 = 0;

/// Records of a terrain, some of them others than the file's.
#[derive(Debug, Clone)]
pub struct EditedRecords<'a, C: RecordCodec> {
    records: Records<'a, C>,
    shape: RecordShape<C>,
    /// Which own page each logical page is, counted from 1, or [`FILES`].
    own: PageMap,
    /// Own pages, one after the other.
    bytes: Vec<u8>,
}

impl<'a, C: RecordCodec> EditedRecords<'a, C> {
    /// The records as the file has them.
    pub fn new(records: Records<'a, C>) -> Self {
        let own = PageMap::like(records.pages());
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
        let own = self.own.get(page_of::<C>(slot))?;
        let within = byte_in_page::<C>(slot);
        (own != FILES).then(|| (own as usize - 1) * PAGE_BYTES + within)
    }
}

impl<C: RecordCodec> CompleteStore for EditedRecords<'_, C> {}

impl<C: RecordCodec> RecordStore for EditedRecords<'_, C> {
    type Codec = C;

    const IS_COMPLETE: bool = true;

    #[inline(always)]
    fn shape(&self) -> &RecordShape<C> {
        &self.shape
    }

    #[inline(always)]
    fn get(&self, slot: u64) -> Option<RawOf<Self>> {
        Some(match self.place(slot) {
            Some(at) => C::read(&self.bytes[at..at + C::BYTES]),
            None => self.records.raw(slot),
        })
    }

    #[inline(always)]
    fn prefetch(&self, slot: u64) {
        match self.place(slot) {
            Some(at) => prefetch(&self.bytes, at),
            None => self.records.prefetch(slot),
        }
    }
}
