//! Little terrains in memory and views of them, for the tests of this package and of those above it.

use crate::view::{ErrorMetric, View, Viewport};
use glam::DVec3;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::file::source::MemorySource;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

fn terrain(samples: [u32; 2]) -> Terrain {
    let dem = MemoryDem::from_fn(samples, SampleType::I16, |x, y| {
        let hash = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
        300.0 + 90.0 * (f64::from(x) / 17.0).sin() * (f64::from(y) / 11.0).cos() + f64::from(hash >> 28)
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    let options = BuildOptions::default().spacing_m([10.0, 12.0]);
    build(&dem, &path, &options, &Silent).unwrap();
    let bytes = std::fs::read(path).unwrap();
    Terrain::from_source(Box::new(MemorySource::new("memory", bytes))).unwrap()
}

/// 2^k + 1 samples a side.
pub fn square_terrain(k: u32) -> Terrain {
    terrain([(1 << k) + 1; 2])
}

/// A third of the square is padding.
pub fn padded_terrain() -> Terrain {
    terrain([129, 70])
}

/// A view from a point given in fractions of the terrain's extent.
pub fn view_at(terrain: &Terrain, at: [f64; 2], yaw_rad: f64) -> View {
    let [w, h] = terrain.grid().extent_m();
    View {
        eye_m: DVec3::new(at[0] * w, at[1] * h, 520.0),
        yaw_rad,
        pitch_rad: -0.3,
        roll_rad: 0.0,
        vertical_fov_rad: 0.8,
        viewport: Viewport { width_px: 320, height_px: 240 },
        tolerance_px: 1.0,
        vertical_exaggeration: 1.0,
        metric: ErrorMetric::default(),
    }
}
