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
use crate::grid::record::{RecordCodec, Vertex, VertexClass};

/// A triangle of the descent: its corners, how far they are above the plane, its slots, and which edges belong to others.
#[derive(Debug, Clone, Copy)]
struct Piece {
    /// Apex and the ends of the base.
    corners: [GridPoint; 3],
    /// Codes by which the corners lie above the plane; not a number for voids.
    above: [f64; 3],
    apex_slot: u64,
    split_slot: u64,
    /// Whether the base, the edge from the apex to its first end and that to its second lie on a leg of the whole triangle: their samples count with the vertex
    /// that splits that leg.
    outside: [bool; 3],
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

    /// Searches the triangle (apex; b, d) with these slots of its apex and its split vertex, whose record is `raw`.
    pub(crate) fn run(
        &mut self,
        ground: &mut Ground<'_, C>,
        corners: [GridPoint; 3],
        slots: [u64; 2],
        raw: C::Raw,
    ) {
        let piece = Piece {
            corners,
            // A plane passes through its corners.
            above: [0.0; 3],
            apex_slot: slots[0],
            split_slot: slots[1],
            outside: [false, true, true],
        };
        self.visit(ground, piece, raw, self.level);
    }

    #[inline(always)]
    fn consider(&mut self, above: f64) {
        if above.abs() > self.farthest {
            self.farthest = above.abs();
            let metres = f64::from(self.rules.scanned_error_m(self.farthest));
            if metres > self.limit_m {
                self.limit_m = self.limit_m.max(self.rules.stored_error_m(self.level, self.class, metres));
                self.know_enough();
            }
        }
    }

    /// Looks at the vertex that splits `piece`, whose record is `raw` and whose level is `level`, 1 or more, and at what lies below it.
    fn visit(&mut self, ground: &mut Ground<'_, C>, piece: Piece, raw: C::Raw, level: u32) {
        let [a, b, d] = piece.corners;
        let v = b.midpoint(d);
        let vertex = self.rules.codec.decode(raw, level);
        if vertex.class == VertexClass::Inert {
            return;
        }
        let above =
            if vertex.class.is_void() { f64::NAN } else { self.plane.above(v, ground.code_of(v, raw)) };
        if !piece.outside[0] && !above.is_nan() {
            self.consider(above);
        }
        // The centre's triangles are no part of the walk that slots follow.
        let slots = if piece.split_slot == CENTRE_SLOT {
            [slot_of(ground.grid.k(), a.midpoint(b)), slot_of(ground.grid.k(), a.midpoint(d))]
        } else {
            child_slots(piece.apex_slot, piece.split_slot)
        };
        let [base_out, b_out, d_out] = piece.outside;
        let [above_a, above_b, above_d] = piece.above;
        let halves = [
            Piece {
                corners: [v, b, a],
                above: [above, above_b, above_a],
                apex_slot: piece.split_slot,
                split_slot: slots[0],
                outside: [b_out, base_out, false],
            },
            Piece {
                corners: [v, a, d],
                above: [above, above_a, above_d],
                apex_slot: piece.split_slot,
                split_slot: slots[1],
                outside: [d_out, false, base_out],
            },
        ];
        let raws = slots.map(|slot| ground.pages.raw(slot));
        if level == 1 {
            for (half, raw) in halves.into_iter().zip(raws) {
                let leaf = half.corners[1].midpoint(half.corners[2]);
                if !half.outside[0] && !C::is_void(raw) {
                    self.consider(self.plane.above(leaf, ground.code_of(leaf, raw)));
                }
            }
            return;
        }
        let bounds = [0, 1].map(|i| self.bound(&halves[i], &self.rules.codec.decode(raws[i], level - 1)));
        for i in [0, 1].into_iter().filter(|i| bounds[*i] > self.enough) {
            // Siblings share a cache line more often than not.
            ground.pages.prefetch(child_slots(halves[i].apex_slot, halves[i].split_slot)[0]);
        }
        let order = if bounds[1] > bounds[0] { [1, 0] } else { [0, 1] };
        for i in order {
            if bounds[i] > self.enough {
                self.visit(ground, halves[i], raws[i], level - 1);
            }
        }
    }

    /// Codes of distance that no sample of `piece` exceeds, `split` being the vertex that splits it.
    #[inline(always)]
    fn bound(&self, piece: &Piece, split: &Vertex) -> f64 {
        if split.class == VertexClass::Inert {
            return 0.0;
        }
        // An error says nothing of triangles with a void corner. Samples on the legs are the children's to count, whose triangles have the split vertex as a corner.
        let [a, b, d] = piece.above.map(f64::abs);
        if a.is_nan() || b.is_nan() || d.is_nan() || split.class.is_void() {
            return f64::INFINITY;
        }
        larger(larger(a, b), d) + self.slack + split.error_m * self.per_step
    }
}
