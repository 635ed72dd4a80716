//! Terrasoar: fly over terrain far larger than memory, every visible sample within a tolerance in pixels.
//!
//! The engine half of the project: a [`view::View`] and a terrain file (package `terrasoar-layout`) go in, a conforming triangle mesh comes
//! out. [`refine`] has the engines, [`flyover`] replays recorded [`flight`]s through them and counts, `terrasoar_lab::iobench` counts what they
//! read, `terrasoar_lab::report` shows what they cost. EMBEDDING.md shows how to use it in a program, ARCHITECTURE.md how it is built.

pub mod edits;
pub mod flight;
pub mod flyover;
pub mod ground;
pub mod mesh;
pub mod metric;
pub mod refine;
pub mod sink;
pub mod stats;
pub mod stream;
pub mod terrain;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
pub mod view;

/// The program in EMBEDDING.md, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../EMBEDDING.md")]
struct Embedding;
