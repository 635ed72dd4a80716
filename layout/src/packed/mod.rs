//! Packed terrain: the records of a terrain in a tenth of the room, every bit of them (FORMAT.md, section 9).
//!
//! * `shape`: how a terrain is cut into groups of tiles, each of which is read by itself.
//! * `walk`: the way through a tile, for writing and reading; `plane` predicts heights, `rules` knows what follows from them.
//! * `container`, `places`, `source`: a packed file, read as the terrain file that it was made of. [`pack`](pack()) makes one, [`unpack`](unpack()) that terrain file again.
//! * `coder`, `model`, `token`, `bits`: values into bytes and back.
//!
//! Invariant: what is read is what was written, or an error; no bytes make reading panic, or take memory beyond a tile's.

mod bits;
mod cache;
mod coder;
mod container;
mod model;
#[cfg(feature = "files")]
mod pack;
mod places;
mod plane;
mod rules;
mod shape;
mod source;
mod tile;
mod token;
#[cfg(feature = "files")]
mod unpack;
mod walk;

pub(crate) use container::{PACKED_VERSION, is_packed, only_read};
#[cfg(feature = "files")]
pub use pack::{Packed, pack};
pub(crate) use source::PackedSource;
#[cfg(feature = "files")]
pub use unpack::unpack;

#[cfg(test)]
mod tests;
