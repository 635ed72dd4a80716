//! Formats that are recognised but not read: what they are, and how to convert them to one that is read.
//!
//! A line each. Signatures of four bytes or more are looked at before any name; shorter ones and names last, for samples of a file without a header may look like them.
//! A command in an advice has INPUT where the file's name belongs.

use crate::identify::{Look, is_called};
use std::path::Path;
use terrasoar_layout::words::harmless;

/// A format that is not read.
struct Stranger {
    /// Where its signature stands.
    at: usize,
    magic: &'static [u8],
    what: &'static str,
    advice: &'static str,
}

const fn stranger(at: usize, magic: &'static [u8], what: &'static str, advice: &'static str) -> Stranger {
    Stranger { at, magic, what, advice }
}

const CONVERT: &str =
    "read it with a build that has the feature gdal, or convert it with: gdal_translate INPUT output.tif";
const CONVERT_BAND: &str = "list what is in it with gdalinfo INPUT and convert the data set with the heights: gdal_translate NAME_OF_THE_DATA_SET output.tif";
const PICTURE: &str = "a picture of a terrain has no heights: look for the elevation data it was made from";
const UNPACK: &str = "unpack it and name the elevation file inside";
const POINTS: &str =
    "points make no terrain by themselves: make a grid of them first, for example with PDAL's writers.gdal";
const VECTORS: &str = "lines and points make no terrain by themselves: make a grid of them first, for example with: gdal_grid -zfield NAME_OF_THE_HEIGHTS -a linear INPUT output.tif";
const MESH: &str = "a mesh is no grid of heights: look for the elevation data it was made from, or write a heightmap from the program that made it";
const LICENSED: &str = "GDAL reads it only with its maker's library; ask whoever gave it to you for a GeoTIFF, or write one with a program that has that library, such as QGIS for Windows";
const HEIGHTMAP: &str =
    "write it as a 16-bit PNG, a GeoTIFF or a .r16 heightmap with the program that made it";

/// Signatures long enough to stand for themselves.
const SIGNED: &[Stranger] = &[
    stranger(0, b"GIF8", "a GIF picture", PICTURE),
    stranger(8, b"WEBP", "a WebP picture", PICTURE),
    stranger(0, b"8BPS", "a Photoshop picture", PICTURE),
    stranger(0, b"DDS ", "a DirectDraw texture", PICTURE),
    stranger(0, b"\0\0\0\x0cJXL ", "a JPEG XL picture", PICTURE),
    stranger(4, b"ftypavi", "an AVIF picture", PICTURE),
    stranger(4, b"ftyphei", "an HEIF picture", PICTURE),
    stranger(4, b"ftyphevc", "an HEIF picture", PICTURE),
    stranger(4, b"ftypmif1", "an HEIF picture", PICTURE),
    stranger(4, b"jP  \r\n", "a JPEG 2000 file", CONVERT),
    stranger(0, b"\xffO\xffQ", "a JPEG 2000 stream", CONVERT),
    stranger(0, b"msid", "a MrSID picture", LICENSED),
    stranger(0, b"\xfd7zXZ", "an xz archive", UNPACK),
    stranger(0, b"7z\xbc\xaf", "a 7-Zip archive", UNPACK),
    stranger(0, b"Rar!", "a RAR archive", UNPACK),
    stranger(0, b"\x28\xb5\x2f\xfd", "a Zstandard archive", UNPACK),
    stranger(257, b"ustar", "a tar archive", UNPACK),
    stranger(0, b"%PDF", "a PDF document", "find the elevation data it describes"),
    stranger(0, b"\x0e\x03\x13\x01", "an HDF4 file", CONVERT_BAND),
    stranger(0, b"LASF", "a LAS or LAZ point cloud", POINTS),
    stranger(0, b"ASTM-E57", "an E57 point cloud", POINTS),
    stranger(0, b"EHFA_HEADER_TAG", "an Erdas Imagine file", CONVERT),
    stranger(0, b"SDTS", "an SDTS file", CONVERT),
    stranger(5, b"SDTS", "an SDTS file", CONVERT),
    stranger(0, b"TERRAGEN", "a Terragen terrain", CONVERT),
    stranger(0, b"trrn", "a Leveller terrain", CONVERT),
    stranger(0, b"HF2\0", "an HF2 terrain", CONVERT),
    stranger(0, b"NITF0", "a NITF file", CONVERT),
    stranger(0, b"NSIF0", "an NSIF file", CONVERT),
    stranger(0, b"PCIDSK", "a PCIDSK file", CONVERT),
    stranger(0, b"SIMPLE  =", "a FITS file", CONVERT),
    stranger(0, b"RSVP", "a PCRaster map", CONVERT),
    stranger(0, b"RUU CROSS SYSTEM MAP FORMAT", "a PCRaster map", CONVERT),
    stranger(
        0,
        b"GRID1.2\0",
        "the header of an ARC/INFO grid, which is a folder",
        "convert the folder: gdal_translate FOLDER output.tif",
    ),
    stranger(
        0,
        b"EXP  ",
        "an ARC/INFO interchange file (.e00)",
        "import it with ArcGIS or GRASS and write a GeoTIFF or an ASCII grid from there",
    ),
    stranger(0, b"\0\0'\n\0\0\0\0", "a shapefile", VECTORS),
    stranger(0, b"glTF", "a glTF mesh", MESH),
    stranger(0, b"ply\n", "a PLY mesh or point cloud", MESH),
    stranger(0, b"ply\r\n", "a PLY mesh or point cloud", MESH),
    stranger(0, b"solid ", "an STL mesh", MESH),
    stranger(0, b"<MRF_META", "a Meta Raster Format file", CONVERT),
    stranger(0, b"Lerc2 ", "a stream of LERC", CONVERT),
    stranger(0, b"north:", "a GRASS ASCII grid", CONVERT),
    stranger(0, b"north ", "a GRASS ASCII grid", CONVERT),
    stranger(0, b"DatasetHeader", "an ERMapper header", CONVERT),
    stranger(0, b"#?RADIANCE", "a Radiance picture", PICTURE),
];

