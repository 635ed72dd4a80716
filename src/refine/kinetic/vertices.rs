//! The vertex array: the vertices that triangles are made of, in slots that they keep for as long as they are in the mesh.
//!
//! It lies beside the bin-tree array but has an order of its own, so that nodes moved in that array move no vertex on the GPU. The first
//! five slots are the square's corners and its centre. Cost: 12 bytes a vertex, half a vertex a triangle.

use super::capacity::grow;
use crate::refine::soar::StripVertex;
use terrasoar_layout::grid::GridPoint;

#[derive(Debug, Default)]
pub(super) struct Vertices {
    all: Vec<StripVertex>,
    free: Vec<u32>,
}

impl Vertices {
    /// Places a vertex; returns its slot.
    pub(super) fn place(&mut self, at: GridPoint, height_m: f64) -> u32 {
        let vertex = StripVertex { x: at.x(), y: at.y(), height_m: height_m as f32 };
        if let Some(slot) = self.free.pop() {
            self.all[slot as usize] = vertex;
            return slot;
        }
        grow(&mut self.all, 1);
        self.all.push(vertex);
        self.all.len() as u32 - 1
    }

    /// Gives a slot back.
    pub(super) fn remove(&mut self, slot: u32) {
        grow(&mut self.free, 1);
        self.free.push(slot);
    }

    #[inline(always)]
    pub(super) fn point(&self, slot: u32) -> GridPoint {
        let v = &self.all[slot as usize];
        GridPoint::new(v.x, v.y)
    }

    #[inline(always)]
    pub(super) fn get(&self, slot: u32) -> &StripVertex {
        &self.all[slot as usize]
    }

    /// Slots, free ones included.
    pub(super) fn slots(&self) -> &[StripVertex] {
        &self.all
    }

    /// Bytes held.
    pub(super) fn bytes(&self) -> usize {
        self.all.capacity() * size_of::<StripVertex>() + self.free.capacity() * size_of::<u32>()
    }
}
