//! The end of a packed file, where it grows: what is appended to the terrain file that it reads as goes behind what is packed, page by page (FORMAT.md, section 9.8).
//!
//! What is packed is never touched again. A header of the packed file is that of the terrain file with a few fields more, which stay the same while it grows. So everything that appends to a
//! terrain file appends to a packed one, by this table of two offsets.

use super::bytes::{PAGE_BYTES, Page, checksum, get_u16, get_u32, put_u16};
use super::header::seal;
use super::version::{MAGIC, PACKED_VERSION};
use std::ops::Range;

/// Bytes of a header page that tell how the file is packed.
pub(crate) const FIELDS: Range<usize> = 0x100..0x200;
/// Where the minor version of the terrain file stands among them.
pub(crate) const UNPACKED_MINOR: usize = 0x102;

/// Where a packed file grows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PackedEnd {
    /// The fields that tell how it is packed.
    pub(crate) fields: Box<[u8; 0x100]>,
    /// First byte of the terrain file that is not packed.
    pub(crate) from: u64,
    /// Where that lies in the packed file.
    pub(crate) place: u64,
    /// Length of the terrain file when it was packed.
    pub(crate) unpacked_bytes: u64,
}

impl PackedEnd {
    /// Where in the packed file byte `offset` of the terrain file lies, which is not packed.
    pub(crate) fn place_of(&self, offset: u64) -> u64 {
        self.place.saturating_add(offset.saturating_sub(self.from))
    }

    /// A header page of the terrain file as it stands in the packed one.
    pub(crate) fn to_file(&self, page: &Page) -> Box<Page> {
        let mut page = Box::new(*page);
        let minor = get_u16(&page[..], 0x00a);
        page[FIELDS].copy_from_slice(&self.fields[..]);
        put_u16(&mut page[..], UNPACKED_MINOR, minor);
        put_u16(&mut page[..], 0x008, PACKED_VERSION);
        put_u16(&mut page[..], 0x00a, 0);
        seal(&mut page);
        page
    }
}

/// The header page of the terrain file that a header page of a packed file stands for; zeros for what is none.
pub(crate) fn from_file(page: &Page) -> Box<Page> {
    let is_sound = page[..8] == MAGIC
        && get_u16(page, 0x008) == PACKED_VERSION
        && get_u32(page, 0xffc) == checksum(&page[..0xffc]);
    if !is_sound {
        return Box::new([0; PAGE_BYTES]);
    }
    let mut own = Box::new(*page);
    put_u16(&mut own[..], 0x008, 1);
    put_u16(&mut own[..], 0x00a, get_u16(page, UNPACKED_MINOR));
    own[FIELDS].fill(0);
    seal(&mut own);
    own
}
