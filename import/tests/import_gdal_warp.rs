//! Warps against a live `gdalwarp`, kernel by kernel: every sample within what a twentieth of a sample's shift would change.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_warp -- --ignored`.

mod import_support;
#[path = "import_support/tools.rs"]
mod tools;

use import_support::{Grid, collect};
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::{OpenOptions, Resampling, open_with};

fn run(program: &str, arguments: &[&str]) {
    tools::run(Path::new("."), program, arguments);
}

fn read(path: &Path, options: &OpenOptions) -> Grid {
    collect(&*open_with(&[path.to_owned()], options).unwrap()).unwrap()
}

/// A terrain of hills and some voids as a Float32 GeoTIFF with this map of corners: upper left, lower right.
fn hills(folder: &Path, system: &str, [west, north, east, south]: [f64; 4], samples: [u32; 2]) -> PathBuf {
    let plain = folder.join("hills.asc");
    let [wide, high] = samples;
    let mut text =
        format!("ncols {wide}\nnrows {high}\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9999\n");
    for row in 0..high {
        for col in 0..wide {
            let (x, y) = (f64::from(col), f64::from(row));
            let void = (60..75).contains(&col) && (40..52).contains(&row) || (col * 7 + row * 13) % 331 == 0;
            let height = 500.0 + 200.0 * (x / 9.0).sin() * (y / 11.0).cos() + 3.0 * x - 2.0 * y;
            text.push_str(&if void { "-9999 ".to_owned() } else { format!("{height:.3} ") });
        }
        text.push('\n');
    }
    std::fs::write(&plain, text).unwrap();
    let path = folder.join("hills.tif");
    let corners = [west, north, east, south].map(|value| value.to_string());
    let [plain, tif] = [&plain, &path].map(|path| path.to_str().unwrap().to_owned());
    run(
        "gdal_translate",
        &[
            "-q",
            "-ot",
            "Float32",
            "-a_srs",
            system,
            "-a_ullr",
            &corners[0],
            &corners[1],
            &corners[2],
            &corners[3],
            &plain,
            &tif,
        ],
    );
    path
}

/// Compares what is read of `path` with `options` to what gdalwarp makes on the same grid.
fn agrees(path: &Path, target: &str, options: &OpenOptions, folder: &Path) {
    let ours = read(path, options);
    let map = ours.info.georeference.pixel_to_crs.unwrap();
    let [wide, high] = [ours.info.samples_wide, ours.info.samples_high].map(f64::from);
    let (west, north) = (map[0] - 0.5 * map[1], map[3] - 0.5 * map[5]);
    let extent =
        [west, north + map[5] * high, west + map[1] * wide, north].map(|value| format!("{value:.9}"));
    let size = [ours.info.samples_wide, ours.info.samples_high].map(|count| count.to_string());
    let name = options.resampling.unwrap_or_default().name();
    // GDAL before 3.10 shifts what a widened Lanczos kernel makes by up to a sample: then its cubic kernel tells where the ground lies.
    let is_stand_in = name == "lanczos" && tools::gdal_version() < [3, 10];
    let kernel = match name {
        "nearest" => "near",
        "lanczos" if is_stand_in => "cubic",
        name => name,
    };
    let out = folder.join(format!("{name}.tif"));
    let [from, to] = [path, &out].map(|path| path.to_str().unwrap().to_owned());
    run(
        "gdalwarp",
        &[
            "-q",
            "-overwrite",
            "-et",
            "0",
            "-t_srs",
            target,
            "-r",
            kernel,
            "-dstnodata",
            "-9999",
            "-te",
            &extent[0],
            &extent[1],
            &extent[2],
            &extent[3],
            "-ts",
            &size[0],
            &size[1],
            &from,
            &to,
        ],
    );
    let theirs =
        read(&out, &OpenOptions { as_stored: true, spacing_is_stated: true, ..OpenOptions::default() });
    assert_eq!(ours.samples.len(), theirs.samples.len());
    // How much the terrain changes over a twentieth of a sample: by the steps between neighbours.
    let width = ours.info.samples_wide as usize;
    let steepest = |at: usize| {
        let around = [at.wrapping_sub(1), at + 1, at.wrapping_sub(width), at + width];
        let step =
            around.iter().filter_map(|other| Some((theirs.samples.get(*other)? - theirs.samples[at]).abs()));
        step.filter(|step| !step.is_nan()).fold(1.0, f64::max)
    };
    let (mut voids, mut both, mut other, mut worst) = (0, 0, 0, 0.0f64);
    for (at, (a, b)) in ours.samples.iter().zip(&theirs.samples).enumerate() {
        match (a.is_nan(), b.is_nan()) {
            (false, false) => {
                both += 1;
                let off = (a - b).abs() / steepest(at);
                other += u32::from(off > 0.05);
                worst = worst.max(off);
            }
            (true, true) => {}
            _ => voids += 1,
        }
    }
    // The rim and edges of voids are a rounding's affair: one in two hundred.
    // Of a mean it is also the two corners of a sample's area, which stand for all four.
    let is_mean = options.resampling == Some(Resampling::Average);
    println!(
        "{name} to {target}: {both} samples, {voids} voids differ, worst {worst:.4} of a step, {other} off by more than a twentieth"
    );
    assert!(
        both > 3000 && voids * if is_mean { 30 } else { 200 } <= both,
        "{name}: {voids} of {both} samples are void on one side alone"
    );
    // Of two samples that are as near, either is the nearest one.
    let is_nearest = options.resampling == Some(Resampling::Nearest);
    // Weights beside voids may add up to nearly nothing, and a rounding decides.
    let is_sine = options.resampling == Some(Resampling::Lanczos);
    assert!(
        worst <= 0.05
            || is_nearest && other * 50 <= both
            || is_mean && worst <= 0.2 && other * 50 <= both
            || is_sine && other * if is_stand_in { 6 } else { 10_000 } <= both,
        "{name}: {worst} of a step, {other} of {both}"
    );
}

