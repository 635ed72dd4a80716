//! Every foreign format: readers of elevation data, each of which turns one format into a [`DemSource`], and of pictures
//! ([`open_image`]); and [`synth`], which makes up terrain and pictures of it.
//!
//! ```
//! use terrasoar_import::synth::{SynthOptions, write};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("made-up.tif");
//! write(&SynthOptions::default().size(65), &path, &|_| {})?;
//! let dem = terrasoar_import::open_file(&path)?;
//! assert_eq!(dem.info().samples_wide, 65);
//! # Ok(())
//! # }
//! ```
//!
//! What comes out is for `terrasoar_layout::build`, and for `terrasoar_layout::imagery::drape`. The other way, [`export`] writes heights of a terrain as GeoTIFF,
//! and [`difference`] compares two.
//!
//! [`open`] looks at a file's first bytes and gives it to the reader of that format, whatever its
//! name. Formats without a signature are recognised by name, and by files beside them. Opening
//! reads headers, streaming reads samples. Nothing in a file is trusted: every size it declares is
//! checked against the length of the file before memory is taken for it.

mod ascii_grid;
mod beside;
mod bt;
mod cells;
mod crs;
pub mod difference;
mod dted;
pub mod export;
mod formats;
#[cfg(feature = "gdal")]
mod gdal;
mod geotiff;
mod grib;
mod guard;
mod heights;
mod hgt;
mod identify;
pub(crate) mod input;
mod jpeg2000;
pub(crate) mod jpeg_frame;
mod jpeg_rows;
mod jxl;
mod kept;
mod labelled;
mod mask;
mod mosaic;
mod netcdf;
mod opened;
mod openexr;
mod options;
mod parallel;
pub(crate) mod picture;
mod placement;
pub mod places;
mod plain;
mod png;
pub(crate) mod png_stream;
mod pnm;
mod raster;
mod raw;
mod reader;
mod shown;
mod strangers;
mod surfer;
pub mod synth;
mod text;
mod tiff_tags;
mod tiles;
mod usgs_dem;
mod value;
mod vrt;
mod warp;
mod webp;
mod xml;
mod xyz;

use std::path::{Path, PathBuf};

use terrasoar_layout::dem::DemSource;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::remedy::Remedy;

pub(crate) use geotiff::TiffImage;
pub(crate) use guard::guard;
pub use guard::is_guarded;
pub(crate) use identify::is_tiff;
pub use options::{Direction, OpenOptions, Priority, Resampling, TileOptions};
pub use picture::{open_image, open_images, open_images_on};
pub(crate) use png::{HEIGHT_SCALE_KEY as PNG_HEIGHT_SCALE_KEY, SPACING_KEY as PNG_SPACING_KEY};
pub use shown::{PictureOptions, Stretch};
pub use strangers::strangers;

/// Samples handed to a sink in one window, at most, unless a row has more: half a mebibyte of `f64`.
const WINDOW_SAMPLES: u64 = 1 << 16;

/// Opens the elevation data in `paths`: one file; several, folders and patterns as one mosaic; a pyramid of map tiles.
///
/// A file of several that is missing or damaged is left out, and the warnings name it.
///
/// The formats are those of `formats.rs`. Cost: the headers, and for GeoTIFF 16 bytes a chunk; no samples, but an XYZ grid is read once to find its grid, and of a
/// colour PNG the beginning to see whether heights are packed into it.
///
/// # Errors
/// [`LayoutError::Usage`] for no path, a pattern that fits nothing, or several files that make no grid together; [`LayoutError::Io`] for a file that is missing or cannot be read;
/// [`LayoutError::NotThisFormat`] for a file of none of these formats, saying what it is where that
/// can be told; [`LayoutError::Unsupported`] and [`LayoutError::Damaged`] from the reader.
pub fn open(paths: &[PathBuf]) -> Result<Box<dyn DemSource>, LayoutError> {
    open_with(paths, &OpenOptions::default())
}

/// As [`open`], with what a person knows and the file does not say.
///
/// # Errors
/// As [`open`]; [`LayoutError::Usage`] for options that do not go with the data.
pub fn open_with(paths: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn DemSource>, LayoutError> {
    let files = match mosaic::Inputs::of(paths)? {
        mosaic::Inputs::Several(files) => {
            tiles::check_asked(&files, &options.tiles)?;
            return mosaic::open(&files, options);
        }
        mosaic::Inputs::Alone(files) => files,
    };
    tiles::check_asked(&files, &options.tiles)?;
    // Tiles that could be one grid, where more is asked for than to join them.
    let is_made = options.feather_m.is_some() || options.resolution.is_some() && options.reproject.is_none();
    if files.len() > 1 && is_made {
        return mosaic::open(&files, options);
    }
    match mosaic::open_one(&files, options) {
        // Tiles of unlike shape, or of which some cannot be read.
        Err(error) if files.len() > 1 && !is_usage(&error) => mosaic::open(&files, options),
        Ok(_) if options.feather_m.is_some() => Err(LayoutError::Usage(
            "seams are blended between several files, and one was named; name the others, or leave that out".into(),
        )),
        Ok(_) if options.resolution.is_some() && options.reproject.is_none() => Err(LayoutError::Usage(
            "a resolution is for data that is brought into another system, and for several files; say which system"
                .into(),
        )
        .mended_by(Remedy::Reproject)),
        opened => Ok(Box::new(opened?)),
    }
}

/// Whether the request was wrong, and not a file.
fn is_usage(error: &LayoutError) -> bool {
    matches!(error, LayoutError::Usage(_) | LayoutError::Unmet { .. })
}

/// Other files that the elevation data at `path` is made of: those that a virtual raster names. What cannot be read names none.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    vrt::files_of(path)
}

/// As [`open`], of one file.
///
/// # Errors
/// As [`open`].
pub fn open_file(path: &Path) -> Result<Box<dyn DemSource>, LayoutError> {
    open(std::slice::from_ref(&path.to_owned()))
}
/// The program in README.md, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
