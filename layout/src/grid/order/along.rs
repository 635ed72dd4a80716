//! Slots of the vertices of a row one after the other: each from the one before it, by a few additions.
//!
//! Slots are made of spread coordinates. One more of a spread number is an addition in which the bits between its own let the carry pass, one less a subtraction that clears them.
//! Invariant: the slots are those of [`slot_of`](super::slot_of).

use super::{black_base, black_block, level_slots, spread24, white_base};

/// The bits of spread numbers.
const EVEN: u64 = 0x5555_5555_5555_5555;

/// Slots of a row of white vertices, from one of them eastwards, without end. What lies beyond the square has none that counts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WhiteAlong {
    base: u64,
    /// Spread cell column of the next vertex.
    column: u64,
    /// Spread cell row.
    row: u64,
}

impl WhiteAlong {
    /// From the vertex of `level`, which is odd, at (`x`, `y`) on, in a square of 2^k steps a side.
    #[inline(always)]
    pub(crate) const fn new(k: u32, level: u32, x: u32, y: u32) -> Self {
        let t = level / 2;
        let [column, row] = [spread24((x >> (t + 1)) as u64), spread24((y >> (t + 1)) as u64)];
        Self { base: white_base(k - 1 - t) + 2 * row, column, row }
    }
}

impl Iterator for WhiteAlong {
    type Item = u64;

    #[inline(always)]
    fn next(&mut self) -> Option<u64> {
        let column = self.column;
        self.column = (column | !EVEN).wrapping_add(1) & EVEN;
        Some(self.base + (column ^ self.row))
    }
}

/// Slots of a row of black vertices, as [`WhiteAlong`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlackAlong {
    base: u64,
    /// Spread A of the next vertex, and B: see [`slot_of`](super::slot_of).
    a: u64,
    b: u64,
    /// What is turned about of A, and of A and B together.
    flips: [u64; 2],
}

impl BlackAlong {
    /// From the vertex of `level`, which is even, at (`x`, `y`) on, in a square of 2^k steps a side.
    #[inline(always)]
    pub(crate) const fn new(k: u32, level: u32, x: u32, y: u32) -> Self {
        let t = level / 2;
        let d = k - 1 - t;
        let (a, b) = black_block(d, (x >> t) as u64, (y >> t) as u64);
        let top = 1 << (2 * d);
        Self { base: black_base(d), a: spread24(a), b: spread24(b), flips: [EVEN & (top - 1), top] }
    }
}

impl Iterator for BlackAlong {
    type Item = u64;

    #[inline(always)]
    fn next(&mut self) -> Option<u64> {
        let Self { base, a, b, flips: [turned, top] } = *self;
        // A step along the row is one more of A and one less of B.
        self.a = (a | !EVEN).wrapping_add(1) & EVEN;
        self.b = b.wrapping_sub(1) & EVEN;
        Some(base + 2 * (a ^ turned) + (a ^ b ^ top))
    }
}

/// Slots of a [`family`].
pub(crate) const FAMILY: u64 = 16;

/// First slot of the family of the vertex at `slot` of `level` + 4: of the 16 vertices of `level` that lie side by side in the file and around it on the
/// ground, three times 2^(`level` / 2) steps away at most along either axis. They are its quadtree's, so every vertex of `level` is in one family.
#[inline(always)]
pub(crate) const fn family(k: u32, level: u32, slot: u64) -> u64 {
    level_slots(k, level).start + FAMILY * (slot - level_slots(k, level + 4).start)
}

/// The first slot of the row that begins with a vertex of `level`.
#[cfg(test)]
pub(super) fn first_along(k: u32, level: u32, p: crate::grid::GridPoint) -> Option<u64> {
    if level & 1 == 1 {
        WhiteAlong::new(k, level, p.x(), p.y()).next()
    } else {
        BlackAlong::new(k, level, p.x(), p.y()).next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::order::{point_of, slot_of};
    use crate::grid::{Grid, GridPoint};

    fn along(k: u32, level: u32, x: u32, y: u32, count: usize) -> Vec<u64> {
        if level & 1 == 1 {
            WhiteAlong::new(k, level, x, y).take(count).collect()
        } else {
            BlackAlong::new(k, level, x, y).take(count).collect()
        }
    }

    #[test]
    fn slots_along_rows_are_those_of_their_vertices() {
        for k in 1..=6 {
            let grid = Grid::new([(1 << k) + 1; 2], [1.0; 2]).unwrap();
            let n = grid.side_steps();
            let mut seen = 0;
            for level in 0..grid.levels() {
                for y in 0..=n {
                    let of_row = |x: &u32| {
                        let p = GridPoint::new(*x, y);
                        !grid.is_corner(p) && grid.level(p) == level
                    };
                    let row: Vec<u32> = (0..=n).filter(of_row).collect();
                    for start in 0..row.len() {
                        let along = along(k, level, row[start], y, row.len() - start);
                        for (x, slot) in row[start..].iter().zip(along) {
                            assert_eq!(slot, slot_of(k, GridPoint::new(*x, y)), "level {level}: ({x}, {y})");
                            seen += 1;
                        }
                    }
                }
            }
            assert!(seen >= (n + 1) * (n + 1) - 4);
        }
    }

    #[test]
    fn slots_along_rows_of_a_large_square_are_those_of_their_vertices() {
        for k in [12, 17] {
            let n = 1u32 << k;
            for level in 0..8 {
                let step = 1u32 << (level / 2);
                for y in (0..=n).step_by(step as usize * 37).chain([n - step, n]) {
                    let Some(first) = (0..2).map(|i| i * step).find(|x| {
                        let p = GridPoint::new(*x, y);
                        level_of(p, k) == Some(level)
                    }) else {
                        continue;
                    };
                    let row = (first..=n).step_by(2 * step as usize);
                    let along = along(k, level, first, y, row.clone().count());
                    for (x, slot) in row.zip(along).step_by(11) {
                        assert_eq!(
                            slot,
                            slot_of(k, GridPoint::new(x, y)),
                            "level {level} of {k}: ({x}, {y})"
                        );
                    }
                }
            }
        }
    }

    fn level_of(p: GridPoint, k: u32) -> Option<u32> {
        let grid = Grid::new([(1 << k) + 1; 2], [1.0; 2]).unwrap();
        (!grid.is_corner(p)).then(|| grid.level(p))
    }

    #[test]
    fn every_vertex_is_in_the_family_that_lies_around_it() {
        for k in 3..=6 {
            let grid = Grid::new([(1 << k) + 1; 2], [1.0; 2]).unwrap();
            let points = || (0..=1 << k).flat_map(|y| (0..=1 << k).map(move |x| GridPoint::new(x, y)));
            let mut seen = 0;
            for of in points().filter(|p| !grid.is_corner(*p) && grid.level(*p) >= 4) {
                let level = grid.level(of) - 4;
                let first = family(k, level, slot_of(k, of));
                let reach = 3 << (level / 2);
                for p in (first..first + FAMILY).filter_map(|slot| point_of(k, slot)) {
                    assert_eq!(grid.level(p), level);
                    assert!(
                        p.x().abs_diff(of.x()) <= reach && p.y().abs_diff(of.y()) <= reach,
                        "{of:?} {p:?}"
                    );
                    seen += 1;
                }
            }
            let has_family = |p: &GridPoint| !grid.is_corner(*p) && grid.level(*p) + 4 < grid.levels();
            assert_eq!(seen, points().filter(has_family).count());
        }
    }
}
