//! The bin-tree array: one record a vertex, with its live-range word, what its next test needs, and its parents.
//!
//! A node is a vertex that has been tested: it is *split* if its one or two triangles are, and a leaf otherwise. Nodes form the refinement graph of
//! Lindstrom & Pascucci (2001, section 3): a node has up to two parents, the apexes of the triangles that it splits, and up to four
//! children. A leaf names its parents by their vertex slots. A split node names its own slot, and its [ring](super::rings) has its parents, its children and the corners of all their triangles.
//! Node i owns the triangle slots 2i and 2i + 1, one a side, so triangles need no array of
//! their own: what a slot shows follows from its node. At the finest level, where a split makes four triangles that no vertex splits any
//! further, an *annex*, a node without a vertex, has the two slots that are missing.
//!
//! Invariants: a split node's parents are split; a side's parent is recorded exactly while that side's triangle exists; a node without
//! parents is free. The word's own bits ([`ACTIVE`] and the certificate) say what is wanted, [`SPLIT`] what is.
//! Cost: 16 bytes a node with compact records, and a little more than a node a triangle.

use super::clusters::{CLUSTER, Clusters};
use super::labels::{child_point, level_of};
use super::rings::{Corner, Rings};
use super::vertices::Vertices;
use crate::refine::kinetic::capacity::{grow, shorten};
use crate::refine::kinetic::time::certificate::{ACTIVE, clock_of, expiry_of};
use crate::refine::kinetic::time::clocks::EXPIRY_BITS;
use crate::refine::kinetic::time::queue::{NODE_BITS, Words};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::read::prefetch::prefetch;

/// Tree bit of a word: the node's triangles are split.
pub(crate) const SPLIT: u32 = 1 << 30;
/// The bits of a word that are no certificate.
pub(crate) const STATUS: u32 = ACTIVE | SPLIT;
/// The word of a free node, and of an annex: no live word has this certificate.
pub(crate) const NO_VERTEX: u32 = SPLIT - 1;
/// The word of a node whose record has not come yet: nor has any this one.
pub(crate) const UNREAD: u32 = NO_VERTEX - (1 << EXPIRY_BITS);
/// The expiry of both, which no live word has.
const UNUSED_EXPIRY: u32 = (1 << EXPIRY_BITS) - 1;
/// The square's centre, which is always split.
pub(crate) const CENTRE: u32 = 0;

/// One record of the bin-tree array.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct Node<R> {
    /// Live-range word.
    pub word: u32,
    /// The vertex's record as the file has it, so that testing again reads no file.
    pub raw: R,
    /// Of a leaf: its parent on each side. Of a split node: its own vertex slot, at the finest level twice. Of an annex: the slot of the vertex whose it is.
    pub links: [Corner; 2],
}

impl<R> Node<R> {
    /// A leaf without parents.
    #[inline(always)]
    pub(crate) fn leaf(word: u32, raw: R) -> Self {
        Self { word, raw, links: [Corner::NONE; 2] }
    }

    /// A place that holds nothing; some record fills it.
    #[inline(always)]
    pub(crate) fn free(raw: R) -> Self {
        Self::leaf(NO_VERTEX, raw)
    }

    /// The annex of the vertex in a slot.
    #[inline(always)]
    pub(crate) fn annex(owner: u32, raw: R) -> Self {
        Self { word: NO_VERTEX, raw, links: [Corner::of(owner), Corner::NONE] }
    }

    /// Becomes split, with this vertex slot.
    #[inline(always)]
    pub(crate) fn become_split(&mut self, slot: u32, level: u32) {
        self.word |= SPLIT;
        self.links = [Corner::of(slot), if level == 0 { Corner::of(slot) } else { Corner::NONE }];
    }

    /// Whether its triangles are split.
    #[inline(always)]
    pub(crate) fn is_split(&self) -> bool {
        self.word & SPLIT != 0
    }

    /// Whether the place holds a vertex.
    #[inline(always)]
    pub(crate) fn is_live(&self) -> bool {
        self.word & !STATUS != NO_VERTEX
    }

    /// The vertex slot of a split node.
    #[inline(always)]
    pub(crate) fn slot(&self) -> u32 {
        self.links[0].slot()
    }

    /// A vertex beside which it lies: of a leaf a parent, of a split node itself.
    #[inline(always)]
    pub(crate) fn anchor(&self) -> Corner {
        self.links[usize::from(self.links[0].is_none())]
    }

    /// The point and the level of a node that has a vertex. Without branches, because leaves and split nodes come in no order.
    #[inline(always)]
    pub(crate) fn place(&self, vertices: &Vertices) -> (GridPoint, u32) {
        let side = usize::from(self.links[0].is_none());
        let anchor = self.links[side];
        let own = vertices.point(anchor.slot());
        let level = level_of(own);
        let child = child_point(own, level, 2 * side + anchor.orientation());
        let is_split = self.is_split();
        (if is_split { own } else { child }, if is_split { level } else { level.wrapping_sub(1) })
    }
}

impl<R> Words for Vec<Node<R>> {
    #[inline(always)]
    fn word(&self, node: u32) -> u32 {
        self.get(node as usize).map_or(NO_VERTEX, |node| node.word & !SPLIT)
    }

    #[inline(always)]
    fn fetch(&self, node: u32) {
        prefetch(self, node as usize);
    }
}

/// The bin-tree array, and the rings that it leads to.
#[derive(Debug)]
pub(crate) struct Nodes<R> {
    pub all: Vec<Node<R>>,
    pub rings: Rings,
    /// Which places are taken, and which slots have changed.
    pub clusters: Clusters,
    /// Places that there can be: numbers of nodes stand in entries of the queue.
    most: usize,
}

