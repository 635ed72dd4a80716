//! The image on its way from rows to tiles: a few hundred rows of each level, from north to south.
//!
//! A level's texel is the mean of the (at most) four below it, in linear light and weighted by alpha. Levels keep the rows that the tile row
//! under way needs, border included. A tile row is finished once its southernmost row is there. Nothing is written and read
//! again. Memory: 576 rows a level, 12 bytes a texel of level 0's width for all of them together.
//!
//! Invariant: rows of a level arrive once each, in descending order; a tile is cut only when every row it repeats has arrived.

use super::encode::{Texels, encode, is_transparent};
use super::linear::{Linear, TABLES, mean};
use super::section::TileEntry;
use super::shape::{BORDER_TEXELS, INNER_TEXELS, ImageryShape, TILE_TEXELS, TileId};
use crate::error::LayoutError;
use crate::file::bytes::checksum;
use rayon::prelude::*;

/// Rows that arrive at once.
pub(super) const STEP_ROWS: u32 = 64;
/// Rows a level keeps: those of a tile and those that arrive beyond them.
const KEPT_ROWS: u32 = TILE_TEXELS + STEP_ROWS;
/// Tiles made before they are written.
const TILES_AT_ONCE: u32 = 32;

/// A tile and what the directory says about it; its page is not known yet.
#[derive(Debug)]
pub(crate) struct MadeTile {
    pub(crate) id: TileId,
    pub(crate) entry: TileEntry,
    pub(crate) bytes: Vec<u8>,
}

/// Bytes that the pyramid of an image takes in memory.
pub(super) fn memory_bytes(shape: &ImageryShape) -> u64 {
    let texel_bytes = |level| if level == 0 { 4 } else { 8 };
    let level_bytes = |level| {
        let [wide, high] = shape.level_texels(level);
        u64::from(wide) * u64::from(high.min(KEPT_ROWS)) * texel_bytes(level)
    };
    let arriving = 2 * u64::from(shape.texels[0]) * u64::from(STEP_ROWS) * 4;
    let in_work = u64::from(TILES_AT_ONCE) * shape.format.tile_bytes() as u64
        + rayon::current_num_threads() as u64 * 2 * (1 << 20);
    (0..shape.levels).map(level_bytes).sum::<u64>() + arriving + in_work
}

/// The rows of one level at hand, row y at `y % kept`.
struct Rows<T> {
    wide: usize,
    kept: u32,
    texels: Vec<T>,
}

impl<T: Copy + Default> Rows<T> {
    fn new([wide, high]: [u32; 2]) -> Self {
        let kept = high.min(KEPT_ROWS);
        Self { wide: wide as usize, kept, texels: vec![T::default(); wide as usize * kept as usize] }
    }

    fn row(&self, y: u32) -> &[T] {
        let at = (y % self.kept) as usize * self.wide;
        &self.texels[at..at + self.wide]
    }

    fn row_mut(&mut self, y: u32) -> &mut [T] {
        let at = (y % self.kept) as usize * self.wide;
        &mut self.texels[at..at + self.wide]
    }
}

/// Texels of either kind, as bytes of sRGB and as linear light.
trait Texel: Copy + Send + Sync {
    fn srgb(self) -> [u8; 4];
    fn linear(self) -> Linear;
}

impl Texel for [u8; 4] {
    #[inline(always)]
    fn srgb(self) -> [u8; 4] {
        self
    }

    #[inline(always)]
    fn linear(self) -> Linear {
        TABLES.linear(self)
    }
}

impl Texel for Linear {
    #[inline(always)]
    fn srgb(self) -> [u8; 4] {
        TABLES.srgb(self)
    }

    #[inline(always)]
    fn linear(self) -> Linear {
        self
    }
}

/// How far a level has come.
struct Course {
    /// Southernmost row that has arrived; the level's height before the first.
    low: u32,
    /// Tile row to leave next, counted from the south, plus 1; 0 when all have left.
    tile_rows_left: u32,
}

/// All levels of an image under way.
pub(super) struct Pyramid {
    shape: ImageryShape,
    finest: Rows<[u8; 4]>,
    coarser: Vec<Rows<Linear>>,
    courses: Vec<Course>,
}

impl Pyramid {
    pub(super) fn new(shape: ImageryShape) -> Self {
        let courses = (0..shape.levels)
            .map(|level| Course {
                low: shape.level_texels(level)[1],
                tile_rows_left: shape.tile_count(level)[1],
            })
            .collect();
        let coarser = (1..shape.levels).map(|level| Rows::new(shape.level_texels(level))).collect();
        Self { finest: Rows::new(shape.texels), coarser, courses, shape }
    }

    /// Takes the next rows of the image from the north, at most [`STEP_ROWS`], red, green, blue, alpha a byte each; hands the tiles that are
    /// complete then, absent ones left out, to `put` in an order that does not depend on threads.
    pub(super) fn push(
        &mut self,
        rgba: &[u8],
        put: &mut dyn FnMut(MadeTile) -> Result<(), LayoutError>,
    ) -> Result<(), LayoutError> {
        let (texels, _) = rgba.as_chunks::<4>();
        for row in texels.chunks_exact(self.finest.wide) {
            let y = self.courses[0].low - 1;
            self.finest.row_mut(y).copy_from_slice(row);
            self.courses[0].low = y;
        }
        for level in 1..self.shape.levels as usize {
            self.halve(level);
        }
        for level in 0..self.shape.levels {
            while let Some(y) = self.complete_tile_row(level) {
                if level == 0 {
                    emit(&self.shape, &self.finest, level, y, put)?;
                } else {
                    emit(&self.shape, &self.coarser[level as usize - 1], level, y, put)?;
                }
                self.courses[level as usize].tile_rows_left -= 1;
            }
        }
        Ok(())
    }

