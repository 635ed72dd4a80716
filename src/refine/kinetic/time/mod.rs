//! When a vertex must be looked at again: clocks, words, and the queue in which words wait.

pub(crate) mod certificate;
pub(crate) mod clocks;
pub(crate) mod course;
mod curve;
pub(crate) mod queue;
mod ring;
mod swing;
mod wheel;
