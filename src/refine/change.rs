//! What engines are told when the ground was edited, and which of their vertices this can concern.

use terrasoar_layout::edit::SampleRect;
use terrasoar_layout::file::bytes::Page;
use terrasoar_layout::grid::{Grid, GridPoint};

/// A change of the ground between two frames.
#[derive(Clone, Copy)]
pub struct GroundChange<'c> {
    /// Rectangles that hold all samples whose height changed.
    pub areas: &'c [SampleRect],
    /// Lowest and highest height in metres that there is now.
    pub height_range_m: [f64; 2],
    /// Contents of a logical page that holds records which changed; others may be `None`.
    pub page: &'c dyn Fn(u64) -> Option<&'c Page>,
}

impl std::fmt::Debug for GroundChange<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GroundChange").field("areas", &self.areas).finish_non_exhaustive()
    }
}

/// West, south, east and north, both ends included.
type Span = [u32; 4];

/// Most areas that are looked through one by one.
const FEW: usize = 8;
/// Cells a side at most.
const SIDE: u32 = 512;

/// The changed areas, and which vertices they can concern.
///
/// A vertex's record is made of the samples in its diamond and of its children's records, so it can change only where an area touches the square of
/// [`Grid::reach_steps`] around it. A child of a vertex of level l lies d_l steps away at most along either axis, and reach(l) >= d_l + reach(l - 1) by its definition: the
/// child's square lies in the vertex's. So a walk that turns back where no area touches the square, and leads to a vertex through any one of its parents, meets every vertex whose
/// record can have changed. It also meets every unsplit triangle that has a moved corner: the corners of a vertex's diamond lie 2^(l / 2) steps away, and reach(l) is no less. Padding
/// has the heights of the border, so areas there reach on to the end of the square.
///
/// Many areas are gathered in cells, which may say of a few more vertices that areas touch their squares. Cost: a test is [`FEW`] comparisons or four loads, however many areas there are.
#[derive(Debug, Default)]
pub(super) struct Areas {
    /// How far from a vertex of each level an area can concern it.
    reach: Vec<u32>,
    spans: Vec<Span>,
    cells: Cells,
}

impl Areas {
    /// Takes the areas of `change`.
    pub(super) fn start(&mut self, grid: &Grid, change: &GroundChange<'_>) {
        let ([wide, high], n) = (grid.samples(), grid.side_steps());
        self.reach.clear();
        self.reach.extend((0..grid.levels()).map(|level| grid.reach_steps(level)));
        self.spans.clear();
        self.spans.extend(change.areas.iter().map(|rect| {
            let east = if rect.east + 1 >= wide { n } else { rect.east };
            let north = if rect.north + 1 >= high { n } else { rect.north };
            [rect.west, rect.south, east, north]
        }));
        if self.spans.len() > FEW {
            self.cells.fill(&self.spans);
        }
    }

    /// Whether an area can concern a vertex of `level` or its descendants.
    #[inline(always)]
    pub(super) fn concern(&self, point: GridPoint, level: u32) -> bool {
        let reach = self.reach[level as usize];
        let [west, east] = [point.x().saturating_sub(reach), point.x() + reach];
        let [south, north] = [point.y().saturating_sub(reach), point.y() + reach];
        if self.spans.len() > FEW {
            return self.cells.touch([west, south, east, north]);
        }
        self.spans.iter().any(|[w, s, e, n]| *w <= east && *e >= west && *s <= north && *n >= south)
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.reach.capacity() * size_of::<u32>()
            + self.spans.capacity() * size_of::<Span>()
            + self.cells.sums.capacity() * size_of::<u32>()
    }
}

/// Squares over all areas, and how many of them areas touch.
#[derive(Debug, Default)]
struct Cells {
    /// What the squares cover.
    span: Span,
    /// Binary logarithm of a square's side in steps.
    shift: u32,
    /// Squares that areas touch south-west of each corner, rows from the south.
    sums: Vec<u32>,
}

impl Cells {
    /// Corners a row.
    fn row_length(&self) -> usize {
        ((self.span[2] - self.span[0]) >> self.shift) as usize + 2
    }

    fn fill(&mut self, spans: &[Span]) {
        let around =
            |all: Span, [w, s, e, n]: &Span| [all[0].min(*w), all[1].min(*s), all[2].max(*e), all[3].max(*n)];
        let [west, south, east, north] = spans.iter().fold([u32::MAX, u32::MAX, 0, 0], around);
        self.span = [west, south, east, north];
        self.shift = 0;
        while (east - west).max(north - south) >> self.shift >= SIDE {
            self.shift += 1;
        }
        let row = self.row_length();
        let rows = ((north - south) >> self.shift) as usize + 2;
        self.sums.clear();
        self.sums.resize(row * rows, 0);
        for [w, s, e, n] in spans {
            let [w, e] = [w - west, e - west].map(|x| (x >> self.shift) as usize + 1);
            let [s, n] = [s - south, n - south].map(|y| (y >> self.shift) as usize + 1);
            for y in s..=n {
                self.sums[y * row + w..=y * row + e].fill(1);
            }
        }
        let mut lines = self.sums.chunks_exact_mut(row);
        let Some(mut below) = lines.next() else { return };
        for line in lines {
            let mut sum = 0;
            for (here, below) in line.iter_mut().zip(&*below) {
                sum += *here;
                *here = sum + below;
            }
            below = line;
        }
    }

    /// Whether a square that an area touches lies in or touches a span.
    #[inline(always)]
    fn touch(&self, [w, s, e, n]: Span) -> bool {
        let [west, south, east, north] = self.span;
        if e < west || w > east || n < south || s > north {
            return false;
        }
        let [w, e] = [w.max(west) - west, e.min(east) - west].map(|x| (x >> self.shift) as usize);
        let [s, n] = [s.max(south) - south, n.min(north) - south].map(|y| (y >> self.shift) as usize);
        let row = self.row_length();
        let sum = |x: usize, y: usize| self.sums[y * row + x];
        sum(e + 1, n + 1) + sum(w, s) != sum(w, n + 1) + sum(e + 1, s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rect() -> impl Strategy<Value = SampleRect> {
        (0..1200u32, 0..700u32, 0..40u32, 0..40u32).prop_map(|(west, south, wide, high)| SampleRect {
            west,
            south,
            east: (west + wide).min(1199),
            north: (south + high).min(699),
        })
    }

    proptest! {
        #[test]
        fn areas_concern_all_that_one_of_them_touches(areas in prop::collection::vec(rect(), 1..40), x in 0..=2048u32, y in 0..=2048u32, level in 0..22u32) {
            let grid = Grid::new([1200, 700], [1.0; 2]).unwrap();
            let change = GroundChange { areas: &areas, height_range_m: [0.0; 2], page: &|_| None };
            let mut all = Areas::default();
            all.start(&grid, &change);
            let reach = grid.reach_steps(level);
            let touches = |by: u32| areas.iter().any(|rect| {
                let east = if rect.east == 1199 { 2048 } else { rect.east };
                let north = if rect.north == 699 { 2048 } else { rect.north };
                rect.west <= x + by && east + by >= x && rect.south <= y + by && north + by >= y
            });
            let found = all.concern(GridPoint::new(x, y), level);
            prop_assert!(found || !touches(reach));
            // A square is 8 steps wide at most.
            let most = if areas.len() > FEW { 8 } else { 0 };
            prop_assert!(!found || touches(reach + most));
        }
    }
}
