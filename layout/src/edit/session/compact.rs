//! A terrain file written anew as a build would have left it: pages in order, imagery behind them, and without what edits replaced.

use crate::error::LayoutError;
use crate::file::atomic::AtomicFile;
use crate::file::bytes::PAGE_BYTES;
use crate::file::directory::{page_at, put_directory};
use crate::file::disk::Disk;
use crate::file::entries::{ENTRIES_PER_LEAF, Entry};
use crate::file::header::{Header, INERT_PAGE};
use crate::file::lock::WriteLock;
use crate::file::page_table::Leaf;
use crate::file::slots::Slots;
use crate::file::structure::inert_page;
use crate::file::tail::Tail;
use crate::imagery::{Append, Imagery, MadeTile};
use crate::packing::{Check, publish_packed};
use crate::progress::Progress;
use crate::publish::publish_terrain;
use crate::read::terrain::Terrain;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;
/// Bytes written at a time.
const CHUNK_BYTES: usize = 1 << 20;

/// What became of a file that was written anew.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Compacted {
    /// Header of the new file.
    pub header: Header,
    /// Bytes of the old one, with its overlay if it had one.
    pub bytes_before: u64,
    /// Bytes of the new file.
    pub bytes: u64,
    /// Commits that could be undone or redone in the old one; 0 if its journal cannot be read.
    pub commits_before: u64,
}

