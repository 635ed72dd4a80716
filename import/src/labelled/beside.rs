//! Headers beside a data file (`.hdr`): where they are, and their text.
//!
//! They have the data file's name with another extension, in small or large letters, or that extension behind the whole name. Cost: a look at each name.

use crate::input;
use std::io::Read;
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;

/// Longest text read; a reference system with all its words takes some kilobytes, a header with a list of bands some more.
const MOST_BYTES: u64 = 1 << 18;

/// The file beside the one at `path` that has `extension` (in small letters), if there is one.
pub(super) fn find(path: &Path, extension: &str) -> Option<PathBuf> {
    let upper = extension.to_ascii_uppercase();
    let behind = |extension: &str| {
        let mut name = path.as_os_str().to_owned();
        name.push(".");
        name.push(extension);
        PathBuf::from(name)
    };
    let names =
        [path.with_extension(extension), path.with_extension(&upper), behind(extension), behind(&upper)];
    names.into_iter().find(|name| name != path && name.is_file())
}

/// The text of a small file.
pub(super) fn text(path: &Path) -> Result<String, LayoutError> {
    let mut bytes = Vec::new();
    input::open(path, "cannot open the file beside the elevation data")?
        .take(MOST_BYTES + 1)
        .read_to_end(&mut bytes)
        .map_err(|source| LayoutError::io(path, "cannot read the file beside the elevation data", source))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(LayoutError::not_this_format(
            path,
            format!(
                "more than {} KiB are no text about elevation data; put the file elsewhere",
                MOST_BYTES >> 10
            ),
        ));
    }
    // Names of places come in any old code page; all that is understood is ASCII.
    let text = String::from_utf8_lossy(&bytes).into_owned();
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}

/// A file's name without its folder, for messages.
pub(super) fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_beside_are_found() {
        let folder = tempfile::tempdir().unwrap();
        let data = folder.path().join("a.b.flt");
        for name in ["a.b.HDR", "a.b.flt.prj"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        assert_eq!(find(&data, "hdr"), Some(folder.path().join("a.b.HDR")));
        assert_eq!(find(&data, "prj"), Some(folder.path().join("a.b.flt.prj")));
        assert_eq!(find(&data, "stx"), None);
        assert_eq!(find(&folder.path().join("a.b.HDR"), "hdr"), None);
    }
}
