//! The formats that are read, one a line: how each is known, and what opens it.
//!
//! They are tried in this order: signatures first, then what a label beside a file says, then names. A file that no line knows is looked up among formats that are not read ([`crate::strangers`]).

use crate::identify::{self, Look};
use crate::reader::Reader;
use crate::strangers;
use crate::{
    OpenOptions, ascii_grid, bt, dted, geotiff, grib, hgt, labelled, netcdf, openexr, png, pnm, raw, surfer,
    tiles, usgs_dem, vrt, xyz,
};
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;

type Opens = fn(&Path, &OpenOptions) -> Result<Box<dyn Reader>, LayoutError>;

/// A format that is read.
struct Format {
    /// Its name in messages.
    name: &'static str,
    is: fn(&Look<'_>) -> bool,
    open: Opens,
}

/// Formats with a signature.
const SIGNED: &[Format] = &[
    Format {
        name: "PNG",
        is: |look| look.begins(b"\x89PNG\r\n\x1a\n"),
        open: |path, options| boxed(png::PngDem::open(path, options)),
    },
    Format {
        name: "VTP BT",
        is: |look| look.begins(b"binterr"),
        open: |path, _| boxed(bt::BtDem::open(path)),
    },
    Format {
        name: "TIFF",
        is: |look| identify::is_tiff(&look.head),
        open: |path, options| boxed(geotiff::TiffDem::open(path, options)),
    },
    Format { name: "virtual raster (.vrt)", is: |look| vrt::is_vrt(&look.head), open: virtual_raster },
    Format {
        name: "netCDF",
        is: |look| netcdf::is_netcdf(&look.head),
        open: |path, options| boxed(netcdf::NetcdfDem::open(path, options)),
    },
    Format {
        name: "GRIB",
        is: |look| {
            let is_called = ["grib2", "grib", "grb2", "grb"].iter().any(|name| look.is_called(name));
            grib::is_grib(&look.head, is_called)
        },
        open: grib,
    },
    Format {
        name: "DTED",
        is: |look| dted::is_dted(&look.head),
        open: |path, _| boxed(dted::DtedDem::open(path)),
    },
    Format {
        name: "USGS DEM",
        is: |look| usgs_dem::is_usgs_dem(&look.head),
        open: |path, _| boxed(usgs_dem::UsgsDem::open(path)),
    },
    Format {
        name: "Netpbm",
        is: |look| pnm::is_pnm(&look.head),
        open: |path, _| boxed(pnm::PnmDem::open(path)),
    },
    Format {
        name: "OpenEXR",
        is: |look| look.begins(openexr::MAGIC),
        open: |path, options| boxed(openexr::ExrDem::open(path, options)),
    },
    Format {
        name: "MBTiles",
        is: |look| tiles::is_mbtiles(look.path, &look.head),
        open: |path, options| boxed(tiles::TileDem::open(path, options)),
    },
    Format {
        name: "PMTiles",
        is: |look| tiles::is_pmtiles(&look.head),
        open: |path, options| boxed(tiles::TileDem::open(path, options)),
    },
    Format {
        name: "Surfer",
        is: |look| surfer::is_surfer(&look.head),
        open: |path, _| boxed(surfer::SurferDem::open(path)),
    },
    Format {
        name: ".hgt archive",
        is: |look| look.begins(b"PK\x03\x04") && hgt::has_tiles(look.path),
        open: |path, options| hgt_tiles(&[path.to_owned()], options),
    },
    Format {
        name: ".hgt.gz",
        is: |look| look.begins(b"\x1f\x8b") && look.is_called("hgt.gz"),
        open: |path, options| hgt_tiles(&[path.to_owned()], options),
    },
    Format {
        name: "Esri ASCII grid",
        is: |look| ascii_grid::is_ascii_grid(&look.head) && !look.is_called("hdr"),
        open: |path, _| boxed(ascii_grid::AsciiGrid::open(path)),
    },
];

/// Formats without one.
const NAMED: &[Format] = &[
    Format {
        name: ".hgt",
        is: |look| hgt::is_tile(look.path),
        open: |path, options| hgt_tiles(&[path.to_owned()], options),
    },
    // Before labels: a table of text is no raw data, though the label of other data of that name stands beside it.
    Format { name: "XYZ", is: xyz::is_xyz, open: |path, _| boxed(xyz::XyzDem::open(path)) },
    Format {
        name: "labelled (.hdr)",
        is: |look| labelled::is_labelled(look.path),
        open: |path, options| boxed(labelled::LabelledDem::open(path, options)),
    },
    Format {
        name: "headerless heightmap",
        is: |look| ["r16", "r32", "raw"].iter().any(|e| look.is_called(e)),
        open: |path, _| boxed(raw::RawDem::square(path)),
    },
];

/// Whether the file at `path` is elevation data of a format that says where it lies. Masks, overviews and labels beside data are none.
pub(crate) fn is_placed(path: &Path) -> bool {
    const BESIDE: [&str; 12] =
        ["ovr", "msk", "hdr", "xml", "prj", "aux", "clr", "stx", "sta", "blw", "wld", "qml"];
    const UNPLACED: [&str; 4] = ["PNG", "Netpbm", "OpenEXR", "headerless heightmap"];
    if BESIDE.iter().any(|name| identify::is_called(path, name)) {
        return false;
    }
    if strangers::headed(path).is_some() {
        return false;
    }
    let Ok(look) = Look::at(path) else { return false };
    let format = SIGNED.iter().chain(NAMED).find(|format| (format.is)(&look));
    format.is_some_and(|format| !UNPLACED.contains(&format.name))
}

/// What is read, in a few words for messages.
pub(crate) const READ_HERE: &str = "read are GeoTIFF, virtual rasters, netCDF, GRIB 2, DTED, USGS DEM, PNG, PGM and OpenEXR, .hgt tiles, Esri ASCII and Surfer grids, .flt and .bil with .hdr, ENVI, XYZ, VTP BT, pyramids of map tiles (folders, MBTiles, PMTiles) and headerless heightmaps";

fn boxed<R: Reader + 'static>(opened: Result<R, LayoutError>) -> Result<Box<dyn Reader>, LayoutError> {
    Ok(Box::new(opened?))
}

