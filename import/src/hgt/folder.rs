//! The tiles in a folder, and in the folders in it.

use super::tile::is_tile;
use crate::identify::is_called;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;

/// How deep folders lie in folders, and how many files are looked at.
const DEEPEST: u32 = 4;
const MOST_FILES: usize = 200_000;

/// All tiles in the folder at `path`, each once, in the order of their names.
///
/// # Errors
/// I/O; [`LayoutError::NotThisFormat`] for a folder without tiles, saying what it is where that can be told.
pub(crate) fn tiles_in(path: &Path) -> Result<Vec<PathBuf>, LayoutError> {
    let files = files_in(path)?;
    let tiles = each_once(files.iter().filter(|file| is_tile(file)));
    if tiles.is_empty() {
        return Err(LayoutError::not_this_format(path, refusal(&files)));
    }
    Ok(tiles)
}

/// Tiles in the order of their names. Of one that is there both packed and unpacked the unpacked one counts.
pub(crate) fn each_once<'a>(files: impl IntoIterator<Item = &'a PathBuf>) -> Vec<PathBuf> {
    // A tile's name up to the first point, and how it is packed.
    let mut tiles: BTreeMap<(PathBuf, String), (u8, PathBuf)> = BTreeMap::new();
    for file in files {
        let name =
            file.file_name().map(|name| name.to_string_lossy().to_ascii_uppercase()).unwrap_or_default();
        let stem = name.split('.').next().unwrap_or_default().to_owned();
        let rank = if is_called(file, "hgt") {
            0
        } else if is_called(file, "gz") {
            1
        } else {
            2
        };
        let key = (file.parent().unwrap_or(Path::new("")).to_owned(), stem);
        let entry = tiles.entry(key).or_insert_with(|| (rank, file.clone()));
        if rank < entry.0 {
            *entry = (rank, file.clone());
        }
    }
    tiles.into_values().map(|(_, file)| file).collect()
}

/// All files in the folder at `path` and the folders in it, in the order of their names.
///
/// # Errors
/// I/O; [`LayoutError::Usage`] for more files than are looked at.
pub(crate) fn files_in(path: &Path) -> Result<Vec<PathBuf>, LayoutError> {
    let mut files = Vec::new();
    walk(path, DEEPEST, &mut files)?;
    files.sort();
    Ok(files)
}

fn walk(folder: &Path, depth: u32, files: &mut Vec<PathBuf>) -> Result<(), LayoutError> {
    let failed = |source| LayoutError::io(folder, "cannot list the folder", source);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let kind = entry.file_type().map_err(failed)?;
        let path = entry.path();
        // Links to folders may lead round in a ring; links to files are files.
        if kind.is_dir() {
            if depth > 0 {
                walk(&path, depth - 1, files)?;
            }
        } else if kind.is_file() || path.is_file() {
            files.push(path);
        }
        if files.len() > MOST_FILES {
            return Err(LayoutError::Usage(format!(
                "{}: more than {MOST_FILES} files lie in this folder; name the one with the tiles",
                folder.display()
            )));
        }
    }
    Ok(())
}

/// What to say of a folder without tiles.
fn refusal(files: &[PathBuf]) -> String {
    let has = |wanted: &str| {
        files.iter().any(|file| file.file_name().is_some_and(|name| name.eq_ignore_ascii_case(wanted)))
    };
    if has("hdr.adf") {
        return "this folder is an ARC/INFO grid, which is not read; convert it with: gdal_translate INPUT output.tif".into();
    }
    "there is no elevation data in this folder that says where it lies; name the file in it".into()
}
