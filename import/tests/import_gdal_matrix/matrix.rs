//! The list of combinations: what matters of format, type, storage, direction, system, voids and meaning, family by family.

use super::combination::{Combination, Format, Kind, METRES, Meaning, System, Turn, Unit, Void};

pub(crate) const GEOTIFF: Format = Format { name: "GeoTIFF", driver: "GTiff", ending: "tif" };
pub(crate) const COG: Format = Format { name: "Cloud-optimised GeoTIFF", driver: "COG", ending: "tif" };
pub(crate) const ASCII: Format = Format { name: "Esri ASCII grid", driver: "AAIGrid", ending: "asc" };
pub(crate) const ESRI: Format = Format { name: "Esri .bil with .hdr", driver: "EHdr", ending: "bil" };
pub(crate) const ENVI: Format = Format { name: "ENVI with .hdr", driver: "ENVI", ending: "dat" };
pub(crate) const XYZ: Format = Format { name: "XYZ", driver: "XYZ", ending: "xyz" };
pub(crate) const PNG: Format = Format { name: "PNG", driver: "PNG", ending: "png" };
pub(crate) const PNM: Format = Format { name: "Netpbm (PGM)", driver: "PNM", ending: "pgm" };
pub(crate) const VRT: Format = Format { name: "Virtual raster (.vrt)", driver: "VRT", ending: "vrt" };
pub(crate) const NETCDF: Format = Format { name: "netCDF", driver: "netCDF", ending: "nc" };
pub(crate) const GRIB: Format = Format { name: "GRIB 2", driver: "GRIB", ending: "grib2" };
pub(crate) const BT: Format = Format { name: "VTP BT", driver: "BT", ending: "bt" };
pub(crate) const DTED: Format = Format { name: "DTED", driver: "DTED", ending: "dt0" };
pub(crate) const HGT: Format = Format { name: ".hgt tile", driver: "SRTMHGT", ending: "hgt" };
pub(crate) const USGS: Format = Format { name: "USGS DEM", driver: "USGSDEM", ending: "dem" };
pub(crate) const SURFER_TEXT: Format = Format { name: "Surfer, text", driver: "GSAG", ending: "grd" };
pub(crate) const SURFER_6: Format = Format { name: "Surfer 6", driver: "GSBG", ending: "grd" };
pub(crate) const SURFER_7: Format = Format { name: "Surfer 7", driver: "GS7BG", ending: "grd" };

/// Formats in the order of the page.
pub(crate) const FORMATS: [Format; 18] = [
    GEOTIFF,
    COG,
    VRT,
    NETCDF,
    GRIB,
    ASCII,
    ESRI,
    ENVI,
    XYZ,
    PNG,
    PNM,
    BT,
    SURFER_TEXT,
    SURFER_6,
    SURFER_7,
    DTED,
    HGT,
    USGS,
];

const fn system(name: &'static str, text: &'static str, unit: Unit, corner: [f64; 2], step: f64) -> System {
    System { name, text, unit, corner, step: [step, step], height_unit_m: None }
}

pub(crate) const UTM: System =
    system("UTM zone 32N, metres", "EPSG:32632", Unit::Metres(1.0), [500_000.0, 5_000_000.0], 10.0);
const US_FOOT_M: f64 = 1200.0 / 3937.0;
const DEGREES: System = System {
    // Unlike steps, for a grid of degrees may have them.
    step: [0.000_833_333_333_333_333_3, 0.000_555_555_555_555_555_5],
    ..system("WGS 84, degrees", "EPSG:4326", Unit::Degrees, [8.0, 47.0], 1.0)
};

/// Systems that say in what coordinates count, each in its own way.
const SYSTEMS: [System; 10] = [
    UTM,
    system(
        "State Plane New York, US survey feet",
        "EPSG:2263",
        Unit::Metres(US_FOOT_M),
        [980_000.0, 200_000.0],
        25.0,
    ),
    system("State Plane Arizona, feet", "EPSG:2222", Unit::Metres(0.3048), [700_000.0, 600_000.0], 25.0),
    DEGREES,
    system("Web Mercator at 60 N", "EPSG:3857", Unit::Mercator, [1_000_000.0, 8_400_000.0], 20.0),
    system(
        "a transverse Mercator in kilometres",
        "+proj=tmerc +lat_0=0 +lon_0=9 +k=1 +x_0=500 +y_0=0 +datum=WGS84 +units=km +no_defs",
        Unit::Metres(1000.0),
        [500.0, 5000.0],
        0.01,
    ),
    // Two that cross what a map of longitudes is cut at.
    System { corner: [179.99, -17.0], ..DEGREES },
    System { corner: [359.98, 51.0], ..DEGREES },
    // Southern, and counted from the equator downward.
    system("UTM zone 36S, metres", "EPSG:32736", Unit::Metres(1.0), [300_000.0, 8_500_000.0], 30.0),
    system("ETRS89 / LAEA Europe", "EPSG:3035", Unit::Metres(1.0), [4_321_000.0, 3_210_000.0], 25.0),
];

