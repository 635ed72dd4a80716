//! Synthetic fractal terrain of any size, in the manner of the Puget Sound data set.
//!
//! One landscape a seed: an inlet of flat sea, rolling lowlands, two mountain ranges, two volcanoes. Its
//! layout spans the grid whatever its size, so 1,025 samples at 160 m show the same land as 8,193 at
//! 20 m; grids narrower than 164 km get proportionally lower land, wider ones keep the heights. Every
//! octave down to the single sample adds relief (`landscape` the large forms, `detail` the rest).
//! Every sample is a function of seed and place alone: the file is the same for any number of threads.
//!
//! Mean |z - mean of 4 neighbours| at 160, 320, 640, 1280, 2560 m, seed 1 (Puget Sound in brackets): above
//! 1,000 m 13.4, 27.5, 52.4, 103, 200 m (14.3, 32.6, 68.2, 122, 178 m); below 200 m 3.9, 6.0, 9.2, 14.1, 20.9 m
//! (4.4, 8.4, 14.2, 22.2, 31.8 m); zero samples 12 % (4 %). At 20 m it is 3.3 m in the mountains, 1.0 m below 200 m.
//!
//! Rows are made in bands, in parallel, while the band before is written: 35 to 70 MiB of memory with two threads.
//! Every sample is made and stored: 131,073 a side take 34 GB, and the largest 2.2 TB.

mod colour;
mod detail;
mod landscape;
mod noise;
mod output;
mod recognise;
mod tiff_header;

pub use colour::{ColourOptions, write_colour};
pub use recognise::is_synthetic;

use std::path::Path;

use rayon::prelude::*;

use detail::Terrain;
use output::Output;
use terrasoar_layout::error::LayoutError;

/// Metres of height a raw unit of the files written.
pub const HEIGHT_SCALE: f64 = 0.1;

/// Largest grid: 2^20 + 1 samples a side, as terrain has.
pub const MAX_SIZE: u32 = terrasoar_layout::grid::MOST_SAMPLES;
/// Samples of a band, at most; a band is made while the one before is written.
const BAND_SAMPLES: u64 = 1 << 22;
/// Rows made by one task, at most.
const TASK_ROWS: usize = 16;
/// Tasks of a band, at least, as long as it has so many rows.
const TASKS: usize = 4;

/// What to make.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SynthOptions {
    /// Samples along each side: 2^k + 1, from 3 to 1,048,577.
    pub size: u32,
    /// Which of the landscapes.
    pub seed: u64,
    /// Metres between samples, above 0; default 20.
    pub spacing_m: f64,
}

impl Default for SynthOptions {
    /// 1,025 samples a side at 20 m, seed 0.
    fn default() -> Self {
        Self { size: 1025, seed: 0, spacing_m: 20.0 }
    }
}

impl SynthOptions {
    /// These options with so many samples along each side.
    pub fn size(self, size: u32) -> Self {
        Self { size, ..self }
    }

    /// These options with another landscape.
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// These options with so many metres between samples.
    pub fn spacing_m(self, spacing_m: f64) -> Self {
        Self { spacing_m, ..self }
    }

    /// Bytes of the samples in a GeoTIFF, which is longer by its tables: a thousandth at most where there are many.
    pub fn sample_bytes(self) -> u64 {
        2 * u64::from(self.size).pow(2)
    }
}

/// Writes synthetic terrain to `out`: an uncompressed GeoTIFF (`.tif`, `.tiff`; BigTIFF above 4 GiB)
/// or a 16-bit grey PNG (`.png`), heights in units of [`HEIGHT_SCALE`].
///
/// The file appears under its name only when it is complete. `progress` is told the number of rows
/// written, from this thread, never going back. Cost: two bytes of file a sample; the PNG encoder is one thread's work.
///
/// # Errors
/// [`LayoutError::Usage`] for a size that is not 2^k + 1 or out of range, a spacing that is not a
/// positive number, another extension, or a GeoTIFF for which the disk has no room; [`LayoutError::Io`] when the file cannot be written.
pub fn write(options: &SynthOptions, out: &Path, progress: &(dyn Fn(u64) + Sync)) -> Result<(), LayoutError> {
    let SynthOptions { size, seed, spacing_m } = *options;
    if !(3..=MAX_SIZE).contains(&size) || !(size - 1).is_power_of_two() {
        return Err(LayoutError::Usage(format!(
            "synthetic terrain has 2^k + 1 samples a side, from 3 to {MAX_SIZE}, and {size} is none of these: take {}",
            nearest_size(size)
        )));
    }
    if !(spacing_m.is_finite() && spacing_m > 0.0) {
        return Err(LayoutError::Usage(format!(
            "a spacing of {spacing_m} m is no distance; the default is 20"
        )));
    }
    let mut output = Output::create(out, options)?;
    let terrain = Terrain::new(size, seed, spacing_m);
    let width = size as usize;
    let band_rows = (BAND_SAMPLES / u64::from(size)).clamp(1, u64::from(size)) as u32;
    let task_rows = (band_rows as usize / TASKS).clamp(1, TASK_ROWS);
    let (mut written, mut made): (Vec<u16>, Vec<u16>) = (Vec::new(), Vec::new());
    let mut written_rows = 0;
    let mut first = 0;
    // One turn more than there are bands: each makes a band and writes the one before.
    while written_rows < size {
        let rows = band_rows.min(size - first);
        made.resize(width * rows as usize, 0);
        let make = || {
            made.par_chunks_mut(width * task_rows).enumerate().for_each_init(
                detail::Scratch::default,
                |scratch, (task, rows)| {
                    terrain.rows(first + (task * task_rows) as u32, rows, scratch);
                },
            );
        };
        let ((), result) = rayon::join(make, || output.write_rows(&written));
        result?;
        written_rows += (written.len() / width) as u32;
        progress(u64::from(written_rows));
        first += rows;
        std::mem::swap(&mut written, &mut made);
    }
    output.finish()
}

/// The size allowed that is closest from above.
fn nearest_size(size: u32) -> u32 {
    size.saturating_sub(1).clamp(2, MAX_SIZE - 1).next_power_of_two() + 1
}
