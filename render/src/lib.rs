//! Draws a terrain mesh that changes every frame, through wgpu: patches and normal tiles in, pixels out.
//!
//! The crate opens no file and knows no engine. The caller owns device, queue and target.

mod attachments;
mod error;
mod gpu;
mod look;
mod mesh;
mod offscreen;
mod pipelines;
pub mod ramps;
mod renderer;
pub mod shaders;
mod tiles;
mod timing;
mod uniforms;
mod view;

pub use error::{RenderError, Result};
pub use gpu::{Capabilities, DeviceWatch, Gpu};
pub use look::{Contours, Haze, LOOKS, Look, Sun, Surface, Wireframe};
pub use mesh::{MeshPatch, MeshVertex, UploadStats};
pub use offscreen::{Offscreen, read_depth_m};
pub use renderer::{DrawStats, Frame, Renderer, RendererOptions, Target};
pub use tiles::{
    HEIGHTS_PER_TILE, Pyramid, Residency, TILE_BORDER, TILE_CELLS, TileId, TileStats, WantedTiles,
    pack_gradients,
};
pub use view::{FrameView, TerrainShape};
