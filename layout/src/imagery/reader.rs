//! The imagery of an opened terrain: a checked directory in memory, tiles read from the file one by one.
//!
//! Cost: opening reads 16 bytes a tile, stored or not, and keeps those that are; a tile is one read, a checksum, and for tiles at the rim a copy. Reading needs no exclusive
//! access, so any number of threads may read through one [`Imagery`].

use super::entries::Entries;
use super::section::{Section, TileEntry, damaged};
use super::shape::{ImageryShape, TILE_TEXELS, TileFormat, TileId};
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, checksum};
use crate::file::entries::PageUses;
use crate::file::header::ImageryPlace;
use crate::file::source::Source;
use crate::read::terrain::Terrain;

/// The imagery section of a terrain file.
#[derive(Debug, Clone)]
pub struct Imagery {
    section: Section,
    entries: Entries,
    /// The opened terrain whose imagery it is.
    of: u64,
}

impl Imagery {
    /// Reads header and directory of the imagery of `terrain`; `None` if it has none.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] for anything out of place in them, [`LayoutError::Unsupported`] for a later version of the section; I/O.
    pub fn open(terrain: &Terrain) -> Result<Option<Self>, LayoutError> {
        let header = terrain.header();
        header.imagery.map(|place| Self::open_at(terrain, place, header.file_bytes)).transpose()
    }

    /// As [`Imagery::open`], of the section at `place` in a file of `file_bytes` bytes: that of another state of an edited file.
    pub(crate) fn open_at(
        terrain: &Terrain,
        place: ImageryPlace,
        file_bytes: u64,
    ) -> Result<Self, LayoutError> {
        let (path, source) = (terrain.path(), terrain.source());
        let mut page = Box::new([0; PAGE_BYTES]);
        source.read_at(place.offset, &mut page[..])?;
        let section = Section::parse(path, place, &page)?;
        let directory = u64::from(section.directory_page) * PAGE_BYTES as u64;
        let read = |offset, piece: &mut [u8]| source.read_at(directory + offset, piece);
        let (entries, sum) = Entries::read(section.shape.tiles(), read)?;
        if sum != section.directory_checksum {
            return Err(damaged(path, "imagery directory".into(), "the checksum does not match"));
        }
        for (index, entry) in entries.all() {
            let Some(id) = section.shape.id_at(index) else { continue };
            if !section.is_entry(id, entry, file_bytes) {
                let place = format!("imagery directory entry of {}", tile_name(id));
                return Err(damaged(path, place, "the tile has another length or lies outside the file"));
            }
        }
        check_uses(source, place, &section, &entries, file_bytes)?;
        let (tiles, bytes) =
            entries.all().fold((0, 0), |(n, sum), (_, entry)| (n + 1, sum + u64::from(entry.bytes)));
        if (tiles, bytes) != (section.stored_tiles, section.tile_bytes) {
            let problem = "it holds another number of tiles or bytes than the imagery header says";
            return Err(damaged(path, "imagery directory".into(), problem));
        }
        Ok(Self { section, entries, of: terrain.instance() })
    }

    /// What all tiles have in common, and where the image lies.
    pub fn shape(&self) -> ImageryShape {
        self.section.shape
    }

    /// Format of the image it was made from, in words.
    pub fn source(&self) -> &str {
        &self.section.source
    }

    /// Tiles east and north at a level; none past the coarsest.
    pub fn tile_count(&self, level: u32) -> [u32; 2] {
        self.section.shape.tile_count(level)
    }

    /// Tiles that are stored: those that are not transparent throughout.
    pub fn stored_tiles(&self) -> u64 {
        self.section.stored_tiles
    }

    /// Bytes of all stored tiles together.
    pub fn tile_bytes(&self) -> u64 {
        self.section.tile_bytes
    }

    /// Whether the tile exists and is not transparent throughout.
    pub fn has_tile(&self, id: TileId) -> bool {
        self.entry(id).is_some()
    }

