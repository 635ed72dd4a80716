//! `terrasoar crater`: one crater, or a rain of them.

use super::work::Target;
use super::{HowArgs, TargetArgs, apply};
use crate::verbs::output::{complain, decimal, grouped, print};
use crate::verbs::outputs::{Force, Kind};
use crate::verbs::{WrongUsage, parse, within};
use anyhow::{Result, bail};
use std::path::PathBuf;
use terrasoar::edits::rain::Rain;
use terrasoar::edits::{Batch, MAX_EDITS, Script};
use terrasoar::sink::is_stream;
use terrasoar_layout::edit::{Crater, Edit};
use terrasoar_layout::read::terrain::Terrain;

/// Blast a crater into the ground of a terrain file, or a rain of them.
///
/// A crater is a bowl, and around it, to twice the radius, a rim of what was in it, higher where the shell flew to. Places are metres east and north of the
/// south-west sample. With --rain, places, directions and sizes are chosen by chance, the same for the same seed everywhere; small ones are many. All is one batch,
/// which `terrasoar undo` takes back, unless --batch says otherwise. With -o, a script is written instead, for `terrasoar edit` or `terrasoar replay`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar crater alps.iqt --at 1500,820.5 --radius 40 --depth 9 --direction 135
  terrasoar crater alps.iqt --rain 1000 --seed 7
  terrasoar crater alps.iqt --rain 1000 --seed 7 --radius 10,80 --depth-ratio 0.1,0.25 --batch 50 -o war.edits

Fields of --json are those of terrasoar edit.")]
pub(crate) struct Args {
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    what: What,
    /// Radius of the bowl in metres; with --rain the smallest and the largest, 2 to 8 samples without it
    #[arg(long, value_name = "M[,M]", value_parser = parse::range, required_unless_present = "rain")]
    radius: Option<[f64; 2]>,
    /// Depth of the bowl in metres
    #[arg(long, value_name = "M", value_parser = parse::positive, required_unless_present = "rain", conflicts_with = "rain")]
    depth: Option<f64>,
    /// Where the shell flew to, degrees clockwise from north; 0 without it
    #[arg(long, value_name = "DEG", value_parser = parse::finite, allow_negative_numbers = true, conflicts_with = "rain")]
    direction: Option<f64>,
    /// Which rain
    #[arg(long, value_name = "S", conflicts_with = "at")]
    seed: Option<u64>,
    /// Where it rains, the whole terrain without it
    #[arg(long, value_name = "W,S,E,N", value_parser = parse::extent, allow_hyphen_values = true, conflicts_with = "at")]
    extent: Option<[f64; 4]>,
    /// Depths as parts of the radii, 0.15 to 0.3 without it
    #[arg(long, value_name = "A[,B]", value_parser = parse::range, conflicts_with = "at")]
    depth_ratio: Option<[f64; 2]>,
    /// Craters a batch of the rain, all without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..), conflicts_with = "at")]
    batch: Option<u64>,
    /// Write a script instead of editing
    #[arg(short, long, value_name = "E.edits", conflicts_with_all = ["dry_run", "json", "overlay"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    how: HowArgs,
}

/// One crater, or many.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct What {
    /// Metres east and north of the south-west sample
    #[arg(long, value_name = "X,Y", value_parser = parse::place_m, allow_hyphen_values = true)]
    at: Option<[f64; 2]>,
    /// So many craters by chance
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=MAX_EDITS), requires = "seed")]
    rain: Option<u64>,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    if let Some(out) = &args.output {
        args.force.stream(out, Kind::Craters, &[&args.target.file])?;
    }
    let script = args.script()?;
    let Some(out) = &args.output else {
        return apply(args.target.target(), &script, None, &args.how, args.force.is_given());
    };
    script.write(out)?;
    let told = format!(
        "{}: {} crater{} in {} batch{}",
        out.display(),
        grouped(script.edits()),
        if script.edits() == 1 { "" } else { "s" },
        grouped(script.batches.len() as u64),
        if script.batches.len() == 1 { "" } else { "es" }
    );
    // A script piped on to another program stays alone in the pipe.
    if is_stream(out) {
        complain(&told);
        return Ok(());
    }
    print(&told)
}

impl Args {
    fn script(&self) -> Result<Script> {
        let Target { file, .. } = self.target.target();
        let terrain = Terrain::open_unmapped(file)?;
        let extent_m = terrain.grid().extent_m();
        if let Some(count) = self.what.rain {
            let sample_m = terrain.grid().spacing_m()[0].max(terrain.grid().spacing_m()[1]);
            return Ok(Rain {
                count,
                seed: self.seed.unwrap_or(0),
                extent_m: self.extent.unwrap_or([0.0, 0.0, extent_m[0], extent_m[1]]),
                radius_m: self.radius.unwrap_or([2.0 * sample_m, 8.0 * sample_m]),
                depth_ratio: self.depth_ratio.unwrap_or([0.15, 0.3]),
                batch: self.batch.unwrap_or(count),
            }
            .script());
        }
        let (Some(centre_m), Some([radius_m, largest_m]), Some(depth_m)) =
            (self.what.at, self.radius, self.depth)
        else {
            return Err(WrongUsage("give --at, --radius and --depth, or --rain and --seed".into()).into());
        };
        if radius_m != largest_m {
            return Err(WrongUsage("--radius takes two numbers with --rain only; give one".into()).into());
        }
        let direction_deg = self.direction.unwrap_or(0.0);
        let crater = Edit::Crater(Crater { centre_m, direction_deg, radius_m, depth_m });
        crater.check(terrain.grid())?;
        if crater.bounds(terrain.grid()).is_none() {
            bail!(
                "{}: no sample lies within {} metres of {},{}; the terrain extends from 0,0 to {},{} metres",
                file.display(),
                decimal(2.0 * radius_m, 4),
                centre_m[0],
                centre_m[1],
                decimal(extent_m[0], 4),
                decimal(extent_m[1], 4)
            );
        }
        within::warn_of(&crater, terrain.grid());
        Ok(Script { batches: vec![Batch::of([crater])] })
    }
}
