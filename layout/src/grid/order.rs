//! Where a vertex lies in the file: Lindstrom & Pascucci's interleaved quadtrees, as a walk and as a
//! closed form.
//!
//! White vertices (cell centres) and black vertices (edge midpoints) each form a quadtree; their levels
//! alternate in the file, and within a level slots follow the quadtree, so that vertices refined
//! together lie together. The black quadtree is a square turned by 45 degrees; the slots of its corners outside
//! the grid are ghosts: they exist as numbers and hold no vertex.
//!
//! Slots 0..=3 are the corners SW, SE, NE, NW; 4 is the centre; 5..=8 are the midpoints of the W, S, E, N
//! sides. See FORMAT.md, "Order of records". Cost: a few shifts a vertex.

mod along;
mod blocks;
#[cfg(test)]
mod large;

pub(crate) use along::{BlackAlong, FAMILY, WhiteAlong, family};
pub(crate) use blocks::{block_start, level_around, step_in_block};

use crate::grid::GridPoint;

/// Slot of the square's centre.
pub const CENTRE_SLOT: u64 = 4;

/// The four root triangles as (slot of the side's midpoint, base corners in counter-clockwise order around the
/// square): S, E, N, W. The apex of each is the centre.
pub const ROOTS: [(u64, [usize; 2]); 4] = [(6, [0, 1]), (7, [1, 2]), (8, [2, 3]), (5, [3, 0])];

/// Number of slots, ghosts included, of a grid of 2^k steps a side: `4 + 5 (4^k - 1) / 3`.
pub const fn slot_count(k: u32) -> u64 {
    4 + 5 * ((1u64 << (2 * k)) - 1) / 3
}

/// The corners of a square of 2^k steps: SW, SE, NE, NW, which is also their slot order.
pub const fn corners(k: u32) -> [GridPoint; 4] {
    let n = 1 << k;
    [GridPoint::new(0, 0), GridPoint::new(n, 0), GridPoint::new(n, n), GridPoint::new(0, n)]
}

/// Slots of the split vertices of a triangle's two children, given the slots of its apex and of its split
/// vertex; the child triangles' apex is `split`. For a triangle (apex a; base b, d) reached from [`ROOTS`] by
/// always descending to (v; b, a) and (v; a, d), the first belongs to the child (v; b, a).
#[inline(always)]
pub const fn child_slots(apex: u64, split: u64) -> [u64; 2] {
    let first = 4 * apex - 7;
    [first + ((2 * apex + split + 2) & 3), first + ((2 * apex + split + 3) & 3)]
}

