//! What engines are told when the ground was edited, and which of their triangles that can concern.

use crate::mesh::Triangle;
use std::ops::Range;
use terrasoar_layout::bytes::Page;
use terrasoar_layout::edit::SampleRect;
use terrasoar_layout::grid::Grid;

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

/// The changed areas, narrowed down from triangle to triangle on the way from the roots.
#[derive(Debug, Default)]
pub(super) struct Areas {
    /// West, south, east and north of each, the padding that folds onto it included.
    all: Vec<[u32; 4]>,
    /// How far from an area a vertex of each level can change.
    reach: Vec<u32>,
    /// Areas that concern the triangles under way, those of the largest first.
    stack: Vec<u32>,
}

impl Areas {
    /// Takes the areas of `change`; returns the range of the stack that holds all of them.
    pub(super) fn start(&mut self, grid: &Grid, change: &GroundChange<'_>) -> Range<usize> {
        let ([wide, high], n) = (grid.samples(), grid.side_steps());
        self.all.clear();
        self.all.extend(change.areas.iter().map(|rect| {
            let east = if rect.east + 1 >= wide { n } else { rect.east };
            let north = if rect.north + 1 >= high { n } else { rect.north };
            [rect.west, rect.south, east, north]
        }));
        self.reach.clear();
        self.reach.extend((0..grid.levels()).map(|level| grid.reach_steps(level)));
        self.stack.clear();
        self.stack.extend(0..self.all.len() as u32);
        0..self.stack.len()
    }

    /// Puts those areas of a range of the stack on top of it that can concern a triangle split at `level`, or what lies in it; returns their range. What lies
    /// above the range is forgotten.
    #[inline(always)]
    pub(super) fn narrow(&mut self, range: &Range<usize>, triangle: Triangle, level: u32) -> Range<usize> {
        let reach = self.reach[level as usize];
        let [a, b, c] = triangle;
        let span = |i: fn(terrasoar_layout::grid::GridPoint) -> u32| {
            let [a, b, c] = [i(a), i(b), i(c)];
            [a.min(b).min(c).saturating_sub(reach), a.max(b).max(c) + reach]
        };
        let ([west, east], [south, north]) = (span(|p| p.x()), span(|p| p.y()));
        self.stack.truncate(range.end);
        for i in range.clone() {
            let area = self.stack[i];
            let [w, s, e, n] = self.all[area as usize];
            if w <= east && e >= west && s <= north && n >= south {
                self.stack.push(area);
            }
        }
        range.end..self.stack.len()
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<[u32; 4]>() + (self.reach.capacity() + self.stack.capacity()) * 4
    }
}
