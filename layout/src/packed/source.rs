//! A packed file read as the terrain file that it was made of: its bytes, unpacked as they are asked for.
//!
//! Everything that reads a terrain reads this one: the header, directory, pages and imagery are those of the terrain file, at their places there, so that a record page that is read is checked
//! against the directory's checksum, whatever it was unpacked from. What was appended since is there page by page, and is read as it is. Only what maps needs the terrain file itself.
//!
//! Opening reads the front, which lists the directory's leaves and the tile directory's; both kinds of leaves are read when they are needed.
//!
//! Invariant: memory is what the front of the file takes, and tiles in a quarter of what the pool over it was given, [`MOST_CACHE_BYTES`] at most. Cost: a page takes its tiles, a handful, of which most are still there from the page before.

mod bounds;
mod growth;
mod meter;
mod records;
#[cfg(feature = "testing")]
mod stages;

use super::appended::Appended;
use super::bounds::BoundTable;
use super::cache::Cache;
use super::container::{BLOCKS, Container, INDEX, MODEL, ROOT, RUNS, Section, current_of};
use super::leaves::{PackedLeaves, PackedNodes};
use super::model::{DecodeTables, Model};
use super::places::{TilePlace, TileRoot};
use super::shape::Groups;
use super::way::{Scratch, Way};
use super::wide::Width;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum, to_usize};
use crate::file::entries::ENTRY_BYTES;
use crate::file::header::{Header, INERT_PAGE};
use crate::file::packed_end::{PackedEnd, from_file};
use crate::file::source::{Source, Unpacking};
use crate::file::structure::inert_page;
use meter::Meter;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

const PAGE: u64 = PAGE_BYTES as u64;
/// Bytes of tiles kept unpacked, at most, and where no pool of pages has said how many.
const MOST_CACHE_BYTES: usize = 16 << 20;
/// Part of a pool's memory that its tiles take, up to that.
const TILES_SHARE: u64 = 4;
/// Pages of the whole that are unpacked at a time.
const WHOLE_PAGES: usize = 256;
/// First record page of a terrain file as a build leaves it.
const FIRST_PAGE: u64 = INERT_PAGE as u64 + 1;
/// What opening reads first.
pub(crate) const FIRST_READ: u64 = 64 << 10;

/// A packed terrain file.
pub(crate) struct PackedSource {
    inner: Box<dyn Source>,
    container: Container,
    header: Header,
    slots: [Box<Page>; 2],
    inert: Box<Page>,
    /// The file's first bytes, which were read at once: small files, and the coarsest tiles of others, are in them.
    front: Vec<u8>,
    /// Leaves of the terrain file's directory that are present.
    leaves: PackedLeaves,
    /// First page of the root of the directory that is packed.
    root_page: u64,
    /// What is not packed, as it was when the file was opened, and as it is.
    end: PackedEnd,
    appended: Appended,
    /// First page of nodes of that directory, or of the root if it has none.
    node_page: u64,
    /// Its nodes and root, made when they are first asked for.
    root: OnceLock<(PackedNodes, Vec<u8>)>,
    groups: Groups,
    /// Where leaves of tiles lie, and what they hold, once they were needed.
    tile_root: TileRoot,
    tiles: Vec<OnceLock<Box<[TilePlace]>>>,
    way: Way,
    /// What bounds stand for.
    bounds: BoundTable,
    tables: DecodeTables,
    cache: Cache,
    scratch: Mutex<Vec<Scratch>>,
    width: Width,
    meter: Meter,
    /// Whether the whole may be unpacked for those who need it; that, and who does it just now.
    lends_whole: bool,
    whole: OnceLock<Vec<u8>>,
    unpacking_whole: Mutex<()>,
}

