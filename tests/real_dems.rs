//! The promises on real elevation data: the committed DEMs, built with the bounded error, flown over, every sample in view measured.

mod common;

use common::checks::{check_conforming, check_tolerance, keys, triangles, views};
use common::frame;
use std::path::Path;
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Unobserved};
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Builds and opens a committed DEM.
fn built(name: &str, options: &BuildOptions) -> (tempfile::TempDir, Terrain) {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("t.iqt");
    let dem = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name);
    build(&*terrasoar_import::open(&[dem]).unwrap(), &out, options, &Silent).unwrap();
    let terrain = Terrain::open(&out).unwrap();
    (folder, terrain)
}

/// Flies low over the terrain's middle, then high from a corner.
fn fly(terrain: &Terrain, tolerance_px: f64) {
    let [low, high] = terrain.header().height_range_m;
    let near = (0..4)
        .map(|i| frame(terrain, [0.5, 0.3 + 0.004 * f64::from(i)], high + 50.0, 25.0 * f64::from(i), -20.0));
    let far = (0..2)
        .map(|i| frame(terrain, [0.05, 0.05], high + 3.0 * (high - low), 40.0 + 5.0 * f64::from(i), -15.0));
    with_records!(terrain.records().unwrap(), records => {
        let mut naive = Naive::new(records.clone(), Culling::Vertices);
        let mut soar = Soar::new(records.clone(), Culling::Vertices);
        let mut smart = Smart::new(records.clone(), Culling::Vertices);
        for view in views(near.chain(far), tolerance_px) {
            naive.update(&view, &mut Unobserved);
            soar.update(&view, &mut Unobserved);
            smart.update(&view, &mut Unobserved);
            let expected = triangles(&naive);
            assert!(expected.len() > 300, "only {} triangles: the flight shows nothing", expected.len());
            check_conforming(&records, &expected);
            check_tolerance(&records, &view, &expected);
            assert!(keys(&triangles(&soar)) == keys(&expected));
            assert!(keys(&triangles(&smart)) == keys(&expected));
        }
    });
}

#[test]
fn puget_sound() {
    let options = BuildOptions::default().spacing_m([160.0; 2]).z_scale(0.1);
    let (_folder, terrain) = built("puget_sound_1025.png", &options);
    for tolerance_px in [0.5, 1.0, 4.0] {
        fly(&terrain, tolerance_px);
    }
}

#[test]
fn crater_lake() {
    let (_folder, terrain) = built("crater_lake_1025.bt", &BuildOptions::default());
    for tolerance_px in [0.5, 1.0, 4.0] {
        fly(&terrain, tolerance_px);
    }
}
