//! `terrasoar replay`: a recorded flight through one engine.

use super::clock::{self, Clock};
use super::made::title;
use super::output::{columns, complain, grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::pages::{self, CacheArgs};
use super::progress::Meter;
use super::terrain::TerrainArgs;
use super::{WrongUsage, parse, within};
use anyhow::{Context, Result};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrasoar::edits::{Loader, Script, timed};
use terrasoar::flight::{Flight, FlightFrame};
use terrasoar::flyover::{EngineKind, Quality, TimedBatch, replay, replay_edited};
use terrasoar::refine::Culling;
use terrasoar::stats::{FrameStats, ReplaySummary};
use terrasoar::view::{ErrorMetric, Viewport};
use terrasoar_lab::report::{Origin, ReportFile, write_frames_csv};
use terrasoar_layout::read::terrain::Terrain;

/// Fly a recorded flight with one engine and print what it cost.
///
/// kinetic: only what can have changed, without looking at the rest. smart: only what can have changed is tested, all is looked at. soar:
/// top-down refinement, every frame anew. naive: every triangle from scratch, by definition. All give the same mesh. Everything printed but the times is the same in every replay.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar replay alps.iqt --flight low.flight
  terrasoar replay alps.iqt --flight low.flight --engine soar --tolerance-px 2 --stats frames.csv --json
  terrasoar replay alps.iqt --flight low.flight --edits war.edits

Totals (vertex tests, splits, merges and what else is called total in --json) are sums over all frames, the first included, which makes the mesh from nothing; so they
are the sums of the columns of --stats. Triangles a frame are over all frames too. Incoherence and times leave the first frame out. What an engine does not have is -,
null in --json and empty in --stats: only kinetic has a queue, slots, patches and parts of an update.
Packed terrain, and all terrain with --cache, is read page by page when a frame needs it; the frame waits, so that its mesh and its counts are those of mapped terrain. What was read is told besides.
Percentiles are by nearest rank. Incoherence is the mean of the frames' percentages. Times are wall-clock times.")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    #[command(flatten)]
    cache: CacheArgs,
    /// Flight file
    #[arg(long, value_name = "F")]
    flight: PathBuf,
    /// Engine
    #[arg(long, value_name = "ENGINE", default_value = EngineKind::default().name(), value_parser = parse::engine())]
    engine: EngineKind,
    #[command(flatten)]
    quality: QualityArgs,
    /// Edit the ground on the way, in memory only, by this script's moments (`frame N`, `at SECONDS`)
    #[arg(long, value_name = "E.edits")]
    edits: Option<PathBuf>,
    /// Make at most N vertex tests a frame (kinetic only); what is late stays coarse, and the figures say how much
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    budget_tests: Option<u64>,
    /// Also write every frame's figures to this file
    #[arg(long, value_name = "CSV")]
    stats: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// Names of the notes in which a flight says for which pictures its speed was found.
const TOLERANCE_NOTE: &str = "solved-tolerance-px";
const METRIC_NOTE: &str = "solved-metric";
const VIEWPORT_NOTE: &str = "solved-viewport";
const EXAGGERATION_NOTE: &str = "solved-exaggeration";
const CULLING_NOTE: &str = "solved-culling";

/// Picture and precision.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct QualityArgs {
    /// Largest error on the screen in pixels
    #[arg(long, value_name = "PX", default_value = "1", value_parser = parse::tolerance_px)]
    tolerance_px: f64,
    /// How errors are measured on the screen: ball (as if all were seen from the side) or sight (along the line of sight, where heights show the less the steeper one looks down)
    #[arg(long, value_name = "METRIC", default_value = ErrorMetric::default().name(), value_parser = parse::metric())]
    metric: ErrorMetric,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "800x600", value_parser = parse::viewport)]
    viewport: Viewport,
    /// Multiply heights by this factor
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = parse::exaggeration)]
    exaggeration: f64,
    /// What is left out of view: vertices (the mesh is coarse there) or clusters (the mesh is refined all around, clusters are not drawn)
    #[arg(long, value_name = "WHAT", default_value = Culling::default().name(), value_parser = parse::culling())]
    culling: Culling,
}

impl QualityArgs {
    pub(super) fn quality(self) -> Quality {
        Quality::default()
            .viewport(self.viewport)
            .tolerance_px(self.tolerance_px)
            .metric(self.metric)
            .vertical_exaggeration(self.exaggeration)
            .culling(self.culling)
    }

