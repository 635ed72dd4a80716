//! The end of a file that grows while others read it: new bytes behind everything that a header leads to, and the header that makes them count (FORMAT.md, sections 7.1 and 8.5).
//!
//! The order is always the same: the new bytes, a mark that the commit was begun, a sync, a check that the file still has its name, the header slot that is not current, a sync, a mark that it is saved. Nothing that a
//! header leads or led to is written over. Wherever this is cut off, the file holds what it held before, or all that is new.
//!
//! **A header that was begun may be in force, whatever the error said.** [`Attempt`] remembers such a header, so that the next write goes behind what it counts and takes the next generation.

use super::bytes::{PAGE_BYTES, Page};
use super::directory::page_at;
use super::disk::Disk;
use super::header::Header;
use super::lock::WriteLock;
use super::mark::{MARK_BYTES, Mark};
use super::packed_end::{PackedEnd, Run, packed_run};
use super::slots::Slots;
use super::source::Source;
use crate::error::LayoutError;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

const PAGE: u64 = PAGE_BYTES as u64;

/// What headers that failed may have made of the file all the same.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Attempted {
    generation: u32,
    file_bytes: u64,
    /// Where a packed file may end.
    place: u64,
}

impl Attempted {
    /// Whether a header newer than this one may be on the disk.
    pub(crate) fn is_after(&self, header: &Header) -> bool {
        self.generation > header.generation
    }

    /// Takes an attempt into account that did not succeed.
    pub(crate) fn note(&mut self, attempt: &Attempt) {
        if attempt.header_begun.load(Ordering::Acquire) {
            self.generation = self.generation.max(attempt.generation);
            self.file_bytes = self.file_bytes.max(attempt.file_bytes);
            self.place = self.place.max(attempt.place.load(Ordering::Acquire));
        }
    }
}

/// How far the writing of a header came. The code that ordered the write keeps a clone, to know what may be on the disk if the write does not return.
#[derive(Debug)]
pub(crate) struct Attempt {
    generation: u32,
    file_bytes: u64,
    /// Where a packed file ends with it.
    place: AtomicU64,
    header_begun: AtomicBool,
}

/// Where a file is written to.
#[derive(Debug)]
pub(crate) struct Tail {
    path: PathBuf,
    file: TailFile,
    /// Offset of the file's first byte: 0, or where an overlay begins.
    start: u64,
    /// First byte behind everything that a header leads to, of a page.
    begin: u64,
    /// The generation after all that were tried.
    generation: u32,
    /// The current header as it stands in the terrain file.
    current: Box<Page>,
    /// Byte from the file's start at which the next header goes.
    header_offset: u64,
    /// Where the file grows, if it is packed.
    packed: Option<PackedTail>,
}

/// What a packed file's end has besides.
#[derive(Debug)]
struct PackedTail {
    before: PackedEnd,
    /// Where what is written first goes in the file.
    place: u64,
    /// Length of what was packed, and the checksum of its table.
    packed: OnceLock<(u64, u32)>,
    /// As the header makes it.
    after: OnceLock<PackedEnd>,
}

/// Whose end it is.
#[derive(Debug)]
enum TailFile {
    /// A file that others may have open, and the right to write to it.
    Live(WriteLock),
    /// One that has no name yet, which needs none of the care.
    New(File),
}

/// A header that is ready to be written.
#[derive(Debug)]
pub(crate) struct NextHeader {
    pub(crate) page: Box<Page>,
    pub(crate) header: Header,
    pub(crate) attempt: Arc<Attempt>,
}

impl Tail {
    /// The end of the file at `path` that `lock` is of, whose first byte has the offset `start`.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] when the generations have run out.
    pub(crate) fn of(
        path: &Path,
        lock: &WriteLock,
        start: u64,
        slots: &Slots,
        attempted: Attempted,
    ) -> Result<Self, LayoutError> {
        Self::new(path, TailFile::Live(lock.clone()), start, slots, attempted)
    }

    /// The end of a file that no other program knows of, because it is not published yet.
    pub(crate) fn of_new(path: &Path, file: &File, slots: &Slots) -> Result<Self, LayoutError> {
        let file =
            file.try_clone().map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
        Self::new(path, TailFile::New(file), 0, slots, Attempted::default())
    }

