//! Grids of plain numbers: samples of one size at regular distances in a file, whatever header describes them.
//!
//! [`Plain`] says where the numbers are; all threads read bands of rows, each of a mebibyte at most. Invariant: only [`Plain::checked`] makes a `Plain`,
//! so every sample lies in the file.

mod kind;

pub(crate) use kind::Kind;

use crate::WINDOW_SAMPLES;
use crate::input;
use crate::parallel::each_task;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Bytes that are read at once, at most.
const MOST_BYTES: u64 = 1 << 20;

/// Where the samples of one band lie in a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Plain {
    path: PathBuf,
    samples: [u32; 2],
    kind: Kind,
    at: u64,
    /// Bytes from a sample to the next in its row, and from a row to the next.
    steps: [u64; 2],
}

impl Plain {
    /// A band of `samples` (wide, high) whose first sample is `at` bytes behind the beginning of the file at `path`, with `steps` bytes from one sample to the
    /// next in its row and from one row to the next.
    ///
    /// # Errors
    /// Damage if the file is too short for it; unsupported where samples lie more than a mebibyte apart.
    pub(crate) fn checked(
        path: &Path,
        samples: [u32; 2],
        kind: Kind,
        at: u64,
        steps: [u64; 2],
    ) -> Result<Self, LayoutError> {
        let [wide, high] = samples.map(u128::from);
        let (along, down) = (u128::from(steps[0]), u128::from(steps[1]));
        let needed = u128::from(at) + (wide - 1) * along + (high - 1) * down + u128::from(kind.bytes());
        let length = input::open(path, "cannot open the elevation file")?
            .metadata()
            .map_err(|source| LayoutError::io(path, "cannot read the elevation file", source))?
            .len();
        if needed > u128::from(length) {
            return Err(LayoutError::damaged(
                path,
                "samples",
                format!(
                    "{wide} x {high} samples of {} bytes reach to byte {needed} and the file has {length}: it is cut short, or what is said of its \
                     shape is wrong; fetch it again or mend that",
                    kind.bytes()
                ),
            ));
        }
        if steps[0] > MOST_BYTES {
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "samples of one band lie {} bytes apart; keep the band with the heights alone: gdal_translate -b 1 INPUT output.tif",
                    steps[0]
                ),
            ));
        }
        Ok(Self { path: path.to_owned(), samples, kind, at, steps })
    }

    /// What a sample is.
    pub(crate) fn kind(&self) -> Kind {
        self.kind
    }

    /// Pushes every sample once.
    pub(crate) fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let [wide, high] = self.samples;
        // The last sample of a row needs no step behind it, but counting one keeps this simple.
        let columns = u32::try_from(MOST_BYTES / self.steps[0]).unwrap_or(u32::MAX).clamp(1, wide);
        let is_dense = columns == wide && self.steps[0] * u64::from(wide) == self.steps[1];
        let rows = if columns < wide {
            1
        } else {
            let by_bytes = MOST_BYTES / (self.steps[0] * u64::from(wide));
            u32::try_from((WINDOW_SAMPLES / u64::from(wide)).min(by_bytes)).unwrap_or(u32::MAX).clamp(1, high)
        };
        let across = u64::from(wide.div_ceil(columns));
        let tasks = across * u64::from(high.div_ceil(rows));
        let open =
            || Ok((input::open(&self.path, "cannot open the elevation file")?, Vec::new(), Vec::new()));
        each_task(tasks, usize::MAX, open, |(file, bytes, samples), task| {
            // Both are below the sides of the grid.
            let (row, col) = ((task / across) as u32 * rows, (task % across) as u32 * columns);
            let window = Window { col, row, width: columns.min(wide - col), height: rows.min(high - row) };
            samples.clear();
            if is_dense {
                self.read_run(file, row, 0, u64::from(wide) * u64::from(window.height), bytes, samples)?;
            } else {
                for line in 0..window.height {
                    self.read_run(file, row + line, col, u64::from(window.width), bytes, samples)?;
                }
            }
            sink.put(window, samples)
        })
    }

    /// At most `count` samples from the middle row, as numbers of a `kind` of the same size, for a look at what they are.
    pub(crate) fn first_as(&self, kind: Kind, count: u32) -> Result<Vec<f64>, LayoutError> {
        let mut file = input::open(&self.path, "cannot open the elevation file")?;
        let (mut bytes, mut samples) = (Vec::new(), Vec::new());
        let other = Self { kind, ..self.clone() };
        let count = u64::from(count.min(self.samples[0])).min(MOST_BYTES / self.steps[0]).max(1);
        other.read_run(&mut file, self.samples[1] / 2, 0, count, &mut bytes, &mut samples)?;
        Ok(samples)
    }

    /// Appends `count` samples from a place on, all of them one step apart.
    fn read_run(
        &self,
        file: &mut File,
        row: u32,
        col: u32,
        count: u64,
        bytes: &mut Vec<u8>,
        samples: &mut Vec<f64>,
    ) -> Result<(), LayoutError> {
        let at = self.at + u64::from(row) * self.steps[1] + u64::from(col) * self.steps[0];
        // At most MOST_BYTES and a sample.
        let length = ((count - 1) * self.steps[0] + self.kind.bytes()) as usize;
        bytes.resize(length, 0);
        let read = file.seek(SeekFrom::Start(at)).and_then(|_| file.read_exact(bytes));
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                &self.path,
                format!("row {row}"),
                "the file was cut short while it was read; start again",
            ),
            _ => LayoutError::io(&self.path, "cannot read the elevation file", source),
        })?;
        self.kind.append(bytes, self.steps[0] as usize, samples);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    struct Seen(Mutex<Vec<f64>>, u32);

    impl SampleSink for Seen {
        fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
            let mut seen = self.0.lock().unwrap();
            for (i, sample) in samples.iter().enumerate() {
                let (col, row) = (window.col + i as u32 % window.width, window.row + i as u32 / window.width);
                let place = &mut seen[(row * self.1 + col) as usize];
                assert!(place.is_nan());
                *place = *sample;
            }
            Ok(())
        }
    }

    #[test]
    fn any_steps_lead_to_every_sample() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let [wide, high] = [700u32, 5];
        for (along, gap, at) in [(2u64, 0u64, 0u64), (2, 10, 3), (6, 0, 128), (4099, 7, 1)] {
            let down = along * u64::from(wide) + gap;
            let mut bytes = vec![0xee; (at + down * u64::from(high)) as usize];
            for i in 0..wide * high {
                let place = at + u64::from(i / wide) * down + u64::from(i % wide) * along;
                bytes[place as usize..][..2].copy_from_slice(&(i as u16).to_le_bytes());
            }
            std::fs::write(&path, &bytes).unwrap();
            let kind: Kind = "u16le".parse().unwrap();
            let plain = Plain::checked(&path, [wide, high], kind, at, [along, down]).unwrap();
            let seen = Seen(Mutex::new(vec![f64::NAN; (wide * high) as usize]), wide);
            plain.stream(&seen).unwrap();
            assert!(seen.0.lock().unwrap().iter().enumerate().all(|(i, sample)| *sample == i as f64));
            assert_eq!(plain.first_as(kind, 3).unwrap(), [1400.0, 1401.0, 1402.0]);
            let too_high = Plain::checked(&path, [wide, high + 1], kind, at, [along, down]);
            assert!(too_high.unwrap_err().to_string().contains("cut short"));
        }
        let kind: Kind = "f64be".parse().unwrap();
        let absurd = Plain::checked(&path, [u32::MAX; 2], kind, u64::MAX, [u64::MAX; 2]);
        assert!(absurd.unwrap_err().to_string().contains("cut short"));
    }
}
