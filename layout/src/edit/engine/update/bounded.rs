//! The bounded error of a vertex above the finest levels, after its children have theirs.
//!
//! All samples of its two triangles have a say in it, and only few of them have changed. **Where a triangle's corners are as they were, samples that did not change are no farther from it
//! than the former error says.** So if one that did change, or a child, now says at least as much, nothing else has to be looked at; and if neither a changed sample nor a changed child made
//! the former error what it was, it stays. Only otherwise, and where a corner moved, [`Search`] looks at the rest of a triangle. Cost: two comparisons most of the time, then the rows of the
//! changed rectangle, then some tens of records.

use super::Update;
use crate::bound::{Plane, larger};
use crate::edit::engine::farthest::Search;
use crate::grid::order::slot_of;
use crate::grid::record::{RecordCodec, Vertex};
use crate::grid::{Grid, GridPoint};

/// Changed children that a vertex's former error is looked up among; with more of them it is found by search.
const FEW: usize = 64;

/// A triangle that a vertex splits, none of whose corners is void.
struct Triangle {
    /// Apex and ends of the base.
    corners: [GridPoint; 3],
    plane: Plane,
    /// Whether a corner has another height than before.
    is_moved: bool,
}

/// A vertex whose error is asked for.
pub(super) struct Asked<'v, R> {
    pub(super) v: GridPoint,
    pub(super) level: u32,
    pub(super) slot: u64,
    pub(super) old: R,
    /// What the record said before.
    pub(super) was: &'v Vertex,
    /// Error in metres that its children say now.
    pub(super) children_m: f64,
}

