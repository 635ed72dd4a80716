//! Overlays of edits that lie beside the terrain file they were made over, and what is said of them before the file changes.
//!
//! **A terrain file that is edited, draped or undone keeps what its overlays refer to; one that is written anew does not.** So the first is told, when they are not to show a new picture, and the second is refused unless
//! `--force` is given. `beside` finds them.

use super::output::complain;
use crate::beside::named_beside;
use crate::lost::{may_have_lost_a_commit, newest_header_is_lost};
use anyhow::{Result, bail};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use terrasoar_layout::read::terrain::Terrain;

/// Says that overlays beside `file` will not show the picture that it is given now.
pub(super) fn tell_of_growing(file: &Path) {
    if let Some(names) = named_beside(file) {
        complain(&format!(
            "note: {names}: edits kept apart from {}; seen with them, the terrain stays as it was when they were begun, without this picture",
            file.display()
        ));
    }
}

/// Refuses to write `file` anew under overlays, unless that is forced.
pub(super) fn refuse_rewriting(file: &Path, is_forced: bool) -> Result<()> {
    let Some(names) = named_beside(file).filter(|_| !is_forced) else { return Ok(()) };
    let file = file.display();
    bail!(
        "{file}: this would write the file anew, and the edits kept apart from it would be lost: {names}; put them into a file of their own first, `terrasoar compact {file} --overlay O.iqo -o NEW.iqt`, or give them up with --force"
    );
}

/// Says so where a terrain is not in the last state that its files were written in: it is seen with an overlay that is older than what its file was given last, or its last header is damaged.
pub(super) fn tell_of_older(terrain: &Terrain) {
    tell_of_lost(terrain);
    tell_of_grown(terrain);
}

/// Says so where a terrain is seen with an overlay that is older than what its file was given last.
pub(super) fn tell_of_grown(terrain: &Terrain) {
    if let Some(base) = terrain.base_path().filter(|_| terrain.base_has_grown()) {
        complain(&format!(
            "note: {} was edited or draped after {} was begun; it is seen as it was then",
            base.display(),
            terrain.path().display()
        ));
    }
}

/// Warns where the newest header of a terrain is damaged; of a file that a verb opens twice, once.
pub(super) fn tell_of_lost(terrain: &Terrain) {
    static TOLD: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if let Some(words) = newest_header_is_lost(terrain)
        && TOLD.lock().is_ok_and(|mut told| told.insert(terrain.path().to_owned()))
    {
        complain(&words);
    }
}

/// Warns of that where a verb hands the names of its files on; gives whether it is so. What keeps them from being opened is for the verb to say.
pub(super) fn tell_of_lost_in(file: &Path, overlay: Option<&Path>) -> bool {
    let opened = match overlay {
        Some(overlay) => Terrain::open_with_overlay_unmapped(file, overlay),
        None => Terrain::open_unmapped(file),
    };
    opened.is_ok_and(|terrain| {
        tell_of_lost(&terrain);
        // One that was cut off before it was saved leads to nothing.
        may_have_lost_a_commit(&terrain)
    })
}
