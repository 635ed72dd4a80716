//! A packed file that has grown since it was opened.

use super::super::container::current_of;
use super::PackedSource;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::file::packed_end::{PackedEnd, Run};
use crate::file::source::Source;

impl PackedSource {
    /// Fills the first part of `rest` with what was appended, from byte `at` of the terrain file on; how many bytes.
    pub(super) fn read_appended(&self, at: u64, rest: &mut [u8]) -> Result<usize, LayoutError> {
        let packed = |number, page: &mut Page| self.packed_page(number, page);
        self.appended.read(&*self.inner, at, rest, || self.runs_now(), packed)
    }

    /// What was appended up to now.
    fn runs_now(&self) -> Result<Vec<Run>, LayoutError> {
        let mut slots = [[0; PAGE_BYTES]; 2];
        self.inner.read_at(0, slots.as_flattened_mut())?;
        let [a, b] = &slots;
        let (_, _, page) = current_of(self.path(), [a, b], u64::MAX)?;
        let read_at = |at, buffer: &mut [u8]| self.inner.read_at(at, buffer);
        Ok(PackedEnd::read(self.path(), page, self.end.first, &read_at)?.runs)
    }

    /// A page that an appended one is a difference to.
    fn packed_page(&self, number: u64, page: &mut Page) -> Result<(), LayoutError> {
        if number >= self.end.first {
            let problem = "it is the difference to a page that is not packed";
            return Err(LayoutError::damaged_terrain(self.path(), "appended page".into(), problem));
        }
        self.page(number, page)
    }
}
