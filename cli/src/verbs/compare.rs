//! `terrasoar compare`: engines on the same flight, side by side, and a report.

use super::clock::{self, Clock};
use super::made::title;
use super::output::{columns, complain, grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::pages::{self, CacheArgs};
use super::progress::Meter;
use super::replay::{QualityArgs, Told, fly};
use super::terrain::TerrainArgs;
use super::{WrongUsage, parse, sweep};
use anyhow::{Result, bail};
use std::path::PathBuf;
use terrasoar::flight::Flight;
use terrasoar::flyover::{EngineKind, Quality};
use terrasoar::stats::{Comparison, EngineComparison, FrameStats};
use terrasoar_lab::report::{ComparisonReport, FlightPicture, remove_stale};
use terrasoar_layout::read::terrain::Terrain;

/// Fly a recorded flight with several engines, compare them and write a report.
///
/// The first engine named is the one that the others are measured against; the first frame, which starts from nothing, is left out of the ratios. The
/// report has a CSV file an engine, a JSON summary, plots, a picture where there is a graphics driver, and one page, report.html. Exit code 1 if the engines' meshes differ.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar compare alps.iqt --flight low.flight -o report
  terrasoar compare alps.iqt --flight low.flight --engines naive,soar,smart,kinetic --no-sweeps -o report --json

summary.json says how it was made: program and version, commit where the build was told, machine, date, command, and the terrain, flight, tolerance and viewport. Totals are sums
over all frames; null is what an engine does not have (terrasoar replay --help).

Two sweeps redo the plots of the SMART paper: speed-up by tolerance (0.5 to 8 px) and by incoherence (0.6, 1.4, 5.3 %). They fly up to 120
frames a point; --no-sweeps leaves them out.")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    #[command(flatten)]
    cache: CacheArgs,
    /// Flight file
    #[arg(long, value_name = "F")]
    flight: PathBuf,
    /// Engines, the first being the base of the ratios
    #[arg(long, value_name = "A,B", value_delimiter = ',', default_value = "soar,smart,kinetic", value_parser = parse::engine())]
    engines: Vec<EngineKind>,
    #[command(flatten)]
    quality: QualityArgs,
    /// Folder for the report, made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Leave out the sweeps over tolerance and incoherence
    #[arg(long)]
    no_sweeps: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Args {
    fn check(&self) -> Result<(), WrongUsage> {
        let names: Vec<&str> = self.engines.iter().map(|e| e.name()).collect();
        let twice = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name));
        match twice {
            Some((_, name)) => {
                Err(WrongUsage(format!("--engines names {name} twice; name each engine once")))
            }
            None => Ok(()),
        }
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    args.check()?;
    let engines: Vec<&str> = args.engines.iter().map(|engine| engine.name()).collect();
    let files: Vec<_> = ComparisonReport::files(&engines)
        .into_iter()
        .map(|(name, file)| (name, Kind::Report(file)))
        .collect();
    args.force.folder(&args.output, &files, &args.terrain.inputs(&[&args.flight]))?;
    let (terrain, cache_bytes) = args.cache.open(&args.terrain)?;
    let flight = Flight::read(&args.flight)?;
    args.quality.look_at(&terrain, &flight, &args.flight)?;
    let quality = args.quality.quality().cache_bytes(cache_bytes);
    let progress = Meter::new("frames");
    let mut runs: Vec<(String, Vec<FrameStats>)> = Vec::new();
    let clock = Clock::start();
    for engine in &args.engines {
        let frames = fly(&terrain, &flight.frames, quality, *engine, engine.name(), &progress)?;
        runs.push((engine.name().to_owned(), frames));
    }
    let few = runs.iter().find_map(|(_, frames)| pages::too_few(frames, cache_bytes));
    few.iter().for_each(|words| progress.note(words));
    let processor_percent = clock.processor_percent();
    let comparison = Comparison::of(&runs);
    // Engines that disagree are compared no further.
    let (by_tolerance, by_incoherence) = if args.no_sweeps || !comparison.same_mesh {
        (Vec::new(), Vec::new())
    } else {
        let sweep = sweep::Sweep {
            terrain: &terrain,
            flight: &flight,
            quality,
            engines: &args.engines,
            progress: &progress,
        };
        progress.note(&format!(
            "sweeps fly about {} more frames; --no-sweeps leaves them out",
            grouped(sweep.frames())
        ));
        (sweep.by_tolerance()?, sweep.by_incoherence()?)
    };
    drop(progress);
    let picture = middle_frame(&terrain, &flight, quality);
    let title = title(&args.terrain.file, &args.flight, quality);
    let report = ComparisonReport {
        title: &title,
        runs: &runs,
        comparison: &comparison,
        tolerance_sweep: &by_tolerance,
        incoherence_sweep: &by_incoherence,
        picture: match &picture {
            Ok((file, caption)) => FlightPicture::Png { file, caption },
            Err(why) => FlightPicture::Missing(why),
        },
    };
    let written = report.write(&args.output)?;
    let files = ComparisonReport::files(&EngineKind::ALL.map(EngineKind::name));
    remove_stale(&args.output, &files, "compare", &written);
    if args.json {
        print_json(&Told { origin: title.origin(), processor_percent, figures: &comparison })?;
    } else {
        print(&text(&comparison, processor_percent))?;
    }
    if let Some(page) = written.last() {
        // With --json standard output holds the object and nothing else.
        let line = format!("report: {}", page.display());
        if args.json { complain(&line) } else { print(&line)? }
    }
    match first_difference(&runs) {
        Some((engine, frame)) => bail!(
            "the meshes differ: {engine} draws other triangles than {} first in frame {frame}; please report it with terrain and flight",
            runs[0].0
        ),
        None => Ok(()),
    }
}

