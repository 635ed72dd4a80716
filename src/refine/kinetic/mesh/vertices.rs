//! The vertex array: the vertices that triangles are made of, in slots that they keep for as long as they are in the mesh.
//!
//! It lies beside the bin-tree array but has an order of its own, so that nodes moved in that array move no vertex on the GPU. The first
//! five slots are the square's corners and its centre. Where slots are all taken, what would split next waits: the mesh is coarser there, and that is told as what is late. Heights are kept where clusters
//! have bounds, for these alone. Cost: 8 bytes a vertex, and 4 for its height; half a vertex a triangle.

use crate::refine::kinetic::capacity::{give_back, grow, shorten};
use crate::refine::kinetic::hands::extend;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::prefetch::prefetch;

/// Slots that there can be: [`Corner`](super::rings::Corner) has bits for no more.
const MOST: usize = (1 << 29) - 1;

/// A point, and whether its sample is void.
#[derive(Debug, Clone, Copy)]
struct Placed(u64);

impl Placed {
    const VOID: u64 = 1 << 63;

    #[inline(always)]
    fn new(at: GridPoint, is_void: bool) -> Self {
        Self(at.packed() | u64::from(is_void) << 63)
    }

    #[inline(always)]
    fn point(self) -> GridPoint {
        let packed = self.0 & !Self::VOID;
        GridPoint::new(packed as u32, (packed >> 32) as u32)
    }

    #[inline(always)]
    fn is_void(self) -> bool {
        self.0 & Self::VOID != 0
    }
}

#[derive(Debug)]
pub(crate) struct Vertices {
    all: Vec<Placed>,
    /// Heights in metres, if they are kept.
    heights_m: Vec<f32>,
    has_heights: bool,
    /// Bit s % 64 of word s / 64: slot s is free.
    open: Vec<u64>,
    /// No word before this one has a bit.
    first_open: usize,
    free: usize,
    most: usize,
}

impl Vertices {
    /// No vertices yet.
    pub(crate) fn new(has_heights: bool) -> Self {
        Self {
            all: Vec::new(),
            heights_m: Vec::new(),
            has_heights,
            open: Vec::new(),
            first_open: 0,
            free: 0,
            most: MOST,
        }
    }

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
        let placed = Placed::new(at, vertex.class.is_void());
        if self.free > 0 {
            while let Some(open) = self.open.get_mut(self.first_open) {
                if *open != 0 {
                    let slot = 64 * self.first_open + open.trailing_zeros() as usize;
                    *open &= *open - 1;
                    self.free -= 1;
                    self.all[slot] = placed;
                    self.set_height(slot as u32, vertex.height_m);
                    return slot as u32;
                }
                self.first_open += 1;
            }
        }
        grow(&mut self.all, 1);
        self.all.push(placed);
        if self.has_heights {
            grow(&mut self.heights_m, 1);
            self.heights_m.push(vertex.height_m as f32);
        }
        self.all.len() as u32 - 1
    }

    /// Places vertices at the end, where none has been removed, by their points, whether they are void, and their heights.
    pub(crate) fn append(
        &mut self,
        count: usize,
        place: impl Fn(usize) -> (GridPoint, bool) + Sync + Send,
        height_m: impl Fn(usize) -> f32 + Sync + Send,
    ) {
        extend(&mut self.all, count, |i| {
            let (at, is_void) = place(i);
            Placed::new(at, is_void)
        });
        if self.has_heights {
            extend(&mut self.heights_m, count, height_m);
        }
    }

    /// Slots, those that are free included.
    pub(crate) fn len(&self) -> u32 {
        self.all.len() as u32
    }

    /// Gives all slots back; memory stays.
    pub(crate) fn clear(&mut self) {
        self.all.clear();
        self.heights_m.clear();
        self.open.clear();
        (self.first_open, self.free) = (0, 0);
    }

    /// Gives memory back if less than one part in `parts` of it is in use.
    pub(crate) fn give_back(&mut self, parts: usize) {
        give_back(&mut self.all, parts);
        give_back(&mut self.heights_m, parts);
        give_back(&mut self.open, parts);
    }

    /// Moves a vertex up or down.
    pub(crate) fn set_height(&mut self, slot: u32, height_m: f64) {
        if self.has_heights {
            self.heights_m[slot as usize] = height_m as f32;
        }
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
            self.heights_m.truncate(from);
            self.free -= last % 64 + 1;
        }
        (self.all.len() < before).then(|| {
            shorten(&mut self.all);
            shorten(&mut self.heights_m);
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
        self.all[slot as usize].point()
    }

    /// The height of a vertex in metres, of which there is one where heights are kept.
    #[inline(always)]
    pub(crate) fn height_m(&self, slot: u32) -> f32 {
        self.heights_m[slot as usize]
    }

    #[inline(always)]
    pub(crate) fn is_void(&self, slot: u32) -> bool {
        self.all[slot as usize].is_void()
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<Placed>()
            + self.heights_m.capacity() * size_of::<f32>()
            + self.open.capacity() * size_of::<u64>()
    }
}
