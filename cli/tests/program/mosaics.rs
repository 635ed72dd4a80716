//! Several files by the real program: what is said of lost ones, few open files, virtual rasters that are looked at.

use crate::support::{Bench, text};
use std::fmt::Write;
use std::path::Path;

/// A grid of 9 x 9 samples of 10 m, so many grids east and south.
fn tile(folder: &Path, name: &str, east: u32, south: u32, height: f64) {
    let (west, north) = (500_000 + 90 * east, 5_000_000 - 90 * south);
    let mut grid = format!("ncols 9\nnrows 9\nxllcorner {west}\nyllcorner {}\ncellsize 10\n", north - 90);
    for row in 0..9 {
        for col in 0..9 {
            let _ = write!(grid, "{} ", height + f64::from(row + col));
        }
        grid.push('\n');
    }
    std::fs::write(folder.join(format!("{name}.asc")), grid).unwrap();
    std::fs::write(folder.join(format!("{name}.prj")), "EPSG:32632").unwrap();
}

#[test]
fn lost_files_are_named_and_strict_ends_there() {
    let bench = Bench::new();
    tile(bench.folder(), "a", 0, 0, 100.0);
    tile(bench.folder(), "b", 1, 0, 200.0);
    tile(bench.folder(), "c", 2, 0, 300.0);
    let spoilt = std::fs::read_to_string(bench.path("b.asc")).unwrap().replacen("208", "2o8", 1);
    std::fs::write(bench.path("b.asc"), spoilt).unwrap();
    let typed = ["build", "a.asc", "b.asc", "c.asc", "none.tif", "-o", "all.iqt"];
    let output = bench.run(&typed);
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(
        said.matches("left out").count() == 2 && said.contains("b.asc") && said.contains("none.tif"),
        "{said}"
    );
    let info = bench.json(&["info", "all.iqt", "--json"]);
    assert_eq!(info["nodata_samples"], 81);
    let kept = info["warnings"].to_string();
    assert!(kept.contains("b.asc") && kept.contains("none.tif"), "{kept}");
    let origins = info["origins"].to_string();
    assert!(origins.contains("mosaic of 3 files, a.asc to c.asc, priority finest"), "{origins}");
    bench.good(&["verify", "all.iqt"]);
    let strict = bench.bad(1, &[&typed[..], &["--strict", "--force"]].concat());
    assert!(strict.contains("none.tif"), "{strict}");
    let strict = bench.bad(1, &["build", "a.asc", "b.asc", "-o", "ab.iqt", "--strict"]);
    assert!(strict.contains("b.asc") && !bench.path("ab.iqt").exists(), "{strict}");
    for wrong in [&["--feather", "20"][..], &["--resolution", "5"]] {
        bench.bad(2, &[&["build", "a.asc", "-o", "a.iqt"], wrong].concat());
    }
    bench.bad(2, &["build", "a.asc", "c.asc", "-o", "ac.iqt", "--priority", "lowest"]);
    let none = bench.bad(1, &["build", "*.tif", "-o", "x.iqt"]);
    assert!(none.contains("no file has a name that fits"), "{none}");
}

/// A thousand files, of which never more than some are open, whatever the number of threads.
#[cfg(unix)]
#[test]
fn a_thousand_files_need_few_open_ones() {
    let bench = Bench::new();
    for number in 0..1000 {
        tile(bench.folder(), &format!("t{number:03}"), number % 40, number / 40, f64::from(number));
    }
    let script = format!(
        "ulimit -n 64; exec '{}' build '*.asc' -o all.iqt --threads 8 --memory 96",
        env!("CARGO_BIN_EXE_terrasoar")
    );
    let output =
        std::process::Command::new("sh").args(["-c", &script]).current_dir(bench.folder()).output().unwrap();
    let said = text(&output.stderr);
    assert!(output.status.success() && !said.contains("left out"), "{said}");
    assert!(text(&output.stdout).starts_with("all.iqt: 360 x 225 samples"), "{}", text(&output.stdout));
    assert_eq!(bench.json(&["info", "all.iqt", "--json"])["nodata_samples"], 0);
}

/// What is looked at without a build of one's own is built again when a file that a virtual raster names is another.
#[test]
fn virtual_rasters_are_looked_at_and_follow_their_files() {
    let bench = Bench::new();
    tile(bench.folder(), "a", 0, 0, 100.0);
    std::fs::write(
        bench.path("v.vrt"),
        "<VRTDataset rasterXSize=\"9\" rasterYSize=\"9\"><SRS>EPSG:32632</SRS><GeoTransform>500000,10,0,5000000,0,-10</GeoTransform>\
         <VRTRasterBand dataType=\"Float32\" band=\"1\"><SimpleSource><SourceFilename relativeToVRT=\"1\">a.asc</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>",
    )
    .unwrap();
    let lowest = || bench.json(&["info", "v.vrt", "--json"])["height_range_m"][0].clone();
    assert_eq!(lowest(), 100.0);
    tile(bench.folder(), "a", 0, 0, 1000.0);
    assert_eq!(lowest(), 1000.0);
}
