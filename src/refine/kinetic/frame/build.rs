//! A whole mesh at once, level by level, by many hands: the first one, and the one after a jump of the eye.
//!
//! Splits one by one would make the same mesh. But where nothing is there yet, all vertices of a level are known when those of the level above are: they are the children of its split
//! vertices. So a level is a few passes over arrays, piece by piece so that a piece stays in the cache. Vertices that are to be split are numbered; their children are counted, numbered, made and
//! tested; the split ones are told their children; words of the children go into the queue, and those that stay leaves into the patch. Each element is made from what the passes before have left,
//! so that threads share a pass and no one waits for another.
//!
//! A child of two split vertices is made by the one that comes first. Numbers follow from the order of levels and of their parents: nodes, slots and words are those that splits one by one,
//! level by level, make where places are packed. Near places are dealt out in the same order, with room left in each cluster for those that come later; vertices that come
//! one after another in a level lie together on the ground.
//!
//! Invariant: afterwards all is as after splits one by one: `super::super::mesh::nodes` holds, each word is in a queue, and the patch tells every slot that shows something or has shown something before.
//! Cost: some fifty nanoseconds a node on one thread, a third of it for memory that is touched for the first time.

use super::piece::{Line, Parent, Piece, Places, order_of};
use crate::refine::Phase;
use crate::refine::kinetic::capacity::grow;
use crate::refine::kinetic::frame::collect::enter;
use crate::refine::kinetic::frame::shown::Shown;
use crate::refine::kinetic::hands::{both, change, extend, extend_by, extend_parts, gather};
use crate::refine::kinetic::mesh::clusters::{CLUSTER, Dealing};
use crate::refine::kinetic::mesh::labels::{child_point, is_on_border, level_of, orientation};
use crate::refine::kinetic::mesh::nodes::{CENTRE, Node, SPLIT, UNREAD};
use crate::refine::kinetic::mesh::rings::{Corner, NONE, Ring, TURNS, label_of};
use crate::refine::kinetic::time::certificate::batch::{BATCH, Batch};
use crate::refine::kinetic::time::certificate::{ACTIVE, Judge, clock_of};
use crate::refine::kinetic::time::queue::Entry;
use crate::refine::kinetic::{Kinetic, MeshVertex, Patch};
use crate::refine::listener::Listener;
use std::ops::Range;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::order::slot_of;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::store::{RawOf, RecordStore};

/// Nodes of a mesh that has only been planted: the centre and four roots.
const PLANTED: u32 = 5;
/// Split vertices of a piece.
const PIECE: usize = 1 << 14;
/// Split vertices ahead whose parents memory is asked for.
const PARENTS_AHEAD: usize = 8;
/// Clusters that one thread takes at the least, to find their bounds.
const CLUSTERS_SHARE: usize = 16;
/// Nodes that are put into a near cluster, so that most of those that come later find room beside their parents.
const NEAR_FILL: u32 = CLUSTER as u32 * 7 / 8;

impl<S: RecordStore> Kinetic<S> {
    /// Makes the mesh for a view of one that has been planted in this frame.
    pub(crate) fn build(&mut self, judge: &Judge, probe: &mut Listener<'_>) {
        probe.phase(Phase::Test);
        let fill = if self.nodes.clusters.dealing() == Dealing::Near { NEAR_FILL } else { CLUSTER as u32 };
        let places = Places { fill };
        let stale = self.nodes.clusters.stale_slots();
        self.fresh.clear();
        self.nodes.all.truncate(PLANTED as usize);
        let level = level_of(self.point_of(1));
        self.test_roots(judge);
        let mut nodes = PLANTED;
        let (mut line, mut below) = (Line::default(), Line::default());
        line.start(level, 1);
        self.list_slots(0..1, stale);
        self.survey(1..PLANTED, &mut line, 1, stale);
        let (parents, births, verdicts) = (Vec::new(), Vec::new(), Vec::new());
        let mut piece = Piece { start: 0, parents, births, verdicts, base: 0, next: 0, places };
        while !line.split.is_empty() {
            let most_children = 4 * line.split.len() as u32;
            let has_places = self.nodes.can_reach(places.place(nodes + most_children));
            if !has_places || !self.vertices.have_room(line.split.len()) {
                self.leave(&mut line, stale);
                break;
            }
            let at = self.nodes.all.len() as u32;
            below.start(line.level.saturating_sub(1), at);
            piece.base = self.vertices.len();
            for start in (0..line.split.len()).step_by(PIECE) {
                (piece.start, piece.next) = (start, nodes);
                self.number(&line, &mut piece);
                self.place_vertices(&line, &piece);
                nodes += piece.made(line.level);
                let children = self.nodes.all.len() as u32..places.place(nodes - 1) + 1;
                self.judge_children(judge, &line, &mut piece);
                self.make_children(&children, &line, &piece);
                self.tell_parents(&line, &piece);
                if line.level > 0 {
                    // Corners of children may be vertices of later pieces: what slots show is listed behind the last.
                    let is_last = start + PIECE >= line.split.len();
                    let first = if is_last { below.range.start } else { children.end };
                    self.survey(children, &mut below, first, stale);
                }
            }
            if line.level == 0 {
                break;
            }
            std::mem::swap(&mut line, &mut below);
        }
        drop((piece, below));
        if line.level == 0 {
            self.list_slots(line.range.start as usize..self.nodes.all.len(), stale);
        }
        self.finish(nodes, fill, stale);
        probe.phase(Phase::Apply);
        if !probe.hears_reads() {
            return;
        }
        let k = self.records.grid().k();
        for node in self.nodes.all[1..].iter().filter(|node| node.is_live() && node.word != UNREAD) {
            probe.read(slot_of(k, node.place(&self.vertices).0));
        }
    }

