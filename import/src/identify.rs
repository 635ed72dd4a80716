//! What a file is, judged by its first bytes.
//!
//! A table of signatures, of the formats read here and of the strangers people most often offer
//! instead, so that a refusal can say what the file is and how to convert it. Cost: one read of 512 bytes.

use std::io::Read;
use std::path::Path;

use super::{hgt, input};
use terrasoar_layout::error::LayoutError;

/// What `open` accepts, for messages.
const READ_HERE: &str = "read are 16-bit grey PNG, VTP BT (.bt), SRTM .hgt and GeoTIFF";

/// A format that can be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Png,
    Bt,
    Hgt,
    Tiff,
}

impl Format {
    /// Its name in messages.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Bt => "VTP BT",
            Self::Hgt => ".hgt",
            Self::Tiff => "TIFF",
        }
    }
}

/// Tells the format of the file at `path`.
pub(super) fn identify(path: &Path) -> Result<Format, LayoutError> {
    let metadata = std::fs::metadata(path)
        .map_err(|source| LayoutError::io(path, "cannot open the elevation file", source))?;
    if metadata.is_dir() {
        return Err(LayoutError::not_this_format(
            path,
            "this is a directory; name the elevation file in it, or for .hgt tiles all of them: DIRECTORY/*.hgt",
        ));
    }
    if metadata.is_file() && metadata.len() == 0 {
        return Err(LayoutError::not_this_format(path, "the file is empty; fetch or write it again"));
    }
    let mut head = Vec::with_capacity(512);
    input::open(path, "cannot open the elevation file")?
        .take(512)
        .read_to_end(&mut head)
        .map_err(|source| LayoutError::io(path, "cannot read the elevation file", source))?;

    if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        return Ok(Format::Png);
    }
    if head.starts_with(b"binterr") {
        return Ok(Format::Bt);
    }
    if is_tiff(&head) {
        return Ok(Format::Tiff);
    }
    if has_extension(path, "hgt") {
        hgt::side_of(path, metadata.len())?;
        return Ok(Format::Hgt);
    }
    Err(LayoutError::not_this_format(path, refusal(path, &head)))
}

/// Classic TIFF is version 42, BigTIFF 43, in either byte order.
pub(crate) fn is_tiff(head: &[u8]) -> bool {
    [&b"II*\0"[..], b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| head.starts_with(magic))
}

fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
}

/// Signatures of formats that are not read here: where they stand, what they are, what to do.
const STRANGERS: &[(usize, &[u8], &str, &str)] = &[
    (0, b"\xff\xd8\xff", "a JPEG picture", PICTURE),
    (0, b"GIF8", "a GIF picture", PICTURE),
    (0, b"BM", "a BMP picture", PICTURE),
    (8, b"WEBP", "a WebP picture", PICTURE),
    (0, b"8BPS", "a Photoshop picture", PICTURE),
    (4, b"jP  \r\n", "a JPEG 2000 file", CONVERT),
    (0, b"\xffO\xffQ", "a JPEG 2000 stream", CONVERT),
    (0, b"PK\x03\x04", "a zip archive", UNPACK),
    (0, b"\x1f\x8b", "a gzip archive", UNPACK),
    (0, b"BZh", "a bzip2 archive", UNPACK),
    (0, b"\xfd7zXZ", "an xz archive", UNPACK),
    (0, b"7z\xbc\xaf", "a 7-Zip archive", UNPACK),
    (257, b"ustar", "a tar archive", UNPACK),
    (0, b"%PDF", "a PDF document", "find the elevation data it describes"),
    (0, b"\x89HDF", "an HDF5 or netCDF-4 file", CONVERT),
    (0, b"CDF\x01", "a netCDF file", CONVERT),
    (0, b"CDF\x02", "a netCDF file", CONVERT),
    (0, b"UHL1", "a DTED file", CONVERT),
    (0, b"LASF", "a LAS point cloud", "make a grid of it first, for example with PDAL's writers.gdal"),
    (0, b"EHFA_HEADER_TAG", "an Erdas Imagine file", CONVERT),
    (0, b"ncols", "an Esri ASCII grid", CONVERT),
    (0, b"NCOLS", "an Esri ASCII grid", CONVERT),
    (0, b"DSAA", "a Surfer ASCII grid", CONVERT),
    (0, b"DSBB", "a Surfer grid", CONVERT),
    (0, b"DSRB", "a Surfer 7 grid", CONVERT),
    (0, b"<VRTDataset", "a GDAL virtual raster", CONVERT),
    (0, b"SDTS", "an SDTS file", CONVERT),
    (0, b"TERRAGEN", "a Terragen terrain", CONVERT),
];

const PICTURE: &str = "a picture of a terrain has no heights: look for the elevation data it was made from";
const CONVERT: &str = "convert it with: gdal_translate INPUT output.tif";
const UNPACK: &str = "unpack it and name the elevation file inside";

/// What to say about a file that is none of ours.
fn refusal(path: &Path, head: &[u8]) -> String {
    let stranger =
        STRANGERS.iter().find(|(at, magic, ..)| head.get(*at..).is_some_and(|rest| rest.starts_with(magic)));
    if let Some((_, _, what, advice)) = stranger {
        return format!("this is {what}, which is not read; {advice} ({READ_HERE})");
    }
    if has_extension(path, "iqt") {
        return format!(
            "this is a terrain file already built from elevation data, not elevation data; open it to fly, or name \
             the data to build from ({READ_HERE})"
        );
    }
    format!("the format is unknown; {READ_HERE}; if GDAL knows it, {CONVERT}")
}
