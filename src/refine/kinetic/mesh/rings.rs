//! What lies around each vertex of the mesh: the corners of its triangles, and its children.
//!
//! Around a vertex lie, counter-clockwise, a parent, an end of the edge that it splits, the other parent, and the other end. Two neighbours among these four and the vertex itself are the
//! triangle that one of its children splits, so child t lies beyond the corners t and t + 1: that is its *turn*. Sides are those of `super::labels`; the turns of side 0
//! are 0 and 3, those of side 1 are 2 and 1.
//!
//! A ring has the number of its vertex's slot. So a node names a parent by the parent's vertex slot, which is a corner of its triangle too, and no node keeps corners of its own.
//!
//! Invariant: a ring is true while its vertex is in the mesh. Cost: 32 bytes a vertex, half a vertex a triangle.

use super::labels::first_child;
use crate::refine::kinetic::capacity::{give_back, grow};
use terrasoar_layout::read::prefetch::prefetch;

/// No node, no vertex.
pub(crate) const NONE: u32 = u32::MAX;

/// A vertex slot, of which there are at most 2^30, and for a parent the turn of the child that it is told of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Corner(u32);

impl Corner {
    /// There is none.
    pub(crate) const NONE: Self = Self(u32::MAX);
    const TURN_SHIFT: u32 = 30;

    /// The parent with this vertex slot, of its child with this turn.
    #[inline(always)]
    pub(crate) fn parent(slot: u32, turn: usize) -> Self {
        Self(slot | (turn as u32) << Self::TURN_SHIFT)
    }

    /// A vertex slot.
    #[inline(always)]
    pub(crate) fn of(slot: u32) -> Self {
        Self(slot)
    }

    #[inline(always)]
    pub(crate) fn slot(self) -> u32 {
        self.0 & ((1 << Self::TURN_SHIFT) - 1)
    }

    #[inline(always)]
    pub(crate) fn turn(self) -> usize {
        (self.0 >> Self::TURN_SHIFT) as usize
    }

    #[inline(always)]
    pub(crate) fn is_none(self) -> bool {
        self == Self::NONE
    }

    #[inline(always)]
    pub(crate) fn is_some(self) -> bool {
        self != Self::NONE
    }
}

/// What lies around one vertex.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(crate) struct Ring {
    /// Parent of side 0, end, parent of side 1, end. A parent that is missing is [`Corner::NONE`].
    pub corners: [Corner; 4],
    /// Nodes of the children by turn, or [`NONE`]. At the finest level, where there are no children, the first is the annex.
    pub children: [u32; 4],
}

impl Ring {
    /// The ring of a vertex without children.
    #[inline(always)]
    pub(crate) fn new(parents: [Corner; 2], [p, q]: [u32; 2]) -> Self {
        let corners = [parents[0], Corner::of(p), parents[1], Corner::of(q)];
        Self { corners, children: [NONE; 4] }
    }

    #[inline(always)]
    pub(crate) fn parents(&self) -> [Corner; 2] {
        [self.corners[0], self.corners[2]]
    }

    /// Vertex slots of the edge that the vertex splits.
    #[inline(always)]
    pub(crate) fn ends(&self) -> [u32; 2] {
        [self.corners[1].slot(), self.corners[3].slot()]
    }

    /// The edge beyond which the child with this turn lies.
    #[inline(always)]
    pub(crate) fn edge(&self, turn: usize) -> [u32; 2] {
        [self.corners[turn & 3].slot(), self.corners[(turn + 1) & 3].slot()]
    }

    /// The annex of a vertex of the finest level.
    pub(crate) fn annex(&self) -> u32 {
        self.children[0]
    }
}

/// The ring of no vertex.
pub(crate) const NOTHING: Ring = Ring { corners: [Corner::NONE; 4], children: [NONE; 4] };

/// The edge that a leaf splits, as its triangle of side 0 has it, from its parents and their rings; one of them is enough.
#[inline(always)]
pub(crate) fn edge_of(parents: [Corner; 2], rings: [&Ring; 2]) -> [u32; 2] {
    if parents[0].is_some() {
        rings[0].edge(parents[0].turn())
    } else {
        // Side 1 has it the other way round.
        let [q, p] = rings[1].edge(parents[1].turn());
        [p, q]
    }
}

/// The turns of a side's two triangles: the first counter-clockwise from its parent, and the last.
pub(crate) const TURNS: [[usize; 2]; 2] = [[0, 3], [2, 1]];

/// The side of a turn, and whether it is the last one of its two.
#[inline(always)]
pub(crate) fn side_of(turn: usize) -> (usize, bool) {
    ((turn ^ turn >> 1) & 1, turn & 1 == 1)
}

