//! Synthetic terrain: readable, the same for any number of threads, the same land at any resolution.

mod import_support;

use std::path::Path;
use std::sync::Mutex;

use import_support::{Grid, read};
use tempfile::tempdir;
use terrasoar_import::synth;
use terrasoar_import::synth::SynthOptions;
use terrasoar_layout::dem::HorizontalUnit;

fn made(folder: &Path, name: &str, options: &SynthOptions) -> Grid {
    let path = folder.join(name);
    synth::write(options, &path, &|_| ()).unwrap();
    read(&[path]).unwrap()
}

#[test]
fn png_and_geotiff_say_the_same() {
    let folder = tempdir().unwrap();
    let options = SynthOptions::default().size(257).seed(5).spacing_m(640.0);
    let tiff = made(folder.path(), "t.tif", &options);
    let png = made(folder.path(), "t.png", &options);
    assert!(tiff.samples == png.samples);
    for info in [&tiff.info, &png.info] {
        assert_eq!((info.height_scale, info.georeference.unit), (0.1, HorizontalUnit::Metre));
        assert_eq!(info.georeference.pixel_to_crs, Some([0.0, 640.0, 0.0, 163_840.0, 0.0, -640.0]));
    }
    let highest = tiff.samples.iter().copied().fold(0.0, f64::max) / 10.0;
    assert!((3500.0..4600.0).contains(&highest), "{highest}");
    let sea = tiff.samples.iter().filter(|height| **height == 0.0).count() as f64 / tiff.samples.len() as f64;
    assert!((0.05..0.3).contains(&sea), "{sea}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "a temporary file was left");
}

#[test]
fn threads_do_not_matter() {
    let folder = tempdir().unwrap();
    let options = SynthOptions::default().size(2049).seed(9).spacing_m(20.0);
    let files = [1, 3].map(|threads| {
        let path = folder.path().join(format!("{threads}.tif"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| synth::write(&options, &path, &|_| ())).unwrap();
        std::fs::read(path).unwrap()
    });
    assert!(files[0] == files[1]);
}

#[test]
fn resolution_changes_detail_only() {
    let folder = tempdir().unwrap();
    let extent_m = 163_840.0;
    let of = |size: u32| {
        made(
            folder.path(),
            "t.tif",
            &SynthOptions::default().size(size).seed(2).spacing_m(extent_m / f64::from(size - 1)),
        )
    };
    let (coarse, fine) = (of(129), of(2049));
    let mut difference = 0.0;
    for row in 0..129 {
        for col in 0..129 {
            difference += (coarse.at(col, row) - fine.at(col * 16, row * 16)).abs() / 10.0;
        }
    }
    let mean_m = difference / (129.0 * 129.0);
    assert!(mean_m < 15.0, "the landscapes differ by {mean_m} m");
    let seeds = made(folder.path(), "u.tif", &SynthOptions::default().size(129).seed(3).spacing_m(1280.0));
    assert!(seeds.samples != coarse.samples);
}

#[test]
fn progress_ends_at_the_last_row() {
    let folder = tempdir().unwrap();
    let told = Mutex::new(Vec::new());
    let options = SynthOptions::default().size(513);
    synth::write(&options, &folder.path().join("t.tif"), &|rows| told.lock().unwrap().push(rows)).unwrap();
    let told = told.into_inner().unwrap();
    assert!(told.is_sorted());
    assert_eq!(told.last(), Some(&513));
}

#[test]
fn mistakes_are_explained() {
    let folder = tempdir().unwrap();
    let fails = |size: u32, spacing_m: f64, name: &str| {
        let options = SynthOptions::default().size(size).seed(0).spacing_m(spacing_m);
        synth::write(&options, &folder.path().join(name), &|_| ()).unwrap_err().to_string()
    };
    assert!(fails(1000, 20.0, "t.tif").contains("take 1025"));
    assert!(fails(0, 20.0, "t.tif").contains("take 3"));
    assert!(fails(u32::MAX, 20.0, "t.tif").contains("take 1048577"));
    assert!(fails(129, 0.0, "t.tif").contains("spacing"));
    assert!(fails(129, f64::NAN, "t.tif").contains("spacing"));
    assert!(fails(129, 20.0, "t.jpg").contains(".tif or .png"));
    assert!(fails(129, 20.0, "no/such/folder/t.tif").contains("cannot create"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