/// Clusters that a split may take: it makes at most four children.
const CLUSTERS_A_SPLIT: usize = 4;

impl<R: Copy> Nodes<R> {
    pub(crate) fn new(clusters: Clusters) -> Self {
        Self { all: Vec::new(), rings: Rings::default(), clusters, most: 1 << NODE_BITS }
    }

    /// Whether there can be places up to this one.
    pub(crate) fn can_reach(&self, place: u32) -> bool {
        (place as usize) < self.most
    }

    /// Whether the children of one more split find places.
    #[inline(always)]
    pub(crate) fn have_room(&self) -> bool {
        self.clusters.places() + CLUSTERS_A_SPLIT * CLUSTER <= self.most
    }

    /// Has no more places than that.
    #[cfg(test)]
    pub(crate) fn limit(&mut self, most: usize) {
        self.most = most;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<Node<R>>() + self.rings.bytes() + self.clusters.bytes()
    }

    #[inline(always)]
    pub(crate) fn get(&self, node: u32) -> &Node<R> {
        &self.all[node as usize]
    }

    #[inline(always)]
    pub(crate) fn get_mut(&mut self, node: u32) -> &mut Node<R> {
        &mut self.all[node as usize]
    }

    /// The word at a place that may have been given up since, if it has a certificate on that clock.
    #[inline(always)]
    pub(crate) fn word_on(&mut self, clock: usize, node: u32) -> Option<&mut u32> {
        let word = &mut self.all.get_mut(node as usize)?.word;
        let has_expiry = (1..UNUSED_EXPIRY).contains(&expiry_of(*word));
        if has_expiry & (clock_of(*word) == clock) { Some(word) } else { None }
    }

    /// The same, if that is over when its clock has come to the tick that `until`, a word on this clock, has for its expiry.
    #[inline(always)]
    pub(crate) fn word_over(&mut self, node: u32, until: u32) -> Option<&mut u32> {
        self.word_on(clock_of(until), node).filter(|word| expiry_of(**word) <= expiry_of(until))
    }

    /// Whether the place holds a vertex. Lists of nodes may name places that have been given up since, beyond the array's end too.
    #[inline(always)]
    pub(crate) fn is_live(&self, node: u32) -> bool {
        self.all.get(node as usize).is_some_and(Node::is_live)
    }

    /// Whether the node waits for its record.
    #[inline(always)]
    pub(crate) fn is_unread(&self, node: u32) -> bool {
        self.all.get(node as usize).is_some_and(|node| node.word == UNREAD)
    }

    #[inline(always)]
    pub(crate) fn is_split(&self, node: u32) -> bool {
        self.get(node).is_split()
    }

    /// The parents of a node, by side.
    #[inline(always)]
    pub(crate) fn parents(&self, node: u32) -> [Corner; 2] {
        let node = self.get(node);
        if node.is_split() { self.rings.parents(node.slot()) } else { node.links }
    }

    /// The node of the vertex in a slot, which is no corner of the square.
    pub(crate) fn node_of(&self, slot: u32) -> u32 {
        let [first, second] = self.rings.parents(slot);
        let parent = if first.is_some() { first } else { second };
        // The centre alone has no parents.
        if parent.is_none() { CENTRE } else { self.rings.child(parent.slot(), parent.turn()) }
    }

    /// A new node beside another, without parents and certificate; `raw` stands in for its record until that is read.
    pub(crate) fn create(&mut self, beside: u32, raw: R) -> u32 {
        self.place(beside, Node::leaf(0, raw))
    }

    /// A new annex beside the node of the vertex in slot `owner`.
    pub(crate) fn create_annex(&mut self, beside: u32, owner: u32) -> u32 {
        self.place(beside, Node::annex(owner, self.get(beside).raw))
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
        shorten(&mut self.all);
    }

    /// Frees a node or an annex.
    pub(crate) fn free(&mut self, node: u32) {
        let freed = self.get_mut(node);
        (freed.word, freed.links) = (NO_VERTEX, [Corner::NONE; 2]);
        self.clusters.give_back(node);
    }

    /// What the two slots of a place show: triangles of vertex slots, counter-clockwise, apex first.
    #[inline]
    pub(crate) fn triangles(&self, node: u32) -> [Option<[u32; 3]>; 2] {
        [0, 1].map(|side| self.triangle(node, side))
    }

    /// What one slot of a place shows. With few branches, because no processor can predict what has changed.
    #[inline(always)]
    pub(crate) fn triangle(&self, node: u32, side: usize) -> Option<[u32; 3]> {
        let Node { word, links, .. } = self.get(node);
        let is_annex = *word & !STATUS == NO_VERTEX;
        let is_split = self.get(node).is_split();
        let own = is_annex | is_split;
        let corner = if own { links[0] } else { links[side] };
        // Above the finest level the children of a split node show its halves. Whatever is free has no owner.
        if corner.is_none() | (!is_annex & is_split & links[1].is_none()) {
            return None;
        }
        // A vertex of the finest level shows the first half of each side, and its annex the last.
        let half = if is_annex { 3 - 2 * side } else { 2 * side };
        let turn = if own { half } else { corner.turn() };
        let [p, q] = self.rings.edge(corner.slot(), turn);
        let has_some = !own | self.rings.corner(corner.slot(), 2 * side).is_some();
        has_some.then_some([corner.slot(), p, q])
    }
}
