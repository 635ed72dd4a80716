//! The triangles in their slots, gathered in clusters that lie together on the ground.
//!
//! A slot holds the three vertex slots of a triangle, apex first, counter-clockwise. Slots are dealt out in clusters of [`CLUSTER`]: a
//! triangle that splits leaves both halves in its own cluster. A cluster that is full is cut in two along its longer side; two that came
//! from one cut are joined when little is left of them. Within a cluster live triangles come first, so that each is one range to draw.
//!
//! Invariants: the links of a triangle's owner name its slot, wherever it is moved; a cluster's bounds contain its triangles.
//! Cost: a cut moves half a cluster, once in at least as many insertions.

use super::nodes::Links;
use super::vertices::Vertices;
use std::ops::Range;
use terrasoar_layout::grid::Grid;

/// Slots of a cluster.
pub(super) const CLUSTER: usize = 256;
/// Clusters of one cut are joined when they hold no more than this.
const JOIN: u32 = CLUSTER as u32 / 2;
/// Bit of a triangle's first corner: it is not drawn, for void touches it or it has no area.
const HIDDEN: u32 = 1 << 31;
const NONE: u32 = u32::MAX;

/// Who holds a triangle's slot: a node and the place in its links.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Owner(u32);

impl Owner {
    pub(super) fn new(node: u32, place: usize) -> Self {
        Self(node << 2 | place as u32)
    }

    fn tell(self, links: &mut [Links], slot: u32) {
        links[(self.0 >> 2) as usize][self.0 as usize & 3] = slot;
    }
}

/// A triangle: its corners, apex first, and whether it is left out of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Corners {
    pub corners: [u32; 3],
    pub hidden: bool,
}

/// A box around a cluster, in grid steps (padding folded) and metres of height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least column, row and height.
    pub least: [f32; 3],
    /// Largest column, row and height.
    pub largest: [f32; 3],
}

impl Bounds {
    const EMPTY: Self = Self { least: [f32::INFINITY; 3], largest: [f32::NEG_INFINITY; 3] };

