//! The bytes of a file by their offset: its own, and in front of them those of the base, if it is an overlay. Only its own can be changed.

use crate::file::bytes::{PAGE_BYTES, checksum, get_u32, get_u64};
use crate::file::header::MAGIC;
use crate::file::source::split_of;

/// First bytes of an overlay.
const OVERLAY_MAGIC: [u8; 8] = *b"\x89IQO\r\n\x1a\n";
/// First bytes of a journal page.
pub(super) const JOURNAL_MAGIC: [u8; 8] = *b"IQTCOMIT";
/// First bytes of an imagery section.
pub(super) const SECTION_MAGIC: [u8; 8] = *b"IQTIMAGE";

/// A file to be changed.
pub(super) struct Image<'b> {
    base: &'b [u8],
    own: &'b mut Vec<u8>,
    /// Offset of the first own byte.
    start: usize,
}

impl<'b> Image<'b> {
    /// A terrain file.
    pub(super) fn terrain(own: &'b mut Vec<u8>) -> Self {
        Self { base: &[], own, start: 0 }
    }

    /// An overlay over a terrain file.
    pub(super) fn overlay(base: &'b [u8], own: &'b mut Vec<u8>) -> Self {
        let counted = current_header(base).map_or(base.len() as u64, |at| get_u64(base, at + 0x088));
        let start = usize::try_from(split_of(counted.min(base.len() as u64))).unwrap_or(usize::MAX);
        Self { base: base.get(..start).unwrap_or(base), own, start }
    }

    /// Offset of the file's first byte.
    pub(super) fn start(&self) -> usize {
        self.start
    }

    /// Offset behind the last byte.
    pub(super) fn end(&self) -> usize {
        self.start + self.own.len()
    }

    /// Whole pages up to the end.
    pub(super) fn pages(&self) -> u32 {
        (self.end() / PAGE_BYTES) as u32
    }

    /// `length` bytes at `at`, if they are there in one of the two files.
    pub(super) fn get(&self, at: usize, length: usize) -> Option<&[u8]> {
        if at < self.start {
            return self.base.get(at..at.checked_add(length)?);
        }
        let at = at - self.start;
        self.own.get(at..at.checked_add(length)?)
    }

    /// As [`Image::get`], to be changed; `None` in the base.
    pub(super) fn get_mut(&mut self, at: usize, length: usize) -> Option<&mut [u8]> {
        let at = at.checked_sub(self.start)?;
        self.own.get_mut(at..at.checked_add(length)?)
    }

    /// Writes what is not there yet, if it lies in the file; tells whether anything changed.
    pub(super) fn put(&mut self, at: usize, bytes: &[u8]) -> bool {
        match self.get_mut(at, bytes.len()) {
            Some(place) if *place != *bytes => {
                place.copy_from_slice(bytes);
                true
            }
            _ => false,
        }
    }

    /// The number at `at`; 0 where there is none.
    pub(super) fn u32_at(&self, at: usize) -> u32 {
        self.get(at, 4).map_or(0, |bytes| get_u32(bytes, 0))
    }

    /// The number at `at`; 0 where there is none.
    pub(super) fn u64_at(&self, at: usize) -> u64 {
        self.get(at, 8).map_or(0, |bytes| get_u64(bytes, 0))
    }

    /// The CRC-32 of bytes that are there.
    pub(super) fn sum(&self, at: usize, length: usize) -> Option<u32> {
        self.get(at, length).map(checksum)
    }

    /// Cuts the file, or fills it up with zeros.
    pub(super) fn resize(&mut self, bytes: usize) {
        self.own.resize(bytes, 0);
    }

    /// Offsets of the header slots that begin as one does.
    pub(super) fn headers(&self) -> Vec<usize> {
        let slots = [self.start, self.start + PAGE_BYTES];
        let is_header = |at: &usize| self.get(*at, PAGE_BYTES).is_some_and(has_magic);
        slots.into_iter().filter(is_header).collect()
    }

    /// Makes an overlay name the base that it lies over.
    pub(super) fn name_base(&mut self) {
        if self.start == 0 {
            return;
        }
        let Some(current) = current_header(self.base) else { return };
        let identity = [
            &self.base[current + 0x01c..current + 0x020],
            &self.base[current + 0xffc..current + 0x1000],
            &self.base[current + 0x088..current + 0x090],
        ]
        .concat();
        for at in self.headers() {
            self.put(at + 0x0f0, &identity);
        }
    }
}

fn has_magic(page: &[u8]) -> bool {
    page[..8] == MAGIC || page[..8] == OVERLAY_MAGIC
}

/// Offset of the slot of a terrain file that counts.
pub(super) fn current_header(bytes: &[u8]) -> Option<usize> {
    let is_whole = |at: &usize| {
        let page = bytes.get(*at..*at + PAGE_BYTES);
        page.is_some_and(|page| has_magic(page) && checksum(&page[..0xffc]) == get_u32(page, 0xffc))
    };
    [0, PAGE_BYTES].into_iter().filter(is_whole).max_by_key(|at| (get_u32(bytes, at + 0x01c), *at == 0))
}
