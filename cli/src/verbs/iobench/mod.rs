//! `terrasoar iobench`: how much of a file a flight touches, and what reading it costs.

mod measure;
mod table;

use super::cap::{self, Asked, Standing};
use super::output::{print, print_json};
use super::outputs::{Force, Kind};
use super::progress::Meter;
use super::replay::QualityArgs;
use super::{WrongUsage, made, parse};
use anyhow::{Result, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use std::path::PathBuf;
use terrasoar::flight::Flight;
use terrasoar::flyover::EngineKind;
use terrasoar::view::View;
use terrasoar_lab::iobench::{IoBench, IoRun, LayoutKind, Prefetch, ReadBy, Reader, Run, Timed, kernel};
use terrasoar_lab::report::{IoReport, ReportFile, remove_stale, write_io_frames_csv};
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::read::terrain::Terrain;

/// Measure how much of a file a flight touches, by engine and layout.
///
/// Counts, which repeat: the records that each frame reads, the pages they lie on, and those of them that a page cache of the stated size does not hold when they are
/// needed. Measured, cold and warm: update times, page faults and bytes read over the file itself. The row mesh is all that a frame's mesh needs, even if the engine has it in memory.
/// Rows whose source is pool fly kinetic at a steady pace over pages that threads read into --cache of memory: no frame waits, and what came too late is told.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar iobench alps.iqt --flight low.flight
  terrasoar iobench alps.iqt --flight low.flight --engines soar,kinetic --layouts row,ours --prefetch none,frustum -o report
  terrasoar iobench alps.iqt --flight low.flight --cap 128 --scratch /var/tmp --json

Layouts: row (row by row, 20-byte records), tiled (Z-order, 20 bytes), soar (SOAR's interleaved quadtrees, 20 bytes), ours (the file as it is).
Prefetch: none (pages are read when they are lacked), frustum (the view extended as Qiu et al. do: back by --block, ahead by a frame's way; what is counted
has a disk of stated speed between frames), deadline (by the frame in which live ranges say that a page will be needed; kinetic over a pool only).")]
pub(in crate::verbs) struct Args {
    /// Terrain file (.iqt)
    file: PathBuf,
    /// Flight file
    #[arg(long, value_name = "F")]
    flight: PathBuf,
    /// Engines
    #[arg(long, value_name = "A,B", value_delimiter = ',', default_value = "soar,smart,kinetic", value_parser = engine())]
    engines: Vec<EngineKind>,
    /// Layouts
    #[arg(long, value_name = "A,B", value_delimiter = ',', default_value = "row,tiled,soar,ours", value_parser = layout())]
    layouts: Vec<LayoutKind>,
    /// What is loaded before it is needed
    #[arg(long, value_name = "A,B", value_delimiter = ',', default_value = "none,deadline", value_parser = preload())]
    prefetch: Vec<Prefetch>,
    /// Size of the page cache that is counted with, and of the pool that is flown over
    #[arg(long, value_name = "MIB", default_value = "128", value_parser = clap::value_parser!(u64).range(1..=1 << 24))]
    cache: u64,
    /// Pages that the disk serves between two frames when preloading: 16.7 ms at 130 us a read
    #[arg(long, value_name = "N", default_value = "128", value_parser = clap::value_parser!(u64).range(1..=1 << 24))]
    disk_pages: u64,
    /// Pace of flights over the pool, in frames a second; 0 for as fast as frames are made
    #[arg(long, value_name = "N", default_value = "60", value_parser = parse::pace)]
    fps: f64,
    /// What reads pages into the pool: threads, or one with an io_uring
    #[arg(long, value_name = "HOW", default_value = ReadBy::default().name(), value_parser = read_by())]
    reads: ReadBy,
    /// Metres that the view is moved back when preloading; a sixteenth of the terrain's side if not given
    #[arg(long, value_name = "M", value_parser = parse::not_negative)]
    block: Option<f64>,
    /// Measure with memory capped, page cache included (Linux control groups)
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(16..=1 << 24))]
    cap: Option<u64>,
    /// The capped copy's group
    #[arg(long, value_name = "DIR", hide = true, requires = "cap")]
    cap_group: Option<PathBuf>,
    /// Also replay each layout's pages against a file of its size in this folder, which needs the room
    #[arg(long, value_name = "DIR")]
    scratch: Option<PathBuf>,
    #[command(flatten)]
    quality: QualityArgs,
    /// Also write every frame's figures to this file
    #[arg(long, value_name = "CSV")]
    frames: Option<PathBuf>,
    /// Folder for a report with tables and plots, made if missing
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// An engine by name; `naive` reads everything and has nothing to be measured.
fn engine() -> impl TypedValueParser<Value = EngineKind> {
    let names = EngineKind::ALL.into_iter().filter(|e| *e != EngineKind::Naive).map(EngineKind::name);
    PossibleValuesParser::new(names).try_map(|word| word.parse::<EngineKind>())
}

fn layout() -> impl TypedValueParser<Value = LayoutKind> {
    PossibleValuesParser::new(LayoutKind::ALL.map(LayoutKind::name)).map(|word| {
        LayoutKind::ALL.into_iter().find(|layout| layout.name() == word).unwrap_or(LayoutKind::Ours)
    })
}

fn preload() -> impl TypedValueParser<Value = Prefetch> {
    PossibleValuesParser::new(Prefetch::ALL.map(Prefetch::name))
        .map(|word| Prefetch::ALL.into_iter().find(|kind| kind.name() == word).unwrap_or(Prefetch::None))
}

fn read_by() -> impl TypedValueParser<Value = ReadBy> {
    PossibleValuesParser::new(ReadBy::ALL.map(ReadBy::name))
        .map(|word| ReadBy::ALL.into_iter().find(|how| how.name() == word).unwrap_or_default())
}

impl Args {
    fn check(&self) -> Result<()> {
        fn twice<'a>(flag: &str, names: impl Iterator<Item = &'a str>) -> Result<(), WrongUsage> {
            let mut seen: Vec<&str> = Vec::new();
            for name in names {
                if seen.contains(&name) {
                    return Err(WrongUsage(format!("{flag} names {name} twice; name each once")));
                }
                seen.push(name);
            }
            Ok(())
        }
        twice("--engines", self.engines.iter().map(|e| e.name()))?;
        twice("--layouts", self.layouts.iter().map(|l| l.name()))?;
        twice("--prefetch", self.prefetch.iter().map(|p| p.name()))?;
        if self.prefetch == [Prefetch::Deadline] && !self.flies_pooled() {
            let what = "--prefetch deadline is for the engine kinetic over the layout ours; add them, or preload by frustum or not at all";
            return Err(WrongUsage(what.into()).into());
        }
        if self.fps != 0.0 && !(0.1..=10_000.0).contains(&self.fps) {
            return Err(
                WrongUsage(format!("--fps is 0 or a number from 0.1 to 10000, not {}", self.fps)).into()
            );
        }
        if let Some(folder) = &self.scratch
            && !folder.is_dir()
        {
            bail!("{}: --scratch needs a folder that is there", folder.display());
        }
        let inputs = [self.file.as_path(), self.flight.as_path()];
        if let Some(folder) = &self.output {
            let files: Vec<_> =
                IoReport::files().into_iter().map(|(name, file)| (name, Kind::Report(file))).collect();
            self.force.folder(folder, &files, &inputs)?;
        }
        if let Some(csv) = &self.frames {
            self.force.table(csv, Kind::Report(ReportFile::IoFrames), &inputs)?;
        }
        Ok(())
    }

    /// Whether there are flights over a pool: of kinetic, over the file as it is.
    fn flies_pooled(&self) -> bool {
        self.engines.contains(&EngineKind::Kinetic) && self.layouts.contains(&LayoutKind::Ours)
    }

    /// The engines and the mesh.
    fn readers(&self) -> impl Iterator<Item = Reader> {
        self.engines.iter().map(|e| Reader::Engine(*e)).chain([Reader::Mesh])
    }
}

