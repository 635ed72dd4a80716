//! Every foreign format: readers of elevation data, each of which turns one format into a [`DemSource`], and of pictures
//! ([`open_image`]); and [`synth`], which makes up terrain and pictures of it.
//!
//! ```
//! use terrasoar_import::synth::{SynthOptions, write};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("made-up.tif");
//! write(&SynthOptions { size: 65, ..Default::default() }, &path, &|_| {})?;
//! let dem = terrasoar_import::open_file(&path)?;
//! assert_eq!(dem.info().samples_wide, 65);
//! # Ok(())
//! # }
//! ```
//!
//! What comes out is for `terrasoar_layout::build`, and for `terrasoar_layout::imagery::drape`.
//!
//! [`open`] looks at a file's first bytes, never at its name, and hands it to the one reader that
//! knows them; only `.hgt` tiles have no signature and are known by extension and size. Opening
//! reads headers, streaming reads samples. Nothing in a file is trusted: every size it declares is
//! held against the length of the file before memory is taken for it.

mod beside;
mod bt;
mod crs;
mod geotiff;
mod guard;
mod hgt;
mod identify;
pub(crate) mod input;
pub(crate) mod jpeg_frame;
mod mask;
mod opened;
mod options;
mod parallel;
pub(crate) mod picture;
mod placement;
pub mod places;
mod png;
pub(crate) mod png_stream;
mod reader;
pub mod synth;
mod value;
mod warp;

use std::path::{Path, PathBuf};

use identify::Format;
use reader::Reader;
use terrasoar_layout::dem::DemSource;
use terrasoar_layout::error::LayoutError;

pub(crate) use geotiff::TiffImage;
pub(crate) use guard::guard;
pub use guard::is_guarded;
pub(crate) use identify::is_tiff;
pub use options::{Direction, OpenOptions, Resampling};
pub use picture::open_image;
pub(crate) use png::{HEIGHT_SCALE_KEY as PNG_HEIGHT_SCALE_KEY, SPACING_KEY as PNG_SPACING_KEY};

/// Samples handed to a sink in one window, at most, unless a row has more: half a mebibyte of `f64`.
const WINDOW_SAMPLES: u64 = 1 << 16;

/// Opens the elevation data in `paths`: one file, or several `.hgt` tiles as one mosaic.
///
/// Read are 16-bit and 8-bit grey PNG, VTP BT 1.0 to 1.3, SRTM `.hgt` and GeoTIFF (BigTIFF and
/// cloud-optimised ones included). Cost: the headers, and for GeoTIFF 16 bytes a chunk; no samples.
///
/// # Errors
/// [`LayoutError::Usage`] for no path, or for several that are not all `.hgt` tiles of one
/// resolution; [`LayoutError::Io`] for a file that is missing or cannot be read;
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
    let reader = reader_of(paths, options)?;
    let path = paths.first().map(PathBuf::as_path).unwrap_or(Path::new(""));
    let beside = beside::Beside::of(paths, &*reader);
    Ok(Box::new(opened::OpenedDem::new(path, reader, beside, options)?))
}

/// The reader that knows the format.
fn reader_of(paths: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
    let [path] = paths else {
        return open_mosaic(paths);
    };
    Ok(match identify::identify(path)? {
        Format::Png => Box::new(png::PngDem::open(path)?),
        Format::Bt => Box::new(bt::BtDem::open(path)?),
        Format::Tiff => Box::new(geotiff::TiffDem::open(path, options)?),
        Format::Hgt => Box::new(hgt::HgtDem::open(paths)?),
    })
}

/// As [`open`], of one file.
///
/// # Errors
/// As [`open`].
pub fn open_file(path: &Path) -> Result<Box<dyn DemSource>, LayoutError> {
    open(std::slice::from_ref(&path.to_owned()))
}

/// Several files make one data set only if every one is an `.hgt` tile, whose name says where it lies.
fn open_mosaic(paths: &[PathBuf]) -> Result<Box<dyn Reader>, LayoutError> {
    if paths.is_empty() {
        return Err(LayoutError::Usage(
            "no elevation file was named; name one, or several .hgt tiles".into(),
        ));
    }
    for path in paths {
        let format = identify::identify(path)?;
        if format != Format::Hgt {
            return Err(LayoutError::Usage(format!(
                "{}: several inputs are read together only if all of them are .hgt tiles, and this is a {} file; \
                 merge the files first, for example with: gdalbuildvrt all.vrt FILES && gdal_translate all.vrt all.tif",
                path.display(),
                format.name()
            )));
        }
    }
    Ok(Box::new(hgt::HgtDem::open(paths)?))
}

/// The program in README.md, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