/// Systems that say what heights are counted in.
const COMPOUND: [System; 6] = [
    System { name: "UTM and EVRF2000 heights", text: "EPSG:32632+5730", height_unit_m: Some(1.0), ..UTM },
    System { name: "WGS 84 and EGM2008", text: "EPSG:4326+3855", height_unit_m: Some(1.0), ..DEGREES },
    System {
        name: "State Plane New York and NAVD88 in US survey feet",
        text: "EPSG:2263+6360",
        height_unit_m: Some(US_FOOT_M),
        ..SYSTEMS[1]
    },
    System {
        name: "State Plane Arizona and NAVD88 in feet",
        text: "EPSG:2222+8228",
        height_unit_m: Some(0.3048),
        ..SYSTEMS[2]
    },
    System {
        name: "UTM and depths below mean sea level",
        text: "EPSG:32632+5715",
        height_unit_m: Some(-1.0),
        ..UTM
    },
    System { name: "UTM and NAVD88 in metres", text: "EPSG:26910+5703", height_unit_m: Some(1.0), ..UTM },
];

const UNITS: [(&str, f64); 6] = [
    ("m", 1.0),
    ("metre", 1.0),
    ("ft", 0.3048),
    ("US survey foot", US_FOOT_M),
    ("dm", 0.1),
    ("fathom", 1.8288),
];

const SCALES: [(f64, f64); 4] = [(1.0, 0.0), (0.1, 0.0), (0.01, -100.0), (-1.0, 0.0)];

/// All of them.
pub(crate) fn all() -> Vec<Combination> {
    let mut list = Vec::new();
    tiff_storage(&mut list);
    tiff_placement(&mut list);
    tiff_voids(&mut list);
    meanings(&mut list);
    labelled_and_text(&mut list);
    netcdf(&mut list);
    grib(&mut list);
    virtual_rasters(&mut list);
    pictures(&mut list);
    tiles_and_sheets(&mut list);
    list
}

/// Types, compressions, predictors, strips and tiles of GeoTIFF.
fn tiff_storage(list: &mut Vec<Combination>) {
    let kinds = [&Kind::WHOLE[..], &[Kind::UInt12, Kind::Float16, Kind::Float32, Kind::Float64]].concat();
    for kind in kinds {
        let new = || Combination::new(GEOTIFF, kind, UTM);
        let predictors: &[&str] = match kind {
            // Predictors are of whole bytes.
            Kind::UInt12 => &["1"],
            Kind::Float16 | Kind::Float32 | Kind::Float64 => &["1", "3"],
            _ => &["1", "2"],
        };
        for tiles in [false, true] {
            let [layout, also]: [&str; 2] =
                if tiles { ["tiles", "TILED=YES"] } else { ["strips", "TILED=NO"] };
            let size: &[&str] = if tiles { &["BLOCKXSIZE=16", "BLOCKYSIZE=16"] } else { &["BLOCKYSIZE=7"] };
            for compression in ["NONE", "PACKBITS"] {
                let compress = format!("COMPRESS={compression}");
                let creation = [&[also, &*compress][..], size].concat();
                list.push(new().stored(&format!("{layout}, {compression}"), &creation));
            }
            for compression in ["LZW", "DEFLATE", "ZSTD"] {
                for predictor in predictors {
                    let [compress, predict] =
                        [format!("COMPRESS={compression}"), format!("PREDICTOR={predictor}")];
                    let creation = [&[also, &compress, &predict][..], size].concat();
                    list.push(
                        new().stored(&format!("{layout}, {compression}, predictor {predictor}"), &creation),
                    );
                }
            }
        }
        if !matches!(kind, Kind::UInt12 | Kind::Float16 | Kind::UInt64 | Kind::Int64) {
            for compression in ["LERC", "LERC_DEFLATE", "LERC_ZSTD"] {
                let compress = format!("COMPRESS={compression}");
                list.push(new().stored(&format!("tiles, {compression}"), &["TILED=YES", &compress]));
            }
        }
        list.push(
            new().stored("BigTIFF, big-endian", &["BIGTIFF=YES", "ENDIANNESS=BIG", "COMPRESS=DEFLATE"]),
        );
    }
    for kind in [Kind::Byte, Kind::Int16, Kind::Float32] {
        for compression in ["NONE", "LZW", "DEFLATE", "ZSTD", "LERC"] {
            let compress = format!("COMPRESS={compression}");
            let stored = format!("with overviews, {compression}");
            list.push(Combination::new(COG, kind, UTM).stored(&stored, &[&compress, "BLOCKSIZE=128"]));
        }
    }
}

