//! SRTM height tiles (`.hgt`): one, or a mosaic of neighbours; packed ones, archives and folders of them.
//!
//! A tile has no header: big-endian 16-bit heights in metres from the north-west corner, rows eastwards, covering one degree each way *including* both borders,
//! void -32768. Its length says how many ([`shape`]), its name its south-west corner. Neighbours repeat their common border, so a mosaic of `n` tiles in a line has
//! `n * (side - 1) + 1` samples. The grid spans the tiles' bounding box; what no tile covers is void.

mod folder;
mod mosaic;
mod name;
mod shape;
mod tile;
mod unpacked;

use std::path::PathBuf;

use crate::reader::{CrsSaid, Declared, HorizontalSize, Reader, Said};
pub(crate) use folder::{each_once, files_in, tiles_in};
use mosaic::Mosaic;
use terrasoar_layout::dem::{SampleSink, SampleType, Warning};
use terrasoar_layout::error::LayoutError;
use tile::Tile;
pub(crate) use tile::{has_tiles, is_tile};

/// One or several `.hgt` tiles.
#[derive(Debug)]
pub(super) struct HgtDem {
    declared: Declared,
    mosaic: Mosaic,
}

impl HgtDem {
    /// Places the tiles, which have the `stated` columns and rows if a person states them; reads only their lengths. A tile of several that cannot be read later is void, or an error where this
    /// is `strict`.
    pub(super) fn open(
        paths: &[PathBuf],
        stated: Option<[u32; 2]>,
        strict: bool,
    ) -> Result<Self, LayoutError> {
        let mut tiles = Vec::new();
        for path in paths {
            tiles.extend(Tile::all_of(path, stated)?);
        }
        let count = tiles.len();
        let mut mosaic = Mosaic::place(tiles)?;
        mosaic.strict = strict;
        let [wide, high] = mosaic.sides;
        let format = match count {
            1 => format!("SRTM .hgt, {wide} x {high}"),
            tiles => format!("mosaic of {tiles} SRTM .hgt tiles, {wide} x {high} each"),
        };
        let mut declared = Declared::new([mosaic.samples_wide, mosaic.samples_high], SampleType::I16, format);
        declared.crs = CrsSaid {
            code: Some(Said::new(4326, "the format .hgt")),
            unit: Some(Said::new(HorizontalSize::Radians(1f64.to_radians()), "the format .hgt")),
            ..CrsSaid::default()
        };
        match mosaic.north_west {
            Some((north, west)) => {
                if wide % 2 == 0 || high % 2 == 0 {
                    declared.warnings.push(Warning::new(format!(
                        "a tile of {wide} x {high} heights is none that is known, for those with both borders of their degree have odd numbers; both borders were taken to be in it, so places may be off by up to a step"
                    )));
                }
                let [across, down] = [wide, high].map(|side| 1.0 / f64::from(side - 1));
                declared.place = Some(Said::new([west, across, 0.0, north, 0.0, -down], "the file's name"));
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

    fn warnings(&self) -> Vec<Warning> {
        self.mosaic.warnings()
    }

    fn memory_bytes(&self) -> u64 {
        self.mosaic.memory_bytes()
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        self.mosaic.stream(sink)
    }
}
