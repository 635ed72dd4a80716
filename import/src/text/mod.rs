//! Text files of millions of numbers: cut into blocks between words or lines, read on all cores, passed on in order.
//!
//! Nothing is held but the blocks under way. Cost: a quarter of a mebibyte of text and the numbers in it, twice, for each thread.

mod blocks;
mod number;
mod sequence;

pub(crate) use blocks::{Cut, each_block};
pub(crate) use number::{is_blank, number, shown, words};
pub(crate) use sequence::Sequence;
