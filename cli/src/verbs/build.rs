//! `terrasoar build`: a DEM in, a terrain file out.

use super::output::{complain, grouped, print};
use super::outputs::{Force, Kind};
use super::progress::{Meter, short};
use super::{parse, terrain};
use anyhow::{Context, Result};
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use std::time::Instant;
use terrasoar_layout::build::{BuildOptions, build};
use terrasoar_layout::file::header::{ErrorKind, Header, SpacingOrigin};
use terrasoar_layout::grid::record::RecordKind;

/// Make a terrain file (.iqt) from elevation data.
///
/// Reads 16-bit and 8-bit grey PNG, VTP BT, SRTM .hgt (one tile, or several that border each other) and GeoTIFF, of any size and any
/// rectangle. The output appears when it is complete; a build that fails or is killed leaves nothing, and the next one starts from the
/// beginning. The same input gives the same bytes whatever --threads and --memory.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar build alps.tif -o alps.iqt
  terrasoar build N46E007.hgt N46E008.hgt -o valais.iqt
  terrasoar build puget.png --spacing 160 --z-scale 0.1 -o puget.iqt
  terrasoar build huge.tif --memory 2048 -o huge.iqt

Room on the output's disk: some 4 bytes a sample for the file (8 or 16 with exact records), and while building another 4 (8 where single
precision does not hold the samples), unless --memory holds them. Voids take none.

A DEM in degrees gets the spacing in metres that degrees have at its centre; `terrasoar info` says so. PNG says nothing about spacing:
state it, or it is taken to be 1 m.")]
pub(super) struct Args {
    /// Elevation data: one file, or several .hgt tiles that border each other
    #[arg(required = true, value_name = "IN")]
    inputs: Vec<PathBuf>,
    /// Terrain file to write
    #[arg(short, long, value_name = "OUT.iqt")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Metres between samples, one number or east,north, instead of what the DEM says
    #[arg(long, value_name = "M|MX,MY", value_parser = parse::spacing_m)]
    spacing: Option<[f64; 2]>,
    /// Factor on all heights, such as 0.1 where a raw unit is a decimetre
    #[arg(long, value_name = "S", default_value = "1", value_parser = parse::positive)]
    z_scale: f64,
    /// Memory to use at most, in MiB
    #[arg(long, value_name = "MIB", default_value_t = 512, value_parser = clap::value_parser!(u64).range(48..=1 << 24))]
    memory: u64,
    /// Kind of record; without it the smallest that keeps every height exactly. Compact rounds heights to 65,536 steps where it must
    #[arg(long, value_name = "KIND")]
    record: Option<RecordWord>,
    /// Error to store: bounded keeps the promise on the screen, step is the measure of the SOAR papers
    #[arg(long, value_name = "KIND", default_value = "bounded")]
    error: ErrorWord,
    /// Threads to use; all cores without it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Raw value that means "no data", beside what the DEM declares
    #[arg(long, value_name = "VALUE", value_parser = parse::finite, allow_negative_numbers = true)]
    nodata: Option<f64>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum RecordWord {
    /// 4 bytes a vertex
    Compact,
    /// 8 or 16 bytes a vertex
    Exact,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum ErrorWord {
    /// Farthest departure of the surface over all samples
    Bounded,
    /// Distance of a vertex from the edge it splits
    Step,
}

impl Args {
    fn options(&self) -> BuildOptions {
        BuildOptions::default()
            .spacing_m(self.spacing)
            .z_scale(self.z_scale)
            .memory_mib(self.memory)
            .record(self.record.map(|word| match word {
                RecordWord::Compact => RecordKind::Compact,
                RecordWord::Exact => RecordKind::Exact8,
            }))
            .error(match self.error {
                ErrorWord::Bounded => ErrorKind::Bounded,
                ErrorWord::Step => ErrorKind::Step,
            })
            .nodata(self.nodata)
    }
}

pub(super) fn run(args: &Args) -> Result<()> {
    let inputs: Vec<&Path> = args.inputs.iter().map(PathBuf::as_path).collect();
    args.force.file(&args.output, Kind::Terrain, &inputs)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = args.threads {
        pool = pool.num_threads(usize::from(threads));
    }
    let pool = pool.build().context("cannot start the threads; give fewer with --threads")?;
    let start = Instant::now();
    let header = pool.install(|| {
        let dem = terrasoar_import::open(&args.inputs)?;
        build(&*dem, &args.output, &args.options(), &Meter::new("samples"))
    })?;
    let seconds = start.elapsed().as_secs_f64();
    warn_about_spacing(&header);
    print(&summary(&args.output, &header, seconds))
}

/// The spacing decides slopes and speeds: whoever did not state it should hear where it came from.
fn warn_about_spacing(header: &Header) {
    match header.spacing_origin {
        SpacingOrigin::Dem | SpacingOrigin::User => {}
        SpacingOrigin::Degrees { .. } => complain(&format!(
            "note: the DEM is in degrees; its spacing of {} was {}; state another with --spacing",
            terrain::spacing(header),
            terrain::spacing_origin(header)
        )),
        SpacingOrigin::Assumed => complain(&format!(
            "warning: the DEM does not say how far apart its samples are; {} was assumed; state it with --spacing",
            terrain::spacing(header)
        )),
    }
}

fn summary(out: &Path, header: &Header, seconds: f64) -> String {
    let [wide, high] = header.grid.samples().map(u64::from);
    let samples = wide * high;
    format!(
        "{}: {} x {} samples in {seconds:.1} s ({} samples/s), {} bytes ({:.2} a sample)\n\
         {} records of {} bytes, {} error, spacing {} ({})",
        out.display(),
        grouped(wide),
        grouped(high),
        short(samples as f64 / seconds.max(1e-9)),
        grouped(header.file_bytes),
        header.file_bytes as f64 / samples as f64,
        header.record_kind.name(),
        header.record_kind.bytes(),
        header.error_kind.name(),
        terrain::spacing(header),
        terrain::spacing_origin(header)
    )
}
