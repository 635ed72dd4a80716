//! From new heights to new records, bottom-up, in memory.

pub(crate) mod core;
pub(crate) mod farthest;
#[cfg(feature = "files")]
pub(crate) mod foresight;
pub(crate) mod midway;
pub(crate) mod near;
pub(crate) mod pages;
pub(crate) mod update;
