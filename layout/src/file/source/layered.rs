//! A terrain file and what was written behind it in another file, as one: the base up to a whole page, then the overlay (FORMAT.md, section 7.3).

use super::{Source, Unpacking};
use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use std::path::Path;

/// Two sources in one range of offsets.
pub(crate) struct LayeredSource<'s> {
    base: Box<dyn Source + 's>,
    overlay: Box<dyn Source + 's>,
    /// First offset of the overlay.
    split: u64,
    /// Whether the base is in another state by now.
    has_grown: bool,
}

/// Offset at which an overlay of a base of so many bytes begins.
pub(crate) fn split_of(base_bytes: u64) -> u64 {
    base_bytes.next_multiple_of(PAGE_BYTES as u64)
}

impl<'s> LayeredSource<'s> {
    /// The overlay begins at the offset `split`; what the base has behind it, if it has grown since, is not part of this terrain.
    pub(crate) fn new(
        base: Box<dyn Source + 's>,
        split: u64,
        overlay: Box<dyn Source + 's>,
        has_grown: bool,
    ) -> Self {
        Self { base, overlay, split, has_grown }
    }
}

impl Source for LayeredSource<'_> {
    /// The overlay's: it is what tells this terrain from the base.
    fn path(&self) -> &Path {
        self.overlay.path()
    }

    fn base_path(&self) -> Option<&Path> {
        Some(self.base.path())
    }

    fn base_has_grown(&self) -> bool {
        self.has_grown
    }

    fn byte_count(&self) -> u64 {
        self.split + self.overlay.byte_count()
    }

    /// Of both.
    fn packed_bytes(&self) -> Option<u64> {
        Some(self.base.packed_bytes()? + self.overlay.byte_count())
    }

    fn unpacking(&self) -> Option<&dyn Unpacking> {
        self.base.unpacking()
    }

    fn take_share(&self, cache_bytes: u64) -> u64 {
        self.base.take_share(cache_bytes)
    }

    fn read_end(&self, buffer: &mut [u8]) -> Result<bool, LayoutError> {
        self.overlay.read_end(buffer)
    }

    fn own_start(&self) -> u64 {
        self.split
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        if offset >= self.split {
            return self.overlay.read_at(offset - self.split, buffer);
        }
        let in_base = (self.split - offset).min(buffer.len() as u64) as usize;
        let (low, high) = buffer.split_at_mut(in_base);
        self.base.read_at(offset, low)?;
        if high.is_empty() { Ok(()) } else { self.overlay.read_at(0, high) }
    }

    fn bytes(&self) -> Option<&[u8]> {
        self.lend().ok().flatten()
    }

    fn lends(&self) -> bool {
        self.base.lends() && self.overlay.lends()
    }

    fn lend(&self) -> Result<Option<&[u8]>, LayoutError> {
        let (Some(base), Some(_)) = (self.base.lend()?, self.overlay.bytes()) else { return Ok(None) };
        // Whatever lies behind the part that counts is none of this terrain's.
        Ok(base.get(..base.len().min(self.split as usize)))
    }

    fn bytes_behind(&self) -> Option<(u64, &[u8])> {
        Some((self.split, self.overlay.bytes()?))
    }
}
