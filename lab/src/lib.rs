//! What flights cost, measured and shown: figures of reading, reports, plots.
//!
//! [`iobench`] counts and times what a flight's reads touch, under layouts and caches that the engine itself does not have; [`report`] writes
//! comparisons of engines and of reading as CSV, JSON, plots and a page. The engine knows nothing of it.
//!
//! ```
//! use terrasoar::flyover::EngineKind;
//! use terrasoar::refine::Culling;
//! use terrasoar::{MappedTerrain, View};
//! use terrasoar_lab::iobench::{CountOptions, LayoutKind, Prefetch, Reader, count};
//! # use terrasoar_layout::{build::{BuildOptions, build}, dem::{MemoryDem, SampleType}, progress::Silent};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("alps.iqt");
//! # let dem = MemoryDem::from_fn([257, 257], SampleType::I16, |x, y| f64::from((x * 7) ^ (y * 5)));
//! # build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 30.0]), &Silent)?;
//! let terrain = MappedTerrain::open(&path)?;
//! let views = [0.0, 50.0, 100.0].map(|north| View::new([3800.0, 500.0 + north, 900.0], 0.0, -20.0));
//! let options = CountOptions::default().layouts(vec![LayoutKind::Ours, LayoutKind::Row]).preloads(vec![Prefetch::None]);
//! let runs =
//!     count(terrain.file(), &views, Culling::Vertices, Reader::Engine(EngineKind::Kinetic), &options, &mut |_| {})?;
//! for run in &runs {
//!     println!("{}: {} pages for the first view", run.layout.name(), run.frames[0].pages);
//! }
//! # assert!(runs[0].frames[0].pages < runs[1].frames[0].pages);
//! # Ok(())
//! # }
//! ```
//!
//! | to | there is |
//! |---|---|
//! | count the pages that a flight's reads touch, under four layouts and any cache | [`iobench::count()`] |
//! | fly over pages that threads read, and see what comes late | [`iobench::fly_pooled`] |
//! | time a flight over a mapped file, cold and warm | [`iobench::time()`], [`iobench::kernel`] |
//! | write a comparison of engines for people and for programs | [`report::ComparisonReport`] |
//! | colour differences | [`diverging`] |
//! | write a mesh as PLY, OBJ, STL or GLB | [`mesh_file`] |
//! | keep a picture as PNG that is known again as ours | [`picture`] |
//!
//! The frames that reports are about come from [`replay`](terrasoar::flyover::replay).

pub mod diverging;
pub mod iobench;
pub mod made;
pub mod mesh_file;
pub mod picture;
pub mod report;
