//! The Terrasoar terrain file: elevation data in, paged interleaved-quadtree records out.
pub mod dem;
pub mod error;
pub mod grid;
pub mod import;
pub mod octave;
pub mod order;
pub mod record;
pub mod synth;
