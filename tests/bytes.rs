//! Terrain files that are bytes in memory: what a program flies that has no files, a web page for one.

use terrasoar::ground::PictureEngine;
use terrasoar::refine::Culling;
use terrasoar::{Ground, MappedTerrain, StreamOptions, Terrain, View};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::file::source::MemorySource;
use terrasoar_layout::progress::Silent;

/// A file of 257 x 257 samples 30 m apart, and where it is.
fn file() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("land.iqt");
    let dem = MemoryDem::from_fn([257, 257], SampleType::I16, |x, y| f64::from((x * 7) ^ (y * 5)));
    build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 30.0]), &Silent).unwrap();
    (folder, path)
}

/// The triangles of the last of some views, in order.
fn flown(ground: &mut Ground<'_>) -> Vec<String> {
    for step in 0..5 {
        let view = View::new([3800.0, 500.0 + 200.0 * f64::from(step), 900.0], 10.0, -20.0).tolerance_px(2.0);
        ground.update(&view);
        while ground.is_waiting() {
            std::thread::sleep(std::time::Duration::from_millis(1));
            ground.update(&view);
        }
    }
    let mut triangles = Vec::new();
    ground.for_each_triangle(&mut |corners| triangles.push(format!("{corners:?}")));
    triangles.sort();
    triangles
}

#[test]
fn bytes_fly_as_their_file_does() {
    let (_folder, path) = file();
    let bytes = std::fs::read(&path).unwrap();
    let mapped = |terrain: &MappedTerrain| {
        let mut ground = terrain.ground(PictureEngine::Kinetic, Culling::Vertices).unwrap();
        (flown(&mut ground), ground.height_at(3805.0, 1234.0).height_m)
    };
    let from_file = mapped(&MappedTerrain::open(&path).unwrap());
    assert!(from_file.0.len() > 1000 && from_file.1.is_some());
    assert_eq!(mapped(&MappedTerrain::from_bytes("land.iqt", bytes.clone()).unwrap()), from_file);

    let terrain = Terrain::from_source(Box::new(MemorySource::new("land.iqt", bytes))).unwrap();
    let mut streamed = terrain.stream(StreamOptions::default().cache_mib(4)).unwrap();
    assert_eq!(flown(&mut streamed), from_file.0);
}

#[test]
fn bytes_that_are_no_terrain_are_refused() {
    let (_folder, path) = file();
    let bytes = std::fs::read(&path).unwrap();
    let cut = bytes[..bytes.len() / 2].to_vec();
    let error = MappedTerrain::from_bytes("half.iqt", cut).unwrap_err().to_string();
    assert!(error.contains("half.iqt") && error.contains("cut short"), "{error}");
    assert!(MappedTerrain::from_bytes("none", Vec::new()).is_err());
}
