//! The end of a packed file, where it grows: what is appended to the terrain file that it reads as goes behind what is packed, in runs of pages (FORMAT.md, section 9.8).
//!
//! What is there is never touched again. A header of the packed file is that of the terrain file with a few fields more, and says where the newest block of the list of runs lies; each
//! block names the one before it. So a commit writes its run, one block, and a header. Invariant: runs follow one another without gaps in the terrain file, and each lies in the file.

use super::bytes::{
    PAGE_BYTES, Page, checksum, get_u16, get_u32, get_u64, put_u16, put_u32, put_u64, to_usize,
};
use super::header::{GENERATION, seal};
use super::version::{MAGIC, PACKED_VERSION};
use crate::error::LayoutError;
use std::ops::Range;
use std::path::Path;

/// Fills a buffer with the bytes at an offset.
pub(crate) type ReadAt<'r> = dyn Fn(u64, &mut [u8]) -> Result<(), LayoutError> + 'r;

const PAGE: u64 = PAGE_BYTES as u64;
/// Bytes before all else: two header slots.
pub(crate) const FRONT: u64 = 2 * PAGE;
/// Bytes of a header page that tell how the file is packed.
pub(crate) const FIELDS: Range<usize> = 0x100..0x200;
/// Where the minor version of the terrain file stands.
const UNPACKED_MINOR: usize = 0x102;
/// Where the length of the file stands as it was when it was packed.
pub(crate) const PACKED_BYTES: usize = 0x108;
/// Where the length of the packed file stands, and the place of the newest block.
const END: usize = 0x1e0;
const BLOCK: usize = 0x1e8;
/// Runs a block.
const MOST_RUNS: usize = 64;
const RUN_BYTES: usize = 24;
const PLACE_BYTES: usize = 16;
/// Bytes that the table of a run of packed pages has for each.
pub(crate) const ENTRY_BYTES: usize = 6;

/// Where a block lies; all 0 where there is none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct BlockPlace {
    offset: u64,
    checksum: u32,
    runs: u32,
}

impl BlockPlace {
    fn read(bytes: &[u8], at: usize) -> Self {
        let [checksum, runs] = [8, 12].map(|field| get_u32(bytes, at + field));
        Self { offset: get_u64(bytes, at), checksum, runs }
    }

    fn write(self, bytes: &mut [u8], at: usize) {
        put_u64(bytes, at, self.offset);
        put_u32(bytes, at + 8, self.checksum);
        put_u32(bytes, at + 12, self.runs);
    }
}

/// Pages of the terrain file that lie together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Run {
    /// Number of the first one.
    pub(crate) first: u32,
    pub(crate) pages: u32,
    /// First byte in the packed file.
    pub(crate) place: u64,
    /// Whether each page is packed by itself, with a table before them that has this CRC-32; else they are as they are.
    pub(crate) table: Option<u32>,
}

impl Run {
    fn read(bytes: &[u8], at: usize) -> Option<Self> {
        let table = match get_u32(bytes, at + 16) {
            0 => None,
            1 => Some(get_u32(bytes, at + 20)),
            _ => return None,
        };
        let [first, pages] = [0, 4].map(|field| get_u32(bytes, at + field));
        Some(Self { first, pages, place: get_u64(bytes, at + 8), table })
    }

    fn write(&self, bytes: &mut [u8], at: usize) {
        put_u32(bytes, at, self.first);
        put_u32(bytes, at + 4, self.pages);
        put_u64(bytes, at + 8, self.place);
        put_u32(bytes, at + 16, u32::from(self.table.is_some()));
        put_u32(bytes, at + 20, self.table.unwrap_or(0));
    }

    /// The page behind its last one.
    pub(crate) fn end(&self) -> u64 {
        u64::from(self.first) + u64::from(self.pages)
    }

    /// Bytes that it takes at least.
    fn least_bytes(&self) -> u64 {
        u64::from(self.pages) * if self.table.is_some() { ENTRY_BYTES as u64 } else { PAGE }
    }
}

/// Where a packed file grows, and all that was appended to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedEnd {
    /// The fields of a header page that tell how it is packed.
    fields: Box<[u8; 0x100]>,
    /// First page of the terrain file that is not packed.
    pub(crate) first: u64,
    /// Length of the packed file when it was packed, and now.
    pub(crate) packed_bytes: u64,
    pub(crate) end: u64,
    newest: BlockPlace,
    /// The block before the newest one.
    before: BlockPlace,
    /// All runs, in order.
    pub(crate) runs: Vec<Run>,
    /// How many of them are in the newest block.
    in_newest: usize,
}

