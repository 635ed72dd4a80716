//! The right to edit a file, edits in memory, and the commit that is on its way to the disk: what one thread has and another may be given.
//!
//! Batches of edits that are not on the disk are remembered as they were given, so that they can be made again where the file is rewritten ([`Hand::widened`]). Cost beside the session's: a copy of
//! every edit that is not committed.

use super::ticket::{CommitFailed, CommitTicket, Saved, Writing};
use crate::stream::GroundPatch;
use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, CommitJob, Committed, Edit, EditSession, room_for};
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::file::header::FileState;
use terrasoar_layout::progress::Silent;
use terrasoar_layout::read::terrain::Terrain;

/// Pages, and where they lie in the file.
pub(super) type Places = Vec<(u64, Entry)>;

/// Batches of edits, in their order.
pub(super) type Batches = VecDeque<Vec<Edit>>;

/// Why a hand could not do its work, and what is left of it.
pub(super) enum Failed {
    /// It is as it was.
    Back(Box<Hand>, LayoutError),
    /// Nothing.
    Gone(Gone),
}

/// An error after which nobody can edit, and how many edits are lost by it.
pub(super) struct Gone {
    pub(super) error: LayoutError,
    pub(super) edits: usize,
}

impl Gone {
    /// The error, with what is lost.
    pub(super) fn told(self) -> LayoutError {
        let Self { error, edits } = self;
        match edits {
            0 => error,
            1 => LayoutError::Usage(format!("{error}; one edit that was not on the disk is lost")),
            _ => LayoutError::Usage(format!("{error}; {edits} edits that were not on the disk are lost")),
        }
    }
}

/// A session and what is not on the disk.
pub(super) struct Hand {
    /// Dropped before the session: the commit under way is brought to the disk while the right to edit is still held.
    writing: Option<Writing>,
    pub(super) session: EditSession,
    pub(super) path: PathBuf,
    /// Batches that are not on the disk, in their order.
    unsaved: Batches,
    /// So many of them, the first ones, are in the commit under way.
    in_writing: usize,
    /// Why edits since the last commit were refused that had been taken on.
    pub(super) refused: Option<CommitFailed>,
}

impl Hand {
    /// With a session of the file at `path`.
    pub(super) fn of(session: EditSession, path: &Path) -> Self {
        let path = path.to_owned();
        Self { session, writing: None, path, unsaved: Batches::new(), in_writing: 0, refused: None }
    }

    /// Applies a batch in memory, all of it or, on an error, nothing.
    ///
    /// # Errors
    /// As [`EditSession::apply`].
    pub(super) fn apply(&mut self, edits: &[Edit]) -> Result<(Changes, GroundPatch), LayoutError> {
        let changes = self.session.apply(edits)?;
        self.unsaved.push_back(edits.to_vec());
        let patch = GroundPatch::of(&changes, self.session.editor());
        Ok((changes, patch))
    }

    /// Begins to write all that is not on the disk; no commit may be under way.
    ///
    /// # Errors
    /// As [`EditSession::prepare_commit`]; the system gives no thread.
    pub(super) fn begin_commit(&mut self, label: &str) -> Result<CommitTicket, LayoutError> {
        let Some(job) = self.session.prepare_commit(label)? else {
            self.unsaved.clear();
            return Ok(CommitTicket::of_nothing(self.refused.take().map_or(Ok(Saved::default()), Err)));
        };
        let writing = Writing::begin(job, self.session.disk(), &self.path, self.refused.clone())?;
        self.refused = None;
        let ticket = writing.ticket();
        (self.writing, self.in_writing) = (Some(writing), self.unsaved.len());
        Ok(ticket)
    }

    /// Writes all that is not on the disk, and waits for that. Where pages lie then.
    ///
    /// # Errors
    /// As [`EditSession::commit`]; nothing is lost in memory.
    pub(super) fn commit_now(&mut self, label: &str) -> Result<(Saved, Places), LayoutError> {
        let committed = self.session.commit(label)?;
        self.unsaved.clear();
        let saved = Saved { pages: committed.pages, bytes: committed.bytes };
        Ok((saved, committed.places))
    }

    /// Whether the thread that writes a commit has come to its end.
    pub(super) fn has_written(&self) -> bool {
        self.writing.as_ref().is_some_and(Writing::is_over)
    }

