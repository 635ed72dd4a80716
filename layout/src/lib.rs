//! The Terrasoar terrain file: elevation data in, error bounds and nested spheres computed, pages out, and a reader of it.
//!
//! The way data takes: `terrasoar_import` turns a DEM into a [`dem::DemSource`]; [`build`] computes what refinement needs and writes
//! the file that FORMAT.md specifies; [`terrain`](read::terrain) opens it. This crate knows bytes and knows no camera.
#![cfg_attr(not(feature = "files"), allow(dead_code, unused_imports, reason = "what writes files uses it"))]

mod bound;
#[cfg(feature = "files")]
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
#[cfg(feature = "files")]
pub(crate) mod publish;
pub mod read;
pub mod remedy;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
#[cfg(feature = "files")]
pub mod unfinished;
#[cfg(feature = "files")]
pub mod verify;
pub mod words;

pub use error::LayoutError;
pub use remedy::Remedy;
