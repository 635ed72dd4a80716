//! A terrain file opened: [`terrain`], and from a slot to a vertex by [`records`] that are mapped or a [`pool`] of pages that are read.
//!
//! Engines are written for [`store`], which is all of these.

pub mod edited;
pub mod heights;
pub mod kinds;
#[cfg(feature = "files")]
pub(crate) mod layers;
pub mod loader;
pub mod pool;
pub mod prefetch;
pub mod records;
pub mod store;
pub mod terrain;
pub mod window;
