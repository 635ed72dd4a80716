//! A section appended to a terrain file so that the file reads as before or as after, wherever the work is cut off.
//!
//! Tiles, directory and the section's first page go behind what the current header counts as the file; then a header makes them count ([`crate::file::tail`]). An append that fails
//! before it has begun on the header gives the space back; one that is killed leaves bytes behind the file that no header counts, and the next append writes over them.

use super::entries::Entries;
use super::pyramid::MadeTile;
use super::section::{Section, TileEntry};
use super::shape::{ImageryShape, TileId};
use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::file::directory::page_at;
use crate::file::disk::Disk;
use crate::file::header::{Header, History, ImageryPlace};
use crate::file::journal::{Lineage, State};
use crate::file::tail::Tail;

const PAGE: u64 = PAGE_BYTES as u64;
/// Bytes of the directory that are written at a time, from so many on.
const WRITE_BYTES: usize = 1 << 20;

/// An append under way.
pub(crate) struct Append<'t> {
    disk: &'t dyn Disk,
    tail: Tail,
    old: Header,
    /// What the journal goes on from, in a file that has one.
    lineage: Option<Lineage>,
    shape: ImageryShape,
    /// First byte not yet taken, of a page.
    next: u64,
    entries: Entries,
    stored_tiles: u64,
    tile_bytes: u64,
}

impl<'t> Append<'t> {
    /// Begins behind the end of the file whose current header is `old`. Nothing is written yet.
    pub(crate) fn begin(
        disk: &'t dyn Disk,
        tail: Tail,
        old: Header,
        lineage: Option<Lineage>,
        shape: ImageryShape,
    ) -> Result<Self, LayoutError> {
        let directory_bytes = shape.tiles() * super::section::TILE_ENTRY_BYTES as u64;
        Ok(Self {
            disk,
            next: tail.begin() + PAGE + directory_bytes.next_multiple_of(PAGE),
            tail,
            old,
            lineage,
            shape,
            entries: Entries::none_of(shape.tiles()),
            stored_tiles: 0,
            tile_bytes: 0,
        })
    }

    fn write(&self, bytes: &[u8], offset: u64) -> Result<(), LayoutError> {
        self.tail.write(self.disk, bytes, offset)
    }

    /// Writes a tile behind the last one.
    pub(crate) fn put(&mut self, tile: &MadeTile) -> Result<(), LayoutError> {
        let page = page_at(self.tail.path(), self.next)?;
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
            self.entries.set(index, entry);
        }
    }

    /// Tiles written so far.
    pub(crate) fn stored_tiles(&self) -> u64 {
        self.stored_tiles
    }

    /// Writes directory and first page, and makes the section the file's imagery. Whatever the error, a file whose header was not begun has the length `length` again.
    pub(crate) fn commit(self, source: &str, length: u64) -> Result<Header, LayoutError> {
        let begin = self.tail.begin();
        let place = ImageryPlace { offset: begin, bytes: self.next - begin };
        let mut header = Header { file_bytes: place.end(), imagery: Some(place), ..self.old.clone() };
        let finished = self.finish(source, &mut header);
        let next = match finished.and_then(|()| self.tail.next_header(header)) {
            Ok(next) => next,
            Err(error) => {
                self.give_up(length);
                return Err(error);
            }
        };
        if let Err(error) = self.tail.flip(self.disk, &next) {
            self.tail.give_up(self.disk, Some(&next), length);
            return Err(error);
        }
        Ok(next.header)
    }

    /// Gives the space back, before a header was begun.
    pub(crate) fn give_up(&self, length: u64) {
        self.tail.give_up(self.disk, None, length);
    }

    /// Writes what is missing: directory and first page, behind which the tiles lie, and the journal's page.
    fn finish(&self, source: &str, header: &mut Header) -> Result<(), LayoutError> {
        // In a file that was edited, a picture can be undone as an edit can.
        if let Some(lineage) = &self.lineage {
            let commit_page = page_at(self.tail.path(), header.file_bytes)?;
            let commit = lineage.commit(State::of(header), 0, "drape");
            self.write(&commit.to_page()[..], header.file_bytes)?;
            header.history = Some(History { commit_page, tip_page: commit_page });
            header.file_bytes += PAGE;
        }
        let begin = self.tail.begin();
        let section = Section {
            shape: self.shape,
            stored_tiles: self.stored_tiles,
            tile_bytes: self.tile_bytes,
            directory_page: page_at(self.tail.path(), begin + PAGE)?,
            directory_checksum: self.entries.checksum(),
            source: source.to_owned(),
        };
        let (mut piece, mut at) = (section.to_page().to_vec(), begin);
        self.entries.pieces(|bytes| {
            piece.extend_from_slice(bytes);
            if piece.len() >= WRITE_BYTES {
                self.write(&piece, at)?;
                at += piece.len() as u64;
                piece.clear();
            }
            Ok(())
        })?;
        piece.resize(piece.len().next_multiple_of(PAGE_BYTES), 0);
        self.write(&piece, at)
    }
}
