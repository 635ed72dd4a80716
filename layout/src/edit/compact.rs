//! A terrain file written anew as a build would have left it: pages in order, imagery behind them, and nothing of what edits replaced.

use super::commit::Directory;
use crate::atomic_file::AtomicFile;
use crate::build::BuildProgress;
use crate::bytes::{PAGE_BYTES, checksum};
use crate::directory::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, absent, leaf_page};
use crate::disk::Disk;
use crate::error::LayoutError;
use crate::header::{Header, INERT_PAGE};
use crate::imagery::{Append, Imagery, MadeTile};
use crate::lock::WriteLock;
use crate::opening::inert_page;
use crate::slots::Slots;
use crate::terrain::Terrain;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;
/// Bytes written at a time.
const CHUNK_BYTES: usize = 1 << 20;

/// Writes `terrain`, as it is now, to `out`, which may be its own file: the same records and imagery, in order, without journal. `out` appears when it is complete. Returns
/// its header.
///
/// # Errors
/// Damage and I/O of the terrain; I/O of `out`; [`LayoutError::Usage`] while another program writes to it.
pub fn compact(
    disk: &dyn Disk,
    terrain: &Terrain,
    out: &Path,
    progress: &dyn BuildProgress,
) -> Result<Header, LayoutError> {
    let _lock = WriteLock::take(out)?;
    let file = AtomicFile::create(out)?;
    progress.stage("compacting", terrain.header().stored_pages * terrain.header().records_per_page());
    let mut writer = Writer { disk, file: &file, chunk: Vec::with_capacity(CHUNK_BYTES), offset: 0 };
    let slots = write_terrain(&mut writer, terrain, progress)?;
    let header = copy_imagery(disk, &file, slots, terrain)?;
    progress.stage("syncing", 0);
    file.publish_on(disk)?;
    Ok(header)
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
        let page = (self.offset + self.chunk.len() as u64) / PAGE;
        u32::try_from(page).map_err(|_| LayoutError::Usage("a terrain file has at most 16 TiB".into()))
    }
}

fn write_terrain(
    writer: &mut Writer<'_>,
    terrain: &Terrain,
    progress: &dyn BuildProgress,
) -> Result<Slots, LayoutError> {
    let old = terrain.header();
    // The header comes last.
    writer.put(&[0; 2 * PAGE_BYTES])?;
    debug_assert_eq!(writer.page()?, INERT_PAGE);
    writer.put(&inert_page(old.record_kind)[..])?;
    let mut directory = Directory { entries: absent(terrain.entries().len()), root: Vec::new() };
    let pages = (0u64..).zip(terrain.entries()).zip(&mut directory.entries);
    for ((logical, entry), place) in pages.filter(|((_, entry), _)| entry.is_present()) {
        let page = terrain.checked_page(logical)?;
        *place = Entry { page: writer.page()?, generation: 1, ..*entry };
        writer.put(&page[..])?;
        progress.advance(old.records_per_page());
    }
    for entries in directory.entries.chunks(ENTRIES_PER_LEAF) {
        if entries.iter().any(|entry| entry.is_present()) {
            let bytes = leaf_page(entries);
            directory.root.push(Entry { page: writer.page()?, checksum: checksum(&bytes), generation: 1 });
            writer.put(&bytes)?;
        } else {
            directory.root.push(Entry::default());
        }
    }
    let mut root = vec![0; directory.root.len() * ENTRY_BYTES];
    directory.root.iter().enumerate().for_each(|(i, entry)| entry.write(&mut root, i));
    let root_page = writer.page()?;
    let root_checksum = checksum(&root);
    root.resize(root.len().next_multiple_of(PAGE_BYTES), 0);
    writer.put(&root)?;
    writer.flush()?;
    let header = Header {
        generation: 1,
        root_page,
        root_checksum,
        file_bytes: u64::from(root_page) * PAGE + root.len() as u64,
        imagery: None,
        history: None,
        ..old.clone()
    };
    let page = header.to_page();
    writer.write(&page[..], 0)?;
    Ok(Slots { current: page, current_slot: 0, header })
}

/// Copies the imagery of `terrain`, if it has any, behind the file with these header slots; returns the file's header.
pub(super) fn copy_imagery(
    disk: &dyn Disk,
    file: &AtomicFile,
    slots: Slots,
    terrain: &Terrain,
) -> Result<Header, LayoutError> {
    let Some(imagery) = Imagery::open(terrain)? else { return Ok(slots.header) };
    let mut append = Append::begin(file.target(), disk, file.file(), slots, imagery.shape())?;
    for id in imagery.shape().ids() {
        let mut bytes = Vec::new();
        if let Some(entry) = imagery.read_stored(terrain, id, &mut bytes)? {
            append.put(&MadeTile { id, entry, bytes })?;
        }
    }
    append.commit(imagery.source(), || Ok(()))
}
