//! Where a DEM has heights, in blocks of 256 x 256 samples: what lets a build pass over the rest.
//!
//! A block of nothing but voids makes no record that a file holds, but for those that refinement around heights needs. How far such records lie from heights follows from
//! their level, so the columns of a level's row that can hold any are known before it is made. Memory: a bit a block, 2 MiB for a square of 2^20 samples a side.

use super::levels::LevelShape;
use crate::dem::Window;
use std::ops::{Range, RangeInclusive};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Binary logarithm of a block's side.
pub(super) const BLOCK_LOG2: u32 = 8;
/// Side of a block in samples; the side of every tile divides it.
pub(super) const BLOCK: u32 = 1 << BLOCK_LOG2;

/// Blocks with heights. Columns and rows are counted from the south-west.
#[derive(Debug)]
pub(super) struct Land {
    samples: [u32; 2],
    /// Words a row of blocks.
    words: usize,
    bits: Vec<AtomicU64>,
    /// Whether a row of blocks has any.
    has_any: Vec<AtomicBool>,
}

impl Land {
    /// A DEM of `samples` (wide, high) without heights.
    pub(super) fn none(samples: [u32; 2]) -> Self {
        let [columns, rows] = samples.map(|count| count.div_ceil(BLOCK) as usize);
        let words = columns.div_ceil(64);
        Self {
            samples,
            words,
            bits: (0..words * rows).map(|_| AtomicU64::new(0)).collect(),
            has_any: (0..rows).map(|_| AtomicBool::new(false)).collect(),
        }
    }

    /// A DEM with heights in these windows, whose rows are counted from the north; everywhere if they are not known.
    pub(super) fn in_windows(samples: [u32; 2], windows: Option<&[Window]>) -> Self {
        let land = Self::none(samples);
        let [wide, high] = samples;
        let whole = [Window { col: 0, row: 0, width: wide, height: high }];
        for window in windows.unwrap_or(&whole) {
            let (east, end) = (
                window.col.saturating_add(window.width).min(wide),
                window.row.saturating_add(window.height).min(high),
            );
            if window.col < east && window.row < end {
                let (south, north) = (high - end, high - 1 - window.row);
                (south >> BLOCK_LOG2..=north >> BLOCK_LOG2)
                    .for_each(|row| land.mark_blocks(window.col..east, row as usize));
            }
        }
        land
    }

    /// Says that there are heights in row `y`, in columns `x`.
    pub(super) fn mark(&self, x: Range<u32>, y: u32) {
        self.mark_blocks(x, (y >> BLOCK_LOG2) as usize);
    }

    fn mark_blocks(&self, x: Range<u32>, row: usize) {
        let (first, last) = ((x.start >> BLOCK_LOG2) as usize, ((x.end - 1) >> BLOCK_LOG2) as usize);
        for word in first / 64..=last / 64 {
            let bits = bits_between(first, last, word);
            // Most blocks are marked many times.
            let place = &self.bits[row * self.words + word];
            if place.load(Ordering::Relaxed) & bits != bits {
                place.fetch_or(bits, Ordering::Relaxed);
            }
        }
        self.has_any[row].store(true, Ordering::Relaxed);
    }

    fn word(&self, row: usize, word: usize) -> u64 {
        self.bits[row * self.words + word].load(Ordering::Relaxed)
    }

    /// Columns of the blocks that have heights and touch these rows, from the west; they do not touch each other.
    pub(super) fn runs(&self, rows: RangeInclusive<u32>) -> Vec<Range<u32>> {
        let blocks = (rows.start() >> BLOCK_LOG2) as usize..=(rows.end() >> BLOCK_LOG2) as usize;
        let mut any = blocks.filter(|row| self.has_any[*row].load(Ordering::Relaxed));
        let Some(first) = any.next() else { return Vec::new() };
        let mut words: Vec<u64> = (0..self.words).map(|word| self.word(first, word)).collect();
        any.for_each(|row| words.iter_mut().enumerate().for_each(|(i, word)| *word |= self.word(row, i)));
        let mut runs = Vec::new();
        let mut at = 0;
        while let Some(start) = next_bit(&words, at, true) {
            let end = next_bit(&words, start, false).unwrap_or(64 * words.len());
            runs.push((start as u32) << BLOCK_LOG2..(end as u32 * BLOCK).min(self.samples[0]));
            at = end;
        }
        runs
    }

