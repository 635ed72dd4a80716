//! What is said of a terrain whose newest header is damaged.

use terrasoar_layout::read::terrain::Terrain;

/// Words for a terrain that is seen as it was before the last commit, because that commit's header is damaged; `None` for all others.
pub(crate) fn newest_header_is_lost(terrain: &Terrain) -> Option<String> {
    // What cannot be read is told by whoever needs it.
    let lost = terrain.lost_header().ok().flatten()?;
    Some(format!(
        "{}: the newest header, on page {}, is damaged, and the terrain is seen as it was before the last edit, undo or picture; if a power cut stopped that, nothing is lost; else restore a copy of the file, for the next edit writes over what was lost",
        terrain.path().display(),
        lost.page
    ))
}
