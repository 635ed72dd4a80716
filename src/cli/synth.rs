//! `terrasoar synth`: fractal terrain for tests and figures.

use super::output::{check_output, grouped, print};
use super::parse;
use super::progress::Progress;
use anyhow::Result;
use std::path::PathBuf;
use terrasoar_layout::synth::{SynthOptions, write};

/// Make synthetic elevation data in the manner of Puget Sound.
///
/// An inlet, lowlands, two ranges and two volcanoes, with detail down to the sample; the same seed and size give the same file
/// everywhere. Streamed, so any size fits any memory. Raw units are decimetres and the file says so.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar synth --size 4097 --seed 1 -o land.tif
  terrasoar synth --size 16385 --seed 7 --spacing 10 -o large.tif")]
pub(super) struct Args {
    /// Samples a side, 2^k + 1 up to 65537
    #[arg(long, value_name = "N", value_parser = parse::synth_size)]
    size: u32,
    /// Which landscape
    #[arg(long, value_name = "S")]
    seed: u64,
    /// Metres between samples
    #[arg(long, value_name = "M", default_value = "20", value_parser = parse::positive)]
    spacing: f64,
    /// File to write: GeoTIFF or 16-bit PNG by its extension
    #[arg(short, long, value_name = "OUT.(tif|png)", value_parser = |text: &str| parse::with_extension(text, &["tif", "tiff", "png"]))]
    output: PathBuf,
}

pub(super) fn run(args: &Args) -> Result<()> {
    check_output(&args.output, &[])?;
    let options = SynthOptions { size: args.size, seed: args.seed, spacing_m: args.spacing };
    let progress = Progress::new("rows");
    progress.begin("making terrain", args.size.into());
    write(&options, &args.output, &|rows| progress.set(rows))?;
    drop(progress);
    let size = grouped(args.size.into());
    print(&format!("{}: {size} x {size} samples, {} m apart", args.output.display(), args.spacing))
}
