//! A sink that keeps the whole grid and notices samples pushed twice or never.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use terrasoar_import::OpenOptions;
use terrasoar_layout::dem::{DemInfo, DemSource, SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// The samples of a DEM, row by row.
pub(crate) struct Grid {
    pub(crate) info: DemInfo,
    pub(crate) samples: Vec<f64>,
}

impl Grid {
    pub(crate) fn at(&self, col: u32, row: u32) -> f64 {
        self.samples[row as usize * self.info.samples_wide as usize + col as usize]
    }

    /// Checksum of all samples as little-endian `f64`, voids as one NaN.
    pub(crate) fn checksum(&self) -> u32 {
        let mut hasher = crc32fast::Hasher::new();
        for sample in &self.samples {
            let bits = if sample.is_nan() { 0x7ff8_0000_0000_0000 } else { sample.to_bits() };
            hasher.update(&bits.to_le_bytes());
        }
        hasher.finalize()
    }

    pub(crate) fn voids(&self) -> usize {
        self.samples.iter().filter(|sample| sample.is_nan()).count()
    }
}

struct Keeper {
    width: u32,
    height: u32,
    grid: Mutex<(Vec<f64>, Vec<u8>)>,
}

impl SampleSink for Keeper {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        assert_eq!(samples.len(), window.width as usize * window.height as usize, "{window:?}");
        assert!(window.width > 0 && window.height > 0, "{window:?}");
        assert!(
            window.col + window.width <= self.width && window.row + window.height <= self.height,
            "{window:?}"
        );
        let mut grid = self.grid.lock().unwrap();
        for (row, samples) in samples.chunks_exact(window.width as usize).enumerate() {
            let at = (window.row as usize + row) * self.width as usize + window.col as usize;
            grid.0[at..][..samples.len()].copy_from_slice(samples);
            grid.1[at..][..samples.len()].iter_mut().for_each(|pushed| *pushed += 1);
        }
        Ok(())
    }
}

/// Streams a DEM and checks that every sample came exactly once.
pub(crate) fn collect(dem: &dyn DemSource) -> Result<Grid, LayoutError> {
    let info = dem.info().clone();
    let samples = info.samples_wide as usize * info.samples_high as usize;
    let keeper = Keeper {
        width: info.samples_wide,
        height: info.samples_high,
        grid: Mutex::new((vec![f64::INFINITY; samples], vec![0; samples])),
    };
    dem.stream(&keeper)?;
    let (samples, pushed) = keeper.grid.into_inner().unwrap();
    assert!(pushed.iter().all(|times| *times == 1), "a sample was not pushed exactly once");
    Ok(Grid { info, samples })
}

/// Opens and streams files, rows and columns as they lie in them.
pub(crate) fn read(paths: &[PathBuf]) -> Result<Grid, LayoutError> {
    let options = OpenOptions { as_stored: true, ..OpenOptions::default() };
    collect(&*terrasoar_import::open_with(paths, &options)?)
}

/// The message with which opening or streaming fails.
pub(crate) fn refusal(paths: &[PathBuf]) -> String {
    match read(paths) {
        Ok(_) => panic!("{paths:?} was read"),
        Err(error) => error.to_string(),
    }
}

pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// A file of the project's test data.
pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

/// Deterministic numbers for tests.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mixed = (self.0 ^ (self.0 >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
        (mixed ^ (mixed >> 29)) % limit
    }
}

/// Writes an `.hgt` tile whose height at (col, row) is given.
pub(crate) fn write_hgt(path: &Path, side: u32, height: impl Fn(u32, u32) -> i16) {
    let bytes: Vec<u8> = (0..side * side).flat_map(|i| height(i % side, i / side).to_be_bytes()).collect();
    std::fs::write(path, bytes).unwrap();
}
