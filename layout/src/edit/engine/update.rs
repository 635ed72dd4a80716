//! From new heights to new records, from the bottom up: every vertex whose triangles touch what changed, and every vertex that depends on a record that changed. Each
//! is recomputed as the maximum over all contributions, upwards until nothing changes. So values fall as well as rise.
//!
//! The work goes level by level. At a level, the vertices whose diamonds touch the changed rectangle are enumerated, and the parents of changed children outside it
//! are added. A bounded error has contributions from all samples in the diamond; `bounded` knows when more of
//! them have to be looked at than those that changed. Cost: the samples of the rectangle, some ten vertices a level above them, a few tens of records for each search.

mod bounded;
mod finest;

use super::farthest::Waiting;
use super::midway::{Ground, NewCodes};
use super::near::{NEAR_LEVELS, Near, first_of_row};
use super::pages::Pages;
use crate::bound::{Below, FIRST_SCANNED, Rules};
use crate::edit::operations::window::SampleRect;
use crate::error::LayoutError;
use crate::file::header::ErrorKind;
use crate::grid::order::{corners, slot_of};
use crate::grid::record::{RecordCodec, VertexClass};
use crate::grid::{Grid, GridPoint};
use bounded::Asked;

/// Lists that outlive an update, so that none is allocated anew.
#[derive(Debug)]
pub(crate) struct Scratch<C: RecordCodec> {
    pub(crate) near: Near<C>,
    /// Vertices of the level below that changed, and their former records.
    below: Vec<(GridPoint, C::Raw)>,
    /// The same of this level.
    here: Vec<(GridPoint, C::Raw)>,
    /// Parents of changed children that lie apart from what changed.
    apart: Vec<GridPoint>,
    /// Triangles of a search.
    waiting: Vec<Waiting>,
}

impl<C: RecordCodec> Default for Scratch<C> {
    fn default() -> Self {
        Self {
            near: Near::default(),
            below: Vec::new(),
            here: Vec::new(),
            apart: Vec::new(),
            waiting: Vec::new(),
        }
    }
}

/// One update.
pub(crate) struct Update<'u, C: RecordCodec> {
    rules: &'u Rules<C>,
    ground: Ground<'u, C>,
    /// Grid points whose height changed: the changed rectangle, and the padding that folds onto it.
    area: SampleRect,
    scratch: &'u mut Scratch<C>,
}

impl<'u, C: RecordCodec> Update<'u, C> {
    pub(crate) fn new(
        rules: &'u Rules<C>,
        pages: &'u mut Pages<C>,
        new: NewCodes<'u>,
        scratch: &'u mut Scratch<C>,
    ) -> Self {
        let grid = rules.grid;
        let area = with_padding(&grid, new.rect);
        Self { rules, ground: Ground { grid, pages, new }, area, scratch }
    }

    /// Brings all records up to date. What fails is kept by the pages.
    pub(crate) fn run(mut self) {
        let grid = self.rules.grid;
        // An update that failed may have left both as they were.
        self.scratch.below.clear();
        self.scratch.here.clear();
        let mut reach = 0;
        for level in 0..grid.levels() {
            reach = Grid::reach_above(level, reach);
            self.level(level, reach);
            if self.ground.pages.has_failed() {
                return;
            }
            std::mem::swap(&mut self.scratch.below, &mut self.scratch.here);
            self.scratch.here.clear();
        }
        for (slot, corner) in corners(grid.k()).into_iter().enumerate() {
            if self.area.contains(corner.x(), corner.y()) {
                self.corner(corner, slot as u64);
            }
        }
    }

    fn corner(&mut self, corner: GridPoint, slot: u64) {
        let old = self.ground.pages.raw(slot);
        let class = self.rules.codec.decode(old, 0).class;
        if !class.is_void() {
            let code = self.ground.code_of(corner, old);
            let new = self.rules.codec.encode(0, code, class, 0.0, 0.0);
            self.put(corner, slot, old, new);
        }
    }

    /// Makes the records of a level anew, whose vertices reach `reach` steps.
    fn level(&mut self, level: u32, reach: u32) {
        let grid = self.rules.grid;
        let s = 1u32 << (level / 2);
        let limit = grid.samples().map(|count| (count - 1 + reach - 1).min(grid.side_steps()));
        let (south, north) = (self.area.south.saturating_sub(s), (self.area.north + s).min(limit[1]));
        for y in (south.next_multiple_of(s)..=north).step_by(s as usize) {
            // Diamonds of white vertices are squares, those of black ones stand on a corner.
            let off = self.area.south.saturating_sub(y) + y.saturating_sub(self.area.north);
            let across = if level & 1 == 1 { s } else { s - off };
            let (west, east) =
                (self.area.west.saturating_sub(across), (self.area.east + across).min(limit[0]));
            if let Some(first) = first_of_row(level, west, y) {
                self.renew_along(level, y, first, east);
            }
        }
        self.renew_apart(level, limit);
    }

