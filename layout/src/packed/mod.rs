//! Packed terrain: the records of a terrain in a tenth of the room, every bit of them (FORMAT.md, section 9).
//!
//! * `shape`: how a terrain is cut into groups of tiles, each of which is read by itself.
//! * `walk`: the way through a tile, for writing and reading; `plane` predicts heights, `rules` knows what follows from them.
//! * `coder`, `model`, `token`, `bits`: values into bytes and back.
//!
//! Invariant: what is read is what was written, or an error; no bytes make reading panic, or take memory beyond a tile's.

mod bits;
mod coder;
mod model;
mod plane;
mod rules;
mod shape;
mod tile;
mod token;
mod walk;

#[cfg(test)]
mod tests;