    /// Mean colour of the texels a tile covers, weighted by alpha and taken in linear light, as sRGB, and their mean alpha. `None` where there is no tile.
    pub fn average(&self, id: TileId) -> Option<[u8; 4]> {
        self.entry(id).map(|entry| entry.average)
    }

    /// Fills `texels` with a whole tile, [`TileFormat::tile_bytes`] long, rows from the south: what a GPU takes. Past the rim of the image its
    /// last texels are repeated. `Ok(false)` where there is no tile; `texels` is empty then.
    ///
    /// # Errors
    /// [`LayoutError::Damaged`] naming the tile if it does not match its checksum; [`LayoutError::Usage`] for another terrain than the one that it was opened of; I/O.
    pub fn read_tile(
        &self,
        terrain: &Terrain,
        id: TileId,
        texels: &mut Vec<u8>,
    ) -> Result<bool, LayoutError> {
        let format = self.section.shape.format;
        texels.clear();
        texels.reserve(format.tile_bytes());
        let is_there = self.read_stored(terrain, id, texels)?.is_some();
        if is_there {
            widen(format, self.section.shape.stored_texels(id), texels);
        }
        Ok(is_there)
    }

    /// Fills `texels` with a tile as it is stored, and returns its entry; `None` where there is no tile.
    pub(crate) fn read_stored(
        &self,
        terrain: &Terrain,
        id: TileId,
        texels: &mut Vec<u8>,
    ) -> Result<Option<TileEntry>, LayoutError> {
        texels.clear();
        if terrain.instance() != self.of {
            return Err(LayoutError::Usage(format!(
                "{}: the image was opened of another terrain; open it of this one",
                terrain.path().display()
            )));
        }
        let Some(entry) = self.entry(id) else { return Ok(None) };
        texels.resize(entry.bytes as usize, 0);
        terrain.source().read_at(u64::from(entry.page) * PAGE_BYTES as u64, texels)?;
        if checksum(texels) != entry.checksum {
            let place = format!("imagery {} (file page {})", tile_name(id), entry.page);
            return Err(damaged(terrain.path(), place, "the checksum does not match"));
        }
        Ok(Some(entry))
    }

    /// What the section's first page says.
    pub(super) fn section(&self) -> &Section {
        &self.section
    }

    /// The tiles' entries, in the order of the directory.
    pub(super) fn entries(&self) -> &Entries {
        &self.entries
    }

    /// Imagery of the same opened terrain, from what its first page says and its directory.
    pub(super) fn with(&self, section: Section, entries: Entries) -> Self {
        Self { section, entries, of: self.of }
    }

    /// Whether a tile lies at the same place in the file as that of `other`.
    pub(super) fn has_same_tile(&self, other: &Self, id: TileId) -> bool {
        self.entry(id) == other.entry(id)
    }

    /// Tiles that are not the same in two states of a file whose imagery has one shape.
    pub(super) fn differing(&self, other: &Self) -> Vec<TileId> {
        let indices = self.entries.differing(&other.entries);
        indices.into_iter().filter_map(|index| self.section.shape.id_at(index)).collect()
    }

    /// First page, length in bytes and checksum of a tile that is stored.
    pub(crate) fn stored_place(&self, id: TileId) -> Option<(u32, u32, u32)> {
        self.entry(id).map(|entry| (entry.page, entry.bytes, entry.checksum))
    }

    /// Bytes of the directory of tiles.
    pub(crate) fn directory_bytes(&self) -> u64 {
        self.section.directory_bytes()
    }

    /// First page of a tile in the file.
    pub(crate) fn first_page(&self, id: TileId) -> Option<u64> {
        self.entry(id).map(|entry| entry.page.into())
    }

    /// Pages that a tile takes.
    pub(crate) fn stored_pages(&self, id: TileId) -> u64 {
        self.entry(id).map_or(0, |entry| u64::from(entry.bytes).div_ceil(PAGE_BYTES as u64))
    }

