//! Painted tiles on their way into the file: a section of its own with a directory that points to new tiles and old ones (FORMAT.md, section 8.6).
//!
//! Cost: each painted tile is decoded once for its mean colour and gets its checksum once, in parallel; one copy of all bytes.

use super::super::Imagery;
use super::super::reader::check_uses;
use super::super::section::{Section, TileEntry};
use super::super::shape::TileId;
use super::Painter;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, checksum, to_usize};
use crate::file::header::ImageryPlace;
#[cfg(feature = "files")]
use rayon::prelude::*;

const PAGE: u64 = PAGE_BYTES as u64;

/// A section that is yet to be written.
#[derive(Debug)]
pub struct PaintedSection {
    /// Where it lies: what the file's header is to say.
    pub place: ImageryPlace,
    /// What is to be written there, whole pages: the section's first page, the directory, painted tiles.
    pub bytes: Vec<u8>,
    pub(super) imagery: Imagery,
}

impl PaintedSection {
    /// Bytes of a section that begins on page `first_page` of the file; `None` if no tile differs from the file's.
    pub(super) fn of(
        painter: &Painter,
        ids: &[TileId],
        first_page: u32,
    ) -> Result<Option<Self>, LayoutError> {
        let (current, original) = (&painter.files.current, &painter.files.original);
        let shape = current.shape();
        let entry = |id: &TileId| -> TileEntry {
            let Some(tile) = painter.cache.get(*id) else { return TileEntry::default() };
            if tile.differing_count == 0 {
                return original.entry(*id).unwrap_or_default();
            }
            let (Some(average), Some(bytes)) = (tile.average(shape.covered_texels(*id)), tile.bytes()) else {
                return TileEntry::default();
            };
            TileEntry { page: 0, bytes: bytes.len() as u32, checksum: checksum(bytes), average }
        };
        #[cfg(feature = "files")]
        let made: Vec<TileEntry> = ids.par_iter().map(entry).collect();
        #[cfg(not(feature = "files"))]
        let made: Vec<TileEntry> = ids.iter().map(entry).collect();
        let mut entries = current.entries().clone();
        let directory_bytes = to_usize(current.section().directory_bytes())?;
        // What is zero takes no memory until it is written to.
        let mut bytes = vec![0; PAGE_BYTES + directory_bytes.next_multiple_of(PAGE_BYTES)];
        for (id, mut entry) in ids.iter().zip(made) {
            let Some(index) = shape.index(*id) else { continue };
            if entry.page == 0 && entry.bytes > 0 {
                let page = u64::from(first_page) + bytes.len() as u64 / PAGE;
                entry.page = u32::try_from(page).map_err(|_| {
                    LayoutError::Usage(format!(
                        "{}: with this paint the file would be longer than 16 TiB",
                        painter.files.terrain.path().display()
                    ))
                })?;
                if let Some(tile) = painter.cache.get(*id).and_then(|tile| tile.bytes()) {
                    bytes.extend_from_slice(tile);
                }
                bytes.resize(bytes.len().next_multiple_of(PAGE_BYTES), 0);
            }
            entries.set(index, entry);
        }
        if entries == *current.entries() {
            return Ok(None);
        }
        for (index, entry) in entries.all() {
            entry.write(&mut bytes[PAGE_BYTES..], index as usize);
        }
        let section = Section {
            stored_tiles: entries.all().count() as u64,
            tile_bytes: entries.all().map(|(_, entry)| u64::from(entry.bytes)).sum(),
            directory_page: first_page + 1,
            directory_checksum: entries.checksum(),
            ..current.section().clone()
        };
        bytes[..PAGE_BYTES].copy_from_slice(&section.to_page()[..]);
        let place = ImageryPlace { offset: u64::from(first_page) * PAGE, bytes: bytes.len() as u64 };
        // Tiles of two states of a file of nonsense may lie over one another.
        check_uses(painter.files.terrain.source(), place, &section, &entries, place.end())?;
        Ok(Some(Self { place, bytes, imagery: current.with(section, entries) }))
    }
}
