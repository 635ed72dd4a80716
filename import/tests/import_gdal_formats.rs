//! Files that GDAL writes, read here as GDAL reads them; and the advice given for what is not read, carried out.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_formats -- --ignored`.

#[path = "import_support/adam7.rs"]
mod adam7;
#[path = "import_support/gdal.rs"]
mod gdal;
mod import_support;

use gdal::{agrees, run};
use import_support::{read, refusal, write_hgt};
use std::path::{Path, PathBuf};
use tempfile::tempdir;

/// A ground with two voids, as Esri ASCII grid.
fn source(folder: &Path, nodata: &str, height: impl Fn(u32, u32) -> f64) -> PathBuf {
    let (wide, high) = (41, 31);
    let mut text = format!(
        "ncols {wide}\nnrows {high}\nxllcorner 500000\nyllcorner 5000000\ncellsize 10\nNODATA_value {nodata}\n"
    );
    for row in 0..high {
        for col in 0..wide {
            let is_void = (col, row) == (5, 6) || (col, row) == (40, 30);
            text += &if is_void { format!("{nodata} ") } else { format!("{} ", height(col, row)) };
        }
        text.push('\n');
    }
    let path = folder.join("source.asc");
    std::fs::write(&path, text).unwrap();
    std::fs::write(
        folder.join("source.prj"),
        "PROJCS[\"WGS 84 / UTM zone 32N\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],\
         UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],PARAMETER[\"latitude_of_origin\",0],PARAMETER[\"central_meridian\",9],\
         PARAMETER[\"scale_factor\",0.9996],PARAMETER[\"false_easting\",500000],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1]]",
    )
    .unwrap();
    path
}

fn ground(col: u32, row: u32) -> f64 {
    f64::from(100 + 3 * col + 7 * row)
}

fn real_ground(col: u32, row: u32) -> f64 {
    f64::from(col).mul_add(3.125, -50.5) + f64::from(row) * 0.001
}

#[test]
#[ignore = "needs gdal-bin"]
fn formats_that_gdal_writes() {
    let mut files = 0;
    for (kind, nodata, is_real) in [
        ("Byte", "250", false),
        ("Int16", "-9999", false),
        ("UInt16", "65535", false),
        ("Int32", "-2147483648", false),
        ("UInt32", "4000000000", false),
        ("Float32", "-9999", true),
        ("Float64", "-1e30", true),
    ] {
        let folder = tempdir().unwrap();
        let height = |col, row| {
            if is_real {
                real_ground(col, row)
            } else if kind == "Byte" {
                ground(col, row) % 250.0
            } else {
                ground(col, row)
            }
        };
        source(folder.path(), nodata, height);
        for (driver, name, options) in [
            ("AAIGrid", "a.asc", &[][..]),
            ("AAIGrid", "b.asc", &["-co", "FORCE_CELLSIZE=NO", "-tr", "10", "5"]),
            ("EHdr", "c.bil", &[]),
            ("ENVI", "d.dat", &[]),
            ("ENVI", "e.bip", &["-co", "INTERLEAVE=BIP"]),
            ("ENVI", "f.img", &["-co", "INTERLEAVE=BIL", "-co", "SUFFIX=ADD"]),
            ("XYZ", "g.xyz", &[]),
            ("XYZ", "h.csv", &["-co", "COLUMN_SEPARATOR=,", "-co", "ADD_HEADER_LINE=YES"]),
            ("PNM", "i.pgm", &[]),
            ("PNG", "j.png", &[]),
        ] {
            let is_picture = matches!(driver, "PNM" | "PNG");
            // What GDAL does not write.
            let is_unknown =
                is_picture && !matches!(kind, "Byte" | "UInt16") || driver == "EHdr" && kind == "Float64";
            if is_unknown {
                continue;
            }
            let arguments =
                [&["-q", "-of", driver, "-ot", kind][..], options, &["source.asc", name]].concat();
            run(folder.path(), "gdal_translate", &arguments);
            agrees(&folder.path().join(name));
            files += 1;
        }
    }
    assert_eq!(files, 59);
}

#[test]
#[ignore = "needs gdal-bin"]
fn bands_and_turned_grids_of_envi() {
    let folder = tempdir().unwrap();
    let path = source(folder.path(), "-9999", ground);
    let name = path.to_str().unwrap();
    run(
        folder.path(),
        "gdal_translate",
        &[
            "-q",
            "-ot",
            "Int16",
            "-b",
            "1",
            "-b",
            "1",
            "-b",
            "1",
            "-of",
            "ENVI",
            "-co",
            "INTERLEAVE=BIP",
            name,
            "three.dat",
        ],
    );
    agrees(&folder.path().join("three.dat"));
    run(
        folder.path(),
        "gdal_translate",
        &["-q", "-ot", "Int16", "-b", "1", "-b", "1", "-of", "EHdr", name, "two.bil"],
    );
    agrees(&folder.path().join("two.bil"));
}

