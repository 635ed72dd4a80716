//! Elevation data held in memory, and terrain files made of it.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use rayon::prelude::*;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
pub mod drape;
pub mod edits;
pub mod packed;
pub mod paint;
pub mod paint_reference;

pub use terrasoar_layout::dem::MemoryDem;
use terrasoar_layout::dem::{DemInfo, DemSource, SampleSink, SampleType, Window};
use terrasoar_layout::read::terrain::Terrain;

/// Builds a file from `dem` and returns its bytes.
pub fn build_bytes(dem: &MemoryDem, options: &BuildOptions) -> Result<Vec<u8>, LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    build(dem, &path, options, &Silent)?;
    Ok(std::fs::read(path).unwrap())
}

/// Opens a terrain over bytes in memory.
pub fn open_bytes(bytes: Vec<u8>) -> Result<Terrain, LayoutError> {
    Terrain::from_source(Box::new(terrasoar_layout::file::source::MemorySource::new("memory", bytes)))
}

/// A rectangle of ground in a sea of voids, in samples from the south-west one.
#[derive(Debug, Clone, Copy)]
pub struct Island {
    pub west: u32,
    pub south: u32,
    pub wide: u32,
    pub high: u32,
}

impl Island {
    fn contains(&self, x: u32, y: u32) -> bool {
        (self.west..self.west + self.wide).contains(&x) && (self.south..self.south + self.high).contains(&y)
    }
}

/// A square of voids with islands that do not overlap, computed as it is streamed.
pub struct Islands {
    pub info: DemInfo,
    pub islands: Vec<Island>,
}

impl Islands {
    pub fn new(side: u32, islands: Vec<Island>) -> Self {
        let info = MemoryDem::from_fn([2, 2], SampleType::I16, |_, _| 0.0).info().clone();
        Self { info: DemInfo { samples_wide: side, samples_high: side, ..info }, islands }
    }

    /// Metres of height of a sample; `None` in the sea.
    pub fn height(&self, x: u32, y: u32) -> Option<f64> {
        let is_land = self.islands.iter().any(|island| island.contains(x, y));
        is_land.then(|| f64::from((x.wrapping_mul(31) ^ y.wrapping_mul(17)) % 97 + x % 613 + y % 389))
    }

    /// Samples that have a height.
    pub fn samples(&self) -> u64 {
        self.islands.iter().map(|i| u64::from(i.wide) * u64::from(i.high)).sum()
    }
}

impl DemSource for Islands {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let side = self.info.samples_wide;
        (0..side).into_par_iter().try_for_each_init(
            || vec![f64::NAN; side as usize],
            |samples, row| {
                let y = side - 1 - row;
                for island in self.islands.iter().filter(|i| i.contains(i.west, y)) {
                    for x in island.west..island.west + island.wide {
                        samples[x as usize] = self.height(x, y).unwrap_or(f64::NAN);
                    }
                }
                sink.put(Window { col: 0, row, width: side, height: 1 }, samples)?;
                for island in &self.islands {
                    samples[island.west as usize..(island.west + island.wide) as usize].fill(f64::NAN);
                }
                Ok(())
            },
        )
    }
}
