//! A frame's drawn triangles as a mesh for other programs.

use super::ReplayError;
use crate::mesh::{IndexedMesh, Triangle, is_drawn};
use crate::refine::Engine;
use std::collections::HashMap;
use terrasoar_layout::read::store::{CompleteStore, RecordStore};

/// The mesh of an engine over its records.
///
/// # Errors
/// What the records could not be read for.
pub(super) fn collect_mesh<E: Engine>(mut engine: E) -> Result<IndexedMesh, ReplayError>
where
    E::Store: CompleteStore,
{
    let mut triangles: Vec<Triangle> = Vec::new();
    engine.for_each_triangle(&mut |triangle| triangles.push(triangle));
    let mesh = mesh_of(&triangles, engine.store_mut());
    engine.store_mut().take_error().map_or(Ok(mesh), |error| Err(error.into()))
}

fn mesh_of(triangles: &[Triangle], records: &impl RecordStore) -> IndexedMesh {
    let mut mesh = IndexedMesh::default();
    let mut indices: HashMap<u64, u32> = HashMap::new();
    let grid = *records.grid();
    for t in triangles.iter().filter(|t| is_drawn(records, **t)) {
        mesh.triangles.push(t.map(|p| {
            // Folded points coincide; they become one vertex.
            *indices.entry(grid.fold(p).packed()).or_insert_with(|| {
                let [x, y] = grid.position_m(p);
                mesh.positions.push([x, y, records.vertex_at(p).height_m]);
                mesh.positions.len() as u32 - 1
            })
        }));
    }
    mesh
}
