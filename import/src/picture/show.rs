//! How pictures are shown, as a person states it: which bands are colours, and which numbers are black and white.

use crate::OpenOptions;
use std::num::NonZero;

/// Which numbers of a picture become black and white; those between lie on a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stretch {
    /// So many percent of the texels are black, and so many not yet white: 2 and 98. Each band by itself, all pictures together.
    Percentiles(f64, f64),
    /// These numbers, for all bands.
    Values(f64, f64),
}

/// How to show pictures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PictureOptions {
    /// Bands counted from 1: that of grey, or those of red, green and blue. Empty: as the picture says.
    pub bands: Vec<NonZero<u32>>,
    /// Black and white, of pictures of any numbers. Without it bytes are shown as they are, and of 16 bits the upper eight of those in use.
    pub stretch: Option<Stretch>,
    /// Memory in MiB that looking for percentiles may take; without it 512.
    pub memory_mib: Option<u64>,
}

impl PictureOptions {
    /// What the files beside a picture are read with.
    pub(super) fn open_options(&self) -> OpenOptions {
        OpenOptions { memory_mib: self.memory_mib, ..OpenOptions::default() }
    }
}