#[test]
#[ignore = "needs gdal-bin"]
fn tiles_labels_and_interlaced_pictures_of_our_own() {
    let folder = tempdir().unwrap();
    for (name, side) in [("N29E080.hgt", 1201), ("S01W001.hgt", 3601)] {
        let path = folder.path().join(name);
        write_hgt(&path, side, |col, row| {
            if (col + row) % 97 == 0 { -32768 } else { (col % 900 * 3 + row % 900) as i16 }
        });
        agrees(&path);
    }
    let narrow = folder.path().join("N60E010.hgt");
    let bytes: Vec<u8> =
        (0..1801 * 3601u32).flat_map(|i| ((i % 1801 + i / 1801) as i16).to_be_bytes()).collect();
    std::fs::write(&narrow, bytes).unwrap();
    agrees(&narrow);
    let picture = folder.path().join("interlaced.png");
    // Of 8 bits: of 16 this GDAL hands out some with their bytes swapped twice.
    let pixels: Vec<Vec<u8>> = (0..100 * 77u16).map(|i| vec![(i % 251) as u8]).collect();
    std::fs::write(&picture, adam7::interlaced_png([100, 77], 0, 8, &pixels)).unwrap();
    agrees(&picture);
    let numbers: Vec<u8> = (0..3 * 2 * 12i16).flat_map(|i| (i * 5 - 20).to_be_bytes()).collect();
    for (name, label) in [
        (
            "gtopo.dem",
            "BYTEORDER M\nLAYOUT BIL\nNROWS 6\nNCOLS 12\nNBANDS 1\nNBITS 16\nNODATA -9999\nULXMAP 10.5\nULYMAP 40\nXDIM 0.5\nYDIM 0.5\n",
        ),
        ("plain.bil", "BYTEORDER M\nNROWS 6\nNCOLS 12\nNBITS 16\nSKIPBYTES 0\nPIXELTYPE SIGNEDINT\n"),
        ("guess.bil", "nrows 6\nncols 12\nbyteorder M\n"),
        (
            "corner.bil",
            "BYTEORDER M\nNROWS 3\nNCOLS 12\nNBITS 16\nSKIPBYTES 24\nPIXELTYPE SIGNEDINT\nxllcorner 10\nyllcorner 20\ncellsize 2\n",
        ),
    ] {
        let path = folder.path().join(name);
        std::fs::write(&path, &numbers).unwrap();
        std::fs::write(path.with_extension("hdr"), label).unwrap();
        let degrees = "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]]";
        std::fs::write(path.with_extension("prj"), degrees).unwrap();
        agrees(&path);
    }
}

/// What stands in a message from `tool` to the end of its command.
fn command(said: &str, tool: &str) -> String {
    let begins = said.find(tool).unwrap_or_else(|| panic!("no {tool} in: {said}"));
    let rest = &said[begins..];
    let ends = rest.find([',', ';', ')']).unwrap_or(rest.len());
    rest[..ends].trim().trim_end_matches(" (read are GeoTIFF").split(" (").next().unwrap().to_owned()
}

/// Carries out the advice and reads what it makes.
fn advice_works(folder: &Path, input: &str, tool: &str, is_exact: bool) {
    let path = folder.join(input);
    let said = refusal(std::slice::from_ref(&path));
    let command = command(&said, tool).replace("INPUT", input).replace("FOLDER", input);
    assert!(!said.contains("unknown"), "{said}");
    for old in ["output.tif", "all.tif", "all.vrt"] {
        let _ = std::fs::remove_file(folder.join(old));
    }
    run(folder, "sh", &["-c", &command]);
    let made = ["output.tif", "all.tif"].map(|name| folder.join(name)).into_iter().find(|path| path.exists());
    let grid = read(&[made.unwrap_or_else(|| panic!("{command} made nothing"))])
        .unwrap_or_else(|error| panic!("{input}: {command}: {error}"));
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [41, 31], "{input}");
    if is_exact {
        for (col, row) in [(0, 0), (40, 0), (0, 30), (20, 15)] {
            assert_eq!(grid.at(col, row), ground(col, row), "{input}: {col} {row}");
        }
    }
}

