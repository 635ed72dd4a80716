//! The bin-tree array: one record a vertex, with its live-range word, what its next test needs, and its relatives.
//!
//! A node is a vertex that has been tested: it is *split* if its one or two triangles are, and a leaf otherwise. Nodes form the refinement graph of
//! Lindstrom & Pascucci (2001, section 3): a node has up to two parents, the apexes of the triangles that it splits, and up to four
//! children (`super::labels` names them). Node i owns the triangle slots 2i and 2i + 1, one a side, so triangles need no array of
//! their own: what a slot shows follows from its node. At the finest level, where a split makes four triangles that no vertex splits any
//! further, an *annex*, a node without a vertex, has the two slots that are missing.
//!
//! Invariants: a split node's parents are split; a side's parent is recorded exactly while that side's triangle exists; a node without
//! parents is free. The word's own bits ([`ACTIVE`] and the certificate) say what is wanted, [`SPLIT`] what is.
//! Cost: 48 bytes a node with compact records, and a little more than a node a triangle.

use super::clusters::{CLUSTER, Clusters};
use super::labels::{first_child, is_on_border, level_of, orientation};
use crate::refine::kinetic::capacity::grow;
use crate::refine::kinetic::time::certificate::ACTIVE;
use crate::refine::kinetic::time::clocks::EXPIRY_BITS;
use terrasoar_layout::grid::GridPoint;

/// Tree bit of a word: the node's triangles are split.
pub(crate) const SPLIT: u32 = 1 << 30;
/// The bits of a word that are no certificate.
pub(crate) const STATUS: u32 = ACTIVE | SPLIT;
/// The word of a free node, and of an annex: no live word has this certificate.
pub(crate) const NO_VERTEX: u32 = SPLIT - 1;
/// The word of a node whose record has not come yet: nor has any this one.
pub(crate) const UNREAD: u32 = NO_VERTEX - (1 << EXPIRY_BITS);
/// No node, no vertex.
pub(crate) const NONE: u32 = u32::MAX;
/// The square's centre, which is always split.
pub(crate) const CENTRE: u32 = 0;

/// Places in [`Node::body`].
pub(crate) mod body {
    /// Leaf, and split node of level 0: vertex slots of the edge's ends, as the triangle of side 0 has them counter-clockwise.
    pub(in crate::refine::kinetic) const P: usize = 0;
    pub(in crate::refine::kinetic) const Q: usize = 1;
    /// Leaf, and split node of level 0: vertex slot of the apex of side 0; that of side 1 follows.
    pub(in crate::refine::kinetic) const APEX: usize = 2;
    /// Split node: its own vertex slot. Children by label lie before it if the level is above 0.
    pub(in crate::refine::kinetic) const HERE: usize = 4;
    /// Leaf whose record has not been read: where the file has it, low half first.
    pub(super) const SLOT: usize = 4;
    /// Split node of level 0: its annex.
    pub(in crate::refine::kinetic) const ANNEX: usize = 5;
}

/// One record of the bin-tree array.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct Node<R> {
    /// Live-range word.
    pub word: u32,
    /// The vertex's record as the file has it, so that testing again reads no file.
    pub raw: R,
    pub point: GridPoint,
    /// Parent on each side, or [`NONE`]; of an annex, whose it is.
    pub parents: [u32; 2],
    /// By state: see [`body`].
    pub body: [u32; 6],
}

impl<R> Node<R> {
    /// A leaf without parents, whose record is to be read from `slot`.
    #[inline(always)]
    pub(crate) fn fresh(word: u32, point: GridPoint, slot: u64, raw: R) -> Self {
        let [low, high] = [slot as u32, (slot >> 32) as u32];
        Self { word, raw, point, parents: [NONE; 2], body: [NONE, NONE, NONE, NONE, low, high] }
    }

    /// Where the file has the record of a leaf that has not been tested.
    #[inline(always)]
    pub(crate) fn slot(&self) -> u64 {
        u64::from(self.body[body::SLOT]) | u64::from(self.body[body::SLOT + 1]) << 32
    }

    /// A place that holds nothing; some record fills it.
    pub(crate) fn free(raw: R) -> Self {
        Self { word: NO_VERTEX, raw, point: GridPoint::default(), parents: [NONE; 2], body: [NONE; 6] }
    }
}

/// The bin-tree array.
#[derive(Debug)]
pub(crate) struct Nodes<R> {
    pub all: Vec<Node<R>>,
    /// Which places are taken, and which slots have changed.
    pub clusters: Clusters,
}

impl<R: Copy> Nodes<R> {
    pub(crate) fn new(clusters: Clusters) -> Self {
        Self { all: Vec::new(), clusters }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<Node<R>>() + self.clusters.bytes()
    }

    #[inline(always)]
    pub(crate) fn get(&self, node: u32) -> &Node<R> {
        &self.all[node as usize]
    }

    #[inline(always)]
    pub(crate) fn get_mut(&mut self, node: u32) -> &mut Node<R> {
        &mut self.all[node as usize]
    }

    /// The word at a place that may have been given up since, if it is the one that was entered for it.
    #[inline(always)]
    pub(crate) fn word_if(&mut self, node: u32, entered: u32) -> Option<&mut u32> {
        let word = &mut self.all.get_mut(node as usize)?.word;
        if *word & !SPLIT == entered { Some(word) } else { None }
    }

