//! Engine and renderer together: everything that is drawn of a terrain goes through [`scene`].
//!
//! | to | there is |
//! |---|---|
//! | draw ground that is flown over, into a pass and a depth buffer of its own or of yours | [`scene`] |
//! | take pictures without a window | [`studio`] |
//! | choose how much memory and work it may take | [`options`] |
//! | see a terrain as a whole, or look from a place | [`overview`] |
//! | show pictures on the ground, and what edits change of them | [`repaint`] |
//!
//! The repository's `examples/window` is a program of its own: a window, ground that streams, and a cube that stands on it.
//!
//! The engine knows no pixels, and the renderer knows no terrain file. Only this package knows both. It owns no window and no
//! device: the caller has these and says when a frame is drawn.

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
