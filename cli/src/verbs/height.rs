//! `terrasoar height`: the height at a place, or at all places of a table.

mod points;
mod table;

use super::output::{complain, decimal, print, print_json};
use super::outputs::{Force, Kind};
use super::siting::{self, frame};
use super::terrain::TerrainArgs;
use super::{guess, parse};
use anyhow::{Context, Result, bail};
use serde::Serialize;
use std::path::{Path, PathBuf};
use terrasoar_import::places::Frame;
use terrasoar_layout::read::terrain::Terrain;

/// Print the height at a place, or at all places of a table.
///
/// A place is two numbers, east before north: metres from the south-west sample, or with --crs coordinates of a reference system, longitude before latitude. Between samples
/// the height is interpolated bilinearly. Where a sample is void it prints "no data", which is an answer and no failure.
///
/// A table is text with a place a row: separated by commas, semicolons, tabs or spaces, with names of columns in its first row or without. The columns lon and lat, x and y, or
/// east and north are taken by name, else the first two. Columns named lon and lat are degrees where no --crs is given. Each row is printed with its height in metres added, empty where
/// there is none. A place that was read as metres and looks like degrees, or like coordinates of the elevation model, is told on standard error, with the flag to type.
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("places").args(["at", "points"]).required(true)), after_help = "\
Examples:
  terrasoar height alps.iqt --at 1500,820.5
  terrasoar height alps.iqt --at 7.6586,45.9763 --crs EPSG:4326
  terrasoar height alps.iqt --at 395000,5092000 --crs dem --json
  terrasoar height alps.iqt --points huts.csv -o huts-with-heights.csv")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Place, east before north: metres from the south-west sample, or coordinates of --crs
    #[arg(long, value_name = "X,Y", value_parser = parse::place, allow_hyphen_values = true)]
    at: Option<[f64; 2]>,
    /// Table of places, or - for standard input
    #[arg(long, value_name = "FILE", conflicts_with_all = ["at", "json"])]
    points: Option<PathBuf>,
    /// Write the table to this file instead of standard output; it appears when it is complete
    #[arg(short, long, value_name = "FILE", requires = "points", conflicts_with_all = ["at", "json"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// System of the places: dem for the elevation model's own coordinates, EPSG:n, WKT or a PROJ string
    #[arg(long, value_name = "SYSTEM")]
    crs: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Answer {
    at_m: [f64; 2],
    /// Null where the terrain has no data.
    height_m: Option<f64>,
    /// The place as it was given.
    at: [f64; 2],
    /// Null for metres from the corner.
    crs: Option<String>,
    /// What --crs the place was probably meant in, where it was read as metres and looks like something else.
    likely_crs: Option<&'static str>,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let terrain = args.terrain.open()?;
    if let Some(path) = &args.points {
        if let Some(out) = &args.output {
            args.force.file(out, Kind::Heights, &args.terrain.inputs(&[Path::new(path)]))?;
        }
        return points::run(&terrain, path, args.crs.as_deref(), args.output.as_deref());
    }
    let Some(at) = args.at else { return Ok(()) };
    let frame = frame(terrain.header(), args.crs.as_deref())
        .with_context(|| args.terrain.file.display().to_string())?;
    let at_m = match &frame {
        None => Some(at),
        Some(frame) => frame.place_m(at),
    };
    let Some(at_m) = at_m.filter(|at_m| is_inside(&terrain, *at_m)) else {
        bail!("{}: {}", args.terrain.file.display(), outside(&terrain, frame.as_ref(), at));
    };
    let height_m = terrain.height_m(at_m[0], at_m[1])?;
    let likely = if frame.is_none() { guess::note_of_local(terrain.header(), &[at]) } else { None };
    if let Some((note, _)) = &likely {
        complain(note);
    }
    if args.json {
        let likely_crs = likely.and_then(|(_, guess)| guess.crs());
        let crs = frame.as_ref().map(siting::system_name);
        return print_json(&Answer { at_m, height_m, at, crs, likely_crs });
    }
    // To the millimetre; more is not in any elevation model.
    print(&height_m.map_or_else(|| "no data".to_owned(), |h| format!("{} m", decimal(h, 3))))
}

fn is_inside(terrain: &Terrain, at_m: [f64; 2]) -> bool {
    let is_within = |(at, extent): (f64, f64)| (-1e-9 * extent..=extent * (1.0 + 1e-9)).contains(&at);
    at_m.into_iter().zip(terrain.grid().extent_m()).all(is_within)
}

/// That a place lies outside, and where the terrain is, in the system that was asked for.
fn outside(terrain: &Terrain, frame: Option<&Frame>, at: [f64; 2]) -> String {
    let place = format!("{},{} lies outside the terrain", at[0], at[1]);
    let hint = guess::clause_of_outside(terrain.header(), frame, &[at]);
    match siting::reach(terrain.header(), frame) {
        Some(reach) => format!("{place}, which extends {reach}{hint}"),
        None => format!("{place}{hint}"),
    }
}
