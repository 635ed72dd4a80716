//! A state that the file is to go to, its whole directory checked, before any header names it.
//!
//! Undo and redo write nothing but a header. Without this check a nonsensical journal could lead to a file that does not open. Cost: that of reading its
//! directory, less the leaves that the state has in common with the one that is known.

use crate::error::LayoutError;
use crate::file::bytes::{Page, get_u64};
use crate::file::entries::Entry;
use crate::file::header::Header;
use crate::file::page_table::PageTable;
use crate::imagery::Imagery;
use crate::read::terrain::Terrain;

/// A state that opens.
pub(super) struct CheckedState {
    /// Its directory.
    pub(super) directory: PageTable,
    /// Logical pages whose entries are others than those known, and their entries.
    pub(super) differing: Vec<(usize, Entry)>,
}

/// Checks the state that the header page `page` names, in the file of `terrain`, whose directory is now `known`: the header itself, the whole directory, the imagery.
///
/// # Errors
/// What opening the file in that state would say.
pub(super) fn check_state(
    terrain: &Terrain,
    known: &PageTable,
    page: &Page,
) -> Result<CheckedState, LayoutError> {
    read_state(terrain, known, page).map_err(|error| match error {
        LayoutError::Damaged { path, place, problem } => {
            let place = format!("the state that this would lead to, {place}");
            LayoutError::Damaged { path, place, problem: format!("{problem}. Nothing was changed") }
        }
        other => other,
    })
}

fn read_state(terrain: &Terrain, known: &PageTable, page: &Page) -> Result<CheckedState, LayoutError> {
    let magic = get_u64(page, 0).to_le_bytes();
    let header = Header::parse_as(terrain.path(), page, magic)?;
    let directory = PageTable::open_beside(terrain.source(), &header, known)?;
    directory.check(terrain.source())?;
    if let Some(place) = header.imagery {
        Imagery::open_at(terrain, place, header.file_bytes)?;
    }
    Ok(CheckedState { differing: known.differing(&directory), directory })
}
