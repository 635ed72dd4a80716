//! An opened terrain file: checked header and directory over a source, and the way from a slot to a vertex.
//!
//! [`Terrain`] owns the source and has the header. Refinement holds [`Records`](super::records::Records).
//!
//! Leaves of the directory are read and checked when one of their pages is first asked for ([`Terrain::entry`]); [`Terrain::check_directory`] reads and checks them all.
//!
//! Invariant: every page number that is handed out lies inside the file as its header counts it.

use super::opening::{Found, Opening};
use super::page_map::PageMap;
use super::store::RecordShape;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum};
use crate::file::entries::Entry;
use crate::file::header::{Header, INERT_PAGE};
use crate::file::journal::Commit;
use crate::file::packed_end::PackedEnd;
use crate::file::page_table::PageTable;
use crate::file::source::Source;
#[cfg(feature = "files")]
use crate::file::source::{MapSource, PreadSource};
use crate::file::structure::inert_page;
use crate::grid::order::slot_of;
use crate::grid::record::{AnyCodec, Vertex};
use crate::grid::{Grid, GridPoint};
use std::path::Path;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// An opened and checked terrain file.
pub struct Terrain {
    source: Box<dyn Source>,
    header: Header,
    table: PageTable,
    /// Page of each logical page, counted from the inert page, which absent ones read as. Made when records are first asked for.
    pages: OnceLock<PageMap>,
    codec: OnceLock<Box<AnyCodec>>,
    /// Which opened terrain of this process it is.
    instance: u64,
}

impl std::fmt::Debug for Terrain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Terrain")
            .field("path", &self.path())
            .field("header", &self.header)
            .finish_non_exhaustive()
    }
}

impl Terrain {
    /// Opens the file at `path`: checks it by plain reads, then maps it (see [`MapSource`] for what that asks of others). A packed one is not mapped: for
    /// [`Terrain::records`] all of it is unpacked into memory, where a [`Terrain::pool`] takes what it needs.
    ///
    /// # Errors
    /// As FORMAT.md, section 6: not a terrain file, another version, truncated or damaged; or I/O.
    #[cfg(feature = "files")]
    pub fn open(path: &Path) -> Result<Self, LayoutError> {
        Self::mapped(PreadSource::open(path)?)
    }

    /// Opens and maps a file, or opens a packed one that is to be unpacked for [`Terrain::records`].
    #[cfg(feature = "files")]
    pub(crate) fn mapped(mut file: PreadSource) -> Result<Self, LayoutError> {
        Ok(match Opening::of(&mut file)?.into_found()? {
            Found::Plain(header, table) => Self::of(Box::new(MapSource::map(file)?), header, table),
            Found::Packed(packed, header, table) => {
                Self::of(Box::new(packed.over(Box::new(file)).lending_whole()), header, table)
            }
        })
    }

    /// Opens the file at `path` without mapping it: for [`Terrain::pool`], whose pages are read. Files that others may truncate raise no signal then.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    #[cfg(feature = "files")]
    pub fn open_unmapped(path: &Path) -> Result<Self, LayoutError> {
        Self::from_source(Box::new(PreadSource::open(path)?))
    }

    /// Opens the file at `path` as it was before all edits that its journal knows; as it is, if it has none. Mapped.
    ///
    /// # Errors
    /// As [`Terrain::open`]; a damaged journal.
    #[cfg(feature = "files")]
    pub fn open_original(path: &Path) -> Result<Self, LayoutError> {
        Self::open(path)?.into_original()
    }

    /// This terrain before all edits that its journal knows.
    ///
    /// # Errors
    /// I/O; a damaged journal or directory of that time.
    pub fn into_original(self) -> Result<Self, LayoutError> {
        let Some(history) = self.header.history else { return Ok(self) };
        let tip = Commit::read(&*self.source, &self.header, history.tip_page)?;
        let header = Header { history: None, ..tip.original.put_into(&self.header) };
        let table = PageTable::open_beside(&*self.source, &header, &self.table)?;
        Ok(Self::of(self.source, header, table))
    }

