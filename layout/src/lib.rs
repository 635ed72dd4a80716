//! The Terrasoar terrain file: elevation data in, paged interleaved-quadtree records out.
pub mod dem;
pub mod error;
pub mod import;
pub mod synth;
