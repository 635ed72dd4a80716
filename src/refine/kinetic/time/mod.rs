//! When a vertex is to be looked at again: clocks, words, and the queue they wait in.

pub(crate) mod certificate;
pub(crate) mod clocks;
pub(crate) mod queue;