    fn test_roots(&mut self, judge: &Judge) {
        let side_steps = self.records.grid().side_steps();
        for node in 1..PLANTED {
            let point = self.point_of(node);
            let slot = slot_of(self.records.grid().k(), point);
            let Some(raw) = self.records.get(slot) else {
                self.nodes.get_mut(node).word = UNREAD;
                continue;
            };
            let word = self.word_of(judge, point, raw);
            let is_whole = !self.nodes.get(node).links.contains(&Corner::NONE);
            let is_split = word & ACTIVE != 0 && (is_whole || is_on_border(point, side_steps));
            let record = self.nodes.get_mut(node);
            record.raw = raw;
            record.word = word | if is_split { SPLIT } else { 0 };
        }
    }

    /// The word of a vertex.
    #[inline(always)]
    fn word_of(&self, judge: &Judge, point: GridPoint, raw: RawOf<S>) -> u32 {
        let vertex = self.records.decode(raw, level_of(point));
        judge.word(&judge.metric().sight(self.records.grid().position_m(point), &vertex))
    }

    /// Takes new vertices into their level: those that are split are listed, words go into the queue, leaves from the place `first` on into the patch. At the finest level slots wait until split
    /// vertices have their own.
    fn survey(&mut self, range: Range<u32>, line: &mut Line, first: u32, stale: usize) {
        let all = &self.nodes.all;
        let from = range.start as usize;
        let known = line.split.len();
        gather(&mut line.split, range.len(), |part, list| {
            let nodes = all[from + part.start..from + part.end].iter().zip(range.start + part.start as u32..);
            list.extend(nodes.filter(|(node, _)| node.word & ACTIVE != 0).map(|(_, place)| place));
        });
        // Those whose other parent is not there wait for it, as in every frame.
        let is_split = |place: &u32| all[*place as usize].word & SPLIT != 0;
        if !line.split[known..].iter().all(is_split) {
            let active = line.split.split_off(known);
            for place in active {
                let list =
                    if is_split(&place) { &mut line.split } else { &mut self.to_split[line.level as usize] };
                list.push(place);
            }
        }
        line.range.end = range.end;
        line.ranks.resize(line.range.len(), NONE);
        for (place, rank) in line.split[known..].iter().zip(known as u32..) {
            line.ranks[(place - line.range.start) as usize] = rank;
        }
        let (queue, ahead, unread) = (&mut self.queue, &mut self.ahead, &mut self.unread);
        let shown = Shown { records: &self.records, nodes: &self.nodes, vertices: &self.vertices };
        let patch = &mut self.patch;
        let vertices = &mut self.work.tests;
        let enter_words = || {
            for (node, place) in all[from..range.end as usize].iter().zip(range.clone()) {
                let word = node.word & !SPLIT;
                if !node.is_live() {
                    continue;
                }
                *vertices += 1;
                if !S::IS_COMPLETE && word == UNREAD {
                    unread.push(place);
                } else {
                    enter::<S>(queue, ahead, clock_of(word), Entry { node: place, word });
                }
            }
        };
        let slots = if line.level > 0 { first as usize..range.end as usize } else { 0..0 };
        // Split ones have no rings yet, and will show nothing.
        both(range.len(), enter_words, || list_slots(patch, &shown, slots, stale, false));
    }

    /// Leaves a level unsplit for which there are not slots enough; splits one by one take those that are left in the next frame.
    fn leave(&mut self, line: &mut Line, stale: usize) {
        for place in line.split.drain(..) {
            self.nodes.get_mut(place).word &= !SPLIT;
            self.to_split[line.level as usize].push(place);
            if line.level > 0 {
                self.list_slots(place as usize..place as usize + 1, stale);
            }
        }
    }

