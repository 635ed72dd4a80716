//! Mosaics and virtual rasters against GDAL's tools: gdalbuildvrt and gdal_translate sample by sample, gdalwarp within what a twentieth of a step changes.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_mosaics -- --ignored`.

mod import_support;
#[path = "import_support/tools.rs"]
mod tools;

use import_support::{Grid, Random, collect};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, Priority, open_with};
use tools::{run, try_run, values};

/// Hills with voids.
fn hills(x: f64, y: f64, seed: f64) -> f64 {
    let is_void = ((x * 0.11 + seed).sin() * (y * 0.13).cos()) > 0.93;
    let height = 500.0 + 200.0 * ((x + seed * 31.0) / 900.0).sin() * (y / 1100.0).cos() + x / 40.0 - y / 60.0;
    if is_void { -9999.0 } else { (height * 10.0).round() / 10.0 }
}

/// A grid of hills as GeoTIFF of this type, with the north-west corner of its area.
fn tif(
    folder: &Path,
    name: &str,
    system: &str,
    [west, north]: [f64; 2],
    step: [f64; 2],
    samples: [u32; 2],
    kind: &str,
) -> PathBuf {
    let plain = folder.join("plain.asc");
    let [wide, high] = samples;
    let mut text =
        format!("ncols {wide}\nnrows {high}\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n");
    // Degrees are some 100 km.
    let size = if step[0] < 0.5 { 100_000.0 } else { 1.0 };
    for row in 0..high {
        for col in 0..wide {
            let x = (west + step[0] * (f64::from(col) + 0.5)) * size % 100_000.0;
            let y = (north - step[1] * (f64::from(row) + 0.5)) * size % 100_000.0;
            let height = hills(x, y, name.len() as f64);
            let fills = name.starts_with("smooth") && height == -9999.0;
            text.push_str(&format!("{} ", if fills { 321.5 } else { height }));
        }
        text.push('\n');
    }
    std::fs::write(&plain, text).unwrap();
    let corners = [west, north, west + step[0] * f64::from(wide), north - step[1] * f64::from(high)];
    let corners = corners.map(|value| format!("{value:.12}"));
    let mut arguments = vec!["-q", "-ot", kind, "-a_srs", system, "-a_ullr"];
    arguments.extend(corners.iter().map(String::as_str));
    arguments.extend(["-co", "TILED=YES", "-co", "BLOCKXSIZE=64", "-co", "BLOCKYSIZE=64", "plain.asc", name]);
    run(folder, "gdal_translate", &arguments);
    folder.join(name)
}

