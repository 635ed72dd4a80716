//! What flights cost, measured and shown: figures of reading, reports, plots.
//!
//! [`iobench`] counts and times what a flight's reads touch, under layouts and caches that the engine itself does not have; [`report`] writes
//! comparisons of engines and of reading as CSV, JSON, plots and a page. The engine knows nothing of it.

pub mod iobench;
pub mod picture;
pub mod report;