impl PackedSource {
    /// Opens the packed file `inner`: reads its front.
    ///
    /// # Errors
    /// A damaged front; a way of packing that is not known; I/O.
    pub(crate) fn open(mut inner: Box<dyn Source>) -> Result<Self, LayoutError> {
        let length = inner.byte_count();
        let path = inner.path().to_owned();
        let path = &*path;
        let mut first = vec![0; to_usize(length.min(FIRST_READ))?];
        inner.read_at(0, &mut first)?;
        let [Some(a), Some(b)] =
            [0, PAGE_BYTES].map(|at| first.get(at..).and_then(<[u8]>::first_chunk::<PAGE_BYTES>))
        else {
            let problem = format!("the file is cut short: it has {length} bytes; copy it again");
            return Err(LayoutError::damaged(path, format!("byte {length}"), problem));
        };
        let (container, header, page) = current_of(path, [a, b], length)?;
        let (slots, page) = ([a, b].map(from_file), Box::new(*page));
        let front = Front::read(&*inner, &container, first)?;
        let runs = front.section(&*inner, &container.section(RUNS), "directory leaves")?;
        let index = front.section(&*inner, &container.section(INDEX), "list of directory leaves")?;
        let pages = [header.record_pages(), container.pages];
        let leaves = PackedLeaves::parse(&runs, &index, &container.section(BLOCKS), pages, FIRST_PAGE)
            .ok_or_else(|| odd(path, "directory leaves"))?;
        let node_page = FIRST_PAGE + container.pages + leaves.count();
        let shape = header.directory();
        let root_page = node_page + leaves.nodes(shape);
        let root_pages = (shape.root_entries() * ENTRY_BYTES as u64).div_ceil(PAGE);
        let first_page = root_page + root_pages;
        let model = front.section(&*inner, &container.section(MODEL), "tables")?;
        let tables = DecodeTables::of(&Model::parse(&model).ok_or_else(|| odd(path, "tables"))?);
        let groups = Groups::of(&header.grid);
        let root = front.section(&*inner, &container.section(ROOT), "tile directory")?;
        let tile_root = TileRoot::parse(&root, groups.leaves, shape.has_nodes())
            .ok_or_else(|| odd(path, "tile directory"))?;
        // The header first and then the length: what a header counts was in the file before the header was.
        inner.measure_again()?;
        let end = PackedEnd::read(path, &page, first_page, &|at, buffer| inner.read_at(at, buffer))?;
        let length = inner.byte_count();
        if length < end.end {
            let problem =
                format!("the file is cut short: it has {length} bytes of {}; copy it again", end.end);
            return Err(LayoutError::damaged(path, format!("byte {length}"), problem));
        }
        if header.file_bytes.div_ceil(PAGE) != end.pages() {
            return Err(odd(path, "appended pages"));
        }
        let appended = Appended::default();
        appended.learn(&end.runs);
        Ok(Self {
            tiles: (0..tile_root.count()).map(|_| OnceLock::new()).collect(),
            tile_root,
            way: Way::of(&header),
            bounds: BoundTable::new(),
            inert: inert_page(header.record_kind),
            cache: Cache::new(MOST_CACHE_BYTES),
            scratch: Mutex::default(),
            width: Width::best(),
            meter: Meter::default(),
            lends_whole: false,
            whole: OnceLock::new(),
            unpacking_whole: Mutex::default(),
            root: OnceLock::new(),
            node_page,
            root_page,
            end,
            appended,
            inner,
            container,
            header,
            slots,
            front: front.into_kept(),
            leaves,
            groups,
            tables,
        })
    }

    /// The same, read from `inner` from now on: the file whose front was read.
    pub(crate) fn over(mut self, inner: Box<dyn Source>) -> Self {
        self.inner = inner;
        self
    }

    /// Lends all bytes of the terrain file, unpacked when they are first asked for: what takes all records needs them all in memory.
    pub(crate) fn lending_whole(mut self) -> Self {
        self.lends_whole = true;
        self
    }

