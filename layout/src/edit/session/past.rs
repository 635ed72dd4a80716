//! Back and forth through a file's history, by a header that names a state which is in the file already.

use super::EditSession;
use super::checked_state::check_state;
use super::commit::CommitJob;
use crate::edit::Changes;
use crate::error::LayoutError;
use crate::file::entries::Entry;
use crate::file::header::{Header, History};
use crate::file::journal::{Commit, Lineage};
use crate::file::source::Source;
use crate::read::terrain::Terrain;
use std::sync::Arc;

/// A commit of a file's history.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HistoryEntry {
    /// 1 for the first.
    pub sequence: u32,
    /// Edits in it.
    pub edits: u64,
    /// What it was, in words.
    pub label: String,
    /// Whether the file is in the state that it led to.
    pub is_current: bool,
}

impl EditSession {
    /// Goes back to the state before the last commit, durably; `None` if there is none to go back to.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] while edits are not committed or a commit is under way; damage and I/O of what the file holds of that state. The file reads as before then.
    pub fn undo(&mut self) -> Result<Option<Changes>, LayoutError> {
        self.check_idle()?;
        let Some(History { commit_page, tip_page }) = self.slots.header.history else { return Ok(None) };
        if commit_page == 0 {
            return Ok(None);
        }
        let parent = Commit::read(self.source(), &self.slots.header, commit_page)?.parent;
        self.turn_to(parent, tip_page).map(Some)
    }

    /// Goes forward again to the state after the commit that was undone last, durably; `None` if there is none.
    ///
    /// # Errors
    /// As [`EditSession::undo`].
    pub fn redo(&mut self) -> Result<Option<Changes>, LayoutError> {
        self.check_idle()?;
        let Some(History { commit_page, tip_page }) = self.slots.header.history else { return Ok(None) };
        let mut at = tip_page;
        while at != commit_page {
            let parent = Commit::read(self.source(), &self.slots.header, at)?.parent;
            if parent == commit_page {
                return self.turn_to(at, tip_page).map(Some);
            }
            if parent == 0 {
                return Err(LayoutError::damaged(
                    &self.path,
                    "journal",
                    "what was undone does not lead on from here; `terrasoar compact` writes the file without its journal",
                ));
            }
            at = parent;
        }
        Ok(None)
    }

    /// How many commits led to the state that the file is in: those that can be undone. Reads two pages of the journal at most, however long it is.
    ///
    /// # Errors
    /// Damage of these pages; I/O.
    pub fn commits_in_force(&self) -> Result<u32, LayoutError> {
        Ok(Lineage::read(self.source(), &self.slots.header)?.commits())
    }

    /// All commits that can be undone or redone, the first one first.
    ///
    /// # Errors
    /// Damage of the journal; I/O.
    pub fn history(&self) -> Result<Vec<HistoryEntry>, LayoutError> {
        history_of(self.source(), &self.slots.header)
    }

    /// Brings the file, and the ground in memory, to the state of a journal page; 0 is how it was built.
    fn turn_to(&mut self, commit_page: u32, tip_page: u32) -> Result<Changes, LayoutError> {
        if !self.is_committed() {
            return Err(LayoutError::Usage(format!(
                "{}: there are edits that are not committed; commit them or take them back first",
                self.path.display()
            )));
        }
        let old = &self.slots.header;
        let state = match commit_page {
            0 => self.original,
            page => Commit::read(self.source(), old, page)?.state,
        };
        let tail = self.tail()?;
        let header = Header {
            generation: tail.generation(),
            history: Some(History { commit_page, tip_page }),
            ..state.put_into(old)
        };
        let job = CommitJob::turn(tail, header)?;
        // Everything that can fail comes before the header: once that is durable, memory follows without fail.
        let checked = check_state(self.editor.terrain(), &self.directory, &job.next.page)?;
        let places: Vec<(u64, Entry)> =
            checked.differing.iter().map(|(logical, entry)| (*logical as u64, *entry)).collect();
        let replacement = self.editor.replacement(&places, &job.next.header)?;
        let (terrain, original) = (Arc::clone(self.editor.terrain()), self.original.imagery);
        let turn = self.picture.turn(&terrain, &self.slots.header, original, state.imagery)?;
        if let Err(error) = job.run_on(&*self.disk) {
            self.attempted.note(&job.next.attempt);
            return Err(error);
        }
        let changes = self.editor.replace(replacement);
        self.picture.turn_to(turn);
        self.directory = checked.directory;
        self.slots.flip(job.next.page, job.next.header, job.tail.packed_end().cloned());
        Ok(changes)
    }
}

/// All commits of a file, the first one first.
fn history_of(source: &dyn Source, header: &Header) -> Result<Vec<HistoryEntry>, LayoutError> {
    let Some(History { commit_page, tip_page }) = header.history else { return Ok(Vec::new()) };
    let mut entries = Vec::new();
    let mut at = tip_page;
    while at != 0 {
        let Commit { parent, sequence, edits, label, .. } = Commit::read(source, header, at)?;
        entries.push(HistoryEntry { sequence, edits, label, is_current: at == commit_page });
        at = parent;
    }
    entries.reverse();
    Ok(entries)
}

/// The commits that can be undone or redone in an opened terrain, the first one first.
///
/// # Errors
/// Damage of the journal; I/O.
pub fn history(terrain: &Terrain) -> Result<Vec<HistoryEntry>, LayoutError> {
    history_of(terrain.source(), terrain.header())
}
