//! Root, nodes and leaves out of a file, each checked when it is read.

use super::{Leaf, PER_LEAF};
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page, checksum, to_usize};
use crate::file::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry};
use crate::file::header::{Header, INERT_PAGE};
use crate::file::source::Source;

/// The directory's root: where the nodes lie, or the leaves of squares that have no nodes.
pub(crate) fn read_root(source: &dyn Source, header: &Header) -> Result<Vec<Entry>, LayoutError> {
    let entries = header.directory().root_entries();
    let mut root = vec![0; to_usize(entries * ENTRY_BYTES as u64)?];
    source.read_at(u64::from(header.root_page) * PAGE_BYTES as u64, &mut root)?;
    if checksum(&root) != header.root_checksum {
        return Err(LayoutError::damaged_terrain(
            source.path(),
            "directory root".into(),
            "the checksum does not match",
        ));
    }
    Ok((0..entries as usize).map(|i| Entry::read(&root, i)).collect())
}

/// Node `i`, which the root says lies at `here`: where its leaves lie; without leaves if it is absent.
pub(crate) fn read_node(
    source: &dyn Source,
    header: &Header,
    i: u64,
    here: Entry,
) -> Result<Leaf, LayoutError> {
    if !here.is_present() {
        return Ok([Entry::default(); ENTRIES_PER_LEAF]);
    }
    let damaged =
        |problem: &str| LayoutError::damaged_terrain(source.path(), format!("directory node {i}"), problem);
    let page = read_page(source, header, here, damaged)?;
    if checksum(&page) != here.checksum {
        return Err(damaged("the checksum does not match"));
    }
    let (entries, outside) = entries_of(header, &page, i * PER_LEAF, header.directory().leaves());
    match outside {
        Some(leaf) => Err(damaged_leaf(source, leaf, "it lies outside the file")),
        None => Ok(entries),
    }
}

/// Leaf `i`, which root or node say lies at `here`; without pages if it is absent.
pub(crate) fn read_leaf(
    source: &dyn Source,
    header: &Header,
    i: u64,
    here: Entry,
) -> Result<Leaf, LayoutError> {
    if !here.is_present() {
        return Ok([Entry::default(); ENTRIES_PER_LEAF]);
    }
    let leaf = read_page(source, header, here, |problem| damaged_leaf(source, i, problem))?;
    parse_leaf(source, header, i, here, &leaf)
}

/// The bytes of a node or leaf, unchecked.
fn read_page(
    source: &dyn Source,
    header: &Header,
    here: Entry,
    damaged: impl Fn(&str) -> LayoutError,
) -> Result<Page, LayoutError> {
    if !is_in_file(header, here.page) {
        return Err(damaged("it lies outside the file"));
    }
    let mut page = [0; PAGE_BYTES];
    source.read_at(u64::from(here.page) * PAGE_BYTES as u64, &mut page)?;
    Ok(page)
}

/// Whether a page may be a node, a leaf or a record page.
pub(super) fn is_in_file(header: &Header, page: u32) -> bool {
    page > INERT_PAGE && (u64::from(page) + 1) * PAGE_BYTES as u64 <= header.file_bytes
}

pub(super) fn damaged_leaf(source: &dyn Source, i: u64, problem: &str) -> LayoutError {
    LayoutError::damaged_terrain(source.path(), format!("directory leaf {i}"), problem)
}

/// The entries of a page whose first is number `first` of `all`; the number of the first one that leads out of the file.
fn entries_of(header: &Header, page: &Page, first: u64, all: u64) -> (Leaf, Option<u64>) {
    let mut entries = [Entry::default(); ENTRIES_PER_LEAF];
    let count = all.saturating_sub(first).min(PER_LEAF) as usize;
    let mut outside = None;
    for (j, place) in entries[..count].iter_mut().enumerate() {
        *place = Entry::read(page, j);
        if place.is_present() && !is_in_file(header, place.page) {
            outside.get_or_insert(first + j as u64);
        }
    }
    (entries, outside)
}

/// The entries of a leaf that was read.
pub(super) fn parse_leaf(
    source: &dyn Source,
    header: &Header,
    i: u64,
    here: Entry,
    page: &Page,
) -> Result<Leaf, LayoutError> {
    if checksum(page) != here.checksum {
        return Err(damaged_leaf(source, i, "the checksum does not match"));
    }
    let (entries, outside) = entries_of(header, page, i * PER_LEAF, header.record_pages());
    match outside {
        Some(page) => {
            let place = format!("directory entry of record page {page}");
            Err(LayoutError::damaged_terrain(source.path(), place, "the page lies outside the file"))
        }
        None => Ok(entries),
    }
}
