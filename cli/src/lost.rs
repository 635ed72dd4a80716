//! What is said of a terrain whose newest header is damaged.

use terrasoar_layout::read::terrain::Terrain;

/// Whether a commit that was saved may be lost with the newest header; so it is where that cannot be read.
pub(crate) fn may_have_lost_a_commit(terrain: &Terrain) -> bool {
    terrain.lost_header().map_or(true, |lost| lost.is_some_and(|lost| lost.may_have_been_saved()))
}

/// Words for a terrain that is seen as it was before the last commit, because that commit's header is damaged; `None` for all others. They begin with `note: ` where nothing that was saved is lost, else with `warning: `.
pub(crate) fn newest_header_is_lost(terrain: &Terrain) -> Option<String> {
    // What cannot be read is told by whoever needs it.
    let lost = terrain.lost_header().ok().flatten()?;
    let (path, page) = (terrain.path().display(), lost.page);
    Some(match lost.was_saved {
        Some(false) => format!(
            "note: {path}: the last edit, undo or picture was cut off before it was saved, and the terrain is seen as it was before; nothing that was saved is lost, and the next edit writes over what was left of it"
        ),
        Some(true) => format!(
            "warning: {path}: the newest header, on page {page}, is damaged, and the terrain is seen as it was before the last edit, undo or picture, which was saved; restore a copy of the file, for the next edit writes over what was lost"
        ),
        None => format!(
            "warning: {path}: the newest header, on page {page}, is damaged, and the terrain is seen as it was before the last edit, undo or picture; if a power cut stopped that, nothing is lost; else restore a copy of the file, for the next edit writes over what was lost"
        ),
    })
}
