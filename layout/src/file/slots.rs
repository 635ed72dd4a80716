//! The two header slots of a file that is written to while others read it, and which of them counts (FORMAT.md, section 4).

use super::bytes::{PAGE_BYTES, Page};
use super::header::{Header, MAGIC};
use super::packed_end::PackedEnd;
use super::source::Source;
use crate::error::LayoutError;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;

/// The current header of a file and where it stands.
#[derive(Debug)]
pub(crate) struct Slots {
    /// The current header as it stands in the file, or in the terrain file that a packed one reads as.
    pub(crate) current: Box<Page>,
    /// 0 or 1.
    pub(crate) current_slot: u64,
    /// What it says.
    pub(crate) header: Header,
    /// Where the file grows, if it is packed.
    pub(crate) packed_end: Option<PackedEnd>,
}

impl Slots {
    /// Reads the slots of a file that begins at `start` of `source`.
    pub(crate) fn read(source: &dyn Source, start: u64) -> Result<Self, LayoutError> {
        Self::read_as(source, start, MAGIC)
    }

    /// As [`Slots::read`], of a file that begins with `magic`.
    pub(crate) fn read_as(source: &dyn Source, start: u64, magic: [u8; 8]) -> Result<Self, LayoutError> {
        let page = |number: u64| -> Result<Box<Page>, LayoutError> {
            let mut page = Box::new([0; PAGE_BYTES]);
            source.read_at(start + number * PAGE, &mut page[..])?;
            Ok(page)
        };
        let slots = Self::of(source.path(), [page(0)?, page(1)?], magic)?;
        Ok(Self { packed_end: source.packed_end().cloned(), ..slots })
    }

    fn of(path: &Path, [a, b]: [Box<Page>; 2], magic: [u8; 8]) -> Result<Self, LayoutError> {
        let header = Header::current_as(path, &a, &b, magic)?;
        let is = |page: &Page| Header::parse_as(path, page, magic).is_ok_and(|h| h == header);
        Ok(if is(&b) && !is(&a) {
            Self { current: b, current_slot: 1, header, packed_end: None }
        } else {
            Self { current: a, current_slot: 0, header, packed_end: None }
        })
    }

    /// Byte from the file's start at which the next header goes.
    pub(crate) fn next_offset(&self) -> u64 {
        (1 - self.current_slot) * PAGE
    }

    /// The next header was written.
    pub(crate) fn flip(&mut self, page: Box<Page>, header: Header, packed_end: Option<PackedEnd>) {
        self.packed_end = packed_end;
        self.current = page;
        self.current_slot = 1 - self.current_slot;
        self.header = header;
    }
}
