//! Ground under a moving eye: a terrain, the engine that refines its mesh, and its edits, as one thing.
//!
//! A frame is [`Ground::update`]. Code that keeps a copy of the mesh, on a graphics device for example, calls [`Ground::change_since`] with the step that the copy is at. It gets what the copy
//! lacks: the patch of one update, or the whole mesh if the copy missed more than one. So a copy cannot fall behind unnoticed. [`Ground::height_at`] gives heights and never waits.
//!
//! Invariants: whatever the engine, the mesh of a view is the same once its pages are at hand; edits are seen by the next update. Cost: the engine's own, and one call through a table a
//! frame.

#[cfg(feature = "files")]
mod editing;
mod engine;
mod full;
#[cfg(feature = "files")]
mod hand;
mod mapped;
mod options;
mod ray;
#[cfg(feature = "files")]
mod room;
mod samples;
mod streamed;
#[cfg(feature = "files")]
mod ticket;

#[cfg(feature = "files")]
pub use editing::Edited;
pub use engine::Refined;
pub use mapped::PictureEngine;
pub use options::StreamOptions;
pub use ray::RayHit;
pub use samples::HeightTile;
#[cfg(feature = "files")]
pub use ticket::{CommitFailed, CommitTicket, Saved};

use crate::refine::Culling;
use crate::refine::kinetic::{Budget, Patch};
use crate::stream::{GroundPatch, HeightAt};
use crate::view::View;
#[cfg(feature = "files")]
use editing::Editing;
use engine::MeshEngine;
use glam::DVec3;
use ray::Ray;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::SampleRect;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::file::header::FileState;
use terrasoar_layout::read::terrain::Terrain;

/// Ground that is flown over.
pub struct Ground<'t> {
    engine: Box<dyn MeshEngine + 't>,
    terrain: Opened<'t>,
    step: MeshStep,
    /// Views of the last two updates.
    views: [Option<View>; 2],
    /// The right to edit, from the first edit on.
    #[cfg(feature = "files")]
    editing: Option<Editing>,
    /// The state of the file that is shown while there is no editing session.
    seen: FileState,
    /// The first opened terrain's number.
    land: u64,
    options: StreamOptions,
    /// Rectangles of samples whose heights changed, the newest last, and how many there were before these.
    edited: VecDeque<SampleRect>,
    edited_before: u64,
    errors: VecDeque<LayoutError>,
}

/// The terrain under it.
enum Opened<'t> {
    Mapped(&'t Terrain),
    Streamed(Arc<Terrain>),
}

/// The state of one ground's mesh after one update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MeshStep {
    /// Number of the mesh in this process: of the ground, anew whenever its mesh begins anew.
    mesh: u64,
    /// Updates of it.
    updates: u64,
}

/// What a copy of the mesh lacks.
#[derive(Debug)]
pub enum MeshChange<'g> {
    /// Nothing.
    Same,
    /// This, to be applied to the copy.
    Patch(&'g Patch),
    /// All: this is to be applied to an empty mesh.
    Whole(Patch),
}

/// Rectangles of edits remembered for those who ask what changed.
const EDITED_KEPT: usize = 1024;

