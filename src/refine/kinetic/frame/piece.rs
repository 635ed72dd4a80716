//! What the passes of [`super::build`] leave behind for one another: a level's vertices, and a piece of its split ones.
//!
//! Invariant: numbers of children follow from the order of their parents. Cost: some sixty bytes a split vertex of a piece, eight a vertex of a level.

use crate::refine::kinetic::mesh::clusters::CLUSTER;
use crate::refine::kinetic::mesh::labels::orientation;
use crate::refine::kinetic::mesh::rings::{Corner, NONE, sharer_of, side_of};
use std::ops::Range;
use terrasoar_layout::grid::GridPoint;

/// Where nodes are put, one after another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Places {
    /// Nodes of a cluster.
    pub(super) fill: u32,
}

impl Places {
    /// The place of the node with a number.
    #[inline(always)]
    pub(super) fn place(self, number: u32) -> u32 {
        let cluster = CLUSTER as u32;
        if self.fill == cluster { number } else { number / self.fill * cluster + number % self.fill }
    }

    /// The number of the node at a place, if that takes one.
    #[inline(always)]
    pub(super) fn number(self, place: u32) -> Option<u32> {
        let within = place % CLUSTER as u32;
        (within < self.fill).then(|| place / CLUSTER as u32 * self.fill + within)
    }
}

/// A vertex that is split, as the passes over its piece need it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Parent<R> {
    pub(super) raw: R,
    pub(super) point: GridPoint,
    /// Its node's links as a leaf.
    pub(super) links: [Corner; 2],
    /// Ends of the edge that it splits.
    pub(super) ends: [u32; 2],
    /// Bit i: it makes the child that comes [i-th](order_of). Bit 4 + s: it has a triangle on side s.
    pub(super) makes: u8,
    /// By turn: which split vertex of the level shares that child, or [`NONE`].
    pub(super) sharers: [u32; 4],
    /// How many children those before it in the piece make.
    pub(super) before: u32,
}

impl<R> Parent<R> {
    /// Which of the piece's children is the one with this turn, which this vertex makes.
    #[inline(always)]
    pub(super) fn child(&self, turn: usize) -> u32 {
        self.before + (self.makes & ((1 << order_of(turn)) - 1)).count_ones()
    }

    /// Whether it makes the child with this turn.
    #[inline(always)]
    pub(super) fn makes(&self, turn: usize) -> bool {
        self.makes >> order_of(turn) & 1 == 1
    }

    /// The turn that a child with this turn has at the vertex which shares it.
    #[inline(always)]
    pub(super) fn turn_there(&self, turn: usize) -> usize {
        let (side, last) = side_of(turn);
        sharer_of(side, orientation(self.point), last).1
    }
}

/// When the child with a turn comes: children are made in the order of splits, the first and the last of side 0, then those of side 1. The turn of the child that comes then, too.
#[inline(always)]
pub(super) fn order_of(turn: usize) -> usize {
    (4 - turn) & 3
}

/// The vertices of a level.
#[derive(Debug, Default)]
pub(super) struct Line {
    pub(super) level: u32,
    /// Their places.
    pub(super) range: Range<u32>,
    /// Those that are split.
    pub(super) split: Vec<u32>,
    /// By place: which split vertex it is, or [`NONE`].
    pub(super) ranks: Vec<u32>,
}

impl Line {
    /// Goes on to the next level, whose vertices are yet to come.
    pub(super) fn start(&mut self, level: u32, at: u32) {
        (self.level, self.range) = (level, at..at);
        self.split.clear();
        self.ranks.clear();
    }

    #[inline(always)]
    pub(super) fn rank(&self, node: u32) -> u32 {
        self.ranks.get(node.wrapping_sub(self.range.start) as usize).copied().unwrap_or(NONE)
    }
}

/// Split vertices of a level, one after another, and their children.
pub(super) struct Piece<R> {
    /// Which split vertex of the level comes first.
    pub(super) start: usize,
    pub(super) parents: Vec<Parent<R>>,
    /// Children to be made: which parent of the piece makes it, times 4, and its turn there.
    pub(super) births: Vec<u32>,
    /// Their records and words.
    pub(super) verdicts: Vec<(R, u32)>,
    /// The vertex slot of the level's first split vertex.
    pub(super) base: u32,
    /// The number of the piece's first child, or annex.
    pub(super) next: u32,
    pub(super) places: Places,
}

impl<R> Piece<R> {
    /// Children, or annexes.
    pub(super) fn made(&self, level: u32) -> u32 {
        (if level == 0 { self.parents.len() } else { self.births.len() }) as u32
    }
}
