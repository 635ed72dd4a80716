//! `terrasoar pack` and `terrasoar unpack`: a terrain file in a tenth of the room, and back.

use super::output::{grouped, print, print_json};
use super::outputs::{Force, Kind};
use super::overlays;
use super::progress::Meter;
use anyhow::Result;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::disk::SystemDisk;
use terrasoar_layout::packing::{pack, unpack};

/// Pack a terrain file into a third to a tenth of its bytes, without any loss.
///
/// Packed terrain is drawn and flown over as it is: tiles are unpacked as views need them, by every engine. It is
/// edited, draped and undone as any other: what that appends is packed, too. Terrains with any kind of records can be packed. The history comes along, and undo goes on; what edits appended before keeps its size, and
/// `terrasoar compact --packed` packs the terrain as it is instead, without history. What was written is unpacked again and compared with the terrain, byte for byte, before it gets its name.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar pack alps.iqt -o alps-packed.iqt
  terrasoar pack alps.iqt -o alps-packed.iqt --json

Fields of --json: file, output, bytes_before, bytes_after, bytes_per_sample (imagery left out), seconds.")]
pub(super) struct PackArgs {
    #[command(flatten)]
    rewriting: Rewriting,
}

/// Make the terrain file again that a packed one was made of.
///
/// It is the same, byte for byte, with all edits since then and their history. Every page is checked.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  terrasoar unpack alps-packed.iqt -o alps.iqt

Fields of --json: file, output, bytes_before, bytes_after, seconds.")]
pub(super) struct UnpackArgs {
    #[command(flatten)]
    rewriting: Rewriting,
}

/// A file read and another written of it.
#[derive(Debug, clap::Args)]
struct Rewriting {
    /// Terrain file to read (.iqt)
    file: PathBuf,
    /// Terrain file to write
    #[arg(short, long, value_name = "OUT.iqt")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// What a rewriting came to.
struct Sizes {
    bytes_before: u64,
    bytes_after: u64,
    bytes_per_sample: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Answer {
    file: String,
    output: String,
    bytes_before: u64,
    bytes_after: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    bytes_per_sample: Option<f64>,
    seconds: f64,
}

impl Rewriting {
    /// Does it, and tells what came of it.
    fn run(&self, rewrite: impl FnOnce(&Meter) -> Result<Sizes, LayoutError>) -> Result<()> {
        let start = Instant::now();
        self.force.file(&self.output, Kind::Terrain, &[self.file.as_path()])?;
        overlays::tell_of_lost_in(&self.file, None);
        let progress = Meter::new("samples");
        let Sizes { bytes_before, bytes_after, bytes_per_sample } = rewrite(&progress)?;
        drop(progress);
        let answer = Answer {
            file: self.file.display().to_string(),
            output: self.output.display().to_string(),
            bytes_before,
            bytes_after,
            bytes_per_sample,
            seconds: start.elapsed().as_secs_f64(),
        };
        if self.json {
            return print_json(&answer);
        }
        let a_sample = bytes_per_sample.map_or(String::new(), |bytes| format!(", {bytes:.3} bytes a sample"));
        print(&format!(
            "{}: {} bytes instead of {}{a_sample}, {:.1} s",
            answer.output,
            grouped(bytes_after),
            grouped(bytes_before),
            answer.seconds
        ))
    }
}

pub(super) fn run_pack(args: &PackArgs) -> Result<()> {
    let Rewriting { file, output, .. } = &args.rewriting;
    args.rewriting.run(|progress| {
        let packed = pack(&SystemDisk, file, output, progress)?;
        Ok(Sizes {
            bytes_before: packed.bytes_before,
            bytes_after: packed.bytes,
            bytes_per_sample: Some(packed.bytes_per_sample),
        })
    })
}

pub(super) fn run_unpack(args: &UnpackArgs) -> Result<()> {
    let Rewriting { file, output, .. } = &args.rewriting;
    args.rewriting.run(|progress| {
        let bytes_before = std::fs::metadata(file).map_or(0, |meta| meta.len());
        let header = unpack(&SystemDisk, file, output, progress)?;
        Ok(Sizes { bytes_before, bytes_after: header.file_bytes, bytes_per_sample: None })
    })
}
