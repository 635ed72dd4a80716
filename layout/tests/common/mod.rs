//! Elevation data held in memory, and terrain files made of it.
#![allow(dead_code, reason = "each test binary uses a part of it")]

use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, Silent, build};
use terrasoar_layout::dem::{DemInfo, DemSource, Georeference, SampleSink, SampleType, Window};
use terrasoar_layout::terrain::Terrain;

/// A DEM in memory; rows from the south, voids NaN.
#[derive(Debug, Clone)]
pub struct MemoryDem {
    info: DemInfo,
    pub heights: Vec<f64>,
}

impl MemoryDem {
    pub fn new(samples: [u32; 2], sample_type: SampleType, mut height: impl FnMut(u32, u32) -> f64) -> Self {
        let info = DemInfo {
            samples_wide: samples[0],
            samples_high: samples[1],
            sample_type,
            height_scale: 1.0,
            height_offset_m: 0.0,
            georeference: Georeference::default(),
            format: "memory".into(),
        };
        let heights = (0..samples[1])
            .flat_map(|y| (0..samples[0]).map(move |x| (x, y)))
            .map(|(x, y)| height(x, y))
            .collect();
        Self { info, heights }
    }

    pub fn height(&self, x: u32, y: u32) -> f64 {
        self.heights[(y * self.info.samples_wide + x) as usize]
    }
}

impl DemSource for MemoryDem {
    fn info(&self) -> &DemInfo {
        &self.info
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let wide = self.info.samples_wide;
        for row in 0..self.info.samples_high {
            let y = self.info.samples_high - 1 - row;
            let samples = &self.heights[(y * wide) as usize..((y + 1) * wide) as usize];
            // Two windows a row, so that partial rows are seen too.
            let (a, b) = samples.split_at(samples.len() / 2);
            sink.put(Window { col: 0, row, width: a.len() as u32, height: 1 }, a)?;
            sink.put(Window { col: a.len() as u32, row, width: b.len() as u32, height: 1 }, b)?;
        }
        Ok(())
    }
}

/// Builds a file from `dem` and returns its bytes.
pub fn build_bytes(dem: &MemoryDem, options: &BuildOptions) -> Result<Vec<u8>, LayoutError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.iqt");
    build(dem, &path, options, &Silent)?;
    Ok(std::fs::read(path).unwrap())
}

/// Opens a terrain over bytes in memory.
pub fn open_bytes(bytes: Vec<u8>) -> Result<Terrain, LayoutError> {
    Terrain::from_source(Box::new(terrasoar_layout::source::MemorySource::new("memory", bytes)))
}
