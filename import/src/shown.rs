//! How pictures are shown, as a person states it: which bands are colours, and which numbers are black and white.

use crate::OpenOptions;
use crate::options::TileOptions;
use std::num::NonZero;
use std::path::Path;
use terrasoar_layout::error::LayoutError;

/// What is lost where inks become light without a colour profile.
pub(crate) const PRESS_NOTE: &str = "its inks (CMYK) are shown as light by arithmetic, without a colour profile, so colours are brighter than in print";

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
    /// What of a pyramid of map tiles is read; without bounds it is what lies on the terrain.
    pub tiles: TileOptions,
}

impl PictureOptions {
    /// What the files beside a picture are read with.
    pub(crate) fn open_options(&self) -> OpenOptions {
        OpenOptions { memory_mib: self.memory_mib, ..OpenOptions::default() }
    }
}

/// The bands chosen, counted from 0, of a picture that has so many.
///
/// # Errors
/// [`LayoutError::Usage`] for neither one nor three, and for one that the picture does not have.
pub(crate) fn chosen_bands(path: &Path, has: u64, bands: &[NonZero<u32>]) -> Result<Vec<usize>, LayoutError> {
    let path = path.display();
    if !matches!(bands.len(), 0 | 1 | 3) {
        return Err(LayoutError::Usage(format!(
            "{} bands make no colours; name three, for red, green and blue, or one for grey",
            bands.len()
        )));
    }
    if let Some(band) = bands.iter().find(|band| u64::from(band.get()) > has) {
        let all = if has == 1 { "one band".to_owned() } else { format!("bands 1 to {has}") };
        return Err(LayoutError::Usage(format!("{path}: there is no band {band}; the picture has {all}")));
    }
    Ok(bands.iter().map(|band| band.get() as usize - 1).collect())
}
