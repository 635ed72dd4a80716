//! An engine as the renderer sees it: what changed in the mesh, and heights for shading, whatever the records' kind and the engine.
//!
//! Invariant: the changes told since the last [`Feed::whole`], applied in order to it, give the mesh. Cost: an engine's update and a copy of its patch.

use terrasoar::refine::kinetic::Patch;
use terrasoar::refine::{Culling, Probe, Work};
use terrasoar::stream::GroundPatch;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::grid::record::{RecordCodec, Vertex};
use terrasoar_layout::imagery::TileId;
use terrasoar_layout::read::records::Records;
use terrasoar_layout::read::store::RecordStore;
use terrasoar_render::{HEIGHTS_PER_TILE, tile_lines};

/// What an update of the mesh did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Refined {
    /// The engine's own account; SOAR fills in its tests only.
    pub work: Work,
    /// Triangles in the mesh.
    pub triangles: u64,
    /// Bytes of records read, every read counted; 0 for SOAR.
    pub record_bytes_read: u64,
    /// Distinct 4 KiB pages of them; 0 for SOAR.
    pub pages_read: u64,
    /// Pages that came from storage; 0 where the file is mapped.
    pub pages_come: u64,
}

/// An engine over a terrain.
pub trait Feed {
    /// Brings the mesh to a view.
    fn update(&mut self, view: &View) -> Refined;

    /// What the last update changed.
    fn patch(&self) -> &Patch;

    /// The mesh of the last update as a patch to an empty one.
    fn whole(&self) -> Patch;

    /// Heights of a tile as the renderer wants them, void not a number; replaces what `heights_m` held. `false` if they are not at hand yet: then they
    /// have been asked for.
    fn heights_m(&mut self, tile: TileId, heights_m: &mut Vec<f32>) -> bool;

    /// Lowest and highest height in metres, edits included.
    fn height_range_m(&self) -> [f64; 2];

    /// Height of the ground in metres at a place in metres east and north, where one is known.
    fn ground_m(&self, east_m: f64, north_m: f64) -> Option<f64>;

    /// Takes over edits of the ground. Whether it can: only feeds of windows do.
    fn ground_changed(&mut self, patch: GroundPatch) -> Result<bool, LayoutError> {
        let _ = patch;
        Ok(false)
    }

    /// Takes notice that edited pages are in the file, at these places.
    fn relocate(&mut self, places: &[(u64, Entry)]) {
        let _ = places;
    }

    /// Edited pages kept in memory, for they are not in the file yet.
    fn held_pages(&self) -> usize {
        0
    }

    /// Culls in another way; the next update begins anew. Whether it can: only feeds of windows do.
    fn set_culling(&mut self, culling: Culling) -> bool {
        let _ = culling;
        false
    }

    /// Asks for what the exact height at a place needs.
    fn want_ground(&mut self, east_m: f64, north_m: f64) {
        let _ = (east_m, north_m);
    }

    /// Whether what the last view needs is still on its way.
    fn is_waiting(&self) -> bool {
        false
    }

    /// Whether the mesh lacks pages, those that cannot be read included.
    fn lacks_pages(&self) -> bool {
        false
    }

    /// What could not be read and nobody has heard of yet.
    fn take_error(&mut self) -> Option<LayoutError> {
        None
    }
}

/// The pages of the records that an update reads, each read a page.
#[derive(Debug, Default)]
pub struct Reads {
    slots_a_page: u64,
    pages: Vec<u64>,
}

impl Probe for Reads {
    fn read(&mut self, slot: u64) {
        self.pages.push(slot / self.slots_a_page);
    }
}

impl Reads {
    /// For the records of a store.
    pub fn over<S: RecordStore>(_: &S) -> Self {
        Self { slots_a_page: S::records_per_page(), pages: Vec::new() }
    }

    /// How many reads there were, and of how many pages; forgets them.
    pub fn take(&mut self) -> [u64; 2] {
        let reads = self.pages.len() as u64;
        self.pages.sort_unstable();
        self.pages.dedup();
        let pages = self.pages.len() as u64;
        self.pages.clear();
        [reads, pages]
    }
}

/// Grid points of a tile and its border, south-west first; those beyond the data are the nearest sample.
pub fn tile_points(samples: [u32; 2], tile: TileId) -> impl Iterator<Item = GridPoint> {
    let [columns, rows] = [0, 1].map(|axis| tile_lines(samples, tile, axis));
    rows.flat_map(move |y| columns.clone().map(move |x| GridPoint::new(x, y)))
}

/// Heights of the points of a tile.
pub fn tile_heights_m<C: RecordCodec>(records: &Records<'_, C>, tile: TileId, heights_m: &mut Vec<f32>) {
    heights_m.clear();
    heights_m.reserve(HEIGHTS_PER_TILE);
    heights_m
        .extend(tile_points(records.grid().samples(), tile).map(|point| shown_m(&records.vertex_at(point))));
}

/// Height of a sample as tiles have it.
pub fn shown_m(vertex: &Vertex) -> f32 {
    if vertex.class.is_void() { f32::NAN } else { vertex.height_m as f32 }
}
