//! Places in the bin-tree array and its triangle slots, given out in clusters of [`CLUSTER`] nodes.
//!
//! Culling works on clusters too: the slots of a cluster's triangles are one range, and a cluster has bounds. There are two ways of giving out places.
//! *Packed* fills any cluster that has room, so that the array is as short as possible. *Near* puts a child into its parent's cluster, or, when that is full, into
//! the one that continues it, so that a cluster's triangles lie together on the ground.
//!
//! Invariant: a cluster's bounds contain all triangles that its slots show. Cost: a few bit operations a node.

use super::bounds::{Bounds, BoundsColumns};
use crate::metric::{BoxPlane, PLANES};
use std::ops::Range;

/// Nodes of a cluster.
pub(crate) const CLUSTER: usize = 128;
/// No cluster.
const NONE: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Cluster {
    /// Bit i: place i is taken.
    taken: u128,
    /// Bit i of side s: slot 2 i + s has changed.
    written: [u128; 2],
    /// Where children go when this cluster is full, and which use of that cluster is meant.
    spill: (u32, u32),
    /// How often the cluster has been emptied.
    use_count: u32,
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
    /// Packed: no cluster before this one has room.
    first_open: usize,
    /// Near: empty clusters. May hold others as well.
    empty: Vec<u32>,
    /// Clusters with slots that have changed.
    written: Vec<u32>,
    taken: usize,
}

impl Clusters {
    pub(crate) fn new(dealing: Dealing) -> Self {
        Self {
            dealing,
            clusters: Vec::new(),
            bounds: BoundsColumns::default(),
            first_open: 0,
            empty: Vec::new(),
            written: Vec::new(),
            taken: 0,
        }
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.clusters.capacity() * size_of::<Cluster>()
            + self.bounds.bytes()
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
        (cluster != other && self.clusters.get(cluster)?.taken != u128::MAX).then(|| self.take_in(cluster))
    }

    fn take_in(&mut self, cluster: usize) -> u32 {
        let place = (!self.clusters[cluster].taken).trailing_zeros();
        self.clusters[cluster].taken |= 1 << place;
        self.taken += 1;
        (cluster * CLUSTER) as u32 + place
    }

    /// The first cluster with room.
    fn cluster_with_room(&mut self) -> usize {
        let full =
            self.clusters[self.first_open..].iter().take_while(|cluster| cluster.taken == u128::MAX).count();
        self.first_open += full;
        if self.first_open == self.clusters.len() { self.new_cluster() } else { self.first_open }
    }

    fn cluster_near(&mut self, cluster: usize) -> usize {
        let Some(Cluster { taken, spill: (spill, use_count), .. }) = self.clusters.get(cluster).copied()
        else {
            return self.new_cluster();
        };
        if taken != u128::MAX {
            return cluster;
        }
        if let Some(other) = self.clusters.get(spill as usize)
            && other.use_count == use_count
            && other.taken != u128::MAX
        {
            return spill as usize;
        }
        let other = self.empty_cluster();
        self.clusters[cluster].spill = (other as u32, self.clusters[other].use_count);
        other
    }

    fn empty_cluster(&mut self) -> usize {
        while let Some(cluster) = self.empty.pop() {
            if self.clusters.get(cluster as usize).is_some_and(|cluster| cluster.taken == 0) {
                return cluster as usize;
            }
        }
        self.new_cluster()
    }

    fn new_cluster(&mut self) -> usize {
        self.clusters.push(Cluster { taken: 0, written: [0; 2], spill: (NONE, 0), use_count: 0 });
        self.bounds.push_empty();
        self.clusters.len() - 1
    }

    /// Gives a place back.
    pub(crate) fn give_back(&mut self, place: u32) {
        let index = place as usize / CLUSTER;
        let cluster = &mut self.clusters[index];
        cluster.taken &= !(1 << (place as usize % CLUSTER));
        self.taken -= 1;
        if cluster.taken == 0 {
            cluster.use_count = cluster.use_count.wrapping_add(1);
            self.bounds.set(index, Bounds::EMPTY);
        }
        if self.dealing == Dealing::Packed {
            self.first_open = self.first_open.min(index);
        } else if cluster.taken == 0 {
            self.empty.push(index as u32);
        }
    }

    /// Gives up empty clusters at the end whose slots have been told; whether there were any.
    pub(crate) fn give_up_empty_end(&mut self) -> bool {
        let before = self.clusters.len();
        while self.clusters.last().is_some_and(|cluster| cluster.taken == 0 && cluster.written == [0; 2]) {
            self.clusters.pop();
            self.bounds.pop();
        }
        self.first_open = self.first_open.min(self.clusters.len());
        self.clusters.len() < before
    }

    /// Notes that the slot of a place's side shows something else now.
    #[inline(always)]
    pub(crate) fn touch(&mut self, place: u32, side: usize) {
        let index = place as usize / CLUSTER;
        let cluster = &mut self.clusters[index];
        if cluster.written == [0; 2] {
            self.written.push(index as u32);
        }
        cluster.written[side] |= 1 << (place as usize % CLUSTER);
    }

    /// Hands out the slots that have changed, as places and sides, cluster by cluster in order.
    pub(crate) fn take_written(&mut self, mut each: impl FnMut(u32, usize)) {
        for index in self.written.drain(..) {
            let written = std::mem::take(&mut self.clusters[index as usize].written);
            let mut either = written[0] | written[1];
            while either != 0 {
                let place = either.trailing_zeros();
                either &= either - 1;
                for (side, written) in written.iter().enumerate() {
                    if written >> place & 1 == 1 {
                        each(index * CLUSTER as u32 + place, side);
                    }
                }
            }
        }
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
        let mut taken = self.clusters[cluster].taken;
        std::iter::from_fn(move || {
            let place = taken.trailing_zeros();
            (taken != 0).then(|| {
                taken &= taken - 1;
                (cluster * CLUSTER) as u32 + place
            })
        })
    }

    /// Bounds and triangle slots of every cluster that is in use.
    pub(crate) fn clusters(&self) -> impl Iterator<Item = (Bounds, Range<u32>)> {
        let used = self.clusters.iter().enumerate().filter(|(_, cluster)| cluster.taken != 0);
        used.map(|(index, cluster)| (self.bounds.get(index), slots_of(index, cluster)))
    }

    /// Calls `draw` with the triangle slots of every cluster that is in use and may be seen.
    pub(crate) fn cull(&mut self, planes: &[BoxPlane; PLANES], mut draw: impl FnMut(Range<u32>)) {
        let is_seen = self.bounds.cull(planes);
        for (index, cluster) in self.clusters.iter().enumerate() {
            if cluster.taken != 0 && is_seen(index) {
                draw(slots_of(index, cluster));
            }
        }
    }
}

/// The triangle slots from a cluster's first place taken to its last.
fn slots_of(index: usize, cluster: &Cluster) -> Range<u32> {
    let first = (index * CLUSTER) as u32;
    let (from, to) = (cluster.taken.trailing_zeros(), CLUSTER as u32 - cluster.taken.leading_zeros());
    2 * (first + from)..2 * (first + to)
}
