//! `terrasoar verify`: checks every page of a terrain file.

use super::output::{grouped, print_line};
use super::progress::Meter;
use super::terrain::TerrainArgs;
use super::{Lines, overlays};
use anyhow::{Result, bail};
use terrasoar_layout::read::lost::LostHeader;
use terrasoar_layout::verify::{verify, verify_pages};

/// Check every page of a terrain file.
///
/// Header, directory, checksums, page numbers, that errors and radii are nested the way refinement relies on, and every tile of imagery; of a file that was edited also its
/// history, and the checksums and page numbers of every state that undo and redo lead to. Names the pages that are wrong. Exit code 0: sound; 1: not.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  terrasoar verify alps.iqt && echo sound")]
pub(super) struct Args {
    #[command(flatten)]
    terrain: TerrainArgs,
}

pub(super) fn run(args: &Args) -> Result<()> {
    // Plain reads: a file that is cut while it is checked is an error, where a map would be a signal.
    let terrain = args.terrain.open_to_verify()?;
    let progress = Meter::new("pages");
    progress.begin("verifying", verify_pages(&terrain));
    let report =
        verify(&terrain, &|pages| progress.add(pages)).inspect_err(|_| overlays::tell_of_lost(&terrain))?;
    drop(progress);
    // What was cut off before it was saved is said, and is no fault of the file.
    let lost = report.lost_header.filter(LostHeader::may_have_been_saved);
    if report.lost_header.is_some() && lost.is_none() {
        overlays::tell_of_lost(&terrain);
    }
    if let (true, Some(lost)) = (report.is_sound(), lost) {
        let or_else = match lost.was_saved {
            Some(_) => "",
            None => ", or let the next edit write it anew if a power cut stopped the last one",
        };
        bail!(
            "{}: the newest header, on page {}, is damaged; the state before it, which is read instead, is sound; restore a copy of the file{or_else}",
            terrain.path().display(),
            lost.page
        );
    }
    if report.is_sound() {
        let tiles = match report.tiles_checked {
            0 => String::new(),
            tiles => format!(", {} tiles of imagery match theirs", grouped(tiles)),
        };
        return print_line(&format!(
            "{}: sound: {} record pages match their checksums, {} vertices are nested{tiles}",
            terrain.path().display(),
            grouped(report.pages_checked),
            grouped(report.vertices_checked)
        ));
    }
    let mut lines = vec![format!(
        "{}: not sound, {} problem{}; restore a copy of the file or build it again",
        terrain.path().display(),
        grouped(report.problem_count),
        if report.problem_count == 1 { "" } else { "s" },
    )];
    lines.extend(report.problems.iter().map(|problem| format!("  {problem}")));
    let more = report.problem_count - report.problems.len() as u64;
    if more > 0 {
        lines.push(format!("  and {} more", grouped(more)));
    }
    if let Some(lost) = lost {
        lines.push(format!(
            "  the newest header, on page {}, is damaged, too; the state before it was read instead",
            lost.page
        ));
    }
    Err(Lines(lines).into())
}
