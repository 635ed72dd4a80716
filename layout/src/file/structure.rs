//! What is checked when a terrain file is opened: header, directory root, inert page (FORMAT.md, section 6). Leaves and record pages are checked when they are read.
//!
//! Cost: two reads, one of the first three pages and one of the root, 16 bytes a mebibyte of compact records.

use super::bytes::{PAGE_BYTES, Page};
use super::header::Header;
use super::page_table::PageTable;
use super::source::Source;
use crate::error::LayoutError;
use crate::file::version::{is_another, is_packed};
use crate::grid::record::{Compact, Exact8, Exact16, RecordCodec, RecordKind};
use std::path::Path;

/// Reads and checks header and directory root (FORMAT.md, section 6).
pub(crate) fn read_structure(source: &dyn Source) -> Result<(Header, PageTable), LayoutError> {
    let (header, inert) = read_front(source)?;
    let pages = check_structure(source, &header, &inert)?;
    Ok((header, pages))
}

/// As [`read_structure`], of a file that others may append to at this moment.
#[cfg(feature = "files")]
pub(crate) fn read_growing(file: &mut dyn Source) -> Result<(Header, PageTable), LayoutError> {
    // The header first and then the length: what a header counts was in the file before the header was.
    let (header, inert) = read_front(file)?;
    file.measure_again()?;
    let pages = check_structure(file, &header, &inert)?;
    Ok((header, pages))
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

/// Whether all that a header counts is there; the directory.
fn check_structure(source: &dyn Source, header: &Header, inert: &Page) -> Result<PageTable, LayoutError> {
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
    PageTable::open(source, header)
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
        RecordKind::Compact | RecordKind::Fine => fill::<Compact>(),
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
