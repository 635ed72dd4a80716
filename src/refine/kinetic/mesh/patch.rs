//! What a frame changed in the mesh: all that a GPU's copy of it needs to follow.

use std::ops::Range;

/// The level of vertices that have none.
pub const NO_LEVEL: u32 = 255;

/// A vertex as the GPU holds it: 32 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct PatchVertex {
    /// Column, counted east; padding is folded onto the data.
    pub x: u32,
    /// Row, counted north.
    pub y: u32,
    /// Height in metres.
    pub height_m: f32,
    /// Saturated error in metres.
    pub error_m: f32,
    /// Nested-sphere radius in metres.
    pub radius_m: f32,
    /// Slots of the ends of the edge that the vertex splits; its own for the corners and the centre.
    pub ends: [u32; 2],
    /// The vertex's level, from 0 for the finest; [`NO_LEVEL`] for the corners of the square.
    pub flags: u32,
}

/// The change of one frame. Applied in order to the meshes of all frames before, it gives this frame's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Patch {
    /// Vertex slots and what they hold from now on. A slot may occur twice; the later one counts.
    pub vertices: Vec<(u32, PatchVertex)>,
    /// Triangle slots and the vertex slots of their corners, counter-clockwise from above, apex first; three equal ones draw nothing.
    pub triangles: Vec<(u32, [u32; 3])>,
    /// Ranges of triangle slots to draw in this frame. A slot that was never sent holds three equal corners.
    pub draws: Vec<Range<u32>>,
}

impl Patch {
    /// Bytes of vertices and indices that a GPU receives.
    pub fn bytes(&self) -> u64 {
        (self.vertices.len() * size_of::<PatchVertex>() + self.triangles.len() * size_of::<[u32; 3]>()) as u64
    }

    pub(crate) fn clear(&mut self) {
        self.vertices.clear();
        self.triangles.clear();
        self.draws.clear();
    }
}