    /// All bytes of the terrain file.
    fn unpack_whole(&self) -> Result<Vec<u8>, LayoutError> {
        let count = self.header.file_bytes;
        #[cfg(feature = "files")]
        let free = crate::machine::free_memory_bytes();
        #[cfg(not(feature = "files"))]
        let free = None;
        let mut bytes = Vec::new();
        let fits = |bytes: &mut Vec<u8>| {
            fits_memory(count, free)?;
            let is_reserved =
                usize::try_from(count).is_ok_and(|count| bytes.try_reserve_exact(count).is_ok());
            if is_reserved { Ok(()) } else { fits_memory(count, Some(0)) }
        };
        fits(&mut bytes).map_err(|problem| LayoutError::unsupported(self.path(), problem))?;
        bytes.resize(to_usize(count)?, 0);
        let mut pages: Vec<(u64, &mut [u8])> = (0..).zip(bytes.chunks_mut(PAGE_BYTES)).collect();
        // Pages that lie side by side one after the other, so that a tile is unpacked once for all of them.
        pages.sort_by_cached_key(|(number, _)| self.place_of(*number));
        let fill = |(number, page): &mut (u64, &mut [u8])| self.read_at(*number * PAGE, page);
        #[cfg(feature = "files")]
        {
            use rayon::prelude::*;
            pages.par_iter_mut().with_min_len(WHOLE_PAGES).try_for_each(fill)?;
        }
        #[cfg(not(feature = "files"))]
        pages.iter_mut().try_for_each(fill)?;
        Ok(bytes)
    }

    /// One page of the terrain file, of those that are packed.
    fn page(&self, number: u64, page: &mut Page) -> Result<(), LayoutError> {
        let stored = self.container.pages;
        match number {
            0 | 1 => *page = *self.slots[number as usize],
            2 => *page = *self.inert,
            _ if number - FIRST_PAGE < stored => {
                self.record_page(self.logical(number - FIRST_PAGE)?, page)?;
            }
            _ if number < self.node_page => {
                let at = (number - FIRST_PAGE - stored) as usize;
                let read = |offset, buffer: &mut [u8]| self.read_packed(offset, buffer);
                page.copy_from_slice(&self.leaves.page(self.path(), at, read)?);
            }
            _ => {
                let (nodes, root) =
                    self.root.get_or_init(|| self.leaves.root(self.header.directory(), stored));
                if number < self.root_page {
                    let first_leaf = FIRST_PAGE + stored;
                    page.copy_from_slice(&nodes.page(&self.leaves, number - self.node_page, first_leaf));
                    return Ok(());
                }
                let at = (number - self.root_page) as usize * PAGE_BYTES;
                page.fill(0);
                let bytes = root.get(at..).unwrap_or_default();
                let count = bytes.len().min(PAGE_BYTES);
                page[..count].copy_from_slice(&bytes[..count]);
            }
        }
        Ok(())
    }

    /// The logical page that is the `nth` of those that are packed.
    fn logical(&self, nth: u64) -> Result<u64, LayoutError> {
        self.leaves.logical(self.path(), nth, |offset, buffer| self.read_packed(offset, buffer))
    }

    /// Fills `buffer` with bytes of the packed file that are never written over.
    fn read_packed(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        let known = usize::try_from(offset)
            .ok()
            .and_then(|from| self.front.get(from..from.checked_add(buffer.len())?));
        match known {
            Some(bytes) => buffer.copy_from_slice(bytes),
            None => self.inner.read_at(offset, buffer)?,
        }
        Ok(())
    }
}

/// Refuses what is larger unpacked than the memory that is free, where that is known.
fn fits_memory(bytes: u64, free: Option<u64>) -> Result<(), String> {
    match free {
        Some(free) if free < bytes => Err(format!(
            "what is asked for takes all of it unpacked, which is {bytes} bytes of memory, and there are not so many{}; write it unpacked, and \
             take that file, which is read where it lies",
            if free > 0 { format!(", but {free}") } else { String::new() }
        )),
        _ => Ok(()),
    }
}

impl Source for PackedSource {
    fn path(&self) -> &Path {
        self.inner.path()
    }

    /// That of the terrain file.
    fn byte_count(&self) -> u64 {
        self.header.file_bytes
    }

    fn read_end(&self, buffer: &mut [u8]) -> Result<bool, LayoutError> {
        self.inner.read_end(buffer)
    }

    fn packed_end(&self) -> Option<&PackedEnd> {
        Some(&self.end)
    }

    fn packed_bytes(&self) -> Option<u64> {
        Some(self.end.end)
    }