    /// Pages that first page, directory and tiles take, wherever they lie.
    pub(crate) fn used_pages(&self) -> u64 {
        let page = PAGE_BYTES as u64;
        let tiles = self.entries.all().map(|(_, entry)| u64::from(entry.bytes).div_ceil(page));
        1 + self.section.directory_bytes().div_ceil(page) + tiles.sum::<u64>()
    }

    pub(super) fn entry(&self, id: TileId) -> Option<TileEntry> {
        let index = self.section.shape.index(id)?;
        Some(self.entries.get(index)).filter(|entry| entry.is_present())
    }
}

/// No page has two uses in one section: a small file would stand for a large picture.
pub(super) fn check_uses(
    source: &dyn Source,
    place: ImageryPlace,
    section: &Section,
    entries: &Entries,
    file_bytes: u64,
) -> Result<(), LayoutError> {
    let page = PAGE_BYTES as u64;
    let damaged = |place: String| move |problem: String| damaged(source.path(), place, &problem);
    let mut uses = PageUses::new(source, file_bytes)?;
    uses.take(place.offset / page, 1).map_err(damaged("imagery header".into()))?;
    uses.take(section.directory_page.into(), section.directory_bytes().div_ceil(page))
        .map_err(damaged("imagery directory".into()))?;
    for (index, entry) in entries.all() {
        let Some(id) = section.shape.id_at(index) else { continue };
        let problem = uses.take(entry.page.into(), u64::from(entry.bytes).div_ceil(page)).err();
        if let Some(problem) = problem {
            return Err(damaged(format!("imagery directory entry of {}", tile_name(id)))(problem));
        }
    }
    Ok(())
}

/// Name of a tile in messages.
pub(crate) fn tile_name(id: TileId) -> String {
    format!("tile {}, {} of level {}", id.x, id.y, id.level)
}

/// Makes a tile stored with fewer texels whole: repeats the last column of blocks (of Rgba8: of texels) eastwards, then the last row northwards.
pub(super) fn widen(format: TileFormat, stored: [u32; 2], texels: &mut Vec<u8>) {
    let (unit, unit_texels) = match format {
        TileFormat::Bc1 | TileFormat::Bc7 => (format.block_bytes(), 4),
        TileFormat::Rgba8 => (4, 1),
    };
    let [across, up] = stored.map(|side| (side / unit_texels) as usize);
    let whole = (TILE_TEXELS / unit_texels) as usize;
    let (row, whole_row) = (across * unit, whole * unit);
    texels.resize(format.tile_bytes(), 0);
    // From the last row to the first, so that no row is written over before it has moved.
    for y in (0..up).rev() {
        texels.copy_within(y * row..(y + 1) * row, y * whole_row);
        let last = y * whole_row + row - unit;
        for x in across..whole {
            texels.copy_within(last..last + unit, y * whole_row + x * unit);
        }
    }
    for y in up..whole {
        texels.copy_within((up - 1) * whole_row..up * whole_row, y * whole_row);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn narrow_tiles_are_widened_with_their_rim() {
        for (format, unit, unit_texels) in
            [(TileFormat::Bc1, 8, 4), (TileFormat::Bc7, 16, 4), (TileFormat::Rgba8, 4, 1)]
        {
            for stored in [[12, 512], [512, 16], [12, 16], [512, 512]] {
                let [across, up] = stored.map(|side: u32| (side / unit_texels) as usize);
                let mark = |x: usize, y: usize| (x * 7 + y * 31) as u8;
                let mut texels: Vec<u8> = (0..up)
                    .flat_map(|y| (0..across).flat_map(move |x| std::iter::repeat_n(mark(x, y), unit)))
                    .collect();
                widen(format, stored, &mut texels);
                let whole = (TILE_TEXELS / unit_texels) as usize;
                assert_eq!(texels.len(), format.tile_bytes());
                for y in 0..whole {
                    for x in 0..whole {
                        let wanted = mark(x.min(across - 1), y.min(up - 1));
                        let at = (y * whole + x) * unit;
                        assert!(texels[at..at + unit].iter().all(|b| *b == wanted), "{format:?} {x} {y}");
                    }
                }
            }
        }
    }
}