    /// Makes the records of a level's vertices in a row from column `first` to `last` anew.
    #[inline(never)]
    fn renew_along(&mut self, level: u32, y: u32, first: u32, last: u32) {
        match level {
            0 => self.renew_row::<0>(y, first, last),
            1 => self.renew_row::<1>(y, first, last),
            2 => self.renew_row::<2>(y, first, last),
            3 => self.renew_row::<3>(y, first, last),
            4 => self.renew_row::<4>(y, first, last),
            5 => self.renew_row::<5>(y, first, last),
            6 => self.renew_row::<6>(y, first, last),
            7 => self.renew_row::<7>(y, first, last),
            _ => {
                for x in (first..=last).step_by(2 << (level / 2)) {
                    self.renew(GridPoint::new(x, y), level);
                }
            }
        }
    }

    /// Whether the diamond of a vertex touches the area.
    fn touches(&self, p: GridPoint, level: u32) -> bool {
        let s = 1u32 << (level / 2);
        let off = |v: u32, low: u32, high: u32| low.saturating_sub(v) + v.saturating_sub(high);
        let dx = off(p.x(), self.area.west, self.area.east);
        let dy = off(p.y(), self.area.south, self.area.north);
        if level & 1 == 1 { dx <= s && dy <= s } else { dx + dy <= s }
    }

    /// Vertices of the level that do not touch the area and have a child that changed.
    fn renew_apart(&mut self, level: u32, limit: [u32; 2]) {
        let mut apart = std::mem::take(&mut self.scratch.apart);
        apart.clear();
        // Diamonds hold their children: those of a child inside the area touch it.
        let outside = self.scratch.below.iter().filter(|(p, _)| !self.area.contains(p.x(), p.y()));
        for (child, _) in outside {
            let parents = self.rules.grid.apexes(*child);
            apart.extend(parents.filter(|p| {
                p.x() <= limit[0]
                    && p.y() <= limit[1]
                    && !self.rules.grid.is_corner(*p)
                    && !self.touches(*p, level)
            }));
        }
        apart.sort_unstable();
        apart.dedup();
        for v in &apart {
            if level < NEAR_LEVELS && self.scratch.near.holds(*v, 1 << (level / 2)) {
                self.renew_along(level, v.y(), v.x(), v.x());
            } else {
                self.renew(*v, level);
            }
        }
        self.scratch.apart = apart;
    }

    /// Makes the record of one vertex anew.
    #[inline(never)]
    fn renew(&mut self, v: GridPoint, level: u32) {
        let (grid, rules) = (self.rules.grid, self.rules);
        let slot = slot_of(grid.k(), v);
        let old = self.ground.pages.raw(slot);
        let was = rules.codec.decode(old, level);
        if was.class == VertexClass::Inert {
            return;
        }
        let (step, [wide, high]) = (1u32 << (level / 2), grid.samples());
        let folded = v.x() + step >= wide || v.y() + step >= high;
        let is_void = was.class.is_void();
        let code = self.ground.code_of(v, old);
        let mut below = Below::default();
        if level == 0 {
            below.fringe = was.class == VertexClass::Fringe;
        } else {
            let height_m = code * rules.scale.height_step_m;
            for child in grid.children(v) {
                let raw = self.ground.pages.raw(slot_of(grid.k(), child));
                let child_vertex = rules.codec.decode(raw, level - 1);
                if child_vertex.class == VertexClass::Inert && grid.is_beyond(child, level - 1) {
                    continue;
                }
                below.add(&child_vertex, rules.ground2(v, child), height_m, rules.scale.height_base_m);
            }
        }
        let own_m = if rules.error_kind == ErrorKind::Bounded && level >= FIRST_SCANNED && !folded {
            self.bounded_error_m(&Asked { v, level, slot, old, was: &was, children_m: below.error_m })
        } else {
            rules.own_error_m(v, grid.edge_ends(v), folded, |p| self.ground.code(p))
        };
        let new = rules.record(level, code, is_void, own_m, folded, &below);
        if self.put(v, slot, old, new).is_some() {
            self.scratch.here.push((v, old));
        }
    }

    /// Stores a record; returns it if it is another one than before.
    fn put(&mut self, v: GridPoint, slot: u64, old: C::Raw, new: Option<C::Raw>) -> Option<C::Raw> {
        match new {
            Some(new) if new != old => {
                self.ground.pages.write(v, slot, old, new);
                self.scratch.near.note(v, new);
                Some(new)
            }
            Some(_) => None,
            None => {
                self.fail(v);
                None
            }
        }
    }

    /// Notes that no record can say what is at a vertex.
    #[cold]
    fn fail(&mut self, v: GridPoint) {
        self.ground.pages.fail(LayoutError::OutOfRange {
            path: self.ground.pages.terrain().path().to_owned(),
            heights_m: [f64::NAN; 2],
            problem: format!(
                "the ground at ({}, {}) would be steeper than this file's records can say; rewrite it with room for that",
                v.x(),
                v.y()
            ),
        });
    }
}

/// A rectangle of samples and the padding that folds onto it.
fn with_padding(grid: &Grid, rect: SampleRect) -> SampleRect {
    let ([wide, high], n) = (grid.samples(), grid.side_steps());
    SampleRect {
        east: if rect.east == wide - 1 { n } else { rect.east },
        north: if rect.north == high - 1 { n } else { rect.north },
        ..rect
    }
}
