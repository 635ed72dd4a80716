//! What flights cost, measured and shown: figures of reading, reports, plots.
//!
//! [`iobench`] counts and times what a flight's reads touch, under layouts and caches that the engine itself does not have; [`report`] writes
//! comparisons of engines and of reading as CSV, JSON, plots and a page. The engine knows nothing of it.
//!
//! ```
//! use terrasoar::flight::FlightFrame;
//! use terrasoar_lab::iobench::{LayoutKind, layouts};
//! ```
//!
//! | to | there is |
//! |---|---|
//! | count the pages that a flight's reads touch, under four layouts and any cache | [`iobench::count()`] |
//! | fly over pages that threads read, and see what comes late | [`iobench::fly_pooled`] |
//! | time a flight over a mapped file, cold and warm | [`iobench::time()`], [`iobench::kernel`] |
//! | write a comparison of engines for people and for programs | [`report::ComparisonReport`] |
//! | keep a picture as PNG that is known again as ours | [`picture`] |
//!
//! The frames that reports are about come from [`replay`](terrasoar::flyover::replay).

pub mod iobench;
pub mod picture;
pub mod report;
