//! Samples that come one after the other, row by row, as windows of a sink.
//!
//! Samples are passed on at once: the end of a row that was begun, whole rows, the beginning of a row. Only the position is kept.

use terrasoar_layout::dem::{SampleSink, Window};
use terrasoar_layout::error::LayoutError;

/// How far a sequence of samples has come.
pub(crate) struct Sequence<'a> {
    sink: &'a dyn SampleSink,
    samples: [u32; 2],
    next: u64,
}

impl<'a> Sequence<'a> {
    /// The beginning of a grid of `samples` (wide, high).
    pub(crate) fn new(sink: &'a dyn SampleSink, samples: [u32; 2]) -> Self {
        Self { sink, samples, next: 0 }
    }

    /// Samples that came.
    pub(crate) fn count(&self) -> u64 {
        self.next
    }

    /// Samples that are still to come.
    pub(crate) fn missing(&self) -> u64 {
        u64::from(self.samples[0]) * u64::from(self.samples[1]) - self.next
    }

    /// Row and column of the sample that is `ahead` samples on, counted from 0.
    pub(crate) fn place(&self, ahead: usize) -> [u64; 2] {
        let at = self.next + ahead as u64;
        [at / u64::from(self.samples[0]), at % u64::from(self.samples[0])]
    }

    /// Hands on the samples that come next, of which there are at most [`missing`](Self::missing).
    pub(crate) fn put(&mut self, mut samples: &[f64]) -> Result<(), LayoutError> {
        let wide = u64::from(self.samples[0]);
        while !samples.is_empty() {
            // Both are below the sides of the grid.
            let (row, col) = ((self.next / wide) as u32, (self.next % wide) as u32);
            let left = self.samples[0] - col;
            let (width, height) = match u32::try_from(samples.len()) {
                Ok(count) if count < left => (count, 1),
                _ if col > 0 => (left, 1),
                _ => (left, ((samples.len() as u64 / wide) as u32).min(self.samples[1] - row)),
            };
            let count = width as usize * height as usize;
            let (now, later) = samples.split_at(count);
            self.sink.put(Window { col, row, width, height }, now)?;
            self.next += count as u64;
            samples = later;
        }
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
            assert_eq!(samples.len() as u32, window.width * window.height);
            assert_eq!(seen.len() as u32, window.row * self.1 + window.col);
            assert!(window.height == 1 || window.width == self.1);
            seen.extend(samples);
            Ok(())
        }
    }

    #[test]
    fn any_pieces_make_the_grid() {
        let all: Vec<f64> = (0..5 * 7).map(f64::from).collect();
        for piece in 1..=all.len() {
            let sink = Seen(Mutex::new(Vec::new()), 5);
            let mut sequence = Sequence::new(&sink, [5, 7]);
            for samples in all.chunks(piece) {
                assert_eq!(sequence.place(0), [sequence.count() / 5, sequence.count() % 5]);
                sequence.put(samples).unwrap();
            }
            assert_eq!(sequence.missing(), 0);
            assert_eq!(*sink.0.lock().unwrap(), all, "{piece}");
        }
    }
}
