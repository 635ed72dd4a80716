//! A whole mesh at once, level by level, by many hands: the first one, and the one after a jump of the eye.
//!
//! Splits one by one would make the same mesh. But where nothing is there yet, all vertices of a level are known when those of the level above are: they are the children of its split
//! vertices. So a level is a few passes over arrays. Vertices that are to be split are numbered; their children are counted, numbered, made and tested; the split ones are told their
//! children. Each element is made from what the passes before have left, so that threads share a pass and no one waits for another.
//!
//! A child of two split vertices is made by the one that comes first. Numbers follow from the order of levels and of their parents: nodes, slots and words are those that splits one by one,
//! level by level, make where places are packed. Near places are dealt out in the same order, with room left in each cluster for those that come later; vertices that come
//! one after another in a level lie together on the ground.
//!
//! Invariant: afterwards all is as after splits one by one: `super::nodes` holds, each word is in a queue, and the patch tells every slot that shows something or has shown something before.
//! Cost: some fifty nanoseconds a node on one thread, a third of it for memory that is touched for the first time.

use super::clusters::{CLUSTER, Dealing};
use super::labels::{child_point, first_child, is_on_border, level_of, orientation};
use super::nodes::{CENTRE, NONE, NO_VERTEX, Node, SPLIT, STATUS, UNREAD, body};
use crate::refine::kinetic::frame::collect::enter;
use crate::refine::kinetic::frame::shown::Shown;
use crate::refine::kinetic::hands::{both, change, extend, extend_by, gather};
use crate::refine::kinetic::time::certificate::{ACTIVE, Judge, clock_of};
use crate::refine::kinetic::time::queue::Entry;
use crate::refine::kinetic::{Kinetic, MeshVertex, Patch};
use crate::refine::{Phase, Probe};
use std::ops::Range;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::read::store::{RawOf, RecordStore};

/// Nodes of a mesh that has only been planted: the centre and four roots.
const PLANTED: u32 = 5;
/// Children ahead whose record memory is asked for.
const FETCH_AHEAD: usize = 12;
/// Clusters that one thread takes at the least, to find their bounds.
const CLUSTERS_SHARE: usize = 16;
/// Nodes that are put into a near cluster, so that most of those that come later find room beside their parents.
const NEAR_FILL: u32 = CLUSTER as u32 * 7 / 8;

/// Where nodes are put, one after another.
#[derive(Debug, Clone, Copy)]
struct Places {
    /// Nodes of a cluster.
    fill: u32,
}

impl Places {
    /// The place of the node with a number.
    #[inline(always)]
    fn place(self, number: u32) -> u32 {
        number / self.fill * CLUSTER as u32 + number % self.fill
    }

    /// The number of the node at a place, if that takes one.
    #[inline(always)]
    fn number(self, place: u32) -> Option<u32> {
        let within = place % CLUSTER as u32;
        (within < self.fill).then(|| place / CLUSTER as u32 * self.fill + within)
    }
}

/// A vertex that is split, as the passes over its level need it.
#[derive(Debug, Clone, Copy)]
struct Parent<R> {
    node: u32,
    raw: R,
    point: GridPoint,
    /// The leaf's [`body`]: ends of the edge, and apexes.
    body: [u32; 4],
    /// By label: which split vertex of the level shares that child, or [`NONE`].
    sharers: [u32; 4],
    /// Bit l: it makes the child with label l. Bit 4 + s: it has a triangle on side s.
    makes: u8,
    /// How many children those before it make.
    first: u32,
}

impl<R> Parent<R> {
    /// Which of the level's children is the one with `label` that this vertex makes.
    #[inline(always)]
    fn child(&self, label: usize) -> u32 {
        self.first + (self.makes & ((1 << label) - 1)).count_ones()
    }

    /// Ends of the edge of the child with `label`, as its triangle of side 0 has them; side 0's first child has the label `first`.
    #[inline(always)]
    fn ends(&self, label: usize, first: usize) -> [u32; 2] {
        let [p, q, apex, other] = self.body;
        // First and last child of side 0, then of side 1, whose edge runs the other way.
        let [p, q] = match (label + 4 - first) & 3 {
            0 => [apex, p],
            3 => [q, apex],
            2 => [other, q],
            _ => [p, other],
        };
        if label >> 1 == 0 { [p, q] } else { [q, p] }
    }
}

