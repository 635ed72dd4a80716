//! Records of 4, 8 and 16 bytes behind one type: a terrain's records and pools, whichever kind its file has.

use super::paged::PagedRecords;
use super::pool::PagePool;
use super::records::{Records, Slices};
use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::grid::record::{AnyCodec, Compact, Exact8, Exact16};

/// Memory for pages that are read when they are needed, if nobody says how much: 128 MiB.
pub const CACHE_BYTES: u64 = 128 << 20;

/// One thing for whichever kind of records a terrain has.
#[derive(Debug, Clone)]
pub enum ByKind<A, B, C> {
    /// 4-byte records, compact or fine.
    Compact(A),
    /// 8-byte records.
    Exact8(B),
    /// 16-byte records.
    Exact16(C),
}

/// The records of a terrain, of whichever kind.
pub type AnyRecords<'a> = ByKind<Records<'a, Compact>, Records<'a, Exact8>, Records<'a, Exact16>>;

/// Records that are read when they are asked for, of whichever kind.
pub type AnyPaged<'a> =
    ByKind<PagedRecords<'a, Compact>, PagedRecords<'a, Exact8>, PagedRecords<'a, Exact16>>;

/// A pool of pages, of whichever kind.
pub type AnyPool = ByKind<PagePool<Compact>, PagePool<Exact8>, PagePool<Exact16>>;

/// Runs `$body` with `$records` bound to the records, or the pool, of whichever kind.
#[macro_export]
macro_rules! with_records {
    ($any:expr, $records:ident => $body:expr) => {
        match $any {
            $crate::read::kinds::ByKind::Compact($records) => $body,
            $crate::read::kinds::ByKind::Exact8($records) => $body,
            $crate::read::kinds::ByKind::Exact16($records) => $body,
        }
    };
}

impl Terrain {
    /// The records as refinement reads them. Reads and checks the whole directory.
    ///
    /// # Errors
    /// As [`Terrain::check_directory`]; of a packed terrain, which is unpacked into memory for it, damage and I/O of any page, and too little memory; [`LayoutError::Unsupported`] if the source
    /// cannot lend its bytes, as [`Terrain::lends_records`] says.
    pub fn records(&self) -> Result<AnyRecords<'_>, LayoutError> {
        self.check_directory()?;
        let Some(first) = self.source().lend()? else {
            let problem = "its records are not in this process's memory, neither mapped nor unpacked there";
            return Err(LayoutError::unsupported(self.path(), problem));
        };
        let bytes = Slices { first, behind: self.source().bytes_behind().unwrap_or_default() };
        Ok(match self.codec().clone() {
            AnyCodec::Compact(codec) => ByKind::Compact(Records::new(self, bytes, codec)?),
            AnyCodec::Exact8(codec) => ByKind::Exact8(Records::new(self, bytes, codec)?),
            AnyCodec::Exact16(codec) => ByKind::Exact16(Records::new(self, bytes, codec)?),
        })
    }

    /// Whether the source lends its bytes, which [`Terrain::records`] needs. Reads nothing.
    pub fn lends_records(&self) -> bool {
        self.source().lends()
    }

    /// The records, each page of which is read when it is first asked for, into `cache_bytes` of memory, 64 KiB at the least; whatever the source. Reads nothing. Of packed terrain up to a quarter of them is for what pages are
    /// unpacked from.
    pub fn paged(&self, cache_bytes: u64) -> AnyPaged<'_> {
        match self.codec().clone() {
            AnyCodec::Compact(codec) => {
                ByKind::Compact(PagedRecords::new(self, self.shape(codec), cache_bytes))
            }
            AnyCodec::Exact8(codec) => {
                ByKind::Exact8(PagedRecords::new(self, self.shape(codec), cache_bytes))
            }
            AnyCodec::Exact16(codec) => {
                ByKind::Exact16(PagedRecords::new(self, self.shape(codec), cache_bytes))
            }
        }
    }

    /// Memory for pages where so much was asked for, or nothing, for [`Terrain::paged`]: [`CACHE_BYTES`] for a terrain that does not lend its records; `None` for one that does, whose [`Terrain::records`] are taken where they lie.
    pub fn cache_bytes(&self, asked: Option<u64>) -> Option<u64> {
        asked.or_else(|| (!self.lends_records()).then_some(CACHE_BYTES))
    }

    /// A pool of at most `cache_bytes` for the pages of this terrain, whatever its source.
    ///
    /// # Errors
    /// As [`PagePool::new`].
    pub fn pool(&self, cache_bytes: u64) -> Result<AnyPool, LayoutError> {
        Ok(match self.codec().clone() {
            AnyCodec::Compact(codec) => ByKind::Compact(PagePool::new(self, self.shape(codec), cache_bytes)?),
            AnyCodec::Exact8(codec) => ByKind::Exact8(PagePool::new(self, self.shape(codec), cache_bytes)?),
            AnyCodec::Exact16(codec) => ByKind::Exact16(PagePool::new(self, self.shape(codec), cache_bytes)?),
        })
    }
}
