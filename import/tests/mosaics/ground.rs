//! Small files of ground for mosaics, written as Esri ASCII grids.

use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A grid of ground: samples, north-west corner of its area, step, and heights by column and row; NaN for a void.
pub(crate) struct Patch {
    pub(crate) samples: [u32; 2],
    pub(crate) west: f64,
    pub(crate) north: f64,
    pub(crate) step: f64,
}

impl Patch {
    /// Writes it with heights by coordinates of sample centres.
    pub(crate) fn write(&self, path: PathBuf, system: &str, height: impl Fn(f64, f64) -> f64) -> PathBuf {
        let [wide, high] = self.samples;
        let south = self.north - f64::from(high) * self.step;
        let mut text = format!(
            "ncols {wide}\nnrows {high}\nxllcorner {}\nyllcorner {south}\ncellsize {}\nNODATA_value -9999\n",
            self.west, self.step
        );
        for row in 0..high {
            for col in 0..wide {
                let (x, y) = (
                    self.west + (f64::from(col) + 0.5) * self.step,
                    self.north - (f64::from(row) + 0.5) * self.step,
                );
                let value = height(x, y);
                let value = if value.is_nan() { -9999.0 } else { value };
                write!(text, "{value} ").unwrap();
            }
            text.push('\n');
        }
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        std::fs::write(path.with_extension("prj"), system).unwrap();
        path
    }
}

/// A patch of the map, 100 samples wide and high.
pub(crate) fn at(west: f64, north: f64, step: f64) -> Patch {
    Patch { samples: [100; 2], west, north, step }
}

pub(crate) fn inside(folder: &Path, name: &str) -> PathBuf {
    folder.join(name)
}
