//! Elevation data held in memory, and terrain files made of it.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::progress::Silent;
pub mod drape;
pub mod edits;
pub mod hollow;
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
    /// What is added to every height.
    more: f64,
}

impl Islands {
    pub fn new(side: u32, islands: Vec<Island>) -> Self {
        let info = MemoryDem::from_fn([2, 2], SampleType::I16, |_, _| 0.0).info().clone();
        Self { info: DemInfo { samples_wide: side, samples_high: side, ..info }, islands, more: 0.0 }
    }

    /// The same with heights that only double precision holds.
    pub fn precise(self) -> Self {
        Self { info: DemInfo { sample_type: SampleType::F64, ..self.info }, more: 1.0 / 3.0, ..self }
    }

    /// Metres of height of a sample; `None` in the sea.
    pub fn height(&self, x: u32, y: u32) -> Option<f64> {
        let is_land = self.islands.iter().any(|island| island.contains(x, y));
        is_land.then(|| {
            f64::from((x.wrapping_mul(31) ^ y.wrapping_mul(17)) % 97 + x % 613 + y % 389) + self.more
        })
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

    /// Windows of voids between the islands, of any size, and islands some rows at a time.
    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let side = self.info.samples_wide;
        let mut cuts: Vec<u32> = self.islands.iter().flat_map(|i| [i.south, i.south + i.high]).collect();
        cuts.extend([0, side]);
        cuts.sort_unstable();
        cuts.dedup();
        for south in cuts.windows(2).flat_map(|cut| (cut[0]..cut[1]).step_by(64).map(move |y| (y, cut))) {
            let (south, cut) = south;
            let mut here: Vec<&Island> = self.islands.iter().filter(|i| i.contains(i.west, south)).collect();
            here.sort_unstable_by_key(|i| i.west);
            if here.is_empty() {
                if south == cut[0] {
                    let height = cut[1] - cut[0];
                    sink.put_void(Window { col: 0, row: side - cut[1], width: side, height })?;
                }
                continue;
            }
            let height = (cut[1] - south).min(64);
            let row = side - south - height;
            let mut west = 0;
            for island in here {
                if west < island.west {
                    sink.put_void(Window { col: west, row, width: island.west - west, height })?;
                }
                let window = Window { col: island.west, row, width: island.wide, height };
                let rows = (south..south + height).rev();
                let samples: Vec<f64> = rows
                    .flat_map(|y| (island.west..island.west + island.wide).map(move |x| (x, y)))
                    .map(|(x, y)| self.height(x, y).unwrap_or(f64::NAN))
                    .collect();
                sink.put(window, &samples)?;
                west = island.west + island.wide;
            }
            if west < side {
                sink.put_void(Window { col: west, row, width: side - west, height })?;
            }
        }
        Ok(())
    }
}