    /// Columns of a row of a level outside which every record is inert, from the west; they do not touch each other. A vertex with a height under it lies no farther from that than its
    /// level reaches; padding has the heights of the border.
    pub(super) fn columns(&self, shape: &LevelShape, row: usize) -> Vec<Range<usize>> {
        let [wide, high] = self.samples;
        let (y, reach, count) = (shape.row_y(row), shape.reach(), shape.columns(row));
        let mut columns: Vec<Range<usize>> = Vec::new();
        for run in self.runs(y.saturating_sub(reach).min(high - 1)..=(y + reach).min(high - 1)) {
            let west = run.start.saturating_sub(reach);
            let east = if run.end == wide { u32::MAX } else { run.end - 1 + reach };
            let (from, to) = shape.columns_between(row, west, east);
            let to = to.min(count);
            match columns.last_mut() {
                Some(last) if from <= last.end => last.end = last.end.max(to),
                _ if from < to => columns.push(from..to),
                _ => {}
            }
        }
        columns
    }

    /// Whether a block with heights touches the rectangle from (`x[0]`, `y[0]`) to (`x[1]`, `y[1]`).
    pub(super) fn touches(&self, x: [u32; 2], y: [u32; 2]) -> bool {
        let [first, last] = x.map(|x| (x.min(self.samples[0] - 1) >> BLOCK_LOG2) as usize);
        let [south, north] = y.map(|y| (y.min(self.samples[1] - 1) >> BLOCK_LOG2) as usize);
        (south..=north).filter(|row| self.has_any[*row].load(Ordering::Relaxed)).any(|row| {
            (first / 64..=last / 64).any(|word| self.word(row, word) & bits_between(first, last, word) != 0)
        })
    }

    /// Blocks with heights.
    pub(super) fn blocks(&self) -> u64 {
        self.bits.iter().map(|word| u64::from(word.load(Ordering::Relaxed).count_ones())).sum()
    }

    /// Most blocks with heights in two rows of blocks side by side, and most runs of them.
    pub(super) fn widest(&self) -> [u64; 2] {
        let rows = self.has_any.len() as u32;
        let both =
            |row: u32| self.runs(row * BLOCK..=((row + 1).min(rows - 1) * BLOCK).min(self.samples[1] - 1));
        (0..rows).map(both).fold([0; 2], |most, runs| {
            let blocks = runs.iter().map(|run| u64::from((run.end - run.start).div_ceil(BLOCK))).sum::<u64>();
            [most[0].max(blocks), most[1].max(runs.len() as u64)]
        })
    }
}

/// Those bits of a word that stand for blocks `first` to `last`.
fn bits_between(first: usize, last: usize, word: usize) -> u64 {
    let from = if word == first / 64 { u64::MAX << (first % 64) } else { u64::MAX };
    let to = if word == last / 64 { u64::MAX >> (63 - last % 64) } else { u64::MAX };
    from & to
}

/// The first place from `at` on whose bit is `wanted`.
fn next_bit(words: &[u64], at: usize, wanted: bool) -> Option<usize> {
    let flip = if wanted { 0 } else { u64::MAX };
    let mut word = at / 64;
    let mut bits = (words.get(word)? ^ flip) & (u64::MAX << (at % 64));
    while bits == 0 {
        word += 1;
        bits = words.get(word)? ^ flip;
    }
    Some(64 * word + bits.trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against a look at every block.
        #[test]
        fn runs_and_rectangles_are_those_of_a_look_at_every_block(
            wide in 2u32..70_000, high in 2u32..3000,
            marks in prop::collection::vec((0.0f64..1.0, 0.0f64..1.0, 1u32..900), 0..12),
            asked in (0.0f64..1.0, 0.0f64..1.0, 0u32..40_000, 0u32..900),
        ) {
            let land = Land::none([wide, high]);
            let at = |part: f64, count: u32| ((f64::from(count) * part) as u32).min(count - 1);
            let mut blocks = std::collections::BTreeSet::new();
            for (x, y, width) in marks {
                let (west, y) = (at(x, wide), at(y, high));
                let east = (west + width).min(wide);
                land.mark(west..east, y);
                blocks.extend((west..east).map(|x| (x / 256, y / 256)));
            }
            let (west, south) = (at(asked.0, wide), at(asked.1, high));
            let (east, north) = ((west + asked.2).min(wide - 1), (south + asked.3).min(high - 1));
            let rows = south / 256..=north / 256;
            let touched = blocks.iter().any(|(x, y)| rows.contains(y) && (west / 256..=east / 256).contains(x));
            prop_assert_eq!(land.touches([west, east], [south, north]), touched);
            let runs = land.runs(south..=north);
            prop_assert!(runs.windows(2).all(|two| two[0].end < two[1].start));
            for column in 0..wide.div_ceil(256) {
                let found = runs.iter().any(|run| run.contains(&(column * 256)));
                prop_assert_eq!(found, rows.clone().any(|row| blocks.contains(&(column, row))));
            }
            prop_assert!(runs.last().is_none_or(|run| run.end <= wide));
            prop_assert_eq!(land.blocks(), blocks.len() as u64);
        }
    }
}
