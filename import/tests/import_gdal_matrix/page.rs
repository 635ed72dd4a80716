//! The page docs/formats.md: tables made from the list of combinations, and a few words about each format.

use super::combination::{Combination, Format, Turn, Void};
use super::matrix::{self, FORMATS};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// How a format is known, what is said beside it, and what no table shows.
const NOTES: [(&str, &str); 18] = [
    (
        "GeoTIFF",
        "Known by its first bytes, BigTIFF too. Keys, world files, `.prj`, `.aux.xml` and `.msk` are read. Chunks are decoded in parallel and never more than a few at a time; \
         files may be sparse, planar, and of bits from 1 to 64. Of several bands `--band` names one. Sub-images and overviews are passed over. Chunks of JPEG XL are read (uint8, uint16, float32), and compared with arithmetic in a test of their own; reals of both signs side by side \
         are packed by libjxl in a way that only libjxl reads, and some are refused. JPEG, WebP, JPEG 2000 and LZMA chunks are refused with a command that converts them.",
    ),
    ("Cloud-optimised GeoTIFF", "A GeoTIFF with overviews; the full image is read."),
    (
        "Virtual raster (.vrt)",
        "As gdalbuildvrt and gdal_translate write them: simple and complex sources with scale, offset, exponent, table and \"no data\", pieces with fractions of samples, the kernels nearest, bilinear, cubic, lanczos and \
         average, masks, alpha, hidden \"no data\", virtual rasters in each other. What no file covers is void, where GDAL gives a number. A file that is missing or damaged is named and left out. \
         Pixel functions and other derived bands, warped, pansharpened and raw ones are refused with the command that writes them out. What gdalbuildvrt makes of several files is compared in a test of its own, import_gdal_mosaics.",
    ),
    (
        "netCDF",
        "Classic files, those with 64-bit offsets, and version 4 (HDF5). COARDS and CF: coordinates, `_FillValue`, `missing_value`, `scale_factor`, `add_offset`, `units`, `positive`, grid \
         mappings; rows and columns either way. Of several variables `--band NAME` picks one. Units of heights are read and are not in the table, for GDAL does not write them.",
    ),
    (
        "GRIB 2",
        "Known by its first bytes. One field is read: the only one, the only one of the ground, or the one that `--band` names by number or name (HGT, GP, DIST). Packing: simple, complex with and without differences, reals, PNG, \
         JPEG 2000, and CCSDS, which this GDAL does not write; bitmaps and missing numbers are voids. Grids: longitude and latitude, Mercator, transverse Mercator, polar stereographic, Lambert's conic, Albers, Lambert's \
         azimuthal; samples in any order. A geopotential is divided by gravity. Rotated, Gaussian and reduced grids, spherical harmonics and GRIB 1 are refused with a command that converts them.",
    ),
    (
        "Esri ASCII grid",
        "Known by its first words. Corner or centre, comma decimals, a byte order mark, any breaks of lines. A `.prj` beside it says the system.",
    ),
    (
        "Esri .bil with .hdr",
        "`.flt`, `.bil`, `.bip` and `.bsq` beside a `.hdr`, either order of bytes, with skipped bytes and gaps.",
    ),
    (
        "ENVI with .hdr",
        "Any ending, with the header beside it. Bands apart, by lines or by samples; turned by `rotation`.",
    ),
    (
        "XYZ",
        "Three columns of numbers in any order of rows that makes a full grid; separators and a header line are found. Nothing in it says a system: name it with `--crs`.",
    ),
    (
        "PNG",
        "8 and 16 bits of grey, interlaced too; transparency makes voids. Heights packed into colours are read with `--decode mapbox`, `terrarium` or four factors. A PNG says neither place nor scale: a world file, \
         `--spacing` and `--z-scale` do.",
    ),
    ("Netpbm (PGM)", "Plain and raw greymaps of up to 16 bits, and `Pf` floats."),
    ("VTP BT", "Versions 1.0 to 1.3. The `.prj` beside it is the system where the header points to it."),
    (
        "Surfer, text",
        "`.grd` that begins with `DSAA`. 1.70141e38 is a void. A `.prj` or `.aux.xml` beside it says the system.",
    ),
    ("Surfer 6", "`.grd` that begins with `DSBB`; as the text."),
    (
        "Surfer 7",
        "`.grd` that begins with `DSRB`; its own value of voids. Sections of faults are passed over.",
    ),
    ("DTED", "Levels 0 to 2; columns of any length."),
    (
        ".hgt tile",
        "Of any size, also 1801 x 3601; packed by gzip or zip. The name says the place. GDAL's tool is the truth here too, in a test of its own.",
    ),
    ("USGS DEM", "Whole sheets of types A and B, in degrees or UTM, in metres or feet."),
];

