//! The section's first page and its directory as bytes: FORMAT.md, section 8, field by field.
//!
//! Invariant: a [`Section`] that [`Section::parse`] returned has every field in range, consistent with the others, and a directory that lies
//! in the section. So reading it allocates no more than the file holds.

use super::shape::{BORDER_TEXELS, ImageryShape, MAX_TEXELS, TILE_TEXELS, TileFormat, TileId};
use crate::error::LayoutError;
use crate::file::bytes::{
    PAGE_BYTES, Page, checksum, get_f64, get_text, get_u16, get_u32, get_u64, put_f64, put_text, put_u16,
    put_u32, put_u64,
};
use crate::file::header::ImageryPlace;
use std::path::Path;

/// First bytes of the section.
const MAGIC: [u8; 8] = *b"IQTIMAGE";
/// Bytes a directory entry.
pub(super) const TILE_ENTRY_BYTES: usize = 16;

/// Where a tile lies, and what it is like from afar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct TileEntry {
    /// First page in the file; 0 if absent.
    pub(super) page: u32,
    /// Bytes stored; 0 if absent.
    pub(super) bytes: u32,
    /// CRC-32 of them; 0 if absent.
    pub(super) checksum: u32,
    /// Mean colour of the texels it covers, sRGB, and mean alpha.
    pub(super) average: [u8; 4],
}

impl TileEntry {
    pub(super) fn read(bytes: &[u8], i: usize) -> Self {
        let at = i * TILE_ENTRY_BYTES;
        Self {
            page: get_u32(bytes, at),
            bytes: get_u32(bytes, at + 4),
            checksum: get_u32(bytes, at + 8),
            average: get_u32(bytes, at + 12).to_le_bytes(),
        }
    }

    pub(super) fn write(self, bytes: &mut [u8], i: usize) {
        let at = i * TILE_ENTRY_BYTES;
        put_u32(bytes, at, self.page);
        put_u32(bytes, at + 4, self.bytes);
        put_u32(bytes, at + 8, self.checksum);
        put_u32(bytes, at + 12, u32::from_le_bytes(self.average));
    }

    pub(super) fn is_present(self) -> bool {
        self.page != 0
    }
}

/// What the section's first page says.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Section {
    pub(super) shape: ImageryShape,
    pub(super) stored_tiles: u64,
    /// Bytes of all stored tiles together.
    pub(super) tile_bytes: u64,
    pub(super) directory_page: u32,
    pub(super) directory_checksum: u32,
    /// Format of the image it was made from.
    pub(super) source: String,
}

impl Section {
    /// Bytes of the directory.
    pub(super) fn directory_bytes(&self) -> u64 {
        self.shape.tiles() * TILE_ENTRY_BYTES as u64
    }

    pub(super) fn to_page(&self) -> Box<Page> {
        let mut page = Box::new([0; PAGE_BYTES]);
        let p = &mut page[..];
        p[..8].copy_from_slice(&MAGIC);
        put_u16(p, 0x008, 1);
        p[0x00a] = match self.shape.format {
            TileFormat::Bc1 => 1,
            TileFormat::Bc7 => 2,
            TileFormat::Rgba8 => 3,
        };
        p[0x00b] = 1;
        put_u32(p, 0x00c, TILE_TEXELS);
        put_u32(p, 0x010, BORDER_TEXELS);
        put_u32(p, 0x014, self.shape.texels[0]);
        put_u32(p, 0x018, self.shape.texels[1]);
        put_u32(p, 0x01c, self.shape.levels);
        for (i, value) in [self.shape.origin_m, self.shape.texel_m].concat().into_iter().enumerate() {
            put_f64(p, 0x020 + 8 * i, value);
        }
        put_u64(p, 0x040, self.shape.tiles());
        put_u64(p, 0x048, self.stored_tiles);
        put_u64(p, 0x050, self.tile_bytes);
        put_u32(p, 0x058, self.directory_page);
        put_u32(p, 0x05c, self.directory_checksum);
        put_text(p, 0x200, &self.source);
        let sum = checksum(&p[..0xffc]);
        put_u32(p, 0xffc, sum);
        page
    }