/// Signatures that samples may have by chance.
const WEAK: &[Stranger] = &[
    stranger(0, b"\xff\xd8\xff", "a JPEG picture", PICTURE),
    stranger(0, b"\xff\x0a", "a JPEG XL picture", PICTURE),
    stranger(0, b"BM", "a BMP picture", PICTURE),
    stranger(0, b"\x1f\x8b", "a gzip archive", UNPACK),
    stranger(0, b"BZh", "a bzip2 archive", UNPACK),
    stranger(0, b"e\x02", "an ECW picture", LICENSED),
];

/// Names that say what a file is where its bytes do not.
const NAMES: &[(&str, &str, &str)] = &[
    ("ecw", "an ECW picture", LICENSED),
    ("obj", "a Wavefront mesh", MESH),
    ("stl", "an STL mesh", MESH),
    ("dxf", "a drawing (DXF)", VECTORS),
    ("kml", "a KML file", VECTORS),
    ("geojson", "a GeoJSON file", VECTORS),
    ("gpx", "a GPX track", VECTORS),
    (
        "adf",
        "a part of an ARC/INFO grid, which is a folder",
        "convert the folder: gdal_translate FOLDER output.tif",
    ),
    ("sdat", "a SAGA grid", CONVERT),
    (
        "sgrd",
        "the header of a SAGA grid",
        "convert the data file beside it, which ends in .sdat: gdal_translate INPUT output.tif",
    ),
    ("rst", "an Idrisi raster", CONVERT),
    ("ter", "a terrain of another program", HEIGHTMAP),
    ("hfz", "a packed terrain of another program", HEIGHTMAP),
    ("tga", "a TGA picture", PICTURE),
    ("grd", "a grid of one of many programs", CONVERT),
    ("gtx", "a grid of vertical shifts", CONVERT),
    ("img", "a file of one of many programs", CONVERT),
    ("las", "a point cloud", POINTS),
    ("laz", "a point cloud", POINTS),
    ("pts", "a point cloud", POINTS),
    ("ptx", "a point cloud", POINTS),
    (
        "iqt",
        "a terrain file already built from elevation data, not elevation data",
        "open it to fly, or name the data to build from",
    ),
];

/// Data of other programs by the end of its name, the end of the name of the header that must stand beside, and what it is. Without this their data would be read by any other
/// header of that name, or by the signature of its first piece.
const HEADED: &[(&[&str], &str, &str)] = &[
    (&["sdat"], "sgrd", "the data of a SAGA grid"),
    (&["rst"], "rdc", "an Idrisi raster"),
    (&["gri"], "grd", "the data of a raster of R"),
    (&["ppg", "pjg", "ptf", "pzp", "til", "lrc", "psz"], "mrf", "the tiles of a Meta Raster Format file"),
];

