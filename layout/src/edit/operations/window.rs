//! Rectangles of samples, and their heights.

use crate::error::LayoutError;
use crate::grid::Grid;

/// A rectangle of samples, both corners included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SampleRect {
    /// Westernmost column.
    pub west: u32,
    /// Southernmost row.
    pub south: u32,
    /// Easternmost column, at least `west`.
    pub east: u32,
    /// Northernmost row, at least `south`.
    pub north: u32,
}

impl SampleRect {
    /// Samples from west to east.
    pub fn wide(&self) -> u32 {
        self.east - self.west + 1
    }

    /// Samples from south to north.
    pub fn high(&self) -> u32 {
        self.north - self.south + 1
    }

    /// Number of samples.
    pub fn count(&self) -> usize {
        self.wide() as usize * self.high() as usize
    }

    /// Whether it holds a sample.
    #[inline(always)]
    pub fn contains(&self, x: u32, y: u32) -> bool {
        (self.west..=self.east).contains(&x) && (self.south..=self.north).contains(&y)
    }

    /// The rectangle with `margin` more samples on each side, as far as the data goes.
    #[must_use]
    pub fn grown(&self, margin: u32, grid: &Grid) -> Self {
        let [wide, high] = grid.samples();
        Self {
            west: self.west.saturating_sub(margin),
            south: self.south.saturating_sub(margin),
            east: self.east.saturating_add(margin).min(wide - 1),
            north: self.north.saturating_add(margin).min(high - 1),
        }
    }
}

/// Heights of a rectangle of samples, voids NaN.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightWindow {
    rect: SampleRect,
    /// Metres, row by row from the south, west to east.
    heights_m: Vec<f64>,
}

impl HeightWindow {
    /// A window over `rect` with these heights in metres, rows from the south, voids NaN.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if there are more or fewer heights than samples.
    pub fn new(rect: SampleRect, heights_m: Vec<f64>) -> Result<Self, LayoutError> {
        if heights_m.len() != rect.count() {
            return Err(LayoutError::Usage(format!(
                "a window of {} x {} samples takes {} heights, not {}",
                rect.wide(),
                rect.high(),
                rect.count(),
                heights_m.len()
            )));
        }
        Ok(Self { rect, heights_m })
    }

    /// Where it lies.
    pub fn rect(&self) -> SampleRect {
        self.rect
    }

    /// Heights in metres, rows from the south.
    pub fn heights_m(&self) -> &[f64] {
        &self.heights_m
    }

    /// Heights in metres, rows from the south, to be changed.
    pub fn heights_m_mut(&mut self) -> &mut [f64] {
        &mut self.heights_m
    }

    /// Index of a sample in the heights. The sample must lie in the window.
    #[inline(always)]
    pub fn index(&self, x: u32, y: u32) -> usize {
        (y - self.rect.south) as usize * self.rect.wide() as usize + (x - self.rect.west) as usize
    }

    /// Height in metres of a sample of the window.
    #[inline(always)]
    pub fn height_m(&self, x: u32, y: u32) -> f64 {
        self.heights_m[self.index(x, y)]
    }
}