    /// Numbers the children of split vertices of a level, from `piece.start` on.
    fn number(&mut self, line: &Line, piece: &mut Piece<RawOf<S>>) {
        let Piece { start, parents, births, .. } = piece;
        let (all, rings) = (&self.nodes.all, &self.nodes.rings);
        parents.clear();
        extend(parents, PIECE.min(line.split.len() - *start), |i| {
            let (rank, place) = ((*start + i) as u32, line.split[*start + i]);
            if let Some(later) = line.split.get(rank as usize + PARENTS_AHEAD) {
                all[*later as usize].links.iter().for_each(|parent| rings.fetch(*parent));
            }
            let node = &all[place as usize];
            let links = node.links;
            let ends = rings.edge_of(links);
            // What the node will be is a vertex at the point of a leaf.
            let point = Node { word: 0, ..*node }.place(&self.vertices).0;
            let mut parent =
                Parent { raw: node.raw, point, links, ends, makes: 0, sharers: [NONE; 4], before: 0 };
            for side in (0..2).filter(|side| links[*side].is_some()) {
                parent.makes |= 16 << side;
                if line.level == 0 {
                    continue;
                }
                // The neighbours around the parent share the children beside it.
                for (turn, step) in TURNS[side].into_iter().zip([3, 1]) {
                    let sharer = line.rank(rings.child(links[side].slot(), links[side].turn() + step));
                    parent.sharers[turn] = sharer;
                    parent.makes |= u8::from(sharer == NONE || sharer > rank) << order_of(turn);
                }
            }
            parent
        });
        births.clear();
        for (i, parent) in parents.iter_mut().enumerate() {
            self.triangles += (parent.makes >> 4).count_ones() as usize;
            parent.before = births.len() as u32;
            let mut turns = parent.makes & 15;
            while turns != 0 {
                births.push((i as u32) << 2 | order_of(turns.trailing_zeros() as usize) as u32);
                turns &= turns - 1;
            }
        }
        self.work.splits += parents.len() as u64;
    }

    /// Gives split vertices their slots.
    fn place_vertices(&mut self, line: &Line, piece: &Piece<RawOf<S>>) {
        let (records, parents) = (&self.records, &piece.parents);
        let here = piece.base + piece.start as u32;
        let sent = self.patch.vertices.len();
        extend(&mut self.patch.vertices, parents.len(), |i| {
            let Parent { point, raw, ends, .. } = parents[i];
            let vertex = records.decode(raw, line.level);
            (here + i as u32, MeshVertex::of(records, point, &vertex, ends))
        });
        let sent = &self.patch.vertices[sent..];
        let is_void = |i: usize| records.decode(parents[i].raw, line.level).class.is_void();
        self.vertices.append(
            parents.len(),
            |i| (parents[i].point, records.shape().has_voids && is_void(i)),
            |i| sent[i].1.height_m,
        );
    }

    /// Makes split nodes of leaves: they have their own vertices, whose rings have the places of their children.
    fn tell_parents(&mut self, line: &Line, piece: &Piece<RawOf<S>>) {
        let Piece { start, parents, base, next, places, .. } = piece;
        if parents.is_empty() {
            return;
        }
        let range = line.split[*start] as usize..line.split[start + parents.len() - 1] as usize + 1;
        let ranks = &line.ranks[range.start - line.range.start as usize..];
        change(&mut self.nodes.all[range], |at, part| {
            for (node, rank) in part.iter_mut().zip(&ranks[at..]).filter(|(_, rank)| **rank != NONE) {
                node.become_split(base + rank, line.level);
            }
        });
        self.nodes.rings.append(parents.len(), |i, children_before| {
            let parent = &parents[i];
            let mut ring = Ring::new(parent.links, parent.ends);
            if line.level == 0 {
                ring.children[0] = places.place(next + i as u32);
                return ring;
            }
            for (turn, child) in ring.children.iter_mut().enumerate() {
                let sharer = parent.sharers[turn];
                let turn_there = parent.turn_there(turn);
                *child = if parent.makes(turn) {
                    places.place(next + parent.child(turn))
                } else if sharer == NONE {
                    NONE
                } else if let Some(i) = (sharer as usize).checked_sub(*start) {
                    places.place(next + parents[i].child(turn_there))
                } else {
                    children_before(base + sharer)[turn_there]
                };
            }
            ring
        });
    }

