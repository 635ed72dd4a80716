//! Terrain edited while it is flown over: heights of a region change, and the records of the region and its ancestors follow, exactly as if the file were built
//! from the edited heights.
//!
//! An [`Edit`] turns old heights into new ones; an [`Editor`] makes records of them, in memory. `update` and `farthest` say which records an edit reaches, and why only few of them have to be looked at.
//! Based on: M. Liao, F. Xu, X. He, "Improvement on Dynamic Tiled Terrain Rendering Algorithm in libMini", section 3: the update from the bottom up, here for saturated error bounds and nested spheres.
//!
//! Voids stay voids and samples stay samples: edits pass over voids, whose filled-in heights stay as they are, so that no vertex changes its class.
//!
//! Invariant: after any batch every record is the one that a build in the file's own scale makes of the edited heights; a batch that fails changes nothing.

mod engine;
pub(crate) mod operations;
#[cfg(feature = "files")]
mod session;

#[cfg(feature = "files")]
pub use engine::foresight::{Foresight, holds_heights};
pub use operations::area::{Area, Limit};
pub use operations::brush::{Brush, BrushAction, Falloff};
pub use operations::check::MAX_EDIT_SAMPLES;
pub use operations::crater::Crater;
pub use operations::edit::Edit;
pub use operations::line::{Crest, Line, MAX_LINE_PLACES};
pub use operations::stamp::{Stamp, StampMode};
pub use operations::window::{HeightWindow, SampleRect};
#[cfg(feature = "files")]
pub use session::beside::overlays_beside;
#[cfg(feature = "files")]
pub use session::commit::CommitJob;
#[cfg(feature = "files")]
pub use session::compact::{Compacted, compact, compact_packed};
#[cfg(feature = "files")]
pub use session::picture::Repainted;
#[cfg(feature = "files")]
pub use session::widen::{room_for, widen};
#[cfg(feature = "files")]
pub use session::{Committed, EditSession, HistoryEntry, history};

use crate::error::LayoutError;
use crate::file::bytes::Page;
use crate::file::entries::Entry;
use crate::file::header::Header;
use crate::grid::GridPoint;
use crate::grid::record::{Compact, Exact8, Exact16, Vertex};
use crate::read::kinds::ByKind;
use crate::read::terrain::Terrain;
use crate::with_records;
use engine::core::{Core, Replacement};
use std::sync::Arc;

/// What a batch of edits, an undo or a redo changed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Changes {
    /// Vertices whose record is another one now, each once, padding included.
    pub vertices: Vec<GridPoint>,
    /// Rectangles that hold all samples whose height changed.
    pub samples: Vec<SampleRect>,
    /// Logical pages that hold these records, ascending.
    pub pages: Vec<u64>,
    /// Voids that the edits passed over.
    pub voids_passed: u64,
}

/// A terrain with edits in memory: pages that differ from the file's, and the way from new heights to new records.
#[derive(Debug)]
pub struct Editor {
    core: ByKind<Core<Compact>, Core<Exact8>, Core<Exact16>>,
}

impl Editor {
    /// An editor over `terrain`, without edits.
    pub fn new(terrain: Arc<Terrain>) -> Self {
        let (grid, scale) = (*terrain.grid(), terrain.header().scale);
        let core = match terrain.header().record_kind {
            crate::grid::record::RecordKind::Compact | crate::grid::record::RecordKind::Fine => {
                ByKind::Compact(Core::new(terrain, Compact::new(&grid, &scale)))
            }
            crate::grid::record::RecordKind::Exact8 => {
                ByKind::Exact8(Core::new(terrain, Exact8::new(&grid, &scale)))
            }
            crate::grid::record::RecordKind::Exact16 => {
                ByKind::Exact16(Core::new(terrain, Exact16::new(&grid, &scale)))
            }
        };
        Self { core }
    }

    /// States what [`Edit::Restore`](Edit) restores; without it, the terrain under the edits.
    pub fn set_original(&mut self, original: Arc<Terrain>) {
        with_records!(&mut self.core, core => core.set_original(original));
    }