impl PackedEnd {
    /// Of a file that nothing was appended to, with these fields in its header pages: `end` bytes long, page `first` of its terrain file being the first one that is not packed.
    pub(crate) fn of_new(fields: Box<[u8; 0x100]>, first: u64, end: u64) -> Self {
        let none = BlockPlace::default();
        let packed_bytes = get_u64(&fields[..], PACKED_BYTES - FIELDS.start);
        Self { fields, first, packed_bytes, end, newest: none, before: none, runs: Vec::new(), in_newest: 0 }
    }

    /// Bytes that were appended since it was packed.
    pub(crate) fn appended_bytes(&self) -> u64 {
        self.end.saturating_sub(self.packed_bytes)
    }

    /// Of a file with this header page, whose bytes `read_at` reads.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] if the list of runs is not what the header says; I/O.
    pub(crate) fn read(
        path: &Path,
        page: &Page,
        first: u64,
        read_at: &ReadAt<'_>,
    ) -> Result<Self, LayoutError> {
        let damaged =
            |problem: &str| LayoutError::damaged_terrain(path, "list of what was appended".into(), problem);
        let outside = || damaged("it lies outside the file");
        let mut fields = Box::new([0; 0x100]);
        fields.copy_from_slice(&page[FIELDS]);
        let (end, newest) = (get_u64(page, END), BlockPlace::read(page, BLOCK));
        let mut this = Self { newest, ..Self::of_new(fields, first, end) };
        // What comes next is written at the end, and must not be written over anything.
        if end < this.packed_bytes || end < FRONT {
            return Err(outside());
        }
        let (mut at, mut limit) = (newest, end);
        let mut blocks: Vec<Vec<Run>> = Vec::new();
        while at != BlockPlace::default() {
            let runs = at.runs as usize;
            if runs == 0 || runs > MOST_RUNS {
                return Err(damaged("it has another number of runs than blocks have"));
            }
            // Each lies before the one that names it, so that there are no more of them than the file has room for.
            let mut bytes = vec![0; PLACE_BYTES + runs * RUN_BYTES];
            let block_end = at.offset.checked_add(bytes.len() as u64).filter(|end| *end <= limit);
            if at.offset < FRONT || block_end.is_none() {
                return Err(outside());
            }
            read_at(at.offset, &mut bytes)?;
            if checksum(&bytes) != at.checksum {
                return Err(damaged("the checksum does not match"));
            }
            let read = |i| Run::read(&bytes, PLACE_BYTES + i * RUN_BYTES);
            let runs = (0..runs).map(read).collect::<Option<_>>();
            blocks.push(runs.ok_or_else(|| damaged("it has a run of an unknown kind"))?);
            limit = at.offset;
            at = BlockPlace::read(&bytes, 0);
            if blocks.len() == 1 {
                this.before = at;
            }
        }
        this.in_newest = blocks.first().map_or(0, Vec::len);
        this.runs = blocks.into_iter().rev().flatten().collect();
        let mut next = first;
        for run in &this.runs {
            let run_end = run.place.checked_add(run.least_bytes());
            if run.place < FRONT || run_end.is_none_or(|run_end| run_end > end) {
                return Err(outside());
            }
            if u64::from(run.first) != next || run.pages == 0 {
                return Err(damaged("its runs do not follow one another"));
            }
            next = run.end();
        }
        Ok(this)
    }

    /// The page behind all that the file holds of the terrain file.
    pub(crate) fn pages(&self) -> u64 {
        self.runs.last().map_or(self.first, Run::end)
    }

    /// With `run` appended, which ends at byte `place` of the file: where the file ends then, and the block that is to be written at `place`.
    pub(crate) fn with(&self, run: Run, place: u64) -> (Self, Vec<u8>) {
        let is_full = self.in_newest == MOST_RUNS;
        let before = if is_full { self.newest } else { self.before };
        let mut runs = self.runs.clone();
        runs.push(run);
        let in_newest = if is_full { 1 } else { self.in_newest + 1 };
        let mut block = vec![0; PLACE_BYTES + in_newest * RUN_BYTES];
        before.write(&mut block, 0);
        for (i, run) in runs[runs.len() - in_newest..].iter().enumerate() {
            run.write(&mut block, PLACE_BYTES + i * RUN_BYTES);
        }
        let newest = BlockPlace { offset: place, checksum: checksum(&block), runs: in_newest as u32 };
        let (fields, end) = (self.fields.clone(), place + block.len() as u64);
        (
            Self {
                first: self.first,
                packed_bytes: self.packed_bytes,
                fields,
                end,
                newest,
                before,
                runs,
                in_newest,
            },
            block,
        )
    }