impl<'t> Ground<'t> {
    /// Ground whose pages are read into memory of a fixed size, and that can be edited.
    ///
    /// # Errors
    /// The first page cannot be read, or the system gives no thread.
    pub fn streamed(terrain: Arc<Terrain>, options: &StreamOptions) -> Result<Ground<'static>, LayoutError> {
        let engine = streamed::streamed(&terrain, options)?;
        Ok(Ground::new(engine, Opened::Streamed(terrain), *options))
    }

    /// Ground whose records all have an answer at once: in memory, mapped, or read there and then if the source lends no bytes, into [128 MiB](terrasoar_layout::read::kinds::CACHE_BYTES). What cannot be read
    /// [`Ground::take_error`] tells after the update.
    ///
    /// # Errors
    /// Damage of the directory, all of which is read where the source lends its bytes.
    pub fn mapped(
        terrain: &'t Terrain,
        engine: PictureEngine,
        culling: Culling,
    ) -> Result<Self, LayoutError> {
        Self::reading(terrain, engine, culling, None)
    }

    /// As [`Ground::mapped`], with records that are read into `cache_bytes` of memory when they are needed, whatever the source; with `None` it is the same.
    ///
    /// # Errors
    /// As [`Ground::mapped`].
    pub fn reading(
        terrain: &'t Terrain,
        engine: PictureEngine,
        culling: Culling,
        cache_bytes: Option<u64>,
    ) -> Result<Self, LayoutError> {
        let options = StreamOptions::default();
        let engine = mapped::mapped(terrain, engine, culling, cache_bytes)?;
        Ok(Self::new(engine, Opened::Mapped(terrain), options))
    }

    fn new(engine: Box<dyn MeshEngine + 't>, terrain: Opened<'t>, options: StreamOptions) -> Self {
        let opened: &Terrain = match &terrain {
            Opened::Mapped(terrain) => terrain,
            Opened::Streamed(terrain) => terrain,
        };
        let (seen, land) = (opened.header().state(), opened.instance());
        Self {
            engine,
            terrain,
            seen,
            land,
            options,
            step: MeshStep::first(),
            views: [None; 2],
            #[cfg(feature = "files")]
            editing: None,
            edited: VecDeque::new(),
            edited_before: 0,
            errors: VecDeque::new(),
        }
    }

    /// The terrain as it was opened, or as it was rewritten for an edit that it had no room for; edits since then are not in it.
    pub fn terrain(&self) -> &Terrain {
        match &self.terrain {
            Opened::Mapped(terrain) => terrain,
            Opened::Streamed(terrain) => terrain,
        }
    }

    /// A number that the ground keeps where its file is rewritten for an edit: the [`instance`](Terrain::instance) of the terrain that it began with.
    pub fn land(&self) -> u64 {
        self.land
    }

    /// The terrain to read from with others, if it is not mapped.
    pub fn shared_terrain(&self) -> Option<&Arc<Terrain>> {
        match &self.terrain {
            Opened::Mapped(_) => None,
            Opened::Streamed(terrain) => Some(terrain),
        }
    }

    /// Refines the mesh for a view with what is in memory. Streamed ground waits for its first view only. For a view that is not sound ([`View::is_sound`]) the mesh stays that of
    /// the last one that was; without any there is no mesh yet, and all figures are 0.
    pub fn update(&mut self, view: &View) -> Refined {
        #[cfg(feature = "files")]
        self.settle();
        let Some(view) = Some(view).filter(|view| view.is_sound()).or(self.views[1].as_ref()).copied() else {
            return Refined::default();
        };
        let view = &view;
        let refined = self.engine.update(view);
        self.step.updates += 1;
        self.views = [self.views[1], Some(*view)];
        refined
    }

    /// The view of the last update.
    pub fn view(&self) -> Option<&View> {
        self.views[1].as_ref()
    }

    /// The views of the last two updates, the older one first: they tell where the eye is going.
    pub fn last_views(&self) -> [Option<View>; 2] {
        self.views
    }

    /// The state of the mesh.
    pub fn step(&self) -> MeshStep {
        self.step
    }

    /// What a copy of the mesh lacks that was complete at step `seen`; of none if there is no copy.
    pub fn change_since(&self, seen: Option<MeshStep>) -> MeshChange<'_> {
        match seen {
            Some(seen) if seen == self.step => MeshChange::Same,
            Some(seen) if seen.mesh == self.step.mesh && seen.updates + 1 == self.step.updates => {
                MeshChange::Patch(self.engine.patch())
            }
            _ => MeshChange::Whole(self.engine.whole()),
        }
    }

    /// Calls `visit` with the corners of every triangle of the mesh, counter-clockwise from above, in metres east, north and up of the south-west
    /// sample, heights not exaggerated. Takes a copy of the mesh.
    pub fn for_each_triangle(&self, visit: &mut dyn FnMut([DVec3; 3])) {
        let whole = self.engine.whole();
        let [dx, dy] = self.terrain().grid().spacing_m();
        let slots = whole.vertices.iter().map(|(slot, _)| *slot as usize + 1).max().unwrap_or(0);
        let mut places = vec![DVec3::NAN; slots];
        for (slot, v) in &whole.vertices {
            places[*slot as usize] =
                DVec3::new(f64::from(v.x) * dx, f64::from(v.y) * dy, f64::from(v.height_m));
        }
        for (_, [a, b, c]) in whole.triangles.iter().filter(|(_, [a, b, _])| a != b) {
            visit([a, b, c].map(|slot| places[*slot as usize]));
        }
    }

    /// Height of the ground, edits included, at a place in metres east and north of the south-west sample, from what is in memory.
    pub fn height_at(&self, east_m: f64, north_m: f64) -> HeightAt {
        self.engine.height_at(east_m, north_m)
    }

    /// Where a ray from a place in metres east, north and up first meets the ground, edits included, from above or from below, within `longest_m` metres; from what is in memory. `None` where it
    /// meets none, and for numbers that make no ray.
    pub fn ray_hit(&self, from_m: [f64; 3], direction: [f64; 3], longest_m: f64) -> Option<RayHit> {
        let grid = self.terrain().grid();
        let height = |east_m: f64, north_m: f64| self.engine.height_at(east_m, north_m);
        let range_m = self.engine.height_range_m();
        Ray::new(from_m, direction)?.hit(longest_m, grid.spacing_m(), grid.extent_m(), range_m, height)
    }

    /// Asks for the pages that the exact height at a place needs; they are in memory some updates later.
    pub fn want_height(&mut self, east_m: f64, north_m: f64) {
        self.engine.want_height(east_m, north_m);
    }

    /// Heights of a tile of samples, voids not a number, rows from the south; replaces what `heights_m` held. `false` if they are not in memory yet: then they have been asked for.
    pub fn tile_heights_m(&mut self, tile: HeightTile, heights_m: &mut Vec<f32>) -> bool {
        self.engine.heights_m(tile, heights_m)
    }

    /// Lowest and highest height in metres, edits included.
    pub fn height_range_m(&self) -> [f64; 2] {
        self.engine.height_range_m()
    }

    /// Metres from the first to the last sample, east and north.
    pub fn extent_m(&self) -> [f64; 2] {
        self.terrain().grid().extent_m()
    }

    /// Bounds what one update may do from now on. Whether the engine can be bounded.
    pub fn set_budget(&mut self, budget: Budget) -> bool {
        self.options.budget = budget;
        self.engine.set_budget(budget)
    }

    /// Culls in another way from now on; the next update begins a mesh anew, and edits stay. Whether it can: only streamed ground does.
    pub fn set_culling(&mut self, culling: Culling) -> bool {
        let can = self.engine.set_culling(culling);
        if can {
            self.options.culling = culling;
            self.step = MeshStep::first();
        }
        can
    }

    /// Takes over edits that another made of this ground's file, in memory so far: the next update shows them. Whether it can: only streamed ground does.
    ///
    /// # Errors
    /// Edits of another terrain.
    pub fn take_edits(&mut self, patch: GroundPatch) -> Result<bool, LayoutError> {
        let samples = patch.samples.clone();
        let can = self.engine.take_edits(patch)?;
        if can {
            self.note_edited(&samples);
        }
        Ok(can)
    }

    fn note_edited(&mut self, samples: &[SampleRect]) {
        self.edited.extend(samples);
        while self.edited.len() > EDITED_KEPT {
            self.edited.pop_front();
            self.edited_before += 1;
        }
    }

    /// Rectangles of samples whose heights changed since so many of them had been told, and how many there are now. `None` instead of them where too many
    /// were missed: anything may have changed then.
    pub fn edited_since(&self, told: u64) -> (Option<Vec<SampleRect>>, u64) {
        let now = self.edited_before + self.edited.len() as u64;
        let missed = now.saturating_sub(told) as usize;
        let rects = (told >= self.edited_before && told <= now)
            .then(|| self.edited.iter().skip(self.edited.len() - missed).copied().collect());
        (rects, now)
    }

    /// Takes notice that edits are in the file: these pages lie there now, as they were told last.
    pub fn relocate(&mut self, places: &[(u64, Entry)]) {
        self.engine.relocate(places);
    }

    /// Edited pages kept in memory, for they are not in the file yet.
    pub fn held_pages(&self) -> usize {
        self.engine.held_pages()
    }

    /// Whether what the last view needs is still on its way.
    pub fn is_waiting(&self) -> bool {
        self.engine.is_waiting()
    }

    /// Whether the mesh lacks pages, those that cannot be read included.
    pub fn lacks_pages(&self) -> bool {
        self.engine.lacks_pages()
    }

    /// The oldest error of reading or writing that has not been reported yet. Where a page cannot be read the ground stays coarse. Edits that could not be written are part of the next commit.
    pub fn take_error(&mut self) -> Option<LayoutError> {
        #[cfg(feature = "files")]
        let own = self.editing_error();
        #[cfg(not(feature = "files"))]
        let own = self.errors.pop_front();
        own.or_else(|| self.engine.take_error())
    }
}

impl MeshStep {
    /// Whether both are of one mesh, so that slots mean the same in both.
    pub fn is_of_same_mesh(self, other: Self) -> bool {
        self.mesh == other.mesh
    }

    /// The step before the first update of a mesh of its own number.
    fn first() -> Self {
        static MESHES: AtomicU64 = AtomicU64::new(0);
        Self { mesh: MESHES.fetch_add(1, Ordering::Relaxed), updates: 0 }
    }
}

impl std::fmt::Debug for Ground<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Ground")
            .field("terrain", self.terrain())
            .field("step", &self.step)
            .finish_non_exhaustive()
    }
}