/// Directions and systems of GeoTIFF.
fn tiff_placement(list: &mut Vec<Combination>) {
    for kind in [Kind::Int16, Kind::Float32] {
        for system in SYSTEMS {
            for turn in Turn::ALL {
                // On longitudes round the seam a turned grid would be cut.
                let is_at_seam = system.corner[0] > 170.0 && system.unit == Unit::Degrees;
                if is_at_seam && turn.is_resampled() {
                    continue;
                }
                list.push(Combination::new(GEOTIFF, kind, system).turned(turn).with(Void::Declared));
            }
        }
        for turn in [Turn::NorthUp, Turn::SouthUp] {
            for system in [UTM, DEGREES] {
                let points = Combination { is_point: true, ..Combination::new(GEOTIFF, kind, system) };
                list.push(points.turned(turn));
            }
        }
    }
    for system in COMPOUND {
        for kind in [Kind::Int16, Kind::Float32] {
            list.push(Combination::new(GEOTIFF, kind, system));
            list.push(Combination::new(GEOTIFF, kind, system).turned(Turn::SouthUp));
        }
    }
}

/// Voids of every origin.
fn tiff_voids(list: &mut Vec<Combination>) {
    let kinds = [
        Kind::Byte,
        Kind::UInt16,
        Kind::Int16,
        Kind::UInt32,
        Kind::Int32,
        Kind::Float16,
        Kind::Float32,
        Kind::Float64,
    ];
    for kind in kinds {
        for void in [Void::Declared, Void::InsideMask, Void::MaskFile, Void::AuxXml] {
            for turn in [Turn::NorthUp, Turn::SouthUp] {
                list.push(Combination::new(GEOTIFF, kind, UTM).with(void).turned(turn));
            }
        }
        if kind.is_real() {
            list.push(Combination::new(GEOTIFF, kind, UTM).with(Void::Nan));
        }
        if matches!(kind, Kind::Byte | Kind::UInt16) {
            for turn in [Turn::NorthUp, Turn::Mirrored] {
                list.push(Combination::new(GEOTIFF, kind, UTM).with(Void::Alpha).turned(turn));
            }
        }
    }
    for kind in [Kind::Float32, Kind::Float64] {
        list.push(Combination::new(GEOTIFF, kind, UTM).with(Void::Lowest));
    }
    for void in [Void::Declared, Void::InsideMask] {
        for kind in [Kind::Int16, Kind::Float32] {
            let stored = Combination::new(COG, kind, UTM).stored("with overviews, LZW", &["COMPRESS=LZW"]);
            list.push(stored.with(void));
        }
    }
}

/// Units, scales and offsets.
fn meanings(list: &mut Vec<Combination>) {
    for format in [GEOTIFF, COG, NETCDF] {
        // GDAL's writer of netCDF leaves units out.
        let units: &[(&str, f64)] = if format == NETCDF { &[("", 1.0)] } else { &UNITS };
        for &(unit, unit_m) in units {
            for (scale, offset) in SCALES {
                let meaning = Meaning { unit, unit_m, scale, offset };
                list.push(Combination::new(format, Kind::Int16, UTM).meaning(meaning).with(Void::Declared));
            }
        }
    }
    for (scale, offset) in SCALES {
        for kind in [Kind::Byte, Kind::Float32] {
            list.push(Combination::new(GEOTIFF, kind, DEGREES).meaning(Meaning { scale, offset, ..METRES }));
        }
    }
}

