//! The Terrasoar terrain file: elevation data in, error bounds and nested spheres computed, pages out, and a reader of it.
//!
//! The way data takes: `terrasoar_import` turns a DEM into a [`dem::DemSource`]; [`build`] computes what refinement needs and writes
//! the file that FORMAT.md specifies; [`terrain`](read::terrain) opens it. This crate knows bytes and knows no camera.
mod bound;
pub mod build;
pub mod dem;
pub mod edit;
pub mod error;
pub mod file;
pub mod grid;
pub mod imagery;
pub mod mix;
mod numbers;
pub mod printable;
pub mod progress;
pub(crate) mod publish;
pub mod read;
pub mod remedy;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
pub mod unfinished;
pub mod verify;
pub mod words;

pub use error::LayoutError;
pub use remedy::Remedy;