/// What to say of data that another program's header beside it describes.
pub(crate) fn headed(path: &Path) -> Option<String> {
    let (_, header, what) = HEADED.iter().find(|(data, ..)| data.iter().any(|name| is_called(path, name)))?;
    let names = [path.with_extension(header), path.with_extension(header.to_ascii_uppercase())];
    let header = names.into_iter().find(|name| name.is_file())?;
    let name = harmless(&header.file_name()?.to_string_lossy(), 80);
    let input = if is_called(&header, "mrf") || is_called(&header, "grd") { name.as_str() } else { "INPUT" };
    let advice = CONVERT.replace("INPUT", input);
    Some(format!("this is {what} that {name} beside it describes, which is not read; {advice}"))
}

/// Whether a file is but tiles of a file of many, which have signatures of their own.
#[cfg(feature = "gdal")]
pub(crate) fn is_part(path: &Path) -> bool {
    HEADED.last().is_some_and(|(data, ..)| data.iter().any(|name| is_called(path, name)))
        && headed(path).is_some()
}

fn told(what: &str, advice: &str) -> String {
    format!("this is {what}, which is not read; {advice}")
}

fn find(look: &Look<'_>, strangers: &[Stranger]) -> Option<String> {
    let stranger =
        strangers.iter().find(|s| look.head.get(s.at..).is_some_and(|rest| rest.starts_with(s.magic)))?;
    Some(told(stranger.what, stranger.advice))
}

/// Formats that are known and not read: what each is, and the way from it to one that is read. Some are there twice.
pub fn strangers() -> impl Iterator<Item = (&'static str, &'static str)> {
    let signed = SIGNED.iter().chain(WEAK).map(|stranger| (stranger.what, stranger.advice));
    signed.chain(NAMES.iter().map(|(_, what, advice)| (*what, *advice)))
}

/// What to say of a file with the signature of a format that is not read.
pub(crate) fn signed(look: &Look<'_>) -> Option<String> {
    find(look, SIGNED).or_else(|| database(look)).or_else(|| archive(look)).or_else(|| markup(look))
}

/// What to say of a file that nothing knows by its content.
pub(crate) fn unknown(look: &Look<'_>) -> String {
    let named = || {
        let (_, what, advice) = NAMES.iter().find(|(extension, ..)| look.is_called(extension))?;
        Some(if look.is_called("iqt") { format!("this is {what}; {advice}") } else { told(what, advice) })
    };
    find(look, WEAK)
        .or_else(named)
        .unwrap_or_else(|| format!("the format is unknown; if GDAL knows it, {CONVERT}"))
}

/// SQLite databases with tiles or grids in them, told apart by the number of their application.
fn database(look: &Look<'_>) -> Option<String> {
    if !look.begins(b"SQLite format 3\0") {
        return None;
    }
    Some(match look.head.get(68..72) {
        Some(b"GPKG" | b"GP10" | b"GP11") => told("a GeoPackage", CONVERT),
        _ => told("an SQLite database", DATABASE),
    })
}

const DATABASE: &str = "if it holds map tiles (MBTiles), let its name end with .mbtiles; if GDAL knows it, convert it: gdal_translate INPUT output.tif";

/// A zip archive without `.hgt` tiles, told by the name of its first file.
fn archive(look: &Look<'_>) -> Option<String> {
    if !look.begins(b"PK\x03\x04") {
        return None;
    }
    let length =
        look.head.get(26..28).map_or(0, |bytes| usize::from(u16::from_le_bytes([bytes[0], bytes[1]])));
    let first = look.head.get(30..30 + length).unwrap_or_default();
    if look.is_called("kmz") || first.eq_ignore_ascii_case(b"doc.kml") {
        return Some(told(
            "a KMZ file",
            "what is in it is mostly a picture; look for the elevation data it was made from",
        ));
    }
    Some(told("a zip archive without .hgt tiles in it", UNPACK))
}

/// XML: KML, for virtual rasters are read.
fn markup(look: &Look<'_>) -> Option<String> {
    if !look.begins(b"<?xml") && !look.begins(b"\xef\xbb\xbf<?xml") {
        return None;
    }
    let has = |word: &[u8]| look.head.windows(word.len()).any(|window| window == word);
    Some(if has(b"<kml") {
        told("a KML file", VECTORS)
    } else {
        told("an XML text", "name the elevation file that it describes")
    })
}
