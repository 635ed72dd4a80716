//! A terrain opened together with an overlay of edits (see [`overlay`](crate::file::overlay)), so that both read as one file.

use super::opened::Opened;
use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::overlay::Overlaid;
use crate::file::page_table::PageTable;
use crate::file::source::{MapSource, PreadSource};
use crate::file::structure::read_growing;
use std::path::Path;

/// The base with its overlay as one terrain.
fn open_layers(base: &Path, overlay: &Path, is_mapped: bool) -> Result<Terrain, LayoutError> {
    let mut base_file = Opened::of(PreadSource::open(base)?)?;
    // The base must be a sound terrain by itself.
    read_growing(base_file.source_mut())?;
    let mut overlay_file = PreadSource::open(overlay)?;
    let overlaid = Overlaid::read(base_file.source_mut(), &mut overlay_file)?;
    let source = if is_mapped {
        overlaid.source(base_file.into_lender()?, Box::new(MapSource::map(overlay_file)?))
    } else {
        overlaid.source(base_file.into_source(), Box::new(overlay_file))
    }?;
    let table = PageTable::open(&*source, &overlaid.slots.header)?;
    Ok(Terrain::of(source, overlaid.slots.header, table))
}

impl Terrain {
    /// Opens the terrain file `base` with the edits in `overlay` (see [`EditSession::open_overlay`](crate::edit::EditSession::open_overlay)). Both are mapped.
    ///
    /// # Errors
    /// As [`Terrain::open`] of either; [`LayoutError::Usage`] if the overlay was made over another terrain, or if the base was written anew since. One that was edited or draped since is
    /// seen as it was ([`Terrain::base_has_grown`]).
    pub fn open_with_overlay(base: &Path, overlay: &Path) -> Result<Self, LayoutError> {
        open_layers(base, overlay, true)
    }

    /// As [`Terrain::open_with_overlay`], without maps.
    ///
    /// # Errors
    /// As [`Terrain::open_with_overlay`].
    pub fn open_with_overlay_unmapped(base: &Path, overlay: &Path) -> Result<Self, LayoutError> {
        open_layers(base, overlay, false)
    }

    /// The terrain file under an overlay; none if there is no overlay, whose name [`Terrain::path`] is then.
    pub fn base_path(&self) -> Option<&Path> {
        self.source().base_path()
    }

    /// Whether the terrain file under an overlay was edited, draped or undone after the overlay was made. It is seen as it was then.
    pub fn base_has_grown(&self) -> bool {
        self.source().base_has_grown()
    }

    /// Opens the file, with its overlay if it has one, once more, without maps.
    ///
    /// # Errors
    /// As [`Terrain::open`].
    pub fn open_again_unmapped(&self) -> Result<Self, LayoutError> {
        match self.source().base_path() {
            Some(base) => Self::open_with_overlay_unmapped(base, self.path()),
            None => Self::open_unmapped(self.path()),
        }
    }
}