    fn new(
        path: &Path,
        file: TailFile,
        start: u64,
        slots: &Slots,
        attempted: Attempted,
    ) -> Result<Self, LayoutError> {
        let old = &slots.header;
        let Some(generation) = old.generation.max(attempted.generation).checked_add(1) else {
            return Err(LayoutError::Usage(format!(
                "{}: it was written to four thousand million times, which is the most it can count; written anew (compacted) it begins to count again",
                path.display()
            )));
        };
        let packed = slots.packed_end.as_ref().map(|before| PackedTail {
            place: before.end.max(attempted.place),
            before: before.clone(),
            packed: OnceLock::new(),
            after: OnceLock::new(),
        });
        // In a packed file what an attempt left has its place, and counts for nothing.
        let tried = if packed.is_some() { 0 } else { attempted.file_bytes };
        Ok(Self {
            path: path.to_owned(),
            file,
            start,
            begin: old.file_bytes.max(tried).next_multiple_of(PAGE),
            generation,
            current: slots.current.clone(),
            header_offset: slots.next_offset(),
            packed,
        })
    }

    fn file(&self) -> &File {
        match &self.file {
            TailFile::Live(lock) => lock.file(),
            TailFile::New(file) => file,
        }
    }

    /// Where what is written first goes.
    pub(crate) fn begin(&self) -> u64 {
        self.begin
    }

