//! The Terrasoar terrain file. Elevation data go in, error bounds and nested spheres are computed, and pages come out; and there are readers of these.
//!
//! A terrain file holds in four bytes everything that view-dependent refinement needs of a vertex: height, error bound, radius. Their order is such that
//! a view's vertices lie on few pages of 4 KiB. This crate knows bytes and knows no camera. Package `terrasoar` flies over the file.
//!
//! # Building and reading
//!
//! ```
//! # #[cfg(feature = "files")]
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use terrasoar_layout::build::{BuildOptions, build};
//! use terrasoar_layout::dem::{MemoryDem, SampleType};
//! use terrasoar_layout::progress::Silent;
//! use terrasoar_layout::read::terrain::Terrain;
//!
//! let dem = MemoryDem::from_fn([65, 65], SampleType::I16, |x, y| f64::from(x * y / 8));
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("slope.iqt");
//! let header = build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 30.0]), &Silent)?;
//! assert_eq!(header.grid.samples(), [65, 65]);
//!
//! let terrain = Terrain::open(&path)?;
//! assert_eq!(terrain.height_m(30.0 * 64.0, 30.0 * 64.0)?, Some(512.0));
//! assert_eq!(terrain.height_m(-1.0, 0.0)?, None, "outside");
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "files"))]
//! # fn main() {}
//! ```
//!
//! Without the feature `files` nothing of the system is needed: a terrain is opened by [`Terrain::from_source`](read::terrain::Terrain::from_source) from
//! [bytes in memory](file::source::MemorySource) or whatever else is a [`Source`](file::source::Source), on any target.
//!
//! # The way through the modules
//!
//! | to | there is |
//! |---|---|
//! | hand elevation data over | [`dem`]: a [`DemSource`](dem::DemSource), which package `terrasoar-import` makes of files |
//! | make a terrain file | `build` |
//! | open one, and get from a place to a height or a record | [`read`]: [`terrain`](read::terrain), mapped [`records`](read::records), a [`pool`](read::pool) of pages, and the [`loader`](read::loader) whose threads fill it |
//! | know where a vertex lies in the file | [`grid`] |
//! | make a file a tenth as large | `packing` |
//! | put a picture on the ground, and read its tiles | [`imagery`] |
//! | change heights, undo, commit | [`edit`] |
//! | find out whether a file is sound | `verify` |
//! | know the bytes | [`file`](mod@file), and FORMAT.md, which is exact |
//! | say what is wrong, in words | [`LayoutError`], [`Remedy`], [`words`] |
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
#[cfg(feature = "files")]
pub mod machine;
pub mod mix;
mod numbers;
mod packed;
#[cfg(feature = "files")]
pub mod packing;
pub mod portable;
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

/// The program in README.md, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
