//! How much of a file is not used: pages that edits and imagery replaced (FORMAT.md, sections 7 and 8).

use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, to_usize};
use crate::file::entries::{ENTRY_BYTES, Entry};
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
    let root_bytes = header.root_entries() * ENTRY_BYTES as u64;
    let mut root = vec![0; to_usize(root_bytes)?];
    terrain.source().read_at(u64::from(header.root_page) * page, &mut root)?;
    let leaves = (0..header.root_entries() as usize).filter(|i| Entry::read(&root, *i).is_present()).count();
    let root_used = root_bytes.next_multiple_of(page);
    // A painted picture has tiles all over the file; of one that is damaged its section counts.
    let imagery = match Imagery::open(terrain) {
        Ok(imagery) => imagery.map_or(0, |imagery| imagery.used_pages() * page),
        Err(error @ LayoutError::Io { .. }) => return Err(error),
        Err(_) => header.imagery.map_or(0, |place| place.bytes),
    };
    let used = (3 + header.stored_pages + leaves as u64) * page + root_used + imagery;
    Ok(terrain.source().byte_count().saturating_sub(used))
}
