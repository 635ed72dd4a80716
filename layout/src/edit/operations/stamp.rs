//! Stamps: heights from elsewhere, put on the ground sample by sample.

use super::area::each_sample;
use super::window::{HeightWindow, SampleRect};
use crate::error::LayoutError;
use crate::grid::Grid;
use crate::numbers::{MAX_HEIGHT_M, checked};
use std::fmt;
use std::sync::Arc;

/// Farthest sample from the south-west one that a stamp may be placed at.
const MAX_PLACE: i64 = 1 << 20;

/// Heights to be put on the ground.
#[derive(Clone, PartialEq)]
pub struct Stamp {
    /// The sample on which its own south-west sample comes, columns east and rows north; what lies outside the data is left out.
    pub at: [i64; 2],
    /// How heights meet the ground.
    pub mode: StampMode,
    samples: [u32; 2],
    /// Metres, rows from the south, west to east; not-a-numbers leave the ground as it is.
    heights_m: Arc<[f64]>,
}

/// How a stamp's heights meet the ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StampMode {
    /// They take its place.
    #[default]
    Set,
    /// They are added to it.
    Add,
    /// The ground is raised to them where it is lower.
    Max,
    /// The ground is lowered to them where it is higher.
    Min,
}

impl fmt::Debug for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [wide, high] = self.samples;
        write!(f, "Stamp({wide} x {high} at {:?}, {:?})", self.at, self.mode)
    }
}

impl Stamp {
    /// A stamp of `samples` (wide, high) heights in metres, rows from the south, not-a-numbers where the ground stays; its south-west sample comes on the
    /// sample `at`.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if there are more or fewer heights than samples, or none.
    pub fn new(
        at: [i64; 2],
        samples: [u32; 2],
        heights_m: impl Into<Arc<[f64]>>,
        mode: StampMode,
    ) -> Result<Self, LayoutError> {
        let heights_m = heights_m.into();
        let [wide, high] = samples;
        if heights_m.is_empty() || heights_m.len() as u64 != u64::from(wide) * u64::from(high) {
            return Err(LayoutError::Usage(format!(
                "stamp: {wide} x {high} samples take {} heights, not {}",
                u64::from(wide) * u64::from(high),
                heights_m.len()
            )));
        }
        Ok(Self { at, mode, samples, heights_m })
    }

    /// What it covers, whether or not there are data: west, south, east and north in metres.
    pub(crate) fn reach_m(&self, grid: &Grid) -> [f64; 4] {
        let [dx, dy] = grid.spacing_m();
        let [west, south] = self.at.map(|at| at as f64);
        let [wide, high] = self.samples.map(|count| f64::from(count.saturating_sub(1)));
        [west * dx, south * dy, (west + wide) * dx, (south + high) * dy]
    }

    /// The heights of a window set as they are.
    pub fn of_window(window: &HeightWindow) -> Self {
        let rect = window.rect();
        Self {
            at: [i64::from(rect.west), i64::from(rect.south)],
            mode: StampMode::Set,
            samples: [rect.wide(), rect.high()],
            heights_m: window.heights_m().into(),
        }
    }

    /// Samples wide and high.
    pub fn samples(&self) -> [u32; 2] {
        self.samples
    }

    /// Heights in metres, rows from the south, not-a-numbers where the ground stays.
    pub fn heights_m(&self) -> &[f64] {
        &self.heights_m
    }

    pub(crate) fn check(&self) -> Result<(), LayoutError> {
        for (field, at) in ["column it is placed at", "row it is placed at"].into_iter().zip(self.at) {
            let is_allowed = (-MAX_PLACE..=MAX_PLACE).contains(&at);
            checked("stamp", field, at as f64, is_allowed, "a sample from -1048576 to 1048576")?;
        }
        match self.heights_m.iter().find(|height| !height.is_nan() && height.abs() > MAX_HEIGHT_M) {
            Some(height) => checked("stamp", "height of a sample", *height, false, "metres from -1e7 to 1e7"),
            None => Ok(()),
        }
    }

    pub(crate) fn bounds(&self, grid: &Grid) -> Option<SampleRect> {
        let [x, y] = [0, 1].map(|axis| {
            let low = self.at[axis].max(0);
            let high = self.at[axis].saturating_add(i64::from(self.samples[axis]) - 1);
            let high = high.min(i64::from(grid.samples()[axis]) - 1);
            (low <= high).then_some([low as u32, high as u32])
        });
        let ([west, east], [south, north]) = (x?, y?);
        Some(SampleRect { west, south, east, north })
    }

    pub(crate) fn apply(&self, grid: &Grid, window: &mut HeightWindow) {
        let [wide, _] = self.samples;
        each_sample(window, self.bounds(grid), |x, y, ground| {
            // Within the bounds neither difference is negative.
            let column = (i64::from(x) - self.at[0]) as usize;
            let row = (i64::from(y) - self.at[1]) as usize;
            let height = self.heights_m[row * wide as usize + column];
            if !height.is_nan() {
                *ground = match self.mode {
                    StampMode::Set => height,
                    StampMode::Add => *ground + height,
                    StampMode::Max => ground.max(height),
                    StampMode::Min => ground.min(height),
                };
            }
        });
    }
}