    /// The tile row to leave next, if all its rows have arrived.
    fn complete_tile_row(&self, level: u32) -> Option<u32> {
        let course = &self.courses[level as usize];
        let y = course.tile_rows_left.checked_sub(1)?;
        (course.low <= (y * INNER_TEXELS).saturating_sub(BORDER_TEXELS)).then_some(y)
    }

    /// Makes the rows of `level` whose rows below have all arrived.
    fn halve(&mut self, level: usize) {
        let low = self.courses[level - 1].low.div_ceil(2);
        let arriving = low..self.courses[level].low;
        let high = self.shape.level_texels(level as u32 - 1)[1];
        let (finer, coarser) = self.coarser.split_at_mut(level - 1);
        match finer.last() {
            None => halve_rows(&self.finest, high, &mut coarser[0], arriving),
            Some(finer) => halve_rows(finer, high, &mut coarser[0], arriving),
        }
        self.courses[level].low = low;
    }
}

/// Makes the rows `arriving` of a level from the `high` rows of the one below.
fn halve_rows<T: Texel + Default>(
    finer: &Rows<T>,
    high: u32,
    coarser: &mut Rows<Linear>,
    arriving: std::ops::Range<u32>,
) {
    let (wide, kept) = (coarser.wide, coarser.kept);
    let work = |(place, row): (usize, &mut [Linear])| {
        // The one row of the range that lies at this place, if any.
        let ahead = (place as u32 + kept - arriving.start % kept) % kept;
        let y = arriving.start + ahead;
        if y < arriving.end {
            halve_row(finer.row(2 * y), finer.row((2 * y + 1).min(high - 1)), row);
        }
    };
    coarser.texels.par_chunks_exact_mut(wide).enumerate().for_each(work);
}

/// A row of a level from two below it. The last texel of an odd row stands alone.
fn halve_row<T: Texel>(south: &[T], north: &[T], row: &mut [Linear]) {
    let last = south.len() - 1;
    let mean = |west: usize, east: usize| {
        mean([south[west].linear(), south[east].linear(), north[west].linear(), north[east].linear()])
    };
    let pairs = south.len() / 2;
    for (x, texel) in row[..pairs].iter_mut().enumerate() {
        *texel = mean(2 * x, 2 * x + 1);
    }
    if let [texel] = &mut row[pairs..] {
        *texel = mean(last, last);
    }
}

/// Makes the tiles of one row, some at a time in parallel, and hands them on from the west.
fn emit<T: Texel + Default>(
    shape: &ImageryShape,
    rows: &Rows<T>,
    level: u32,
    y: u32,
    put: &mut dyn FnMut(MadeTile) -> Result<(), LayoutError>,
) -> Result<(), LayoutError> {
    let across = shape.tile_count(level)[0];
    for first in (0..across).step_by(TILES_AT_ONCE as usize) {
        let made: Vec<Option<MadeTile>> = (first..across.min(first + TILES_AT_ONCE))
            .into_par_iter()
            .map_init(Vec::new, |rgba, x| make(shape, rows, TileId { level, x, y }, rgba))
            .collect();
        made.into_iter().flatten().try_for_each(&mut *put)?;
    }
    Ok(())
}

/// Cuts and encodes one tile; `None` if nothing of it would be seen.
fn make<T: Texel + Default>(
    shape: &ImageryShape,
    rows: &Rows<T>,
    id: TileId,
    rgba: &mut Vec<u8>,
) -> Option<MadeTile> {
    let [wide, high] = shape.level_texels(id.level);
    let [covered, side] = [shape.covered_texels(id), shape.stored_texels(id)];
    let place = |tile: u32, texel: u32, end: u32| {
        (tile * INNER_TEXELS + texel).saturating_sub(BORDER_TEXELS).min(end - 1)
    };
    rgba.clear();
    let mut sums = [0u64; 4];
    let mut is_seen = false;
    for v in 0..side[1] {
        let row = rows.row(place(id.y, v, high));
        let begin = rgba.len();
        // Beyond the image its rim is repeated.
        let (from, to) = (place(id.x, 0, wide) as usize, place(id.x, side[0] - 1, wide) as usize);
        let missing = if id.x == 0 { BORDER_TEXELS as usize } else { 0 };
        rgba.extend(std::iter::repeat_n(row[from].srgb(), missing).flatten());
        rgba.extend(row[from..=to].iter().flat_map(|texel| texel.srgb()));
        let end = begin + side[0] as usize * 4;
        let last = row[to].srgb();
        while rgba.len() < end {
            rgba.extend(last);
        }
        let inside = (BORDER_TEXELS..BORDER_TEXELS + covered[1]).contains(&v);
        is_seen |= rgba[begin..].iter().skip(3).step_by(4).any(|alpha| !is_transparent(shape.format, *alpha));
        if inside {
            let first = (id.x * INNER_TEXELS) as usize;
            for texel in &row[first..first + covered[0] as usize] {
                let texel = texel.linear();
                sums.iter_mut().zip(texel).for_each(|(sum, value)| *sum += u64::from(value));
            }
        }
    }
    if !is_seen {
        return None;
    }
    let texels = u64::from(covered[0]) * u64::from(covered[1]);
    let average = TABLES.srgb(sums.map(|sum| ((sum + texels / 2) / texels) as u16));
    let bytes = encode(shape.format, Texels { side, rgba });
    let entry = TileEntry { page: 0, bytes: bytes.len() as u32, checksum: checksum(&bytes), average };
    Some(MadeTile { id, entry, bytes })
}
