//! Terrasoar: fly over terrain far larger than memory.
pub mod flight;
pub mod report;
pub mod stats;
pub mod view;
