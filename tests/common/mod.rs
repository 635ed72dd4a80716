//! Small terrains held in memory, for tests of the engines.
#![allow(dead_code, reason = "each test binary uses a part of it")]

pub mod checks;
pub mod mirror;

use terrasoar::flight::FlightFrame;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::edit::{Changes, Editor};
use terrasoar_layout::file::source::MemorySource;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::store::CompleteStore;
use terrasoar_layout::read::terrain::Terrain;

/// Builds a terrain in memory.
pub fn terrain_of(dem: &MemoryDem, options: &BuildOptions) -> Terrain {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    build(dem, &path, options, &Silent).unwrap();
    let bytes = std::fs::read(path).unwrap();
    Terrain::from_source(Box::new(MemorySource::new("memory", bytes))).unwrap()
}

/// Repeatable noise in 0..1.
pub fn noise(seed: u64, x: u32, y: u32) -> f64 {
    let mut h = seed ^ (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((h ^ h >> 32) % 4096) as f64 / 4096.0
}

/// Rugged heights with detail at every scale, in whole metres.
pub fn rugged(seed: u64, x: u32, y: u32) -> f64 {
    let mut height = 800.0;
    for octave in 0..7 {
        let cell = 64u32 >> octave;
        let (fx, fy) = (f64::from(x % cell) / f64::from(cell), f64::from(y % cell) / f64::from(cell));
        let at = |i: u32, j: u32| noise(seed + octave, x / cell + i, y / cell + j) - 0.5;
        let south = at(0, 0) * (1.0 - fx) + at(1, 0) * fx;
        let north = at(0, 1) * (1.0 - fx) + at(1, 1) * fx;
        height += 12.0 * f64::from(cell) * (south * (1.0 - fy) + north * fy);
    }
    height.round()
}

/// A rugged terrain of `samples`, with holes if asked, 10 x 12 m apart.
pub fn rugged_terrain(samples: [u32; 2], seed: u64, holes: bool) -> Terrain {
    let dem = MemoryDem::from_fn(samples, SampleType::I16, |x, y| {
        let hole = x.abs_diff(samples[0] / 3).pow(2) + y.abs_diff(samples[1] / 2).pow(2) < 60
            || noise(seed, y, x) < 0.001;
        if holes && hole && (x, y) != (0, 0) { f64::NAN } else { rugged(seed, x, y) }
    });
    terrain_of(&dem, &BuildOptions::default().spacing_m([10.0, 12.0]))
}

/// Rugged ground of compact records with room for edits below and above: two samples in a corner lie far off.
pub fn roomy_terrain(samples: [u32; 2], seed: u64, holes: bool) -> Terrain {
    let dem = MemoryDem::from_fn(samples, SampleType::I16, |x, y| match (x, y) {
        (0, 0) => -2000.0,
        (1, 0) => 4000.0,
        _ if holes && (x.abs_diff(40).pow(2) + y.abs_diff(50).pow(2) < 80 || noise(seed, y, x) < 0.002) => {
            f64::NAN
        }
        _ => rugged(seed, x, y),
    });
    terrain_of(&dem, &BuildOptions::default().spacing_m([10.0, 12.0]))
}

/// Replaces pages of a store that an edit changed.
pub fn install<S: CompleteStore>(store: &mut EditedRecords<S>, editor: &Editor, changes: &Changes) {
    store.set_height_range_m(editor.header().height_range_m);
    for page in &changes.pages {
        store.install(*page, editor.edited_page(*page).unwrap()).unwrap();
    }
}

/// A frame looking along yaw and pitch, in degrees, from a point given as fractions of the terrain's extent and metres up.
pub fn frame(terrain: &Terrain, at: [f64; 2], up_m: f64, yaw_deg: f64, pitch_deg: f64) -> FlightFrame {
    let [w, h] = terrain.grid().extent_m();
    FlightFrame {
        time_s: 0.0,
        eye_m: [at[0] * w, at[1] * h, up_m],
        yaw_deg,
        pitch_deg,
        roll_deg: 0.0,
        vertical_fov_deg: 45.0,
    }
}
