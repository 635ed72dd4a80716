//! Places in the bin-tree array and its triangle slots, given out in clusters of [`CLUSTER`] nodes.
//!
//! Culling works on clusters too: the slots of a cluster's triangles are one range, and a cluster has bounds. There are two ways of giving out places.
//! *Packed* fills any cluster that has room, so that the array is as short as possible. *Near* puts a child into its parent's cluster, or, when that is full, into
//! the one that continues it, so that a cluster's triangles lie together on the ground.
//!
//! Invariant: a cluster's bounds contain all triangles that its slots show. Cost: a few bit operations a node.

use super::bounds::{Bounds, BoundsColumns};
use crate::metric::{BoxPlane, PLANES};
use crate::refine::kinetic::capacity::settle;
use std::ops::Range;

/// Nodes of a cluster.
pub(crate) const CLUSTER: usize = 128;
/// No cluster.
const NONE: u32 = u32::MAX;

/// A cache line. How many places are taken stands beside the bits, because a processor waits where many bytes are read at once that were written one by one.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
struct Cluster {
    /// Bit i % 64 of word i / 64: place i is taken.
    taken: [u64; 2],
    /// The same of slots: slot i has changed.
    written: [u64; 4],
    /// Where children go when this cluster is full, and which use of that cluster is meant.
    spill: (u32, u32),
    /// How often the cluster has been emptied.
    use_count: u32,
    /// Places taken.
    used: u16,
}

impl Cluster {
    fn is_full(&self) -> bool {
        usize::from(self.used) == CLUSTER
    }

    fn is_empty(&self) -> bool {
        self.used == 0
    }

    /// Whether a slot has changed.
    fn is_written(&self) -> bool {
        self.written != [0; 4]
    }
}

/// How places are dealt out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Dealing {
    Packed,
    Near,
}

/// The clusters of one array.
#[derive(Debug)]
pub(crate) struct Clusters {
    dealing: Dealing,
    clusters: Vec<Cluster>,
    /// Bounds of each cluster.
    bounds: BoundsColumns,
    /// Packed: bit c % 64 of word c / 64: cluster c has room.
    open: Vec<u64>,
    /// Packed: no word before this one has a bit.
    first_open: usize,
    /// Near: empty clusters. May hold others as well.
    empty: Vec<u32>,
    /// Slots that have changed, each once.
    written: Vec<u32>,
    /// Clusters that are not there, of whose slots receivers of patches still have what a mesh before this one showed.
    stale: Range<usize>,
    taken: usize,
}

