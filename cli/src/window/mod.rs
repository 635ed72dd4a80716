//! `terrasoar view`: a window that a terrain is flown over in.
//!
//! `camera`, `coordinates`, `pick`, `flights`, `settings`, `keys`, `hand`, `job`, `meter` and `workshop` know no window and are tested by themselves; `screen` and
//! `overlay` know no terrain; `viewer` puts a frame together, `events` brings it the window's events. A frame is drawn only when something
//! moves or was touched. **What fails while the window is open is shown in the window.**

mod camera;
mod coordinates;
mod display;
mod events;
mod flights;
mod hand;
mod heights;
mod history;
mod job;
mod keep;
mod keys;
mod meter;
mod overlay;
mod panel;
mod pick;
mod screen;
mod settings;
mod stage;
mod threads;
mod tool;
mod viewer;
mod wake;
mod workshop;

use crate::fit;
use anyhow::Result;
use std::path::PathBuf;
use terrasoar::flight::Flight;
use terrasoar::view::{ErrorMetric, Viewport};
use terrasoar_layout::read::terrain::Terrain;

pub(crate) use keys::list as list_of_keys;

/// What was asked for on the command line.
#[derive(Debug, Clone, Default)]
pub(crate) struct Plan {
    /// Terrain file.
    pub file: PathBuf,
    /// Whether it was made of elevation data and lies in the folder for caches, where edits would be lost.
    pub is_kept: bool,
    /// Edits of it in a file of their own.
    pub overlay: Option<PathBuf>,
    /// Flight to play.
    pub flight: Option<PathBuf>,
    /// Style, ramp, tolerance, exaggeration and size instead of what is remembered.
    pub style: Option<String>,
    /// Name of a ramp.
    pub ramp: Option<String>,
    /// Pixels.
    pub tolerance_px: Option<f64>,
    /// How errors are measured.
    pub metric: Option<ErrorMetric>,
    /// Factor on heights.
    pub exaggeration: Option<f64>,
    /// Size of the window in pixels.
    pub size_px: Option<[u32; 2]>,
    /// Whether to tell on standard output what happens, for programs that drive the window.
    pub narrate: bool,
    /// Files to open as if they had been dropped.
    pub drop: Vec<PathBuf>,
    /// Frames after which to end.
    pub exit_after_frames: Option<u64>,
    /// Frames after which the device is thrown away, to try how that goes.
    pub lose_device_after_frames: Option<u64>,
    /// Memory for pages of the terrain, in bytes.
    pub cache_bytes: u64,
}

/// Shows the window until it is closed.
///
/// # Errors
/// A terrain or flight that cannot be opened, before there is a window; no display; no adapter.
pub(crate) fn run(plan: Plan) -> Result<()> {
    let terrain = match &plan.overlay {
        Some(overlay) => Terrain::open_with_overlay_unmapped(&plan.file, overlay)?,
        None => Terrain::open_unmapped(&plan.file)?,
    };
    let flight = plan.flight.as_deref().map(Flight::read).transpose()?;
    // What is only strange is said in the window.
    if let (Some(flight), Some(path)) = (&flight, &plan.flight) {
        fit::strange(&terrain, flight, path, Viewport::default()).map_err(anyhow::Error::msg)?;
    }
    let event_loop =
        winit::event_loop::EventLoop::with_user_event().build().map_err(|e| display::refusal(&e))?;
    events::run(event_loop, plan, terrain, flight)
}
