//! Engines that turn a view into a conforming mesh: [`naive`] is the definition, [`soar`] visits the whole active tree every frame,
//! [`smart`] remembers how long each vertex's status holds, [`kinetic`] keeps the mesh and looks only at what is over.
//!
//! All engines draw the same triangles for the same view. They read records and nothing else, and report what they
//! read to a [`Probe`], which costs nothing where it is not used.

pub mod change;
mod clock;
pub mod kinetic;
mod listener;
pub mod naive;
pub mod smart;
pub mod soar;
mod strip;

use crate::mesh::Triangle;
use crate::view::View;
use change::GroundChange;
use terrasoar_layout::read::store::RecordStore;

/// Where what lies out of view is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Culling {
    /// Vertices whose sphere lies outside the view are not refined: the mesh is SOAR's, coarse where it is not seen.
    #[default]
    Vertices,
    /// The mesh is refined all around; clusters of triangles outside the view are not drawn. Turning changes nothing in the mesh.
    Clusters,
}

impl Culling {
    /// Both ways.
    pub const ALL: [Self; 2] = [Self::Vertices, Self::Clusters];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Vertices => "vertices",
            Self::Clusters => "clusters",
        }
    }
}

/// What an update did, beyond its vertex tests. Engines that keep no mesh from frame to frame leave it at 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Work {
    /// Live ranges that were over.
    pub expired: u64,
    /// Vertex tests.
    pub tests: u64,
    /// Vertices split: one or two triangles each.
    pub splits: u64,
    /// Vertices merged.
    pub merges: u64,
    /// Triangle slots written.
    pub slots_written: u64,
    /// Bytes of vertices and triangles that a GPU receives.
    pub patch_bytes: u64,
    /// Vertices that are to be tested or split and were not, for want of budget or of pages; 0 without a budget over records that are all at hand.
    pub late: u64,
    /// Those of them whose own record is away.
    pub unread: u64,
    /// Largest error on the screen that late vertices may leave, in pixels, the ground being a sample spacing away at the least; 0 if none exceeds the
    /// tolerance. With a budget of time, and more than 8,192 late vertices, the largest of so many of them.
    pub late_error_px: f64,
}

/// The parts of an update, for those who time them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Finding out what is over.
    Scan,
    /// Testing it.
    Test,
    /// Splitting, merging and telling.
    Apply,
    /// After the last part.
    Done,
}

/// Hears what a refinement does. The methods are empty unless a listener wants them.
pub trait Probe {
    /// Whether [`Probe::read`] does anything.
    const HEARS_READS: bool = true;

    /// Whether [`Probe::foreseen`] is to hear of all that can be foreseen. Else what is in memory is taken from there, which is quicker.
    const HEARS_FORESEEN: bool = false;

    /// The record at `slot` was read.
    #[inline(always)]
    fn read(&mut self, slot: u64) {
        let _ = slot;
    }

    /// The record at `slot` was left unread: it was certain that its vertex does not show. Counts as read for those who do not tell the two apart.
    #[inline(always)]
    fn foreseen(&mut self, slot: u64) {
        self.read(slot);
    }

    /// The update goes on to its next part.
    #[inline(always)]
    fn phase(&mut self, phase: Phase) {
        let _ = phase;
    }
}

/// Hears nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Probe for Unobserved {
    const HEARS_READS: bool = false;
}

/// A refinement algorithm over one terrain.
pub trait Engine {
    /// Where its records come from.
    type Store: RecordStore;

    /// The store, to be given pages between two frames. What it holds may change in no other way; where a record changes that was there before,
    /// [`Engine::ground_changed`] follows.
    fn store_mut(&mut self) -> &mut Self::Store;

    /// The ground was edited: called between two frames, after pages of the store that changed have been replaced. The next update's mesh is the one over the
    /// edited ground.
    fn ground_changed(&mut self, change: &GroundChange<'_>);

    /// Brings the mesh to `view`; returns the vertex tests that took.
    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64;

    /// Calls `visit` with every triangle of the mesh, counter-clockwise, also those that are not drawn
    /// (see [`crate::mesh::is_drawn`]).
    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle));

    /// What the last update did.
    fn work(&self) -> Work {
        Work::default()
    }
}
