//! Tiles of all levels, each made of the four below it, compressed as soon as they are made and kept in a nameless temporary file.
//!
//! The walk goes down by quarters, so a tile's four are at hand when it is due, and samples that lie near each other in the terrain file are read together. Tiles without a number are neither made nor
//! kept, and squares of them are passed over as a whole, so an ocean costs its places in the tables. Held are a few tiles a thread and level, and 16 bytes a tile. Which thread makes what shows nowhere: where a tile lies in the temporary file depends on it, and what is written in the end does not.

use super::encode::{Numbers, encode};
use crate::raster::Raster;
use std::fs::File;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};
use terrasoar_layout::dem::Window;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::atomic::folder_of;
use terrasoar_layout::file::disk::write_at;
use terrasoar_layout::progress::Progress;

/// Pixels a side of a tile.
pub(crate) const TILE: u32 = 512;
const SIDE: usize = TILE as usize;

/// Where a tile lies in the temporary file; one without a number takes no bytes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Kept {
    pub(super) offset: u64,
    pub(super) bytes: u32,
}

/// One level.
#[derive(Debug, Clone)]
pub(super) struct Level {
    /// Columns and rows of pixels.
    pub(super) size: [u32; 2],
    /// Columns and rows of tiles.
    pub(super) tiles: [u32; 2],
    /// By rows from the north.
    pub(super) kept: Vec<Kept>,
}

impl Level {
    /// Tiles that have a number.
    pub(super) fn stored(&self) -> impl Iterator<Item = &Kept> {
        self.kept.iter().filter(|tile| tile.bytes > 0)
    }
}

/// All tiles.
pub(super) struct Made {
    /// The finest first.
    pub(super) levels: Vec<Level>,
    pub(super) spool: File,
    /// Pixels of the finest level without a number.
    pub(super) voids: u64,
}

/// What is written meanwhile.
struct Spool {
    end: u64,
    levels: Vec<Level>,
    voids: u64,
}

struct Maker<'r> {
    raster: &'r dyn Raster,
    numbers: Numbers,
    tiles: Vec<[u32; 2]>,
    out: &'r Path,
    file: &'r File,
    spool: Mutex<Spool>,
    progress: &'r dyn Progress,
}

/// Sizes of the levels: each half of the one before, rounded up, to the first that one tile holds.
fn levels(size: [u32; 2]) -> Vec<Level> {
    let mut sizes = vec![size];
    while let Some(last) = sizes.last().filter(|size| size.iter().any(|side| *side > TILE)) {
        sizes.push(last.map(|side| side.div_ceil(2)));
    }
    let level = |size: [u32; 2]| {
        let tiles = size.map(|side| side.div_ceil(TILE));
        Level { size, tiles, kept: vec![Kept::default(); tiles[0] as usize * tiles[1] as usize] }
    };
    sizes.into_iter().map(level).collect()
}