/// What the passes over a level leave behind for one another.
struct Level<R> {
    /// Leaves that are selected.
    active: Vec<u32>,
    /// By place in the level: which split vertex it is, or [`NONE`].
    ranks: Vec<u32>,
    parents: Vec<Parent<R>>,
    /// Children to be made: which parent makes it, times 4, and its label there.
    births: Vec<u32>,
}

impl<S: RecordStore> Kinetic<S> {
    /// Makes the mesh for a view of one that has been planted in this frame.
    pub(crate) fn build<P: Probe>(&mut self, judge: &Judge, probe: &mut P) {
        probe.phase(Phase::Test);
        let fill =
            if self.nodes.clusters.dealing() == Dealing::Near { NEAR_FILL } else { CLUSTER as u32 };
        let places = Places { fill };
        self.fresh.clear();
        self.nodes.all.truncate(PLANTED as usize);
        let mut nodes = PLANTED;
        let mut range = 1..PLANTED;
        let side_steps = self.records.grid().side_steps();
        for node in range.clone() {
            let record = self.nodes.get(node);
            let (raw, word) = tested(&self.records, judge, record.point, record.raw);
            let is_split = word & ACTIVE != 0 && self.nodes.is_complete(node, side_steps);
            let record = self.nodes.get_mut(node);
            record.raw = raw;
            record.word = word | if is_split { SPLIT } else { 0 };
        }
        let mut level = level_of(self.nodes.get(1).point);
        let mut passes = Level { active: Vec::new(), ranks: Vec::new(), parents: Vec::new(), births: Vec::new() };
        loop {
            self.number_parents(&range, level, &mut passes);
            if passes.parents.is_empty() {
                break;
            }
            let base = self.place_vertices(&passes.parents, level);
            self.tell_parents(&range, level, base, places, nodes, &passes);
            let children = if level == 0 { passes.parents.len() } else { passes.births.len() } as u32;
            range = self.nodes.all.len() as u32..places.place(nodes + children - 1) + 1;
            self.make_children(judge, &range, level, base, places, nodes, &passes);
            nodes += children;
            if level == 0 || children == 0 {
                break;
            }
            level -= 1;
        }
        drop(passes);
        self.finish(nodes, places, probe);
    }

    /// Finds the leaves of a level that are to be split, numbers them and counts the children that they make.
    fn number_parents(&mut self, range: &Range<u32>, level: u32, passes: &mut Level<RawOf<S>>) {
        let all = &self.nodes.all;
        let from = range.start as usize;
        let active = &mut passes.active;
        active.clear();
        gather(active, range.len(), |part, list| {
            let nodes = all[from + part.start..from + part.end].iter().zip(range.start + part.start as u32..);
            list.extend(nodes.filter(|(node, _)| node.word & ACTIVE != 0).map(|(_, place)| place));
        });
        // Those whose other parent is not there wait for it, as in every frame.
        let waiting = &mut self.to_split[level as usize];
        active.retain(|node| {
            let is_split = all[*node as usize].word & SPLIT != 0;
            if !is_split {
                waiting.push(*node);
            }
            is_split
        });
        passes.ranks.clear();
        passes.ranks.resize(range.len(), NONE);
        for (rank, node) in active.iter().enumerate() {
            passes.ranks[(node - range.start) as usize] = rank as u32;
        }
        let (active, ranks) = (&*active, &passes.ranks);
        let rank_of = |node: u32| ranks.get(node.wrapping_sub(range.start) as usize).copied().unwrap_or(NONE);
        passes.parents.clear();
        extend(&mut passes.parents, active.len(), |rank| {
            let place = active[rank];
            let node = &all[place as usize];
            let [p, q, apex, other, ..] = node.body;
            let mut parent = Parent {
                node: place,
                raw: node.raw,
                point: node.point,
                body: [p, q, apex, other],
                sharers: [NONE; 4],
                makes: 0,
                first: 0,
            };
            for side in (0..2).filter(|side| node.parents[*side] != NONE) {
                parent.makes |= 16 << side;
                if level == 0 {
                    continue;
                }
                let own = 2 * side + orientation(node.point);
                let around = &all[node.parents[side] as usize].body;
                let first = first_child(own, level);
                // The neighbours around the parent share the children beside it.
                for (label, turn) in [(first, 3), ((first + 3) & 3, 1)] {
                    let sharer = rank_of(around[(own + turn) & 3]);
                    parent.sharers[label] = sharer;
                    parent.makes |= u8::from(sharer == NONE || sharer > rank as u32) << label;
                }
            }
            parent
        });
        passes.births.clear();
        for (rank, parent) in passes.parents.iter_mut().enumerate() {
            self.triangles += (parent.makes >> 4).count_ones() as usize;
            parent.first = passes.births.len() as u32;
            let mut labels = parent.makes & 15;
            while labels != 0 {
                passes.births.push((rank as u32) << 2 | labels.trailing_zeros());
                labels &= labels - 1;
            }
        }
        self.work.splits += passes.parents.len() as u64;
    }

