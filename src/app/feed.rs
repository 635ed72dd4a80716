//! An engine as the renderer sees it: what changed in the mesh, and heights for shading, whatever the records' kind and the engine.
//!
//! Invariant: the changes told since the last [`Feed::whole`], applied in order to it, give the mesh. Cost: an engine's update and a copy of its patch.

use super::full_mesh::FullMesh;
use terrasoar::refine::kinetic::{Kinetic, Patch, PatchVertex};
use terrasoar::refine::{Culling, Engine, Unobserved, Work};
use terrasoar::view::View;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::record::RecordCodec;
use terrasoar_layout::terrain::{Records, Terrain};
use terrasoar_layout::with_records;
use terrasoar_render::{HEIGHTS_PER_TILE, MeshVertex, TILE_BORDER, TILE_CELLS, TileId};

/// Which engine makes the mesh. Both make the same one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum PictureEngine {
    /// Changes from frame to frame: the one to fly with.
    #[default]
    Kinetic,
    /// The whole mesh anew every frame: the reference.
    Soar,
}

/// What an update of the mesh did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Refined {
    /// The engine's own account; SOAR fills in its tests only.
    pub work: Work,
    /// Triangles in the mesh.
    pub triangles: u64,
}

/// An engine over a terrain.
pub(crate) trait Feed {
    /// Brings the mesh to a view.
    fn update(&mut self, view: &View) -> Refined;

    /// What the last update changed.
    fn patch(&self) -> &Patch;

    /// The mesh of the last update as a patch to an empty one.
    fn whole(&self) -> Patch;

    /// Heights of a tile as the renderer wants them, void not a number; replaces what `heights_m` held.
    fn heights_m(&self, tile: TileId, heights_m: &mut Vec<f32>);
}

/// The feed of an engine over a terrain; none if the terrain's source lends no bytes.
pub(crate) fn feed(terrain: &Terrain, engine: PictureEngine, culling: Culling) -> Option<Box<dyn Feed + '_>> {
    Some(with_records!(terrain.records()?, records => match engine {
        PictureEngine::Kinetic => {
            Box::new(KineticFeed { engine: Kinetic::new(records.clone(), culling), records }) as Box<dyn Feed + '_>
        }
        PictureEngine::Soar => Box::new(FullMesh::new(records, culling)),
    }))
}

/// A vertex of a patch as the renderer takes it.
pub(crate) fn mesh_vertex(vertex: &PatchVertex) -> MeshVertex {
    let PatchVertex { x, y, height_m, error_m, radius_m, ends, flags } = *vertex;
    MeshVertex { x, y, height_m, error_m, radius_m, ends, flags }
}

struct KineticFeed<'a, C: RecordCodec> {
    engine: Kinetic<'a, C>,
    records: Records<'a, C>,
}

impl<C: RecordCodec> Feed for KineticFeed<'_, C> {
    fn update(&mut self, view: &View) -> Refined {
        self.engine.update(view, &mut Unobserved);
        Refined { work: self.engine.work(), triangles: self.engine.triangle_count() as u64 }
    }

    fn patch(&self) -> &Patch {
        self.engine.patch()
    }

    fn whole(&self) -> Patch {
        self.engine.whole_patch()
    }

    fn heights_m(&self, tile: TileId, heights_m: &mut Vec<f32>) {
        tile_heights_m(&self.records, tile, heights_m);
    }
}

/// Heights of the grid points of a tile and its border, south-west first; those beyond the data are the nearest sample's.
pub(crate) fn tile_heights_m<C: RecordCodec>(
    records: &Records<'_, C>,
    tile: TileId,
    heights_m: &mut Vec<f32>,
) {
    heights_m.clear();
    heights_m.reserve(HEIGHTS_PER_TILE);
    let samples = records.grid().samples();
    let points = |axis: usize| {
        let (first, last) = (i64::from(tile.first_sample()[axis]), i64::from(samples[axis]) - 1);
        let at =
            move |i: u32| first + (i64::from(i) - i64::from(TILE_BORDER)) * i64::from(tile.cell_samples());
        (0..TILE_CELLS + 1 + 2 * TILE_BORDER).map(move |i| at(i).clamp(0, last) as u32)
    };
    for y in points(1) {
        heights_m.extend(points(0).map(|x| {
            let vertex = records.vertex_at(GridPoint::new(x, y));
            if vertex.class.is_void() { f32::NAN } else { vertex.height_m as f32 }
        }));
    }
}
