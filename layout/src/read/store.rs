//! What refinement reads records from: all of a file, or the part of it that is in memory.
//!
//! [`Records`](super::records::Records) lends every record of a mapped file, [`EditedRecords`](super::edited::EditedRecords) those of one that is edited meanwhile; [`PagePool`](super::pool::PagePool) holds some pages of a file of any size and
//! says which it lacks. An engine written for the trait flies over all of them. Where all records are there, its code for absent ones compiles to nothing.

use crate::file::bytes::PAGE_BYTES;
use crate::grid::order::slot_of;
use crate::grid::record::{RecordCodec, Vertex};
use crate::grid::{Grid, GridPoint};

/// What a terrain's records have in common.
#[derive(Debug, Clone)]
pub struct RecordShape<C> {
    /// Bytes to vertices.
    pub codec: C,
    /// Grid shape and spacing.
    pub grid: Grid,
    /// Lowest and highest height in metres.
    pub height_range_m: [f64; 2],
    /// Whether any sample is void.
    pub has_voids: bool,
}

/// Record of a store.
pub type RawOf<S> = <<S as RecordStore>::Codec as RecordCodec>::Raw;

/// Records a page: a power of two.
pub const fn records_per_page<C: RecordCodec>() -> u64 {
    (PAGE_BYTES / C::BYTES) as u64
}

/// Logical page of a slot.
#[inline(always)]
pub const fn page_of<C: RecordCodec>(slot: u64) -> u64 {
    slot >> const { records_per_page::<C>().trailing_zeros() }
}

/// Where the record of a slot begins in its page, in bytes.
#[inline(always)]
pub const fn byte_in_page<C: RecordCodec>(slot: u64) -> usize {
    (slot & (records_per_page::<C>() - 1)) as usize * C::BYTES
}

/// Records by slot (FORMAT.md, section 2).
pub trait RecordStore: Send + Sync {
    /// Kind of the records.
    type Codec: RecordCodec;

    /// Whether [`RecordStore::get`] always has an answer.
    const IS_COMPLETE: bool;

    /// What the records have in common.
    fn shape(&self) -> &RecordShape<Self::Codec>;

    /// The record at `slot`, not yet decoded; `None` if it is not at hand now. Those of logical page 0 always are.
    ///
    /// # Panics
    /// For a slot past the last page.
    fn get(&self, slot: u64) -> Option<RawOf<Self>>;

    /// Asks memory for the record at `slot`. A hint: reads nothing.
    fn prefetch(&self, slot: u64);

    /// Logical page of a slot.
    #[inline(always)]
    fn page_of(slot: u64) -> u64 {
        page_of::<Self::Codec>(slot)
    }

    /// Records a page.
    fn records_per_page() -> u64 {
        records_per_page::<Self::Codec>()
    }

    /// Grid shape and spacing.
    #[inline(always)]
    fn grid(&self) -> &Grid {
        &self.shape().grid
    }

    /// The vertex at `slot`, whose level is `level` (0 for corners); an inert one if its record is not at hand.
    ///
    /// # Panics
    /// For a slot past the last page.
    #[inline(always)]
    fn vertex(&self, slot: u64, level: u32) -> Vertex {
        self.decode(self.get(slot).unwrap_or(Self::Codec::INERT), level)
    }

    /// The records at two slots, not yet decoded, inert ones where they are not at hand. For slots that lie side by side, as those of a triangle's two
    /// children do, a store may find both at once.
    ///
    /// # Panics
    /// For a slot past the last page.
    #[inline(always)]
    fn pair(&self, slots: [u64; 2]) -> [RawOf<Self>; 2] {
        slots.map(|slot| self.get(slot).unwrap_or(Self::Codec::INERT))
    }

    /// The vertex at a grid point.
    fn vertex_at(&self, p: GridPoint) -> Vertex {
        let level = if self.grid().is_corner(p) { 0 } else { self.grid().level(p) };
        self.vertex(slot_of(self.grid().k(), p), level)
    }

    /// The vertex of a record at `level` (0 for corners).
    #[inline(always)]
    fn decode(&self, raw: RawOf<Self>, level: u32) -> Vertex {
        self.shape().codec.decode(raw, level)
    }
}

/// A store in which every record is at hand, always: [`RecordStore::get`] has an answer for every slot that there is, and [`RecordStore::IS_COMPLETE`] says so.
///
/// Engines that read records without asking whether they are there take no other: over a pool they would take what is away for ground without detail.
pub trait CompleteStore: RecordStore {}