/// Draws the flight's middle frame; gives a PNG file and a caption, or says why there is none. A report without a picture is a report.
#[cfg(feature = "pictures")]
fn middle_frame(terrain: &Terrain, flight: &Flight, quality: Quality) -> Result<(Vec<u8>, String), String> {
    let frame = flight.frames.len() / 2;
    let drawn = super::picture::draw_frame(terrain, flight, frame, quality);
    let (file, drawn_by) = drawn.map_err(|error| super::message(&error))?;
    Ok((file, format!("Frame {frame} of {}, drawn by {drawn_by}.", flight.frames.len())))
}

#[cfg(not(feature = "pictures"))]
fn middle_frame(_: &Terrain, _: &Flight, _: Quality) -> Result<(Vec<u8>, String), String> {
    Err("this program was built without the feature pictures".into())
}

/// The first engine, and its first frame, whose mesh is not the first engine's.
fn first_difference(runs: &[(String, Vec<FrameStats>)]) -> Option<(&str, u64)> {
    let (_, base) = runs.first()?;
    runs.iter().find_map(|(engine, frames)| {
        let differs = base.iter().zip(frames).find(|(a, b)| a.mesh_hash != b.mesh_hash);
        differs.map(|(_, frame)| (engine.as_str(), frame.frame))
    })
}

/// The base's median time over the engine's: what the median of ratios is where times are not disturbed.
fn ratio_of_medians(comparison: &Comparison, engine: &EngineComparison) -> f64 {
    let base_ms = comparison.engines.first().map_or(0.0, |base| base.summary.update_ms.p50);
    base_ms / engine.summary.update_ms.p50.max(1e-6)
}

/// Whether two ratios are further apart than a quarter.
fn disagree(a: f64, b: f64) -> bool {
    a > 0.0 && b > 0.0 && (a / b).max(b / a) > 1.25
}

fn text(comparison: &Comparison, processor_percent: Option<f64>) -> String {
    let head = [
        "engine",
        "triangles",
        "vertex tests",
        "ratio",
        "worst",
        "median ms",
        "speed-up",
        "by medians",
        "pages",
    ];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for engine in &comparison.engines {
        let s = &engine.summary;
        rows.push(vec![
            s.engine.clone(),
            format!("{:.0}", s.triangles_mean),
            grouped(s.vertex_tests_total),
            format!("{:.2} %", 100.0 * engine.vertex_tests_ratio),
            format!("{:.2} %", 100.0 * engine.vertex_tests_ratio_worst_frame),
            format!("{:.3}", s.update_ms.p50),
            format!("{:.2}", engine.speedup_median),
            format!("{:.2}", ratio_of_medians(comparison, engine)),
            grouped(s.pages_touched_total),
        ]);
    }
    let same = if comparison.same_mesh { "yes, in every frame" } else { "NO" };
    let incoherence = comparison.engines.first().map_or(0.0, |e| e.summary.incoherence_percent);
    let disturbed: Vec<&str> = comparison
        .engines
        .iter()
        .filter(|engine| disagree(engine.speedup_median, ratio_of_medians(comparison, engine)))
        .map(|engine| engine.summary.engine.as_str())
        .collect();
    let disturbed = match disturbed.as_slice() {
        [] => String::new(),
        names => {
            format!("; times were disturbed: the two ratios of {} differ by more than 25 %", names.join(", "))
        }
    };
    format!(
        "{}same mesh: {same}; incoherence {incoherence:.3} %\n{}{disturbed}\n",
        columns(&rows),
        clock::told(processor_percent)
    )
}