#[test]
#[ignore = "needs gdalwarp"]
fn kernels_are_those_of_gdal() {
    let folder = tempdir().unwrap();
    let path = hills(folder.path(), "EPSG:4326", [8.0, 46.06, 8.12, 45.96], [120, 100]);
    for resampling in Resampling::ALL {
        for resolution in [None, Some(80.0), Some(300.0)] {
            let options = OpenOptions {
                reproject: Some("utm".into()),
                resampling: Some(resampling),
                resolution,
                ..OpenOptions::default()
            };
            agrees_with_size(&path, "EPSG:32632", &options, folder.path(), resolution);
        }
    }
}

/// Coarse grids have few samples; what is asked of them is the same.
fn agrees_with_size(
    path: &Path,
    target: &str,
    options: &OpenOptions,
    folder: &Path,
    resolution: Option<f64>,
) {
    match resolution {
        Some(metres) if metres > 100.0 => {
            let finer = hills(folder, "EPSG:4326", [8.0, 46.3, 8.36, 45.9], [360, 400]);
            agrees(&finer, target, options, folder);
        }
        _ => agrees(path, target, options, folder),
    }
}

#[test]
#[ignore = "needs gdalwarp"]
fn systems_of_every_kind_are_brought_over() {
    let folder = tempdir().unwrap();
    for (system, corners, target, resolution) in [
        ("EPSG:32632", [500_000.0, 5_010_000.0, 512_000.0, 5_000_000.0], "EPSG:3857", 150.0),
        ("EPSG:2263", [980_000.0, 210_000.0, 992_000.0, 200_000.0], "EPSG:26918", 40.0),
        ("EPSG:3857", [1_200_000.0, 8_410_000.0, 1_212_000.0, 8_400_000.0], "EPSG:3035", 60.0),
        // Near the meridian that the map is upright at. Elsewhere gdalwarp widens kernels by how large a window it happens to read.
        ("EPSG:4326", [-51.0, 70.0, -39.0, 60.0], "EPSG:3413", 9000.0),
    ] {
        let path = hills(folder.path(), system, corners, [120, 100]);
        let options = OpenOptions {
            reproject: Some(target.into()),
            resolution: Some(resolution),
            ..OpenOptions::default()
        };
        agrees(&path, target, &options, folder.path());
    }
}

/// GDAL writes these with keys of the file's own: shifts of datum, prime meridians, an oblique projection, Miller's sphere.
#[test]
#[ignore = "needs gdalwarp"]
fn bodies_and_projections_of_the_files_own_are_brought_over() {
    let folder = tempdir().unwrap();
    for (system, [x, y]) in [
        (
            "+proj=tmerc +lon_0=9 +x_0=3500000 +ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7",
            [3_515_000.0, 5_540_000.0],
        ),
        ("+proj=utm +zone=31 +ellps=intl +towgs84=-87,-98,-121", [600_000.0, 5_000_000.0]),
        (
            "+proj=lcc +lat_1=46.8 +lat_0=46.8 +k_0=0.99987742 +x_0=600000 +y_0=2200000 +a=6378249.2 +b=6356515 +towgs84=-168,-60,320 +pm=paris",
            [600_000.0, 2_200_000.0],
        ),
        ("+proj=tmerc +lat_0=45 +ellps=bessel +pm=ferro", [600_000.0, 100_000.0]),
        (
            "+proj=stere +lat_0=46 +lon_0=3 +k=0.999 +x_0=700000 +y_0=6600000 +datum=WGS84",
            [715_000.0, 6_615_000.0],
        ),
        (
            "+proj=sterea +lat_0=46 +lon_0=3 +k=0.999 +x_0=700000 +y_0=6600000 +datum=WGS84",
            [715_000.0, 6_615_000.0],
        ),
        ("+proj=mill +lon_0=3 +R_A +datum=WGS84", [700_000.0, 5_000_000.0]),
    ] {
        let corners = [x, y + 10_000.0, x + 12_000.0, y];
        let path = hills(folder.path(), system, corners, [120, 100]);
        let options = OpenOptions {
            reproject: Some("EPSG:4326".into()),
            resolution: Some(100.0),
            ..OpenOptions::default()
        };
        agrees(&path, "EPSG:4326", &options, folder.path());
    }
}
