//! The kinetic engine over records that are all in memory. It never waits, and it takes no edits.

use super::engine::{MeshEngine, Reads, Refined};
use super::full::FullMesh;
use super::samples::{HeightTile, tile_of};
use crate::refine::kinetic::{Budget, Kinetic, Patch};
use crate::refine::{Culling, Engine};
use crate::stream::{HeightAt, height_at};
use crate::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Which engine makes the mesh of a mapped terrain. Both make the same one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PictureEngine {
    /// Changes from frame to frame: the one to fly with.
    #[default]
    Kinetic,
    /// The whole mesh anew every frame: the reference.
    Soar,
}

/// An engine over a terrain.
///
/// # Errors
/// As [`Terrain::records`].
pub(super) fn mapped(
    terrain: &Terrain,
    engine: PictureEngine,
    culling: Culling,
) -> Result<Box<dyn MeshEngine + '_>, LayoutError> {
    Ok(with_records!(terrain.records()?, records => match engine {
        PictureEngine::Kinetic => Box::new(Mapped {
            engine: Kinetic::new(records.clone(), culling),
            reads: Reads::over(&records),
            records,
        }) as Box<dyn MeshEngine + '_>,
        PictureEngine::Soar => Box::new(FullMesh::new(records, culling)),
    }))
}

struct Mapped<'a, C: RecordCodec> {
    engine: Kinetic<Records<'a, C>>,
    records: Records<'a, C>,
    reads: Reads,
}

impl<C: RecordCodec> MeshEngine for Mapped<'_, C> {
    fn update(&mut self, view: &View) -> Refined {
        self.engine.update(view, &mut self.reads);
        let [reads, pages_read] = self.reads.take();
        Refined {
            work: self.engine.work(),
            triangles: self.engine.triangle_count() as u64,
            record_bytes_read: reads * C::BYTES as u64,
            pages_read,
            ..Refined::default()
        }
    }

    fn patch(&self) -> &Patch {
        self.engine.patch()
    }

    fn whole(&self) -> Patch {
        self.engine.whole_patch()
    }

    fn set_budget(&mut self, budget: Budget) -> bool {
        self.engine.set_budget(budget);
        true
    }

    fn heights_m(&mut self, tile: HeightTile, heights_m: &mut Vec<f32>) -> bool {
        tile_of(&self.records, tile, heights_m);
        true
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.records.height_range_m()
    }

    fn height_at(&self, east_m: f64, north_m: f64) -> HeightAt {
        height_at(&self.records, east_m, north_m)
    }
}
