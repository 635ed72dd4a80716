//! What a terrain file was when it was decided to replace it.
//!
//! Making a file may take minutes, and the decision to replace another by it is made before. Edits that were committed to the other meanwhile were reported as durable, and must not be lost.
//! So its header pages, which every commit changes, are kept and compared at the end. Of files that are no terrain nothing is kept. Cost: two pages.

use super::bytes::PAGE_BYTES;
use super::header::MAGIC;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The header pages of a terrain file; nothing of anything else.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Seen(Option<Vec<u8>>);

impl Seen {
    /// Looks at what `path` names.
    pub(super) fn at(path: &Path) -> Self {
        // A pipe is not opened; what cannot be read is nothing that this program writes to.
        if !std::fs::symlink_metadata(path).is_ok_and(|meta| meta.is_file()) {
            return Self(None);
        }
        let mut pages = Vec::new();
        let read = File::open(path).and_then(|file| file.take(2 * PAGE_BYTES as u64).read_to_end(&mut pages));
        Self((read.is_ok() && pages.starts_with(&MAGIC)).then_some(pages))
    }

    /// Whether `path` names the same as it did then, as far as it was looked at.
    pub(super) fn is_still(&self, path: &Path) -> bool {
        *self == Self::at(path)
    }
}