/// Opens tiles, in the shape that a person states if they do.
fn hgt_tiles(paths: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
    let stated = options.raw.as_deref().map(raw::tile_shape).transpose()?;
    boxed(hgt::HgtDem::open(paths, stated, options.strict))
}

/// Opens what is one grid: a file, a folder of `.hgt` tiles, or several such tiles.
///
/// # Errors
/// As [`crate::open_with`].
pub(crate) fn open(paths: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
    match paths {
        [] => Err(LayoutError::Usage("no elevation file was named; name one, or several .hgt tiles".into())),
        [path] if path.is_dir() && tiles::is_folder(path) => boxed(tiles::TileDem::open(path, options)),
        [path] if path.is_dir() => hgt_tiles(&hgt::tiles_in(path)?, options),
        [path] => open_file(path, options),
        paths => hgt_tiles(paths, options),
    }
}

fn open_file(path: &Path, options: &OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
    #[cfg(feature = "gdal")]
    if crate::gdal::is_name(path) {
        return boxed(crate::gdal::GdalDem::open(path, options));
    }
    let look = Look::at(path)?;
    // Stated shapes are for what a person knows better.
    if options.raw.is_none()
        && let Some(refusal) = strangers::headed(path)
    {
        return stranger(path, options, refusal);
    }
    if let Some(format) = SIGNED.iter().find(|format| (format.is)(&look)) {
        if options.raw.is_some() && !hgt::is_tile(path) {
            return Err(LayoutError::Usage(format!(
                "{}: a shape was stated, which is for files that do not say what they hold, and this is a {} file; leave the shape out",
                path.display(),
                format.name
            )));
        }
        return (format.open)(path, options);
    }
    if let Some(shape) = &options.raw
        && !hgt::is_tile(path)
    {
        return boxed(raw::RawDem::stated(path, shape));
    }
    if let Some(refusal) = strangers::signed(&look) {
        return stranger(path, options, refusal);
    }
    match NAMED.iter().find(|format| (format.is)(&look)) {
        Some(format) => (format.open)(path, options),
        None => stranger(path, options, strangers::unknown(&look)),
    }
}

/// Opens a virtual raster; one that GDAL computes is GDAL's, where that is there.
fn virtual_raster(path: &Path, options: &OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
    or_gdal(path, options, vrt::VrtDem::open(path, options, open_file))
}

/// Opens a GRIB file; an edition, grid or packing that is not read here is GDAL's, where that is there.
fn grib(path: &Path, options: &OpenOptions) -> Result<Box<dyn Reader>, LayoutError> {
    or_gdal(path, options, grib::GribDem::open(path, options))
}

/// What was opened.
#[cfg(not(feature = "gdal"))]
fn or_gdal<R: Reader + 'static>(
    _: &Path,
    _: &OpenOptions,
    opened: Result<R, LayoutError>,
) -> Result<Box<dyn Reader>, LayoutError> {
    boxed(opened)
}

/// What was opened; what is not read here, and no option mends it, is GDAL's.
#[cfg(feature = "gdal")]
fn or_gdal<R: Reader + 'static>(
    path: &Path,
    options: &OpenOptions,
    opened: Result<R, LayoutError>,
) -> Result<Box<dyn Reader>, LayoutError> {
    match opened {
        Err(ours @ LayoutError::Unsupported { remedy: None, .. }) => {
            match crate::gdal::GdalDem::open(path, options) {
                // What GDAL does not know either is told in the words of its reader here.
                Err(LayoutError::NotThisFormat { .. }) => Err(ours),
                opened => boxed(opened),
            }
        }
        opened => boxed(opened),
    }
}

/// Refuses what no line knows, with the words of its kind.
#[cfg(not(feature = "gdal"))]
fn stranger(path: &Path, _: &OpenOptions, refusal: String) -> Result<Box<dyn Reader>, LayoutError> {
    Err(LayoutError::not_this_format(path, format!("{refusal} ({READ_HERE})")))
}

/// Hands what no line knows to GDAL; what that does not open either is refused with the words of its kind. One tile of a file of many would pass for the whole.
#[cfg(feature = "gdal")]
fn stranger(path: &Path, options: &OpenOptions, refusal: String) -> Result<Box<dyn Reader>, LayoutError> {
    if strangers::is_part(path) {
        return Err(LayoutError::not_this_format(path, refusal));
    }
    match crate::gdal::GdalDem::open(path, options) {
        Err(LayoutError::NotThisFormat { .. }) => Err(LayoutError::not_this_format(
            path,
            format!("{refusal} ({READ_HERE}, and all that GDAL opens)"),
        )),
        opened => boxed(opened),
    }
}