/// The page.
pub(crate) fn page() -> String {
    let all = matrix::all();
    let mut page = format!(
        "# Formats of elevation data\n\n\
         What `terrasoar build` reads, and what it makes of it. The tables are made from the list of {} files that a test writes with GDAL, builds, and compares sample by sample with \
         what GDAL reads in them and with the arithmetic by which they were made: heights, voids, places and spacing.\n\n\
         The test is `import_gdal_matrix` of the package terrasoar-import; it needs gdal-bin. `./test` compares one file in three, `./test --full` all. It also makes this page, where TERRASOAR_BLESS is 1.\n\n\
         ## What is read\n\n\
         | format | files compared | samples | voids |\n|---|---|---|---|\n",
        all.len()
    );
    let of = |format: Format| all.iter().filter(move |combination| combination.format == format);
    for format in FORMATS {
        let list: Vec<&Combination> = of(format).collect();
        let kinds: BTreeSet<_> = list.iter().map(|combination| combination.kind).collect();
        let voids: BTreeSet<_> =
            list.iter().map(|combination| combination.void).filter(|void| *void != Void::None).collect();
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} |",
            format.name,
            list.len(),
            joined(", ", kinds.iter().map(|kind| kind.name())),
            joined(", ", voids.iter().map(|void| void.name())),
        );
    }
    page.push_str(
        "| headerless heightmap | - | any, stated as `--raw WxH:TYPE`; square `.r16`, `.r32` and `.raw` by their length | `--nodata` |\n\
         | OpenEXR | - | float16, float32, uint32 | not a number |\n\
         | map tiles: folders, MBTiles, PMTiles | - | packed into colours | transparent, missing |\n\n\
         `--nodata` adds a mark of voids to any format. All formats are read in bounded memory (`--memory`).\n\n",
    );
    page.push_str(
        "Several files, folders and patterns of any of these formats are one mosaic: of unlike resolution, system, type, unit, \"no data\" and overlap. They are compared with gdalbuildvrt sample by sample where they lie on one \
         grid, and with gdalwarp where they do not, in the test import_gdal_mosaics. [build](manual/build.md#several-files) tells the rules.\n\n",
    );
    for format in FORMATS {
        let notes = NOTES.iter().find(|(name, _)| *name == format.name).map_or("", |(_, notes)| notes);
        let _ = writeln!(page, "### {}\n\n{notes}\n", format.name);
        let storage: BTreeSet<_> = of(format).map(|combination| combination.storage.as_str()).collect();
        if storage.len() > 1 {
            let _ = writeln!(page, "Stored as: {}.\n", joined("; ", storage.iter().copied()));
        }
    }
    page.push_str(
        "### OpenEXR\n\n\
         One channel of half, float or uint, in rows or tiles, packed by RLE, ZIP, PIZ, PXR24, B44 or not at all. Of several `--band NAME` names one, \
         as `PART.NAME` in a file of several parts; alpha does not count. Not-a-number is void. The data window is read; nothing says where it lies, so a world file, `--spacing` and `--z-scale` do. \
         Deep data, DWAA and DWAB are refused. OpenEXR's own library wrote the files that are compared with arithmetic.\n\n",
    );
    page.push_str(
        "### Map tiles\n\n\
         Pyramids of web-map tiles in EPSG:3857: folders of `zoom/column/row.png` (XYZ, and TMS), MBTiles, and PMTiles of version 3. Heights are packed into PNG or lossless WebP, as \
         `--decode` or the pyramid's metadata say. One zoom is read, by `--zoom` and `--bounds`. Tiles of AVIF and vector tiles are refused, and so are directories packed by Brotli. GDAL's reading is the truth \
         here too, in the test `import_gdal_tiles`.\n\n",
    );
    page.push_str(
        "## Which way rows and columns go\n\n| grid | files compared | what is done |\n|---|---|---|\n",
    );
    for turn in Turn::ALL {
        let files = all.iter().filter(|combination| combination.turn == turn).count();
        let done = match turn {
            Turn::NorthUp => "read as it is",
            Turn::SouthUp | Turn::Mirrored | Turn::HalfTurned => "turned, every sample as it was",
            Turn::Rotated | Turn::Sheared => {
                "resampled to north-up, bilinearly unless `--resampling` says otherwise"
            }
        };
        let _ = writeln!(page, "| {} | {files} | {done} |", turn.name());
    }
    page.push_str(
        "\n## Reference systems compared\n\n| system | files | metres a unit of heights |\n|---|---|---|\n",
    );
    let mut systems: Vec<(&str, Option<f64>)> = Vec::new();
    for combination in &all {
        let entry = (combination.system.name, combination.system.height_unit_m);
        if !systems.contains(&entry) {
            systems.push(entry);
        }
    }
    for (name, height_unit_m) in systems {
        let files = all.iter().filter(|combination| combination.system.name == name).count();
        let unit = height_unit_m.map_or("as the file says".into(), |metres| metres.to_string());
        let _ = writeln!(page, "| {name} | {files} | {unit} |");
    }
    page.push_str(
        "\nEvery code of the EPSG registry is known, and WKT 1 and 2, Esri's `.prj` and PROJ strings are read. Where a file says nothing, `--crs` does.\n\n\
         ## Known and not read\n\n\
         These are told by name, with the way to a format that is read. A build with the feature `gdal` reads all that GDAL opens.\n\n\
         | the way out | what |\n|---|---|\n",
    );
    let mut by_advice: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (what, advice) in terrasoar_import::strangers() {
        by_advice.entry(advice).or_default().insert(what);
    }
    for (advice, what) in by_advice {
        let _ = writeln!(page, "| {advice} | {} |", joined("; ", what.into_iter()));
    }
    page
}

fn joined<'a>(by: &str, words: impl Iterator<Item = &'a str>) -> String {
    let words: Vec<&str> = words.collect();
    if words.is_empty() { "none in the file".into() } else { words.join(by) }
}
