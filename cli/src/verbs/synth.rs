//! `terrasoar synth`: fractal terrain, and pictures of terrain, for tests and figures.

use super::output::{complain, grouped, print};
use super::outputs::{Force, Kind};
use super::progress::Meter;
use super::{WrongUsage, parse, terrain};
use anyhow::Result;
use std::path::{Path, PathBuf};
use terrasoar_import::synth::{ColourOptions, SynthOptions, write, write_colour};

/// From so many bytes on it is said how many there will be.
const MUCH_BYTES: u64 = 1 << 30;

/// Make synthetic elevation data in the manner of Puget Sound, or a picture of a terrain.
///
/// An inlet, lowlands, two ranges and two volcanoes, with detail down to the sample; the same seed and size give the same file
/// everywhere. Streamed, so any size fits any memory. Raw units are decimetres and the file says so.
///
/// With --colour, an RGB GeoTIFF that looks like a photograph of the terrain from above, coloured by height, slope and noise, which
/// `terrasoar drape` lays where it belongs.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar synth --size 4097 --seed 1 -o land.tif
  terrasoar synth --size 16385 --seed 7 --spacing 10 -o large.tif
  terrasoar synth --colour land.iqt -o photo.tif
  terrasoar synth --colour land.iqt --texels 4 -o sharp.tif")]
pub(super) struct Args {
    /// Samples a side, 2^k + 1 up to 1048577: 2 bytes each in a GeoTIFF, 34 GB at 131073 and 2.2 TB at the most
    #[arg(long, value_name = "N", value_parser = parse::synth_size, required_unless_present = "colour")]
    size: Option<u32>,
    /// Which landscape, or which picture
    #[arg(long, value_name = "S", required_unless_present = "colour")]
    seed: Option<u64>,
    /// Metres between samples
    #[arg(long, value_name = "M", default_value = "20", value_parser = parse::positive)]
    spacing: f64,
    /// Make a picture of this terrain file instead
    #[arg(long, value_name = "FILE.iqt", visible_alias = "color", conflicts_with_all = ["size", "spacing"])]
    colour: Option<PathBuf>,
    /// Texels a sample of the picture
    #[arg(long, value_name = "N", default_value_t = 1, requires = "colour", conflicts_with_all = ["size", "spacing"], value_parser = clap::value_parser!(u32).range(1..=64))]
    texels: u32,
    /// File to write: GeoTIFF or 16-bit PNG by its extension
    #[arg(short, long, value_name = "OUT.(tif|png)", value_parser = parse::with_extension(&["tif", "tiff", "png"]))]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let seed = args.seed.unwrap_or(0);
    if let Some(file) = &args.colour {
        return colour(args, file, seed);
    }
    args.force.file(&args.output, Kind::Synthetic, &[])?;
    let size = args.size.unwrap_or(1025);
    let options = SynthOptions::default().size(size).seed(seed).spacing_m(args.spacing);
    if options.sample_bytes() >= MUCH_BYTES {
        complain(&format!(
            "note: {}: {} samples take {} bytes in a GeoTIFF",
            args.output.display(),
            grouped(u64::from(size).pow(2)),
            grouped(options.sample_bytes())
        ));
    }
    let progress = Meter::new("rows");
    progress.begin("making terrain", size.into());
    write(&options, &args.output, &|rows| progress.set(rows))?;
    drop(progress);
    let size = grouped(size.into());
    print(&format!("{}: {size} x {size} samples, {} m apart", args.output.display(), args.spacing))
}

fn colour(args: &Args, file: &Path, seed: u64) -> Result<()> {
    if args.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        return Err(
            WrongUsage("pictures are written as GeoTIFF; give the output the extension .tif".into()).into()
        );
    }
    args.force.file(&args.output, Kind::Synthetic, &[file])?;
    let terrain = terrain::open(file)?;
    let options = ColourOptions::default().seed(seed).texels_a_sample(args.texels);
    let progress = Meter::new("rows");
    let rows = u64::from(terrain.grid().samples()[1] - 1) * u64::from(args.texels);
    progress.begin("painting", rows);
    let [wide, high] =
        write_colour(&terrain, &options, &args.output, &|rows| progress.set(rows))?.map(u64::from);
    drop(progress);
    print(&format!("{}: {} x {} texels", args.output.display(), grouped(wide), grouped(high)))
}
