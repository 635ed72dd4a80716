//! Terrasoar: fly over terrain far larger than memory.
pub mod flight;
pub mod flyover;
pub mod mesh;
pub mod metric;
pub mod refine;
pub mod report;
pub mod stats;
pub mod view;
