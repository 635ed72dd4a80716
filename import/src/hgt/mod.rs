//! SRTM height tiles (`.hgt`): one, or a mosaic of neighbours.
//!
//! A tile has no header: `side * side` big-endian 16-bit heights in metres from the north-west corner,
//! rows eastwards, covering one degree each way *including* both borders, void -32768. Its name says
//! its south-west corner. Neighbours repeat their common border, so a mosaic of `n` tiles in a line has
//! `n * (side - 1) + 1` samples. The grid spans the tiles' bounding box; what no tile covers is void.

mod mosaic;
mod name;

use std::path::{Path, PathBuf};

use mosaic::Mosaic;
use terrasoar_layout::dem::{DemInfo, DemSource, Georeference, HorizontalUnit, SampleSink, SampleType};
use terrasoar_layout::error::LayoutError;

/// One or several `.hgt` tiles.
#[derive(Debug)]
pub(super) struct HgtDem {
    info: DemInfo,
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
        let (crs_name, pixel_to_crs) = match mosaic.north_west {
            Some((north, west)) => ("WGS 84".into(), Some([west, step, 0.0, north, 0.0, -step])),
            // The tile is a degree wide wherever it is, but how many metres that is depends on its latitude.
            None => ("WGS 84, one degree square at an unknown place".into(), None),
        };
        let info = DemInfo {
            samples_wide: mosaic.samples_wide,
            samples_high: mosaic.samples_high,
            sample_type: SampleType::I16,
            height_scale: 1.0,
            height_offset_m: 0.0,
            georeference: Georeference {
                epsg: Some(4326),
                crs_name,
                unit: HorizontalUnit::Degree,
                pixel_to_crs,
                body_radius_m: None,
            },
            format: match paths.len() {
                1 => format!("SRTM .hgt, {0} x {0}", mosaic.side),
                tiles => format!("mosaic of {tiles} SRTM .hgt tiles, {0} x {0} each", mosaic.side),
            },
        };
        Ok(Self { info, mosaic })
    }
}

impl DemSource for HgtDem {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.mosaic.stream(sink)
    }
}
