//! Which numbers an edit may have, and the message for those it may not have.

use super::window::SampleRect;
use crate::error::LayoutError;

/// Most samples that one edit may change: its window takes 8 bytes each.
pub const MAX_EDIT_SAMPLES: usize = 1 << 24;

/// Refuses to touch more samples at once than fit a window.
pub(crate) fn checked_size(what: &str, bounds: Option<SampleRect>) -> Result<(), LayoutError> {
    match bounds {
        Some(rect) if rect.count() > MAX_EDIT_SAMPLES => Err(LayoutError::Usage(format!(
            "{what}: it covers {} x {} samples, and one edit may cover {MAX_EDIT_SAMPLES}; make it smaller, or several of it",
            rect.wide(),
            rect.high(),
        ))),
        _ => Ok(()),
    }
}
