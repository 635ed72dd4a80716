//! Where the engine meets the renderer: all that is seen of a terrain goes through [`scene`].
//!
//! The engine knows no pixels and the renderer no terrain file; nothing but this module knows both. It owns no window and no
//! device: the caller brings these and says when a frame is drawn.

mod border;
mod drape;
pub mod frame;
pub mod options;
pub mod overview;
pub mod repaint;
pub mod scene;
mod sight;
pub mod studio;
mod tile_reader;
