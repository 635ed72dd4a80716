//! The directory of a terrain file on its way to the disk: leaves that lead to record pages, and the root that leads to them (FORMAT.md, section 5).
//!
//! Builds, rewritten files and commits all write it here. Invariant: no page number is handed out that 32 bits do not hold.

use super::bytes::{PAGE_BYTES, checksum};
use super::entries::{ENTRY_BYTES, Entry, leaf_page};
use crate::error::LayoutError;
use std::path::Path;

const PAGE: u64 = PAGE_BYTES as u64;

/// The page that begins at byte `offset` of a file.
///
/// # Errors
/// [`LayoutError::Usage`] beyond 16 TiB.
pub(crate) fn page_at(path: &Path, offset: u64) -> Result<u32, LayoutError> {
    u32::try_from(offset / PAGE).map_err(|_| {
        LayoutError::Usage(format!(
            "{}: the file would be longer than 16 TiB, which is the most there is room for; writing it anew drops what edits replaced",
            path.display()
        ))
    })
}

/// A root on its way to the disk.
pub(crate) struct RootBytes {
    /// Whole pages.
    pub(crate) bytes: Vec<u8>,
    /// Of the part that counts.
    pub(crate) checksum: u32,
}

/// The root as it is written.
pub(crate) fn root_bytes(root: &[Entry]) -> RootBytes {
    let mut bytes = vec![0; root.len() * ENTRY_BYTES];
    root.iter().enumerate().for_each(|(i, entry)| entry.write(&mut bytes, i));
    let checksum = checksum(&bytes);
    bytes.resize(bytes.len().next_multiple_of(PAGE_BYTES), 0);
    RootBytes { bytes, checksum }
}

/// Writes one leaf, from at most 256 entries, by `put`; returns its entry in the root, which says that it lies at `page`.
pub(crate) fn put_leaf(
    entries: &[Entry],
    page: u32,
    generation: u32,
    put: impl FnOnce(&[u8]) -> Result<(), LayoutError>,
) -> Result<Entry, LayoutError> {
    let bytes = leaf_page(entries);
    put(&bytes)?;
    Ok(Entry { page, checksum: checksum(&bytes), generation })
}

/// Writes all `leaves` of a new file, each from at most 256 entries, by `put`, which is told the page that each goes to, from `first_page` on. Leaves without pages are left out. Returns the root and
/// the first page behind them.
///
/// # Errors
/// Those of `put`; as [`page_at`], which says them of `path`.
pub(crate) fn put_all_leaves<'e>(
    path: &Path,
    leaves: impl Iterator<Item = &'e [Entry]>,
    first_page: u32,
    mut put: impl FnMut(u32, &[u8]) -> Result<(), LayoutError>,
) -> Result<(Vec<Entry>, u32), LayoutError> {
    let mut page = first_page;
    let mut root = Vec::new();
    for of_leaf in leaves {
        root.push(if of_leaf.iter().any(|entry| entry.is_present()) {
            let entry = put_leaf(of_leaf, page, 1, |bytes| put(page, bytes))?;
            page = page_at(path, (u64::from(page) + 1) * PAGE)?;
            entry
        } else {
            Entry::default()
        });
    }
    Ok((root, page))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::file::entries::ENTRIES_PER_LEAF;

    #[test]
    fn a_file_has_an_end() {
        let path = Path::new("a.iqt");
        assert_eq!(page_at(path, u64::from(u32::MAX) * PAGE).unwrap(), u32::MAX);
        assert!(page_at(path, (u64::from(u32::MAX) + 1) * PAGE).unwrap_err().to_string().contains("16 TiB"));
    }

    #[test]
    fn leaves_without_pages_are_left_out() {
        let mut entries = vec![Entry::default(); 2 * ENTRIES_PER_LEAF + 3];
        entries[ENTRIES_PER_LEAF + 1] = Entry { page: 3, checksum: 7, generation: 1 };
        let mut put = Vec::new();
        let leaves = entries.chunks(ENTRIES_PER_LEAF);
        let (root, end) = put_all_leaves(Path::new("a.iqt"), leaves, 9, |page, bytes| {
            put.push((page, bytes.len()));
            Ok(())
        })
        .unwrap();
        assert_eq!((put, end), (vec![(9, PAGE_BYTES)], 10));
        assert_eq!(root.iter().map(|entry| entry.page).collect::<Vec<_>>(), [0, 9, 0]);
        let bytes = root_bytes(&root);
        assert_eq!(bytes.bytes.len(), PAGE_BYTES);
        assert_eq!(bytes.checksum, checksum(&bytes.bytes[..3 * ENTRY_BYTES]));
    }
}
