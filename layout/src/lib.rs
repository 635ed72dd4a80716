//! The Terrasoar terrain file: elevation data in, error bounds and nested spheres computed, pages out, and a reader of it.
//!
//! The way data takes: `terrasoar_import` turns a DEM into a [`dem::DemSource`]; [`build`] computes what refinement needs and writes
//! the file that FORMAT.md specifies; [`terrain`] opens it. This crate knows bytes and knows no camera.
mod bound;
pub mod build;
pub mod bytes;
pub mod dem;
pub mod directory;
pub mod disk;
pub mod edit;
pub mod edited;
pub mod error;
pub mod file;
pub mod grid;
pub mod header;
pub mod imagery;
pub mod kinds;
mod layers;
pub mod loader;
mod numbers;
pub mod octave;
mod opening;
pub mod order;
pub(crate) mod overlay;
pub mod pool;
pub mod prefetch;
pub mod printable;
pub mod progress;
pub(crate) mod publish;
pub mod record;
pub mod records;
pub mod remedy;
pub mod source;
pub mod store;
pub mod terrain;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod unfinished;
pub mod unused;
pub mod verify;
pub mod words;

pub use error::LayoutError;
pub use file::atomic as atomic_file;
pub use remedy::Remedy;
