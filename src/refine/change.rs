//! What engines are told when the ground was edited, and which of their vertices this can concern.

use std::ops::Range;
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

/// The changed areas, narrowed down from vertex to vertex on the way from the roots.
///
/// A vertex's record is made of the samples in its diamond and of its children's records, so it can change only where an area touches the square of
/// [`Grid::reach_steps`] around it. A child of a vertex of level l lies d_l steps away at most along either axis, and reach(l) >= d_l + reach(l - 1) by its definition: the
/// child's square lies in the vertex's. So a walk that turns back where no area touches the square, and leads to a vertex through any one of its parents, meets every vertex whose
/// record can have changed. It also meets every unsplit triangle that has a moved corner: the corners of a vertex's diamond lie 2^(l / 2) steps away, and reach(l) is no less. Padding
/// has the heights of the border, so areas there reach on to the end of the square.
#[derive(Debug, Default)]
pub(super) struct Areas {
    /// How far from a vertex of each level an area can concern it.
    reach: Vec<u32>,
    /// All areas, and on top of each other those that concern the vertices under way.
    stack: Vec<Span>,
}

impl Areas {
    /// Takes the areas of `change`; returns the range of the stack that holds all of them.
    pub(super) fn start(&mut self, grid: &Grid, change: &GroundChange<'_>) -> Range<usize> {
        let ([wide, high], n) = (grid.samples(), grid.side_steps());
        self.reach.clear();
        self.reach.extend((0..grid.levels()).map(|level| grid.reach_steps(level)));
        self.stack.clear();
        self.stack.extend(change.areas.iter().map(|rect| {
            let east = if rect.east + 1 >= wide { n } else { rect.east };
            let north = if rect.north + 1 >= high { n } else { rect.north };
            [rect.west, rect.south, east, north]
        }));
        0..self.stack.len()
    }

    /// Those areas of a range of the stack that can concern a vertex of `level` or its descendants, as a range of the stack. What lies above both is forgotten by the next call
    /// for the same range.
    #[inline(always)]
    pub(super) fn narrow(&mut self, range: &Range<usize>, point: GridPoint, level: u32) -> Range<usize> {
        let reach = self.reach[level as usize];
        let [west, east] = [point.x().saturating_sub(reach), point.x() + reach];
        let [south, north] = [point.y().saturating_sub(reach), point.y() + reach];
        let touches = |[w, s, e, n]: Span| w <= east && e >= west && s <= north && n >= south;
        if range.len() == 1 {
            let end = range.start + usize::from(touches(self.stack[range.start]));
            return range.start..end;
        }
        self.stack.truncate(range.end);
        for i in range.clone() {
            let span = self.stack[i];
            if touches(span) {
                self.stack.push(span);
            }
        }
        range.end..self.stack.len()
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.reach.capacity() * size_of::<u32>() + self.stack.capacity() * size_of::<Span>()
    }
}
