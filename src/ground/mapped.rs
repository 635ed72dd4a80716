//! An engine over records that all have an answer: in memory, mapped, or read there and then. What cannot be read is told afterwards. It takes no edits.

use super::engine::{MeshEngine, Reads, Refined};
use super::full::FullMesh;
use super::samples::{HeightTile, tile_of};
use crate::refine::kinetic::{Budget, Kinetic, Patch};
use crate::refine::{Culling, Engine};
use crate::stream::{HeightAt, height_at};
use crate::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::edited::EditedRecords;
use terrasoar_layout::read::store::CompleteStore;
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

/// An engine over a terrain, whose pages are read into so much memory where it is given.
///
/// # Errors
/// As [`Terrain::records`].
pub(super) fn mapped(
    terrain: &Terrain,
    engine: PictureEngine,
    culling: Culling,
    cache_bytes: Option<u64>,
) -> Result<Box<dyn MeshEngine + '_>, LayoutError> {
    Ok(match (engine, terrain.cache_bytes(cache_bytes)) {
        (PictureEngine::Kinetic, None) => {
            with_records!(terrain.records()?, records => flown(records, culling))
        }
        // Nothing edits these records. Replays over edited pages have this engine too, so it is compiled once for both.
        (PictureEngine::Kinetic, Some(bytes)) => {
            with_records!(terrain.paged(bytes), records => flown(EditedRecords::new(records), culling))
        }
        (PictureEngine::Soar, None) => with_records!(terrain.records()?, records => whole(records, culling)),
        (PictureEngine::Soar, Some(bytes)) => {
            with_records!(terrain.paged(bytes), records => whole(records, culling))
        }
    })
}

fn flown<'t, S: CompleteStore + 't>(records: S, culling: Culling) -> Box<dyn MeshEngine + 't> {
    let reads = Reads::over(&records);
    Box::new(Mapped { engine: Kinetic::new(records, culling), reads })
}

fn whole<'t, S: CompleteStore + Clone + 't>(records: S, culling: Culling) -> Box<dyn MeshEngine + 't> {
    Box::new(FullMesh::new(records, culling))
}

struct Mapped<S: CompleteStore> {
    engine: Kinetic<S>,
    reads: Reads,
}

impl<S: CompleteStore> MeshEngine for Mapped<S> {
    fn update(&mut self, view: &View) -> Refined {
        self.engine.update(view, &mut self.reads);
        let [reads, pages_read] = self.reads.take();
        Refined {
            work: self.engine.work(),
            triangles: self.engine.triangle_count() as u64,
            record_bytes_read: reads * S::Codec::BYTES as u64,
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
        tile_of(self.engine.store(), tile, heights_m);
        true
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.engine.store().shape().height_range_m
    }

    fn height_at(&self, east_m: f64, north_m: f64) -> HeightAt {
        height_at(self.engine.store(), east_m, north_m)
    }

    fn take_error(&mut self) -> Option<LayoutError> {
        self.engine.store().take_error()
    }
}
