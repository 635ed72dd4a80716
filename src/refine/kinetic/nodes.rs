//! The bin-tree array: one record a vertex, each a live-range word and what its next test needs.
//!
//! A node is a vertex that has been tested: it is *split* if its two triangles are, and a leaf otherwise. Nodes form the refinement graph of
//! Lindstrom & Pascucci (2001, section 3): a node has up to two parents, the apexes of the triangles that it splits, and up
//! to four children. Neighbours are named by direction, so that everything is reached by index arithmetic:
//!
//! * children of a white node (a cell's centre) lie east, north, west, south: labels 0 to 3; those of a black node (an edge's midpoint)
//!   lie south-east, north-east, north-west, south-west. Opposite labels differ by 2.
//! * a node with label j at one parent has label j + 2 at the other. `j >> 1` is the *side* of the node that the parent lies on, `j & 1` the
//!   same for both: its orientation.
//! * around a node, from its parent of label j counter-clockwise: parent, child f, edge end p, child f + 1, other parent, child f + 2,
//!   edge end q, child f + 3, with f = [`first_child`]. A child that two nodes share has opposite labels at them.
//!
//! Invariants: a split node's parents are split; a side's parent is recorded exactly while that side's triangle exists; a node without
//! parents is free. The word's own bits ([`ACTIVE`] and the certificate) say what is wanted, [`SPLIT`] what is.

use super::certificate::ACTIVE;
use terrasoar_layout::grid::GridPoint;

/// Tree bit of a word: the node's triangles are split.
pub(super) const SPLIT: u32 = 1 << 30;
/// The bits of a word that are no certificate.
pub(super) const STATUS: u32 = ACTIVE | SPLIT;
/// The word of a free node: no live word has this certificate.
const FREE: u32 = SPLIT - 1;
/// No node, no slot.
pub(super) const NONE: u32 = u32::MAX;
/// The square's centre, which is always split.
pub(super) const CENTRE: u32 = 0;

/// What a node holds besides its word, by whether it is split.
///
/// * leaf: `[slot of side 0's triangle, of side 1's, -, -]`
/// * split: its children by label, or at level 0 the slots of its four triangles by the label of the direction they lie in.
pub(super) type Links = [u32; 4];

/// The bin-tree array as structure of arrays.
#[derive(Debug)]
pub(super) struct Nodes<R> {
    /// Live-range words.
    pub words: Vec<u32>,
    /// Where each vertex lies.
    pub points: Vec<GridPoint>,
    /// Each vertex's record as the file has it, so that testing again reads no file.
    pub raws: Vec<R>,
    pub links: Vec<Links>,
    /// Parent on each side, or [`NONE`].
    pub parents: Vec<[u32; 2]>,
    /// Free nodes, newest last. May hold nodes that are not free any more.
    free: Vec<u32>,
    live: usize,
}

impl<R: Copy> Nodes<R> {
    pub(super) fn new() -> Self {
        Self {
            words: Vec::new(),
            points: Vec::new(),
            raws: Vec::new(),
            links: Vec::new(),
            parents: Vec::new(),
            free: Vec::new(),
            live: 0,
        }
    }

    /// Live nodes.
    pub(super) fn live(&self) -> usize {
        self.live
    }

    /// Nodes, free ones included.
    pub(super) fn len(&self) -> usize {
        self.words.len()
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        let a_node = size_of::<u32>()
            + size_of::<GridPoint>()
            + size_of::<R>()
            + size_of::<Links>()
            + size_of::<[u32; 2]>();
        self.words.capacity() * a_node + self.free.capacity() * size_of::<u32>()
    }

    /// Whether a node is in use.
    #[inline(always)]
    pub(super) fn is_live(&self, node: u32) -> bool {
        self.words[node as usize] & !STATUS != FREE
    }

    #[inline(always)]
    pub(super) fn is_split(&self, node: u32) -> bool {
        self.words[node as usize] & SPLIT != 0
    }

    /// A new node without parents and certificate, its record yet to be read.
    pub(super) fn create(&mut self, point: GridPoint, blank: R) -> u32 {
        self.live += 1;
        while let Some(node) = self.free.pop() {
            if !self.is_live(node) {
                self.put(node, 0, point, blank, [NONE; 4], [NONE; 2]);
                return node;
            }
        }
        let node = self.words.len() as u32;
        self.words.push(0);
        self.points.push(point);
        self.raws.push(blank);
        self.links.push([NONE; 4]);
        self.parents.push([NONE; 2]);
        node
    }

    fn put(&mut self, node: u32, word: u32, point: GridPoint, raw: R, links: Links, parents: [u32; 2]) {
        let at = node as usize;
        self.words[at] = word;
        self.points[at] = point;
        self.raws[at] = raw;
        self.links[at] = links;
        self.parents[at] = parents;
    }

    /// Frees a node.
    pub(super) fn free(&mut self, node: u32) {
        self.words[node as usize] = FREE;
        self.free.push(node);
        self.live -= 1;
    }