    /// Applies a batch, all of it or, on an error, nothing.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for numbers that cannot be used; [`LayoutError::OutOfRange`] if the file's records cannot hold the result; damage and I/O of
    /// pages that it needs.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Changes, LayoutError> {
        with_records!(&mut self.core, core => core.apply(edits))
    }

    /// Sets the heights of a window, all of it or, on an error, nothing. Voids are passed over; a height that is not a number leaves its sample as it is.
    ///
    /// # Errors
    /// As [`Editor::apply`].
    pub fn set_heights(&mut self, window: &HeightWindow) -> Result<Changes, LayoutError> {
        with_records!(&mut self.core, core => core.set_heights(window))
    }

    /// Heights of the samples of `rect` as they are now.
    ///
    /// # Errors
    /// Damage and I/O of the pages that hold them; [`LayoutError::Usage`] if it reaches beyond the data.
    pub fn heights(&mut self, rect: SampleRect) -> Result<HeightWindow, LayoutError> {
        with_records!(&mut self.core, core => core.heights(rect))
    }

    /// One vertex as it is now.
    ///
    /// # Errors
    /// Damage and I/O of the page that holds it; [`LayoutError::Usage`] for a point outside the square.
    pub fn vertex(&mut self, p: GridPoint) -> Result<Vertex, LayoutError> {
        let n = self.terrain().grid().side_steps();
        if p.x() > n || p.y() > n {
            return Err(LayoutError::Usage(format!(
                "sample ({}, {}) lies outside the terrain",
                p.x(),
                p.y()
            )));
        }
        with_records!(&mut self.core, core => core.vertex(p))
    }

    /// The page with its edits, from the batch that changed it until the next one; `None` if it is the terrain's own, and perhaps if it was committed before: [`Editor::page`] reads that back.
    pub fn edited_page(&self, logical_page: u64) -> Option<&Page> {
        with_records!(&self.core, core => core.edited_page(logical_page))
    }

    /// Any page as it is now.
    ///
    /// # Errors
    /// Damage and I/O; [`LayoutError::Usage`] for a page that the terrain has not.
    pub fn page(&mut self, logical_page: u64) -> Result<&Page, LayoutError> {
        with_records!(&mut self.core, core => core.page(logical_page))
    }

    /// Logical pages that are, or once were, other than the terrain's, ascending.
    pub fn edited_pages(&self) -> Vec<u64> {
        with_records!(&self.core, core => core.all_edited())
    }

    /// Pages in memory: those that are not committed, and a bounded number of others.
    pub fn held_pages(&self) -> usize {
        with_records!(&self.core, core => core.held_pages())
    }

    /// Keeps at most so many pages in memory, after each batch, that can be read again from the file; default 16,384, which are 64 MiB.
    pub fn keep_at_most(&mut self, pages: usize) {
        with_records!(&mut self.core, core => core.keep_at_most(pages));
    }

    /// Logical pages edited since the last commit, ascending.
    pub fn uncommitted(&self) -> Vec<u64> {
        with_records!(&self.core, core => core.uncommitted())
    }

    /// Takes back everything since the last commit.
    pub fn roll_back(&mut self) -> Changes {
        with_records!(&mut self.core, core => core.roll_back())
    }

    /// All that is not committed is on its way into the file.
    pub(super) fn begin_commit(&mut self) {
        with_records!(&mut self.core, core => core.begin_commit());
    }

    /// It is in the file, each page at the place that its new entry says.
    pub(super) fn end_commit(&mut self, places: &[(u64, Entry)]) {
        with_records!(&mut self.core, core => core.end_commit(places));
    }

    /// It is not, and is uncommitted again.
    pub(super) fn fail_commit(&mut self) {
        with_records!(&mut self.core, core => core.fail_commit());
    }

    /// Whether [`Editor::set_original`] was called.
    pub(super) fn has_original(&self) -> bool {
        with_records!(&self.core, core => core.has_original())
    }

    /// Gets ready to put the contents into pages that the file has at other places, as undoing does, and to take over the range of heights of `header`. Nothing changes yet.
    fn replacement(&mut self, places: &[(u64, Entry)], header: &Header) -> Result<Replacement, LayoutError> {
        with_records!(&mut self.core, core => core.replacement(places, header))
    }

    /// Does that; it cannot fail. What changed is found by comparing records.
    fn replace(&mut self, replacement: Replacement) -> Changes {
        with_records!(&mut self.core, core => core.replace(replacement))
    }

    /// The terrain's header with the range of heights as edits have widened it.
    pub fn header(&self) -> &Header {
        with_records!(&self.core, core => core.header())
    }

    /// The terrain under the edits.
    pub fn terrain(&self) -> &Arc<Terrain> {
        with_records!(&self.core, core => core.terrain())
    }
}
