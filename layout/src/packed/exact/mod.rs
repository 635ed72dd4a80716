//! Exact and fine records through a tile and back, every bit of them (FORMAT.md, sections 9.9 and 9.10).
//!
//! A height is predicted in double precision from the twelve coarser ones around it, as those of compact records are. What is coded is how many floating-point numbers lie between the two, of fine records how many codes. Errors and radii
//! are the bits of singles, or their upper halves, or the codes of fine records; those of the two finest levels follow from heights, and those of other levels are coded as what is missing to their parents'.
//!
//! * `form`: the three kinds of records in parts.
//! * `walk`: the way through a tile; `heights`, `codes`, `special` are its steps.
//! * `numbers`: values of up to 64 bits by the coder of values below 65,536.
//! * `rules`: what follows from heights.
//!
//! Invariant: whatever the bytes say, no more values are asked for than the tile's shape gives, and all arithmetic is that of IEEE 754 in one order, so that all machines read the same.

mod codes;
mod form;
mod heights;
mod numbers;
mod rules;
mod scratch;
mod special;
mod walk;

#[cfg(test)]
mod tests;

pub(crate) use form::Form;
pub(crate) use rules::Rules;
pub(crate) use scratch::Scratch;
pub(crate) use walk::walk;