    /// Looks whether a flight fits the terrain and these; says what does not.
    ///
    /// # Errors
    /// A flight that lies wholly outside the terrain.
    pub(super) fn look_at(self, terrain: &Terrain, flight: &Flight, path: &Path) -> Result<()> {
        within::flight(terrain, flight, path, self.viewport)?;
        within::below_ground(terrain, flight, path, self.exaggeration);
        if let Some(words) = self.differs_from(flight) {
            complain(&format!("note: {}: {words}", path.display()));
        }
        Ok(())
    }

    /// What a flight whose speed was found for an incoherence notes of the picture it was found for.
    pub(super) fn notes(self) -> [(String, String); 5] {
        let [wide, high] = self.viewport.size_px();
        [
            (TOLERANCE_NOTE.into(), self.tolerance_px.to_string()),
            (METRIC_NOTE.into(), self.metric.name().into()),
            (VIEWPORT_NOTE.into(), format!("{wide}x{high}")),
            (EXAGGERATION_NOTE.into(), self.exaggeration.to_string()),
            (CULLING_NOTE.into(), self.culling.name().into()),
        ]
    }

    /// In words, what a flight's speed was found for, if that is not these.
    fn differs_from(self, flight: &Flight) -> Option<String> {
        let note =
            |name: &str| flight.notes.iter().find(|(own, _)| own == name).map(|(_, value)| value.as_str());
        let own = self.notes();
        let differing: Vec<&(String, String)> =
            own.iter().filter(|(name, value)| note(name).is_some_and(|noted| noted != value)).collect();
        let told = |(name, value): &&(String, String)| {
            let noted = note(name).unwrap_or_default();
            match name.as_str() {
                TOLERANCE_NOTE => format!("a tolerance of {noted} px, here it is {value} px"),
                METRIC_NOTE => format!("errors measured by {noted}, here it is by {value}"),
                VIEWPORT_NOTE => format!("a picture of {noted}, here it is {value}"),
                EXAGGERATION_NOTE => format!("an exaggeration of {noted}, here it is {value}"),
                _ => format!("culling by {noted}, here it is by {value}"),
            }
        };
        let is_not = match note("incoherence-percent") {
            Some(percent) => format!("the incoherence is not {percent} % then"),
            None => "the incoherence is another then".into(),
        };
        (!differing.is_empty()).then(|| {
            let told: Vec<String> = differing.iter().map(told).collect();
            format!("its speed was found at {}: {is_not}", told.join(", and at "))
        })
    }
}

/// Flies `frames` with one engine, showing progress under `title`.
pub(super) fn fly(
    terrain: &Terrain,
    frames: &[FlightFrame],
    quality: Quality,
    engine: EngineKind,
    title: &str,
    progress: &Meter,
) -> Result<Vec<FrameStats>> {
    // One pass times, one counts.
    progress.begin(title, 2 * frames.len() as u64);
    Ok(replay(terrain, frames, quality, engine, &mut |done| progress.set(done))?)
}

pub(super) fn run(args: &Args) -> Result<()> {
    if let Some(stats) = &args.stats {
        let others: Vec<_> =
            [Some(&args.flight), args.edits.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
        args.force.table(stats, Kind::Report(ReportFile::Frames), &args.terrain.inputs(&others))?;
    }
    let (terrain, cache_bytes) = args.cache.open(&args.terrain)?;
    let terrain = Arc::new(terrain);
    let flight = Flight::read(&args.flight)?;
    args.quality.look_at(&terrain, &flight, &args.flight)?;
    let progress = Meter::new("frames");
    let name = args.engine.name();
    let mut quality = args.quality.quality().cache_bytes(cache_bytes);
    quality.budget_tests = args.budget_tests;
    if quality.budget_tests.is_some() && args.engine != EngineKind::Kinetic {
        return Err(WrongUsage(format!(
            "--budget-tests is for the engine kinetic; {name} does all or nothing"
        ))
        .into());
    }
    let clock = Clock::start();
    let frames = match &args.edits {
        None => fly(&terrain, &flight.frames, quality, args.engine, name, &progress)?,
        Some(script) => {
            let batches = batches_of(script, &flight.frames, &terrain)?;
            progress.begin(name, 2 * flight.frames.len() as u64);
            let done = &mut |done| progress.set(done);
            replay_edited(&terrain, &flight.frames, quality, args.engine, &batches, done)
                .with_context(|| not_replayed(script, &args.terrain.file))?
        }
    };
    drop(progress);
    let processor_percent = clock.processor_percent();
    pages::too_few(&frames, cache_bytes).iter().for_each(|words| complain(words));
    let title = title(&args.terrain.file, &args.flight, quality);
    if let Some(path) = &args.stats {
        write_frames_csv(path, &title, name, &frames)?;
    }
    let summary = ReplaySummary::of(name, &frames);
    if args.json {
        return print_json(&Told { origin: title.origin(), processor_percent, figures: &summary });
    }
    print(&format!("{}{}\n", text(&summary), clock::told(processor_percent)))
}

/// Figures, and where they come from.
#[derive(serde::Serialize)]
pub(super) struct Told<'a, T> {
    #[serde(flatten)]
    pub(super) origin: Origin<'a>,
    /// Processor time of the thread that flew, in percent of the time that passed.
    pub(super) processor_percent: Option<f64>,
    #[serde(flatten)]
    pub(super) figures: &'a T,
}

