//! Exported heights against GDAL's reading of what they were made from, and the files against GDAL's check of cloud-optimised ones.
//!
//! Ignored, and so reported, unless asked for: `cargo test -p terrasoar-import --test import_gdal_export -- --ignored`.

#[path = "import_support/gdal.rs"]
mod gdal;
mod import_support;

use gdal::{run, values};
use import_support::{Random, data, fixtures};
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::tempdir;
use terrasoar_import::export::export_heights;
use terrasoar_import::synth::{SynthOptions, write};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::read::window::SampleWindow;

/// Builds `path` and exports it; nothing where every sample is void.
fn exported(path: &Path, out: &Path) -> Option<Terrain> {
    let built = out.with_extension("iqt");
    let dem = terrasoar_import::open(&[path.to_owned()]).unwrap();
    match build(&*dem, &built, &BuildOptions::default().spacing_m([10.0, 10.0]), &Silent) {
        Err(error) if error.to_string().contains("every sample is void") => return None,
        built => built.unwrap(),
    };
    let terrain = Terrain::open(&built).unwrap();
    export_heights(&terrain, &SampleWindow::of(terrain.grid()), None, out, &Silent).unwrap();
    Some(terrain)
}

/// Compares the export of a file with the file, both as GDAL reads them: heights at random places, to the bit at the step of heights, and where they lie. Files whose rows GDAL has in our order.
fn agrees(path: &Path, folder: &Path) {
    let shown = path.display();
    let dem = terrasoar_import::open(&[path.to_owned()]).unwrap();
    let info = dem.info().clone();
    let out = folder.join("out.tif");
    let Some(terrain) = exported(path, &out) else { return };
    let [wide, high] = [info.samples_wide, info.samples_high];
    let mut random = Random(u64::from(wide) * 7 + u64::from(high));
    let mut places: Vec<(u32, u32)> =
        (0..500).map(|_| (random.below(wide.into()) as u32, random.below(high.into()) as u32)).collect();
    places.extend([(0, 0), (wide - 1, 0), (0, high - 1), (wide - 1, high - 1)]);
    let step = terrain.header().scale.height_step_m;
    let mut heights = 0;
    for ((place, source), found) in places.iter().zip(values(path, &places)).zip(values(&out, &places)) {
        let is_void = found.is_nan() || found == -32768.0;
        if is_void {
            // What is void is GDAL's no data, or behind its mask; the files' own tests say which.
            continue;
        }
        heights += 1;
        let wanted = source * info.height_scale + info.height_offset_m;
        assert_eq!(
            (found / step).round(),
            (wanted / step).round(),
            "{shown} at {place:?}: {found}, {wanted} m"
        );
        let rounding = if wanted.fract() == 0.0 && wanted.abs() < 16e6 { 0.0 } else { 6e-8 * wanted.abs() };
        assert!((found - wanted).abs() <= rounding, "{shown} at {place:?}: {found}, GDAL says {wanted} m");
    }
    assert!(heights > 10, "{shown}: {heights} heights");
    let said = run(folder, "gdalinfo", &["out.tif"]);
    assert!(said.contains("LAYOUT=COG") && said.contains("Unit Type: m"), "{shown}: {said}");
    assert!(said.contains("AREA_OR_POINT=Point"), "{shown}: {said}");
    check_place(path, &out, folder);
    if wide > 1000 {
        validate(&out);
    }
}

/// The numbers behind a key of what gdalinfo says as JSON.
fn numbers(json: &str, key: &str) -> Option<Vec<f64>> {
    let rest = json.split_once(&format!("\"{key}\":"))?.1;
    let inside = rest.split_once('[')?.1.split_once(']')?.0;
    Some(inside.split(',').map(|number| number.trim().parse().unwrap()).collect())
}

/// GDAL finds both files at the same place, where the source has one that GDAL reads.
fn check_place(path: &Path, out: &Path, folder: &Path) {
    let said = |path: &Path| run(folder, "gdalinfo", &["-json", path.to_str().unwrap()]);
    let Some(wanted) = numbers(&said(path), "geoTransform") else { return };
    let found = numbers(&said(out), "geoTransform").unwrap();
    let size = wanted[1].abs().max(wanted[2].abs());
    for (found, wanted) in found.iter().zip(&wanted) {
        assert!(
            (found - wanted).abs() <= 1e-9 * wanted.abs().max(size),
            "{}: {found} {wanted}",
            path.display()
        );
    }
    let proj =
        |path: &Path| run(folder, "gdalsrsinfo", &["-o", "proj4", path.to_str().unwrap()]).trim().to_owned();
    let wanted = proj(path);
    if !wanted.is_empty() {
        let found = proj(out);
        // Which unit heights had is the file's affair no more.
        let plain = |text: &str| {
            let words = text
                .split_whitespace()
                .filter(|word| !word.starts_with("+vunits") && !word.starts_with("+vto_meter"));
            words.collect::<Vec<_>>().join(" ")
        };
        assert_eq!(plain(&found), plain(&wanted), "{}", path.display());
    }
}

