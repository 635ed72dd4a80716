//! Patches from one mesh to the next, as an engine would send them: triangles keep their slots while they live.

use std::collections::{HashMap, HashSet};

use terrasoar_render::{MeshPatch, UploadStats};

use super::refiner::Mesh;
use super::scene::Scene;

/// What is on the device.
#[derive(Default)]
pub struct Stream {
    vertices: HashSet<u32>,
    slots: HashMap<[u32; 3], u32>,
    free: Vec<u32>,
    next: u32,
}

impl Stream {
    /// Sends what is new. Returns what it cost and the patch's own number of vertices and triangles.
    pub fn advance(&mut self, scene: &mut Scene<'_>, mesh: &Mesh) -> (UploadStats, [u32; 2]) {
        let wanted: HashSet<_> = mesh.triangles.iter().copied().collect();
        let mut gone: Vec<_> = self.slots.keys().filter(|t| !wanted.contains(*t)).copied().collect();
        gone.sort_unstable();
        let mut triangles = Vec::new();
        for triangle in gone {
            if let Some(slot) = self.slots.remove(&triangle) {
                triangles.push((slot, [0; 3]));
                self.free.push(slot);
            }
        }
        for triangle in &mesh.triangles {
            if !self.slots.contains_key(triangle) {
                let slot = self.free.pop().unwrap_or_else(|| {
                    self.next += 1;
                    self.next - 1
                });
                // A slot freed above may come a second time: the later content counts.
                triangles.push((slot, *triangle));
                self.slots.insert(*triangle, slot);
            }
        }
        let new: Vec<_> = mesh.slots.iter().filter(|s| self.vertices.insert(**s)).copied().collect();
        let vertices = scene.square.entries(&new);
        let distinct: HashSet<_> = triangles.iter().map(|(slot, _)| *slot).collect();
        let draws = [0..self.next];
        let stats = scene.apply(&MeshPatch { vertices: &vertices, triangles: &triangles, draws: &draws });
        (stats, [vertices.len() as u32, distinct.len() as u32])
    }
}
