//! The vertex array: the vertices that triangles are made of, in slots that they keep for as long as they are in the mesh.
//!
//! It lies beside the bin-tree array but has an order of its own, so that nodes moved in that array move no vertex on the GPU. The first
//! five slots are the square's corners and its centre. Where slots are all taken, what would split next waits: the mesh is coarser there, and that is told as what is late. Cost: 13 bytes a vertex, half a vertex a triangle.

use crate::refine::kinetic::capacity::{give_back, grow, shorten};
use crate::refine::kinetic::hands::extend;
use crate::refine::soar::StripVertex;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::prefetch::prefetch;

/// Slots that there can be: [`Corner`](super::rings::Corner) has bits for no more.
const MOST: usize = (1 << 29) - 1;

#[derive(Debug)]
pub(crate) struct Vertices {
    all: Vec<StripVertex>,
    /// Whether a vertex's sample is void.
    void: Vec<bool>,
    /// Bit s % 64 of word s / 64: slot s is free.
    open: Vec<u64>,
    /// No word before this one has a bit.
    first_open: usize,
    free: usize,
    most: usize,
}

impl Default for Vertices {
    fn default() -> Self {
        Self { all: Vec::new(), void: Vec::new(), open: Vec::new(), first_open: 0, free: 0, most: MOST }
    }
}

impl Vertices {
    /// Whether so many more vertices find slots.
    #[inline(always)]
    pub(crate) fn have_room(&self, more: usize) -> bool {
        self.all.len() - self.free + more <= self.most
    }

    /// Has no more slots than that.
    #[cfg(test)]
    pub(crate) fn limit(&mut self, most: usize) {
        self.most = most;
    }

    /// Places a vertex in the first slot that is free, so that those at the end are free before long where the mesh shrinks; returns its slot.
    pub(crate) fn place(&mut self, at: GridPoint, vertex: &Vertex) -> u32 {
        let placed = StripVertex { x: at.x(), y: at.y(), height_m: vertex.height_m as f32 };
        let is_void = vertex.class.is_void();
        if self.free > 0 {
            while let Some(open) = self.open.get_mut(self.first_open) {
                if *open != 0 {
                    let slot = 64 * self.first_open + open.trailing_zeros() as usize;
                    *open &= *open - 1;
                    self.free -= 1;
                    self.all[slot] = placed;
                    self.void[slot] = is_void;
                    return slot as u32;
                }
                self.first_open += 1;
            }
        }
        grow(&mut self.all, 1);
        self.all.push(placed);
        grow(&mut self.void, 1);
        self.void.push(is_void);
        self.all.len() as u32 - 1
    }

    /// Places vertices at the end, where none has been removed, by their points, heights and whether they are void.
    pub(crate) fn append(
        &mut self,
        count: usize,
        place: impl Fn(usize) -> (GridPoint, f32) + Sync + Send,
        is_void: impl Fn(usize) -> bool + Sync + Send,
    ) {
        extend(&mut self.all, count, |i| {
            let (at, height_m) = place(i);
            StripVertex { x: at.x(), y: at.y(), height_m }
        });
        extend(&mut self.void, count, is_void);
    }

    /// Slots, those that are free included.
    pub(crate) fn len(&self) -> u32 {
        self.all.len() as u32
    }

    /// Gives all slots back; memory stays.
    pub(crate) fn clear(&mut self) {
        self.all.clear();
        self.void.clear();
        self.open.clear();
        (self.first_open, self.free) = (0, 0);
    }

    /// Gives memory back if less than one part in `parts` of it is in use.
    pub(crate) fn give_back(&mut self, parts: usize) {
        give_back(&mut self.all, parts);
        give_back(&mut self.void, parts);
        give_back(&mut self.open, parts);
    }

    /// Moves a vertex up or down.
    pub(crate) fn set_height(&mut self, slot: u32, height_m: f64) {
        self.all[slot as usize].height_m = height_m as f32;
    }

    /// Gives a slot back.
    pub(crate) fn remove(&mut self, slot: u32) {
        let word = slot as usize / 64;
        if word >= self.open.len() {
            let more = word + 1 - self.open.len();
            grow(&mut self.open, more);
            self.open.resize(word + 1, 0);
        }
        self.open[word] |= 1 << (slot % 64);
        self.first_open = self.first_open.min(word);
        self.free += 1;
    }

    /// Gives up slots at the end that are free, some thousands at a time. Tells how many are left, if any were given up.
    pub(crate) fn give_up_free_end(&mut self) -> Option<usize> {
        const WORDS: usize = 64;
        let before = self.all.len();
        for _ in 0..WORDS {
            let last = self.all.len().checked_sub(1)?;
            // Whole words, once the end is at one.
            let from = last / 64 * 64;
            let wanted = u64::MAX >> (63 - last % 64);
            if self.open.get(last / 64) != Some(&wanted) {
                break;
            }
            self.open.truncate(last / 64);
            self.all.truncate(from);
            self.void.truncate(from);
            self.free -= last % 64 + 1;
        }
        (self.all.len() < before).then(|| {
            shorten(&mut self.all);
            shorten(&mut self.void);
            self.all.len()
        })
    }

    /// Asks memory for a vertex.
    #[inline(always)]
    pub(crate) fn fetch(&self, slot: u32) {
        prefetch(&self.all, slot as usize);
    }

    #[inline(always)]
    pub(crate) fn point(&self, slot: u32) -> GridPoint {
        let v = &self.all[slot as usize];
        GridPoint::new(v.x, v.y)
    }

    #[inline(always)]
    pub(crate) fn get(&self, slot: u32) -> &StripVertex {
        &self.all[slot as usize]
    }

    #[inline(always)]
    pub(crate) fn is_void(&self, slot: u32) -> bool {
        self.void[slot as usize]
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<StripVertex>()
            + self.void.capacity()
            + self.open.capacity() * size_of::<u64>()
    }
}
