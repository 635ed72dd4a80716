//! Packed terrain: the records of a terrain in a tenth of the room, every bit of them (FORMAT.md, section 9).
//!
//! * `shape`: how a terrain is cut into groups of tiles, each of which is read by itself.
//! * `walk`: the way through a tile, for writing and reading, `wide` with the instructions there are; `plane` predicts heights, `rules` knows what follows from them.
//! * `exact`: the same of exact records; `way`: either of the two.
//! * `container`, `places`, `source`: a packed file, read as the terrain file that it was made of. Module `packing` makes one, and that terrain file again.
//! * `leaves`: directory leaves of that file, each from its block.
//! * `appended`: what was appended to it since.
//! * `tile`, `blocks`: a tile's records, and where those of a page lie in tiles.
//! * `bounds`: what no error of a segment exceeds.
//! * `coder`, `encoder`, `model`, `token`, `bits`: values into bytes and back.
//!
//! Invariant: what is read is what was written, or an error; no bytes make reading panic, or take memory beyond a tile's.

mod appended;
mod bits;
mod blocks;
pub(crate) mod bounds;
mod cache;
pub(crate) mod coder;
pub(crate) mod container;
pub(crate) mod encoder;
pub(crate) mod exact;
pub(crate) mod leaves;
pub(crate) mod model;
pub(crate) mod places;
mod plane;
pub(crate) mod rules;
pub(crate) mod shape;
pub(crate) mod source;
#[cfg(feature = "testing")]
pub(crate) mod stages;
pub(crate) mod symbols;
pub(crate) mod tile;
pub(crate) mod token;
pub(crate) mod walk;
pub(crate) mod way;
pub(crate) mod wide;

#[cfg(test)]
mod tests;