/// Makes all tiles of a raster; the temporary file lies in the folder of `out`.
pub(super) fn make(
    raster: &dyn Raster,
    numbers: Numbers,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Made, LayoutError> {
    let size = raster.size();
    let file = tempfile::tempfile_in(folder_of(out))
        .map_err(|e| LayoutError::io(out, "cannot create a temporary file beside it", e))?;
    let levels = levels(size);
    progress.stage("writing", u64::from(size[0]) * u64::from(size[1]));
    let maker = Maker {
        raster,
        numbers,
        tiles: levels.iter().map(|level| level.tiles).collect(),
        out,
        file: &file,
        spool: Mutex::new(Spool { end: 0, levels, voids: 0 }),
        progress,
    };
    maker.tile(maker.tiles.len() - 1, [0; 2])?;
    let Spool { levels, voids, .. } = maker.spool.into_inner().unwrap_or_else(PoisonError::into_inner);
    Ok(Made { levels, spool: file, voids })
}

impl Maker<'_> {
    /// Makes a tile and all below it; its numbers, `None` where it has none.
    fn tile(&self, level: usize, at: [u32; 2]) -> Result<Option<Vec<f64>>, LayoutError> {
        let covered = self.covered(level, at);
        if self.raster.has_nothing(covered)? {
            let samples = u64::from(covered.width) * u64::from(covered.height);
            self.lock().voids += samples;
            self.progress.advance(samples);
            return Ok(None);
        }
        let values = if level == 0 { self.finest(covered)? } else { self.coarser(level, at)? };
        let Some(values) = values else { return Ok(None) };
        let failed = |e| {
            let when_full = "no room for the temporary file beside it, which takes as much as the output; make some on its disk, or name an output on another";
            LayoutError::write(self.out, "cannot write the temporary file beside it", when_full, e)
        };
        let bytes = encode(&values, SIDE, self.numbers).map_err(failed)?;
        let offset = {
            let mut spool = self.lock();
            let offset = spool.end;
            spool.end += bytes.len() as u64;
            let level = &mut spool.levels[level];
            let index = at[1] as usize * level.tiles[0] as usize + at[0] as usize;
            level.kept[index] = Kept { offset, bytes: bytes.len() as u32 };
            offset
        };
        write_at(self.file, &bytes, offset).map_err(failed)?;
        Ok(Some(values))
    }

    fn lock(&self) -> MutexGuard<'_, Spool> {
        self.spool.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a tile covers of the raster.
    fn covered(&self, level: usize, at: [u32; 2]) -> Window {
        let side = u64::from(TILE) << level;
        let span = |axis: usize| {
            let from = u64::from(at[axis]) * side;
            [from, side.min(u64::from(self.raster.size()[axis]) - from)].map(|v| v as u32)
        };
        let ([col, width], [row, height]) = (span(0), span(1));
        Window { col, row, width, height }
    }

    /// A tile of the raster itself.
    fn finest(&self, window: Window) -> Result<Option<Vec<f64>>, LayoutError> {
        let Window { width, height, .. } = window;
        let mut read = Vec::new();
        self.raster.read(window, &mut read)?;
        let voids = read.iter().map(|value| u64::from(value.is_nan())).sum::<u64>();
        self.lock().voids += voids;
        self.progress.advance(read.len() as u64);
        if voids == read.len() as u64 {
            return Ok(None);
        }
        if (width, height) == (TILE, TILE) {
            return Ok(Some(read));
        }
        let mut tile = vec![f64::NAN; SIDE * SIDE];
        for (row, values) in read.chunks_exact(width as usize).enumerate() {
            tile[row * SIDE..][..values.len()].copy_from_slice(values);
        }
        Ok(Some(tile))
    }

    /// A tile of an overview: means of what the four tiles below it have.
    fn coarser(&self, level: usize, at: [u32; 2]) -> Result<Option<Vec<f64>>, LayoutError> {
        let below = self.tiles[level - 1];
        let quarter = |east: u32, south: u32| {
            let child = [2 * at[0] + east, 2 * at[1] + south];
            if child[0] < below[0] && child[1] < below[1] { self.tile(level - 1, child) } else { Ok(None) }
        };
        let ((a, b), (c, d)) = rayon::join(
            || rayon::join(|| quarter(0, 0), || quarter(1, 0)),
            || rayon::join(|| quarter(0, 1), || quarter(1, 1)),
        );
        let quarters = [a?, b?, c?, d?];
        if quarters.iter().all(Option::is_none) {
            return Ok(None);
        }
        let mut tile = vec![f64::NAN; SIDE * SIDE];
        for (i, quarter) in quarters.iter().enumerate() {
            let Some(quarter) = quarter else { continue };
            let corner = (i / 2) * (SIDE / 2) * SIDE + (i % 2) * (SIDE / 2);
            for (row, pair) in quarter.chunks_exact(2 * SIDE).enumerate() {
                let (north, south) = pair.split_at(SIDE);
                let means = north.chunks_exact(2).zip(south.chunks_exact(2));
                for (value, (north, south)) in tile[corner + row * SIDE..].iter_mut().zip(means) {
                    *value = mean([north[0], north[1], south[0], south[1]]);
                }
            }
        }
        Ok(Some(tile))
    }
}

/// The mean of those that are numbers.
fn mean(values: [f64; 4]) -> f64 {
    let there = values.iter().filter(|value| !value.is_nan());
    there.clone().sum::<f64>() / there.count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_until_one_tile_holds_them() {
        let sizes = |size| levels(size).iter().map(|level| level.size).collect::<Vec<_>>();
        assert_eq!(sizes([512, 3]), [[512, 3]]);
        assert_eq!(sizes([513, 3]), [[513, 3], [257, 2]]);
        assert_eq!(sizes([1025, 2049]), [[1025, 2049], [513, 1025], [257, 513], [129, 257]]);
        assert_eq!(levels([65_537; 2]).len(), 9);
    }

    #[test]
    fn means_pass_over_what_is_no_number() {
        assert_eq!(mean([1.0, 2.0, 3.0, 6.0]), 3.0);
        assert_eq!(mean([f64::NAN, 2.0, f64::NAN, 6.0]), 4.0);
        assert!(mean([f64::NAN; 4]).is_nan());
    }
}
