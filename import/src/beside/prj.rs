//! `.prj` files: WKT, or the older form of Arc/Info, a keyword a line.

use crate::crs::Keywords;

/// The text of the system, whichever form it has.
pub(super) fn plain(text: &str) -> String {
    let text = text.trim_start_matches('\u{feff}').trim();
    if text.contains('[') || text.contains("+proj") {
        return text.to_owned();
    }
    Keywords::parse(text).and_then(|keywords| keywords.proj()).unwrap_or_else(|| text.to_owned())
}
