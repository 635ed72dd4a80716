//! The right to edit the terrain on show, taken at the first edit, and commits on a thread of their own, so that no frame waits for the disk.
//!
//! Edits are in memory at once; a stroke is committed when it ends. **What is told as saved is on the disk.** While a commit is under way edits go on, and are part of the next one. Whoever
//! closes the workshop waits for it.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, CommitJob, Edit, EditSession};
use terrasoar_layout::imagery::Paint;
use terrasoar_layout::terrain::Terrain;

/// A commit that has run, and how that went.
type Ran = (CommitJob, Result<(), LayoutError>);

/// Edits of the terrain on show.
#[derive(Debug)]
pub(crate) struct Workshop {
    session: EditSession,
    under_way: Option<Receiver<Ran>>,
    /// What is to be committed next, in words.
    label: Option<String>,
}

impl Workshop {
    /// Takes the right to edit `terrain`, an overlay of it if it has one.
    ///
    /// # Errors
    /// Another program writes to it, or has since it was opened; it cannot be written to.
    pub(crate) fn open(terrain: &Terrain) -> Result<Self, LayoutError> {
        let session = match terrain.base_path() {
            Some(base) => EditSession::open_overlay(base, terrain.path())?,
            None => EditSession::open(terrain.path())?,
        };
        if session.header().generation != terrain.header().generation {
            return Err(LayoutError::Usage(format!(
                "{}: another program has edited it since it was opened; open it again",
                terrain.path().display()
            )));
        }
        Ok(Self { session, under_way: None, label: None })
    }

    /// The edited ground.
    pub(crate) fn session(&self) -> &EditSession {
        &self.session
    }

    /// The session, for a scene to take over what became of the picture.
    pub(crate) fn session_mut(&mut self) -> &mut EditSession {
        &mut self.session
    }

    /// Applies edits, and paint on the picture, in memory.
    ///
    /// # Errors
    /// As [`EditSession::apply_and_paint`].
    pub(crate) fn apply(&mut self, edits: &[Edit], paints: &[Paint]) -> Result<Changes, LayoutError> {
        self.session.apply_and_paint(edits, paints).map(|(changes, _)| changes)
    }

    /// Has everything since the last time written to the disk, on a thread; `wake` is called when it is there.
    ///
    /// # Errors
    /// What was committed before could not be written, or the system gives no thread.
    pub(crate) fn commit(
        &mut self,
        label: &str,
        wake: impl Fn() + Send + 'static,
    ) -> Result<(), LayoutError> {
        self.label = Some(label.to_owned());
        self.look_after(wake).map(drop)
    }

    /// Takes notice of a commit that has ended, and begins the next. Whether one has ended well.
    ///
    /// # Errors
    /// The commit's; what it was to write is part of the next one.
    pub(crate) fn look_after(&mut self, wake: impl Fn() + Send + 'static) -> Result<bool, LayoutError> {
        let mut ended = false;
        if let Some(receiver) = &self.under_way {
            let Ok((job, outcome)) = receiver.try_recv() else { return Ok(false) };
            self.under_way = None;
            self.session.finish_commit(job, outcome)?;
            ended = true;
        }
        let Some(label) = self.label.take() else { return Ok(ended) };
        let Some(job) = self.session.prepare_commit(&label)? else { return Ok(ended) };
        let (sender, receiver) = channel();
        self.under_way = Some(receiver);
        let run = move || {
            let outcome = job.run();
            // A window that has gone has waited for it before.
            let _ = sender.send((job, outcome));
            wake();
        };
        std::thread::Builder::new().name("commit".into()).spawn(run).map_err(|e| {
            LayoutError::io(self.session.editor().terrain().path(), "cannot start a thread that writes", e)
        })?;
        Ok(ended)
    }

    /// Waits for what is under way and writes the rest.
    ///
    /// # Errors
    /// The commits'.
    pub(crate) fn settle(&mut self) -> Result<(), LayoutError> {
        if let Some(receiver) = self.under_way.take()
            && let Ok((job, outcome)) = receiver.recv()
        {
            self.session.finish_commit(job, outcome)?;
        }
        let label = self.label.take().unwrap_or_else(|| "edits".into());
        self.session.commit(&label).map(drop)
    }

    /// Takes back the last commit; nothing if there is none.
    ///
    /// # Errors
    /// As [`EditSession::undo`].
    pub(crate) fn undo(&mut self) -> Result<Option<Changes>, LayoutError> {
        self.settle()?;
        self.session.undo()
    }

    /// Brings back what was taken back last.
    ///
    /// # Errors
    /// As [`EditSession::redo`].
    pub(crate) fn redo(&mut self) -> Result<Option<Changes>, LayoutError> {
        self.settle()?;
        self.session.redo()
    }

    /// Whether something is not on the disk yet.
    pub(crate) fn is_unsaved(&self) -> bool {
        self.under_way.is_some() || self.label.is_some() || !self.session.is_committed()
    }

    /// Everything that differs from the file as it was opened, for a scene that is made anew.
    pub(crate) fn all_changes(&self) -> Changes {
        let pages = self.session.editor().edited_pages();
        Changes { pages, ..Changes::default() }
    }

    /// Gives the right back; the file to be rewritten.
    pub(crate) fn close(mut self) -> Result<PathBuf, LayoutError> {
        self.settle()?;
        Ok(self.session.editor().terrain().path().to_path_buf())
    }
}