pub(in crate::verbs) fn run(args: &Args) -> Result<()> {
    args.check()?;
    let standing = match args.cap {
        None => Standing::default(),
        Some(mib) => match cap::ask(mib, args.cap_group.as_deref())? {
            Asked::GoOn(standing) => standing,
            Asked::Ran => return Ok(()),
        },
    };
    let progress = Meter::new("frames");
    let flight = Flight::read(&args.flight)?;
    args.quality.look_at(&Terrain::open_unmapped(&args.file)?, &flight, &args.flight)?;
    let quality = args.quality.quality();
    let views: Vec<View> = flight.frames.iter().map(|frame| quality.view(frame)).collect();
    // Times come first: what counting holds would be in the peak of memory.
    let timed = measure::measured(args, &views, &standing, &progress)?;
    let (runs, block_m) = measure::counted(args, &views, &progress)?;
    let timed_of = |run: &Run| {
        let found = timed.iter().find(|(reader, _)| *reader == run.reader && measure::is_plain(run));
        found.map(|(_, timed)| timed.clone())
    };
    let with_times = |run: Run| {
        let timed = timed_of(&run);
        (run, timed)
    };
    let mut runs: Vec<(Run, Option<Timed>)> = runs.into_iter().map(with_times).collect();
    let scratch = match &args.scratch {
        Some(folder) => measure::replayed(folder, &runs, &standing, &progress)?,
        None => Vec::new(),
    };
    let pooled = measure::streamed(args, &views, &runs, &standing, &progress)?;
    drop(progress);
    let mut sums: Vec<IoRun> = runs
        .iter()
        .map(|(run, timed)| match timed {
            Some(timed) => IoRun::of(run).with_times(timed),
            None => IoRun::of(run),
        })
        .collect();
    for (i, map, pread) in scratch {
        sums[i].scratch_map = Some(map);
        sums[i].scratch_pread = Some(pread);
    }
    for (run, pooled) in pooled {
        sums.push(IoRun::of(&run).with_times(&pooled.timed).with_stream(&pooled));
        runs.push((run, Some(pooled.timed)));
    }
    let bench = bench_of(args, block_m, standing, sums);
    if let Some(path) = &args.frames {
        write_io_frames_csv(path, &bench, &runs)?;
    }
    let written = match &args.output {
        Some(folder) => {
            let written = IoReport { bench: &bench, runs: &runs }.write(folder)?;
            remove_stale(folder, &IoReport::files(), "iobench", &written);
            written
        }
        None => Vec::new(),
    };
    if args.json {
        return print_json(&bench);
    }
    let page = written.last().map_or(String::new(), |page| format!("report: {}\n", page.display()));
    print(&(table::text(&bench) + &page))
}

/// What was measured, and how.
fn bench_of(args: &Args, block_m: f64, standing: Standing, runs: Vec<IoRun>) -> IoBench {
    let quality = args.quality.quality();
    IoBench {
        terrain: made::name(&args.file),
        flight: made::name(&args.flight),
        tolerance_px: quality.tolerance_px,
        metric: quality.metric.name().into(),
        viewport_px: quality.viewport.size_px(),
        exaggeration: quality.vertical_exaggeration,
        culling: quality.culling.name().into(),
        page_bytes: PAGE_BYTES as u64,
        cache_mib: args.cache,
        disk_pages_per_frame: args.disk_pages,
        frames_per_second: args.fps,
        reads: args.reads.name().into(),
        block_m,
        cap: standing.cap,
        cap_note: standing.note,
        kernel_known: kernel::thread_faults().is_some() && kernel::read_bytes().is_some(),
        runs,
        made: Some(made::made()),
    }
}
