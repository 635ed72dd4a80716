//! The page directory: logical record page -> where it lies and its checksum (FORMAT.md, section 5).
//!
//! On disk it has two levels, or three for the largest squares, so that an edit rewrites one page of each and a mostly void terrain has a small one. So it has in memory (`page_table`).
//!
//! Cost: 12 bytes an entry.

mod uses;

pub(crate) use uses::PageUses;

use super::bytes::{PAGE_BYTES, get_u32, put_u32};

/// Bytes a directory entry.
pub(crate) const ENTRY_BYTES: usize = 16;

/// Where a page lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Entry {
    /// Page number in the file; 0 if absent.
    pub page: u32,
    /// CRC-32 of the page; 0 if absent.
    pub checksum: u32,
    /// Generation that wrote it; 0 if absent.
    pub generation: u32,
}

impl Entry {
    /// The entry at index `i` of an array of entries.
    pub fn read(bytes: &[u8], i: usize) -> Self {
        let at = i * ENTRY_BYTES;
        Self {
            page: get_u32(bytes, at),
            checksum: get_u32(bytes, at + 4),
            generation: get_u32(bytes, at + 8),
        }
    }

    /// Stores the entry at index `i` of an array of entries.
    pub fn write(self, bytes: &mut [u8], i: usize) {
        let at = i * ENTRY_BYTES;
        put_u32(bytes, at, self.page);
        put_u32(bytes, at + 4, self.checksum);
        put_u32(bytes, at + 8, self.generation);
        put_u32(bytes, at + 12, 0);
    }

    /// Whether the page is present.
    pub fn is_present(self) -> bool {
        self.page != 0
    }
}

/// Entries a leaf page.
pub(crate) const ENTRIES_PER_LEAF: usize = PAGE_BYTES / ENTRY_BYTES;

/// One leaf page, from at most 256 entries.
pub(crate) fn leaf_page(entries: &[Entry]) -> Vec<u8> {
    let mut page = vec![0; PAGE_BYTES];
    for (i, entry) in entries.iter().enumerate() {
        entry.write(&mut page, i);
    }
    page
}
