//! A piece of a file, laid on the grid of a virtual raster.
//!
//! Where the piece's rectangle ends within a sample, the sample belongs to it if more than a thousandth of it does, as GDAL has it. The nearest sample is that under the centre; other kernels are those of
//! warps. Plain pieces replace all that lies below, complex ones where they have a number. Cost: one read and one write of each sample covered.

use super::change::held;
use super::said::{Band, Source};
use crate::cells::Cells;
use crate::options::Resampling;
use crate::warp::{Mapping, Resampler, Store, each_block};
use terrasoar_layout::dem::{SampleSink, SampleType, Window};
use terrasoar_layout::error::LayoutError;

/// How much of a sample a rectangle may miss, or cover and not count.
const EDGE: f64 = 1e-3;
/// Columns and rows of a block.
const BLOCK: [u32; 2] = [1024, 64];

/// Where a piece goes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Placing {
    /// Columns and rows of the virtual raster: from, to (not included).
    from: [u32; 2],
    to: [u32; 2],
    /// Columns of the file from corners: `column = start + step * column of the virtual raster`; the same for rows.
    start: [f64; 2],
    step: [f64; 2],
}

/// Where a piece of a file of `file` samples goes on a grid of `grid` samples; none where it misses it.
fn placing(source: &Source, file: [u32; 2], grid: [u32; 2]) -> Option<Placing> {
    let from = source.from.unwrap_or([0.0, 0.0, f64::from(file[0]), f64::from(file[1])]);
    let to = source.to.unwrap_or(from);
    let mut placing = Placing { from: [0; 2], to: [0; 2], start: [0.0; 2], step: [1.0; 2] };
    for i in 0..2 {
        let step = from[i + 2] / to[i + 2];
        let start = from[i] - to[i] * step;
        // What lies outside of the file is not covered.
        let low = from[i].max(0.0);
        let high = (from[i] + from[i + 2]).min(f64::from(file[i]));
        let [west, east] = [low, high].map(|edge| (edge - start) / step);
        let first = (west + EDGE).floor().max(0.0);
        let last = (east - EDGE).ceil().min(f64::from(grid[i]));
        // NaN as well.
        if !(low < high && first < last && step > 0.0) {
            return None;
        }
        (placing.from[i], placing.to[i]) = (first as u32, last as u32);
        (placing.start[i], placing.step[i]) = (start, step);
    }
    Some(placing)
}

/// A file's samples as they were read, and the grid they go to.
pub(super) struct Painting<'a> {
    pub(super) band: &'a Band,
    /// Columns and rows of the file and of the virtual raster.
    pub(super) file: [u32; 2],
    pub(super) grid: [u32; 2],
    pub(super) file_type: SampleType,
    pub(super) sample_bytes: u64,
    pub(super) samples: &'a Store,
}

