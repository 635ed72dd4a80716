//! Makes a terrain file from heights of a program's own: 1,025 x 1,025 of them, 10 m apart.
//!
//!     cargo run --release --example step_1_terrain -- land.iqt

use std::error::Error;
use std::path::PathBuf;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::dem::{MemoryDem, SampleType};
use terrasoar_layout::progress::Silent;

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args().nth(1).unwrap_or("land.iqt".into()));
    let dem = MemoryDem::from_fn([1025, 1025], SampleType::F32, |x, y| height_m(f64::from(x), f64::from(y)));
    let header = build(&dem, &path, &BuildOptions::default().spacing_m([10.0, 10.0]), &Silent)?;
    let [low_m, high_m] = header.height_range_m;
    println!("{}: heights from {low_m:.0} to {high_m:.0} m", path.display());
    Ok(())
}

/// Ridges of ever smaller size, for samples counted from the west and from the north.
fn height_m(x: f64, y: f64) -> f64 {
    let mut height = 900.0;
    let (mut size, mut wave) = (420.0, 0.009);
    for octave in 0..7 {
        let (sin, cos) = (1.3 * f64::from(octave)).sin_cos();
        let (u, v) = (wave * (x * cos - y * sin), wave * (x * sin + y * cos));
        height += size * ((u + 1.6 * v.sin()).sin() * (v - 1.1 * (0.7 * u).cos()).sin()).abs() - 0.5 * size;
        size *= 0.48;
        wave *= 1.9;
    }
    height
}
