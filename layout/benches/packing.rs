//! Packing beside building, as ratios: `build` and `build --packed` of the same samples in memory, in turn, and `pack` alone.
//!
//! `cargo bench -p terrasoar-layout --features testing --bench packing -- [SIDE [ROUNDS]]`: SIDE samples a side, 2,049 without it.

use std::time::Instant;
use terrasoar_layout::LayoutError;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{DemInfo, DemSource, MemoryDem, SampleSink, SampleType, Window};
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::packing::{pack, unpack};
use terrasoar_layout::progress::Silent;

/// Ridges on hills, a row at a time: as rough as ground is.
struct Ground(DemInfo);

impl Ground {
    fn new(side: u32) -> Self {
        let info = MemoryDem::from_fn([2, 2], SampleType::I16, |_, _| 0.0).info().clone();
        Self(DemInfo { samples_wide: side, samples_high: side, height_scale: 0.1, ..info })
    }
}

/// A repeatable number of -1 to 1 for a place.
fn noise(x: u32, y: u32) -> f64 {
    let mut h = (u64::from(x) << 32 | u64::from(y)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    h = (h ^ h >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((h ^ h >> 32) % 2048) as f64 / 1024.0 - 1.0
}

/// Noise between places `step` samples apart.
fn smooth(x: u32, y: u32, step: u32) -> f64 {
    let (i, j) = (x / step, y / step);
    let (u, v) = (f64::from(x % step) / f64::from(step), f64::from(y % step) / f64::from(step));
    let (south, north) = (
        noise(i, j) * (1.0 - u) + noise(i + 1, j) * u,
        noise(i, j + 1) * (1.0 - u) + noise(i + 1, j + 1) * u,
    );
    south * (1.0 - v) + north * v
}

impl DemSource for Ground {
    fn info(&self) -> &DemInfo {
        &self.0
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let side = self.0.samples_wide;
        let mut row = vec![0.0; side as usize];
        for y in 0..side {
            for (x, height) in (0..side).zip(&mut row) {
                let octaves = [(512, 6000.0), (128, 1500.0), (32, 350.0), (8, 70.0), (2, 12.0)];
                *height = octaves.iter().map(|(step, tall)| smooth(x, y, *step) * tall).sum::<f64>().round();
            }
            sink.put(Window { col: 0, row: y, width: side, height: 1 }, &row)?;
        }
        Ok(())
    }
}

/// The samples of another, held in memory, so that making them takes no time.
struct Held(DemInfo, Vec<f64>);

impl Held {
    fn of(ground: &Ground) -> Result<Self, LayoutError> {
        struct Rows(std::sync::Mutex<Vec<f64>>);
        impl SampleSink for Rows {
            fn put(&self, _: Window, samples: &[f64]) -> Result<(), LayoutError> {
                self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner).extend(samples);
                Ok(())
            }
        }
        let rows = Rows(std::sync::Mutex::default());
        ground.stream(&rows)?;
        Ok(Self(ground.0.clone(), rows.0.into_inner().unwrap_or_default()))
    }
}

impl DemSource for Held {
    fn info(&self) -> &DemInfo {
        &self.0
    }

    fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let side = self.0.samples_wide;
        (0..)
            .zip(self.1.chunks_exact(side as usize))
            .try_for_each(|(row, samples)| sink.put(Window { col: 0, row, width: side, height: 1 }, samples))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u32> = std::env::args().filter_map(|word| word.parse().ok()).collect();
    let side = numbers.first().copied().unwrap_or(2049);
    let rounds = numbers.get(1).copied().unwrap_or(5);
    let dem = Held::of(&Ground::new(side))?;
    let folder = tempfile::tempdir()?;
    let [plain, packed, again] =
        ["plain.iqt", "packed.iqt", "again.iqt"].map(|name| folder.path().join(name));
    let options = BuildOptions::default().spacing_m([20.0; 2]);
    let mut least = [f64::INFINITY; 4];
    let mut time = |which: usize, work: &mut dyn FnMut() -> Result<(), LayoutError>| {
        let start = Instant::now();
        work()?;
        least[which] = least[which].min(start.elapsed().as_secs_f64());
        Ok::<(), LayoutError>(())
    };
    for _ in 0..rounds {
        time(0, &mut || build(&dem, &plain, &options, &Silent).map(drop))?;
        time(1, &mut || build(&dem, &packed, &options.clone().packed(true), &Silent).map(drop))?;
        time(2, &mut || pack(&SystemDisk, &plain, &packed, &Silent).map(drop))?;
        time(3, &mut || unpack(&SystemDisk, &packed, &again, &Silent).map(drop))?;
    }
    let samples = f64::from(side) * f64::from(side);
    let bytes = std::fs::metadata(&packed)?.len() as f64;
    println!("{side} x {side} samples, {:.3} bytes a sample packed, least of {rounds}", bytes / samples);
    for (name, seconds) in ["build", "build, packed", "pack", "unpack"].into_iter().zip(least) {
        println!(
            "{name}: {:.2} M samples a second, {:.2} of build's",
            samples / seconds / 1e6,
            least[0] / seconds
        );
    }
    Ok(())
}
