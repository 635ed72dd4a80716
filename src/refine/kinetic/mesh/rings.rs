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
use crate::refine::kinetic::capacity::{give_back, grow, shorten};
use crate::refine::kinetic::hands::change;
use terrasoar_layout::read::prefetch::prefetch;

/// No node, no vertex.
pub(crate) const NONE: u32 = u32::MAX;

/// A vertex slot, of which there are at most 2^29, and for a parent how the child lies at it: its turn there, and its orientation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Corner(u32);

impl Corner {
    /// There is none.
    pub(crate) const NONE: Self = Self(u32::MAX);
    const TURN_SHIFT: u32 = 29;
    const ORIENTATION_SHIFT: u32 = 31;

    /// The parent with this vertex slot, of its child with this turn and label.
    #[inline(always)]
    pub(crate) fn parent(slot: u32, turn: usize, label: usize) -> Self {
        Self(slot | (turn as u32) << Self::TURN_SHIFT | (label as u32) << Self::ORIENTATION_SHIFT)
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
        (self.0 >> Self::TURN_SHIFT) as usize & 3
    }

    /// The child's orientation: see `super::labels`.
    #[inline(always)]
    pub(crate) fn orientation(self) -> usize {
        (self.0 >> Self::ORIENTATION_SHIFT) as usize
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

    /// The annex of a vertex of the finest level.
    pub(crate) fn annex(&self) -> u32 {
        self.children[0]
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

/// Half a ring.
type Half = [u32; 4];

/// The rings of all vertices, by slot. One half goes before the first one: where large allocations begin 16 bytes into a page, as those of glibc do, each ring lies in one cache line. An array of
/// aligned elements would be copied whenever it grows, where this one is mapped elsewhere.
#[derive(Debug, Default)]
pub(crate) struct Rings {
    halves: Vec<Half>,
}

impl Rings {
    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.halves.capacity() * size_of::<Half>()
    }

    /// The parents of the vertex in a slot, by side.
    #[inline(always)]
    pub(crate) fn parents(&self, slot: u32) -> [Corner; 2] {
        [self.corner(slot, 0), self.corner(slot, 2)]
    }

    /// One corner of a ring.
    #[inline(always)]
    pub(crate) fn corner(&self, slot: u32, corner: usize) -> Corner {
        Corner(self.halves[2 * slot as usize + 1][corner & 3])
    }

    /// The node of one child.
    #[inline(always)]
    pub(crate) fn child(&self, slot: u32, turn: usize) -> u32 {
        self.halves[2 * slot as usize + 2][turn & 3]
    }

    /// The edge beyond which a child lies.
    #[inline(always)]
    pub(crate) fn edge(&self, slot: u32, turn: usize) -> [u32; 2] {
        let corners = &self.halves[2 * slot as usize + 1];
        [Corner(corners[turn & 3]).slot(), Corner(corners[(turn + 1) & 3]).slot()]
    }

    /// The edge that a leaf with these parents splits, as its triangle of side 0 has it; one of them is enough.
    #[inline(always)]
    pub(crate) fn edge_of(&self, parents: [Corner; 2]) -> [u32; 2] {
        let side = usize::from(parents[0].is_none());
        let ends = self.edge(parents[side].slot(), parents[side].turn());
        // Side 1 has it the other way round.
        [ends[side], ends[1 - side]]
    }

    /// All of a ring.
    #[inline(always)]
    pub(crate) fn get(&self, slot: u32) -> Ring {
        let [corners, children] = self.halves[2 * slot as usize + 1..][..2] else {
            unreachable!("two halves")
        };
        Ring { corners: corners.map(Corner), children }
    }

    /// Nodes of the children of the vertex in a slot, if that has a ring.
    #[inline(always)]
    pub(crate) fn children(&self, slot: u32) -> &[u32; 4] {
        self.halves.get(2 * slot as usize + 2).unwrap_or(&[NONE; 4])
    }

    /// Nodes of the children of the vertex in a slot.
    #[inline(always)]
    pub(crate) fn children_mut(&mut self, slot: u32) -> &mut [u32; 4] {
        &mut self.halves[2 * slot as usize + 2]
    }

    /// Sets the ring of a slot, which may be the first one behind all others.
    #[inline(always)]
    pub(crate) fn set(&mut self, slot: u32, ring: Ring) {
        let halves = [ring.corners.map(|corner| corner.0), ring.children];
        if let Some(present) = self.halves.get_mut(2 * slot as usize + 1..2 * slot as usize + 3) {
            present.copy_from_slice(&halves);
            return;
        }
        self.room(1);
        self.halves.extend_from_slice(&halves);
    }

    /// Makes room for more rings.
    fn room(&mut self, more: usize) {
        grow(&mut self.halves, 2 * more + 1);
        if self.halves.is_empty() {
            self.halves.push([NONE; 4]);
        }
    }

    /// Appends rings. `make` has the number of each among them, and tells of a slot before all of them what its children are.
    pub(crate) fn append(
        &mut self,
        count: usize,
        make: impl Fn(usize, &dyn Fn(u32) -> [u32; 4]) -> Ring + Sync,
    ) {
        self.room(count);
        let before = self.halves.len();
        self.halves.resize(before + 2 * count, [NONE; 4]);
        let (before, halves) = self.halves.split_at_mut(before);
        // Parts are of whole rings: they have even numbers of halves.
        change(halves, |at, part| {
            for (i, halves) in part.chunks_exact_mut(2).enumerate() {
                let ring = make(at / 2 + i, &|slot| before[2 * slot as usize + 2]);
                halves.copy_from_slice(&[ring.corners.map(|corner| corner.0), ring.children]);
            }
        });
    }

    /// Gives up rings behind the first ones.
    pub(crate) fn truncate(&mut self, slots: usize) {
        self.halves.truncate(2 * slots + 1);
        shorten(&mut self.halves);
    }

    /// Takes all rings away; memory stays.
    pub(crate) fn clear(&mut self) {
        self.halves.clear();
    }

    /// Asks memory for a ring.
    #[inline(always)]
    pub(crate) fn fetch(&self, corner: Corner) {
        prefetch(&self.halves, 2 * corner.slot() as usize + 1);
    }

    /// Gives memory back if less than one part in `parts` of it is in use.
    pub(crate) fn give_back(&mut self, parts: usize) {
        give_back(&mut self.halves, parts);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::kinetic::mesh::labels::{child_point, level_of, orientation};
    use terrasoar_layout::grid::{Grid, GridPoint};

    /// The corners around every vertex, from the grid's own parents and edge ends: its children lie between those that rings say, and are shared as rings say.
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
                let from_p = |at: GridPoint| {
                    [i64::from(at.x()) - i64::from(p.x()), i64::from(at.y()) - i64::from(p.y())]
                };
                // The parents by side: a vertex has the label 2 side + orientation at each.
                let is_parent = |a: GridPoint, side: usize| child_point(a, level + 1, 2 * side + turned) == p;
                let parents = [0, 1]
                    .map(|side| grid.apexes(p).find(|a| level + 1 < grid.levels() && is_parent(*a, side)));
                let Some(side) = (0..2).find(|side| parents[*side].is_some()) else { continue };
                let [px, py] = from_p(parents[side].unwrap());
                // Counter-clockwise from the parent of side 0 comes the first end; from that of side 1 the other one.
                let mut ends = grid.edge_ends(p);
                let [ex, ey] = from_p(ends[0]);
                if (px * ey - py * ex > 0) != (side == 0) {
                    ends.reverse();
                }
                let corners = [parents[0], Some(ends[0]), parents[1], Some(ends[1])];
                for turn in (0..4).filter(|turn| inside(&child(*turn))) {
                    let [Some(a), Some(b)] = [corners[turn], corners[(turn + 1) & 3]] else {
                        panic!("{p:?} has no side {turn}");
                    };
                    assert_eq!(a.midpoint(b), child(turn), "{p:?} {turn}");
                    assert!(corners[2 * side_of(turn).0].is_some(), "{p:?} {turn}");
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
