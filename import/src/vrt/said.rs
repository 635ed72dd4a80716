//! What a virtual raster says: its grid, its bands, and what each is made of.

use super::change::Change;
use crate::options::Resampling;
use std::path::PathBuf;
use terrasoar_layout::dem::SampleType;

/// A virtual raster.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Vrt {
    pub(super) samples: [u32; 2],
    /// From corners of samples to coordinates.
    pub(super) corners: Option<[f64; 6]>,
    pub(super) system: Option<String>,
    /// Whether it is placed by ground control points alone.
    pub(super) by_points: bool,
    pub(super) band: Band,
    pub(super) mask: Option<Band>,
}

/// One band, or the mask.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Band {
    /// Its number, counted from 1.
    pub(super) number: u32,
    pub(super) sample_type: SampleType,
    /// The number that means "no data", unless the file hides it.
    pub(super) nodata: Option<String>,
    pub(super) scale: Option<f64>,
    pub(super) offset: Option<f64>,
    pub(super) unit: Option<String>,
    /// From the lowest to the highest.
    pub(super) sources: Vec<Source>,
}

/// What is read of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// A band, counted from 1.
    Band(u32),
    /// The mask of a band: 255 where there is data, else 0.
    Mask(u32),
}

/// A piece of a file, and where it goes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Source {
    pub(super) file: PathBuf,
    pub(super) part: Part,
    /// Columns and rows of the file: west, north, width, height, counted from corners of samples. All of it without them.
    pub(super) from: Option<[f64; 4]>,
    /// The same of the virtual raster; without them they are those of the file.
    pub(super) to: Option<[f64; 4]>,
    pub(super) resampling: Resampling,
    /// What becomes of its numbers; none where they are taken as they are, voids and all.
    pub(super) change: Option<Change>,
}