/// Python's check of cloud-optimised files comes with gdal-bin.
fn validate(path: &Path) {
    let arguments = ["-m", "osgeo_utils.samples.validate_cloud_optimized_geotiff"];
    let checked = Command::new("/usr/bin/python3").args(arguments).arg(path).output();
    let Ok(output) = checked else { return };
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    if !said.contains("No module named") {
        assert!(said.contains("is a valid cloud optimized GeoTIFF") && !said.contains("warning"), "{said}");
    }
}

#[test]
#[ignore = "needs gdal-bin"]
fn fixtures_and_real_terrain() {
    let folder = tempdir().unwrap();
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(fixtures()).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| {
        let name = path.to_string_lossy();
        // Turned grids are resampled, and masked and inverted ones are not the numbers that GDAL prints.
        path.extension().is_some_and(|e| e == "tif")
            && ["refused-", "rotated", "min-is-white", "mask"].iter().all(|word| !name.contains(word))
            && gdal::tools::unpacks(path)
    });
    paths.extend(["puget_sound_1025.png", "crater_lake_1025.bt"].map(data));
    let large = folder.path().join("large.tif");
    write(&SynthOptions::default().size(1025), &large, &|_| ()).unwrap();
    paths.push(large);
    assert!(paths.len() > 40);
    paths.iter().for_each(|path| agrees(path, folder.path()));
}

/// Systems with a code, with parameters alone, with heights in feet: GDAL finds the same.
#[test]
#[ignore = "needs gdal-bin"]
fn places_are_gdals() {
    let folder = tempdir().unwrap();
    write(&SynthOptions::default().size(65), &folder.path().join("plain.tif"), &|_| ()).unwrap();
    for (system, corners) in [
        ("EPSG:32632", ["500000", "5000000", "501300", "4998700"]),
        ("EPSG:4326", ["7", "47", "7.13", "46.87"]),
        ("EPSG:2263", ["980000", "201300", "981300", "200000"]),
        ("EPSG:26918+5703", ["500000", "4500000", "501300", "4498700"]),
        ("EPSG:2056", ["2600000", "1200000", "2601300", "1198700"]),
        ("EPSG:28992", ["155000", "463000", "156300", "461700"]),
        ("EPSG:3413", ["100000", "-2000000", "101300", "-2001300"]),
        ("EPSG:3857", ["900000", "6000000", "901300", "5998700"]),
        (
            "+proj=tmerc +lat_0=40 +lon_0=9 +k=0.9999 +x_0=3000 +y_0=7000 +ellps=bessel +units=m +no_defs",
            ["5000", "9000", "6300", "7700"],
        ),
        (
            "+proj=lcc +lat_0=46.5 +lon_0=3 +lat_1=49 +lat_2=44 +x_0=700000 +y_0=6600000 +ellps=GRS80 +units=m +no_defs",
            ["600000", "6500000", "601300", "6498700"],
        ),
        (
            "+proj=aea +lat_1=29.5 +lat_2=45.5 +lat_0=23 +lon_0=-96 +x_0=0 +y_0=0 +ellps=GRS80 +units=us-ft +no_defs",
            ["100000", "2000000", "101300", "1998700"],
        ),
        (
            "+proj=laea +lat_0=52 +lon_0=10 +x_0=4321000 +y_0=3210000 +ellps=GRS80 +units=m +no_defs",
            ["4300000", "3200000", "4301300", "3198700"],
        ),
        ("+proj=longlat +a=1737400 +b=1737400 +no_defs", ["7", "47", "7.13", "46.87"]),
    ] {
        let a_srs: Vec<&str> = ["-q", "-a_srs", system, "-a_ullr"]
            .into_iter()
            .chain(corners)
            .chain(["plain.tif", "placed.tif"])
            .collect();
        run(folder.path(), "gdal_translate", &a_srs);
        let (path, out) = (folder.path().join("placed.tif"), folder.path().join("out.tif"));
        exported(&path, &out).unwrap();
        check_place(&path, &out, folder.path());
        validate(&out);
    }
}
