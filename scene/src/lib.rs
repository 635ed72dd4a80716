//! Where the engine meets the renderer: all that is seen of a terrain goes through [`scene`].
//!
//! The engine knows no pixels and the renderer no terrain file; nothing but this module knows both. It owns no window and no
//! device: the caller brings these and says when a frame is drawn.

mod border;
pub mod drape;
pub mod feed;
pub mod full_mesh;
pub mod mapped;
pub mod options;
pub mod overview;
mod pending;
pub mod repaint;
pub mod scene;
mod sight;
pub mod streamed;
pub mod studio;
mod tile_reader;
