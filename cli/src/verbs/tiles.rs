//! Flags that say what of a pyramid of map tiles is read, for every verb that reads one.

use super::parse;
use terrasoar_import::TileOptions;

/// What of a pyramid of map tiles is read.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Pyramids of map tiles")]
pub(super) struct Tiles {
    /// Zoom that is read; without it the deepest complete one
    #[arg(long, value_name = "Z", value_parser = clap::value_parser!(u8).range(0..=30))]
    zoom: Option<u8>,
    /// Part that is read: west, south, east, north in degrees; west of 180 and east of it as well; without it all that the pyramid states
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::bounds, allow_hyphen_values = true)]
    bounds: Option<Sides>,
    /// Rows of a folder of tiles are counted from the south (TMS), not from the north (XYZ)
    #[arg(long)]
    tms: bool,
}

/// West, south, east, north.
type Sides = [f64; 4];

impl Tiles {
    pub(super) fn options(&self) -> TileOptions {
        TileOptions { zoom: self.zoom, bounds_deg: self.bounds, from_south: self.tms }
    }
}
