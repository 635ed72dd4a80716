//! Small holes filled: regions of voids of a few samples, found in one pass over the spooled rows.
//!
//! A region is voids that border each other east, west, north or south; it is filled if its box is at most so many samples wide and high, by a membrane over its rim. Its
//! neighbours are no voids, so **what fills a hole depends on the elevation data alone**, not on other holes, threads or memory. Values are rounded to the steps
//! that all samples keep, so that the kind of record stays. Cost: a pass over the rows; 12 bytes a row's piece of an open region, and a window of a region's size a thread.

mod membrane;

use super::spool::Spool;
use crate::error::LayoutError;
use membrane::Hole;
use rayon::prelude::*;

/// The largest side of a hole that can be filled.
pub const MAX_FILL: u32 = 256;
/// Pieces of finished holes that are filled at a time.
const BATCH: usize = 1 << 14;

/// What was filled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Filled {
    pub(super) holes: u64,
    pub(super) samples: u64,
}

/// A part of a row: from one column to another, both in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Piece {
    y: u32,
    west: u32,
    east: u32,
}

/// Voids that border each other.
#[derive(Debug, Clone)]
struct Region {
    south: u32,
    north: u32,
    west: u32,
    east: u32,
    /// None once it is too large.
    pieces: Vec<Piece>,
    is_large: bool,
}

impl Region {
    fn of(piece: Piece, most: u32) -> Self {
        let Piece { y, west, east } = piece;
        Self { south: y, north: y, west, east, pieces: vec![piece], is_large: false }.bounded(most)
    }

    fn join(&mut self, other: Self, most: u32) {
        self.south = self.south.min(other.south);
        self.north = self.north.max(other.north);
        self.west = self.west.min(other.west);
        self.east = self.east.max(other.east);
        self.is_large |= other.is_large;
        self.pieces.extend(other.pieces);
        let joined = std::mem::replace(self, Self { pieces: Vec::new(), ..*self });
        *self = joined.bounded(most);
    }

    fn bounded(mut self, most: u32) -> Self {
        self.is_large |= self.north - self.south >= most || self.east - self.west >= most;
        if self.is_large {
            self.pieces = Vec::new();
        }
        self
    }
}

/// The regions that have voids in the last row that was looked at.
#[derive(Default)]
struct Open {
    regions: Vec<Region>,
    /// Pieces of that row, from the west, and which region each belongs to.
    row: Vec<(Piece, usize)>,
}

impl Open {
    /// Goes on to the next row, whose pieces are given from the west; moves regions that have none in it to `ended`.
    fn next_row(&mut self, pieces: &[Piece], most: u32, ended: &mut Vec<Region>) {
        let before = self.regions.len();
        let mut roots: Vec<usize> = (0..before + pieces.len()).collect();
        let mut below = self.row.iter().peekable();
        for (i, piece) in pieces.iter().enumerate() {
            while below.next_if(|(old, _)| old.east < piece.west).is_some() {}
            let mut touching = below.clone();
            while let Some((_, region)) = touching.next_if(|(old, _)| old.west <= piece.east) {
                let (a, b) = (root(&mut roots, before + i), root(&mut roots, *region));
                // The lower number leads, so that old regions do.
                roots[a.max(b)] = a.min(b);
            }
        }
        let mut joined: Vec<Option<Region>> = self.regions.drain(..).map(Some).collect();
        joined.extend(pieces.iter().map(|piece| Some(Region::of(*piece, most))));
        let mut goes_on = vec![false; joined.len()];
        for i in 0..joined.len() {
            let leader = root(&mut roots, i);
            goes_on[leader] |= i >= before;
            if leader != i
                && let (Some(other), Some(region)) = (joined[i].take(), joined[leader].as_mut())
            {
                region.join(other, most);
            }
        }
        let mut places = vec![0; joined.len()];
        for (i, region) in joined.into_iter().enumerate() {
            let Some(region) = region else { continue };
            if goes_on[i] {
                places[i] = self.regions.len();
                self.regions.push(region);
            } else if !region.is_large {
                ended.push(region);
            }
        }
        self.row = pieces
            .iter()
            .enumerate()
            .map(|(i, piece)| (*piece, places[root(&mut roots, before + i)]))
            .collect();
    }
}

fn root(roots: &mut [usize], mut i: usize) -> usize {
    while roots[i] != i {
        roots[i] = roots[roots[i]];
        i = roots[i];
    }
    i
}

/// Fills all holes of at most `most` samples across.
pub(super) fn fill_holes(
    spool: &Spool<'_>,
    [wide, high]: [u32; 2],
    most: u32,
    advance: &(dyn Fn(u64) + Sync),
) -> Result<Filled, LayoutError> {
    let (mut open, mut ended, mut filled) = (Open::default(), Vec::new(), Filled::default());
    let (mut row, mut pieces) = (Vec::new(), Vec::new());
    for y in 0..high {
        pieces.clear();
        if spool.is_void_row(y) {
            pieces.push(Piece { y, west: 0, east: wide - 1 });
        } else {
            let mut at = 0;
            for run in spool.land().runs(y..=y) {
                add_piece(&mut pieces, y, at..run.start);
                row.resize(run.len(), 0.0);
                spool.read_part(y, run.start, &mut row)?;
                voids_of(&row, run.start, y, &mut pieces);
                at = run.end;
            }
            add_piece(&mut pieces, y, at..wide);
        }
        open.next_row(&pieces, most, &mut ended);
        if ended.iter().map(|region| region.pieces.len()).sum::<usize>() >= BATCH {
            filled.add(fill(spool, [wide, high], &mut ended)?);
        }
        advance(u64::from(wide));
    }
    open.next_row(&[], most, &mut ended);
    filled.add(fill(spool, [wide, high], &mut ended)?);
    Ok(filled)
}

