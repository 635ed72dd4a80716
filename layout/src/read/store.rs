//! What refinement reads records from: all of a file, or the part of it that is in memory.
//!
//! [`Records`](super::records::Records) lends every record of a mapped file, [`PagedRecords`](super::paged::PagedRecords) those of any source, which it reads when they are asked for, and [`EditedRecords`](super::edited::EditedRecords) those of
//! either that are edited meanwhile; [`PagePool`](super::pool::PagePool) holds some pages of a file of any size and says which it lacks. An engine written for the trait flies over all of them. Where all records are there, its code for absent ones compiles to nothing.

use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::file::source::Unpacked;
use crate::grid::order::slot_of;
use crate::grid::record::{RecordCodec, Vertex};
use crate::grid::{Grid, GridPoint};
use std::time::Duration;

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

    /// The record at `slot` if nothing has to be read for it.
    ///
    /// # Panics
    /// For a slot past the last page.
    #[inline(always)]
    fn at_hand(&self, slot: u64) -> Option<RawOf<Self>> {
        self.get(slot)
    }

    /// Whether [`RecordStore::error_bound_m`] says anything of this store's records.
    #[inline(always)]
    fn has_bounds(&self) -> bool {
        false
    }

    /// What no error of the record at `slot`, that of the vertex at `p`, exceeds, in metres, told without reading the record; infinite where that is not known.
    #[inline(always)]
    fn error_bound_m(&self, slot: u64, p: GridPoint) -> f64 {
        let _ = (slot, p);
        f64::INFINITY
    }

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

/// What reading took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PagesRead {
    /// Pages, each as often as it was read.
    pub pages: u64,
    /// Time that those who asked waited, over all threads.
    pub time: Duration,
    /// Of packed terrain, what was unpacked for it.
    pub unpacked: Option<Unpacked>,
}

impl PagesRead {
    /// What was added since `before`.
    pub fn since(self, before: Self) -> Self {
        let unpacked = self.unpacked.map(|now| {
            let then = before.unpacked.unwrap_or_default();
            Unpacked {
                tiles: now.tiles - then.tiles,
                bytes: now.bytes - then.bytes,
                time: now.time.saturating_sub(then.time),
            }
        });
        Self { pages: self.pages - before.pages, time: self.time.saturating_sub(before.time), unpacked }
    }
}

/// A store in which every record is at hand, always: [`RecordStore::get`] has an answer for every slot that there is, and [`RecordStore::IS_COMPLETE`] says so.
///
/// Engines that read records without asking whether they are there take no other: over a pool they would take what is away for ground without detail.
pub trait CompleteStore: RecordStore {
    /// Logical pages.
    fn page_count(&self) -> u64;

    /// What reading took so far; `None` for records that lie in memory or are mapped.
    fn read_so_far(&self) -> Option<PagesRead> {
        None
    }

    /// What kept records from being read, once. After it every record that is not in memory is inert, so that a mesh is not to be used.
    fn take_error(&self) -> Option<LayoutError> {
        None
    }
}