/// Spreads the low 32 bits of `v` onto the even bits.
#[inline(always)]
pub const fn spread(v: u64) -> u64 {
    let mut v = v & 0xffff_ffff;
    v = (v | v << 16) & 0x0000_ffff_0000_ffff;
    v = (v | v << 8) & 0x00ff_00ff_00ff_00ff;
    v = (v | v << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    v = (v | v << 2) & 0x3333_3333_3333_3333;
    (v | v << 1) & 0x5555_5555_5555_5555
}

/// Gathers the even bits of `v`: the inverse of [`spread`].
#[inline(always)]
const fn gather(v: u64) -> u64 {
    let mut v = v & 0x5555_5555_5555_5555;
    v = (v | v >> 1) & 0x3333_3333_3333_3333;
    v = (v | v >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    v = (v | v >> 4) & 0x00ff_00ff_00ff_00ff;
    v = (v | v >> 8) & 0x0000_ffff_0000_ffff;
    (v | v >> 16) & 0xffff_ffff
}

/// First slot of a level of white vertices at quadtree depth `d`.
#[inline(always)]
const fn white_base(d: u32) -> u64 {
    (5 * (1u64 << (2 * d)) + 7) / 3
}

/// First slot of a level of black vertices at quadtree depth `d`.
#[inline(always)]
const fn black_base(d: u32) -> u64 {
    (8 * (1u64 << (2 * d)) + 7) / 3
}

/// The slots of the vertices of `level` (see [`Grid::level`](crate::grid::Grid::level)), ghosts included.
pub(crate) const fn level_slots(k: u32, level: u32) -> std::ops::Range<u64> {
    let d = k - 1 - level / 2;
    if level & 1 == 1 {
        white_base(d)..white_base(d) + (1 << (2 * d))
    } else {
        black_base(d)..black_base(d) + (1 << (2 * d + 2))
    }
}

/// Slot of a grid point in a square of 2^k steps a side.
#[inline]
pub fn slot_of(k: u32, p: GridPoint) -> u64 {
    let (x, y) = (u64::from(p.x()), u64::from(p.y()));
    let n = 1u64 << k;
    if x & (n - 1) == 0 && y & (n - 1) == 0 {
        return match (x == 0, y == 0) {
            (true, true) => 0,
            (false, true) => 1,
            (false, false) => 2,
            (true, false) => 3,
        };
    }
    let (tx, ty) = (x.trailing_zeros(), y.trailing_zeros());
    let t = tx.min(ty);
    let d = k - 1 - t;
    if tx == ty {
        let (cx, cy) = (x >> (t + 1), y >> (t + 1));
        white_base(d) + 2 * spread24(cy) + spread24(cx ^ cy)
    } else {
        let (u, w) = (x >> t, y >> t);
        let (a, b) = black_block(d, u, w);
        black_base(d) + 2 * spread24(a ^ ((1 << d) - 1)) + spread24(a ^ b ^ (1 << d))
    }
}

/// [`spread`] of the low 24 bits, by table: enough for the coordinates of every block of a square of up to 2^24 steps.
#[inline(always)]
const fn spread24(v: u64) -> u64 {
    SPREAD[v as usize & 255] as u64
        | (SPREAD[(v >> 8) as usize & 255] as u64) << 16
        | (SPREAD[(v >> 16) as usize & 255] as u64) << 32
}

/// Spread bytes.
const SPREAD: [u16; 256] = {
    let mut table = [0; 256];
    let mut i = 0;
    while i < table.len() {
        table[i] = spread(i as u64) as u16;
        i += 1;
    }
    table
};

/// Coordinates of a black vertex in the turned quadtree.
#[inline(always)]
const fn black_block(d: u32, u: u64, w: u64) -> (u64, u64) {
    ((u + w - 1) / 2, (w + (2 << d) - u - 1) / 2)
}

/// Grid point of a slot in a square of 2^k steps a side; `None` for a ghost or a slot past the end.
#[inline]
pub fn point_of(k: u32, slot: u64) -> Option<GridPoint> {
    if slot < 4 {
        return Some(corners(k)[slot as usize]);
    }
    if slot >= slot_count(k) {
        return None;
    }
    let d = depth_of(slot);
    let t = k - 1 - d;
    if slot < black_base(d) {
        let m = slot - white_base(d);
        return Some(white_point(t, gather(m >> 1), gather(m)));
    }
    let m = slot - black_base(d);
    black_point(d, t, gather(m >> 1), gather(m))
}

/// Least cell coordinates (X, Y) of the block of 4^order white slots that starts `offset` into its level.
pub(crate) const fn white_block_at(offset: u64, order: u32) -> [u64; 2] {
    let y = gather(offset >> 1);
    let x = gather(offset) ^ y;
    [x >> order << order, y >> order << order]
}

/// Least turned coordinates (A, B) of the block of 4^order black slots that starts `offset` into its level at depth `d`.
pub(crate) const fn black_block_at(d: u32, offset: u64, order: u32) -> [u64; 2] {
    let a = gather(offset >> 1) ^ ((1 << d) - 1);
    let b = a ^ gather(offset) ^ (1 << d);
    [a >> order << order, b >> order << order]
}

/// Slots of a block whose cells [`BlockCells`] enumerates.
pub(crate) const BLOCK_SLOTS: u64 = 1 << (2 * BLOCK_ORDER);
/// Binary logarithm of a block's side.
const BLOCK_ORDER: u32 = 5;

/// Where the slots of an aligned block lie, each as (rows north, columns east) of the block's first row and column: of white blocks, and of black ones, which stand on a corner.
const WITHIN: [[(u8, i8); BLOCK_SLOTS as usize]; 2] = {
    let mut table = [[(0, 0); BLOCK_SLOTS as usize]; 2];
    let mut i = 0;
    while i < BLOCK_SLOTS as usize {
        let (even, odd) = (gather(i as u64) as u8, gather(i as u64 >> 1) as u8);
        table[0][i] = (odd, (even ^ odd) as i8);
        let a = odd ^ ((1 << BLOCK_ORDER) - 1);
        let b = a ^ even;
        table[1][i] = (a + b, (a as i8 - b as i8) >> 1);
        i += 1;
    }
    table
};

/// Depth of a slot, 4 or more.
#[inline(always)]
fn depth_of(slot: u64) -> u32 {
    // Depth d owns white slots from white_base(d) and black slots from black_base(d); white_base(d + 1) follows.
    let d = (3 * slot - 7).div_ceil(5).max(1).ilog2() / 2;
    if white_base(d) > slot { d - 1 } else { d }
}

/// Rows and columns, within their level, of the slots of one aligned block: [`point_of`] with the work for the block done once.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlockCells {
    row: usize,
    column: usize,
    within: &'static [(u8, i8); BLOCK_SLOTS as usize],
    /// `k`, level and first slot of a level that is smaller than a block and of black vertices, whose turned bits lie within the block.
    small: Option<(u32, u32, u64)>,
}

impl BlockCells {
    /// The block of `level` that starts `offset` slots into it, a multiple of [`BLOCK_SLOTS`].
    pub(crate) fn new(k: u32, level: u32, offset: u64) -> Self {
        debug_assert!(offset.is_multiple_of(BLOCK_SLOTS));
        if level & 1 == 1 {
            let [x, y] = white_block_at(offset, BLOCK_ORDER);
            return Self { row: y as usize, column: x as usize, within: &WITHIN[0], small: None };
        }
        let d = k - 1 - level / 2;
        if d < BLOCK_ORDER {
            let first = level_slots(k, level).start;
            return Self { row: 0, column: 0, within: &WITHIN[1], small: Some((k, level, first)) };
        }
        let [a, b] = black_block_at(d, offset, BLOCK_ORDER).map(|v| v as i64);
        // See `black_point`.
        let (u, w) = (a - b + (1 << d), a + b + 1 - (1 << d));
        Self { row: w as usize, column: (u >> 1) as usize, within: &WITHIN[1], small: None }
    }

    /// Row and column of the block's `i`-th slot. Those of a ghost are in no level: too large, or below 0 and so larger still.
    #[inline(always)]
    pub(crate) fn cell(&self, i: usize) -> (usize, usize) {
        if let Some((k, level, first)) = self.small {
            let t = level / 2;
            return match point_of(k, first + i as u64) {
                Some(p) => ((p.y() >> t) as usize, (p.x() >> (t + 1)) as usize),
                None => (usize::MAX, usize::MAX),
            };
        }
        let (north, east) = self.within[i % BLOCK_SLOTS as usize];
        (self.row.wrapping_add(usize::from(north)), self.column.wrapping_add_signed(isize::from(east)))
    }
}

/// The white vertex with these gathered bits of its offset in its level.
#[inline(always)]
const fn white_point(t: u32, odd: u64, even: u64) -> GridPoint {
    let (cx, cy) = (even ^ odd, odd);
    GridPoint::new(((2 * cx + 1) << t) as u32, ((2 * cy + 1) << t) as u32)
}

/// The black vertex with these gathered bits of its offset in its level at depth `d`; `None` for a ghost.
#[inline(always)]
fn black_point(d: u32, t: u32, odd: u64, even: u64) -> Option<GridPoint> {
    let a = odd ^ ((1 << d) - 1);
    let b = a ^ even ^ (1 << d);
    // u + w = 2A + 1 and w - u = 2B + 1 - 2^(d+1).
    let sum = 2 * a as i64 + 1;
    let difference = 2 * b as i64 + 1 - (2i64 << d);
    let (u, w) = ((sum - difference) / 2, (sum + difference) / 2);
    let side = 2i64 << d;
    ((0..=side).contains(&u) && (0..=side).contains(&w))
        .then(|| GridPoint::new((u as u32) << t, (w as u32) << t))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;

    fn grid(k: u32) -> Grid {
        Grid::new([(1 << k) + 1; 2], [1.0, 1.0]).unwrap()
    }

    #[test]
    fn closed_form_is_a_bijection_onto_the_non_ghost_slots() {
        for k in 1..=7 {
            let n = 1u32 << k;
            let mut seen = vec![false; slot_count(k) as usize];
            for y in 0..=n {
                for x in 0..=n {
                    let p = GridPoint::new(x, y);
                    let slot = slot_of(k, p);
                    assert!(!std::mem::replace(&mut seen[slot as usize], true), "{p:?} twice");
                    assert_eq!(point_of(k, slot), Some(p));
                }
            }
            for (slot, seen) in seen.iter().enumerate() {
                assert_eq!(point_of(k, slot as u64).is_some(), *seen, "slot {slot}, k {k}");
            }
            assert_eq!(point_of(k, slot_count(k)), None);
        }
    }

    /// Rows against the closed form, and its inverse where coordinates have their most bits.
    #[test]
    fn rows_give_the_slots_of_their_vertices() {
        for k in [1, 2, 5, 9, 16] {
            let n = 1u32 << k;
            let step = (n / 64).max(1) - u32::from(k == 16);
            for y in (0..=n).step_by(step as usize) {
                for x in (0..=n).step_by(step as usize) {
                    let p = GridPoint::new(x, y);
                    assert_eq!(point_of(k, slot_of(k, p)), Some(p));
                    if !grid(k).is_corner(p) {
                        let slot = along::first_along(k, grid(k).level(p), p);
                        assert_eq!(slot, Some(slot_of(k, p)), "{p:?} of {k}");
                    }
                }
            }
        }
    }

    #[test]
    fn blocks_enumerate_what_the_closed_form_says() {
        for k in 1..=8 {
            for level in 0..2 * k {
                let slots = level_slots(k, level);
                let (t, is_white) = (level / 2, level & 1);
                for offset in (0..slots.end - slots.start).step_by(BLOCK_SLOTS as usize) {
                    let block = BlockCells::new(k, level, offset);
                    let count = (slots.end - slots.start - offset).min(BLOCK_SLOTS);
                    for i in 0..count {
                        let (row, column) = block.cell(i as usize);
                        match point_of(k, slots.start + offset + i) {
                            Some(p) => assert_eq!(
                                (row, column),
                                ((p.y() >> (t + is_white)) as usize, (p.x() >> (t + 1)) as usize)
                            ),
                            // Beyond the rows and columns of the level.
                            None => {
                                let steps = 1usize << (k - t);
                                assert!(row > steps || column >= steps / 2 + row % 2, "{row} {column}");
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn slots_of_a_level_are_contiguous() {
        for k in 1..=6 {
            let g = grid(k);
            for slot in 4..slot_count(k) {
                if let Some(p) = point_of(k, slot) {
                    assert!(level_slots(k, g.level(p)).contains(&slot));
                }
            }
        }
    }

    /// The recursive walk and the closed form name the same vertices, and the walk's triangles have the edge
    /// ends and apexes that the grid derives from coordinates alone.
    #[test]
    fn walk_agrees_with_closed_form() {
        fn walk(g: &Grid, level: u32, apex: (u64, GridPoint), split: u64, b: GridPoint, d: GridPoint) -> u64 {
            let v = b.midpoint(d);
            assert_eq!(slot_of(g.k(), v), split);
            assert_eq!(g.level(v), level);
            let ends = g.edge_ends(v);
            assert!(ends == [b, d] || ends == [d, b], "{v:?}: {ends:?} against {b:?} {d:?}");
            assert!(g.apexes(v).any(|a| a == apex.1));
            if level == 0 {
                return 1;
            }
            let [left, right] = child_slots(apex.0, split);
            let at_b = b.midpoint(apex.1);
            let at_d = d.midpoint(apex.1);
            assert!(g.children(v).any(|c| c == at_b) && g.children(v).any(|c| c == at_d));
            1 + walk(g, level - 1, (split, v), left, b, apex.1)
                + walk(g, level - 1, (split, v), right, apex.1, d)
        }
        for k in 1..=5 {
            let g = grid(k);
            let c = corners(k);
            let centre = (CENTRE_SLOT, GridPoint::new(1 << (k - 1), 1 << (k - 1)));
            let visited: u64 =
                ROOTS.iter().map(|&(split, [b, d])| walk(&g, 2 * k - 2, centre, split, c[b], c[d])).sum();
            assert_eq!(visited, 4 * ((1 << (2 * k - 1)) - 1));
        }
    }
}
