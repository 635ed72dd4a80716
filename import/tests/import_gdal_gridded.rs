//! NetCDF, DTED, USGS DEM and rarer kinds of TIFF as GDAL writes them, against what GDAL reads in them.

#[path = "import_support/cdf.rs"]
mod cdf;
#[path = "import_support/gdal.rs"]
mod gdal;
mod import_support;

use gdal::{agrees, agrees_north_up, run};
use import_support::data;
use std::path::Path;
use tempfile::tempdir;
use terrasoar_layout::testing::is_thorough;

/// A grid in GDAL's simplest format: heights from 16-bit numbers with voids, in degrees.
fn source(folder: &Path, [wide, high]: [u32; 2], west: f64, north: f64, steps: [f64; 2]) {
    let heights = (0..high).flat_map(|row| (0..wide).map(move |col| (col, row)));
    let heights = heights
        .map(|(col, row)| if (col * 7 + row) % 101 == 3 { -32767 } else { (col * 3 + row * 2) as i16 - 900 });
    let bytes: Vec<u8> = heights.flat_map(i16::to_le_bytes).collect();
    std::fs::write(folder.join("source.raw"), bytes).unwrap();
    let vrt = format!(
        "<VRTDataset rasterXSize=\"{wide}\" rasterYSize=\"{high}\"><SRS>EPSG:4326</SRS><GeoTransform>{}, {}, 0, {}, 0, {}</GeoTransform>\
         <VRTRasterBand dataType=\"Int16\" band=\"1\" subClass=\"VRTRawRasterBand\"><NoDataValue>-32767</NoDataValue>\
         <SourceFilename relativetoVRT=\"1\">source.raw</SourceFilename><ByteOrder>LSB</ByteOrder><PixelOffset>2</PixelOffset>\
         <LineOffset>{}</LineOffset></VRTRasterBand></VRTDataset>",
        west - steps[0] / 2.0,
        steps[0],
        north + steps[1] / 2.0,
        -steps[1],
        2 * wide
    );
    std::fs::write(folder.join("source.vrt"), vrt).unwrap();
}

#[test]
#[ignore = "needs GDAL's tools"]
fn netcdf() {
    let folder = tempdir().unwrap();
    source(folder.path(), [300, 200], 10.0, 47.0, [0.01, 0.02]);
    for kind in ["NC", "NC2", "NC4", "NC4C"] {
        for dtype in ["Int16", "Int32", "Float32", "Float64"] {
            for packing in ["NONE", "DEFLATE"] {
                if packing == "DEFLATE" && !kind.starts_with("NC4") {
                    continue;
                }
                for bottom_up in ["YES", "NO"] {
                    let name = format!("{kind}-{dtype}-{packing}-{bottom_up}.nc");
                    let options = [
                        format!("FORMAT={kind}"),
                        format!("COMPRESS={packing}"),
                        format!("WRITE_BOTTOMUP={bottom_up}"),
                    ];
                    let [a, b, c] = &options;
                    run(
                        folder.path(),
                        "gdal_translate",
                        &[
                            "-q",
                            "-of",
                            "netCDF",
                            "-ot",
                            dtype,
                            "-co",
                            a,
                            "-co",
                            b,
                            "-co",
                            c,
                            "source.vrt",
                            &name,
                        ],
                    );
                    agrees_north_up(&folder.path().join(&name));
                }
            }
        }
    }
    let crater = data("crater_lake_1025.bt");
    run(folder.path(), "gdal_translate", &["-q", "-of", "netCDF", crater.to_str().unwrap(), "utm.nc"]);
    agrees_north_up(&folder.path().join("utm.nc"));
}

#[test]
#[ignore = "needs GDAL's tools"]
fn netcdf_with_ranges_of_valid_numbers() {
    use cdf::{Axis, Values, words, write};
    let folder = tempdir().unwrap();
    let axis = |name, from: f64, step: f64, count: u32, unit| Axis {
        name,
        numbers: (0..count).map(|at| from + step * f64::from(at)).collect(),
        attributes: vec![
            ("units", words(unit)),
            ("standard_name", words(if name == "lon" { "longitude" } else { "latitude" })),
        ],
    };
    let (x, y) = (axis("lon", 10.0, 0.5, 30, "degrees_east"), axis("lat", 47.0, -0.25, 20, "degrees_north"));
    let shorts = Values::Shorts((0..600).collect());
    let floats = Values::Floats((0..600).map(|at| at as f32).collect());
    let range = |low: i16, high: i16| ("valid_range", Values::Shorts(vec![low, high]));
    let fill = ("_FillValue", Values::Shorts(vec![-1]));
    let fill_real = ("_FillValue", Values::Floats(vec![-1.0]));
    let packed = [("scale_factor", Values::Doubles(vec![0.5])), ("add_offset", Values::Doubles(vec![100.0]))];
    let cases: Vec<(Values, Vec<(&str, Values)>)> = vec![
        (shorts.clone(), vec![fill.clone(), range(100, 300)]),
        (shorts.clone(), [&packed[..], &[fill.clone(), range(100, 300)]].concat()),
        (
            shorts.clone(),
            vec![
                fill.clone(),
                ("valid_min", Values::Shorts(vec![100])),
                ("valid_max", Values::Shorts(vec![120])),
            ],
        ),
        (floats.clone(), vec![fill_real.clone(), ("valid_range", Values::Floats(vec![50.0, 70.5]))]),
        (
            floats,
            vec![
                fill_real,
                ("valid_min", Values::Floats(vec![50.0])),
                ("valid_max", Values::Floats(vec![1e6])),
            ],
        ),
    ];
    for (number, (z, about)) in cases.iter().enumerate() {
        let path = folder.path().join(format!("{number}.nc"));
        write(&path, [&x, &y], (z, about), &[]);
        agrees_north_up(&path);
    }
}

