//! What is checked when a terrain file is opened: header, directory, inert page (FORMAT.md, section 6). Record pages are checked when they are read.
//!
//! Invariant: every page number of the directory that is handed out lies inside the source as it was when it was opened, and no page has two uses. Cost: three reads for a file as a build leaves it, one
//! of the first three pages, one of the root, and one of all leaves, which lie one after the other; a read more for each place where leaves of an edited file lie apart, and for each
//! 8 MiB of them.

use super::bytes::{PAGE_BYTES, Page, checksum, to_usize};
use super::entries::{ENTRIES_PER_LEAF, ENTRY_BYTES, Entry, PageUses, absent};
use super::header::{Header, INERT_PAGE};
use super::source::Source;
use crate::error::LayoutError;
use crate::file::version::{is_another, is_packed};
use crate::grid::record::{Compact, Exact8, Exact16, RecordCodec, RecordKind};
use std::path::Path;

/// Leaves read at once, at most: 8 MiB.
const RUN_LEAVES: usize = 2048;

/// Reads and checks header and directory (FORMAT.md, section 6).
pub(crate) fn read_structure(source: &dyn Source) -> Result<(Header, Vec<Entry>), LayoutError> {
    let (header, inert) = read_front(source)?;
    let entries = check_structure(source, &header, &inert)?;
    Ok((header, entries))
}

/// As [`read_structure`], of a file that others may append to at this moment.
#[cfg(feature = "files")]
pub(crate) fn read_growing(file: &mut dyn Source) -> Result<(Header, Vec<Entry>), LayoutError> {
    // The header first and then the length: what a header counts was in the file before the header was.
    let (header, inert) = read_front(file)?;
    file.measure_again()?;
    let entries = check_structure(file, &header, &inert)?;
    Ok((header, entries))
}

/// The current header, and the inert page, which is behind the two slots.
fn read_front(source: &dyn Source) -> Result<(Header, Box<Page>), LayoutError> {
    let path = source.path();
    let length = source.byte_count();
    let page_bytes = PAGE_BYTES as u64;
    if length < 4 * page_bytes {
        let mut start = [0; 16];
        let have = (length as usize).min(start.len());
        source.read_at(0, &mut start[..have])?;
        if is_packed(&start[..have]) {
            return Err(is_another(path));
        }
        let have = have.min(8);
        return Err(if have > 0 && super::header::MAGIC.starts_with(&start[..have]) {
            truncated(path, length, None)
        } else {
            LayoutError::not_this_format(
                path,
                "this is not a terrain file (.iqt); make one from elevation data with `terrasoar build`",
            )
        });
    }
    let mut front = Box::new([[0; PAGE_BYTES]; 3]);
    source.read_at(0, front.as_flattened_mut())?;
    let [slot_a, slot_b, inert] = &*front;
    Ok((Header::current(path, slot_a, slot_b)?, Box::new(*inert)))
}

/// Whether all that a header leads to is there; the directory.
fn check_structure(source: &dyn Source, header: &Header, inert: &Page) -> Result<Vec<Entry>, LayoutError> {
    let length = source.byte_count();
    if length < header.file_bytes {
        return Err(truncated(source.path(), length, Some(header.file_bytes)));
    }
    if *inert != *inert_page(header.record_kind) {
        return Err(LayoutError::damaged_terrain(
            source.path(),
            "inert page".into(),
            "it holds something else",
        ));
    }
    read_directory(source, header)
}

/// The directory's root: where the leaves lie.
pub(crate) fn read_root(source: &dyn Source, header: &Header) -> Result<Vec<Entry>, LayoutError> {
    let root_bytes = to_usize(header.root_entries() * ENTRY_BYTES as u64)?;
    let mut root = vec![0; root_bytes];
    source.read_at(u64::from(header.root_page) * PAGE_BYTES as u64, &mut root)?;
    if checksum(&root) != header.root_checksum {
        return Err(LayoutError::damaged_terrain(
            source.path(),
            "directory root".into(),
            "the checksum does not match",
        ));
    }
    Ok((0..header.root_entries() as usize).map(|i| Entry::read(&root, i)).collect())
}

/// Fills `entries` with those of leaf `i`, which the root says lies at `here`; leaves them as they are if it is absent.
pub(crate) fn read_leaf(
    source: &dyn Source,
    header: &Header,
    i: usize,
    here: Entry,
    entries: &mut [Entry],
) -> Result<(), LayoutError> {
    if !here.is_present() {
        return Ok(());
    }
    check_leaf_place(source, header, i, here)?;
    let mut leaf = [0; PAGE_BYTES];
    source.read_at(u64::from(here.page) * PAGE_BYTES as u64, &mut leaf)?;
    parse_leaf(source, header, i, here, &leaf, entries)
}

/// Whether a page may be a leaf or a record page.
fn is_in_file(header: &Header, page: u32) -> bool {
    page > INERT_PAGE && (u64::from(page) + 1) * PAGE_BYTES as u64 <= header.file_bytes
}

fn damaged_leaf(source: &dyn Source, i: usize, problem: &str) -> LayoutError {
    LayoutError::damaged_terrain(source.path(), format!("directory leaf {i}"), problem)
}

