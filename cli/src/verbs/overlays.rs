//! Overlays of edits that lie beside the terrain file they were made over, and what is said of them before the file changes.
//!
//! **A terrain file that is edited, draped or undone keeps what its overlays refer to; one that is written anew does not.** So the first is told, when they are not to show a new picture, and the second is refused unless
//! `--force` is given. Only the file's own folder is looked into; of overlays elsewhere nothing is known. Cost: that of opening the terrain once for each overlay in the folder.

use super::output::complain;
use anyhow::{Result, bail};
use std::path::{Path, PathBuf};
use terrasoar_layout::read::terrain::Terrain;

/// Overlays named in a message; of more the number is said.
const NAMED: usize = 3;

/// Overlays beside `file` that can be seen over it as it is, by name.
fn beside(file: &Path) -> Vec<PathBuf> {
    // Where a link leads, there its overlays may lie too.
    let real = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
    let mut folders: Vec<&Path> = [file, &real].into_iter().filter_map(Path::parent).collect();
    folders.dedup();
    let mut found: Vec<PathBuf> = Vec::new();
    for folder in folders {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = folder.join(entry.file_name());
            let is_overlay = path.extension().is_some_and(|ext| ext.eq_ignore_ascii_case("iqo"));
            let is_known =
                || found.iter().any(|other| same_file::is_same_file(other, &path).unwrap_or(false));
            if is_overlay && !is_known() && Terrain::open_with_overlay_unmapped(file, &path).is_ok() {
                found.push(path.strip_prefix(".").map_or_else(|_| path.clone(), Path::to_owned));
            }
        }
    }
    found.sort();
    found
}

/// Names of overlays beside `file`, in words; `None` if there are none.
pub(super) fn named_beside(file: &Path) -> Option<String> {
    let found = beside(file);
    let names: Vec<String> = found.iter().take(NAMED).map(|path| path.display().to_string()).collect();
    match found.len() {
        0 => None,
        count if count > NAMED => Some(format!("{} and {} more", names.join(", "), count - NAMED)),
        _ => Some(names.join(", ")),
    }
}

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

/// Says so where a terrain is seen with an overlay that is older than what its file was given last.
pub(super) fn tell_of_older(terrain: &Terrain) {
    if let Some(base) = terrain.base_path().filter(|_| terrain.base_has_grown()) {
        complain(&format!(
            "note: {} was edited or draped after {} was begun; it is seen as it was then",
            base.display(),
            terrain.path().display()
        ));
    }
}