#[test]
#[ignore = "needs GDAL's tools"]
fn dted_of_every_level_and_zone() {
    let folder = tempdir().unwrap();
    // Lines of longitude lie further apart from 50, 70, 75 and 80 degrees on.
    for (level, rows) in [("0", 121u32), ("1", 1201), ("2", 3601)] {
        for (south, wider) in [(10.0, 1), (-33.0, 1), (60.0, 2), (-72.0, 3), (76.0, 4), (82.0, 6)] {
            let columns = (rows - 1) / wider + 1;
            let steps = [1.0 / f64::from(columns - 1), 1.0 / f64::from(rows - 1)];
            source(folder.path(), [columns, rows], -7.0, south + 1.0, steps);
            let name = format!("a{level}-{south}.dt{level}");
            run(folder.path(), "gdal_translate", &["-q", "-of", "DTED", "source.vrt", &name]);
            agrees_north_up(&folder.path().join(&name));
        }
    }
}

#[test]
#[ignore = "needs GDAL's tools"]
fn usgs_dem() {
    let folder = tempdir().unwrap();
    source(folder.path(), [121, 151], -120.0, 41.0, [1.0 / 1200.0; 2]);
    run(folder.path(), "gdal_translate", &["-q", "-of", "USGSDEM", "source.vrt", "degrees.dem"]);
    agrees_north_up(&folder.path().join("degrees.dem"));
    let options = [
        "-q",
        "-t_srs",
        "EPSG:26710",
        "-tr",
        "30",
        "30",
        // Centres on whole multiples of the spacing, as sheets have them.
        "-te",
        "753015",
        "4530015",
        "759015",
        "4542015",
        "-dstnodata",
        "-32767",
        "source.vrt",
        "utm.tif",
    ];
    run(folder.path(), "gdalwarp", &options);
    run(folder.path(), "gdal_translate", &["-q", "-of", "USGSDEM", "utm.tif", "utm.dem"]);
    agrees_north_up(&folder.path().join("utm.dem"));
}

#[test]
#[ignore = "needs GDAL's tools"]
fn tiff_of_odd_widths_planes_and_lerc() {
    let folder = tempdir().unwrap();
    source(folder.path(), [150, 130], 10.0, 47.0, [0.01, 0.02]);
    run(
        folder.path(),
        "gdal_translate",
        &[
            "-q",
            "-ot",
            "UInt16",
            "-scale",
            "-900",
            "900",
            "0",
            "1800",
            "-a_nodata",
            "none",
            "source.vrt",
            "positive.tif",
        ],
    );
    let few = if is_thorough() { 1 } else { 3 };
    let (mut made, mut compared) = (0_usize, 0);
    for endianness in ["ENDIANNESS=LITTLE", "ENDIANNESS=BIG"] {
        for tiled in ["TILED=NO", "TILED=YES"] {
            for (compress, predictors) in [
                ("NONE", &["1"][..]),
                ("DEFLATE", &["1", "2", "3"]),
                ("LZW", &["1", "2"]),
                ("ZSTD", &["1", "3"]),
                ("PACKBITS", &["1"]),
            ] {
                for (dtype, bits) in [
                    ("UInt16", "11"),
                    ("UInt16", "12"),
                    ("UInt32", "17"),
                    ("UInt32", "24"),
                    ("UInt32", "31"),
                    ("Float32", "16"),
                    ("Int32", "32"),
                    ("Float64", "64"),
                    ("Int64", "64"),
                ] {
                    for predictor in predictors {
                        let is_odd = !["16", "32", "64"].contains(&bits);
                        let goes = match *predictor {
                            "2" => !is_odd && dtype != "Float32" && !dtype.ends_with("64"),
                            // GDAL 3.6 does not read back what it writes in big-endian so.
                            "3" => dtype.starts_with("Float") && endianness.ends_with("LITTLE"),
                            _ => true,
                        };
                        if !goes {
                            continue;
                        }
                        made += 1;
                        if !made.is_multiple_of(few) {
                            continue;
                        }
                        let name = format!("a{made}.tif");
                        let co = [
                            endianness.to_owned(),
                            tiled.into(),
                            format!("COMPRESS={compress}"),
                            format!("PREDICTOR={predictor}"),
                            format!("NBITS={bits}"),
                        ];
                        let mut arguments = vec!["-q", "-ot", dtype];
                        for option in co
                            .iter()
                            .filter(|option| **option != format!("NBITS={bits}") || is_odd || bits == "16")
                        {
                            arguments.extend(["-co", option]);
                        }
                        arguments.extend(["positive.tif", &name]);
                        run(folder.path(), "gdal_translate", &arguments);
                        agrees(&folder.path().join(&name));
                        compared += 1;
                    }
                }
            }
            for lerc in ["LERC", "LERC_DEFLATE", "LERC_ZSTD"] {
                for dtype in ["Byte", "Int16", "UInt16", "Int32", "UInt32", "Float32", "Float64"] {
                    made += 1;
                    if !made.is_multiple_of(few) {
                        continue;
                    }
                    let name = format!("a{made}.tif");
                    let compress = format!("COMPRESS={lerc}");
                    run(
                        folder.path(),
                        "gdal_translate",
                        &[
                            "-q",
                            "-ot",
                            dtype,
                            "-co",
                            endianness,
                            "-co",
                            tiled,
                            "-co",
                            &compress,
                            "source.vrt",
                            &name,
                        ],
                    );
                    agrees(&folder.path().join(&name));
                    compared += 1;
                }
            }
        }
    }
    assert!(compared * few > 200, "{compared}");
}