impl Painting<'_> {
    /// Lays a piece of the file over what is in `store`, and notes in `cells` where.
    pub(super) fn paint(&self, source: &Source, store: &Store, cells: &mut Cells) -> Result<(), LayoutError> {
        let Some(placing) = placing(source, self.file, self.grid) else { return Ok(()) };
        cells.add(placing.from, placing.to);
        let size = [0, 1].map(|i| placing.to[i] - placing.from[i]);
        let [columns, rows] =
            [0, 1].map(|i| placing.start[i] + placing.step[i] * (f64::from(placing.from[i]) + 0.5) - 0.5);
        let map = [columns, placing.step[0], 0.0, rows, 0.0, placing.step[1]];
        let identity = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let mapping = Mapping::new(map, identity, self.file[0], None);
        let covered = [0, 1].map(|i| f64::from(self.file[i]) / placing.step[i]);
        let resampler = Resampler::new(mapping, source.resampling, self.file, covered, self.sample_bytes);
        each_block(size, BLOCK, |window| {
            let to =
                Window { col: window.col + placing.from[0], row: window.row + placing.from[1], ..window };
            if source.resampling == Resampling::Nearest {
                let new = self.nearest(&placing, to)?;
                return self.over(source, to, new, store);
            }
            resampler.block(self.samples, window, &mut |part, new| {
                let to = Window { col: part.col + placing.from[0], row: part.row + placing.from[1], ..part };
                let count = part.width as usize * part.height as usize;
                self.over(source, to, new.map_or_else(|| vec![f64::NAN; count], <[f64]>::to_vec), store)
            })
        })
    }

    /// The samples of the file under the centres of a window of the virtual raster.
    fn nearest(&self, placing: &Placing, to: Window) -> Result<Vec<f64>, LayoutError> {
        let at = |i: usize, place: u32| {
            let place = placing.start[i] + placing.step[i] * (f64::from(place) + 0.5);
            (place + 1e-10).floor().clamp(0.0, f64::from(self.file[i] - 1)) as i64
        };
        let columns: Vec<i64> = (to.col..to.col + to.width).map(|col| at(0, col)).collect();
        let (Some(west), Some(east)) = (columns.first(), columns.last()) else { return Ok(Vec::new()) };
        let mut new = Vec::with_capacity(columns.len() * to.height as usize);
        // Of what is made much smaller single samples are read.
        let is_sparse = (east - west) as usize > 16 * columns.len();
        let mut last: Option<(i64, std::ops::Range<usize>)> = None;
        for row in to.row..to.row + to.height {
            let row = at(1, row);
            if let Some((_, range)) = last.clone().filter(|(known, _)| *known == row) {
                new.extend_from_within(range);
                continue;
            }
            let begin = new.len();
            if is_sparse {
                for column in &columns {
                    new.extend(self.samples.window([*column, row], [1, 1], false)?.into_values());
                }
            } else {
                let line =
                    self.samples.window([*west, row], [(east - west) as usize + 1, 1], false)?.into_values();
                new.extend(columns.iter().map(|column| line[(column - west) as usize]));
            }
            last = Some((row, begin..new.len()));
        }
        Ok(new)
    }

    /// Puts new numbers over a window, changed as the source says.
    fn over(&self, source: &Source, to: Window, mut new: Vec<f64>, store: &Store) -> Result<(), LayoutError> {
        let sample_type = self.band.sample_type;
        if let Some(change) = &source.change {
            let single = self.file_type.fits_f32() && sample_type.fits_f32();
            new.iter_mut().for_each(|value| *value = change.of(*value, single));
        }
        new.iter_mut().for_each(|value| *value = held(*value, sample_type));
        if source.change.is_some() && new.iter().any(|value| value.is_nan()) {
            let [first, size] = [[to.col, to.row], [to.width, to.height]];
            let old = store.window(first.map(i64::from), size.map(|n| n as usize), false)?.into_values();
            for (value, old) in new.iter_mut().zip(old) {
                *value = if value.is_nan() { old } else { *value };
            }
        }
        store.put(to, &new)
    }
}

#[cfg(test)]
mod tests {
    use super::super::said::Part;
    use super::*;

    fn source(from: Option<[f64; 4]>, to: Option<[f64; 4]>) -> Source {
        let file = "a.tif".into();
        Source { file, part: Part::Band(1), from, to, resampling: Resampling::Nearest, change: None }
    }

    #[test]
    fn rectangles_are_clipped_to_file_and_grid() {
        let placed = |from, to| placing(&source(from, to), [10, 10], [100, 100]).map(|p| (p.from, p.to));
        assert_eq!(placed(None, None), Some(([0, 0], [10, 10])));
        let to = Some([90.0, 95.5, 20.0, 20.0]);
        assert_eq!(placed(None, to), Some(([90, 95], [100, 100])));
        assert_eq!(
            placed(Some([-5.0, 0.0, 10.0, 10.0]), Some([0.0, 0.0, 10.0, 10.0])),
            Some(([5, 0], [10, 10]))
        );
        assert_eq!(placed(None, Some([200.0, 0.0, 10.0, 10.0])), None);
        assert_eq!(placed(Some([50.0, 0.0, 10.0, 10.0]), Some([0.0, 0.0, 10.0, 10.0])), None);
        assert_eq!(placed(None, Some([0.0, 0.0, 1e11, 1e-6])), None);
        assert_eq!(placed(None, Some([-1e11, 0.0, 1e12, 50.0])), Some(([0, 0], [100, 50])));
    }
}
