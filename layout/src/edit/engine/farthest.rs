//! The sample farthest from a triangle, found through the records below it instead of by looking at every sample.
//!
//! The error of a vertex bounds how far the ground departs from the triangles it splits. Seen from the plane of a larger triangle the samples of a smaller one inside it
//! are therefore no farther than its own corners are, plus that bound (two heights of a plane differ most at a corner). A descent that takes the more
//! promising half first and leaves out what cannot change the record reads some tens of records where the build's brute force
//! reads every sample; the sample it finds is the same, and its distance comes from the same operations.

use super::midway::Ground;
use crate::bound::{Plane, Rules, larger};
use crate::grid::GridPoint;
use crate::grid::order::{CENTRE_SLOT, child_slots, slot_of};
use crate::grid::record::{RecordCodec, VertexClass};

/// A triangle of the descent: its corners, how far they are above the plane, its slots, and which edges belong to others.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// Apex and the ends of the base.
    corners: [GridPoint; 3],
    /// Codes by which the corners are off the plane; infinite for voids, of which nothing is known.
    off: [f64; 3],
    apex_slot: u64,
    split_slot: u64,
    /// Whether the base, the edge from the apex to its first end and that to its second lie on a leg of the whole triangle: their samples count with the vertex
    /// that splits that leg.
    outside: [bool; 3],
}

/// A triangle that waits until the more promising half beside it is done.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Waiting {
    piece: Piece,
    split: Split,
    /// Codes of distance that none of its samples exceeds.
    bound: f64,
}

/// The vertex that splits a triangle.
#[derive(Debug, Clone, Copy)]
struct Split {
    v: GridPoint,
    /// Height code; not a number for a void.
    code: f64,
    level: u32,
}

/// The search in one triangle.
pub(crate) struct Search<'s, C: RecordCodec> {
    rules: &'s Rules<C>,
    plane: Plane,
    level: u32,
    class: VertexClass,
    /// What rounding may add to distances of exact records, in codes.
    slack: f64,
    /// Metres of error to codes.
    per_step: f64,
    /// Farther than any before, in codes.
    farthest: f64,
    /// Codes of distance that cannot change the record.
    enough: f64,
    /// Error in metres that the record will say at least, as it will say it.
    pub(crate) limit_m: f64,
}

impl<'s, C: RecordCodec> Search<'s, C> {
    /// A search for the error of a vertex of this level and class, which will be at least `limit_m`, a number that records hold.
    pub(crate) fn new(
        rules: &'s Rules<C>,
        plane: Plane,
        level: u32,
        class: VertexClass,
        limit_m: f64,
    ) -> Self {
        // Planes through whole codes have dyadic slopes, and all distances from them are exact.
        let slack = if C::BYTES == 4 { 0.0 } else { plane.slack(f64::from(2u32 << (level / 2))) };
        let per_step = 1.0 / rules.scale.height_step_m;
        let mut search =
            Self { rules, plane, level, class, slack, per_step, farthest: 0.0, enough: 0.0, limit_m };
        search.know_enough();
        search
    }

    /// Single precision, to which own errors are rounded up, is exact to a part in 2^24.
    fn know_enough(&mut self) {
        self.enough = self.limit_m * self.per_step * (1.0 - 2e-7);
    }

    /// Searches the triangle (apex; b, d) with these slots of its apex and its split vertex, whose record is `raw`. `waiting` is a list that is empty, and is again afterwards.
    #[inline(always)]
    pub(crate) fn run(
        &mut self,
        ground: &mut Ground<'_, C>,
        corners: [GridPoint; 3],
        slots: [u64; 2],
        raw: C::Raw,
        waiting: &mut Vec<Waiting>,
    ) {
        let vertex = self.rules.codec.decode(raw, self.level);
        if vertex.class == VertexClass::Inert {
            return;
        }
        // The vertex's record is the only one that may not say the new height yet.
        let v = corners[1].midpoint(corners[2]);
        let code = if vertex.class.is_void() { f64::NAN } else { ground.code_of(v, raw) };
        let mut piece = Piece {
            corners,
            // A plane passes through its corners.
            off: [0.0; 3],
            apex_slot: slots[0],
            split_slot: slots[1],
            outside: [false, true, true],
        };
        let mut split = Split { v, code, level: self.level };
        loop {
            let Some(next) = self.visit(ground, &piece, split, waiting).or_else(|| self.next(waiting)) else {
                return;
            };
            (piece, split) = next;
        }
    }