/// Writes the terrain file `file` with the edits of `overlay`, if there is one, as it is now to `out`: the same records and imagery, in order, without journal. A packed terrain stays packed. `out` may be `file` itself, by
/// whatever name; nobody else writes to it from before it is read until it is replaced. `out` appears when it is complete.
///
/// # Errors
/// Damage and I/O of the terrain; I/O of `out`; [`LayoutError::Usage`] while another program writes to it, and if `out` is `file` and has other names (hard links), which would keep the old contents.
pub fn compact(
    disk: &dyn Disk,
    file: &Path,
    overlay: Option<&Path>,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Compacted, LayoutError> {
    write_anew(disk, file, overlay, out, false, progress)
}

/// As [`compact`], and the new file is packed. It takes the room of a terrain file that is not packed beside `out`, until that is complete.
///
/// # Errors
/// As [`compact`] and [`pack`](crate::packing::pack).
pub fn compact_packed(
    disk: &dyn Disk,
    file: &Path,
    overlay: Option<&Path>,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Compacted, LayoutError> {
    write_anew(disk, file, overlay, out, true, progress)
}

fn write_anew(
    disk: &dyn Disk,
    file: &Path,
    overlay: Option<&Path>,
    out: &Path,
    packs: bool,
    progress: &dyn Progress,
) -> Result<Compacted, LayoutError> {
    // The lock comes first: what is committed before it is read, and nothing is committed after it.
    let lock = lock_if_same(file, out)?;
    let terrain = match overlay {
        Some(overlay) => Terrain::open_with_overlay_unmapped(file, overlay)?,
        None => Terrain::open_unmapped(file)?,
    };
    let packs = packs || terrain.source().packed_bytes().is_some();
    let source = terrain.source();
    let bytes_before = source.packed_bytes().unwrap_or_else(|| source.byte_count());
    // A file whose journal is damaged is written anew all the same.
    let commits_before = crate::edit::history(&terrain).map_or(0, |commits| commits.len() as u64);
    let new = AtomicFile::create(out)?;
    let (header, bytes) = if packs {
        let plain = AtomicFile::create(out)?;
        rewrite(disk, &terrain, &plain, progress)?;
        publish_packed(disk, plain, new, lock.as_ref(), Check::Pages, progress)?
    } else {
        rewrite(disk, &terrain, &new, progress)?;
        progress.stage("syncing", 0);
        let header = publish_terrain(disk, new, lock.as_ref())?;
        let bytes = header.file_bytes;
        (header, bytes)
    };
    Ok(Compacted { header, bytes_before, bytes, commits_before })
}

/// The lock of `file` if it is to be replaced.
fn lock_if_same(file: &Path, out: &Path) -> Result<Option<WriteLock>, LayoutError> {
    if !same_file::is_same_file(file, out).unwrap_or(false) {
        return Ok(None);
    }
    let lock = WriteLock::take(out)?;
    lock.check_only_name(out)?;
    Ok(Some(lock))
}

fn rewrite(
    disk: &dyn Disk,
    terrain: &Terrain,
    file: &AtomicFile,
    progress: &dyn Progress,
) -> Result<(), LayoutError> {
    progress.stage("compacting", terrain.header().stored_pages * terrain.header().records_per_page());
    let mut writer = Writer { disk, file, chunk: Vec::with_capacity(CHUNK_BYTES), offset: 0 };
    let slots = write_terrain(&mut writer, terrain, progress)?;
    copy_imagery(disk, file, slots, terrain).map(drop)
}

/// Writes on and on.
struct Writer<'w> {
    disk: &'w dyn Disk,
    file: &'w AtomicFile,
    chunk: Vec<u8>,
    /// Where the chunk goes.
    offset: u64,
}

impl Writer<'_> {
    fn put(&mut self, bytes: &[u8]) -> Result<(), LayoutError> {
        self.chunk.extend_from_slice(bytes);
        if self.chunk.len() >= CHUNK_BYTES { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), LayoutError> {
        self.write(&self.chunk, self.offset)?;
        self.offset += self.chunk.len() as u64;
        self.chunk.clear();
        Ok(())
    }

    fn write(&self, bytes: &[u8], offset: u64) -> Result<(), LayoutError> {
        let when_full = "cannot write the file, for which there is no room; make some on its disk, or name an output on another";
        self.disk
            .write_at(self.file.file(), bytes, offset)
            .map_err(|e| LayoutError::write(self.file.target(), "cannot write the file", when_full, e))
    }

    /// Page that is written next.
    fn page(&self) -> Result<u32, LayoutError> {
        page_at(self.file.target(), self.offset + self.chunk.len() as u64)
    }
}

fn write_terrain(
    writer: &mut Writer<'_>,
    terrain: &Terrain,
    progress: &dyn Progress,
) -> Result<Slots, LayoutError> {
    let old = terrain.header();
    // The header comes last.
    writer.put(&[0; 2 * PAGE_BYTES])?;
    debug_assert_eq!(writer.page()?, INERT_PAGE);
    writer.put(&inert_page(old.record_kind)[..])?;
    let mut leaves: Vec<(u64, Box<Leaf>)> = Vec::new();
    let per_leaf = ENTRIES_PER_LEAF as u64;
    for (logical, entry) in terrain.present_pages()? {
        let page = terrain.checked_page(logical)?;
        if leaves.last().is_none_or(|(leaf, _)| *leaf != logical / per_leaf) {
            leaves.push((logical / per_leaf, Box::new([Entry::default(); ENTRIES_PER_LEAF])));
        }
        if let Some((_, leaf)) = leaves.last_mut() {
            leaf[(logical % per_leaf) as usize] = Entry { page: writer.page()?, generation: 1, ..entry };
        }
        writer.put(&page[..])?;
        progress.advance(old.records_per_page());
    }
    let (path, first) = (writer.file.target(), writer.page()?);
    let entries = leaves.iter().map(|(number, leaf)| (*number, &leaf[..]));
    let (root, root_page) =
        put_directory(path, old.directory(), entries, first, |_, bytes| writer.put(bytes))?;
    writer.put(&root.bytes)?;
    writer.flush()?;
    let header = Header {
        generation: 1,
        root_page,
        root_checksum: root.checksum,
        file_bytes: u64::from(root_page) * PAGE + root.bytes.len() as u64,
        imagery: None,
        history: None,
        ..old.clone()
    };
    let page = header.to_page();
    writer.write(&page[..], 0)?;
    Ok(Slots { current: page, current_slot: 0, header, packed_end: None })
}

/// Copies the imagery of `terrain`, if it has any, behind the file with these header slots, which is not published yet; returns the file's header.
pub(crate) fn copy_imagery(
    disk: &dyn Disk,
    file: &AtomicFile,
    slots: Slots,
    terrain: &Terrain,
) -> Result<Header, LayoutError> {
    let Some(imagery) = Imagery::open(terrain)? else { return Ok(slots.header) };
    let tail = Tail::of_new(file.target(), file.file(), &slots)?;
    let length = slots.header.file_bytes;
    let mut append = Append::begin(disk, tail, slots.header, None, imagery.shape())?;
    for id in imagery.shape().ids() {
        let mut bytes = Vec::new();
        if let Some(entry) = imagery.read_stored(terrain, id, &mut bytes)? {
            append.put(&MadeTile { id, entry, bytes })?;
        }
    }
    append.commit(imagery.source(), length)
}
