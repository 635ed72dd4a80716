//! What was appended to a packed file since it was packed, read page by page (FORMAT.md, section 9.8).
//!
//! Runs that were written after the file was opened are found when one of their pages is asked for: by the header as it is then. Cost: two reads a page, and those of the page that it is a
//! difference to; the first of a run reads its table, too.

use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum};
use crate::file::packed_end::{PackedPage, Run, table_bytes, table_of, unpacked_page};
use crate::file::source::Source;
use std::sync::{Arc, OnceLock, PoisonError, RwLock};

const PAGE: u64 = PAGE_BYTES as u64;

/// A run, and its table once it was needed.
struct Known {
    run: Run,
    table: OnceLock<Vec<PackedPage>>,
}

/// All runs, as far as they are known.
#[derive(Default)]
pub(super) struct Appended {
    runs: RwLock<Vec<Arc<Known>>>,
}

impl Appended {
    /// Takes notice of what follows the runs that are known.
    pub(super) fn learn(&self, runs: &[Run]) {
        let mut known = self.runs.write().unwrap_or_else(PoisonError::into_inner);
        let end = known.last().map_or(0, |known| known.run.end());
        let new = runs.iter().filter(|run| u64::from(run.first) >= end);
        known.extend(new.map(|run| Arc::new(Known { run: *run, table: OnceLock::new() })));
    }

    fn find(&self, page: u64) -> Option<Arc<Known>> {
        let runs = self.runs.read().unwrap_or_else(PoisonError::into_inner);
        let at = runs.partition_point(|known| u64::from(known.run.first) <= page).checked_sub(1)?;
        Some(Arc::clone(&runs[at])).filter(|known| page < known.run.end())
    }

    /// Fills the first part of `buffer`, from byte `offset` of the terrain file on, from the file `inner`; how many bytes. `again` looks for runs, `packed` reads pages that are packed.
    pub(super) fn read(
        &self,
        inner: &dyn Source,
        offset: u64,
        buffer: &mut [u8],
        again: impl FnOnce() -> Result<Vec<Run>, LayoutError>,
        packed: impl FnOnce(u64, &mut Page) -> Result<(), LayoutError>,
    ) -> Result<usize, LayoutError> {
        let number = offset / PAGE;
        let damaged = |problem: &str| {
            LayoutError::damaged_terrain(inner.path(), format!("appended page {number}"), problem)
        };
        let mut found = self.find(number);
        if found.is_none() {
            self.learn(&again()?);
            found = self.find(number);
        }
        let known = found.ok_or_else(|| {
            LayoutError::damaged(inner.path(), format!("byte {offset}"), "the data ends before it")
        })?;
        let run = &known.run;
        let within = offset - u64::from(run.first) * PAGE;
        let Some(sum) = run.table else {
            let count = (u64::from(run.pages) * PAGE - within).min(buffer.len() as u64) as usize;
            inner.read_at(run.place + within, &mut buffer[..count])?;
            return Ok(count);
        };
        let mut table = vec![0; if known.table.get().is_some() { 0 } else { table_bytes(run)? }];
        if !table.is_empty() {
            inner.read_at(run.place, &mut table)?;
            if checksum(&table) != sum {
                return Err(damaged("the checksum of its run's table does not match"));
            }
            let pages =
                table_of(&table).ok_or_else(|| damaged("its run's table has pages that are too long"))?;
            let _ = known.table.set(pages);
        }
        let entry = known.table.get().and_then(|table| table.get((within / PAGE) as usize));
        let entry = entry.ok_or_else(|| damaged("it is not in its run's table"))?;
        let mut bytes = vec![0; entry.bytes];
        inner.read_at(run.place + table_bytes(run)? as u64 + entry.from, &mut bytes)?;
        let mut base = None;
        if entry.base > 0 {
            let page = base.insert(Box::new([0; PAGE_BYTES]));
            packed(entry.base.into(), page)?;
        }
        let mut page = Box::new([0; PAGE_BYTES]);
        unpacked_page(&bytes, base.as_deref(), &mut page)
            .ok_or_else(|| damaged("it holds something else than a page"))?;
        let within = (offset % PAGE) as usize;
        let count = buffer.len().min(PAGE_BYTES - within);
        buffer[..count].copy_from_slice(&page[within..within + count]);
        Ok(count)
    }
}