#[test]
#[ignore = "needs gdal-bin"]
fn advice_for_what_is_not_read_works() {
    let folder = tempdir().unwrap();
    source(folder.path(), "-9999", ground);
    for (driver, name, options, is_exact) in [
        ("HFA", "a.img", &["-ot", "Int16"][..], true),
        ("JP2OpenJPEG", "a.jp2", &["-ot", "Int16", "-co", "QUALITY=100", "-co", "REVERSIBLE=YES"], true),
        (
            "Terragen",
            "a.ter",
            &["-ot", "Float32", "-co", "MINUSERPIXELVALUE=100", "-co", "MAXUSERPIXELVALUE=430"],
            false,
        ),
        ("NITF", "a.ntf", &["-ot", "Int16"], true),
        ("PCIDSK", "a.pix", &["-ot", "Int16"], true),
        ("FITS", "a.fits", &["-ot", "Int16"], false),
        ("PCRaster", "a.map", &["-ot", "Float32", "-mo", "PCRASTER_VALUESCALE=VS_SCALAR"], true),
        ("HF2", "a.hf2", &["-ot", "Float32"], false),
        ("GPKG", "a.gpkg", &["-ot", "Float32", "-co", "TILING_SCHEME=CUSTOM"], false),
        ("SAGA", "a.sdat", &[], true),
        ("RST", "a.rst", &["-ot", "Int16"], true),
        ("MRF", "a.mrf", &["-ot", "Int16"], true),
        ("GTX", "a.gtx", &["-ot", "Float32", "-a_srs", "EPSG:4326", "-a_ullr", "10", "47", "11", "46"], true),
    ] {
        let arguments = [&["-q", "-of", driver][..], options, &["source.asc", name]].concat();
        let made = std::process::Command::new("gdal_translate")
            .args(&arguments)
            .current_dir(folder.path())
            .output()
            .unwrap();
        if !made.status.success() || !folder.path().join(name).exists() {
            // This GDAL lacks the driver, or the driver this kind of data.
            eprintln!("{driver}: {}", String::from_utf8_lossy(&made.stderr));
            continue;
        }
        advice_works(folder.path(), name, "gdal_translate", is_exact);
    }
}

/// GRIB files that are not read; where CDO is installed, those that it converts as well.
#[test]
#[ignore = "needs gdal-bin"]
fn advice_for_grib_works() {
    let folder = tempdir().unwrap();
    let has_cdo = std::process::Command::new("cdo").arg("--version").output().is_ok();
    for (name, made) in [
        ("edition-1.grib", "output.tif"),
        ("rotated.grib2", "output.tif"),
        ("gaussian.grib2", "output.grib2"),
        ("reduced.grib2", "output.grib2"),
        ("waves.grib2", "output.grib2"),
    ] {
        if made.ends_with("grib2") && !has_cdo {
            eprintln!("{name}: CDO is not installed");
            continue;
        }
        let input = import_support::fixtures().with_file_name("grib_fixtures").join(name);
        let said = refusal(std::slice::from_ref(&input));
        let command = said.split("convert it with: ").nth(1).unwrap_or_else(|| panic!("{said}"));
        let command = command.replace("INPUT", input.to_str().unwrap()).replace(" N ", " 1 ");
        run(folder.path(), "sh", &["-c", &command]);
        let made = folder.path().join(made);
        let grid = read(std::slice::from_ref(&made)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(grid.samples.len() > 100, "{name}");
        std::fs::remove_file(made).unwrap();
    }
}

#[test]
#[ignore = "needs gdal-bin"]
fn advice_for_pictures_and_labels_works() {
    let parts = tempdir().unwrap();
    let source = source(parts.path(), "-9999", ground);
    // A colour picture with heights in one channel; a Netpbm one as well.
    for (driver, name, made) in [("PNG", "c.png", "output.png"), ("PNM", "c.ppm", "output.pgm")] {
        run(
            parts.path(),
            "gdal_translate",
            &[
                "-q",
                "-of",
                driver,
                "-ot",
                "Byte",
                "-b",
                "1",
                "-b",
                "1",
                "-b",
                "1",
                "-scale",
                "0",
                "500",
                "0",
                "250",
                name_of(&source),
                name,
            ],
        );
        let command = command(&refusal(&[parts.path().join(name)]), "gdal_translate").replace("INPUT", name);
        run(parts.path(), "sh", &["-c", &command]);
        assert_eq!(read(&[parts.path().join(made)]).unwrap().info.samples_wide, 41);
    }
    // Labels that are not read.
    run(
        parts.path(),
        "gdal_translate",
        &["-q", "-of", "ENVI", "-ot", "CFloat32", name_of(&source), "complex.dat"],
    );
    let said = refusal(&[parts.path().join("complex.dat")]);
    run(parts.path(), "sh", &["-c", &command(&said, "gdal_translate").replace("INPUT", "complex.dat")]);
    assert_eq!(read(&[parts.path().join("output.tif")]).unwrap().at(20, 15), ground(20, 15));
    run(
        parts.path(),
        "gdal_translate",
        &[
            "-q",
            "-of",
            "EHdr",
            "-ot",
            "Byte",
            "-co",
            "NBITS=4",
            "-scale",
            "0",
            "500",
            "0",
            "15",
            name_of(&source),
            "bits.bil",
        ],
    );
    let said = refusal(&[parts.path().join("bits.bil")]);
    run(parts.path(), "sh", &["-c", &command(&said, "gdal_translate").replace("INPUT", "bits.bil")]);
    assert_eq!(read(&[parts.path().join("output.tif")]).unwrap().info.samples_wide, 41);
}

fn name_of(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).unwrap()
}