    /// Gives the split vertices of a level their slots; tells the first one.
    fn place_vertices(&mut self, parents: &[Parent<RawOf<S>>], level: u32) -> u32 {
        let records = &self.records;
        let base = self.vertices.len();
        let sent = self.patch.vertices.len();
        extend(&mut self.patch.vertices, parents.len(), |rank| {
            let Parent { point, raw, body, .. } = parents[rank];
            let vertex = records.decode(raw, level);
            let ends = [body[body::P], body[body::Q]];
            (base + rank as u32, MeshVertex::of(records, point, &vertex, ends))
        });
        let sent = &self.patch.vertices[sent..];
        let is_void = |rank: usize| records.decode(parents[rank].raw, level).class.is_void();
        self.vertices.append(
            parents.len(),
            |rank| (parents[rank].point, sent[rank].1.height_m),
            |rank| records.shape().has_voids && is_void(rank),
        );
        base
    }

    /// Makes split nodes of the leaves of a level: their own vertices, and the places that their children will have.
    fn tell_parents(
        &mut self,
        range: &Range<u32>,
        level: u32,
        base: u32,
        places: Places,
        next: u32,
        passes: &Level<RawOf<S>>,
    ) {
        let Level { ranks, parents, .. } = passes;
        let leaves = &mut self.nodes.all[range.start as usize..range.end as usize];
        change(leaves, |start, part| {
            for (node, rank) in part.iter_mut().zip(&ranks[start..]).filter(|(_, rank)| **rank != NONE) {
                let parent = &parents[*rank as usize];
                node.body[body::HERE] = base + rank;
                if level == 0 {
                    node.body[body::ANNEX] = places.place(next + rank);
                    continue;
                }
                for (label, child) in node.body[..4].iter_mut().enumerate() {
                    let sharer = parent.sharers[label];
                    let number = if parent.makes >> label & 1 == 1 {
                        parent.child(label)
                    } else if sharer != NONE {
                        parents[sharer as usize].child((label + 2) & 3)
                    } else {
                        *child = NONE;
                        continue;
                    };
                    *child = places.place(next + number);
                }
            }
        });
    }

    /// Makes and tests the children of a level, or its annexes, at the places of `range`; the first one has the number `next`.
    #[expect(clippy::too_many_arguments, reason = "what a pass needs of the passes before it")]
    fn make_children(
        &mut self,
        judge: &Judge,
        range: &Range<u32>,
        level: u32,
        base: u32,
        places: Places,
        next: u32,
        passes: &Level<RawOf<S>>,
    ) {
        let Level { parents, births, .. } = passes;
        let records = &self.records;
        let (k, side_steps) = (records.grid().k(), records.grid().side_steps());
        let annex = |rank: usize| {
            let Parent { node, raw, .. } = parents[rank];
            Node { parents: [node, NONE], ..Node::free(raw) }
        };
        let point_of = |birth: u32| child_point(parents[birth as usize >> 2].point, level, birth as usize & 3);
        let child = |number: usize| {
            if let Some(later) = births.get(number + FETCH_AHEAD) {
                records.prefetch(slot_of(k, point_of(*later)));
            }
            let birth = births[number];
            let (rank, label) = (birth >> 2, birth as usize & 3);
            let parent = &parents[rank as usize];
            let point = point_of(birth);
            let (raw, word) = tested(records, judge, point, parent.raw);
            let own = orientation(parent.point);
            let [p, q] = parent.ends(label, first_child(own, level));
            let mut node = Node { word, raw, point, parents: [NONE; 2], body: [NONE; 6] };
            (node.body[body::P], node.body[body::Q]) = (p, q);
            let side = label >> 1;
            node.parents[side] = parent.node;
            node.body[body::APEX + side] = base + rank;
            let sharer = parent.sharers[label];
            if sharer != NONE {
                node.parents[1 - side] = parents[sharer as usize].node;
                node.body[body::APEX + 1 - side] = base + sharer;
            }
            if word & ACTIVE != 0 && (sharer != NONE || is_on_border(point, side_steps)) {
                node.word |= SPLIT;
            }
            node
        };
        let made = if level == 0 { parents.len() } else { births.len() };
        let nothing = Node::free(parents[0].raw);
        extend(&mut self.nodes.all, range.len(), |i| {
            match places.number(range.start + i as u32).and_then(|number| number.checked_sub(next)) {
                Some(number) if (number as usize) < made => {
                    if level == 0 { annex(number as usize) } else { child(number as usize) }
                }
                _ => nothing,
            }
        });
    }

