//! An opened terrain file: [`terrain`], opened by [`opening`]. The way from a slot to a vertex goes through mapped [`records`], through [`paged`] ones that are read when they are asked for, or through a [`pool`] of pages that threads read.
//!
//! Engines are written for the trait in [`store`], which all of these have.

pub mod edited;
pub mod heights;
pub mod kinds;
#[cfg(feature = "files")]
pub(crate) mod layers;
pub mod loader;
pub mod lost;
#[cfg(feature = "files")]
pub(crate) mod opened;
pub mod opening;
pub(crate) mod page_map;
pub mod paged;
pub mod pool;
pub mod prefetch;
pub mod records;
pub mod store;
pub mod terrain;
pub mod window;
