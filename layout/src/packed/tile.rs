//! The records of a tile, octave by octave.
//!
//! Of an octave of m x m cells come its whites, then those on edges that run east, then the others, each row by row: the order in which they are coded. So what a tile unpacks to is written from front to
//! back, and a place has its index by arithmetic.

use super::shape::TileShape;

/// The record of an inert vertex.
pub(crate) const INERT: u32 = 0xff00_0000;

/// Records of a tile, down to some octave. Those that the tile does not give are whatever they are.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct TileRecords {
    /// The finest octave there is, counted from the tile's own finest.
    pub(crate) finest: u32,
    tile_log: u32,
    /// Words of 4 bytes a record: 1 of compact ones, 2 or 4 of exact ones.
    words: usize,
    records: Vec<u32>,
}

/// Where the vertices that refine `m` cells a side begin: behind those of the coarser lattice.
const fn first_of(m: usize) -> usize {
    (m + 1) * (m + 1)
}

/// Index of a place, in steps of a tile of 2^`tile_log` steps.
#[inline(always)]
pub(crate) const fn index_of(tile_log: u32, [x, y]: [u32; 2]) -> usize {
    let octave = (x | y).trailing_zeros();
    if octave >= tile_log {
        return (x >> tile_log) as usize + 2 * (y >> tile_log) as usize;
    }
    let m = 1 << (tile_log - octave - 1);
    let (x, y) = ((x >> octave) as usize, (y >> octave) as usize);
    let (i, j) = (x / 2, y / 2);
    first_of(m)
        + match (x % 2, y % 2) {
            (1, 1) => j * m + i,
            (1, _) => m * m + j * m + i,
            _ => m * m + m * (m + 1) + j * (m + 1) + i,
        }
}

impl TileRecords {
    /// All inert compact ones, down to octave `finest`, counted from the tile's own finest.
    pub(crate) fn inert(shape: &TileShape, finest: u32) -> Self {
        Self::filled(shape, finest, &[INERT])
    }

    /// All the record of these words, down to octave `finest`.
    pub(crate) fn filled(shape: &TileShape, finest: u32, record: &[u32]) -> Self {
        let finest = finest.min(shape.tile_log);
        let count = first_of(1 << (shape.tile_log - finest));
        Self { finest, tile_log: shape.tile_log, words: record.len(), records: record.repeat(count) }
    }

    /// What `row` says of rows of vertices. It is handed the place of the first, how far one lies west of the next, both in steps of the tile, and the words of as many inert records.
    pub(crate) fn by_rows(
        shape: &TileShape,
        inert: &[u32],
        mut row: impl FnMut([u32; 2], u32, &mut [u32]),
    ) -> Self {
        let mut all = Self::filled(shape, 0, inert);
        let (words, last) = (inert.len(), 1 << shape.tile_log);
        for at in [[0, 0], [last, 0], [0, last], [last, last]] {
            row(at, last, all.words_mut(at));
        }
        for octave in 0..shape.tile_log {
            let (m, s) = (1usize << (shape.tile_log - octave - 1), 1u32 << octave);
            let (whites, blacks) = all.refining_mut(m).split_at_mut(words * m * m);
            let (easts, norths) = blacks.split_at_mut(words * m * (m + 1));
            for (y, records) in (s..).step_by(2 * s as usize).zip(whites.chunks_exact_mut(words * m)) {
                row([s, y], 2 * s, records);
            }
            for (y, records) in (0..).step_by(2 * s as usize).zip(easts.chunks_exact_mut(words * m)) {
                row([s, y], 2 * s, records);
            }
            for (y, records) in (s..).step_by(2 * s as usize).zip(norths.chunks_exact_mut(words * (m + 1))) {
                row([0, y], 2 * s, records);
            }
        }
        all
    }

    /// The words of the record at a place in steps of the tile; none if it is finer than what there is.
    pub(crate) fn words_at(&self, at: [u32; 2]) -> &[u32] {
        let first = self.words * index_of(self.tile_log, at);
        self.records.get(first..first + self.words).unwrap_or_default()
    }

    /// As [`TileRecords::words_at`].
    pub(crate) fn words_mut(&mut self, at: [u32; 2]) -> &mut [u32] {
        let first = self.words * index_of(self.tile_log, at);
        self.records.get_mut(first..first + self.words).unwrap_or_default()
    }

    /// The compact record at a place in steps of the tile; an inert one if it is finer than what there is.
    #[inline(always)]
    pub(crate) fn at(&self, at: [u32; 2]) -> u32 {
        self.records.get(index_of(self.tile_log, at)).copied().unwrap_or(INERT)
    }

    pub(crate) fn set(&mut self, at: [u32; 2], record: u32) {
        if let Some(place) = self.records.get_mut(index_of(self.tile_log, at)) {
            *place = record;
        }
    }

    /// The words of all records, by [`index_of`].
    pub(crate) fn all(&self) -> &[u32] {
        &self.records
    }

    /// The words of the vertices that refine `m` cells a side; none if they are finer than what there is.
    pub(crate) fn refining(&self, m: usize) -> &[u32] {
        self.records.get(self.words * first_of(m)..self.words * first_of(2 * m)).unwrap_or_default()
    }

