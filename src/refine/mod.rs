//! Engines that turn a view into a conforming mesh: [`naive`] is the definition, [`soar`] visits the whole active tree every frame,
//! [`smart`] remembers how long each vertex's status holds.
//!
//! All engines draw the same triangles for the same view. They read records and nothing else, and report what they
//! read to a [`Probe`] that costs nothing when nobody listens.

mod clock;
pub mod naive;
pub mod smart;
pub mod soar;
mod strip;

use crate::mesh::Triangle;
use crate::view::View;
use terrasoar_layout::grid::GridPoint;

/// Hears what a refinement does. The methods are empty unless a listener wants them.
pub trait Probe {
    /// The record at `slot` was read.
    #[inline(always)]
    fn read(&mut self, slot: u64) {
        let _ = slot;
    }

    /// The triangle (apex; b, d) is split in this frame.
    #[inline(always)]
    fn split(&mut self, apex: GridPoint, b: GridPoint, d: GridPoint) {
        let _ = (apex, b, d);
    }
}

/// Hears nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unobserved;

impl Probe for Unobserved {}

/// A refinement algorithm over one terrain.
pub trait Engine {
    /// Brings the mesh to `view`; returns the vertex tests that took.
    fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> u64;

    /// Calls `visit` with every triangle of the mesh, counter-clockwise, also those that are not drawn
    /// (see [`crate::mesh::is_drawn`]).
    fn for_each_triangle(&self, visit: &mut dyn FnMut(Triangle));
}
