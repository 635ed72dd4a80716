//! `terrasoar undo`, `redo` and `history`: batches taken back, done again and listed.

use super::TargetArgs;
use crate::verbs::output::{columns, grouped, print, print_json, print_line};
use crate::verbs::overlays;
use crate::verbs::terrain::TerrainArgs;
use anyhow::{Result, bail};
use serde::Serialize;
use terrasoar_layout::edit::{Changes, EditSession, HistoryEntry, history};

/// Take back the last batches of edits.
///
/// The file is again what it was before them, byte by byte where it is read, and says so durably. `terrasoar redo` does them again, until something else is edited.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar undo alps.iqt
  terrasoar undo alps.iqt 3
  terrasoar undo alps.iqt --overlay what-if.iqo

Fields of --json: file, batches (taken back), labels, records_changed, commit (the file is in the state after this one; 0: as built).")]
pub(crate) struct UndoArgs {
    #[command(flatten)]
    turn: TurnArgs,
}

/// Do batches of edits again that were undone.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar redo alps.iqt
  terrasoar redo alps.iqt 3
  terrasoar redo alps.iqt --overlay what-if.iqo

Fields of --json: file, batches (done again), labels, records_changed, commit (the file is in the state after this one).")]
pub(crate) struct RedoArgs {
    #[command(flatten)]
    turn: TurnArgs,
}

#[derive(Debug, clap::Args)]
struct TurnArgs {
    #[command(flatten)]
    target: TargetArgs,
    /// So many batches, or as many as there are
    #[arg(value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

/// List the batches of edits of a terrain file.
///
/// The first one first; those that were undone and can be done again are marked.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  terrasoar history alps.iqt
  terrasoar history alps.iqt --overlay what-if.iqo --json

Fields of --json: file, commit (the file is in the state after this one; 0: as built), commits: a list of commit, edits, label, undone.")]
pub(crate) struct HistoryArgs {
    #[command(flatten)]
    terrain: TerrainArgs,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Turned {
    file: String,
    batches: u64,
    labels: Vec<String>,
    records_changed: u64,
    commit: u32,
}

#[derive(Debug, Serialize)]
struct Past {
    file: String,
    commit: u32,
    commits: Vec<PastCommit>,
}

#[derive(Debug, Serialize)]
struct PastCommit {
    commit: u32,
    edits: u64,
    label: String,
    undone: bool,
}

pub(crate) fn undo(args: &UndoArgs) -> Result<()> {
    args.turn.run("undo", "undone", EditSession::undo)
}

pub(crate) fn redo(args: &RedoArgs) -> Result<()> {
    args.turn.run("redo", "done again", EditSession::redo)
}

/// The commit that a file is in the state of; 0: as built.
fn current(entries: &[HistoryEntry]) -> u32 {
    entries.iter().find(|entry| entry.is_current).map_or(0, |entry| entry.sequence)
}

/// How many of a history's commits are in force.
fn done(entries: &[HistoryEntry]) -> usize {
    entries.iter().position(|entry| entry.is_current).map_or(0, |at| at + 1)
}

impl TurnArgs {
    fn run(
        &self,
        verb: &str,
        participle: &str,
        mut turn: impl FnMut(&mut EditSession) -> Result<Option<Changes>, terrasoar_layout::LayoutError>,
    ) -> Result<()> {
        let target = self.target.target();
        if let Some(overlay) = target.overlay.filter(|overlay| !overlay.exists()) {
            bail!(
                "{}: there is no such overlay, so nothing to {verb}; name one that exists",
                overlay.display()
            );
        }
        let mut session = target.session()?;
        overlays::tell_of_older(session.editor().terrain());
        let before = done(&session.history()?);
        let (mut batches, mut records_changed) = (0, 0);
        while batches < self.count {
            let Some(changes) = turn(&mut session)? else { break };
            batches += 1;
            records_changed += changes.vertices.len() as u64;
        }
        if batches == 0 {
            bail!(
                "{}: there is nothing to {verb}; `terrasoar history` lists what there is",
                target.path().display()
            );
        }
        let entries = session.history()?;
        let after = done(&entries);
        let mut labels: Vec<String> =
            entries[before.min(after)..before.max(after)].iter().map(|entry| entry.label.clone()).collect();
        if after < before {
            labels.reverse();
        }
        let told = Turned {
            file: target.path().display().to_string(),
            batches,
            labels,
            records_changed,
            commit: current(&entries),
        };
        if self.json {
            return print_json(&told);
        }
        let state = match told.commit {
            0 => "as it was built".to_owned(),
            commit => format!("as after commit {commit}"),
        };
        print_line(&format!(
            "{}: {participle}: {}; the terrain is {state}",
            told.file,
            told.labels.join(", ")
        ))
    }
}

pub(crate) fn list(args: &HistoryArgs) -> Result<()> {
    let terrain = args.terrain.open_unmapped()?;
    let entries = history(&terrain)?;
    let done = done(&entries);
    let past = Past {
        file: terrain.path().display().to_string(),
        commit: current(&entries),
        commits: entries
            .into_iter()
            .enumerate()
            .map(|(i, HistoryEntry { sequence: commit, edits, label, .. })| PastCommit {
                commit,
                edits,
                label,
                undone: i >= done,
            })
            .collect(),
    };
    if args.json {
        return print_json(&past);
    }
    if past.commits.is_empty() {
        return print_line(&format!("{}: no edits", past.file));
    }
    let head = ["commit", "edits", "", "what"].map(String::from).to_vec();
    let rows = past.commits.iter().map(|commit| {
        let state = match commit {
            c if c.undone => "undone",
            c if c.commit == past.commit => "current",
            _ => "",
        };
        vec![commit.commit.to_string(), grouped(commit.edits), state.to_owned(), commit.label.clone()]
    });
    let as_built = if past.commit == 0 { "all undone: the terrain is as it was built\n" } else { "" };
    print(&format!("{}{as_built}", columns(&std::iter::once(head).chain(rows).collect::<Vec<_>>())))
}