impl Clusters {
    pub(crate) fn new(dealing: Dealing) -> Self {
        Self {
            dealing,
            clusters: Vec::new(),
            bounds: BoundsColumns::default(),
            open: Vec::new(),
            first_open: 0,
            empty: Vec::new(),
            written: Vec::new(),
            stale: 0..0,
            taken: 0,
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.clusters.capacity() * size_of::<Cluster>()
            + self.bounds.bytes()
            + self.open.capacity() * size_of::<u64>()
            + (self.empty.capacity() + self.written.capacity()) * size_of::<u32>()
    }

    /// Places in all clusters.
    pub(crate) fn places(&self) -> usize {
        self.clusters.len() * CLUSTER
    }

    /// Places taken.
    pub(crate) fn taken(&self) -> usize {
        self.taken
    }

    /// Takes a place: anywhere, or beside the place `beside`.
    pub(crate) fn take(&mut self, beside: u32) -> u32 {
        let cluster = match self.dealing {
            Dealing::Packed => self.cluster_with_room(),
            Dealing::Near => self.cluster_near(beside as usize / CLUSTER),
        };
        self.take_in(cluster)
    }

    /// Takes a place in the cluster of the place `beside`, if it has room and is not cluster `other`.
    pub(crate) fn take_in_cluster_of(&mut self, beside: u32, other: usize) -> Option<u32> {
        let cluster = beside as usize / CLUSTER;
        (cluster != other && !self.clusters.get(cluster)?.is_full()).then(|| self.take_in(cluster))
    }

    fn take_in(&mut self, cluster: usize) -> u32 {
        let present = &mut self.clusters[cluster];
        let word = usize::from(present.taken[0] == u64::MAX);
        let place = (!present.taken[word]).trailing_zeros();
        present.taken[word] |= 1 << place;
        present.used += 1;
        if present.is_full() {
            self.open[cluster / 64] &= !(1 << (cluster % 64));
        }
        self.taken += 1;
        (cluster * CLUSTER + 64 * word) as u32 + place
    }

    /// The first cluster with room.
    fn cluster_with_room(&mut self) -> usize {
        while let Some(open) = self.open.get(self.first_open) {
            if *open != 0 {
                return 64 * self.first_open + open.trailing_zeros() as usize;
            }
            self.first_open += 1;
        }
        let cluster = self.new_cluster();
        self.first_open = cluster / 64;
        cluster
    }

    fn cluster_near(&mut self, cluster: usize) -> usize {
        let Some(present) = self.clusters.get(cluster).copied() else { return self.new_cluster() };
        let (spill, use_count) = present.spill;
        if !present.is_full() {
            return cluster;
        }
        if let Some(other) = self.clusters.get(spill as usize)
            && other.use_count == use_count
            && !other.is_full()
        {
            return spill as usize;
        }
        let other = self.empty_cluster();
        self.clusters[cluster].spill = (other as u32, self.clusters[other].use_count);
        other
    }

    fn empty_cluster(&mut self) -> usize {
        while let Some(cluster) = self.empty.pop() {
            if self.clusters.get(cluster as usize).is_some_and(Cluster::is_empty) {
                return cluster as usize;
            }
        }
        self.new_cluster()
    }

    fn new_cluster(&mut self) -> usize {
        let cluster = self.clusters.len();
        let is_stale = self.stale.contains(&cluster);
        let written = if is_stale { [u64::MAX; 4] } else { [0; 4] };
        if is_stale {
            self.stale.start = cluster + 1;
            let slots = 2 * CLUSTER;
            self.written.extend((cluster * slots) as u32..((cluster + 1) * slots) as u32);
        }
        self.clusters.push(Cluster { taken: [0; 2], written, spill: (NONE, 0), use_count: 0, used: 0 });
        if self.has_bounds() {
            self.bounds.push_empty();
        }
        self.open.resize(cluster / 64 + 1, 0);
        self.open[cluster / 64] |= 1 << (cluster % 64);
        cluster
    }

    /// Gives all places back. What slots have shown is told again as clusters are taken.
    pub(crate) fn clear(&mut self) {
        self.stale = 0..self.stale.end.max(self.clusters.len());
        self.empty_lists();
    }

    fn empty_lists(&mut self) {
        self.clusters.clear();
        self.bounds.clear();
        self.open.clear();
        self.empty.clear();
        self.written.clear();
        (self.first_open, self.taken) = (0, 0);
    }

    /// How many slots may have shown something before all places were given back.
    pub(crate) fn stale_slots(&self) -> usize {
        2 * CLUSTER * self.stale.end
    }

    /// Takes so many places, `fill` in each cluster, in the place of all that were taken. No slot is noted: all are to be told.
    pub(crate) fn fill(&mut self, nodes: usize, fill: usize) {
        self.empty_lists();
        for cluster in 0..nodes.div_ceil(fill) {
            self.new_cluster();
            let taken = (nodes - cluster * fill).min(fill);
            let filled = &mut self.clusters[cluster];
            filled.taken = [0, 64].map(|from| {
                u64::MAX.checked_shr(64 - taken.saturating_sub(from).min(64) as u32).unwrap_or(0)
            });
            filled.used = taken as u16;
            filled.written = [0; 4];
            if filled.is_full() {
                self.open[cluster / 64] &= !(1 << (cluster % 64));
            }
        }
        self.written.clear();
        self.taken = nodes;
    }

    /// Gives a place back.
    pub(crate) fn give_back(&mut self, place: u32) {
        let index = place as usize / CLUSTER;
        let cluster = &mut self.clusters[index];
        cluster.taken[place as usize / 64 % 2] &= !(1 << (place % 64));
        cluster.used -= 1;
        let is_empty = cluster.is_empty();
        if is_empty {
            cluster.use_count = cluster.use_count.wrapping_add(1);
        }
        self.open[index / 64] |= 1 << (index % 64);
        self.taken -= 1;
        if is_empty && self.has_bounds() {
            self.bounds.set(index, Bounds::EMPTY);
        }
        if self.dealing == Dealing::Packed {
            self.first_open = self.first_open.min(index / 64);
        } else if is_empty {
            self.empty.push(index as u32);
        }
    }

    /// Gives up empty clusters at the end whose slots have been told; whether there were any.
    pub(crate) fn give_up_empty_end(&mut self) -> bool {
        let before = self.clusters.len();
        while self.clusters.last().is_some_and(|cluster| cluster.is_empty() && !cluster.is_written()) {
            self.clusters.pop();
            self.bounds.pop();
            let cluster = self.clusters.len();
            self.open[cluster / 64] &= !(1 << (cluster % 64));
        }
        self.open.truncate(self.clusters.len().div_ceil(64));
        self.clusters.len() < before
    }

    /// Notes that the slot of a place's side shows something else now.
    #[inline(always)]
    pub(crate) fn touch(&mut self, place: u32, side: usize) {
        let slot = 2 * place + side as u32;
        let word = &mut self.clusters[place as usize / CLUSTER].written[slot as usize / 64 % 4];
        if *word >> (slot % 64) & 1 == 0 {
            *word |= 1 << (slot % 64);
            self.written.push(slot);
        }
    }

    /// Hands out the slots that have changed, as places and sides, in the order in which they changed first.
    pub(crate) fn take_written(&mut self, mut each: impl FnMut(u32, usize)) {
        for slot in self.written.drain(..) {
            // All others of the word are in the list as well.
            self.clusters[slot as usize / (2 * CLUSTER)].written[slot as usize / 64 % 4] = 0;
            each(slot / 2, slot as usize % 2);
        }
    }

    /// Gives memory back that a frame which changed `used` slots has no need of.
    pub(crate) fn settle(&mut self, used: usize, unused: usize) {
        settle(&mut self.written, used, unused);
    }

    /// How places are dealt out.
    pub(crate) fn dealing(&self) -> Dealing {
        self.dealing
    }

    /// Whether bounds are kept: packed clusters lie anywhere.
    #[inline(always)]
    pub(crate) fn has_bounds(&self) -> bool {
        self.dealing == Dealing::Near
    }

    /// Widens the bounds of a place's cluster.
    #[inline(always)]
    pub(crate) fn cover(&mut self, place: u32, points: &[[f32; 3]]) {
        let cluster = place as usize / CLUSTER;
        let mut bounds = self.bounds.get(cluster);
        points.iter().for_each(|p| bounds.include(*p));
        self.bounds.set(cluster, bounds);
    }

    /// Sets the bounds of a cluster.
    pub(crate) fn set_bounds(&mut self, cluster: usize, bounds: Bounds) {
        self.bounds.set(cluster, bounds);
    }

    /// Number of clusters.
    pub(crate) fn len(&self) -> usize {
        self.clusters.len()
    }

    /// Places taken in a cluster.
    pub(crate) fn places_of(&self, cluster: usize) -> impl Iterator<Item = u32> + use<> {
        let taken = self.clusters[cluster].taken;
        (0..CLUSTER)
            .filter(move |place| taken[place / 64] >> (place % 64) & 1 == 1)
            .map(move |place| (cluster * CLUSTER + place) as u32)
    }

    /// Bounds and triangle slots of every cluster that is in use.
    pub(crate) fn clusters(&self) -> impl Iterator<Item = (Bounds, Range<u32>)> {
        let used = self.clusters.iter().enumerate().filter(|(_, cluster)| !cluster.is_empty());
        let bounds = |index| if self.has_bounds() { self.bounds.get(index) } else { Bounds::EMPTY };
        used.map(move |(index, cluster)| (bounds(index), slots_of(index, cluster)))
    }

    /// Calls `draw` with the triangle slots of every cluster that is in use and may be seen.
    pub(crate) fn cull(&mut self, planes: &[BoxPlane; PLANES], mut draw: impl FnMut(Range<u32>)) {
        let is_seen = self.bounds.cull(planes);
        for (index, cluster) in self.clusters.iter().enumerate() {
            if !cluster.is_empty() && is_seen(index) {
                draw(slots_of(index, cluster));
            }
        }
    }
}

/// The triangle slots from a cluster's first place taken to its last.
fn slots_of(index: usize, cluster: &Cluster) -> Range<u32> {
    let first = (index * CLUSTER) as u32;
    let [low, high] = cluster.taken;
    let from = if low != 0 { low.trailing_zeros() } else { 64 + high.trailing_zeros() };
    let to = if high != 0 { 128 - high.leading_zeros() } else { 64 - low.leading_zeros() };
    2 * (first + from)..2 * (first + to)
}
