//! The rows of a level at hand, in chunks of columns: a chunk in which nothing is seen is not there.
//!
//! Pictures far apart make a mosaic of which next to nothing is seen. A chunk comes with the first row that a picture has in it and goes when the last such row is no
//! longer kept; where there is none, everything is transparent. So memory and time follow what the pictures cover, and a look at each chunk of columns.

use super::shape::TILE_TEXELS;
use rayon::prelude::*;
use std::ops::Range;

/// Rows that arrive at once.
pub(super) const STEP_ROWS: u32 = 64;
/// Rows a level keeps: those of a tile and those that arrive beyond them.
const KEPT_ROWS: u32 = TILE_TEXELS + STEP_ROWS;
/// Columns of a chunk, an even number.
const CHUNK: u32 = 256;

/// Rows as they arrive, the northernmost first: stretches of columns from the west, between which everything is transparent.
#[derive(Debug, Default)]
pub(super) struct Arrival {
    pub(super) rows: u32,
    pub(super) stretches: Vec<Stretch>,
}

/// All rows of some columns.
#[derive(Debug, Default)]
pub(super) struct Stretch {
    pub(super) columns: Range<u32>,
    /// Red, green, blue, alpha, a byte each.
    pub(super) rgba: Vec<u8>,
}

/// Columns from the west and rows from the south that a picture covers.
#[derive(Debug, Clone)]
pub(super) struct Area {
    pub(super) columns: Range<u32>,
    pub(super) rows: Range<u32>,
}

/// The chunks that some columns touch.
fn chunks_of(columns: &Range<u32>) -> Range<usize> {
    (columns.start / CHUNK) as usize..columns.end.div_ceil(CHUNK) as usize
}

/// The most columns that are there at once, of a level of `wide` columns whose texels are `1 << level` of the areas' a side.
pub(super) fn most_columns(wide: u32, level: u32, areas: &[Area]) -> u64 {
    // Rows arrive from the north: an area's chunks are there from its northernmost row until its southernmost one is not kept any more.
    let mut events: Vec<(i64, bool, &Area)> = Vec::new();
    for area in areas {
        let [first, last] = [area.rows.end - 1, area.rows.start].map(|y| i64::from(y >> level));
        events.push((-first, true, area));
        events.push((i64::from(KEPT_ROWS + STEP_ROWS) - last, false, area));
    }
    events.sort_by_key(|(when, comes, _)| (*when, !comes));
    let mut uses = vec![0u32; wide.div_ceil(CHUNK) as usize];
    let (mut there, mut most) = (0, 0);
    for (_, comes, area) in events {
        let columns = area.columns.start >> level..((area.columns.end - 1) >> level) + 1;
        for chunk in chunks_of(&columns) {
            let columns = u64::from(columns_of(wide, chunk));
            if comes {
                there += if uses[chunk] == 0 { columns } else { 0 };
                uses[chunk] += 1;
            } else {
                uses[chunk] -= 1;
                there -= if uses[chunk] == 0 { columns } else { 0 };
            }
        }
        most = most.max(there);
    }
    most
}

/// Rows that a level of so many keeps.
pub(super) fn kept_rows(high: u32) -> u32 {
    high.min(KEPT_ROWS)
}

fn columns_of(wide: u32, chunk: usize) -> u32 {
    CHUNK.min(wide - chunk as u32 * CHUNK)
}

/// The rows of one level at hand.
pub(super) struct Rows<T> {
    wide: u32,
    kept: u32,
    chunks: Vec<Option<Chunk<T>>>,
    /// Whether any chunk is there.
    is_any: bool,
}

/// Row y at `y % kept`.
struct Chunk<T> {
    wide: usize,
    texels: Vec<T>,
    /// The southernmost row that a picture reaches.
    last: u32,
}

impl<T: Copy + Default> Chunk<T> {
    fn new(wide: u32, kept: u32) -> Self {
        let wide = wide as usize;
        Self { wide, texels: vec![T::default(); wide * kept as usize], last: u32::MAX }
    }

    fn row(&self, y: u32, kept: u32) -> &[T] {
        let at = (y % kept) as usize * self.wide;
        &self.texels[at..at + self.wide]
    }