/// The label of the child with a turn, of a vertex of this orientation and level.
#[inline(always)]
pub(crate) fn label_of(turn: usize, orientation: usize, level: u32) -> usize {
    (first_child(orientation, level) + turn) & 3
}

/// A child that two vertices share, for a vertex of this orientation: where around the parent of `side` the other one lies, in turns from it, and the child's turn there. `last` says which of
/// the side's two children is meant.
#[inline(always)]
pub(crate) fn sharer_of(side: usize, orientation: usize, last: bool) -> (usize, usize) {
    // The neighbour before the first one, or after the last; labels and turns around the parent go the same way.
    let step = if last { 1 } else { 3 };
    let label = (2 * side + orientation + step) & 3;
    (step, TURNS[label >> 1][usize::from(!last)])
}

/// The rings of all vertices, by slot.
#[derive(Debug, Default)]
pub(crate) struct Rings {
    pub all: Vec<Ring>,
}

impl Rings {
    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<Ring>()
    }

    #[inline(always)]
    pub(crate) fn get(&self, slot: u32) -> &Ring {
        &self.all[slot as usize]
    }

    #[inline(always)]
    pub(crate) fn get_mut(&mut self, slot: u32) -> &mut Ring {
        &mut self.all[slot as usize]
    }

    /// Sets the ring of a slot, which may be the first one behind all others.
    #[inline(always)]
    pub(crate) fn set(&mut self, slot: u32, ring: Ring) {
        if let Some(present) = self.all.get_mut(slot as usize) {
            *present = ring;
            return;
        }
        grow(&mut self.all, 1);
        self.all.push(ring);
    }

    /// Asks memory for a ring.
    #[inline(always)]
    pub(crate) fn fetch(&self, corner: Corner) {
        prefetch(&self.all, corner.slot() as usize);
    }

    /// Gives memory back if less than one part in `parts` of it is in use.
    pub(crate) fn give_back(&mut self, parts: usize) {
        give_back(&mut self.all, parts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::kinetic::mesh::labels::{child_point, level_of, orientation};
    use terrasoar_layout::grid::{Grid, GridPoint};

    /// The grid's own parents and edge ends of every vertex, against what its parents' rings say.
    #[test]
    fn rings_agree_with_the_grid() {
        for k in 2..=5 {
            let grid = Grid::new([(1 << k) + 1; 2], [1.0, 1.0]).unwrap();
            let n = grid.side_steps();
            let inside = |p: &GridPoint| p.x() <= n && p.y() <= n;
            let all = (0..=n).flat_map(|y| (0..=n).map(move |x| GridPoint::new(x, y)));
            for p in all.filter(|p| !grid.is_corner(*p) && grid.level(*p) > 1) {
                let (level, turned) = (level_of(p), orientation(p));
                let child = |turn: usize| child_point(p, level, label_of(turn, turned, level));
                for turn in (0..4).filter(|turn| inside(&child(*turn))) {
                    let c = child(turn);
                    let side = label_of(turn, turned, level) >> 1;
                    // Corner t of the ring is a parent where t is even, and an end of p's edge elsewhere.
                    let [p0, p1] = [turn, (turn + 1) & 3].map(|t| t % 2 == 0);
                    assert_ne!(p0, p1);
                    let ends: Vec<_> = grid.edge_ends(c).to_vec();
                    assert!(ends.iter().any(|e| grid.edge_ends(p).contains(e)), "{p:?} {turn}");
                    assert!(ends.iter().any(|e| grid.apexes(p).any(|a| a == *e)), "{p:?} {turn}");
                    assert!(grid.apexes(c).any(|a| a == p), "{p:?} {turn} {side}");
                }
                // The same child by its other parent.
                for (side, last) in [(0, false), (0, true), (1, false), (1, true)] {
                    let Some(parent) = grid.apexes(p).find(|a| {
                        (0..4).any(|label| {
                            label >> 1 == side
                                && child_point(*a, level + 1, label) == p
                                && !grid.is_corner(*a)
                        })
                    }) else {
                        continue;
                    };
                    let own = (0..4)
                        .find(|turn| {
                            child_point(parent, level + 1, label_of(*turn, orientation(parent), level + 1))
                                == p
                        })
                        .unwrap();
                    let (step, turn) = sharer_of(side, turned, last);
                    let neighbour = child_point(
                        parent,
                        level + 1,
                        label_of((own + step) & 3, orientation(parent), level + 1),
                    );
                    if inside(&neighbour) {
                        let at = label_of(turn, orientation(neighbour), level);
                        let shared = child(TURNS[side][usize::from(last)]);
                        assert_eq!(child_point(neighbour, level, at), shared, "{p:?} {side} {last}");
                    }
                }
            }
        }
    }
}