    /// Whether nothing is free below the end of the array.
    pub(super) fn is_full(&self) -> bool {
        self.live == self.words.len()
    }

    /// Moves all of node `from` to the free node `to`, links of relatives excepted.
    pub(super) fn move_record(&mut self, from: u32, to: u32) {
        let at = from as usize;
        self.put(to, self.words[at], self.points[at], self.raws[at], self.links[at], self.parents[at]);
        self.words[at] = FREE;
        self.free.push(from);
    }

    /// A node past the end that is free, for [`Nodes::move_record`].
    pub(super) fn spare(&mut self, blank: R) -> u32 {
        let node = self.create(GridPoint::default(), blank);
        self.free(node);
        node
    }

    /// The label of a node at its parent on `side`.
    #[inline(always)]
    pub(super) fn label(&self, node: u32, side: usize) -> usize {
        2 * side + orientation(self.points[node as usize])
    }

    /// Whether both of the node's triangles exist, or the only one it can have.
    #[inline(always)]
    pub(super) fn is_complete(&self, node: u32, side_steps: u32) -> bool {
        let parents = self.parents[node as usize];
        (parents[0] != NONE && parents[1] != NONE) || is_on_border(self.points[node as usize], side_steps)
    }
}

/// Whether a point lies on the border of the square.
#[inline(always)]
pub(super) fn is_on_border(p: GridPoint, side_steps: u32) -> bool {
    p.x() == 0 || p.y() == 0 || p.x() == side_steps || p.y() == side_steps
}

/// Level of a vertex that is no corner: as [`Grid::level`](terrasoar_layout::grid::Grid::level), from the point alone.
#[inline(always)]
pub(super) fn level_of(p: GridPoint) -> u32 {
    let shift = (p.x() | p.y()).trailing_zeros();
    2 * shift + ((p.x() & p.y()) >> shift & 1)
}

/// Whether a node at this level is white, a cell's centre.
pub(super) const fn is_white(level: u32) -> bool {
    level & 1 == 1
}

/// The low bit of a node's labels at its parents.
#[inline(always)]
pub(super) fn orientation(p: GridPoint) -> usize {
    let shift = (p.x() | p.y()).trailing_zeros();
    let (x, y) = (p.x() >> shift, p.y() >> shift);
    // White: parents lie across the diagonal that its cell is not split along. Black: across its edge.
    let (white, turned) = (x & y & 1, (x ^ y) >> 1 & 1);
    (if white == 1 { turned } else { x & 1 }) as usize
}

/// The label of the child that follows the parent of label `label` counter-clockwise.
#[inline(always)]
pub(super) const fn first_child(label: usize, level: u32) -> usize {
    (label + if is_white(level) { 2 } else { 3 }) & 3
}

/// The child with `label` of a node at `p` of `level`, which is above 0.
#[inline(always)]
pub(super) fn child_point(p: GridPoint, level: u32, label: usize) -> GridPoint {
    const WHITE: [[i32; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];
    const BLACK: [[i32; 2]; 4] = [[1, -1], [1, 1], [-1, 1], [-1, -1]];
    let ([dx, dy], step) = if is_white(level) {
        (WHITE[label], 1 << (level / 2))
    } else {
        (BLACK[label], 1 << (level / 2) >> 1)
    };
    GridPoint::new(p.x().wrapping_add_signed(dx * step), p.y().wrapping_add_signed(dy * step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::grid::Grid;

    #[test]
    fn labels_agree_with_the_grid() {
        for k in 1..=5 {
            let grid = Grid::new([(1 << k) + 1; 2], [1.0, 1.0]).unwrap();
            let n = grid.side_steps();
            for p in (0..=n)
                .flat_map(|y| (0..=n).map(move |x| GridPoint::new(x, y)))
                .filter(|p| !grid.is_corner(*p))
            {
                let level = level_of(p);
                assert_eq!(level, grid.level(p));
                if level == 0 {
                    continue;
                }
                let inside = |c: &GridPoint| c.x() <= n && c.y() <= n;
                let mut named: Vec<_> =
                    (0..4).map(|label| child_point(p, level, label)).filter(inside).collect();
                let mut of_grid: Vec<_> = grid.children(p).collect();
                named.sort();
                of_grid.sort();
                assert_eq!(named, of_grid);
                for label in 0..4 {
                    let c = child_point(p, level, label);
                    if !inside(&c) {
                        continue;
                    }
                    assert_eq!(label & 1, orientation(c), "{p:?} {c:?}");
                    assert!(grid.apexes(c).any(|a| a == p));
                    // The next child around the parent shares a child with this one, under opposite labels.
                    let next = child_point(p, level, (label + 1) & 3);
                    if inside(&next) && level > 1 {
                        let last = (first_child(label, level - 1) + 3) & 3;
                        let first = first_child((label + 1) & 3, level - 1);
                        assert_eq!(child_point(c, level - 1, last), child_point(next, level - 1, first));
                        assert_eq!(first, (last + 2) & 3);
                    }
                }
            }
        }
    }
}
