//! The mesh as it comes from the caller: changes since the last frame, in slots.
//!
//! Vertices and triangles live in slots of two buffers on the device. A patch rewrites some slots and says which
//! triangle slots are visible; everything else stays where it is. So what is uploaded follows what changed.

mod buffers;
mod draws;
mod morph;
mod patch;

pub(crate) use buffers::MeshBuffers;
pub(crate) use morph::Morph;

use std::ops::Range;

use bytemuck::{Pod, Zeroable};

/// One vertex of the mesh as the device holds it.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MeshVertex {
    /// Grid column, eastward; padding folded onto the data already. At most 2^24.
    pub x: u32,
    /// Grid row, northward. At most 2^24.
    pub y: u32,
    /// Height in metres, before exaggeration.
    pub height_m: f32,
    /// Saturated error in metres, before exaggeration; at least 0, may be infinite.
    pub error_m: f32,
    /// Nested-sphere radius in metres.
    pub radius_m: f32,
    /// Vertex slots of the two ends of the edge that this vertex splits: where it comes from when it appears. Its own slot, twice, for
    /// corners and the centre. Both must hold vertices whenever this one is drawn, as in a conforming mesh they do.
    pub ends: [u32; 2],
    /// Bits 0 to 7: level, 0 the finest, [`MeshVertex::NO_LEVEL`] for corners. Other bits are reserved, 0.
    pub flags: u32,
}

impl MeshVertex {
    /// Level of a vertex that splits no edge.
    pub const NO_LEVEL: u32 = 255;
}

/// What changed in the mesh, and what of it is seen.
#[derive(Debug, Clone, Copy, Default)]
pub struct MeshPatch<'a> {
    /// Vertex slots and their new content. Where a slot occurs twice the later one counts.
    pub vertices: &'a [(u32, MeshVertex)],
    /// Triangle slots and their corners' vertex slots, counter-clockwise from above; three equal corners draw
    /// nothing, which is how a slot is emptied. Where a slot occurs twice the later one counts.
    pub triangles: &'a [(u32, [u32; 3])],
    /// Triangle slots to draw from now on, in any order.
    pub draws: &'a [Range<u32>],
}

/// What a patch cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct UploadStats {
    /// Vertex slots written.
    pub vertices: u32,
    /// Triangle slots written.
    pub triangles: u32,
    /// Bytes sent to the device: 36 a vertex and 16 a triangle (content and slot). The optimum is the patch's own size.
    pub bytes: u64,
    /// Bytes copied within the device because a buffer grew; 0 in nearly all frames.
    pub grown_bytes: u64,
}
