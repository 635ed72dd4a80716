//! The old samples while new ones are made of them: in memory where that is allowed, else in a nameless temporary file, row by row.
//!
//! Samples that single precision holds take 4 bytes, others 8. A void is NaN; a row that no sample came for is void. Windows are read back by any number of threads.
//! Cost: each sample written once, and read once for each window that it lies in.

use super::kernel::Samples;
use crate::kept::Kept;
use std::path::Path;
use std::sync::Arc;
use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// Samples of a grid.
pub(crate) struct Store {
    samples: [u32; 2],
    sample_bytes: u64,
    kept: Arc<Kept>,
    /// Where its bytes begin in what is kept.
    begin: u64,
}

impl Store {
    /// Bytes that samples take; the largest number there is where they are more, which neither memory nor a file holds.
    pub(crate) fn bytes(samples: [u32; 2], sample_bytes: u64) -> u64 {
        // Two of 32 bits fit in 64.
        (u64::from(samples[0]) * u64::from(samples[1])).saturating_mul(sample_bytes)
    }

    /// Bytes that several grids take.
    pub(crate) fn all_bytes<'a>(grids: impl IntoIterator<Item = &'a [u32; 2]>, sample_bytes: u64) -> u64 {
        grids.into_iter().map(|samples| Self::bytes(*samples, sample_bytes)).fold(0, u64::saturating_add)
    }

    /// An empty store, in memory or in a file in `folder`.
    pub(crate) fn new(
        samples: [u32; 2],
        sample_bytes: u64,
        in_memory: bool,
        folder: &Path,
    ) -> Result<Self, LayoutError> {
        let kept = Kept::new(
            Self::bytes(samples, sample_bytes),
            in_memory,
            folder,
            "cannot keep the samples in a temporary file in",
        )?;
        Ok(Self { samples, sample_bytes, kept: Arc::new(kept), begin: 0 })
    }

    /// Empty stores of these columns and rows, one behind the other in memory or in one file in `folder`.
    pub(crate) fn several(
        samples: &[[u32; 2]],
        sample_bytes: u64,
        in_memory: bool,
        folder: &Path,
    ) -> Result<Vec<Self>, LayoutError> {
        let all = Self::all_bytes(samples, sample_bytes);
        let action = "cannot keep the samples in a temporary file in";
        let kept = Arc::new(Kept::new(all, in_memory, folder, action)?);
        let mut end = 0u64;
        let stores = samples.iter().map(|samples| {
            let begin = end;
            end = begin.saturating_add(Self::bytes(*samples, sample_bytes));
            Self { samples: *samples, sample_bytes, kept: kept.clone(), begin }
        });
        Ok(stores.collect())
    }

    /// Columns `first.0` on and rows `first.1` on, `size` of them; columns are counted around the grid if it `wraps`, and what is outside is void.
    pub(crate) fn window(
        &self,
        first: [i64; 2],
        size: [usize; 2],
        wraps: bool,
    ) -> Result<Block, LayoutError> {
        let [columns, rows] = self.samples.map(i64::from);
        let mut block = Block { first, size, values: vec![f64::NAN; size[0] * size[1]] };
        let mut bytes = Vec::new();
        for (line, values) in block.values.chunks_exact_mut(size[0].max(1)).enumerate() {
            let row = first[1] + line as i64;
            if !(0..rows).contains(&row) {
                continue;
            }
            // Runs of columns that lie together in the grid.
            let mut done = 0;
            while done < size[0] {
                let col = first[0] + done as i64;
                let (at, run) = if wraps {
                    let at = col.rem_euclid(columns);
                    (at, (columns - at) as usize)
                } else if col < 0 {
                    done = usize::try_from(-first[0]).unwrap_or(usize::MAX).min(size[0]);
                    continue;
                } else if col >= columns {
                    break;
                } else {
                    (col, (columns - col) as usize)
                };
                let run = run.min(size[0] - done);
                let offset = self.begin + (row as u64 * columns as u64 + at as u64) * self.sample_bytes;
                let length = run * self.sample_bytes as usize;
                let values = &mut values[done..done + run];
                self.kept.read(offset, length, &mut bytes, |raw| self.decode(raw, values))?;
                done += run;
            }
        }
        Ok(block)
    }

    fn decode(&self, bytes: &[u8], values: &mut [f64]) {
        if self.sample_bytes == 4 {
            for (value, raw) in values.iter_mut().zip(bytes.as_chunks().0) {
                *value = f64::from(f32::from_bits(u32::from_le_bytes(*raw) ^ f32::NAN.to_bits()));
            }
        } else {
            for (value, raw) in values.iter_mut().zip(bytes.as_chunks().0) {
                *value = f64::from_bits(u64::from_le_bytes(*raw) ^ f64::NAN.to_bits());
            }
        }
    }

    /// What was never written is zero, and so zero means void.
    fn encode(&self, values: &[f64], bytes: &mut Vec<u8>) {
        bytes.clear();
        for value in values {
            match (self.sample_bytes, value.is_nan()) {
                (4, true) => bytes.extend([0; 4]),
                (4, false) => bytes.extend(((*value as f32).to_bits() ^ f32::NAN.to_bits()).to_le_bytes()),
                (_, true) => bytes.extend([0; 8]),
                (_, false) => bytes.extend((value.to_bits() ^ f64::NAN.to_bits()).to_le_bytes()),
            }
        }
    }
}

impl SampleSink for Store {
    fn put(&self, window: Window, samples: &[f64]) -> Result<(), LayoutError> {
        let inside = window.col.checked_add(window.width).is_some_and(|end| end <= self.samples[0])
            && window.row.checked_add(window.height).is_some_and(|end| end <= self.samples[1]);
        if !inside || samples.len() != window.width as usize * window.height as usize {
            return Err(LayoutError::Usage("a window of samples does not lie in the elevation model".into()));
        }
        let mut bytes = Vec::new();
        for (line, values) in samples.chunks_exact(window.width.max(1) as usize).enumerate() {
            self.encode(values, &mut bytes);
            let row = u64::from(window.row) + line as u64;
            let offset =
                self.begin + (row * u64::from(self.samples[0]) + u64::from(window.col)) * self.sample_bytes;
            self.kept.write(offset, &bytes)?;
        }
        Ok(())
    }

    fn put_void(&self, _window: Window) -> Result<(), LayoutError> {
        Ok(())
    }
}

/// Old samples around a place.
pub(crate) struct Block {
    first: [i64; 2],
    size: [usize; 2],
    values: Vec<f64>,
}

impl Block {
    /// The samples, row by row.
    pub(crate) fn into_values(self) -> Vec<f64> {
        self.values
    }
}

impl Samples for Block {
    fn at(&self, col: i64, row: i64) -> f64 {
        let (col, row) = (col - self.first[0], row - self.first[1]);
        let inside = (0..self.size[0] as i64).contains(&col) && (0..self.size[1] as i64).contains(&row);
        if inside { self.values[row as usize * self.size[0] + col as usize] } else { f64::NAN }
    }
}
