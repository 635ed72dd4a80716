//! Terrain files with nonsense in them and right checksums, for tests and fuzzing: what a hostile or faulty writer could make.
//!
//! | part | what |
//! |---|---|
//! | [`reseal`], [`reseal_overlay`] | makes every checksum right, bottom up |
//! | [`Mutation`] | one change of a part that matters, told by eight bytes |
//! | [`Sealed`] | a terrain file, and perhaps an overlay over it, mutated and sealed by a recipe of mutations |
//! | [`mutate_packed`], [`reseal_packed`] | the same for packed files |
//! | [`seeds`], [`packed_seeds`] | small sound files to begin with |
//! | `Stages`, `Way` | what unpacking is made of, to be measured |
//! | [`is_thorough`], [`one_in`] | whether tests try all they could, or a part |
//! | [`exercise`] | everything that this crate does with a file |
//!
//! Invariant: mutating and sealing never panic or take long, whatever the bytes; equal recipes give equal files. Cost: a few checksums of the file.

mod exercise;
mod image;
mod mutation;
mod packed;
mod parts;
mod seal;
mod sealed;
mod seeds;
mod share;

#[cfg(feature = "testing")]
pub use crate::packed::stages::{Stages, Way};
pub use exercise::exercise;
pub use mutation::Mutation;
pub use packed::{mutate_packed, reseal_packed};
pub use seal::{Counts, reseal, reseal_overlay};
pub use sealed::Sealed;
pub use seeds::{Seed, packed_seeds, seeds};
pub use share::{is_thorough, one_in};