    /// Whether the place holds a vertex. Lists of nodes may name places that have been given up since, beyond the array's end too.
    #[inline(always)]
    pub(crate) fn is_live(&self, node: u32) -> bool {
        self.all.get(node as usize).is_some_and(|node| node.word & !STATUS != NO_VERTEX)
    }

    /// Whether the node waits for its record.
    #[inline(always)]
    pub(crate) fn is_unread(&self, node: u32) -> bool {
        self.all.get(node as usize).is_some_and(|node| node.word == UNREAD)
    }

    #[inline(always)]
    pub(crate) fn is_split(&self, node: u32) -> bool {
        self.get(node).word & SPLIT != 0
    }

    /// A new node beside another, without parents and certificate; `raw` stands in for its record until that is read from `slot`.
    pub(crate) fn create(&mut self, beside: u32, point: GridPoint, slot: u64, raw: R) -> u32 {
        self.place(beside, Node::fresh(0, point, slot, raw))
    }

    /// A new annex of `owner`, beside it.
    pub(crate) fn create_annex(&mut self, owner: u32) -> u32 {
        let annex = Node { parents: [owner, NONE], ..Node::free(self.get(owner).raw) };
        self.place(owner, annex)
    }

    fn place(&mut self, beside: u32, record: Node<R>) -> u32 {
        let node = self.clusters.take(beside);
        if self.all.len() < self.clusters.places() {
            grow(&mut self.all, CLUSTER);
            self.all.resize(self.clusters.places(), Node::free(record.raw));
        }
        *self.get_mut(node) = record;
        node
    }

    /// Cuts the array off after the last cluster.
    pub(crate) fn shorten(&mut self) {
        self.all.truncate(self.clusters.places());
        if self.all.capacity() > 2 * self.all.len() {
            self.all.shrink_to(self.all.len() + self.all.len() / 8);
        }
    }

    /// Frees a node or an annex.
    pub(crate) fn free(&mut self, node: u32) {
        self.get_mut(node).word = NO_VERTEX;
        self.clusters.give_back(node);
    }

    /// Frees a place whose record has moved elsewhere.
    pub(crate) fn vacate(&mut self, node: u32) {
        self.get_mut(node).parents = [NONE; 2];
        self.free(node);
    }

    /// The label of a node at its parent on `side`.
    #[inline(always)]
    pub(crate) fn label(&self, node: u32, side: usize) -> usize {
        2 * side + orientation(self.get(node).point)
    }

    /// Whether both of the node's triangles exist, or the only one it can have.
    #[inline(always)]
    pub(crate) fn is_complete(&self, node: u32, side_steps: u32) -> bool {
        let Node { parents, point, .. } = self.get(node);
        (parents[0] != NONE && parents[1] != NONE) || is_on_border(*point, side_steps)
    }

    /// The sides of a node that have a triangle.
    #[inline(always)]
    pub(crate) fn sides(&self, node: u32, level: u32) -> [Option<Side>; 2] {
        let parents = self.get(node).parents;
        let side = |side: usize| {
            let label = self.label(node, side);
            let first = first_child(label, level);
            let last = (first + 3) & 3;
            (parents[side] != NONE).then_some(Side { parent: parents[side], label, first, last })
        };
        [side(0), side(1)]
    }

    /// What the two slots of a place show: triangles of vertex slots, counter-clockwise, apex first.
    #[inline]
    pub(crate) fn triangles(&self, node: u32) -> [Option<[u32; 3]>; 2] {
        [0, 1].map(|side| self.triangle(node, side))
    }

    /// What one slot of a place shows. With few branches, because no processor can predict what has changed.
    #[inline(always)]
    pub(crate) fn triangle(&self, node: u32, side: usize) -> Option<[u32; 3]> {
        let record = self.get(node);
        let Node { word, parents, body, point, .. } = record;
        if *word & !STATUS == NO_VERTEX {
            // Whatever is free has no owner; an annex shows the last half of each side.
            let owner = (parents[0] != NONE).then(|| self.get(parents[0]))?;
            let [here, apex, _, q] = half(owner, side);
            return (owner.parents[side] != NONE).then_some([here, q, apex]);
        }
        let [here, apex, p, q] = half(record, side);
        let split = *word & SPLIT != 0;
        let shown =
            [if split { here } else { apex }, if split { apex } else { p }, if split { p } else { q }];
        let has_some = (parents[side] != NONE) & (body[body::P] != NONE) & !(split & (level_of(*point) > 0));
        has_some.then_some(shown)
    }
}

/// Own vertex slot, apex, and edge ends counter-clockwise, of one side of a node that has them.
#[inline(always)]
pub(crate) fn half<R>(node: &Node<R>, side: usize) -> [u32; 4] {
    let [p, q] = if side == 0 {
        [node.body[body::P], node.body[body::Q]]
    } else {
        [node.body[body::Q], node.body[body::P]]
    };
    [node.body[body::HERE], node.body[body::APEX + side], p, q]
}

/// One side of a node: its parent there, and the labels of the two children that side's triangle has.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side {
    pub parent: u32,
    /// The node's label at that parent.
    pub label: usize,
    /// Between parent and edge end p, counter-clockwise: child triangle (v; parent, p).
    pub first: usize,
    /// Between edge end q and parent: child triangle (v; q, parent).
    pub last: usize,
}