/// Samples beside a header, and samples as text.
fn labelled_and_text(list: &mut Vec<Combination>) {
    let kinds =
        [Kind::Byte, Kind::UInt16, Kind::Int16, Kind::UInt32, Kind::Int32, Kind::Float32, Kind::Float64];
    for kind in kinds {
        for void in [Void::None, Void::Declared] {
            for system in [UTM, SYSTEMS[1], DEGREES] {
                let new = |format| Combination::new(format, kind, system).with(void);
                // GDAL's writer of .bil has no doubles, and rounds marks to eight digits so that it finds them no more itself.
                let is_wide = matches!(kind, Kind::Int32 | Kind::UInt32);
                if kind != Kind::Float64 && !(is_wide && void == Void::Declared) {
                    list.push(new(ESRI));
                }
                if system != DEGREES || void == Void::None {
                    list.push(new(ENVI));
                }
                // Text of three columns says neither system nor mark, but for what lies beside it.
                let is_said = if void == Void::Declared { Void::AuxXml } else { void };
                if system != SYSTEMS[1] {
                    list.push(new(XYZ).with(is_said));
                }
                if system == DEGREES {
                    list.push(new(ASCII).stored("unlike steps", &["FORCE_CELLSIZE=NO"]));
                } else {
                    list.push(new(ASCII));
                }
            }
        }
        for (name, option) in [("lines in turn", "INTERLEAVE=BIL"), ("samples in turn", "INTERLEAVE=BIP")] {
            list.push(Combination::new(ENVI, kind, UTM).stored(name, &[option]).with(Void::Declared));
        }
        list.push(
            Combination::new(XYZ, kind, UTM)
                .stored("commas, a header", &["COLUMN_SEPARATOR=,", "ADD_HEADER_LINE=YES"]),
        );
    }
}

/// Classic files and those of version 4, rows either way.
fn netcdf(list: &mut Vec<Combination>) {
    for (name, option) in
        [("classic", "FORMAT=NC"), ("64-bit offsets", "FORMAT=NC2"), ("version 4", "FORMAT=NC4")]
    {
        for (rows, bottom_up) in [("rows from the south", "YES"), ("rows from the north", "NO")] {
            for system in [UTM, DEGREES, SYSTEMS[4]] {
                for kind in [Kind::Byte, Kind::Int16, Kind::Int32, Kind::Float32, Kind::Float64] {
                    let rows_option = format!("WRITE_BOTTOMUP={bottom_up}");
                    let stored = format!("{name}, {rows}");
                    let new = Combination::new(NETCDF, kind, system).stored(&stored, &[option, &rows_option]);
                    list.push(new.with(if kind == Kind::Byte { Void::None } else { Void::Declared }));
                }
            }
        }
    }
    for kind in [Kind::UInt16, Kind::UInt32, Kind::Int64, Kind::UInt64, Kind::Int16, Kind::Float32] {
        list.push(
            Combination::new(NETCDF, kind, UTM)
                .stored("version 4, DEFLATE", &["FORMAT=NC4", "COMPRESS=DEFLATE"])
                .with(Void::Declared),
        );
    }
}

