//! The verbs that change terrain: `edit` and `crater` here, going back and forth in `past`, rewriting in `compact`.

pub(super) mod compact;
pub(super) mod crater;
mod effect;
mod paint;
pub(super) mod past;
mod told;
mod work;

use super::output::print_json;
use super::progress::Meter;
use anyhow::Result;
use std::path::{Path, PathBuf};
use terrasoar::edits::{Loader, Script, Step};
use work::{Target, Work};

/// Change the ground of a terrain file by a script of edits.
///
/// A script of edits (EDITS.md in the repository specifies it) has craters, brushes, stamps of other elevation data, and areas set to a height or back to the one they were built with. Each of its
/// batches is applied whole or not at all and becomes durable before the next; `terrasoar undo` takes it back. Programs that have the file open go on reading it as
/// it was. With --overlay, the edits go to a file of their own and the terrain is not touched. Heights that the file's records cannot hold make it rewrite the file with
/// room for them, which ends its history; it says so. An edit that lies wholly outside the terrain is refused, before anything is done; of one that lies partly outside it warns. Where a picture is draped, craters scorch it, in the same commits.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar edit alps.iqt --script dam.edits
  terrasoar edit alps.iqt --script dam.edits --dry-run
  terrasoar edit alps.iqt --script dam.edits --overlay what-if.iqo

Fields of --json: file, overlay, dry_run, batches, edits, edits_outside (that reach no sample), samples (of the rectangles that hold all changed heights), records_changed,
voids_passed, tiles_painted, pages_written, bytes_appended, widenings (times the file was rewritten), needs_widening (a dry run that got no further),
changed_samples, changed_m2, change_m (lowest and highest change of height; these three null where it was too much to measure), batches_before, seconds.")]
pub(super) struct Args {
    #[command(flatten)]
    target: TargetArgs,
    /// Script of edits
    #[arg(long, value_name = "E.edits")]
    script: PathBuf,
    /// Rewrite the file for heights that it has no room for, also where overlays beside it, or the ground that the script restores, would be lost
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    how: HowArgs,
}

/// What is edited.
#[derive(Debug, clap::Args)]
struct TargetArgs {
    /// Terrain file (.iqt)
    file: PathBuf,
    /// Keep the edits in this file, made if missing, and leave the terrain file as it is
    #[arg(long, value_name = "O.iqo")]
    overlay: Option<PathBuf>,
}

impl TargetArgs {
    fn target(&self) -> Target<'_> {
        Target { file: &self.file, overlay: self.overlay.as_deref() }
    }
}

/// How edits are made and told.
#[derive(Debug, clap::Args)]
struct HowArgs {
    /// Leave the picture over the terrain as it is: craters scorch it otherwise, and what restores ground restores it
    #[arg(long)]
    no_scorch: bool,
    /// Apply everything in memory and write nothing
    #[arg(long)]
    dry_run: bool,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<()> {
    let script = Script::read(&args.script)?;
    apply(args.target.target(), &script, Some(&args.script), &args.how, args.force)
}

/// Applies a script, which was read from `path` or made here, and tells what became of it.
fn apply(
    target: Target<'_>,
    script: &Script,
    path: Option<&Path>,
    how: &HowArgs,
    is_forced: bool,
) -> Result<()> {
    let progress = Meter::new("edits");
    let mut loader = Loader::new(path.unwrap_or(target.file), terrasoar_import::open_file);
    if script
        .batches
        .iter()
        .flat_map(|batch| &batch.steps)
        .any(|step| matches!(step, Step::Stamp(stamp) if stamp.at.is_none()))
    {
        loader = loader.over(target.terrain()?.header());
    }
    let batches = loader.script(script)?;
    let work = Work {
        target,
        batches: &batches,
        script: path,
        paints: !how.no_scorch,
        is_forced,
        progress: &progress,
    };
    let told = if how.dry_run { work.rehearse()? } else { work.perform()? };
    drop(progress);
    if how.json { print_json(&told) } else { super::output::print(&told.text()) }
}