    /// Generation of the next header.
    pub(crate) fn generation(&self) -> u32 {
        self.generation
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Writes `bytes` at `offset`, which lies behind everything that counts.
    pub(crate) fn write(&self, disk: &dyn Disk, bytes: &[u8], offset: u64) -> Result<(), LayoutError> {
        debug_assert!(offset >= self.begin);
        self.put(disk, bytes, self.place_of(offset))
    }

    /// Writes whole pages from the tail's begin on. In a packed file each is packed as the difference to one of `bases`, page numbers that `source` reads; 0 stands for none.
    pub(crate) fn write_pages(
        &self,
        disk: &dyn Disk,
        data: &[u8],
        bases: &[u32],
        source: &dyn Source,
    ) -> Result<(), LayoutError> {
        let Some(packed) = &self.packed else { return self.write(disk, data, self.begin) };
        let run = packed_run(data, bases, &|offset, buffer| source.read_at(offset, buffer))?;
        let _ = packed.packed.set((run.bytes.len() as u64, run.table));
        self.put(disk, &run.bytes, packed.place)
    }

    /// Where the file grows once the header counts, if it is packed.
    pub(crate) fn packed_end(&self) -> Option<&PackedEnd> {
        let packed = self.packed.as_ref()?;
        Some(packed.after.get().unwrap_or(&packed.before))
    }

    /// Bytes by which a packed file has grown.
    pub(crate) fn packed_growth(&self) -> Option<u64> {
        let packed = self.packed.as_ref()?;
        Some(packed.after.get().map_or(0, |after| after.end - packed.before.end))
    }

    /// Where in the file the byte `offset` of the terrain lies, one behind everything that counts.
    fn place_of(&self, offset: u64) -> u64 {
        match &self.packed {
            Some(packed) => packed.place + offset.saturating_sub(self.begin),
            None => offset - self.start,
        }
    }

    fn put(&self, disk: &dyn Disk, bytes: &[u8], place: u64) -> Result<(), LayoutError> {
        let when_full =
            "cannot append to the file, for which there is no room; make some on its disk, and try again";
        disk.write_at(self.file(), bytes, place)
            .map_err(|e| LayoutError::write(&self.path, "cannot append to the file", when_full, e))
    }

    /// Syncs the file to the disk, if it is published.
    fn sync(&self, disk: &dyn Disk) -> Result<(), LayoutError> {
        match &self.file {
            TailFile::New(_) => Ok(()),
            TailFile::Live(lock) => disk
                .sync(lock.file())
                .map_err(|e| LayoutError::io(&self.path, "cannot bring the file to the disk", e)),
        }
    }

    /// The header that follows, with this tail's generation.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] for one that no reader would accept: it must not be written.
    pub(crate) fn next_header(&self, header: Header) -> Result<NextHeader, LayoutError> {
        let header = Header { generation: self.generation, ..header };
        let page = header.amended(&self.current);
        let magic = std::array::from_fn(|i| self.current[i]);
        Header::parse_as(&self.path, &page, magic)?;
        let attempt = Attempt {
            generation: header.generation,
            file_bytes: header.file_bytes,
            place: AtomicU64::new(0),
            header_begun: AtomicBool::new(false),
        };
        Ok(NextHeader { page, header, attempt: Arc::new(attempt) })
    }

    /// Brings what was written to the disk, then the header that leads to it, then the mark that says so.
    ///
    /// # Errors
    /// [`LayoutError::Io`], or [`LayoutError::Usage`] if the file was replaced under its name. The file reads as before then, or as after if the header was written.
    pub(crate) fn flip(&self, disk: &dyn Disk, next: &NextHeader) -> Result<(), LayoutError> {
        if let Some(packed) = &self.packed {
            self.put_block(disk, packed, next)?;
        }
        let mark_place = self.mark_place(disk, next)?;
        self.put_mark(disk, mark_place, next, false)?;
        self.sync(disk)?;
        if let TailFile::Live(lock) = &self.file
            && !lock.is_of(&self.path)
        {
            return Err(LayoutError::Usage(format!(
                "{}: the file was replaced by another while it was written to; open it again, and do it again",
                self.path.display()
            )));
        }
        next.attempt.header_begun.store(true, Ordering::Release);
        let page = self.packed_end().map(|end| end.to_file(&next.page));
        self.put(disk, &page.as_ref().unwrap_or(&next.page)[..], self.header_offset)?;
        self.sync(disk)?;
        // Only then is the commit told as saved: if its header is damaged some day, the file can tell that it is lost.
        self.put_mark(disk, mark_place, next, true)?;
        self.sync(disk)
    }

    /// Where the mark goes: behind everything, or over another mark there.
    fn mark_place(&self, disk: &dyn Disk, next: &NextHeader) -> Result<Option<u64>, LayoutError> {
        // Nobody has a file yet that has no name, and none of it is lost one by one.
        let TailFile::Live(lock) = &self.file else { return Ok(None) };
        let io = |e| LayoutError::io(&self.path, "cannot read the end of the file", e);
        let length = lock.file().metadata().map_err(io)?.len();
        let end = match self.packed_end() {
            Some(end) => end.end,
            None => next.header.file_bytes - self.start,
        };
        if let Some(last) = length.checked_sub(MARK_BYTES as u64).filter(|last| *last >= end) {
            let mut bytes = [0; MARK_BYTES];
            disk.read_at(lock.file(), &mut bytes, last).map_err(io)?;
            if Mark::parse(&bytes).is_some() {
                return Ok(Some(last));
            }
        }
        Ok(Some(length.max(end)))
    }

    fn put_mark(
        &self,
        disk: &dyn Disk,
        place: Option<u64>,
        next: &NextHeader,
        is_saved: bool,
    ) -> Result<(), LayoutError> {
        let mark = Mark { generation: next.header.generation, is_saved };
        place.map_or(Ok(()), |place| self.put(disk, &mark.to_bytes(), place))
    }

    /// Writes where the pages lie that a header counts besides those of the one before.
    fn put_block(&self, disk: &dyn Disk, packed: &PackedTail, next: &NextHeader) -> Result<(), LayoutError> {
        let pages = next.header.file_bytes.div_ceil(PAGE).saturating_sub(self.begin / PAGE);
        let mut end = packed.before.end;
        if pages > 0 {
            let (bytes, table) =
                packed.packed.get().map_or((pages * PAGE, None), |(b, sum)| (*b, Some(*sum)));
            let [first, pages] = [page_at(&self.path, self.begin)?, page_at(&self.path, pages * PAGE)?];
            let run = Run { first, pages, place: packed.place, table };
            let (after, block) = packed.before.with(run, packed.place + bytes);
            self.put(disk, &block, packed.place + bytes)?;
            end = after.end;
            let _ = packed.after.set(after);
        }
        next.attempt.place.store(end, Ordering::Release);
        Ok(())
    }

    /// Gives back what was written, whose header was never begun, of a terrain that had `length` bytes. Failing here costs space only.
    pub(crate) fn give_up(&self, disk: &dyn Disk, next: Option<&NextHeader>, length: u64) {
        if next.is_none_or(|next| !next.attempt.header_begun.load(Ordering::Acquire)) {
            let place = self.packed.as_ref().map_or(length, |packed| packed.place);
            let _ = disk.set_len(self.file(), place);
        }
    }
}
