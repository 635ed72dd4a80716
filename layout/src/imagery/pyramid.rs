//! The image on its way from rows to tiles: a few hundred rows of each level, from north to south.
//!
//! A level's texel is the mean of the (at most) four below it, in linear light and weighted by alpha. Levels keep the rows that the tile row
//! under way needs, border included. A tile row is finished once its southernmost row is there. Nothing is written and read
//! again. Memory: 576 rows a level, 12 bytes a texel of level 0's width for all of them together; of a mosaic whose pictures lie apart, of the columns alone in which these
//! rows have something ([`super::rows`]).
//!
//! Invariant: rows of a level arrive once each, in descending order; a tile is cut only when every row it repeats has arrived.

use super::encode::{Texels, encode, is_transparent};
use super::linear::{Linear, TABLES, mean};
use super::rows::{Area, Arrival, Rows, STEP_ROWS, kept_rows, most_columns};
use super::section::TileEntry;
use super::shape::{BORDER_TEXELS, INNER_TEXELS, ImageryShape, TileId};
use crate::error::LayoutError;
use crate::file::bytes::checksum;
use rayon::prelude::*;
use std::ops::Range;

/// Tiles made before they are written.
const TILES_AT_ONCE: u32 = 32;

/// A tile and what the directory says about it; its page is not known yet.
#[derive(Debug)]
pub(crate) struct MadeTile {
    pub(crate) id: TileId,
    pub(crate) entry: TileEntry,
    pub(crate) bytes: Vec<u8>,
}

/// Bytes that the pyramid of an image takes in memory, of which pictures cover some areas.
pub(super) fn memory_bytes(shape: &ImageryShape, areas: &[Area]) -> u64 {
    let columns = |level| most_columns(shape.level_texels(level)[0], level, areas);
    let texel_bytes = |level| if level == 0 { 4 } else { 8 };
    let level_bytes =
        |level| columns(level) * u64::from(kept_rows(shape.level_texels(level)[1])) * texel_bytes(level);
    let arriving = 2 * columns(0) * u64::from(STEP_ROWS) * 4;
    let in_work = u64::from(TILES_AT_ONCE) * shape.format.tile_bytes() as u64
        + rayon::current_num_threads() as u64 * 2 * (1 << 20);
    (0..shape.levels).map(level_bytes).sum::<u64>() + arriving + in_work
}

/// Texels of either kind, as bytes of sRGB and as linear light.
trait Texel: Copy + Default + Send + Sync {
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

    /// Takes the next rows of the image from the north, at most [`STEP_ROWS`]; hands the tiles that are complete then, absent ones left out, to `put` in an order that does not depend on threads.
    pub(super) fn push(
        &mut self,
        arrival: &Arrival,
        put: &mut dyn FnMut(MadeTile) -> Result<(), LayoutError>,
    ) -> Result<(), LayoutError> {
        self.finest.take(self.courses[0].low, arrival);
        self.courses[0].low -= arrival.rows;
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
            None => coarser[0].halve(&self.finest, high, arriving, halve_row),
            Some(finer) => coarser[0].halve(finer, high, arriving, halve_row),
        }
        self.courses[level].low = low;
    }
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
fn emit<T: Texel>(
    shape: &ImageryShape,
    rows: &Rows<T>,
    level: u32,
    y: u32,
    put: &mut dyn FnMut(MadeTile) -> Result<(), LayoutError>,
) -> Result<(), LayoutError> {
    let [across, wide] = [shape.tile_count(level)[0], shape.level_texels(level)[0]];
    let seen: Vec<u32> = (0..across).filter(|x| !rows.is_void(&columns(*x, wide))).collect();
    for some in seen.chunks(TILES_AT_ONCE as usize) {
        let made: Vec<Option<MadeTile>> = some
            .par_iter()
            .map_init(Default::default, |at_work, x| make(shape, rows, TileId { level, x: *x, y }, at_work))
            .collect();
        made.into_iter().flatten().try_for_each(&mut *put)?;
    }
    Ok(())
}

/// The columns of a level that a tile repeats, its border included.
fn columns(x: u32, wide: u32) -> Range<u32> {
    let first = x * INNER_TEXELS;
    first.saturating_sub(BORDER_TEXELS)..(first + INNER_TEXELS + BORDER_TEXELS).min(wide)
}

/// Cuts and encodes one tile; `None` if nothing of it would be seen.
fn make<T: Texel>(
    shape: &ImageryShape,
    rows: &Rows<T>,
    id: TileId,
    (rgba, line): &mut (Vec<u8>, Vec<T>),
) -> Option<MadeTile> {
    let [wide, high] = shape.level_texels(id.level);
    let [covered, side] = [shape.covered_texels(id), shape.stored_texels(id)];
    let place = |tile: u32, texel: u32, end: u32| {
        (tile * INNER_TEXELS + texel).saturating_sub(BORDER_TEXELS).min(end - 1)
    };
    rgba.clear();
    let mut sums = [0u64; 4];
    let mut is_seen = false;
    let columns = columns(id.x, wide);
    let first = (id.x * INNER_TEXELS - columns.start) as usize;
    for v in 0..side[1] {
        rows.copy(place(id.y, v, high), &columns, line);
        let begin = rgba.len();
        // Beyond the image its rim is repeated.
        let to = (place(id.x, side[0] - 1, wide) - columns.start) as usize;
        let missing = if id.x == 0 { BORDER_TEXELS as usize } else { 0 };
        rgba.extend(std::iter::repeat_n(line[0].srgb(), missing).flatten());
        rgba.extend(line[..=to].iter().flat_map(|texel| texel.srgb()));
        let end = begin + side[0] as usize * 4;
        let last = line[to].srgb();
        while rgba.len() < end {
            rgba.extend(last);
        }
        let inside = (BORDER_TEXELS..BORDER_TEXELS + covered[1]).contains(&v);
        is_seen |= rgba[begin..].iter().skip(3).step_by(4).any(|alpha| !is_transparent(shape.format, *alpha));
        if inside {
            for texel in &line[first..first + covered[0] as usize] {
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