    /// A header page of the terrain file as it stands in the packed one.
    pub(crate) fn to_file(&self, page: &Page) -> Box<Page> {
        let mut page = Box::new(*page);
        let minor = get_u16(&page[..], 0x00a);
        page[FIELDS].copy_from_slice(&self.fields[..]);
        put_u16(&mut page[..], UNPACKED_MINOR, minor);
        put_u64(&mut page[..], END, self.end);
        self.newest.write(&mut page[..], BLOCK);
        put_u16(&mut page[..], 0x008, PACKED_VERSION);
        put_u16(&mut page[..], 0x00a, 0);
        seal(&mut page);
        page
    }
}

/// The header page of the terrain file that a header page of a packed file stands for. For a damaged one a page that is no header and says the same generation; zeros for one that was never written.
pub(crate) fn from_file(page: &Page) -> Box<Page> {
    let is_sound = page[..8] == MAGIC
        && get_u16(page, 0x008) == PACKED_VERSION
        && get_u32(page, 0xffc) == checksum(&page[..0xffc]);
    if !is_sound {
        let mut none = Box::new([0; PAGE_BYTES]);
        if page.iter().any(|byte| *byte != 0) {
            none[..8].copy_from_slice(&MAGIC);
            none[GENERATION..GENERATION + 4].copy_from_slice(&page[GENERATION..GENERATION + 4]);
        }
        return none;
    }
    let mut own = Box::new(*page);
    put_u16(&mut own[..], 0x008, 1);
    put_u16(&mut own[..], 0x00a, get_u16(page, UNPACKED_MINOR));
    own[FIELDS].fill(0);
    seal(&mut own);
    own
}

/// A page of a run on the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PackedPage {
    /// The packed page of the terrain file that it is the difference to; 0 for none.
    pub(crate) base: u32,
    /// First byte behind the run's table.
    pub(crate) from: u64,
    /// Bytes; those of a page if it is as it is.
    pub(crate) bytes: usize,
}

/// The table of a run of packed pages. `None` if no page has so many bytes.
pub(crate) fn table_of(bytes: &[u8]) -> Option<Vec<PackedPage>> {
    let mut from = 0;
    let page = |i: usize| {
        let at = i * ENTRY_BYTES;
        let page = PackedPage { base: get_u32(bytes, at), from, bytes: get_u16(bytes, at + 4).into() };
        from += page.bytes as u64;
        (page.bytes <= PAGE_BYTES).then_some(page)
    };
    (0..bytes.len() / ENTRY_BYTES).map(page).collect()
}

/// A page that was packed as the difference to `base`. `None` for bytes that are none.
pub(crate) fn unpacked_page(bytes: &[u8], base: Option<&Page>, page: &mut Page) -> Option<()> {
    if bytes.len() == PAGE_BYTES {
        page.copy_from_slice(bytes);
    } else {
        let parts = std::iter::once(bytes);
        let count = miniz_oxide::inflate::decompress_slice_iter_to_slice(page, parts, false, true).ok()?;
        if count != PAGE_BYTES {
            return None;
        }
    }
    if let Some(base) = base {
        page.iter_mut().zip(base).for_each(|(byte, base)| *byte ^= base);
    }
    Some(())
}

/// A run of pages on its way to the disk: table and pages. `bases` has a page for each, which `read_at` reads of the terrain file; 0 for none.
#[cfg(feature = "files")]
pub(crate) fn packed_run(data: &[u8], bases: &[u32], read_at: &ReadAt<'_>) -> Result<PackedRun, LayoutError> {
    const LEVEL: u8 = 6;
    let (pages, _) = data.as_chunks::<PAGE_BYTES>();
    let mut table = vec![0; pages.len() * ENTRY_BYTES];
    let mut packed = Vec::new();
    let mut base = Box::new([0; PAGE_BYTES]);
    for (i, (page, number)) in pages.iter().zip(bases).enumerate() {
        let mut difference = *page;
        if *number > 0 {
            read_at(u64::from(*number) * PAGE, &mut base[..])?;
            difference.iter_mut().zip(&*base).for_each(|(byte, base)| *byte ^= base);
        }
        let mut bytes = miniz_oxide::deflate::compress_to_vec(&difference, LEVEL);
        if bytes.len() >= PAGE_BYTES {
            bytes = difference.to_vec();
        }
        put_u32(&mut table, i * ENTRY_BYTES, *number);
        put_u16(&mut table, i * ENTRY_BYTES + 4, bytes.len() as u16);
        packed.extend_from_slice(&bytes);
    }
    let sum = checksum(&table);
    table.append(&mut packed);
    Ok(PackedRun { bytes: table, table: sum })
}

/// See [`packed_run`].
#[cfg(feature = "files")]
pub(crate) struct PackedRun {
    pub(crate) bytes: Vec<u8>,
    /// CRC-32 of its table.
    pub(crate) table: u32,
}

/// Bytes of a run's table.
pub(crate) fn table_bytes(run: &Run) -> Result<usize, LayoutError> {
    to_usize(u64::from(run.pages) * ENTRY_BYTES as u64)
}
