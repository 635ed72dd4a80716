//! What a packed file begins with: its header, and where its sections lie (FORMAT.md, section 9.1).
//!
//! A header page is that of the terrain file that it reads as, but for the version and a few fields that say what is different. Invariant: sections that [`Container::parse`] returned lie in the file.

use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum, get_u16, get_u32, get_u64, put_u16, put_u32, put_u64};
use crate::file::header::Header;
use crate::file::packed_end::{FIELDS, FRONT, PACKED_BYTES, PackedEnd, from_file};
use crate::file::version::{MAGIC, PACKED_VERSION};
use crate::words::number;
use std::path::Path;

/// The way of packing that is described in FORMAT.md.
const SCHEME: u16 = 1;
/// Sections that a header has room for.
const MOST_SECTIONS: usize = 8;
const SECTION_TABLE: usize = 0x120;
const SECTION_BYTES: usize = 24;
/// Bit of a section's kind: a reader that does not know it may leave it out.
const MAY_BE_SKIPPED: u32 = 1 << 31;

/// Tables of the coder.
pub(crate) const MODEL: u32 = 1;
/// Runs of absent and present directory leaves of the terrain file.
pub(crate) const RUNS: u32 = 2;
/// Pages and checksum of each leaf that is present.
pub(crate) const INDEX: u32 = 3;
/// Where leaves of the tile directory lie.
pub(crate) const ROOT: u32 = 4;
/// Which pages the leaves have, and their checksums: read leaf by leaf.
pub(crate) const BLOCKS: u32 = 5;
/// Says that leaves of the tile directory have bounds behind their entries.
pub(crate) const BOUNDS: u32 = MAY_BE_SKIPPED | 6;

/// A part of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Section {
    pub(crate) kind: u32,
    /// CRC-32 of its bytes.
    pub(crate) checksum: u32,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
}

/// What the header of a packed file says besides what the terrain's does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Container {
    /// Length of the file when it was packed; what was appended follows.
    pub(crate) packed_bytes: u64,
    /// Record pages that are packed.
    pub(crate) pages: u64,
    pub(crate) sections: Vec<Section>,
}

impl Container {
    /// The end of the file with this front, `end` bytes long, whose terrain file has `first` as the first page that is not packed.
    pub(crate) fn end(&self, first: u64, end: u64) -> PackedEnd {
        let mut page = [0; PAGE_BYTES];
        let p = &mut page[..];
        put_u16(p, 0x100, SCHEME);
        p[0x105] = super::shape::TILE_LOG as u8;
        p[0x106] = super::shape::OCTAVES as u8;
        p[0x107] = self.sections.len() as u8;
        put_u64(p, PACKED_BYTES, self.packed_bytes);
        put_u64(p, 0x110, self.pages);
        for (i, section) in self.sections.iter().enumerate().take(MOST_SECTIONS) {
            let at = SECTION_TABLE + i * SECTION_BYTES;
            put_u32(p, at, section.kind);
            put_u32(p, at + 4, section.checksum);
            put_u64(p, at + 8, section.offset);
            put_u64(p, at + 16, section.bytes);
        }
        let mut fields = Box::new([0; 0x100]);
        fields.copy_from_slice(&page[FIELDS]);
        PackedEnd::of_new(fields, first, end)
    }

    /// Reads and checks a header page of a file of `length` bytes.
    pub(crate) fn parse(path: &Path, page: &Page, length: u64) -> Result<Self, LayoutError> {
        let p = &page[..];
        let damaged = |problem: &str| {
            LayoutError::damaged(
                path,
                "header",
                format!("{problem}; restore a copy or pack the terrain again"),
            )
        };
        if get_u32(p, 0xffc) != checksum(&p[..0xffc]) {
            return Err(damaged("the checksum does not match"));
        }
        let unknown = |what: String| LayoutError::unsupported(path, format!("{what}; use a newer terrasoar"));
        if get_u16(p, 0x00a) != 0 || get_u16(p, 0x100) != SCHEME {
            return Err(unknown(format!(
                "the terrain is packed in a way that this program does not know: version {}.{}, scheme {}",
                PACKED_VERSION,
                get_u16(p, 0x00a),
                get_u16(p, 0x100)
            )));
        }
        if [p[0x105], p[0x106]] != [super::shape::TILE_LOG as u8, super::shape::OCTAVES as u8] {
            return Err(unknown("the terrain is packed in tiles of another size".into()));
        }
        let (count, packed_bytes) = (usize::from(p[0x107]), get_u64(p, PACKED_BYTES));
        if count > MOST_SECTIONS {
            return Err(damaged("a field of the packed terrain is out of range"));
        }
        if packed_bytes > length {
            return Err(LayoutError::damaged(
                path,
                format!("byte {length}"),
                format!(
                    "the file is cut short: it has {length} bytes of {}; copy it again or pack the terrain again",
                    number(packed_bytes as f64)
                ),
            ));
        }
        let mut sections: Vec<Section> = Vec::with_capacity(count);
        for i in 0..count {
            let at = SECTION_TABLE + i * SECTION_BYTES;
            let section = Section {
                kind: get_u32(p, at),
                checksum: get_u32(p, at + 4),
                offset: get_u64(p, at + 8),
                bytes: get_u64(p, at + 16),
            };
            if section.kind & MAY_BE_SKIPPED != 0 && section.kind != BOUNDS {
                continue;
            }
            if !(MODEL..=BLOCKS).contains(&section.kind) && section.kind != BOUNDS {
                return Err(unknown(format!("the packed terrain has a section of kind {}", section.kind)));
            }
            let end = section.offset.checked_add(section.bytes);
            if section.offset < FRONT || end.is_none_or(|end| end > packed_bytes) {
                return Err(damaged("a section lies outside the file"));
            }
            if sections.iter().any(|other| other.kind == section.kind) {
                return Err(damaged("a section is there twice"));
            }
            sections.push(section);
        }
        Ok(Self { packed_bytes, pages: get_u64(p, 0x110), sections })
    }

    /// Whether leaves of the tile directory have bounds.
    pub(crate) fn has_bounds(&self) -> bool {
        self.sections.iter().any(|section| section.kind == BOUNDS)
    }

    /// The section of a kind; one without bytes if there is none.
    pub(crate) fn section(&self, kind: u32) -> Section {
        let found = self.sections.iter().find(|section| section.kind == kind).copied();
        found.unwrap_or(Section { kind, checksum: 0, offset: FRONT, bytes: 0 })
    }
}

/// The header page that counts of the two slots, and what it says.
pub(super) fn current_of<'p>(
    path: &Path,
    pages: [&'p Page; 2],
    length: u64,
) -> Result<(Container, Header, &'p Page), LayoutError> {
    let read = |page: &'p Page| {
        let container = Container::parse(path, page, length)?;
        Ok::<_, LayoutError>((container, Header::parse(path, &from_file(page))?, page))
    };
    match pages.map(read) {
        [Ok(a), Ok(b)] => Ok(if b.1.generation > a.1.generation { b } else { a }),
        [Ok(it), Err(_)] | [Err(_), Ok(it)] => Ok(it),
        // A slot that was never written says nothing.
        [Err(a), Err(b)] => Err(if pages[0][..8] == MAGIC { a } else { b }),
    }
}
