//! Where the engine meets the renderer: all that is seen of a terrain goes through [`scene`].
//!
//! The engine knows no pixels and the renderer no terrain file; nothing but this module knows both. It uses the libraries only and no part of
//! the command line, so tests and benchmarks take it in as it is.

mod border;
pub(crate) mod drape;
pub(crate) mod feed;
pub(crate) mod full_mesh;
mod options;
pub(crate) mod overview;
mod pending;
pub(crate) mod repaint;
#[allow(dead_code, reason = "windows and tests use more of a scene than pictures do")]
pub(crate) mod scene;
mod sight;
#[allow(dead_code, reason = "pictures without a window are of mapped files")]
pub(crate) mod streamed;
pub(crate) mod studio;
mod tile_reader;