fn check_leaf_place(source: &dyn Source, header: &Header, i: usize, here: Entry) -> Result<(), LayoutError> {
    if is_in_file(header, here.page) {
        Ok(())
    } else {
        Err(damaged_leaf(source, i, "it lies outside the file"))
    }
}

/// The entries of a leaf that was read.
fn parse_leaf(
    source: &dyn Source,
    header: &Header,
    i: usize,
    here: Entry,
    leaf: &Page,
    entries: &mut [Entry],
) -> Result<(), LayoutError> {
    if checksum(leaf) != here.checksum {
        return Err(damaged_leaf(source, i, "the checksum does not match"));
    }
    for (j, place) in entries.iter_mut().enumerate() {
        *place = Entry::read(leaf, j);
        if place.is_present() && !is_in_file(header, place.page) {
            let place = format!("directory entry of record page {}", i * ENTRIES_PER_LEAF + j);
            return Err(LayoutError::damaged_terrain(source.path(), place, "the page lies outside the file"));
        }
    }
    Ok(())
}

/// Fills `entries`, those of all leaves, with those of the leaves `wanted`, which are present. Leaves that lie one after the other are read at once.
fn read_leaves(
    source: &dyn Source,
    header: &Header,
    root: &[Entry],
    wanted: &[usize],
    entries: &mut [Entry],
) -> Result<(), LayoutError> {
    let follows = |a: &usize, b: &usize| root[*a].page.checked_add(1) == Some(root[*b].page);
    let mut bytes = Vec::new();
    for run in wanted.chunk_by(follows).flat_map(|run| run.chunks(RUN_LEAVES)) {
        run.iter().try_for_each(|i| check_leaf_place(source, header, *i, root[*i]))?;
        bytes.resize(run.len() * PAGE_BYTES, 0);
        source.read_at(u64::from(root[run[0]].page) * PAGE_BYTES as u64, &mut bytes)?;
        for (i, leaf) in run.iter().zip(bytes.as_chunks::<PAGE_BYTES>().0) {
            let first = i * ENTRIES_PER_LEAF;
            let end = (first + ENTRIES_PER_LEAF).min(entries.len());
            parse_leaf(source, header, *i, root[*i], leaf, &mut entries[first..end])?;
        }
    }
    Ok(())
}

/// A directory as it is held in memory: the root, an entry a leaf, and all entries, one a logical page.
pub(crate) type Tables = (Vec<Entry>, Vec<Entry>);

/// The whole directory that `header` names, checked.
pub(crate) fn read_directory(source: &dyn Source, header: &Header) -> Result<Vec<Entry>, LayoutError> {
    read_directory_beside(source, header, None).map(|(_, entries)| entries)
}

/// As [`read_directory`], of a state beside one of the same file whose root and entries are `known`: leaves that both have are not read again.
pub(crate) fn read_directory_beside(
    source: &dyn Source,
    header: &Header,
    known: Option<(&[Entry], &[Entry])>,
) -> Result<Tables, LayoutError> {
    let root = read_root(source, header)?;
    let mut uses = PageUses::new(source, header.file_bytes)?;
    uses.take_root(source, header, &root)?;
    let mut entries = absent(to_usize(header.record_pages())?);
    let mut stored = 0;
    let mut wanted = Vec::new();
    for (i, (here, leaf)) in root.iter().zip(entries.chunks_mut(ENTRIES_PER_LEAF)).enumerate() {
        let first = i * ENTRIES_PER_LEAF;
        let same = known.filter(|(root, _)| here.is_present() && root.get(i) == Some(here));
        match same.and_then(|(_, entries)| entries.get(first..first + leaf.len())) {
            Some(known) => leaf.copy_from_slice(known),
            None if here.is_present() => wanted.push(i),
            None => {}
        }
    }
    read_leaves(source, header, &root, &wanted, &mut entries)?;
    for (i, (here, leaf)) in root.iter().zip(entries.chunks(ENTRIES_PER_LEAF)).enumerate() {
        let first = i * ENTRIES_PER_LEAF;
        if here.is_present() {
            uses.take_entries(source, first, leaf)?;
            stored += leaf.iter().filter(|entry| entry.is_present()).count() as u64;
        }
    }
    if stored != header.stored_pages {
        let problem = "it holds another number of pages than the header says";
        return Err(LayoutError::damaged_terrain(source.path(), "directory".into(), problem));
    }
    Ok((root, entries))
}

/// A page of inert records.
pub(crate) fn inert_page(kind: RecordKind) -> Box<Page> {
    fn fill<C: RecordCodec>() -> Box<Page> {
        let mut page = Box::new([0; PAGE_BYTES]);
        for record in page.chunks_exact_mut(C::BYTES) {
            C::write(C::INERT, record);
        }
        page
    }
    match kind {
        RecordKind::Compact => fill::<Compact>(),
        RecordKind::Exact8 => fill::<Exact8>(),
        RecordKind::Exact16 => fill::<Exact16>(),
    }
}

fn truncated(path: &Path, length: u64, wanted: Option<u64>) -> LayoutError {
    let wanted = wanted.map_or(String::new(), |w| format!(" of {w}"));
    LayoutError::damaged(
        path,
        format!("byte {length}"),
        format!("the file is cut short: it has {length} bytes{wanted}; copy it again or build it again"),
    )
}
