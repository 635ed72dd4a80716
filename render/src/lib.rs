//! Draws a terrain mesh that changes every frame, through wgpu: patches, normal tiles and image tiles in, pixels out.
//!
//! The crate opens no file, runs no engine (of `terrasoar` it uses plain types alone) and owns no window. The caller has the device, the queue and the target, and
//! says what changed; the renderer records commands into the caller's encoder.
//!
//! # A frame
//!
//! 1. [`Renderer::apply`] takes a [`MeshPatch`]: vertices and triangles that changed, by slot, and the ranges of
//!    triangles that are seen. What is sent to the device is the patch, 36 bytes a vertex and 16 a triangle.
//! 2. [`Renderer::want_tiles`] says which normal tiles the view lacks, most urgent first; [`Renderer::give_tile`] takes their heights.
//!    How many a frame is the caller's choice. Until a tile comes a coarser one is used. Until any comes, triangles are shaded flat.
//!    [`Renderer::want_imagery`] and [`Renderer::give_imagery`] do the same for an image on the ground, if [`Renderer::set_imagery`] says that there is one.
//! 3. [`Renderer::render`] draws ground, walls and sky as a [`Look`] says. An overlay may follow in the same encoder.
//!
//! ```no_run
//! use glam::DVec3;
//! use terrasoar_render::{
//!     Frame, Gpu, HEIGHTS_PER_TILE, Look, MeshPatch, MeshVertex, Offscreen, Renderer, RendererOptions, TerrainShape, View, Viewport,
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let gpu = Gpu::headless_blocking()?;
//! let terrain = TerrainShape { spacing_m: [10.0, 10.0], samples: [3, 3], height_range_m: [0.0, 5.0] };
//! let options = RendererOptions::from(&gpu.capabilities);
//! let mut renderer = Renderer::new(&gpu.device, &gpu.queue, terrain, options)?;
//!
//! // Four corners and the centre of a square, and its four triangles, counter-clockwise.
//! let vertex = |slot: u32, x, y, height_m| {
//!     let flags = MeshVertex::NO_LEVEL;
//!     (slot, MeshVertex { x, y, height_m, error_m: 0.0, radius_m: 0.0, ends: [slot; 2], flags })
//! };
//! let vertices =
//!     [vertex(0, 0, 0, 0.0), vertex(1, 2, 0, 0.0), vertex(2, 2, 2, 0.0), vertex(3, 0, 2, 0.0), vertex(4, 1, 1, 5.0)];
//! let triangles = [(0, [0, 1, 4]), (1, [1, 2, 4]), (2, [2, 3, 4]), (3, [3, 0, 4])];
//! let mut encoder = gpu.device.create_command_encoder(&Default::default());
//! let sent =
//!     renderer.apply(&mut encoder, &MeshPatch { vertices: &vertices, triangles: &triangles, draws: &[0..2, 2..4] })?;
//! assert_eq!(sent.bytes, 5 * 36 + 4 * 16);
//!
//! let eye_m = DVec3::new(-20.0, -30.0, 25.0);
//! let view = View::look_at(eye_m, DVec3::new(10.0, 10.0, 0.0), Viewport::default());
//! for tile in renderer.want_tiles(&view, 4).to_vec() {
//!     let heights_m = vec![0.0; HEIGHTS_PER_TILE];
//!     renderer.give_tile(tile, &heights_m)?;
//! }
//!
//! let picture = Offscreen::new(&gpu.device, view.viewport.size_px())?;
//! let look = Look::named("contours").unwrap_or_default();
//! renderer.render(&mut encoder, picture.target(), Frame { view: &view, refined_for: None, look: &look })?;
//! gpu.queue.submit([encoder.finish()]);
//! gpu.watch.check()?;
//! let rgba = picture.read_rgba(&gpu.device, &gpu.queue)?;
//! # assert_eq!(rgba.len(), 4 * 800 * 600);
//! # Ok(())
//! # }
//! ```
//!
//! # When a device is lost
//!
//! [`DeviceWatch::check`] returns [`RenderError::DeviceLost`] from then on. All that was on the device is gone, but the caller has
//! all of it: make a [`Gpu`] and a [`Renderer`] anew, apply one patch with the whole mesh,
//! set the image if there was one, and give tiles as they are wanted.
//!
//! # How things are
//!
//! * **Space** is metres east, north and up of the terrain's south-west sample at height zero, heights exaggerated. Positions go to the
//!   device as whole grid numbers and are taken from the eye's cell there. So pictures are steady even a thousand kilometres from the origin.
//! * **Depth** is reversed and endless: 1 at the near plane, 0 at infinity.
//! * **Movement.** A vertex enters on the edge that it splits and reaches its own place when the eye has come half the way nearer. That
//!   depends on vertex and eye alone: there are no cracks at any moment.
//! * **Light** comes from tiles of slopes, chosen by distance alone, so that it is steady while triangles come and go.
//! * **An image** is a second content of the same machinery. Its level follows the width of what a pixel covers, taps its length.
//! * **Equal input gives equal bytes** on one driver.

mod attachments;
mod error;
mod frame;
mod gpu;
mod look;
mod material;
mod mesh;
mod offscreen;
mod pipelines;
pub mod ramps;
mod renderer;
#[doc(hidden)]
pub mod shaders;
mod tiles;
mod timing;
mod uniforms;
mod view;
mod words;

pub use error::{RenderError, Result};
pub use frame::{DepthRange, DrawStats, Frame, PassFormat, RendererOptions, Target};
pub use gpu::{Capabilities, DeviceWatch, Gpu};
pub use look::{Contours, Haze, LOOKS, Look, Sun, Surface, Wireframe};
pub use material::{Layer, Layers, Material};
pub use mesh::{MeshPatch, UploadStats};
pub use offscreen::{Offscreen, read_depth_m};
pub use renderer::{Prepared, Renderer};
/// A vertex as the engine hands it out and the device holds it.
pub use terrasoar::refine::kinetic::MeshVertex;
/// The camera of a frame, and the tolerance that its mesh was made for.
pub use terrasoar::view::{View, Viewport};
/// Images and tiles as the terrain file has them. Slopes are in tiles named alike.
pub use terrasoar_layout::imagery::{ImageryShape, TileFormat, TileId};
pub use tiles::{
    HEIGHTS_PER_TILE, ImageryStats, Pyramid, TILE_CELLS, TileStats, height_tile, pack_gradients,
};
pub use view::TerrainShape;
/// The graphics interface of the version that this crate's types are of.
pub use wgpu;
