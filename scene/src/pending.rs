//! What the engine changed and the device has not heard of: patches laid one on the other until they are sent.
//!
//! Invariant: once a mesh was sent, it and what is pending make the engine's mesh.

use std::ops::Range;
use terrasoar::refine::kinetic::{MeshVertex, Patch};

/// What the engine changed and the device has not heard of.
#[derive(Debug, Default)]
pub(super) struct Pending {
    /// Whether the device has a mesh at all. While it has none nothing is kept: it gets the whole.
    pub begun: bool,
    /// Whether anything changed since the last picture, the visible ranges included.
    pub changed: bool,
    pub vertices: Vec<(u32, MeshVertex)>,
    pub triangles: Vec<(u32, [u32; 3])>,
    pub draws: Vec<Range<u32>>,
    /// One past the highest triangle slot ever sent. Slots past it are empty, and the device has not heard of them.
    end: u32,
}

impl Pending {
    /// Adds a patch to those before it.
    pub(super) fn take(&mut self, patch: &Patch) {
        self.vertices.extend_from_slice(&patch.vertices);
        self.triangles.extend_from_slice(&patch.triangles);
        self.end = patch.triangles.iter().fold(self.end, |end, (slot, _)| end.max(slot + 1));
        let end = self.end;
        self.draws.clear();
        self.draws.extend(patch.draws.iter().map(|r| r.start.min(end)..r.end.min(end)));
    }

    pub(super) fn clear(&mut self) {
        self.vertices.clear();
        self.triangles.clear();
        self.changed = false;
    }
}
