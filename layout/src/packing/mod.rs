//! Terrain files packed into a third to a tenth of their bytes, and unpacked again (FORMAT.md, section 9).
//!
//! Packed terrain is opened as any other: [`Terrain::open`](crate::read::terrain::Terrain::open). How it is read, and how a tile is coded, is module `packed`.

mod compare;
mod front;
mod gather;
mod listed;
mod pack;
mod packer;
mod unpack;

pub(crate) use compare::Check;
pub(crate) use pack::publish_packed;
pub use pack::{Packed, pack};
pub use unpack::unpack;