    /// Waits for the commit under way, and takes notice of what became of it. Where pages lie then that were not edited meanwhile; nothing if there was no commit.
    ///
    /// # Errors
    /// That of the commit; what it was to write is part of the next one.
    pub(super) fn end_writing(&mut self) -> Result<Places, LayoutError> {
        let Some(writing) = self.writing.take() else { return Ok(Places::new()) };
        let taken = std::mem::take(&mut self.in_writing);
        // If the job is gone, the session knows by that that it is to write all that again.
        let job: CommitJob = writing.end().map_err(|failed| {
            LayoutError::Usage(format!("{failed}; the edits are in memory, and part of the next commit"))
        })?;
        let Committed { mut places, .. } = self.session.finish_commit(job, Ok(()))?;
        self.unsaved.drain(..taken);
        // What was edited meanwhile is not what the file has.
        let edited: BTreeSet<u64> = self.session.editor().uncommitted().into_iter().collect();
        places.retain(|(page, _)| !edited.contains(page));
        Ok(places)
    }

    /// Edits that are in memory alone.
    pub(super) fn unsaved_edits(&self) -> usize {
        edits_of(&self.unsaved)
    }

    /// Everything that is in memory alone.
    pub(super) fn uncommitted(&self) -> GroundPatch {
        let editor = self.session.editor();
        let page = |page: u64| Some((page, Box::new(*editor.edited_page(page)?)));
        GroundPatch {
            samples: Vec::new(),
            pages: editor.uncommitted().into_iter().filter_map(page).collect(),
            height_range_m: editor.header().height_range_m,
            places: Places::new(),
        }
    }

    /// What an undo or a redo made of the ground.
    ///
    /// # Errors
    /// Damage and I/O of the pages.
    pub(super) fn turned(&self, changes: Changes) -> Result<GroundPatch, LayoutError> {
        let (session, editor) = (&self.session, self.session.editor());
        let mut pages = Vec::with_capacity(changes.pages.len());
        for page in &changes.pages {
            // One that is in the file need not be in memory.
            let bytes = match editor.edited_page(*page) {
                Some(bytes) => Box::new(*bytes),
                None => editor.terrain().checked_page_at(*page, session.place_of(*page))?,
            };
            pages.push((*page, bytes));
        }
        Ok(GroundPatch {
            pages,
            height_range_m: editor.header().height_range_m,
            places: changes.pages.iter().map(|page| (*page, session.place_of(*page))).collect(),
            samples: changes.samples,
        })
    }

    /// Rewrites the file with room for these heights, on the current rayon pool, and goes on with it, without the batches that were not on the disk: they come beside it. The journal has ended then. No commit
    /// may be under way.
    ///
    /// # Errors
    /// What kept it from that. The hand comes back as it was, unless the file has other contents now.
    pub(super) fn widened(self, heights_m: [f64; 2], memory_mib: u64) -> Result<(Self, Batches), Failed> {
        let Self { session, path, unsaved, refused, .. } = self;
        let (disk, room) = (session.disk(), room_for(session.header(), heights_m));
        let header = match session.widen(room, memory_mib, &Silent) {
            Ok(header) => header,
            Err((Some(session), error)) => {
                let before = Self { unsaved, refused, ..Self::of(*session, &path) };
                return Err(Failed::Back(Box::new(before), error));
            }
            Err((None, error)) => return Err(gone(error, &unsaved)),
        };
        match EditSession::open_on(disk, &path) {
            Ok(session) if session.header().state() == header.state() => {
                Ok((Self { refused, ..Self::of(session, &path) }, unsaved))
            }
            Ok(_) => Err(gone(edited_by_another(&path), &unsaved)),
            Err(error) => Err(gone(error, &unsaved)),
        }
    }
}

/// Opens a session of the file that `terrain` shows in the state `seen`.
///
/// # Errors
/// As [`EditSession::open`]; [`LayoutError::Usage`] if the file is another by now.
pub(super) fn open_session(terrain: &Terrain, seen: FileState) -> Result<EditSession, LayoutError> {
    let session = match terrain.base_path() {
        Some(base) => EditSession::open_overlay(base, terrain.path())?,
        None => EditSession::open(terrain.path())?,
    };
    if session.header().state() == seen { Ok(session) } else { Err(edited_by_another(terrain.path())) }
}

fn edited_by_another(path: &Path) -> LayoutError {
    LayoutError::Usage(format!(
        "{}: the file was edited since it was opened here; open it again to edit it",
        path.display()
    ))
}

/// Edits in memory are gone with the hand.
fn gone(error: LayoutError, unsaved: &Batches) -> Failed {
    Failed::Gone(Gone { error, edits: edits_of(unsaved) })
}

fn edits_of(batches: &Batches) -> usize {
    batches.iter().map(Vec::len).sum()
}