    /// The last triangle that waits and can still change the record.
    #[inline(always)]
    fn next(&self, waiting: &mut Vec<Waiting>) -> Option<(Piece, Split)> {
        while let Some(Waiting { piece, split, bound }) = waiting.pop() {
            if bound > self.enough {
                return Some((piece, split));
            }
        }
        None
    }

    /// Codes by which a sample is off the plane; infinite for a void, whose code is not a number.
    #[inline(always)]
    fn off(&self, p: GridPoint, code: f64) -> f64 {
        if code.is_nan() { f64::INFINITY } else { self.plane.above(p, code).abs() }
    }

    #[inline(always)]
    fn consider(&mut self, off: f64) {
        if off > self.enough && off > self.farthest && off < f64::INFINITY {
            self.take(off);
        }
    }

    #[inline(never)]
    fn take(&mut self, off: f64) {
        self.farthest = off;
        let metres = f64::from(self.rules.scanned_error_m(off));
        if metres > self.limit_m {
            self.limit_m = self.limit_m.max(self.rules.stored_error_m(self.level, self.class, metres));
            self.know_enough();
        }
    }

    /// Looks at the vertex that splits `piece`, which is of level 1 or more. Gives the half to go on with, and lets the other one wait, as far as they can change the record.
    #[inline(always)]
    fn visit(
        &mut self,
        ground: &mut Ground<'_, C>,
        piece: &Piece,
        Split { v, code, level }: Split,
        waiting: &mut Vec<Waiting>,
    ) -> Option<(Piece, Split)> {
        let [a, b, d] = piece.corners;
        let off = self.off(v, code);
        let [base_out, b_out, d_out] = piece.outside;
        if !base_out {
            self.consider(off);
        }
        // The centre's triangles are no part of the walk that slots follow.
        let splits = [a.midpoint(b), a.midpoint(d)];
        let slots = if piece.split_slot == CENTRE_SLOT {
            [slot_of(ground.grid.k(), splits[0]), slot_of(ground.grid.k(), splits[1])]
        } else {
            child_slots(piece.apex_slot, piece.split_slot)
        };
        let raws = ground.pages.raw_pair(slots);
        // All levels below the asked vertex's say the new heights.
        let code_of =
            |raw: C::Raw| if !C::is_plain(raw) && C::is_void(raw) { f64::NAN } else { C::height_value(raw) };
        let codes = [code_of(raws[0]), code_of(raws[1])];
        if level == 1 {
            for i in [0, 1] {
                if ![b_out, d_out][i] {
                    let off = self.off(splits[i], codes[i]);
                    self.consider(off);
                }
            }
            return None;
        }
        let [off_a, off_b, off_d] = piece.off;
        let shared = larger(off, off_a);
        let bounds = [
            self.bound(larger(shared, off_b), raws[0], level - 1),
            self.bound(larger(shared, off_d), raws[1], level - 1),
        ];
        // The ends of the new base turn about, so that slots follow.
        let half = |i: usize| {
            let (corners, off, outside) = if i == 0 {
                ([v, b, a], [off, off_b, off_a], [b_out, base_out, false])
            } else {
                ([v, a, d], [off, off_a, off_d], [d_out, false, base_out])
            };
            let half = Piece { corners, off, apex_slot: piece.split_slot, split_slot: slots[i], outside };
            (half, Split { v: splits[i], code: codes[i], level: level - 1 })
        };
        let first = usize::from(bounds[1] > bounds[0]);
        if bounds[1 - first] > self.enough {
            let (piece, split) = half(1 - first);
            waiting.push(Waiting { piece, split, bound: bounds[1 - first] });
        }
        (bounds[first] > self.enough).then(|| half(first))
    }

    /// Codes of distance that no sample of a triangle exceeds whose corners are `off` at most, `raw` being the record of the vertex that splits it.
    #[inline(always)]
    fn bound(&self, off: f64, raw: C::Raw, level: u32) -> f64 {
        let split = self.rules.codec.decode(raw, level);
        if C::is_plain(raw) {
            return off + self.slack + split.error_m * self.per_step;
        }
        if split.class == VertexClass::Inert {
            return 0.0;
        }
        // An error says nothing of triangles with a void corner. Samples on the legs are the children's to count, whose triangles have the split vertex as a corner.
        if split.class.is_void() {
            return f64::INFINITY;
        }
        off + self.slack + split.error_m * self.per_step
    }
}