impl<C: RecordCodec> Update<'_, C> {
    /// The error in metres, children included, of a vertex whose triangles lie in the data: a number that its record says as it is.
    #[inline(always)]
    pub(super) fn bounded_error_m(&mut self, asked: &Asked<'_, C::Raw>) -> f64 {
        let before_m = asked.was.error_m;
        let mut limit_m = self.recorded_m(asked, asked.children_m);
        let Some([low, high]) = self.changed_within(asked) else {
            if limit_m >= before_m {
                return limit_m;
            }
            if self.is_made_elsewhere(asked, 0.0) {
                return before_m;
            }
            self.triangles(asked.v).iter().flatten().for_each(|t| self.search(asked, t, &mut limit_m));
            return limit_m;
        };
        let triangles = self.triangles(asked.v);
        let mut then_m = 0.0f64;
        for triangle in triangles.iter().flatten() {
            if triangle.is_moved {
                self.search(asked, triangle, &mut limit_m);
                continue;
            }
            // Two heights of a plane differ most at corners.
            let [plane_low, plane_high] = triangle.plane.range(low, high);
            let [then, now] = self.ground.new.ranges.map(|[low, high]| {
                f64::from(
                    self.rules
                        .scanned_error_m((high - plane_low).max(plane_high - low).max(0.0) * (1.0 + 1e-9)),
                )
            });
            then_m = then_m.max(then);
            if now > limit_m {
                self.look_at_changed(asked, triangle, [low, high], &mut limit_m);
            }
        }
        if limit_m >= before_m {
            return limit_m;
        }
        let kept = || triangles.iter().flatten().filter(|triangle| !triangle.is_moved);
        if kept().count() == triangles.iter().flatten().count() {
            // The ranges alone say most of the time that the samples that changed are not what made it.
            if self.stored_m(asked, then_m) >= before_m {
                let then =
                    kept().map(|triangle| self.farthest_before(triangle, [low, high])).fold(0.0, larger);
                then_m = f64::from(self.rules.scanned_error_m(then));
            }
            if self.is_made_elsewhere(asked, then_m) {
                return before_m;
            }
        }
        kept().for_each(|triangle| self.search(asked, triangle, &mut limit_m));
        limit_m
    }

    /// An own error as the record of a vertex says it.
    fn stored_m(&self, asked: &Asked<'_, C::Raw>, own_m: f64) -> f64 {
        self.rules.stored_error_m(asked.level, asked.was.class, own_m)
    }

    /// A child's error as the record of a vertex says it.
    fn recorded_m(&self, asked: &Asked<'_, C::Raw>, child_m: f64) -> f64 {
        self.rules.recorded_error_m(asked.level, asked.was.class, child_m)
    }

    /// First and last corner of where the changed rectangle and the bounds of a vertex's diamond meet.
    fn changed_within(&self, asked: &Asked<'_, C::Raw>) -> Option<[[u32; 2]; 2]> {
        let (rect, v, s) = (self.ground.new.rect, asked.v, 1 << (asked.level / 2));
        let low = [rect.west.max(v.x().saturating_sub(s)), rect.south.max(v.y().saturating_sub(s))];
        let high = [rect.east.min(v.x() + s), rect.north.min(v.y() + s)];
        (low[0] <= high[0] && low[1] <= high[1]).then_some([low, high])
    }

    /// Whether what made the former error of a vertex what it was has not changed, where its corners have not: neither the samples that changed, which were `then_m` metres off at most, nor
    /// a child that did was enough for it.
    fn is_made_elsewhere(&self, asked: &Asked<'_, C::Raw>, then_m: f64) -> bool {
        let before_m = asked.was.error_m;
        if before_m <= self.stored_m(asked, 0.0) {
            return true;
        }
        // Something made it what it was.
        if self.stored_m(asked, then_m) >= before_m || self.scratch.below.len() > FEW {
            return false;
        }
        let rules = self.rules;
        rules.grid.children(asked.v).into_iter().all(|child| {
            let changed = self.scratch.below.iter().find(|(p, _)| *p == child);
            let was_m = changed.map_or(0.0, |(_, old)| rules.codec.decode(*old, asked.level - 1).error_m);
            // Fringe vertices round errors in steps of their own.
            self.recorded_m(asked, was_m) < before_m
        })
    }

    /// The triangles that a vertex splits, but for those with a void corner.
    #[inline(always)]
    fn triangles(&mut self, v: GridPoint) -> [Option<Triangle>; 2] {
        let [b, d] = self.rules.grid.edge_ends(v);
        let ends = [b, d].map(|p| self.ground.code_unless_void(p));
        let is_base_moved = self.ground.new.is_moved(b) || self.ground.new.is_moved(d);
        let mut found = [None, None];
        for (a, place) in self.rules.grid.apexes(v).zip(&mut found) {
            let code = self.ground.code_unless_void(a);
            if !(code.is_nan() || ends[0].is_nan() || ends[1].is_nan()) {
                let plane = Plane::of([(a, code), (b, ends[0]), (d, ends[1])]);
                let is_moved = is_base_moved || self.ground.new.is_moved(a);
                *place = Some(Triangle { corners: [a, b, d], plane, is_moved });
            }
        }
        found
    }

    /// Raises an error, as records say it, to what the samples of a triangle make of it.
    #[inline(never)]
    fn search(&mut self, asked: &Asked<'_, C::Raw>, triangle: &Triangle, limit_m: &mut f64) {
        let (rules, level) = (self.rules, asked.level);
        let mut search = Search::new(rules, triangle.plane, level, asked.was.class, *limit_m);
        let corners = in_walk_order(&rules.grid, triangle.corners, level);
        let apex = slot_of(rules.grid.k(), triangle.corners[0]);
        search.run(&mut self.ground, corners, [apex, asked.slot], asked.old, &mut self.scratch.waiting);
        *limit_m = search.limit_m;
    }

    /// Codes by which the samples of a triangle were off it before, from `low` to `high` within what changed.
    #[inline(always)]
    fn farthest_before(&self, triangle: &Triangle, [low, high]: [[u32; 2]; 2]) -> f64 {
        let (rect, codes) = (self.ground.new.rect, self.ground.new.old_codes);
        let mut farthest = 0.0;
        for y in low[1]..=high[1] {
            let Some([first, last]) = columns(triangle.corners, y) else { continue };
            let (first, last) = (first.max(low[0]), last.min(high[0]));
            if first <= last {
                let at = (y - rect.south) as usize * rect.wide() as usize + (first - rect.west) as usize;
                let row = &codes[at..=at + (last - first) as usize];
                farthest = larger(farthest, triangle.plane.farthest_in_row(first, y, row));
            }
        }
        farthest
    }

    /// Raises an error, as records say it, to what samples of a triangle make of it that lie where something changed, from `low` to `high`.
    #[inline(always)]
    fn look_at_changed(
        &self,
        asked: &Asked<'_, C::Raw>,
        triangle: &Triangle,
        [low, high]: [[u32; 2]; 2],
        limit_m: &mut f64,
    ) {
        let near = &self.scratch.near;
        let mut farthest = 0.0;
        for y in low[1]..=high[1] {
            let Some([first, last]) = columns(triangle.corners, y) else { continue };
            let (first, last) = (first.max(low[0]), last.min(high[0]));
            if first <= last {
                let [from, row] = near.within(GridPoint::new(first, y));
                farthest = larger(farthest, near.row(&triangle.plane, from, from + (last - first), row));
            }
        }
        let own_m = f64::from(self.rules.scanned_error_m(farthest));
        if own_m > *limit_m {
            *limit_m = limit_m.max(self.stored_m(asked, own_m));
        }
    }
}

