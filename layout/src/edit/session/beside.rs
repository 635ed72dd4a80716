//! Overlays of edits that lie beside the terrain file they were made over.
//!
//! Only the file's own folder is looked into; of overlays elsewhere nothing is known. Cost: that of opening the terrain once for each overlay in the folder.

use crate::read::terrain::Terrain;
use std::path::{Path, PathBuf};

/// Overlays beside the terrain file `file` that can be seen over it as it is, by name. They can no longer once it is written anew.
pub fn overlays_beside(file: &Path) -> Vec<PathBuf> {
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