    fn row_mut(&mut self, y: u32, kept: u32) -> &mut [T] {
        let at = (y % kept) as usize * self.wide;
        &mut self.texels[at..at + self.wide]
    }
}

impl<T: Copy + Default + Send + Sync> Rows<T> {
    pub(super) fn new([wide, high]: [u32; 2]) -> Self {
        let chunks = (0..wide.div_ceil(CHUNK)).map(|_| None).collect();
        Self { wide, kept: kept_rows(high), chunks, is_any: false }
    }

    /// Whether nothing is seen in some columns of the rows at hand.
    pub(super) fn is_void(&self, columns: &Range<u32>) -> bool {
        !self.is_any || self.chunks[chunks_of(columns)].iter().all(Option::is_none)
    }

    /// Fills `line` with some columns of a row.
    pub(super) fn copy(&self, y: u32, columns: &Range<u32>, line: &mut Vec<T>) {
        line.clear();
        for chunk in chunks_of(columns) {
            let begin = chunk as u32 * CHUNK;
            let [from, to] = [columns.start.max(begin), columns.end.min(begin + CHUNK)].map(|x| x - begin);
            match &self.chunks[chunk] {
                Some(chunk) => {
                    line.extend_from_slice(&chunk.row(y, self.kept)[from as usize..to as usize]);
                }
                None => line.resize(line.len() + (to - from) as usize, T::default()),
            }
        }
    }

    /// Lets go of chunks in which nothing is seen any more once the rows from `low` on have arrived.
    fn let_go(&mut self, low: u32) {
        for place in &mut self.chunks {
            if place.as_ref().is_some_and(|chunk| chunk.last >= low.saturating_add(self.kept)) {
                *place = None;
            }
        }
        self.is_any = self.chunks.iter().any(Option::is_some);
    }

    /// Makes the rows `arriving` from the `high` rows of the level below, two by two.
    pub(super) fn halve<F: Copy + Default + Send + Sync>(
        &mut self,
        finer: &Rows<F>,
        high: u32,
        arriving: Range<u32>,
        halve_row: impl Fn(&[F], &[F], &mut [T]) + Sync,
    ) {
        if arriving.is_empty() || !self.is_any && !finer.is_any {
            return;
        }
        let (wide, kept) = (self.wide, self.kept);
        self.chunks.par_iter_mut().enumerate().for_each(|(at, place)| {
            let below = [2 * at, 2 * at + 1].map(|i| finer.chunks.get(i).and_then(Option::as_ref));
            let last = below.iter().flatten().map(|chunk| (chunk.last / 2).max(arriving.start)).min();
            let last = last.filter(|last| *last < arriving.end);
            if let Some(last) = last {
                let chunk = place.get_or_insert_with(|| Chunk::new(columns_of(wide, at), kept));
                chunk.last = chunk.last.min(last);
            }
            let Some(chunk) = place else { return };
            for y in arriving.clone() {
                let halves = chunk.row_mut(y, kept);
                let middle = halves.len().min(CHUNK as usize / 2);
                let (west, east) = halves.split_at_mut(middle);
                for (half, below) in [west, east].into_iter().zip(below) {
                    match below {
                        Some(below) if last.is_some() => {
                            let north = (2 * y + 1).min(high - 1);
                            halve_row(below.row(2 * y, finer.kept), below.row(north, finer.kept), half);
                        }
                        _ => half.fill(T::default()),
                    }
                }
            }
        });
        self.let_go(arriving.start);
    }
}