    /// Reads and checks the first page of the section at `place`.
    pub(super) fn parse(path: &Path, place: ImageryPlace, page: &Page) -> Result<Self, LayoutError> {
        let p = &page[..];
        let damaged = |problem: &str| damaged(path, "imagery header".into(), problem);
        if p[..8] != MAGIC {
            return Err(damaged("the magic bytes are missing"));
        }
        if get_u32(p, 0xffc) != checksum(&p[..0xffc]) {
            return Err(damaged("the checksum does not match"));
        }
        let version = get_u16(p, 0x008);
        let format = match (version, p[0x00a], p[0x00b], get_u32(p, 0x00c), get_u32(p, 0x010)) {
            (1, 1, 1, TILE_TEXELS, BORDER_TEXELS) => TileFormat::Bc1,
            (1, 2, 1, TILE_TEXELS, BORDER_TEXELS) => TileFormat::Bc7,
            (1, 3, 1, TILE_TEXELS, BORDER_TEXELS) => TileFormat::Rgba8,
            (version, format, space, tile, border) => {
                return Err(LayoutError::unsupported(
                    path,
                    format!(
                        "its imagery is of version {version}, format {format}, colour space {space}, in tiles of {tile} \
                         texels with a border of {border}, which this program does not read; use a newer terrasoar"
                    ),
                ));
            }
        };
        let check = |holds: bool, field: &str| {
            if holds {
                Ok(())
            } else {
                Err(damaged(&format!("the field {field} is out of range or contradicts another")))
            }
        };
        let texels = [get_u32(p, 0x014), get_u32(p, 0x018)];
        check(texels.iter().all(|side| (1..=MAX_TEXELS).contains(side)), "texels")?;
        let [origin_m, texel_m] = [0x020, 0x030].map(|at| [get_f64(p, at), get_f64(p, at + 8)]);
        check(is_place(origin_m, texel_m), "origin or texel")?;
        let shape = ImageryShape::new(format, texels, origin_m, texel_m);
        check(get_u32(p, 0x01c) == shape.levels, "levels")?;
        check(get_u64(p, 0x040) == shape.tiles(), "tiles")?;
        let section = Self {
            shape,
            stored_tiles: get_u64(p, 0x048),
            tile_bytes: get_u64(p, 0x050),
            directory_page: get_u32(p, 0x058),
            directory_checksum: get_u32(p, 0x05c),
            source: get_text(p, 0x200).ok_or_else(|| damaged("the field source is not text"))?,
        };
        check(section.stored_tiles <= shape.tiles(), "stored_tiles")?;
        let directory = u64::from(section.directory_page) * PAGE_BYTES as u64;
        let inside = directory > place.offset && directory + section.directory_bytes() <= place.end();
        check(inside, "directory_page")?;
        Ok(section)
    }

    /// Whether an entry is what the directory may hold for the tile.
    pub(super) fn is_entry(&self, id: TileId, entry: TileEntry, file_bytes: u64) -> bool {
        if !entry.is_present() {
            return entry == TileEntry::default();
        }
        let wanted = self.shape.format.stored_bytes(self.shape.stored_texels(id));
        let begin = u64::from(entry.page) * PAGE_BYTES as u64;
        entry.page > crate::file::header::INERT_PAGE
            && entry.bytes as usize == wanted
            && begin + u64::from(entry.bytes) <= file_bytes
    }
}

/// Whether an image may lie there: finite, within a million million metres, of texels between a micrometre and a thousand kilometres.
pub(super) fn is_place(origin_m: [f64; 2], texel_m: [f64; 2]) -> bool {
    origin_m.iter().all(|m| m.is_finite() && m.abs() <= 1e12)
        && texel_m.iter().all(|m| (1e-6..=1e6).contains(m))
}

/// Damage of the imagery; the terrain beneath it is whole.
pub(super) fn damaged(path: &Path, place: String, problem: &str) -> LayoutError {
    LayoutError::damaged(
        path,
        place,
        format!("{problem}; restore a copy of the file or drape the image again with `terrasoar drape`"),
    )
}
