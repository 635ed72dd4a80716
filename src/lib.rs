//! Fly over terrain far larger than memory. A terrain file and a view go in. A triangle mesh without cracks comes out, in which every visible sample is within a tolerance in pixels.
//! A frame costs what has changed since the frame before.
//!
//! # In a program
//!
//! [`Terrain`] is an opened file, [`Ground`] is that terrain under a moving eye, [`View`] is where the eye is. Threads read pages into memory of a fixed size, and no frame
//! waits for one. Where a page is late, the ground is coarse and without holes, and becomes fine once the page has come.
//!
//! ```
//! use terrasoar::{StreamOptions, Terrain, View};
//! # use terrasoar_layout::{build::{BuildOptions, build}, dem::{MemoryDem, SampleType}, progress::Silent};
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("alps.iqt");
//! # let dem = MemoryDem::from_fn([257, 257], SampleType::I16, |x, y| f64::from((x * 7) ^ (y * 5)));
//! # build(&dem, &path, &BuildOptions::default().spacing_m([30.0, 30.0]), &Silent)?;
//!
//! let terrain = Terrain::open(&path)?;
//! let mut ground = terrain.stream(StreamOptions::default().cache_mib(64))?;
//! for step in 0..10 {
//!     let view = View::new([3800.0, 500.0 + 10.0 * f64::from(step), 3000.0], 0.0, -20.0).tolerance_px(1.0);
//!     let told = ground.update(&view);
//!     println!("{} triangles, {} vertex tests", told.triangles, told.work.tests);
//! }
//! let height = ground.height_at(3800.0, 600.0);
//! println!("{:?} m, exact: {}", height.height_m, height.is_exact);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Space is metres east, north and up of the terrain's south-west sample at height zero. Package `terrasoar-scene` draws ground with wgpu, into a render pass of its own or of
//! yours. To draw by other means, use [`Ground::change_since`]. [`Ground::edit`] changes heights at once, [`Ground::commit`] brings them to the disk in the background. Terrain files are made
//! by [`terrasoar_layout::build`](mod@terrasoar_layout::build) from data in memory, and by package `terrasoar-import` or the program from elevation files.
//! docs/embedding in the repository goes through it step by step, with programs that run.
//!
//! # Below the front door
//!
//! * [`refine`]: the engines, and what they report. [`refine::naive`] is the definition, [`refine::kinetic`] what [`Ground`] uses.
//! * [`stream`]: an engine over a pool of pages: which page is asked for, and by when.
//! * [`flight`], [`flyover`], [`stats`]: recorded flights, their replay by any engine, and figures. A replay reads no clock.
//! * [`simplify`](mod@simplify): a mesh of a terrain or a part of it, within a height of every sample, without an eye.
//! * [`edits`]: scripts of edits. [`metric`], [`mesh`], [`view`]: the error on the screen, triangles, the camera.
//! * Package `terrasoar-layout` has the file: reading, building, editing, verifying.
//!
//! Based on: P. Lindstrom and V. Pascucci, "Terrain simplification simplified: a general framework for view-dependent out-of-core visualization", IEEE TVCG 8(3), 2002; X. Bao,
//! R. Pajarola and M. Shafae, "SMART: an efficient technique for massive terrain visualization from out-of-core", VMV 2004.

#![cfg_attr(not(feature = "files"), allow(dead_code, unused_imports, reason = "what writes files uses it"))]

pub mod edits;
pub mod flight;
pub mod flyover;
pub mod ground;
pub mod mesh;
pub mod metric;
pub mod refine;
pub mod simplify;
pub mod sink;
pub mod stats;
pub mod stream;
pub mod terrain;
#[cfg(any(test, feature = "testing"))]
#[doc(hidden)]
pub mod testing;
pub mod view;

#[cfg(feature = "files")]
pub use ground::CommitTicket;
pub use ground::{Ground, StreamOptions};
pub use terrain::{MappedTerrain, Terrain};
pub use terrasoar_layout::LayoutError as Error;
pub use terrasoar_layout::edit::{Area, Brush, Crater, Edit};
pub use view::View;

/// The vectors and matrices of the version that this crate's types are of.
pub use glam;

/// The program in EMBEDDING.md, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../EMBEDDING.md")]
struct Embedding;
