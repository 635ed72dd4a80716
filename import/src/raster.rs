//! Numbers in rows and columns, read window by window; the samples of a terrain as such.
//!
//! Each window is read by one of as many readers as there are threads at work, each of which keeps pages (`layout::read::heights`). Pages are checked.

use std::sync::{Mutex, PoisonError};
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::grid::Grid;
use terrasoar_layout::read::heights::Heights;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

/// Numbers in rows and columns, read window by window from any number of threads.
pub(crate) trait Raster: Sync {
    /// Columns and rows.
    fn size(&self) -> [u32; 2];

    /// The numbers of a window, rows from the north, in `into`, whatever was in it; NaN where there is none.
    fn read(&self, window: Window, into: &mut Vec<f64>) -> Result<(), LayoutError>;

    /// Whether it is known at little cost that a window has no number.
    fn has_nothing(&self, window: Window) -> Result<bool, LayoutError>;
}

/// The samples of a window of a terrain.
pub(crate) struct TerrainSamples<'t> {
    terrain: &'t Terrain,
    window: SampleWindow,
    /// Readers that nobody uses now.
    idle: Mutex<Vec<Heights<'t>>>,
}

impl<'t> TerrainSamples<'t> {
    /// The samples of `window`.
    pub(crate) fn new(terrain: &'t Terrain, window: SampleWindow) -> Result<Self, LayoutError> {
        let samples = Self { terrain, window, idle: Mutex::new(Vec::new()) };
        // What does not lie in the terrain is refused before anything is written.
        samples.with_reader(|reader| reader.samples(&window.part([0; 2], [1; 2]), &mut Vec::new()))?;
        let [column, row] = [window.size[0].saturating_sub(1), window.size[1].saturating_sub(1)];
        samples.with_reader(|reader| reader.samples(&window.part([column, row], [1; 2]), &mut Vec::new()))?;
        Ok(samples)
    }

    /// The grid that they are of.
    pub(crate) fn grid(&self) -> &Grid {
        self.terrain.grid()
    }

    /// Whether none of the samples of a part of its window has a height.
    pub(crate) fn is_void(&self, Window { col, row, width, height }: Window) -> Result<bool, LayoutError> {
        let part = self.window.part([col, self.window.size[1] - row - height], [width, height]);
        self.with_reader(|reader| reader.is_void(&part))
    }

    /// Runs `read` with a reader that nobody else uses meanwhile.
    pub(crate) fn with_reader<T>(&self, read: impl FnOnce(&mut Heights<'t>) -> T) -> T {
        let idle = || self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = idle().pop();
        let mut reader = kept.unwrap_or_else(|| Heights::new(self.terrain));
        let told = read(&mut reader);
        idle().push(reader);
        told
    }
}

impl Raster for TerrainSamples<'_> {
    fn size(&self) -> [u32; 2] {
        self.window.size
    }

    fn has_nothing(&self, window: Window) -> Result<bool, LayoutError> {
        self.is_void(window)
    }

    fn read(&self, window: Window, into: &mut Vec<f64>) -> Result<(), LayoutError> {
        let Window { col, row, width, height } = window;
        let south = self.window.size[1] - row - height;
        let part = self.window.part([col, south], [width, height]);
        self.with_reader(|reader| reader.samples(&part, into))?;
        // Rows come from the south.
        let width = width as usize;
        for row in 0..height as usize / 2 {
            let (low, high) = into.split_at_mut((height as usize - 1 - row) * width);
            low[row * width..(row + 1) * width].swap_with_slice(&mut high[..width]);
        }
        Ok(())
    }
}