    fn unpacking(&self) -> Option<&dyn Unpacking> {
        Some(self)
    }

    fn take_share(&self, cache_bytes: u64) -> u64 {
        let share = (cache_bytes / TILES_SHARE).min(MOST_CACHE_BYTES as u64);
        self.cache.restart(share as usize);
        share
    }

    fn bytes(&self) -> Option<&[u8]> {
        self.lend().ok().flatten()
    }

    fn lends(&self) -> bool {
        self.lends_whole
    }

    fn lend(&self) -> Result<Option<&[u8]>, LayoutError> {
        if self.lends_whole && self.whole.get().is_none() {
            let _guard = self.unpacking_whole.lock().unwrap_or_else(PoisonError::into_inner);
            if self.whole.get().is_none() {
                let _ = self.whole.set(self.unpack_whole()?);
            }
        }
        Ok(self.whole.get().map(Vec::as_slice))
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        let (mut at, mut rest) = (offset, buffer);
        let mut page = Box::new([0; PAGE_BYTES]);
        while !rest.is_empty() {
            if at / PAGE >= self.end.first {
                let count = self.read_appended(at, rest)?;
                (at, rest) = (at + count as u64, &mut rest[count..]);
                continue;
            }
            let within = (at % PAGE) as usize;
            let count = rest.len().min(PAGE_BYTES - within);
            self.page(at / PAGE, &mut page)?;
            let (here, after) = rest.split_at_mut(count);
            here.copy_from_slice(&page[within..within + count]);
            (at, rest) = (at + count as u64, after);
        }
        Ok(())
    }
}

/// The first bytes of a file: as far as one more read reaches all sections.
struct Front(Vec<u8>);

impl Front {
    fn read(inner: &dyn Source, container: &Container, first: Vec<u8>) -> Result<Self, LayoutError> {
        // Blocks of leaves are read one by one.
        let needed = container.sections.iter().filter(|section| section.kind != BLOCKS);
        let end = needed.clone().map(|section| section.offset + section.bytes).max().unwrap_or(0);
        let sum: u64 = needed.map(|section| section.bytes).sum();
        let mut bytes = first;
        // Files that have other things between them are read section by section.
        if end > bytes.len() as u64 && end <= sum + FIRST_READ {
            let from = bytes.len();
            bytes.resize(to_usize(end)?, 0);
            inner.read_at(from as u64, &mut bytes[from..])?;
        }
        Ok(Self(bytes))
    }

    /// What is kept of it.
    fn into_kept(mut self) -> Vec<u8> {
        self.0.truncate(FIRST_READ as usize);
        self.0.shrink_to_fit();
        self.0
    }

    fn section(
        &self,
        inner: &dyn Source,
        section: &Section,
        name: &'static str,
    ) -> Result<Vec<u8>, LayoutError> {
        let (from, count) = (to_usize(section.offset)?, to_usize(section.bytes)?);
        let bytes = match self.0.get(from..from + count) {
            Some(bytes) => bytes.to_vec(),
            None => {
                let mut bytes = vec![0; count];
                inner.read_at(section.offset, &mut bytes)?;
                bytes
            }
        };
        if checksum(&bytes) != section.checksum {
            let problem = "the checksum does not match";
            return Err(LayoutError::damaged_terrain(inner.path(), name.into(), problem));
        }
        Ok(bytes)
    }
}

/// A part that contradicts the header.
fn odd(path: &Path, place: &'static str) -> LayoutError {
    LayoutError::damaged_terrain(path, place.into(), "they are not what the header says")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_memory_does_not_hold_is_refused_before_it_is_unpacked() {
        let bytes = 28_632_000_000;
        assert_eq!(fits_memory(bytes, None), Ok(()));
        assert_eq!(fits_memory(bytes, Some(bytes)), Ok(()));
        let said = fits_memory(bytes, Some(24_000_000_000)).unwrap_err();
        assert!(
            said.contains("28632000000 bytes of memory, and there are not so many, but 24000000000; "),
            "{said}"
        );
        assert!(fits_memory(bytes, Some(0)).unwrap_err().contains("not so many; write it unpacked"));
    }
}