impl Filled {
    fn add(&mut self, more: Self) {
        self.holes += more.holes;
        self.samples += more.samples;
    }
}

/// Adds the pieces that are void of a part of a row that begins at column `first`.
fn voids_of(part: &[f64], first: u32, y: u32, pieces: &mut Vec<Piece>) {
    let mut x = 0;
    while let Some(skipped) = part[x..].iter().position(|v| v.is_nan()) {
        let west = x + skipped;
        let count = part[west..].iter().position(|v| !v.is_nan()).unwrap_or(part.len() - west);
        x = west + count;
        add_piece(pieces, y, first + west as u32..first + x as u32);
    }
}

/// Adds columns that are void, to the last piece if they go on where it ends.
fn add_piece(pieces: &mut Vec<Piece>, y: u32, columns: std::ops::Range<u32>) {
    if columns.is_empty() {
        return;
    }
    match pieces.last_mut().filter(|last| last.east + 1 == columns.start) {
        Some(last) => last.east = columns.end - 1,
        None => pieces.push(Piece { y, west: columns.start, east: columns.end - 1 }),
    }
}

/// Fills these regions.
fn fill(spool: &Spool<'_>, samples: [u32; 2], regions: &mut Vec<Region>) -> Result<Filled, LayoutError> {
    let counts = std::mem::take(regions).into_par_iter().map(|region| fill_one(spool, samples, &region));
    let add = |a: Filled, b: Filled| Ok(Filled { holes: a.holes + b.holes, samples: a.samples + b.samples });
    counts.try_reduce(Filled::default, add)
}

fn fill_one(spool: &Spool<'_>, [wide, high]: [u32; 2], region: &Region) -> Result<Filled, LayoutError> {
    let [west, south] = [region.west.saturating_sub(1), region.south.saturating_sub(1)];
    let [east, north] = [(region.east + 1).min(wide - 1), (region.north + 1).min(high - 1)];
    let size = [east - west + 1, north - south + 1].map(|side| side as usize);
    let mut hole =
        Hole { size, samples: vec![f64::NAN; size[0] * size[1]], is_inside: vec![false; size[0] * size[1]] };
    for (y, row) in (south..=north).zip(hole.samples.chunks_exact_mut(size[0])) {
        spool.read_part(y, west, row)?;
    }
    let place = |piece: &Piece| {
        let start = (piece.y - south) as usize * size[0] + (piece.west - west) as usize;
        start..start + (piece.east - piece.west + 1) as usize
    };
    for piece in &region.pieces {
        hole.is_inside[place(piece)].fill(true);
    }
    hole.fill();
    let mut samples = 0;
    for piece in &region.pieces {
        let values = &hole.samples[place(piece)];
        // All is void where a hole has no rim.
        if values.iter().any(|v| v.is_nan()) {
            return Ok(Filled::default());
        }
        spool.fill(piece.y, piece.west, values)?;
        samples += values.len() as u64;
    }
    Ok(Filled { holes: 1, samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Regions and their boxes, by a flood from each void.
        #[test]
        fn regions_are_those_of_a_flood(wide in 1..12u32, high in 1..12u32, bits in prop::collection::vec(any::<bool>(), 144), most in 1..8u32) {
            let is_void = |x: u32, y: u32| bits[(y * 12 + x) as usize];
            let mut expected = Vec::new();
            let mut seen = [false; 144];
            for start in (0..high).flat_map(|y| (0..wide).map(move |x| (x, y))) {
                let mut waiting = vec![start];
                let mut cells = Vec::new();
                while let Some((x, y)) = waiting.pop() {
                    if x >= wide || y >= high || !is_void(x, y) || std::mem::replace(&mut seen[(y * 12 + x) as usize], true) {
                        continue;
                    }
                    cells.push((y, x));
                    waiting.extend([(x + 1, y), (x.wrapping_sub(1), y), (x, y + 1), (x, y.wrapping_sub(1))]);
                }
                cells.sort_unstable();
                let span = |of: fn(&(u32, u32)) -> u32| {
                    cells.iter().map(of).max().unwrap_or(0) - cells.iter().map(of).min().unwrap_or(0)
                };
                if !cells.is_empty() && span(|c| c.0) < most && span(|c| c.1) < most {
                    expected.push(cells);
                }
            }
            let (mut open, mut ended) = (Open::default(), Vec::new());
            for y in 0..high {
                let row: Vec<f64> = (0..wide).map(|x| if is_void(x, y) { f64::NAN } else { 1.0 }).collect();
                let mut pieces = Vec::new();
                voids_of(&row, 0, y, &mut pieces);
                open.next_row(&pieces, most, &mut ended);
            }
            open.next_row(&[], most, &mut ended);
            let mut found: Vec<Vec<(u32, u32)>> = ended.iter().map(|region| {
                let mut cells: Vec<_> =
                    region.pieces.iter().flat_map(|p| (p.west..=p.east).map(|x| (p.y, x))).collect();
                cells.sort_unstable();
                cells
            }).collect();
            found.sort();
            expected.sort();
            prop_assert_eq!(found, expected);
        }
    }
}
