//! An engine as seen by code that draws its mesh: a mesh, what changed in it, and heights, whatever the engine and the kind of its records.
//!
//! Invariant: the patches since the last [`MeshEngine::whole`], applied to it in order, give the mesh. Cost: the engine's own, and one call through a
//! table a frame.

use super::samples::HeightTile;
use crate::refine::kinetic::{Budget, Patch};
use crate::refine::{Culling, Probe, Work};
use crate::stream::{GroundPatch, HeightAt};
use crate::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::read::store::RecordStore;

/// What an update of the mesh did.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
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
pub(super) trait MeshEngine: Send {
    /// Brings the mesh to a view.
    fn update(&mut self, view: &View) -> Refined;

    /// What the last update changed.
    fn patch(&self) -> &Patch;

    /// The mesh of the last update as a patch to an empty one.
    fn whole(&self) -> Patch;

    /// Bounds what a frame may do. Whether it can.
    fn set_budget(&mut self, budget: Budget) -> bool;

    /// Heights of a tile, voids not a number; replaces what `heights_m` held. `false` if they are not in memory yet: then they have been asked for.
    fn heights_m(&mut self, tile: HeightTile, heights_m: &mut Vec<f32>) -> bool;

    /// Lowest and highest height in metres, edits included.
    fn height_range_m(&self) -> [f64; 2];

    /// Height of the ground at a place in metres east and north.
    fn height_at(&self, east_m: f64, north_m: f64) -> HeightAt;

    /// Takes over edits of the ground. Whether it can.
    fn take_edits(&mut self, patch: GroundPatch) -> Result<bool, LayoutError> {
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

    /// Culls in another way; the next update begins anew. Whether it can.
    fn set_culling(&mut self, culling: Culling) -> bool {
        let _ = culling;
        false
    }

    /// Asks for what the exact height at a place needs.
    fn want_height(&mut self, east_m: f64, north_m: f64) {
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

    /// The oldest error of reading that has not been reported yet.
    fn take_error(&mut self) -> Option<LayoutError> {
        None
    }
}

/// The pages of the records that an update reads, each read a page.
#[derive(Debug, Default)]
pub(super) struct Reads {
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
    pub(super) fn over<S: RecordStore>(_: &S) -> Self {
        Self { slots_a_page: S::records_per_page(), pages: Vec::new() }
    }

    /// How many reads there were, and of how many pages; forgets them.
    pub(super) fn take(&mut self) -> [u64; 2] {
        let reads = self.pages.len() as u64;
        self.pages.sort_unstable();
        self.pages.dedup();
        let pages = self.pages.len() as u64;
        self.pages.clear();
        [reads, pages]
    }
}