/// Packings of GRIB, and what it knows of maps; places are in millionths of a degree there.
fn grib(list: &mut Vec<Combination>) {
    const EVEN: System = System { name: "WGS 84, even degrees", step: [0.0008, 0.0006], ..DEGREES };
    let packings: [(&str, &[&str]); 7] = [
        ("simple packing", &["DATA_ENCODING=SIMPLE_PACKING"]),
        ("complex packing", &["DATA_ENCODING=COMPLEX_PACKING", "SPATIAL_DIFFERENCING_ORDER=0"]),
        ("differences", &["DATA_ENCODING=COMPLEX_PACKING", "SPATIAL_DIFFERENCING_ORDER=1"]),
        ("differences of differences", &["DATA_ENCODING=COMPLEX_PACKING", "SPATIAL_DIFFERENCING_ORDER=2"]),
        ("reals", &["DATA_ENCODING=IEEE_FLOATING_POINT"]),
        ("PNG", &["DATA_ENCODING=PNG"]),
        ("JPEG 2000", &["DATA_ENCODING=JPEG2000"]),
    ];
    for (name, options) in packings {
        for kind in [Kind::Byte, Kind::UInt16, Kind::Int16, Kind::Float32] {
            list.push(Combination::new(GRIB, kind, EVEN).stored(name, options));
        }
        let is_complex = options.len() > 1;
        if is_complex {
            list.push(Combination::new(GRIB, Kind::Int16, EVEN).stored(name, options).with(Void::Declared));
        }
    }
    let maps = [
        System { corner: [179.99, -17.0], ..EVEN },
        System { corner: [359.98, 51.0], ..EVEN },
        System { corner: [-120.5, 40.0], ..EVEN },
        UTM,
        SYSTEMS[8],
        SYSTEMS[9],
        system("RGF93 / Lambert-93", "EPSG:2154", Unit::Metres(1.0), [700_000.0, 6_600_000.0], 50.0),
        system(
            "Antarctic Polar Stereographic",
            "EPSG:3031",
            Unit::Metres(1.0),
            [1_000_000.0, 500_000.0],
            100.0,
        ),
        system(
            "NSIDC Polar Stereographic North",
            "EPSG:3413",
            Unit::Metres(1.0),
            [-500_000.0, -900_000.0],
            100.0,
        ),
        system("NAD83 / Conus Albers", "EPSG:5070", Unit::Metres(1.0), [100_000.0, 1_500_000.0], 100.0),
    ];
    for place in maps {
        for (name, options) in [packings[0], packings[3]] {
            list.push(Combination::new(GRIB, Kind::Int16, place).stored(name, options));
        }
    }
}

/// Virtual rasters of a GeoTIFF.
fn virtual_rasters(list: &mut Vec<Combination>) {
    for kind in Kind::WHOLE[1..].iter().copied().chain([Kind::Float32, Kind::Float64]) {
        for void in [Void::None, Void::Declared, Void::InsideMask] {
            for system in [UTM, DEGREES] {
                list.push(Combination::new(VRT, kind, system).with(void));
            }
        }
    }
    for turn in Turn::ALL {
        list.push(Combination::new(VRT, Kind::Int16, SYSTEMS[1]).turned(turn).with(Void::Declared));
    }
    for (scale, offset) in SCALES {
        let meaning = Meaning { unit: "ft", unit_m: 0.3048, scale, offset };
        list.push(Combination::new(VRT, Kind::Int16, UTM).meaning(meaning).with(Void::Declared));
    }
}

/// Grey pictures, which have their place beside them or none.
fn pictures(list: &mut Vec<Combination>) {
    for format in [PNG, PNM] {
        for kind in [Kind::Byte, Kind::UInt16] {
            for system in [UTM, SYSTEMS[1], DEGREES] {
                for void in [Void::None, Void::Declared, Void::AuxXml] {
                    list.push(Combination::new(format, kind, system).with(void));
                }
            }
        }
    }
}

/// Formats of whole tiles and sheets, and those of visual programs.
fn tiles_and_sheets(list: &mut Vec<Combination>) {
    for kind in [Kind::Int16, Kind::Int32, Kind::Float32] {
        for system in [UTM, SYSTEMS[1], DEGREES] {
            list.push(Combination::new(BT, kind, system));
        }
    }
    for system in [UTM, SYSTEMS[1], DEGREES] {
        // GDAL writes its own mark of voids into the text, where Surfer's belongs.
        list.push(Combination::new(SURFER_TEXT, Kind::Float32, system));
        for void in [Void::None, Void::Declared] {
            list.push(Combination::new(SURFER_6, Kind::Float32, system).with(void));
            list.push(Combination::new(SURFER_7, Kind::Float64, system).with(void));
        }
    }
    // One degree, samples on its rim.
    let tile = |format, steps: usize, west: f64, south: f64| {
        let step = 1.0 / steps as f64;
        let system =
            System { corner: [west - 0.5 * step, south + 1.0 + 0.5 * step], step: [step, step], ..DEGREES };
        Combination { samples: [steps + 1, steps + 1], ..Combination::new(format, Kind::Int16, system) }
    };
    for (west, south) in [(8.0, 46.0), (-71.0, -34.0), (179.0, -17.0)] {
        list.push(tile(DTED, 120, west, south));
    }
    list.push(tile(USGS, 120, -91.0, 30.0));
    list.push(tile(HGT, 1200, 8.0, 46.0));
}
