//! What a frame changed in the mesh: all that is needed to bring a GPU's copy of it up to date.

use super::labels::level_of;
use std::ops::Range;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::Vertex;
use terrasoar_layout::read::store::RecordStore;

/// One vertex of the mesh, as a device holds it: 32 bytes, these fields in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C)]
pub struct MeshVertex {
    /// Grid column, eastward; padding is folded onto the data. At most 2^24.
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
    /// corners and the centre. Both hold vertices whenever this one is drawn.
    pub ends: [u32; 2],
    /// Bits 0 to 7: level, 0 the finest, [`MeshVertex::NO_LEVEL`] for corners of the square. Other bits are reserved, 0.
    pub flags: u32,
}

impl MeshVertex {
    /// Level of a vertex that splits no edge.
    pub const NO_LEVEL: u32 = 255;

    /// A vertex at a grid point, on the edge between two slots.
    #[inline(always)]
    pub(crate) fn of(records: &impl RecordStore, point: GridPoint, vertex: &Vertex, ends: [u32; 2]) -> Self {
        let folded = records.grid().fold(point);
        Self {
            x: folded.x(),
            y: folded.y(),
            height_m: vertex.height_m as f32,
            error_m: vertex.error_m as f32,
            radius_m: vertex.radius_m as f32,
            ends,
            flags: if records.grid().is_corner(point) { Self::NO_LEVEL } else { level_of(point) },
        }
    }
}

/// The change of one frame. Applied in order to the meshes of all frames before, it gives this frame's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Patch {
    /// Vertex slots and what they hold from now on. A slot may occur twice; the later one counts.
    pub vertices: Vec<(u32, MeshVertex)>,
    /// Triangle slots and the vertex slots of their corners, counter-clockwise from above, apex first; three equal ones draw nothing.
    pub triangles: Vec<(u32, [u32; 3])>,
    /// Ranges of triangle slots to draw in this frame. A slot that was never sent holds three equal corners.
    pub draws: Vec<Range<u32>>,
}

impl Patch {
    /// Bytes of vertices and indices that a GPU receives.
    pub fn bytes(&self) -> u64 {
        (self.vertices.len() * size_of::<MeshVertex>() + self.triangles.len() * size_of::<[u32; 3]>()) as u64
    }

    pub(crate) fn clear(&mut self) {
        self.vertices.clear();
        self.triangles.clear();
        self.draws.clear();
    }
}
