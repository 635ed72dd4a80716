//! A section appended to a terrain file so that the file reads as before or as after, wherever the work is cut off.
//!
//! Tiles, directory and the section's first page go behind what the current header counts as the file; when they are on the disk, the header slot that is not
//! current gets the next generation, and is synced. Nothing that a reader of the old generation can reach is written to. An append that fails before it has begun on the
//! header gives the space back; after that the new header may be on the disk, whatever the error says, and what it counts must stay. One that is killed leaves bytes behind the
//! file that no header counts, and the next append writes over them.

use super::pyramid::MadeTile;
use super::section::{Section, TileEntry};
use super::shape::{ImageryShape, TileId};
use crate::bytes::{PAGE_BYTES, checksum, to_usize};
use crate::disk::Disk;
use crate::error::LayoutError;
use crate::header::{Header, History, ImageryPlace};
use crate::journal::{Commit, State};
use crate::slots::Slots;
use std::fs::File;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;

/// An append under way.
pub(crate) struct Append<'t> {
    path: &'t Path,
    disk: &'t dyn Disk,
    file: &'t File,
    slots: Slots,
    shape: ImageryShape,
    begin: u64,
    /// First byte not yet taken, of a page.
    next: u64,
    directory: Vec<u8>,
    stored_tiles: u64,
    tile_bytes: u64,
}

impl<'t> Append<'t> {
    /// Begins behind the file's current end. Nothing is written yet.
    pub(crate) fn begin(
        path: &'t Path,
        disk: &'t dyn Disk,
        file: &'t File,
        slots: Slots,
        shape: ImageryShape,
    ) -> Result<Self, LayoutError> {
        let directory_bytes = shape.tiles() * super::section::TILE_ENTRY_BYTES as u64;
        let begin = slots.header.file_bytes.next_multiple_of(PAGE);
        Ok(Self {
            path,
            disk,
            file,
            slots,
            shape,
            begin,
            next: begin + PAGE + directory_bytes.next_multiple_of(PAGE),
            directory: vec![0; to_usize(directory_bytes)?],
            stored_tiles: 0,
            tile_bytes: 0,
        })
    }

    fn write(&self, bytes: &[u8], offset: u64) -> Result<(), LayoutError> {
        let when_full = "cannot append to the file, for which there is no room; make some on its disk, or copy it to another";
        self.disk
            .write_at(self.file, bytes, offset)
            .map_err(|e| LayoutError::write(self.path, "cannot append to the file", when_full, e))
    }

    fn sync(&self) -> Result<(), LayoutError> {
        self.disk
            .sync(self.file)
            .map_err(|e| LayoutError::io(self.path, "cannot bring the file to the disk", e))
    }

    /// Writes a tile behind the last one.
    pub(crate) fn put(&mut self, tile: &MadeTile) -> Result<(), LayoutError> {
        let page = u32::try_from(self.next / PAGE).map_err(|_| {
            LayoutError::Usage(format!(
                "{}: with this imagery the file would be longer than 16 TiB",
                self.path.display()
            ))
        })?;
        self.write(&tile.bytes, self.next)?;
        let rest = tile.bytes.len().next_multiple_of(PAGE_BYTES) - tile.bytes.len();
        if rest > 0 {
            self.write(&[0; PAGE_BYTES][..rest], self.next + tile.bytes.len() as u64)?;
        }
        self.enter(tile.id, TileEntry { page, ..tile.entry });
        self.stored_tiles += 1;
        self.tile_bytes += tile.bytes.len() as u64;
        self.next += (tile.bytes.len() as u64).next_multiple_of(PAGE);
        Ok(())
    }

    fn enter(&mut self, id: TileId, entry: TileEntry) {
        if let Some(index) = self.shape.index(id) {
            entry.write(&mut self.directory, index as usize);
        }
    }

    /// Tiles written so far.
    pub(crate) fn stored_tiles(&self) -> u64 {
        self.stored_tiles
    }

    /// Writes directory and first page, syncs, and makes the section the file's imagery. `may_commit` is asked right before the header.
    pub(crate) fn commit(
        self,
        source: &str,
        may_commit: impl FnOnce() -> Result<(), LayoutError>,
    ) -> Result<Header, LayoutError> {
        let old = &self.slots.header;
        let place = ImageryPlace { offset: self.begin, bytes: self.next - self.begin };
        let mut header = Header {
            generation: old.generation.saturating_add(1),
            file_bytes: place.end(),
            imagery: Some(place),
            ..old.clone()
        };
        // In a file that was edited, a picture can be undone as an edit can.
        if let Some(commit) = self.journal_page(State::of(&header))? {
            let page = (place.end() / PAGE) as u32;
            self.write(&commit.to_page()[..], place.end())?;
            header.history = Some(History { commit_page: page, tip_page: page });
            header.file_bytes += PAGE;
        }
        self.write_section(source)?;
        may_commit()?;
        let page = header.amended(&self.slots.current);
        self.write(&page[..], self.slots.next_offset())?;
        self.sync()?;
        Ok(header)
    }

    /// What the journal is to say of the picture, if the file has a journal.
    fn journal_page(&self, state: State) -> Result<Option<Commit>, LayoutError> {
        let old = &self.slots.header;
        let Some(history) = old.history else { return Ok(None) };
        let read = |page: u32| -> Result<Commit, LayoutError> {
            let mut bytes = Box::new([0; PAGE_BYTES]);
            self.disk
                .read_at(self.file, &mut bytes[..], u64::from(page) * PAGE)
                .map_err(|e| LayoutError::io(self.path, "cannot read the file's journal", e))?;
            Commit::parse(self.path, old, page, &bytes)
        };
        let original = read(history.tip_page)?.original;
        let sequence = if history.commit_page > 0 { read(history.commit_page)?.sequence } else { 0 };
        Ok(Some(Commit {
            parent: history.commit_page,
            sequence: sequence.saturating_add(1),
            edits: 0,
            state,
            original,
            label: "drape".into(),
        }))
    }

    /// Writes directory and first page behind which the tiles lie, and brings all to the disk.
    fn write_section(&self, source: &str) -> Result<(), LayoutError> {
        let section = Section {
            shape: self.shape,
            stored_tiles: self.stored_tiles,
            tile_bytes: self.tile_bytes,
            directory_page: (self.begin / PAGE + 1) as u32,
            directory_checksum: checksum(&self.directory),
            source: source.to_owned(),
        };
        let mut start = section.to_page().to_vec();
        start.extend_from_slice(&self.directory);
        start.resize(start.len().next_multiple_of(PAGE_BYTES), 0);
        self.write(&start, self.begin)?;
        self.sync()
    }
}