/// First and last column of a triangle's samples in row `y`, if it has any. Those of its base count; those of its legs are its children's.
#[inline(always)]
fn columns([a, b, d]: [GridPoint; 3], y: u32) -> Option<[u32; 2]> {
    let (west, east) = (b.x().min(d.x()), b.x().max(d.x()));
    if b.y() == d.y() {
        let off = y.abs_diff(b.y());
        let is_inside = off < a.y().abs_diff(b.y()) && (off == 0 || (y > b.y()) == (a.y() > b.y()));
        return is_inside.then(|| [west + off + 1, east - off - 1]);
    }
    let (south, north) = (b.y().min(d.y()), b.y().max(d.y()));
    if y <= south || y >= north {
        return None;
    }
    if west == east {
        let deep = (y - south).min(north - y) - 1;
        return Some(if a.x() > west { [west, west + deep] } else { [west - deep, west] });
    }
    // The legs run along row and column.
    let left = north - south - y.abs_diff(a.y());
    Some(if a.x() == west { [west + 1, west + left] } else { [east - left, east - 1] })
}

/// The ends of the base in the order in which the walk from the roots meets them: counter-clockwise for the roots, and turned about from level to level.
fn in_walk_order(grid: &Grid, [a, b, d]: [GridPoint; 3], level: u32) -> [GridPoint; 3] {
    let along = |p: GridPoint| (i64::from(p.x()) - i64::from(a.x()), i64::from(p.y()) - i64::from(a.y()));
    let ((bx, by), (dx, dy)) = (along(b), along(d));
    let is_ccw = bx * dy - by * dx > 0;
    // The roots' split vertices have the level below the centre's.
    let wants_ccw = (grid.levels() - level).is_multiple_of(2);
    if is_ccw == wants_ccw { [a, b, d] } else { [a, d, b] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the signs of areas.
    fn is_inside([a, b, d]: [GridPoint; 3], [x, y]: [u32; 2]) -> bool {
        let at = |p: GridPoint| (i64::from(p.x()), i64::from(p.y()));
        let side = |p: GridPoint, q: GridPoint, r: (i64, i64)| {
            let ((px, py), (qx, qy)) = (at(p), at(q));
            ((qx - px) * (r.1 - py) - (qy - py) * (r.0 - px)).signum()
        };
        let turn = side(a, b, at(d));
        let r = (i64::from(x), i64::from(y));
        side(a, b, r) == turn && side(d, a, r) == turn && side(b, d, r) * turn >= 0
    }

    #[test]
    fn rows_hold_what_lies_inside_and_on_the_base() {
        let grid = Grid::new([33, 33], [1.0; 2]).unwrap();
        let points = || (0..=32).flat_map(|y| (0..=32).map(move |x| GridPoint::new(x, y)));
        let mut triangles = 0;
        for v in points().filter(|v| !grid.is_corner(*v) && grid.level(*v) >= 2) {
            let [b, d] = grid.edge_ends(v);
            for a in grid.apexes(v) {
                for p in points() {
                    let row = columns([a, b, d], p.y());
                    let is_there = row.is_some_and(|[first, last]| (first..=last).contains(&p.x()));
                    assert_eq!(is_there, is_inside([a, b, d], [p.x(), p.y()]), "{a:?} {b:?} {d:?}: {p:?}");
                }
                triangles += 1;
            }
        }
        assert!(triangles > 200);
    }
}
