//! The directory of a terrain file on its way to the disk: leaves that lead to record pages, nodes that lead to leaves where the square has them, and the root (FORMAT.md, section 5).
//!
//! Builds, rewritten files and commits all write it here. Invariant: no page number is handed out that 32 bits do not hold.

use super::bytes::{PAGE_BYTES, checksum};
use super::directory_shape::DirectoryShape;
use super::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, leaf_page};
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
    listed_root(root.len() as u64, (0..).zip(root.iter().copied()))
}

/// A root of so many entries: those that are listed by number, all others absent.
fn listed_root(entries: u64, listed: impl Iterator<Item = (u64, Entry)>) -> RootBytes {
    let mut bytes = vec![0; entries as usize * ENTRY_BYTES];
    listed.for_each(|(i, entry)| entry.write(&mut bytes, i as usize));
    let checksum = checksum(&bytes);
    bytes.resize(bytes.len().next_multiple_of(PAGE_BYTES), 0);
    RootBytes { bytes, checksum }
}

/// Writes one leaf or node, from at most 256 entries, by `put`; returns its entry, which says that it lies at `page`.
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

/// Writes a new file's directory of this shape, without its root, by `put`, which is told the page that each page goes to, from `first_page` on: the `leaves`, each with its number and at most 256 entries, in
/// order, and behind them the nodes, if there are any. Leaves without pages, and leaves that are not listed, are left out. Returns the root and the first page behind what was written, where it goes.
///
/// # Errors
/// Those of `put`; as [`page_at`], which says them of `path`.
pub(crate) fn put_directory<'e>(
    path: &Path,
    shape: DirectoryShape,
    leaves: impl Iterator<Item = (u64, &'e [Entry])>,
    first_page: u32,
    mut put: impl FnMut(u32, &[u8]) -> Result<(), LayoutError>,
) -> Result<(RootBytes, u32), LayoutError> {
    let mut page = first_page;
    let mut put_next = |entries: &[Entry]| {
        let entry = put_leaf(entries, page, 1, |bytes| put(page, bytes))?;
        page = page_at(path, (u64::from(page) + 1) * PAGE)?;
        Ok::<_, LayoutError>(entry)
    };
    let mut listed: Vec<(u64, Entry)> = Vec::new();
    for (i, entries) in leaves.filter(|(_, entries)| entries.iter().any(|entry| entry.is_present())) {
        listed.push((i, put_next(entries)?));
    }
    if shape.has_nodes() {
        let per_node = ENTRIES_PER_LEAF as u64;
        let nodes = listed.chunk_by(|a, b| a.0 / per_node == b.0 / per_node);
        let nodes = nodes.map(|leaves| {
            let mut entries = [Entry::default(); ENTRIES_PER_LEAF];
            leaves.iter().for_each(|(leaf, entry)| entries[(leaf % per_node) as usize] = *entry);
            Ok((leaves[0].0 / per_node, put_next(&entries)?))
        });
        listed = nodes.collect::<Result<_, LayoutError>>()?;
    }
    Ok((listed_root(shape.root_entries(), listed.into_iter()), page))
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let leaves = (0..).zip(entries.chunks(ENTRIES_PER_LEAF));
        let shape = DirectoryShape::new(17, entries.len() as u64);
        let (root, end) = put_directory(Path::new("a.iqt"), shape, leaves, 9, |page, bytes| {
            put.push((page, bytes.len()));
            Ok(())
        })
        .unwrap();
        assert_eq!((put, end), (vec![(9, PAGE_BYTES)], 10));
        assert_eq!((0..3).map(|i| Entry::read(&root.bytes, i).page).collect::<Vec<_>>(), [0, 9, 0]);
        assert_eq!(root.bytes.len(), PAGE_BYTES);
        assert_eq!(root.checksum, checksum(&root.bytes[..3 * ENTRY_BYTES]));
    }

    /// Three leaves in two nodes of four.
    #[test]
    fn nodes_lie_behind_the_leaves() {
        let one = [Entry { page: 3, checksum: 7, generation: 1 }];
        let leaves = [(5, &one[..]), (6, &[]), (255, &one), (520, &one)];
        let shape = DirectoryShape::new(18, 256 * (3 * 256 + 3));
        let mut put = Vec::new();
        let (root, end) = put_directory(Path::new("a.iqt"), shape, leaves.into_iter(), 9, |page, bytes| {
            put.push((page, bytes.to_vec()));
            Ok(())
        })
        .unwrap();
        assert_eq!(
            (put.iter().map(|(page, _)| *page).collect::<Vec<_>>(), end),
            (vec![9, 10, 11, 12, 13], 14)
        );
        let present = |bytes: &[u8]| {
            let entries = (0..bytes.len() / ENTRY_BYTES).map(|i| (i, Entry::read(bytes, i).page));
            entries.filter(|(_, page)| *page > 0).collect::<Vec<_>>()
        };
        assert_eq!(present(&put[3].1), [(5, 9), (255, 10)]);
        assert_eq!(present(&put[4].1), [(8, 11)]);
        assert_eq!(present(&root.bytes), [(0, 12), (2, 13)]);
        assert_eq!(Entry::read(&root.bytes, 2).checksum, checksum(&put[4].1));
        assert_eq!(root.checksum, checksum(&root.bytes[..4 * ENTRY_BYTES]));
    }
}
