//! The mesh as it comes from the caller: changes since the last frame, in slots.
//!
//! Vertices and triangles live in slots of two buffers on the device. A patch rewrites some slots and says which
//! triangle slots are visible; everything else stays where it is. So only what changed is uploaded.

mod buffers;
mod draws;
mod morph;
mod patch;

pub(crate) use buffers::MeshBuffers;
pub(crate) use morph::Morph;

use std::ops::Range;

use terrasoar::refine::kinetic::MeshVertex;

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