    /// Reads the records of a piece's children, and tests them.
    fn judge_children(&self, judge: &Judge, line: &Line, piece: &mut Piece<RawOf<S>>) {
        let Piece { parents, births, verdicts, .. } = piece;
        let (level, k) = (line.level, self.records.grid().k());
        verdicts.clear();
        if level == 0 {
            return;
        }
        let point_of = |birth: u32| {
            let Parent { point, .. } = parents[birth as usize >> 2];
            child_point(point, level, label_of(birth as usize & 3, orientation(point), level))
        };
        extend_parts(verdicts, births.len(), (S::Codec::INERT, UNREAD), |at, part| {
            let mut batch = Batch::default();
            for (i, verdicts) in part.chunks_mut(BATCH).enumerate() {
                let first = at + i * BATCH;
                let mut places = [(GridPoint::default(), level - 1); BATCH];
                for (i, (point, _)) in places[..verdicts.len()].iter_mut().enumerate() {
                    *point = point_of(births[first + i]);
                    self.records.prefetch(slot_of(k, *point));
                }
                self.judge_batch(
                    &mut batch,
                    &places[..verdicts.len()],
                    |i| self.records.get(slot_of(k, places[i].0)),
                    judge,
                    verdicts,
                );
            }
        });
    }

    /// Makes the children of a piece, or its annexes, at the places of `range`.
    fn make_children(&mut self, range: &Range<u32>, line: &Line, piece: &Piece<RawOf<S>>) {
        let Piece { start, parents, births, verdicts, base, next, places } = piece;
        let (level, side_steps) = (line.level, self.records.grid().side_steps());
        let here = base + *start as u32;
        let child = |number: usize| {
            let (birth, (raw, word)) = (births[number], verdicts[number]);
            let (i, turn) = (birth >> 2, birth as usize & 3);
            let parent = &parents[i as usize];
            let turned = orientation(parent.point);
            let label = label_of(turn, turned, level);
            let mut node = Node::leaf(word, raw);
            let side = label >> 1;
            node.links[side] = Corner::parent(here + i, turn, label);
            let sharer = parent.sharers[turn];
            if sharer != NONE {
                node.links[1 - side] = Corner::parent(base + sharer, parent.turn_there(turn), label);
            }
            if word & ACTIVE != 0
                && (sharer != NONE || is_on_border(child_point(parent.point, level, label), side_steps))
            {
                node.word |= SPLIT;
            }
            node
        };
        let made = piece.made(level);
        let nothing = Node::free(parents[0].raw);
        extend(&mut self.nodes.all, range.len(), |i| {
            match places.number(range.start + i as u32).and_then(|number| number.checked_sub(*next)) {
                Some(number) if number < made && level == 0 => {
                    Node::annex(here + number, parents[number as usize].raw)
                }
                Some(number) if number < made => child(number as usize),
                _ => nothing,
            }
        });
    }

    /// Lists what the slots of some places show.
    fn list_slots(&mut self, range: Range<usize>, stale: usize) {
        let shown = Shown { records: &self.records, nodes: &self.nodes, vertices: &self.vertices };
        list_slots(&mut self.patch, &shown, range, stale, true);
    }

    /// Brings the clusters to the nodes that have been made.
    fn finish(&mut self, nodes: u32, fill: u32, stale: usize) {
        let made = self.nodes.all.len();
        let free = Node::free(self.nodes.get(CENTRE).raw);
        self.nodes.clusters.fill(nodes as usize, fill as usize);
        self.nodes.all.resize(self.nodes.clusters.places(), free);
        self.list_slots(made..self.nodes.all.len(), stale);
        if self.nodes.clusters.has_bounds() {
            let mut bounds = Vec::new();
            let shown = Shown { records: &self.records, nodes: &self.nodes, vertices: &self.vertices };
            extend_by(CLUSTERS_SHARE, &mut bounds, self.nodes.clusters.len(), |cluster| {
                shown.bounds(cluster)
            });
            for (cluster, bounds) in bounds.into_iter().enumerate() {
                self.nodes.clusters.set_bounds(cluster, bounds);
            }
        }
    }
}

/// Lists the slots of places that show something, and those below `stale` that do not. Split nodes show something if they `have_rings`.
fn list_slots<S: RecordStore>(
    patch: &mut Patch,
    shown: &Shown<'_, S>,
    places: Range<usize>,
    stale: usize,
    have_rings: bool,
) {
    grow(&mut patch.triangles, 2 * places.len());
    gather(&mut patch.triangles, places.len(), |part, list| {
        for place in places.start + part.start..places.start + part.end {
            let shows = have_rings || !shown.nodes.is_split(place as u32);
            let both = if shows { shown.nodes.triangles(place as u32) } else { [None; 2] };
            for (side, corners) in both.into_iter().enumerate() {
                let slot = 2 * place + side;
                if corners.is_some() || slot < stale {
                    list.push((slot as u32, shown.corners(place as u32, corners)));
                }
            }
        }
    });
}
