//! `terrasoar view`: a window to fly over a terrain in.

use super::terrain::TerrainArgs;
use super::{parse, picture};
use crate::window::{self, Plan};
use anyhow::Result;
use std::path::PathBuf;
use terrasoar::view::{ErrorMetric, Viewport};
use terrasoar_render::ramps::Ramp;

/// Fly over a terrain in a window.
///
/// Elevation data, terrain files and flights may be dropped on the window. Pictures and flights that are kept go to the folder the program
/// was started in. What is set in the panel is remembered for the next time. It needs a display and a graphics adapter; a software driver
/// such as Mesa's does.
#[derive(Debug, clap::Args)]
#[command(after_help = after_help())]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Flight to play
    #[arg(long, value_name = "F")]
    flight: Option<PathBuf>,
    /// Style to begin with, instead of the last one
    #[arg(long, value_name = "STYLE", value_parser = picture::style())]
    style: Option<String>,
    /// Colours to begin with, instead of the style's
    #[arg(long, value_name = "RAMP", value_parser = picture::ramp())]
    ramp: Option<&'static Ramp>,
    /// Largest error on the screen in pixels, instead of the last one
    #[arg(long, value_name = "PX", value_parser = parse::tolerance_px)]
    tolerance_px: Option<f64>,
    /// How errors are measured on the screen, instead of the last one: ball (as if all were seen from the side) or sight (along the line of sight, where heights show the less the steeper one looks down)
    #[arg(long, value_name = "METRIC", value_parser = parse::metric())]
    metric: Option<ErrorMetric>,
    /// Multiply heights by this factor, instead of the last one
    #[arg(long, value_name = "FACTOR", value_parser = parse::exaggeration)]
    exaggeration: Option<f64>,
    /// Memory for the terrain file's pages in MiB; what does not fit is read again when it is needed
    #[arg(long, value_name = "MIB", default_value_t = 256, value_parser = clap::value_parser!(u64).range(1..=1 << 20))]
    cache: u64,
    /// Size of the window in pixels, instead of the last one
    #[arg(long, value_name = "WxH", value_parser = parse::viewport)]
    size: Option<Viewport>,
    /// Tell on standard output what happens, a line each
    #[arg(long, hide = true)]
    narrate: bool,
    /// End after so many frames
    #[arg(long, hide = true, value_name = "N")]
    exit_after_frames: Option<u64>,
    /// Open this file as if it had been dropped on the window
    #[arg(long, hide = true, value_name = "FILE")]
    drop: Vec<PathBuf>,
    /// Throw the graphics device away after so many frames
    #[arg(long, hide = true, value_name = "N")]
    lose_device_after_frames: Option<u64>,
}

fn after_help() -> String {
    format!(
        "Examples:\n  terrasoar view alps.iqt\n  terrasoar view alps.iqt --flight low.flight --style contours --exaggeration 2\n\nKeys:\n{}",
        window::list_of_keys()
    )
}

pub(super) fn run(args: &Args) -> Result<()> {
    let kept = args.terrain.kept()?;
    let done = window::run(Plan {
        is_kept: kept.is_some(),
        file: kept.unwrap_or_else(|| args.terrain.file.clone()),
        overlay: args.terrain.overlay.clone(),
        flight: args.flight.clone(),
        style: args.style.clone(),
        ramp: args.ramp.map(|ramp| ramp.name.to_owned()),
        tolerance_px: args.tolerance_px,
        metric: args.metric,
        exaggeration: args.exaggeration,
        size_px: args.size.map(Viewport::size_px),
        narrate: args.narrate,
        drop: args.drop.clone(),
        exit_after_frames: args.exit_after_frames,
        lose_device_after_frames: args.lose_device_after_frames,
        cache_bytes: args.cache << 20,
    });
    #[cfg(unix)]
    if done.is_ok() {
        super::signals::end_as_asked();
    }
    done
}