    #[inline(always)]
    fn include(&mut self, p: [f32; 3]) {
        for (i, p) in p.into_iter().enumerate() {
            self.least[i] = self.least[i].min(p);
            self.largest[i] = self.largest[i].max(p);
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Cluster {
    live: u32,
    /// Its leaf in the tree of cuts.
    cut: u32,
    bounds: Bounds,
}

/// A node of the tree of cuts: a cluster, or two parts.
#[derive(Debug, Clone, Copy)]
struct Cut {
    parent: u32,
    content: Content,
}

#[derive(Debug, Clone, Copy)]
enum Content {
    Cluster(u32),
    Parts([u32; 2]),
}

/// All triangles of a mesh.
#[derive(Debug)]
pub(super) struct Triangles {
    slots: Vec<[u32; 3]>,
    owners: Vec<Owner>,
    clusters: Vec<Cluster>,
    free_clusters: Vec<u32>,
    cuts: Vec<Cut>,
    free_cuts: Vec<u32>,
    /// Slots written since the last [`Triangles::take_written`], each once.
    written: Vec<u32>,
    is_written: Vec<u64>,
    /// The cluster whose bounds are due to be made anew.
    stale: usize,
    live: usize,
    /// Samples less one, that padding is folded to.
    last_sample: [u32; 2],
}

impl Triangles {
    /// No triangles yet, in one empty cluster.
    pub(super) fn new(grid: &Grid) -> Self {
        let mut new = Self {
            slots: Vec::new(),
            owners: Vec::new(),
            clusters: Vec::new(),
            free_clusters: Vec::new(),
            cuts: vec![Cut { parent: NONE, content: Content::Cluster(0) }],
            free_cuts: Vec::new(),
            written: Vec::new(),
            is_written: Vec::new(),
            stale: 0,
            live: 0,
            last_sample: grid.samples().map(|s| s - 1),
        };
        new.new_cluster(0);
        new
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.slots.capacity() * size_of::<[u32; 3]>()
            + self.owners.capacity() * size_of::<Owner>()
            + self.clusters.capacity() * size_of::<Cluster>()
            + self.cuts.capacity() * size_of::<Cut>()
            + (self.written.capacity() + self.free_clusters.capacity() + self.free_cuts.capacity())
                * size_of::<u32>()
            + self.is_written.capacity() * size_of::<u64>()
    }

    /// Triangles in the mesh.
    pub(super) fn live(&self) -> usize {
        self.live
    }

    #[inline(always)]
    pub(super) fn get(&self, slot: u32) -> Corners {
        let [a, b, c] = self.slots[slot as usize];
        Corners { corners: [a & !HIDDEN, b, c], hidden: a & HIDDEN != 0 }
    }

    /// Puts a triangle into a slot in use.
    pub(super) fn set(
        &mut self,
        slot: u32,
        triangle: Corners,
        owner: Owner,
        links: &mut [Links],
        vertices: &Vertices,
    ) {
        self.write(slot, triangle, owner, links);
        let cluster = slot as usize / CLUSTER;
        let bounds = self.with_triangle(self.clusters[cluster].bounds, triangle, vertices);
        self.clusters[cluster].bounds = bounds;
    }

    /// Adds a triangle to the cluster of the slot `beside`.
    pub(super) fn insert(
        &mut self,
        beside: u32,
        triangle: Corners,
        owner: Owner,
        links: &mut [Links],
        vertices: &Vertices,
    ) {
        let mut cluster = beside as usize / CLUSTER;
        if self.clusters[cluster].live as usize == CLUSTER {
            cluster = self.cut(cluster, triangle, links, vertices);
        }
        let slot = (cluster * CLUSTER) as u32 + self.clusters[cluster].live;
        self.clusters[cluster].live += 1;
        self.live += 1;
        self.set(slot, triangle, owner, links, vertices);
    }

    /// Takes a triangle out; the last one of its cluster moves into its slot.
    pub(super) fn remove(&mut self, slot: u32, links: &mut [Links], vertices: &Vertices) {
        let cluster = slot as usize / CLUSTER;
        self.clusters[cluster].live -= 1;
        self.live -= 1;
        let last = (cluster * CLUSTER) as u32 + self.clusters[cluster].live;
        if slot != last {
            self.write(slot, self.get(last), self.owners[last as usize], links);
        }
        self.join(cluster, links, vertices);
    }

    /// Tells the owner of a slot that it is now `owner`.
    pub(super) fn set_owner(&mut self, slot: u32, owner: Owner) {
        self.owners[slot as usize] = owner;
    }

    fn write(&mut self, slot: u32, triangle: Corners, owner: Owner, links: &mut [Links]) {
        let [a, b, c] = triangle.corners;
        self.slots[slot as usize] = [a | if triangle.hidden { HIDDEN } else { 0 }, b, c];
        self.owners[slot as usize] = owner;
        owner.tell(links, slot);
        let (word, bit) = (slot as usize / 64, 1 << (slot % 64));
        if self.is_written[word] & bit == 0 {
            self.is_written[word] |= bit;
            self.written.push(slot);
        }
    }

    /// Hands out the slots written since the last call, each once, as they are now; those past their cluster's end are left out.
    pub(super) fn take_written(&mut self, mut each: impl FnMut(u32, [u32; 3])) {
        for slot in self.written.drain(..) {
            self.is_written[slot as usize / 64] &= !(1 << (slot % 64));
            if slot % (CLUSTER as u32) < self.clusters[slot as usize / CLUSTER].live {
                let [a, b, c] = self.slots[slot as usize];
                each(slot, if a & HIDDEN != 0 { [0; 3] } else { [a, b, c] });
            }
        }
    }

    /// Calls `visit` with every triangle of the mesh.
    pub(super) fn for_each(&self, mut visit: impl FnMut(u32, Corners)) {
        for (i, cluster) in self.clusters.iter().enumerate() {
            for at in 0..cluster.live {
                let slot = (i * CLUSTER) as u32 + at;
                visit(slot, self.get(slot));
            }
        }
    }

    /// Bounds and range of slots of each cluster that holds any triangles.
    pub(super) fn clusters(&self) -> impl Iterator<Item = (&Bounds, Range<u32>)> {
        let range = |i: usize, live: u32| (i * CLUSTER) as u32..(i * CLUSTER) as u32 + live;
        self.clusters
            .iter()
            .enumerate()
            .filter(|(_, c)| c.live > 0)
            .map(move |(i, c)| (&c.bounds, range(i, c.live)))
    }

    /// Makes the bounds of the next cluster anew, which merges leave too large.
    pub(super) fn tighten_one(&mut self, vertices: &Vertices) {
        self.stale = (self.stale + 1) % self.clusters.len();
        self.clusters[self.stale].bounds = self.bounds_of(self.stale, vertices);
    }

    /// Folded position and height of a vertex.
    #[inline(always)]
    fn place_of(&self, vertex: u32, vertices: &Vertices) -> [f32; 3] {
        let v = vertices.get(vertex);
        // Columns and rows are below 2^24: exact.
        [v.x.min(self.last_sample[0]) as f32, v.y.min(self.last_sample[1]) as f32, v.height_m]
    }

    #[inline(always)]
    fn with_triangle(&self, mut bounds: Bounds, triangle: Corners, vertices: &Vertices) -> Bounds {
        triangle.corners.iter().for_each(|v| bounds.include(self.place_of(*v, vertices)));
        bounds
    }

    fn bounds_of(&self, cluster: usize, vertices: &Vertices) -> Bounds {
        let first = (cluster * CLUSTER) as u32;
        let slots = first..first + self.clusters[cluster].live;
        slots.fold(Bounds::EMPTY, |bounds, slot| self.with_triangle(bounds, self.get(slot), vertices))
    }

    fn new_cluster(&mut self, cut: u32) -> usize {
        let fresh = Cluster { live: 0, cut, bounds: Bounds::EMPTY };
        if let Some(cluster) = self.free_clusters.pop() {
            self.clusters[cluster as usize] = fresh;
            return cluster as usize;
        }
        self.clusters.push(fresh);
        let slots = self.clusters.len() * CLUSTER;
        self.slots.resize(slots, [0; 3]);
        self.owners.resize(slots, Owner(0));
        self.is_written.resize(slots / 64, 0);
        self.clusters.len() - 1
    }

    fn new_cut(&mut self, cut: Cut) -> u32 {
        if let Some(at) = self.free_cuts.pop() {
            self.cuts[at as usize] = cut;
            return at;
        }
        self.cuts.push(cut);
        self.cuts.len() as u32 - 1
    }

    /// Cuts a full cluster in two where its triangles lie widest apart; returns the part that `triangle` belongs to.
    fn cut(&mut self, cluster: usize, triangle: Corners, links: &mut [Links], vertices: &Vertices) -> usize {
        let Bounds { least, largest } = self.bounds_of(cluster, vertices);
        let axis = usize::from(largest[1] - least[1] > largest[0] - least[0]);
        // Apexes, not centres: neighbours that share one stay together, and it is one vertex to look up.
        let apex = |t: Corners| self.place_of(t.corners[0], vertices)[axis];
        let first = cluster * CLUSTER;
        let mut apexes: [(f32, u32); CLUSTER] =
            std::array::from_fn(|i| (apex(self.get((first + i) as u32)), i as u32));
        apexes.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let middle = apexes[CLUSTER / 2].0;
        let beyond = apex(triangle) >= middle;
        let leaf = self.clusters[cluster].cut;
        let near = self.new_cut(Cut { parent: leaf, content: Content::Cluster(cluster as u32) });
        let far_cluster = self.new_cluster(NONE);
        let far = self.new_cut(Cut { parent: leaf, content: Content::Cluster(far_cluster as u32) });
        self.cuts[leaf as usize].content = Content::Parts([near, far]);
        self.clusters[cluster].cut = near;
        self.clusters[far_cluster].cut = far;
        // From the highest slot down, so that what closes a gap has been looked at already.
        let mut moving = apexes.map(|(_, i)| i);
        let moving = &mut moving[CLUSTER / 2..];
        moving.sort_unstable_by(|a, b| b.cmp(a));
        for i in moving {
            let slot = (first + *i as usize) as u32;
            let to = (far_cluster * CLUSTER) as u32 + self.clusters[far_cluster].live;
            self.write(to, self.get(slot), self.owners[slot as usize], links);
            self.clusters[far_cluster].live += 1;
            self.clusters[cluster].live -= 1;
            let last = first as u32 + self.clusters[cluster].live;
            if slot != last {
                self.write(slot, self.get(last), self.owners[last as usize], links);
            }
        }
        for part in [cluster, far_cluster] {
            self.clusters[part].bounds = self.bounds_of(part, vertices);
        }
        if beyond { far_cluster } else { cluster }
    }

    /// Joins a cluster with the other part of its cut, if little is left of both.
    fn join(&mut self, cluster: usize, links: &mut [Links], vertices: &Vertices) {
        let live = self.clusters[cluster].live;
        let leaf = self.clusters[cluster].cut;
        let parent = self.cuts[leaf as usize].parent;
        if parent == NONE || live > JOIN {
            return;
        }
        let Content::Parts(parts) = self.cuts[parent as usize].content else { return };
        let other = if parts[0] == leaf { parts[1] } else { parts[0] };
        match self.cuts[other as usize].content {
            Content::Cluster(into) => {
                let into = into as usize;
                if live + self.clusters[into].live > JOIN {
                    return;
                }
                for i in 0..live {
                    let from = (cluster * CLUSTER) as u32 + i;
                    let to = (into * CLUSTER) as u32 + self.clusters[into].live;
                    self.write(to, self.get(from), self.owners[from as usize], links);
                    self.clusters[into].live += 1;
                }
                self.clusters[cluster].live = 0;
                self.clusters[into].bounds = self.bounds_of(into, vertices);
                self.clusters[into].cut = parent;
                self.cuts[parent as usize].content = Content::Cluster(into as u32);
            }
            Content::Parts(deeper) if live == 0 => {
                deeper.iter().for_each(|part| self.cuts[*part as usize].parent = parent);
                self.cuts[parent as usize].content = Content::Parts(deeper);
            }
            Content::Parts(_) => return,
        }
        self.free_clusters.push(cluster as u32);
        self.free_cuts.extend([leaf, other]);
    }
}