fn read(paths: &[PathBuf], options: &OpenOptions) -> Grid {
    collect(&*open_with(paths, options).unwrap_or_else(|error| panic!("{error}")))
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Compares 400 places, and what GDAL calls void with what is void here. `off` is how far numbers may differ; `uncovered` is what GDAL says where no file lies.
fn agrees(path: &Path, grid: &Grid, off: f64, uncovered: f64) {
    let [wide, high] = [grid.info.samples_wide, grid.info.samples_high];
    let said = run(Path::new("."), "gdalinfo", &[path.to_str().unwrap()]);
    assert!(said.contains(&format!("Size is {wide}, {high}")), "{}: {wide} x {high}: {said}", path.display());
    let mut random = Random(path.as_os_str().len() as u64);
    let mut places: Vec<(u32, u32)> =
        (0..400).map(|_| (random.below(wide.into()) as u32, random.below(high.into()) as u32)).collect();
    places.extend([(0, 0), (wide - 1, 0), (0, high - 1), (wide - 1, high - 1)]);
    let (mut heights, mut one_sided, mut worst) = (0, 0, 0.0f64);
    // As a whole: asked for a single sample that is void in the uppermost file, GDAL 3.6 does not look at those below.
    let whole = path.with_extension("whole.tif");
    run(Path::new("."), "gdal_translate", &["-q", path.to_str().unwrap(), whole.to_str().unwrap()]);
    for ((col, row), wanted) in places.iter().zip(values(&whole, &places)) {
        let got = grid.at(*col, *row);
        let name = path.display();
        if got.is_nan() {
            let is_void = wanted == -9999.0 || wanted == uncovered || wanted.is_nan();
            // Where new samples are made GDAL fills voids from their neighbours, and here a void stays one.
            one_sided += usize::from(!is_void);
            assert!(is_void || off > 0.0, "{name}: ({col}, {row}) is void, GDAL says {wanted}");
            continue;
        }
        heights += 1;
        if off > 0.5 && (got - wanted).abs() > off {
            // A void of an upper file, which GDAL fills and here shows what lies below.
            one_sided += 1;
            continue;
        }
        worst = worst.max((got - wanted).abs());
        // GDAL prints singles with some digits less.
        let is_near = (got - wanted).abs() <= off + 1e-8 * wanted.abs();
        assert!(is_near, "{name}: ({col}, {row}) is {got}, GDAL says {wanted}");
    }
    assert!(one_sided * 20 < heights, "{}: {one_sided} of {heights}", path.display());
    println!("{}: {heights} heights, worst {worst}", path.file_name().unwrap().to_string_lossy());
    assert!(heights >= 100, "{}: {heights} heights", path.display());
}

const UTM: &str = "EPSG:32632";

/// Twelve tiles on one grid that overlap, one of them missing from the rectangle.
fn tiles(folder: &Path, kind: &str) -> Vec<PathBuf> {
    (0..12)
        .filter(|number| *number != 5)
        .map(|number| {
            let corner =
                [500_000.0 + f64::from(number % 4) * 900.0, 5_000_000.0 - f64::from(number / 4) * 900.0];
            let name = format!("{kind}-{}.tif", "x".repeat(number as usize + 1));
            tif(folder, &name, UTM, corner, [10.0, 10.0], [100, 100], kind)
        })
        .collect()
}

/// On one grid gdalbuildvrt's last file is our last.
#[test]
#[ignore = "needs GDAL's tools"]
fn mosaics_on_one_grid_are_those_of_gdalbuildvrt() {
    let folder = tempdir().unwrap();
    let here = folder.path();
    for kind in ["Int16", "Float32", "Float64", "Int32"] {
        let files = tiles(here, kind);
        let names: Vec<&str> = files.iter().map(|path| path.to_str().unwrap()).collect();
        let vrt = here.join(format!("{kind}.vrt"));
        run(here, "gdalbuildvrt", &[&["-q", vrt.to_str().unwrap()], &names[..]].concat());
        let options = OpenOptions { priority: Priority::Last, ..OpenOptions::default() };
        agrees(&vrt, &read(&files, &options), 1e-9, -9999.0);
        agrees(&vrt, &read(std::slice::from_ref(&vrt), &OpenOptions::default()), 1e-9, -9999.0);
        // The other way round.
        let back: Vec<&str> = names.iter().rev().copied().collect();
        let vrt = here.join(format!("back-{kind}.vrt"));
        run(here, "gdalbuildvrt", &[&["-q", vrt.to_str().unwrap()], &back[..]].concat());
        let options = OpenOptions { priority: Priority::First, ..OpenOptions::default() };
        agrees(&vrt, &read(&files, &options), 1e-9, -9999.0);
    }
}

#[test]
#[ignore = "needs GDAL's tools"]
fn virtual_rasters_of_gdalbuildvrt_are_read() {
    let folder = tempdir().unwrap();
    let here = folder.path();
    let mut files = tiles(here, "Int16");
    // Twice and one and a half times as coarse, one of them half a sample off.
    files.push(tif(here, "coarse.tif", UTM, [503_600.0, 5_000_000.0], [20.0, 20.0], [60, 90], "Int16"));
    files.push(tif(here, "off.tif", UTM, [500_000.0, 4_997_305.0], [15.0, 15.0], [200, 50], "Int16"));
    let names: Vec<&str> = files.iter().map(|path| path.to_str().unwrap()).collect();
    for (name, more, off) in [
        ("highest.vrt", &["-resolution", "highest"][..], 0.0),
        ("average.vrt", &["-resolution", "average"], 0.0),
        ("lowest.vrt", &["-resolution", "lowest"], 0.0),
        ("fixed.vrt", &["-tr", "7", "13"], 0.0),
        ("tap.vrt", &["-tr", "8", "8", "-tap"], 0.0),
        ("marked.vrt", &["-srcnodata", "-9999", "-vrtnodata", "-9999"], 0.0),
        ("other.vrt", &["-vrtnodata", "-1234"], 0.0),
        ("bilinear.vrt", &["-resolution", "highest", "-r", "bilinear"], 1.0),
        ("extent.vrt", &["-te", "500113", "4997011", "503001", "4999504"], 0.0),
        ("hidden.vrt", &["-hidenodata", "-vrtnodata", "77"], 0.0),
    ] {
        let vrt = here.join(name);
        run(here, "gdalbuildvrt", &[&["-q"], more, &[vrt.to_str().unwrap()], &names[..]].concat());
        let uncovered = match name {
            "other.vrt" => -1234.0,
            "hidden.vrt" => 77.0,
            _ => -9999.0,
        };
        agrees(&vrt, &read(std::slice::from_ref(&vrt), &OpenOptions::default()), off, uncovered);
    }
    let vrt = here.join("separate.vrt");
    run(here, "gdalbuildvrt", &[&["-q", "-separate", vrt.to_str().unwrap()], &names[..3]].concat());
    let refused = open_with(&[vrt], &OpenOptions::default()).err().unwrap().to_string();
    assert!(refused.contains("3 bands") && refused.contains("-separate"), "{refused}");
}

#[test]
#[ignore = "needs GDAL's tools"]
fn virtual_rasters_of_gdal_translate_are_read() {
    let folder = tempdir().unwrap();
    let here = folder.path();
    tif(here, "whole.tif", UTM, [500_000.0, 5_000_000.0], [10.0, 10.0], [150, 130], "Int16");
    tif(here, "real.tif", UTM, [500_000.0, 5_000_000.0], [10.0, 10.0], [150, 130], "Float32");
    tif(here, "smooth.tif", UTM, [500_000.0, 5_000_000.0], [10.0, 10.0], [150, 130], "Float32");
    for (name, from, more, off) in [
        ("plain.vrt", "whole.tif", &[][..], 0.0),
        ("window.vrt", "whole.tif", &["-srcwin", "10", "20", "77", "55"][..], 0.0),
        ("fraction.vrt", "real.tif", &["-srcwin", "10.25", "20.5", "77.5", "55.25"], 0.0),
        ("smaller.vrt", "whole.tif", &["-outsize", "50%", "40%"], 0.0),
        ("larger.vrt", "real.tif", &["-outsize", "333", "401"], 0.0),
        ("scaled.vrt", "whole.tif", &["-scale", "0", "1000", "100", "300", "-ot", "Float32"], 1e-3),
        (
            "whole-scaled.vrt",
            "real.tif",
            &["-scale", "0", "1000", "0", "255", "-ot", "Int16", "-a_nodata", "-1"],
            0.0,
        ),
        (
            "power.vrt",
            "real.tif",
            &["-scale", "0", "1000", "0", "800", "-exponent", "0.5", "-ot", "Float32"],
            1e-3,
        ),
        ("bytes.vrt", "whole.tif", &["-ot", "Byte", "-a_nodata", "none"], 0.0),
        ("marked.vrt", "whole.tif", &["-a_nodata", "500"], 0.0),
        ("offset.vrt", "whole.tif", &["-a_scale", "0.1", "-a_offset", "20"], 0.0),
        ("soft.vrt", "smooth.tif", &["-outsize", "300", "260", "-r", "bilinear"], 1e-3),
        // At the rim GDAL repeats samples, and here the weights of those that are there add up to 1.
        ("cubic.vrt", "smooth.tif", &["-outsize", "300", "260", "-r", "cubic"], 0.6),
        ("mean.vrt", "smooth.tif", &["-outsize", "50", "65", "-r", "average"], 1e-3),
    ] {
        let vrt = here.join(name);
        run(here, "gdal_translate", &[&["-q", "-of", "VRT"], more, &[from, name]].concat());
        let grid = read(
            std::slice::from_ref(&vrt),
            &OpenOptions { spacing_is_stated: true, ..OpenOptions::default() },
        );
        let marks = match name {
            "marked.vrt" => 500.0,
            "whole-scaled.vrt" => -1.0,
            _ => -9999.0,
        };
        agrees(&vrt, &grid, off, marks);
    }
    // Nested, over files of another folder.
    std::fs::create_dir(here.join("deep")).unwrap();
    let names = ["window.vrt", "plain.vrt"].map(|name| here.join(name).display().to_string());
    run(
        here,
        "gdalbuildvrt",
        &[&["-q", "deep/nested.vrt"], &names.each_ref().map(String::as_str)[..]].concat(),
    );
    let nested = here.join("deep/nested.vrt");
    agrees(&nested, &read(std::slice::from_ref(&nested), &OpenOptions::default()), 0.0, -9999.0);
    // What GDAL warps on the way is refused.
    run(here, "gdalwarp", &["-q", "-of", "VRT", "-t_srs", "EPSG:3035", "whole.tif", "warped.vrt"]);
    let refused = open_with(&[here.join("warped.vrt")], &OpenOptions::default()).err().unwrap().to_string();
    assert!(refused.contains("VRTWarpedDataset") && refused.contains("gdal_translate"), "{refused}");
    // A mask of its own.
    let masked = ["-q", "-mask", "1", "-co", "TILED=YES", "whole.tif", "masked.tif"];
    try_run(here, "gdal_translate", &masked, true).unwrap();
    run(here, "gdal_translate", &["-q", "-of", "VRT", "masked.tif", "masked.vrt"]);
    let grid = read(&[here.join("masked.vrt")], &OpenOptions::default());
    let wanted = read(&[here.join("masked.tif")], &OpenOptions::default());
    assert_eq!(grid.checksum(), wanted.checksum());
}

/// Copernicus GLO-30: samples stand for points, tiles have fewer columns towards the poles.
#[test]
#[ignore = "needs GDAL's tools"]
fn tiles_that_narrow_towards_the_poles_are_those_of_gdalwarp() {
    let folder = tempdir().unwrap();
    let here = folder.path();
    let rows = 120.0;
    let mut files = Vec::new();
    for (lat, columns) in [(49u32, 120u32), (50, 80), (60, 60)] {
        for lon in [10u32, 11] {
            let step = [1.0 / f64::from(columns), 1.0 / rows];
            // The first sample stands on the corner.
            let corner = [f64::from(lon) - step[0] / 2.0, f64::from(lat + 1) + step[1] / 2.0];
            files.push(tif(
                here,
                &format!("N{lat}E{lon}.tif"),
                "EPSG:4326",
                corner,
                step,
                [columns, 120],
                "Float32",
            ));
        }
    }
    let near: Vec<PathBuf> = files[..4].to_vec();
    let grid = read(&near, &OpenOptions::default());
    assert_eq!([grid.info.samples_wide, grid.info.samples_high], [240, 240]);
    // The finest are copied.
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    assert!((map[0] - 10.0).abs() < 1e-9 && (map[3] - 51.0).abs() < 1e-9, "{map:?}");
    let alone = read(&files[..1], &OpenOptions::default());
    for row in 0..120 {
        for col in 0..120 {
            let (got, wanted) = (grid.at(col, row + 120), alone.at(col, row));
            assert!(got == wanted || got.is_nan() && wanted.is_nan(), "{col} {row}: {got} {wanted}");
        }
    }
    warped_alike(here, &near, &grid, "EPSG:4326", "glo.tif");
    // A gap between 51 and 60 degrees is void.
    let all = read(&files, &OpenOptions::default());
    assert_eq!([all.info.samples_wide, all.info.samples_high], [240, 1440]);
    assert!((0..240).all(|col| all.at(col, 700).is_nan()) && all.voids() < 240 * 1440 * 9 / 10);
}

/// Warps a VRT of each run of files on one grid, one over the other, onto our grid.
fn warped_alike(folder: &Path, files: &[PathBuf], grid: &Grid, system: &str, name: &str) {
    let map = grid.info.georeference.pixel_to_crs.unwrap();
    let [wide, high] = [grid.info.samples_wide, grid.info.samples_high];
    let (west, north) = (map[0] - 0.5 * map[1], map[3] - 0.5 * map[5]);
    let extent = [west, north + map[5] * f64::from(high), west + map[1] * f64::from(wide), north];
    let extent = extent.map(|value| format!("{value:.12}"));
    let size = [wide.to_string(), high.to_string()];
    let mut arguments = vec![
        "-q",
        "-overwrite",
        "-et",
        "0",
        "-t_srs",
        system,
        "-r",
        "bilinear",
        "-dstnodata",
        "-9999",
        "-ot",
        "Float32",
        "-te",
    ];
    arguments.extend(extent.iter().map(String::as_str));
    arguments.extend(["-ts", &size[0], &size[1]]);
    // From the lowest to the highest.
    let names: Vec<&str> = files.iter().rev().map(|path| path.to_str().unwrap()).collect();
    arguments.extend(names);
    arguments.push(name);
    run(folder, "gdalwarp", &arguments);
    let theirs = read(
        &[folder.join(name)],
        &OpenOptions { as_stored: true, spacing_is_stated: true, ..OpenOptions::default() },
    );
    let width = wide as usize;
    let steepest = |at: usize| {
        let around = [at.wrapping_sub(1), at + 1, at.wrapping_sub(width), at + width];
        let step =
            around.iter().filter_map(|other| Some((theirs.samples.get(*other)? - theirs.samples[at]).abs()));
        step.filter(|step| !step.is_nan()).fold(1.0, f64::max)
    };
    let (mut both, mut voids, mut off) = (0, 0, 0);
    for (at, (a, b)) in grid.samples.iter().zip(&theirs.samples).enumerate() {
        match (a.is_nan(), b.is_nan()) {
            (false, false) => {
                both += 1;
                off += usize::from((a - b).abs() > 0.05 * steepest(at));
            }
            (true, true) => {}
            _ => voids += 1,
        }
    }
    println!("{name}: {both} heights, {off} off, {voids} void on one side");
    // GDAL warps each file for itself, so that within half a sample of its edge it has no neighbour; here it has. The same of voids.
    assert!(both > 1000 && off * 50 < both && voids * 50 < both, "{name}: {off} and {voids} of {both}");
}

/// Files in unlike systems and of unlike steps, brought to one, and to another by name.
#[test]
#[ignore = "needs GDAL's tools"]
fn unlike_systems_and_steps_are_those_of_gdalwarp() {
    let folder = tempdir().unwrap();
    let here = folder.path();
    let base = tif(here, "base.tif", UTM, [500_000.0, 5_003_000.0], [10.0, 10.0], [300, 300], "Float32");
    let half = tif(here, "half.tif", UTM, [502_500.0, 5_004_000.0], [25.0, 25.0], [120, 120], "Float32");
    let other =
        tif(here, "other.tif", "EPSG:3035", [4_322_800.0, 2_453_500.0], [30.0, 30.0], [160, 160], "Float32");
    let degrees =
        tif(here, "degrees.tif", "EPSG:4326", [9.02, 45.19], [0.0004, 0.0003], [130, 150], "Float32");
    for (name, files, reproject) in [
        ("steps.tif", vec![base.clone(), half.clone()], None),
        ("systems.tif", vec![base.clone(), other.clone()], None),
        ("all.tif", vec![degrees.clone(), base.clone(), half.clone(), other.clone()], None),
        ("named.tif", vec![base, degrees, half, other], Some("EPSG:3857")),
    ] {
        let options = OpenOptions {
            priority: Priority::First,
            reproject: reproject.map(str::to_owned),
            resolution: reproject.map(|_| 20.0),
            ..OpenOptions::default()
        };
        let grid = read(&files, &options);
        warped_alike(here, &files, &grid, reproject.unwrap_or(UTM), name);
    }
}

/// Files on both sides of 180 degrees, in degrees and in the zones that meet there.
#[test]
#[ignore = "needs GDAL's tools"]
fn files_on_both_sides_of_180_degrees_are_those_of_gdalwarp() {
    const ZONE: &str = "EPSG:32660";
    let folder = tempdir().unwrap();
    let here = folder.path();
    let steps = [0.001, 0.000_8];
    let west = tif(here, "west.tif", "EPSG:4326", [179.6, 52.0], steps, [400, 250], "Float32");
    let east = tif(here, "eastern.tif", "EPSG:4326", [-180.0, 52.0], steps, [300, 250], "Float32");
    // 52 N, 179.9 E and 179.9 W.
    let last = tif(here, "zone-60.tif", ZONE, [690_000.0, 5_770_000.0], [50.0, 50.0], [250, 250], "Float32");
    let first =
        tif(here, "zone-1.tif", "EPSG:32601", [295_000.0, 5_770_000.0], [50.0, 50.0], [250, 250], "Float32");
    for (name, files, reproject) in [
        ("degrees.tif", vec![west.clone(), east.clone()], Some(ZONE)),
        ("zones.tif", vec![last.clone(), first.clone()], None),
        ("mixed.tif", vec![last, east, first, west], Some(ZONE)),
    ] {
        let options = OpenOptions {
            priority: Priority::First,
            reproject: reproject.map(str::to_owned),
            resolution: reproject.map(|_| 60.0),
            ..OpenOptions::default()
        };
        let grid = read(&files, &options);
        // What lies apart would make a grid around the globe.
        assert!(grid.info.samples_wide < 1200, "{name}: {}", grid.info.samples_wide);
        // Of systems of as many samples the first file's counts, by name.
        warped_alike(here, &files, &grid, reproject.unwrap_or("EPSG:32601"), name);
    }
}
