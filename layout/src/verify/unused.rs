//! How much of a file is not used: pages that edits and imagery replaced (FORMAT.md, sections 7 and 8).

use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::file::entries::ENTRY_BYTES;
use crate::file::mark::{MARK_BYTES, Mark};
use crate::imagery::Imagery;
use crate::read::terrain::Terrain;

/// Bytes of the file that neither header, directory nor imagery lead to, bytes behind its counted end included: what undoing and redoing would need, if the file was
/// edited, and what is no longer needed. Reads the directory's root and that of the imagery.
///
/// # Errors
/// I/O.
pub fn unused_bytes(terrain: &Terrain) -> Result<u64, LayoutError> {
    let page = PAGE_BYTES as u64;
    let header = terrain.header();
    let root_used = (header.directory().root_entries() * ENTRY_BYTES as u64).next_multiple_of(page);
    let directory = terrain.table().pages_below_root(terrain.source())?;
    // A painted picture has tiles all over the file; of one that is damaged its section counts.
    let imagery = match Imagery::open(terrain) {
        Ok(imagery) => imagery.map_or(0, |imagery| imagery.used_pages() * page),
        Err(error @ LayoutError::Io { .. }) => return Err(error),
        Err(_) => header.imagery.map_or(0, |place| place.bytes),
    };
    let used = (3 + header.stored_pages + directory) * page + root_used + imagery;
    // A mark behind the end is in use.
    let source = terrain.source();
    let mut end = [0; MARK_BYTES];
    let behind = source.byte_count().saturating_sub(header.file_bytes);
    let has_mark = behind >= MARK_BYTES as u64 && source.read_end(&mut end)? && Mark::parse(&end).is_some();
    let mark = if has_mark { MARK_BYTES as u64 } else { 0 };
    Ok(source.byte_count().saturating_sub(used + mark))
}
