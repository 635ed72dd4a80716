//! Mosaics: what counts where, bytes that do not depend on threads and order, files that are missing or damaged, virtual rasters. Hostile ones are in `hostile_grids`, which counts memory.

#[path = "../import_support/mod.rs"]
mod import_support;

mod damage;
mod ground;
mod levels;
mod priority;
mod repeat;
mod vast;
mod virtuals;
