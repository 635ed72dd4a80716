//! Feeds of terrains whose records are all in memory: either engine, and never a wait.

use crate::feed::{Feed, Reads, Refined, tile_heights_m};
use crate::full_mesh::FullMesh;
use terrasoar::refine::kinetic::{Kinetic, Patch};
use terrasoar::refine::{Culling, Engine};
use terrasoar::stream::height_at;
use terrasoar::view::View;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::imagery::TileId;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Which engine makes the mesh. Both make the same one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PictureEngine {
    /// Changes from frame to frame: the one to fly with.
    #[default]
    Kinetic,
    /// The whole mesh anew every frame: the reference.
    Soar,
}

/// The feed of an engine over a terrain; none if the terrain's source lends no bytes.
pub fn feed(terrain: &Terrain, engine: PictureEngine, culling: Culling) -> Option<Box<dyn Feed + '_>> {
    Some(with_records!(terrain.records()?, records => match engine {
        PictureEngine::Kinetic => {
            Box::new(KineticFeed { engine: Kinetic::new(records.clone(), culling), reads: Reads::over(&records), records }) as Box<dyn Feed + '_>
        }
        PictureEngine::Soar => Box::new(FullMesh::new(records, culling)),
    }))
}

struct KineticFeed<'a, C: RecordCodec> {
    engine: Kinetic<Records<'a, C>>,
    records: Records<'a, C>,
    reads: Reads,
}

impl<C: RecordCodec> Feed for KineticFeed<'_, C> {
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

    fn heights_m(&mut self, tile: TileId, heights_m: &mut Vec<f32>) -> bool {
        tile_heights_m(&self.records, tile, heights_m);
        true
    }

    fn height_range_m(&self) -> [f64; 2] {
        self.records.height_range_m()
    }

    fn ground_m(&self, east_m: f64, north_m: f64) -> Option<f64> {
        height_at(&self.records, east_m, north_m).height_m
    }
}
