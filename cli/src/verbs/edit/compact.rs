//! `terrasoar compact`: a terrain file written anew, without what edits left behind.

use crate::verbs::WrongUsage;
use crate::verbs::output::{grouped, print, print_json};
use crate::verbs::outputs::{Force, Kind};
use crate::verbs::overlays;
use crate::verbs::progress::Meter;
use crate::verbs::terrain::TerrainArgs;
use anyhow::{Result, bail};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use terrasoar_layout::edit::{Compacted, compact, compact_packed};
use terrasoar_layout::file::disk::SystemDisk;

/// Write a terrain file anew without what edits left behind.
///
/// The ground and the imagery stay as they are, pages come in order again, and the history ends: what was edited can no longer be undone or redone, and it says so. Without -o the file itself
/// is replaced, when the new one is complete; programs that have it open go on reading the old one. With --overlay, -o is the terrain with those edits. Packed
/// terrain stays packed; until it is complete that takes the room of the terrain file that it is made of as well.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar compact alps.iqt
  terrasoar compact alps.iqt -o small.iqt
  terrasoar compact alps.iqt --packed -o smallest.iqt
  terrasoar compact alps.iqt --overlay what-if.iqo -o new-alps.iqt

Fields of --json: file, output, bytes_before, bytes_after, pages, seconds.")]
pub(crate) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// File to write instead of replacing the terrain file
    #[arg(short, long, value_name = "OUT.iqt")]
    output: Option<PathBuf>,
    /// Write packed terrain, in a third to a tenth of the bytes; what is packed stays so in any case
    #[arg(long)]
    packed: bool,
    #[command(flatten)]
    force: Force,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Answer {
    file: String,
    output: String,
    bytes_before: u64,
    bytes_after: u64,
    pages: u64,
    seconds: f64,
}

pub(crate) fn run(args: &Args) -> Result<()> {
    let start = Instant::now();
    let is_lost = overlays::tell_of_lost_in(&args.terrain.file, args.terrain.overlay.as_deref());
    let out = match (&args.output, &args.terrain.overlay) {
        (Some(out), _) => {
            args.force.file(out, Kind::Terrain, &args.terrain.inputs(&[]))?;
            out
        }
        (None, None) => {
            overlays::refuse_rewriting(&args.terrain.file, args.force.is_given())?;
            if is_lost && !args.force.is_given() {
                bail!(
                    "{}: its newest header is damaged, and what that led to would be gone; name another output with -o, or give it up with --force",
                    args.terrain.file.display()
                );
            }
            &args.terrain.file
        }
        (None, Some(_)) => {
            return Err(WrongUsage(
                "with --overlay, name the file to write with -o; the terrain under an overlay stays as it is"
                    .into(),
            )
            .into());
        }
    };
    let progress = Meter::new("records");
    let TerrainArgs { file, overlay } = &args.terrain;
    let rewrite = if args.packed { compact_packed } else { compact };
    let Compacted { header, bytes_before, bytes, commits_before, .. } =
        rewrite(&SystemDisk, file, overlay.as_deref(), out, &progress)?;
    drop(progress);
    let answer = Answer {
        file: overlay.as_ref().unwrap_or(file).display().to_string(),
        output: out.display().to_string(),
        bytes_before,
        bytes_after: bytes,
        pages: header.stored_pages,
        seconds: start.elapsed().as_secs_f64(),
    };
    if args.json {
        return print_json(&answer);
    }
    let ended = match commits_before {
        commits if commits == 0 || args.output.is_some() => String::new(),
        1 => "; the history ends: 1 commit of edits can no longer be undone".into(),
        commits => {
            format!("; the history ends: {} commits of edits can no longer be undone", grouped(commits))
        }
    };
    print(&format!(
        "{}: {} bytes instead of {}, {} record pages, {:.1} s{ended}",
        answer.output,
        grouped(answer.bytes_after),
        grouped(answer.bytes_before),
        grouped(answer.pages),
        answer.seconds
    ))
}