impl Rows<[u8; 4]> {
    /// Takes the rows that arrive south of row `high`, which is not among them.
    pub(super) fn take(&mut self, high: u32, arrival: &Arrival) {
        let low = high - arrival.rows;
        if arrival.rows == 0 || !self.is_any && arrival.stretches.is_empty() {
            return;
        }
        for stretch in &arrival.stretches {
            for at in chunks_of(&stretch.columns) {
                let chunk =
                    self.chunks[at].get_or_insert_with(|| Chunk::new(columns_of(self.wide, at), self.kept));
                chunk.last = low;
            }
        }
        for (at, chunk) in self.chunks.iter_mut().enumerate().filter_map(|(at, c)| Some((at, c.as_mut()?))) {
            let begin = at as u32 * CHUNK;
            let end = begin + chunk.wide as u32;
            let first = arrival.stretches.partition_point(|stretch| stretch.columns.end <= begin);
            let met = arrival.stretches[first..].iter().take_while(|stretch| stretch.columns.start < end);
            for (line, y) in (low..high).rev().enumerate() {
                let row = chunk.row_mut(y, self.kept);
                let mut filled = begin;
                for Stretch { columns, rgba } in met.clone() {
                    let (from, to) = (columns.start.max(begin), columns.end.min(end));
                    let wide = (columns.end - columns.start) as usize;
                    let source = line * wide + (from - columns.start) as usize;
                    let (texels, _) = rgba.as_chunks::<4>();
                    row[(filled - begin) as usize..(from - begin) as usize].fill([0; 4]);
                    row[(from - begin) as usize..(to - begin) as usize]
                        .copy_from_slice(&texels[source..source + (to - from) as usize]);
                    filled = to;
                }
                row[(filled - begin) as usize..].fill([0; 4]);
            }
        }
        self.let_go(low);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[expect(clippy::single_range_in_vec_init, reason = "a list of one stretch is meant")]
    fn stretches_at(y: u32, wide: u32) -> Vec<Range<u32>> {
        match y {
            2500.. => vec![100..300, 700..701],
            1500..2500 => vec![],
            900..1500 => vec![0..wide],
            _ => vec![1290..1300],
        }
    }

    /// Rows of two stretches that move, taken in steps, are those of a plain picture; what was seen is let go of.
    #[test]
    fn chunks_hold_what_arrives_and_nothing_else() {
        let (wide, high) = (1300_u32, 3000_u32);
        let texel = |x: u32, y: u32| [x as u8, y as u8, (x / 256) as u8, 255];
        let stretches_at = |y| stretches_at(y, wide);
        let mut rows = Rows::new([wide, high]);
        let mut low = high;
        let mut line = Vec::new();
        while low > 0 {
            let step = low.min(STEP_ROWS).min(1 + (low - 1) % 50);
            let stretches = stretches_at(low - 1);
            let made = stretches.iter().map(|columns| Stretch {
                columns: columns.clone(),
                rgba: (low - step..low)
                    .rev()
                    .flat_map(|y| columns.clone().flat_map(move |x| texel(x, y)))
                    .collect(),
            });
            rows.take(low, &Arrival { rows: step, stretches: made.collect() });
            low -= step;
            for y in (low..high.min(low + KEPT_ROWS)).step_by(37) {
                for columns in [0..wide, 90..310, 511..513, 1299..1300] {
                    rows.copy(y, &columns, &mut line);
                    let seen = |x: u32| stretches_at(y).iter().any(|columns| columns.contains(&x));
                    let wanted = columns.clone().map(|x| if seen(x) { texel(x, y) } else { [0; 4] });
                    assert!(line.iter().copied().eq(wanted), "{y} {columns:?}");
                }
            }
            if (1500..2500 - KEPT_ROWS - STEP_ROWS).contains(&low) {
                assert!(rows.is_void(&(0..wide)) && !rows.is_any, "{low}");
            }
        }
        assert!(rows.is_void(&(0..1280)) && !rows.is_void(&(1270..1290)));
    }

    #[test]
    fn columns_are_counted_that_are_there_at_once() {
        let area = |columns: Range<u32>, rows: Range<u32>| Area { columns, rows };
        let whole = area(0..10_000, 0..7000);
        for level in 0..5 {
            let wide = 10_000_u32.div_ceil(1 << level);
            assert_eq!(most_columns(wide, level, std::slice::from_ref(&whole)), u64::from(wide));
        }
        let apart = [area(0..256, 0..100), area(9000..9200, 100_000..100_100)];
        assert_eq!(most_columns(10_000, 0, &apart), 256);
        assert_eq!(most_columns(10_000, 0, &[area(0..256, 0..100), area(9000..9200, 50..60)]), 512);
        // At the coarsest both are there.
        assert_eq!(most_columns(313, 5, &[area(0..256, 0..100), area(9000..9200, 10_000..10_100)]), 313);
    }
}