/// A script's batches at their frames. Those whose moment never comes are told.
pub(super) fn batches_of(
    script: &Path,
    frames: &[FlightFrame],
    terrain: &Terrain,
) -> Result<Vec<TimedBatch>> {
    let mut loader = Loader::new(script, terrasoar_import::open_file).over(terrain.header());
    let batches = loader.script(&Script::read(script)?)?;
    let warning = within::edits(&batches, terrain.grid(), Some(script))?;
    warning.iter().for_each(|words| complain(words));
    let late = batches.iter().filter(|batch| batch.frame(frames).is_none()).count();
    if late > 0 {
        complain(&format!(
            "note: {}: {late} of {} batches would come after the flight's last frame and are left out",
            script.display(),
            batches.len()
        ));
    }
    Ok(timed(&batches, frames))
}

/// What is said of a script that cannot be replayed.
pub(super) fn not_replayed(script: &Path, terrain: &Path) -> String {
    format!(
        "{} cannot be replayed over {} (terrasoar edit applies it to a copy, with more room if need be)",
        script.display(),
        terrain.display()
    )
}

fn text(s: &ReplaySummary) -> String {
    let row = |name: &str, value: String| vec![name.to_owned(), value];
    let head = format!("{}, {} frames\n", s.engine, grouped(s.frames));
    let t = s.update_ms;
    // What an engine does not have.
    let none = || "-".to_owned();
    let ms = |value: Option<f64>| value.map_or_else(none, |ms| format!("{ms:.1} ms"));
    let mut rows = vec![
        row("triangles a frame", format!("{:.0}", s.triangles_mean)),
        row("incoherence", format!("{:.3} %", s.incoherence_percent)),
        row("vertex tests", grouped(s.vertex_tests_total)),
        row("splits", grouped(s.splits_total)),
        row("merges", grouped(s.merges_total)),
        row("live ranges over", s.expired_total.map_or_else(none, grouped)),
        row("triangle slots written", s.slots_written_total.map_or_else(none, grouped)),
        row("patch bytes", s.patch_bytes_total.map_or_else(none, grouped)),
        row("late, sum over frames", grouped(s.late_total)),
        row("largest late error", format!("{:.2} px", s.late_error_px_max)),
        row("pages touched", grouped(s.pages_touched_total)),
        row("record bytes read", grouped(s.record_bytes_touched_total)),
        row("update, median", format!("{:.3} ms", t.p50)),
        row("update, 95 %", format!("{:.3} ms", t.p95)),
        row("update, 99 %", format!("{:.3} ms", t.p99)),
        row("update, worst", format!("{:.3} ms", t.max)),
        row("update, mean", format!("{:.3} ms", t.mean)),
        row("scan, median", s.scan_us_p50.map_or_else(none, |us| format!("{us:.1} us"))),
        row("test, median", s.test_us_p50.map_or_else(none, |us| format!("{us:.1} us"))),
        row("apply, median", s.apply_us_p50.map_or_else(none, |us| format!("{us:.1} us"))),
        row("records edited", grouped(s.edited_records_total)),
        row("edits of a frame, worst", format!("{:.3} ms", s.edit_ms_max)),
        row("mesh hash", s.mesh_hash.clone()),
    ];
    if let Some(pages) = s.pages_read_total {
        rows.push(row("pages read", grouped(pages)));
        rows.push(row("tiles unpacked", s.tiles_unpacked_total.map_or_else(none, grouped)));
        rows.push(row("bytes of tiles", s.tile_bytes_read_total.map_or_else(none, grouped)));
        rows.push(row("waited for pages", ms(s.read_ms_total)));
        rows.push(row("of it for unpacking", ms(s.unpack_ms_total)));
    }
    head + &columns(&rows)
}