    pub(crate) fn of(source: Box<dyn Source>, header: Header, table: PageTable) -> Self {
        static INSTANCES: AtomicU64 = AtomicU64::new(0);
        let instance = INSTANCES.fetch_add(1, Ordering::Relaxed);
        Self { source, header, table, pages: OnceLock::new(), codec: OnceLock::new(), instance }
    }

    /// Opens any source.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    pub fn from_source(mut source: Box<dyn Source>) -> Result<Self, LayoutError> {
        let opening = Opening::of(&mut *source)?;
        Self::opened(opening, source)
    }

    /// The terrain of a file that was opened, read from `source` from now on.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if [`Opening::next`] needs more of it.
    pub fn opened(opening: Opening, source: Box<dyn Source>) -> Result<Self, LayoutError> {
        Ok(match opening.into_found()? {
            Found::Plain(header, table) => Self::of(source, header, table),
            Found::Packed(packed, header, table) => Self::of(Box::new(packed.over(source)), header, table),
        })
    }

    /// Page of each logical page, counted from [`INERT_PAGE`].
    ///
    /// # Errors
    /// As [`Terrain::check_directory`].
    pub(crate) fn pages(&self) -> Result<&PageMap, LayoutError> {
        self.check_directory()?;
        Ok(self.pages.get_or_init(|| {
            let mut pages = PageMap::new(self.page_count());
            for (logical, entry) in self.table.present() {
                pages.set(logical, entry.page - INERT_PAGE);
            }
            pages
        }))
    }

    /// A number that no other opened terrain of this process has, the same file opened twice included: what was made for one is not for another.
    pub fn instance(&self) -> u64 {
        self.instance
    }

    /// The file's name for messages.
    pub fn path(&self) -> &Path {
        self.source.path()
    }

    /// What the file says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Grid shape and spacing.
    pub fn grid(&self) -> &Grid {
        &self.header.grid
    }

    /// Logical record pages: those that the square has, whether they are present or not.
    pub fn page_count(&self) -> u64 {
        self.table.pages()
    }

    /// Where a logical record page lies: its entry in the directory, an absent one for a page that there is not. Reads the directory leaf that it is in if none of its pages was asked for before.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the leaf if it does not match its checksum, or the entry in it that leads out of the file; I/O.
    pub fn entry(&self, logical_page: u64) -> Result<Entry, LayoutError> {
        self.table.entry(&*self.source, logical_page)
    }

    /// Where a logical record page lies, if that is known without reading: its directory leaf is absent, or was read before.
    pub fn known_entry(&self, logical_page: u64) -> Option<Entry> {
        self.table.known(logical_page)
    }

    /// Reads all directory leaves that were not read yet, and checks the directory as a whole. Pages that [`Terrain::entry`] gives are each where they should be; that none of them has two
    /// uses, and that there are as many as the header says, only this finds. Whoever takes all records calls it, and whoever writes.
    ///
    /// # Errors
    /// As [`Terrain::entry`]; [`LayoutError::Damaged`] for a page with two uses, and for another number of pages than the header says.
    pub fn check_directory(&self) -> Result<(), LayoutError> {
        self.table.check(&*self.source)
    }

    /// All record pages that are present, in logical order, and where they lie. Reads the whole directory.
    ///
    /// # Errors
    /// As [`Terrain::check_directory`].
    pub fn present_pages(&self) -> Result<impl Iterator<Item = (u64, Entry)> + '_, LayoutError> {
        self.check_directory()?;
        Ok(self.table.present())
    }

    /// The directory, as far as it was read.
    pub(crate) fn table(&self) -> &PageTable {
        &self.table
    }

    /// Bytes per sample of the DEM, everything but imagery counted.
    pub fn bytes_per_sample(&self) -> f64 {
        let [wide, high] = self.grid().samples();
        let imagery = self.header.imagery.map_or(0, |place| place.bytes);
        (self.source.packed_bytes().unwrap_or(self.header.file_bytes).saturating_sub(imagery)) as f64
            / (f64::from(wide) * f64::from(high))
    }

    /// Bytes that were appended to a packed file since it was packed: edits, their history, imagery; `None` for a terrain that is not packed.
    pub fn appended_bytes(&self) -> Option<u64> {
        self.source.packed_end().map(PackedEnd::appended_bytes)
    }

    /// The source it reads from.
    pub fn source(&self) -> &dyn Source {
        &*self.source
    }

    /// One record page, checked against its checksum. Absent pages read as inert ones.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the page if it does not match; I/O.
    pub fn checked_page(&self, logical_page: u64) -> Result<Box<Page>, LayoutError> {
        self.checked_page_at(logical_page, self.entry(logical_page)?)
    }

    /// One record page where `entry` says it lies: where a commit has written it since the terrain was opened, or where it lay in another state of the file. Sources that read reach
    /// what was appended since then; one that holds its bytes in memory does not grow.
    ///
    /// # Errors
    /// As [`Terrain::checked_page`].
    pub fn checked_page_at(&self, logical_page: u64, entry: Entry) -> Result<Box<Page>, LayoutError> {
        let count = self.page_count();
        if logical_page >= count {
            return Err(LayoutError::Usage(format!(
                "page {logical_page} does not exist; the file has {count}"
            )));
        }
        if !entry.is_present() {
            return Ok(inert_page(self.header.record_kind));
        }
        let mut page = Box::new([0; PAGE_BYTES]);
        self.source.read_at(u64::from(entry.page) * PAGE_BYTES as u64, &mut page[..])?;
        self.check_page(logical_page, entry, &page)?;
        Ok(page)
    }

    /// Checks what was read for a page that is present.
    pub(crate) fn check_page(&self, logical_page: u64, entry: Entry, page: &Page) -> Result<(), LayoutError> {
        if checksum(page) == entry.checksum {
            return Ok(());
        }
        Err(LayoutError::damaged_terrain(
            self.path(),
            format!("record page {logical_page} (file page {})", entry.page),
            "the checksum does not match",
        ))
    }

    /// What no error of the record of the vertex at `p`, on this logical page, exceeds, in metres: of packed terrain, told without reading the record; infinite where that is not known, as it is where the ground was edited.
    pub fn error_bound_m(&self, logical_page: u64, p: GridPoint) -> f64 {
        let Some(unpacking) = self.source.unpacking() else { return f64::INFINITY };
        // Tiles know nothing of pages that edits put in place of theirs.
        let is_as_packed = unpacking.is_packed_root(self.header.root_page.into())
            || self.entry(logical_page).is_ok_and(|entry| unpacking.is_packed_record_page(entry.page.into()));
        if is_as_packed { unpacking.bound_m(p) } else { f64::INFINITY }
    }

    /// One vertex, read from a checked page.
    ///
    /// # Errors
    /// As [`Terrain::checked_page`]; [`LayoutError::Usage`] for a point outside the square.
    pub fn checked_vertex(&self, p: GridPoint) -> Result<Vertex, LayoutError> {
        let n = self.grid().side_steps();
        if p.x() > n || p.y() > n {
            return Err(LayoutError::Usage(format!(
                "sample ({}, {}) lies outside the terrain",
                p.x(),
                p.y()
            )));
        }
        let slot = slot_of(self.grid().k(), p);
        let per_page = self.header.records_per_page();
        let page = self.checked_page(slot / per_page)?;
        let at = (slot % per_page) as usize * self.header.record_kind.bytes();
        let level = if self.grid().is_corner(p) { 0 } else { self.grid().level(p) };
        Ok(self.codec().decode(&page[at..], level))
    }

    /// From bytes to a vertex. Its tables are made when they are first asked for.
    pub(crate) fn codec(&self) -> &AnyCodec {
        self.codec.get_or_init(|| {
            let Header { grid, scale, record_kind, .. } = &self.header;
            Box::new(AnyCodec::new(*record_kind, grid, scale))
        })
    }

    pub(crate) fn shape<C>(&self, codec: C) -> RecordShape<C> {
        let Header { grid, height_range_m, has_voids, .. } = self.header;
        RecordShape { codec, grid, height_range_m, has_voids }
    }
}
