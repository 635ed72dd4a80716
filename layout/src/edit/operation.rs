//! What an edit does to heights: a region and a function from old heights to new ones.

use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;

/// One change of the ground. Positions are metres east and north of the south-west sample.
#[derive(Debug, Clone, PartialEq)]
pub enum Edit {
    /// The crater of a shell.
    Crater(Crater),
    /// All samples of a rectangle to one height.
    Set {
        /// The samples.
        rect: SampleRect,
        /// Their new height in metres.
        height_m: f64,
    },
}

/// A crater, after Xi et al. (position, direction, radius, depth).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crater {
    /// Its centre in metres east and north of the south-west sample.
    pub centre_m: [f64; 2],
    /// Where the shell flew to, degrees clockwise from north.
    pub direction_deg: f64,
    /// Radius of the bowl in metres. The rim reaches to twice that.
    pub radius_m: f64,
    /// Depth of the bowl's centre below the old ground in metres.
    pub depth_m: f64,
}

impl Edit {
    /// Checks that all numbers are usable.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] that says which is not.
    pub fn check(&self, grid: &Grid) -> Result<(), LayoutError> {
        let _ = grid;
        Ok(())
    }

    /// The samples that it may change; `None` if it lies wholly outside the data.
    pub fn bounds(&self, grid: &Grid) -> Option<SampleRect> {
        let _ = grid;
        match self {
            Self::Set { rect, .. } => Some(*rect),
            Self::Crater(_) => None,
        }
    }

    /// Samples around its bounds whose heights it looks at.
    pub fn margin(&self) -> u32 {
        0
    }

    /// Whether it looks at the heights before all edits.
    pub fn needs_original(&self) -> bool {
        false
    }

    /// Changes the heights of `window`, which covers its bounds and the margin around them as far as the data goes. `original` are the heights before all
    /// edits of the same rectangle, if it needs them. Voids (NaN) stay as they are.
    pub fn apply(&self, grid: &Grid, window: &mut HeightWindow, original: Option<&HeightWindow>) {
        let _ = (grid, original);
        if let Self::Set { rect, height_m } = self {
            let inner = window.rect();
            for y in inner.south..=inner.north {
                for x in inner.west..=inner.east {
                    let at = window.index(x, y);
                    let height = &mut window.heights_m_mut()[at];
                    if rect.contains(x, y) && !height.is_nan() {
                        *height = *height_m;
                    }
                }
            }
        }
    }
}
