//! A header that was newer than the one that counts, and can no longer be read.
//!
//! A commit writes the header slot that is not current. While that page is damaged the file reads as before the commit, whether a power cut stopped the writing or the page was damaged afterwards. The mark in the file's last
//! bytes tells these two apart. Programs that know of no marks write none; then nobody can tell, and it is said.

use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, get_u32};
use crate::file::header::{GENERATION, Header};
use crate::file::mark::{MARK_BYTES, Mark};
use crate::file::version::{MAGIC, OVERLAY_MAGIC};

/// A header slot that was written after the current one, and holds no header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LostHeader {
    /// Its page, from the start of the file that was edited: 0 or 1.
    pub page: u64,
    /// Generation of the header that counts instead.
    pub generation: u32,
    /// Whether the commit that wrote it was saved, so that it is lost: a power cut stopped one that was not, of which nothing was said to be saved. `None` where the file does not say.
    pub was_saved: Option<bool>,
}

impl LostHeader {
    /// Whether something that was saved may be lost: not where the file says that the commit was cut off before.
    pub fn may_have_been_saved(&self) -> bool {
        self.was_saved != Some(false)
    }
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
        let mut slots = [[0; PAGE_BYTES]; 2];
        source.read_at(source.own_start(), slots.as_flattened_mut())?;
        let magics = [MAGIC, OVERLAY_MAGIC];
        let is_zero = |page: &Page| page.iter().all(|byte| *byte == 0);
        let is_header =
            |page: &Page| magics.iter().any(|magic| Header::parse_as(self.path(), page, *magic).is_ok());
        let says_it_is_older = |page: &Page| {
            magics.iter().any(|magic| page.starts_with(magic))
                && get_u32(page, GENERATION) < header.generation
        };
        let is_damaged = |page: &Page| is_zero(page) || !says_it_is_older(page) && !is_header(page);
        let Some(page) = slots.iter().position(is_damaged) else { return Ok(None) };
        let mut end = [0; MARK_BYTES];
        let mark = if source.read_end(&mut end)? { Mark::parse(&end) } else { None };
        // How many headers the commit's is behind the current one.
        let ahead = mark.map_or(0, |mark| mark.generation.saturating_sub(header.generation));
        let was_saved = match mark {
            Some(mark) if ahead > 0 && mark.is_saved => Some(true),
            Some(_) if ahead == 1 => Some(false),
            // A commit was cut off, and the damaged header is of the one before: that may well have been saved.
            _ => None,
        };
        // Before the first commit the second slot is empty, after it neither.
        let is_lost =
            !is_zero(&slots[page]) || header.history.is_some() || was_saved == Some(true) || ahead > 1;
        Ok(is_lost.then_some(LostHeader { page: page as u64, generation: header.generation, was_saved }))
    }
}
