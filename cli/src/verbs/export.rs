//! `terrasoar export`: heights out again, as a GeoTIFF that every other program reads.

use super::area::{self, AreaArgs};
use super::output::{complain, decimal, grouped, print};
use super::outputs::{Force, Kind};
use super::parse;
use super::progress::Meter;
use super::terrain::{self, TerrainArgs};
use anyhow::Result;
use clap::ValueEnum;
use std::path::PathBuf;
use terrasoar_import::export::{Named, Numbers, Written, export_heights};
use terrasoar_layout::file::header::{Header, SpacingOrigin};
use terrasoar_layout::read::window::SampleWindow;

/// Write the heights of a terrain as a cloud-optimised GeoTIFF.
///
/// Heights are as they are now, with the edits in the file and those of --overlay, in metres, at the samples and in the reference system of the elevation model. Samples without a height are
/// the file's "no data". Whole metres are written as 16-bit integers, other heights in single precision, those of double-precision data in double precision. The file has
/// overviews and tiles, so that programs open it at once however large it is. It takes no more memory for a larger terrain, but twice its room on the disk while it is made; it appears when it
/// is complete.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar export alps.iqt -o alps.tif
  terrasoar export alps.iqt --overlay dam.iqo -o with-dam.tif
  terrasoar export alps.iqt --window 0,0,20480,10240 -o corner.tif
  terrasoar export alps.iqt --window 395000,5092000,396000,5093000 --crs dem -o village.tif
  terrasoar export alps.iqt --window 7.65,45.97,7.67,45.98 --crs EPSG:4326 -o summit.tif
  terrasoar export alps.iqt --window 512,512,1024,1024 --crs samples --step 4 -o coarse.tif

A window holds the samples in it and on its sides. With --step N every N-th sample is written, counted from the terrain's south-west one, so that windows beside each other fit.")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// GeoTIFF to write
    #[arg(short, long, value_name = "OUT.tif", value_parser = parse::with_extension(&["tif", "tiff"]))]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    area: AreaArgs,
    /// Write every N-th sample, N a power of two
    #[arg(long, value_name = "N", default_value = "1", value_parser = area::step)]
    step: u32,
    /// How heights are stored, instead of the smallest numbers that keep them
    #[arg(long = "type", value_name = "TYPE")]
    numbers: Option<NumbersWord>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum NumbersWord {
    /// Whole metres from -32767 to 32767; others are rounded
    Int16,
    /// Single precision, about seven digits
    Float32,
    /// Double precision
    Float64,
}

pub(super) fn run(args: &Args) -> Result<()> {
    args.force.file(&args.output, Kind::Elevation, &args.terrain.inputs(&[]))?;
    // Read page by page: a map of a large terrain would count as memory.
    let terrain = args.terrain.open()?.open_again_unmapped()?;
    let window = args.area.window(&terrain, &args.terrain.file, args.step)?;
    let numbers = args.numbers.map(|word| match word {
        NumbersWord::Int16 => Numbers::Int16,
        NumbersWord::Float32 => Numbers::Float32,
        NumbersWord::Float64 => Numbers::Float64,
    });
    let progress = Meter::new("samples");
    let written = export_heights(&terrain, &window, numbers, &args.output, &progress)?;
    drop(progress);
    warn(terrain.header(), &written);
    print(&summary(&args.output, terrain.header(), &window, &written))
}

/// What a reader of the file should know that it does not say.
fn warn(header: &Header, written: &Written) {
    match written.named {
        Named::Code | Named::Parameters => {}
        Named::Name => complain(&format!(
            "note: the reference system, {}, does not go into GeoTIFF; the file says its name and unit alone",
            terrain::crs(header).unwrap_or_else(|| "which has no name".into())
        )),
        Named::Nothing => complain(match header.sample_to_crs {
            Some(_) => "note: the terrain does not know its reference system, so neither does the file",
            None => {
                "note: the terrain does not know where on the ground it lies; the file is in metres from its south-west sample"
            }
        }),
    }
    if header.spacing_origin == SpacingOrigin::User && header.sample_to_crs.is_some() {
        complain(&format!(
            "note: the spacing of {} was stated when the terrain was built; the file says the elevation model's own",
            terrain::spacing(header)
        ));
    }
}

/// What was written, in words.
pub(super) fn summary(
    out: &std::path::Path,
    header: &Header,
    window: &SampleWindow,
    written: &Written,
) -> String {
    let [east_m, north_m] = header.grid.spacing_m().map(|m| decimal(m * f64::from(window.step), 4));
    let numbers = match written.numbers {
        Numbers::Int16 => "16-bit integers",
        Numbers::Float32 => "single precision",
        Numbers::Float64 => "double precision",
    };
    format!(
        "{}: {} x {} samples {east_m} x {north_m} m apart, {} of them without data, in {numbers}, {} bytes",
        out.display(),
        grouped(written.size[0].into()),
        grouped(written.size[1].into()),
        grouped(written.voids),
        grouped(written.bytes)
    )
}
