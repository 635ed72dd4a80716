//! `terrasoar height`: the height at a place.

use super::output::{decimal, print, print_json};
use super::parse;
use super::terrain::TerrainArgs;
use anyhow::{Result, bail};
use serde::Serialize;

/// Print the height at a place.
///
/// The place is metres east and north of the south-west sample; between samples the height is interpolated bilinearly. Where a sample is
/// void it prints "no data", which is an answer and no failure.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar height alps.iqt --at 1500,820.5
  terrasoar height alps.iqt --at 1500,820.5 --json")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Metres east and north of the south-west sample
    #[arg(long, value_name = "X,Y", value_parser = parse::place_m, allow_hyphen_values = true)]
    at: [f64; 2],
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Answer {
    at_m: [f64; 2],
    /// Null where the terrain has no data.
    height_m: Option<f64>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let terrain = args.terrain.open()?;
    let extent_m = terrain.grid().extent_m();
    let is_outside = |(at, extent): (f64, f64)| !(-1e-9 * extent..=extent * (1.0 + 1e-9)).contains(&at);
    if args.at.into_iter().zip(extent_m).any(is_outside) {
        bail!(
            "{}: {},{} lies outside the terrain, which extends from 0,0 to {},{} metres",
            args.terrain.file.display(),
            args.at[0],
            args.at[1],
            decimal(extent_m[0], 4),
            decimal(extent_m[1], 4)
        );
    }
    let height_m = terrain.height_m(args.at[0], args.at[1])?;
    if args.json {
        return print_json(&Answer { at_m: args.at, height_m });
    }
    print(&height_m.map_or_else(|| "no data".to_owned(), |h| format!("{} m", decimal(h, 6))))
}
