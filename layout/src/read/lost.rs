//! A header that was newer than the one that counts, and can no longer be read.
//!
//! A commit writes the header slot that is not current. While that page is damaged the file reads as before the commit, whether a power cut stopped the writing or the page was damaged afterwards. Nobody can tell these two
//! apart, so it is said.

use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, get_u32};
use crate::file::header::{GENERATION, Header};
use crate::file::version::{MAGIC, OVERLAY_MAGIC};

/// A header slot that was written after the current one, and holds no header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostHeader {
    /// Its page, from the start of the file that was edited: 0 or 1.
    pub page: u64,
    /// Generation of the header that counts instead.
    pub generation: u32,
}

impl Terrain {
    /// The header slot that is damaged and newer than the current one: the terrain is as it was before the commit that wrote it. `None` in every sound file.
    ///
    /// A damaged slot that says it is older than the current one is passed over: nothing depends on it.
    ///
    /// # Errors
    /// I/O.
    pub fn lost_header(&self) -> Result<Option<LostHeader>, LayoutError> {
        // Twice, because another program may be writing one of them.
        let first = self.look_for_lost()?;
        if first.is_none() { Ok(None) } else { self.look_for_lost() }
    }

    fn look_for_lost(&self) -> Result<Option<LostHeader>, LayoutError> {
        let (source, header) = (self.source(), self.header());
        let magics = [MAGIC, OVERLAY_MAGIC];
        let is_header =
            |page: &Page| magics.iter().any(|magic| Header::parse_as(self.path(), page, *magic).is_ok());
        let is_lost = |page: &Page| {
            if page.iter().all(|byte| *byte == 0) {
                // Before the first commit the second slot is empty, after it neither.
                return header.history.is_some();
            }
            let says_it_is_older = magics.iter().any(|magic| page.starts_with(magic))
                && get_u32(page, GENERATION) < header.generation;
            !says_it_is_older && !is_header(page)
        };
        let mut slots = [[0; PAGE_BYTES]; 2];
        source.read_at(source.own_start(), slots.as_flattened_mut())?;
        let lost = slots.iter().position(is_lost);
        Ok(lost.map(|page| LostHeader { page: page as u64, generation: header.generation }))
    }
}