    /// As [`TileRecords::refining`].
    pub(crate) fn refining_mut(&mut self, m: usize) -> &mut [u32] {
        self.records.get_mut(self.words * first_of(m)..self.words * first_of(2 * m)).unwrap_or_default()
    }

    /// Bytes it takes.
    pub(crate) fn bytes(&self) -> usize {
        4 * self.records.len() + size_of::<Self>()
    }

    /// Hands `each` the words of the records of an octave that a tile gives, and whether they are of easts and norths.
    pub(crate) fn for_each_given(&self, shape: &TileShape, octave: u32, mut each: impl FnMut(bool, &[u32])) {
        let (words, m) = (self.words, 1usize << (shape.tile_log - octave - 1));
        let (whites, blacks) = self.refining(m).split_at(words * m * m);
        let (easts, norths) = blacks.split_at(words * m * (m + 1));
        whites.chunks_exact(words).for_each(|record| each(false, record));
        // Of those that run east the last row, of the others the last of each, may be another tile's.
        let easts = &easts[..words * m * (m + usize::from(shape.is_last[1]))];
        easts.chunks_exact(words).for_each(|record| each(true, record));
        for row in norths.chunks_exact(words * (m + 1)) {
            let row = &row[..words * (m + usize::from(shape.is_last[0]))];
            row.chunks_exact(words).for_each(|record| each(true, record));
        }
    }

    /// Whether all records that a tile gives are those of another.
    pub(crate) fn gives_same(&self, other: &Self, shape: &TileShape) -> bool {
        let (words, last) = (self.words, 1 << shape.tile_log);
        let corners = [[0, 0], [last, 0], [0, last], [last, last]];
        if shape.is_top && corners.iter().any(|at| self.words_at(*at) != other.words_at(*at)) {
            return false;
        }
        (0..shape.delivered()).all(|octave| {
            let m = 1usize << (shape.tile_log - octave - 1);
            let (ours, theirs) = (self.refining(m), other.refining(m));
            if ours.len() != theirs.len() || ours.is_empty() {
                return false;
            }
            // Of those that run east the last row, of the others the last of each, may be another tile's.
            let easts = words * (m * m + m * (m + usize::from(shape.is_last[1])));
            let norths = words * (m * m + m * (m + 1));
            let wide = words * (m + usize::from(shape.is_last[0]));
            let mut rows = ours[norths..]
                .chunks_exact(words * (m + 1))
                .zip(theirs[norths..].chunks_exact(words * (m + 1)));
            ours[..easts] == theirs[..easts] && rows.all(|(ours, theirs)| ours[..wide] == theirs[..wide])
        })
    }

    /// Whether all records that a tile gives are inert ones.
    pub(crate) fn gives_nothing(&self, shape: &TileShape, inert: &[u32]) -> bool {
        let last = 1 << shape.tile_log;
        let step_log = shape.delivered();
        let mut places = (0..=last).flat_map(|y| (0..=last).map(move |x: u32| [x, y]));
        places.all(|[x, y]| {
            let is_given = if x % last == 0 && y % last == 0 {
                shape.is_top
            } else {
                (x | y) % (1 << step_log) != 0
                    && (x < last || shape.is_last[0])
                    && (y < last || shape.is_last[1])
            };
            !is_given || self.words_at([x, y]) == inert
        })
    }
}

#[cfg(test)]
impl TileRecords {
    /// What `record` says of every vertex in steps of the tile; it is handed the words of an inert one.
    pub(crate) fn gathered(
        shape: &TileShape,
        inert: &[u32],
        mut record: impl FnMut([u32; 2], &mut [u32]),
    ) -> Self {
        let mut all = Self::filled(shape, 0, inert);
        let side = 0..=1 << shape.tile_log;
        side.clone().for_each(|y| side.clone().for_each(|x| record([x, y], all.words_mut([x, y]))));
        all
    }

    /// Compact records, by what `record` says of every vertex in steps of the tile.
    pub(crate) fn from_fn(shape: &TileShape, mut record: impl FnMut([u32; 2]) -> u32) -> Self {
        Self::gathered(shape, &[INERT], |at, words| words[0] = record(at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_has_an_index_of_its_own() {
        for tile_log in 0..=6 {
            let shape = TileShape { stride_log: 0, tile_log, is_top: true, is_last: [true; 2] };
            let tile = TileRecords::from_fn(&shape, |[x, y]| y << 8 | x);
            let side = 0..=1 << tile_log;
            for [x, y] in side.clone().flat_map(|y| side.clone().map(move |x| [x, y])) {
                assert_eq!(tile.at([x, y]), y << 8 | x);
            }
            assert_eq!(tile.all().len(), ((1 << tile_log) + 1) * ((1 << tile_log) + 1));
            let by_rows = TileRecords::by_rows(&shape, &[INERT], |[x, y], step, words| {
                let xs = (x..).step_by(step as usize);
                words.iter_mut().zip(xs).for_each(|(word, x)| *word = y << 8 | x);
            });
            assert_eq!(by_rows, tile);
        }
    }
}
