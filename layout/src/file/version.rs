//! Which of the two kinds of files one is, by its first bytes: a terrain file, or packed terrain (FORMAT.md, section 9).

use super::bytes::get_u16;
use crate::error::LayoutError;
use std::path::Path;

/// First bytes of every terrain file.
pub const MAGIC: [u8; 8] = *b"\x89IQT\r\n\x1a\n";
/// First bytes of every overlay of edits.
pub(crate) const OVERLAY_MAGIC: [u8; 8] = *b"\x89IQO\r\n\x1a\n";
/// Version of files that hold packed terrain.
pub(crate) const PACKED_VERSION: u16 = 2;

/// Whether a file that begins so is packed terrain.
pub(crate) fn is_packed(start: &[u8]) -> bool {
    start.len() >= 10 && start[..8] == MAGIC && get_u16(start, 8) == PACKED_VERSION
}

/// What is said to those who take packed terrain for the terrain file that it reads as.
pub(crate) fn is_another(path: &Path) -> LayoutError {
    LayoutError::unsupported(path, "this is packed terrain, and its bytes are not those of a terrain file")
}
