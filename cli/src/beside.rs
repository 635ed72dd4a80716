//! Overlays of edits that lie beside the terrain file they were made over, in words.

use std::path::Path;
use terrasoar_layout::edit::overlays_beside;

/// Overlays named in a message; of more the number is said.
const NAMED: usize = 3;

/// Names of overlays beside `file`, in words; `None` if there are none.
pub(crate) fn named_beside(file: &Path) -> Option<String> {
    let found = overlays_beside(file);
    let names: Vec<String> = found.iter().take(NAMED).map(|path| path.display().to_string()).collect();
    match found.len() {
        0 => None,
        count if count > NAMED => Some(format!("{} and {} more", names.join(", "), count - NAMED)),
        _ => Some(names.join(", ")),
    }
}
