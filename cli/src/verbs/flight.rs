//! `terrasoar flight`: a recorded flight over a terrain, at a speed given or found.

use super::output::{complain, decimal, grouped, print};
use super::outputs::{Force, Kind};
use super::pages::CacheArgs;
use super::progress::Meter;
use super::replay::QualityArgs;
use super::terrain::TerrainArgs;
use super::{WrongUsage, parse};
use anyhow::Result;
use std::path::PathBuf;
use terrasoar::flight::generate::{FlightKind, FlightPlan, TerrainGround, generate};
use terrasoar::flight::incoherence::{MAX_TRIALS, solve};
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::flyover::mean_incoherence_percent;
use terrasoar::sink::is_stream;
use terrasoar_layout::grid::Grid;

/// Make a recorded flight over a terrain.
///
/// straight: level through the middle, along the longer side. orbit: round the middle, looking at it. terrain: low over the ground on a winding
/// path. turn: a level circle with a turn rate. The speed is given, or found so that each frame has a wanted percentage of triangles
/// that the frame before did not have. A flight is a text file; the same input gives the same flight.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar flight straight alps.iqt -o fast.flight --frames 500 --speed 40
  terrasoar flight terrain alps.iqt -o low.flight --frames 1000 --incoherence 0.6
  terrasoar flight turn alps.iqt -o turn.flight --frames 360 --speed 5 --turn-rate 1

--tolerance-px, --metric, --viewport and --exaggeration matter for --incoherence only: they decide which triangles a frame has. The flight notes them, and of the terrain its extent and a digest of its heights;
terrasoar replay says when it is flown with others.")]
pub(super) struct Args {
    /// What the flight does
    #[arg(value_name = "KIND", value_parser = parse::flight_kind())]
    kind: FlightKind,
    #[command(flatten)]
    terrain: TerrainArgs,
    #[command(flatten)]
    cache: CacheArgs,
    /// Flight file to write
    #[arg(short, long, value_name = "F.flight")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Frames to fly
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    frames: u64,
    #[command(flatten)]
    pace: Pace,
    /// Degrees of heading a frame, positive to the right; turning flights only, 0.5 without it
    #[arg(long, value_name = "DEG_PER_FRAME", value_parser = parse::finite, allow_negative_numbers = true)]
    turn_rate: Option<f64>,
    #[command(flatten)]
    quality: QualityArgs,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Pace {
    /// Metres a frame
    #[arg(long, value_name = "M_PER_FRAME", value_parser = parse::not_negative)]
    speed: Option<f64>,
    /// Wanted percentage of new triangles a frame, averaged over the flight
    #[arg(long, value_name = "PERCENT", value_parser = parse::percent)]
    incoherence: Option<f64>,
}

impl Args {
    fn plan(&self) -> Result<FlightPlan, WrongUsage> {
        let mut plan = FlightPlan::new(self.kind, self.frames, self.pace.speed.unwrap_or(0.0));
        match self.turn_rate {
            None => {}
            Some(rate) if self.kind == FlightKind::Turn && (1e-6..=90.0).contains(&rate.abs()) => {
                plan.turn_rate_deg_per_frame = rate;
            }
            Some(rate) if self.kind == FlightKind::Turn => {
                return Err(WrongUsage(format!(
                    "--turn-rate is {rate}; give 0.000001 to 90 degrees to either side"
                )));
            }
            Some(_) => {
                return Err(WrongUsage(format!(
                    "--turn-rate belongs to turning flights; a {} flight has its own heading",
                    self.kind.name()
                )));
            }
        }
        if self.pace.incoherence.is_some() && self.frames < 2 {
            return Err(WrongUsage("--incoherence compares frames; give --frames 2 or more".into()));
        }
        Ok(plan)
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let plan = args.plan()?;
    args.force.stream(&args.output, Kind::Flight, &args.terrain.inputs(&[]))?;
    let (terrain, cache_bytes) = args.cache.open(&args.terrain)?;
    let ground = TerrainGround::new(&terrain);
    let (mut flight, speed, told) = match args.pace.incoherence {
        None => (generate(&ground, &plan)?, plan.speed_m_per_frame, String::new()),
        Some(wanted) => {
            let progress = Meter::new("trials");
            progress.begin("finding the speed", MAX_TRIALS as u64);
            let quality = args.quality.quality().cache_bytes(cache_bytes);
            let solution = solve(&ground, &plan, wanted, |pairs| {
                let percent = mean_incoherence_percent(&terrain, pairs, quality);
                progress.add(1);
                percent
            })?;
            let found = solution.best.speed_m_per_frame;
            let [speed, percent, checked] =
                [solution.best.speed_m_per_frame, solution.best.percent, solution.checked_percent]
                    .map(|v| decimal(v, 4));
            let mut flight = solution.flight;
            flight.notes.push(("incoherence-percent".into(), percent.clone()));
            flight.notes.extend(args.quality.notes());
            (
                flight,
                found,
                format!(", {speed} m a frame for {percent} % new triangles ({checked} % on other frames)"),
            )
        }
    };
    ground.check()?;
    note_terrain(&mut flight, args);
    flight.notes.extend(crate::fit::notes_of(&terrain));
    flight.write(&args.output)?;
    if let Some(words) = turned_back(&flight, args.kind, speed, terrain.grid()) {
        complain(&format!("note: {}: {words}", args.output.display()));
    }
    let told =
        format!("{}: {} flight of {} frames{told}", args.output.display(), args.kind.name(), args.frames);
    // A flight piped on to another program stays alone in the pipe.
    if is_stream(&args.output) {
        complain(&told);
        return Ok(());
    }
    print(&told)
}

/// In words, that a way does not fit over the terrain: it is folded at the border, and the camera is not turned.
fn turned_back(flight: &Flight, kind: FlightKind, speed: f64, grid: &Grid) -> Option<String> {
    if !matches!(kind, FlightKind::Straight | FlightKind::Turn) {
        return None;
    }
    let is_backwards = |pair: &&[FlightFrame]| {
        let [east, north] = [0, 1].map(|axis| pair[1].eye_m[axis] - pair[0].eye_m[axis]);
        let yaw = pair[0].yaw_deg.to_radians();
        // A part in a million of a step is rounding.
        east * yaw.sin() + north * yaw.cos() < -1e-6 * speed
    };
    let steps = flight.frames.len().saturating_sub(1) as u64;
    let backwards = flight.frames.windows(2).filter(is_backwards).count() as u64;
    let [wide, long] = grid.extent_m();
    let metres = |m: f64| grouped(m.round() as u64);
    let way = metres(speed * steps as f64);
    let why = match kind {
        FlightKind::Turn => format!(
            "the circle does not fit over the terrain of {} x {} m; its way of {way} m turns back at the border",
            metres(wide),
            metres(long)
        ),
        _ => format!(
            "the way is {way} m long, and a straight flight has three quarters of the terrain's longer side, {} m; it goes there and back",
            metres(0.75 * wide.max(long))
        ),
    };
    (backwards > 0).then(|| {
        format!(
            "{why}. In {} of {} steps the eye flies backwards: it looks where it came from. Fewer frames or a lower speed avoid it",
            grouped(backwards),
            grouped(steps)
        )
    })
}

/// Adds the terrain's name, if it is one that a note can hold.
fn note_terrain(flight: &mut Flight, args: &Args) {
    let Some(name) = args.terrain.file.file_name().and_then(|name| name.to_str()) else { return };
    if name.len() <= 200 && name.trim() == name && !name.chars().any(char::is_control) {
        flight.notes.push(("terrain".into(), name.into()));
    }
}