    /// Brings clusters, queue and patch to the nodes that have been made.
    fn finish<P: Probe>(&mut self, nodes: u32, places: Places, probe: &mut P) {
        let raw = self.nodes.get(CENTRE).raw;
        let stale = self.nodes.clusters.fill(nodes as usize, places.fill as usize);
        self.nodes.all.resize(self.nodes.clusters.places(), Node::free(raw));
        probe.phase(Phase::Apply);
        let k = self.records.grid().k();
        let all = &self.nodes.all;
        for node in &all[1..] {
            if node.word & !STATUS != NO_VERTEX {
                self.work.tests += 1;
                if S::IS_COMPLETE || node.word != UNREAD {
                    probe.read(slot_of(k, node.point));
                }
            }
        }
        if !S::IS_COMPLETE {
            self.unread.extend((1..).zip(&all[1..]).filter(|(_, node)| node.word == UNREAD).map(|(place, _)| place));
        }
        let (queue, ahead) = (&mut self.queue, &mut self.ahead);
        let patch = &mut self.patch;
        let shown = Shown { records: &self.records, nodes: &self.nodes, vertices: &self.vertices };
        let mut bounds = Vec::new();
        if self.nodes.clusters.has_bounds() {
            extend_by(CLUSTERS_SHARE, &mut bounds, self.nodes.clusters.len(), |cluster| shown.bounds(cluster));
        }
        both(
            all.len(),
            || {
                for (place, node) in (1..).zip(&all[1..]) {
                    let word = node.word & !SPLIT;
                    if word != NO_VERTEX && word != UNREAD {
                        enter::<S>(queue, ahead, clock_of(word), Entry { node: place, word });
                    }
                }
            },
            || list_slots(patch, &shown, stale),
        );
        for (cluster, bounds) in bounds.into_iter().enumerate() {
            self.nodes.clusters.set_bounds(cluster, bounds);
        }
    }
}

/// Lists all slots that show something, and those among `stale` that do not.
fn list_slots<S: RecordStore>(patch: &mut Patch, shown: &Shown<'_, S>, stale: usize) {
    let all = &shown.nodes.all;
    let mut slots = Vec::new();
    gather(&mut slots, all.len(), |part, list: &mut Vec<u32>| {
        for place in part {
            let shows = shown.nodes.triangles(place as u32);
            for (side, corners) in shows.into_iter().enumerate() {
                let slot = 2 * place + side;
                if corners.is_some() || slot < stale {
                    list.push(slot as u32);
                }
            }
        }
    });
    extend(&mut patch.triangles, slots.len(), |i| {
        let slot = slots[i];
        (slot, shown.corners(slot / 2, shown.nodes.triangles(slot / 2)[slot as usize & 1]))
    });
}

/// The record at a point and its word; `raw` stands in for a record that is away.
#[inline(always)]
fn tested<S: RecordStore>(records: &S, judge: &Judge, point: GridPoint, raw: RawOf<S>) -> (RawOf<S>, u32) {
    let Some(raw) = records.get(slot_of(records.grid().k(), point)) else { return (raw, UNREAD) };
    let vertex = records.decode(raw, level_of(point));
    (raw, judge.word(&judge.metric().sight(records.grid().position_m(point), &vertex)))
}
