//! SRTM height tiles (`.hgt`): one, or a mosaic of neighbours.
//!
//! A tile has no header: `side * side` big-endian 16-bit heights in metres from the north-west corner,
//! rows eastwards, covering one degree each way *including* both borders, void -32768. Its name says
//! its south-west corner. Neighbours repeat their common border, so a mosaic of `n` tiles in a line has
//! `n * (side - 1) + 1` samples. The grid spans the tiles' bounding box; what no tile covers is void.

mod mosaic;
mod name;

use std::path::{Path, PathBuf};

use crate::reader::{CrsSaid, Declared, Reader, Said};
use mosaic::Mosaic;
use terrasoar_layout::dem::{SampleSink, SampleType};
use terrasoar_layout::error::LayoutError;

/// One or several `.hgt` tiles.
#[derive(Debug)]
pub(super) struct HgtDem {
    declared: Declared,
    mosaic: Mosaic,
}

/// Samples along a side of the tile at `path`, from its length.
pub(super) fn side_of(path: &Path, file_bytes: u64) -> Result<u32, LayoutError> {
    let side = (file_bytes / 2).isqrt();
    match u32::try_from(side) {
        Ok(side @ 2..) if u64::from(side).pow(2) * 2 == file_bytes => Ok(side),
        _ => Err(LayoutError::not_this_format(
            path,
            format!(
                "{file_bytes} bytes are no square of 16-bit heights, so this is no .hgt tile or it is cut short (1201 x \
                 1201 heights are 2884802 bytes, 3601 x 3601 are 25934402); fetch it again, and unpack it if it is an archive"
            ),
        )),
    }
}

impl HgtDem {
    /// Places the tiles; reads only their lengths.
    pub(super) fn open(paths: &[PathBuf]) -> Result<Self, LayoutError> {
        let mosaic = Mosaic::place(paths)?;
        let step = 1.0 / f64::from(mosaic.side - 1);
        let format = match paths.len() {
            1 => format!("SRTM .hgt, {0} x {0}", mosaic.side),
            tiles => format!("mosaic of {tiles} SRTM .hgt tiles, {0} x {0} each", mosaic.side),
        };
        let mut declared = Declared::new([mosaic.samples_wide, mosaic.samples_high], SampleType::I16, format);
        declared.crs = CrsSaid { code: Some(Said::new(4326, "the format .hgt")), ..CrsSaid::default() };
        match mosaic.north_west {
            Some((north, west)) => {
                declared.place = Some(Said::new([west, step, 0.0, north, 0.0, -step], "the file's name"));
            }
            // The tile is a degree wide wherever it is, but how many metres that is depends on its latitude.
            None => declared.crs.name = "WGS 84, one degree square at an unknown place".into(),
        }
        Ok(Self { declared, mosaic })
    }
}

impl Reader for HgtDem {
    fn declared(&self) -> &Declared {
        &self.declared
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.mosaic.stream(sink)
    }
}
