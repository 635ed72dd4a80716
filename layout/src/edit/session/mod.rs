//! Edits of a file, in memory first and on the disk batch by batch, with undo and redo.
//!
//! [`EditSession::apply`] changes the ground at once, in memory. [`EditSession::commit`] makes everything since the last commit durable, as one batch. Undo and redo are commits of
//! their own: a header that leads to a state that is in the file already. One session at a time may have a file; readers need not stop.

mod bases;
pub(crate) mod beside;
mod checked_state;
pub(crate) mod commit;
pub(crate) mod compact;
mod past;
pub(super) mod picture;
pub(crate) mod widen;

pub use past::{HistoryEntry, history};

use super::{Changes, Edit, Editor, HeightWindow};
use crate::error::LayoutError;
use crate::file::bytes::PAGE_BYTES;
use crate::file::disk::{Disk, SystemDisk};
use crate::file::entries::Entry;
use crate::file::header::{Header, ImageryPlace};
use crate::file::journal::{Lineage, State};
use crate::file::lock::WriteLock;
use crate::file::overlay::{Overlaid, create_overlay};
use crate::file::page_table::PageTable;
use crate::file::slots::Slots;
use crate::file::source::{PreadSource, Source};
use crate::file::structure::{read_growing, read_structure};
use crate::file::tail::{Attempt, Attempted, Tail};
use crate::read::opened::Opened;
use crate::read::terrain::Terrain;
use crate::remedy::Remedy;
use bases::Bases;
use commit::{CommitJob, Content};
use picture::Picture;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What became of a commit.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Committed {
    /// Record pages written.
    pub pages: u64,
    /// Bytes by which the file grew.
    pub bytes: u64,
    /// Each logical page that was written, and its entry in the directory now, ascending: where readers of the file find it.
    pub places: Vec<(u64, Entry)>,
}

/// What a session is at.
#[derive(Debug)]
enum Phase {
    /// Nothing is under way. What was applied since the last commit, this many edits, is in memory alone.
    Idle {
        /// Edits that the next commit will count.
        edits: u64,
    },
    /// A commit was handed out to be written.
    Committing {
        /// Edits in it.
        taken: u64,
        /// Edits since.
        edits: u64,
        /// How far its header came. The job has the other clone: if that is gone without a word, the commit has failed.
        attempt: Arc<Attempt>,
    },
}

impl Phase {
    fn edits_mut(&mut self) -> &mut u64 {
        match self {
            Self::Idle { edits } | Self::Committing { edits, .. } => edits,
        }
    }
}

/// The right to edit a terrain file, or an overlay of one, and its edits so far.
#[derive(Debug)]
pub struct EditSession {
    editor: Editor,
    picture: Picture,
    path: PathBuf,
    /// The right to write, and the file.
    lock: WriteLock,
    /// Offset of the file's first byte.
    start: u64,
    slots: Slots,
    directory: PageTable,
    original: State,
    attempted: Attempted,
    phase: Phase,
    disk: Arc<dyn Disk + Send>,
}

impl EditSession {
    /// Opens the terrain file at `path` for editing, and checks its whole directory: nothing is edited that could not be committed.
    ///
    /// # Errors
    /// As [`Terrain::open`]; [`LayoutError::Usage`] while another program writes to it; [`LayoutError::Io`] if it cannot be written to.
    pub fn open(path: &Path) -> Result<Self, LayoutError> {
        Self::open_on(Arc::new(SystemDisk), path)
    }

    /// As [`EditSession::open`], with all writing done by `disk`.
    ///
    /// # Errors
    /// As [`EditSession::open`].
    pub fn open_on(disk: Arc<dyn Disk + Send>, path: &Path) -> Result<Self, LayoutError> {
        let lock = take_lock(path)?;
        let source = Opened::of(over(path, &lock)?)?.into_source();
        let (header, table) = read_structure(&*source)?;
        let slots = Slots::read(&*source, 0)?;
        let terrain = Terrain::of(source, header, table);
        Self::new(disk, terrain, path, 0, slots, lock)
    }

    /// Opens the terrain file `base`, which is not written to, with edits in the file `overlay`, which is made if it does not exist.
    ///
    /// # Errors
    /// As [`EditSession::open`]; [`LayoutError::Usage`] if the overlay was made over another terrain, or if the base was written anew since. Over a base that was edited or draped since,
    /// the edits go on from the ground as it was.
    pub fn open_overlay(base: &Path, overlay: &Path) -> Result<Self, LayoutError> {
        Self::open_overlay_on(Arc::new(SystemDisk), base, overlay)
    }

    /// As [`EditSession::open_overlay`], with all writing done by `disk`.
    ///
    /// # Errors
    /// As [`EditSession::open_overlay`].
    pub fn open_overlay_on(
        disk: Arc<dyn Disk + Send>,
        base: &Path,
        overlay: &Path,
    ) -> Result<Self, LayoutError> {
        let mut base_file = Opened::of(PreadSource::open(base)?)?;
        let look = base_file.source_mut();
        read_growing(look)?;
        create_overlay(&*disk, look, &Slots::read(look, 0)?, overlay)?;
        let lock = take_lock(overlay)?;
        let mut overlay_file = over(overlay, &lock)?;
        let overlaid = Overlaid::read(base_file.source_mut(), &mut overlay_file)?;
        let source = overlaid.source(base_file.into_source(), Box::new(overlay_file))?;
        let Overlaid { slots, split: start, .. } = overlaid;
        let table = PageTable::open(&*source, &slots.header)?;
        let terrain = Terrain::of(source, slots.header.clone(), table);
        Self::new(disk, terrain, overlay, start, slots, lock)
    }

    fn new(
        disk: Arc<dyn Disk + Send>,
        terrain: Terrain,
        path: &Path,
        start: u64,
        slots: Slots,
        lock: WriteLock,
    ) -> Result<Self, LayoutError> {
        let header = terrain.header().clone();
        // Before anything is edited that could not be committed.
        terrain.check_directory()?;
        let directory = terrain.table().clone();
        let original = Lineage::read(terrain.source(), &header)?.original;
        Ok(Self {
            editor: Editor::new(Arc::new(terrain)),
            picture: Picture::default(),
            path: path.to_owned(),
            lock,
            start,
            slots,
            directory,
            original,
            attempted: Attempted::default(),
            phase: Phase::Idle { edits: 0 },
            disk,
        })
    }

    /// The ground with its edits.
    pub fn editor(&self) -> &Editor {
        &self.editor
    }

    /// The ground with its edits, for looking at heights. Edits made here instead of by [`EditSession::apply`] are committed as well.
    pub fn editor_mut(&mut self) -> &mut Editor {
        &mut self.editor
    }

    /// The header as the file has it.
    pub fn header(&self) -> &Header {
        &self.slots.header
    }

    /// Where a logical page lies in the file as it is now, edits that are not committed apart; absent for pages that the terrain has not.
    pub fn place_of(&self, logical_page: u64) -> Entry {
        // The whole directory was read when the session began.
        self.directory.known(logical_page).unwrap_or_default()
    }

    /// What does the session's writing, for jobs of [`EditSession::prepare_commit`] that run elsewhere.
    pub fn disk(&self) -> Arc<dyn Disk + Send> {
        Arc::clone(&self.disk)
    }

    pub(super) fn picture(&self) -> &Picture {
        &self.picture
    }

    pub(super) fn picture_mut(&mut self) -> &mut Picture {
        &mut self.picture
    }

    /// Where the imagery before all commits lies.
    pub(super) fn original_imagery(&self) -> Option<ImageryPlace> {
        self.original.imagery
    }

    pub(super) fn count_edits(&mut self, edits: usize) {
        *self.phase.edits_mut() += edits as u64;
    }

    fn source(&self) -> &dyn Source {
        self.editor.terrain().source()
    }

    /// Applies edits in memory, all of them or, on an error, none.
    ///
    /// # Errors
    /// As [`Editor::apply`]; a damaged journal, if an edit restores what was there before.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Changes, LayoutError> {
        let needs_original = !self.editor.has_original() && edits.iter().any(Edit::needs_original);
        if needs_original && self.slots.header.history.is_some() {
            let header = Header { history: None, ..self.original.put_into(&self.slots.header) };
            let table = PageTable::open_beside(self.source(), &header, &self.directory)?;
            let original = Terrain::of(Box::new(Borrowed(Arc::clone(self.editor.terrain()))), header, table);
            self.editor.set_original(Arc::new(original));
        }
        let changes = self.editor.apply(edits)?;
        self.count_edits(edits.len());
        Ok(changes)
    }

    /// Sets heights in memory, as [`Editor::set_heights`] does.
    ///
    /// # Errors
    /// As [`Editor::set_heights`].
    pub fn set_heights(&mut self, window: &HeightWindow) -> Result<Changes, LayoutError> {
        let changes = self.editor.set_heights(window)?;
        self.count_edits(1);
        Ok(changes)
    }

    /// Takes back what was applied and painted since the last commit: the last one that succeeded, or the one that is under way.
    pub fn discard(&mut self) -> Changes {
        self.notice_lost_job();
        *self.phase.edits_mut() = 0;
        self.picture.roll_back();
        self.editor.roll_back()
    }

    /// Whether everything applied so far is in the file.
    pub fn is_committed(&self) -> bool {
        matches!(self.phase, Phase::Idle { .. })
            && self.editor.uncommitted().is_empty()
            && self.picture.is_committed()
    }

    /// Makes everything since the last commit durable, as one batch that `label` describes. Nothing is written if nothing changed.
    ///
    /// # Errors
    /// As [`CommitJob::run`]; nothing is lost in memory, and the commit may be tried again.
    pub fn commit(&mut self, label: &str) -> Result<Committed, LayoutError> {
        let Some(job) = self.prepare_commit(label)? else { return Ok(Committed::default()) };
        let done = job.run_on(&*self.disk);
        self.finish_commit(job, done)
    }

    /// What [`EditSession::commit`] would write, to be written on another thread; `None` if there is nothing. Edits go on meanwhile;
    /// [`EditSession::finish_commit`] is to be called with the outcome before the next commit. A job that is dropped instead, by a thread that panicked for example, counts as
    /// one that failed: what it was to write is part of the next commit.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] while another commit is under way, and for a file that would become too long.
    pub fn prepare_commit(&mut self, label: &str) -> Result<Option<CommitJob>, LayoutError> {
        let edits = self.check_idle()?;
        let tail = self.tail()?;
        let section = self.picture.section(tail.begin() / PAGE_BYTES as u64)?;
        let job = match self.job(tail, section, edits, label) {
            Ok(Some(job)) => job,
            other => {
                self.picture.failed();
                return other;
            }
        };
        self.editor.begin_commit();
        self.phase = Phase::Committing { taken: edits, edits: 0, attempt: job.attempt() };
        Ok(Some(job))
    }

    fn job(
        &self,
        tail: Tail,
        section: Option<crate::imagery::PaintedSection>,
        edits: u64,
        label: &str,
    ) -> Result<Option<CommitJob>, LayoutError> {
        let (old, pages) = (&self.slots.header, self.editor.uncommitted());
        if pages.is_empty() && section.is_none() {
            // What failed may be in force on the disk all the same; a header then says again where we are.
            if !self.attempted.is_after(old) {
                return Ok(None);
            }
            return CommitJob::turn(tail, old.clone()).map(Some);
        }
        let content = Content {
            pages: pages.iter().filter_map(|page| Some((*page, self.editor.edited_page(*page)?))).collect(),
            header: self.editor.header(),
            section,
            edits,
            label,
        };
        let lineage = Lineage::read(self.source(), old)?;
        let bases = Bases::new(&tail, Arc::clone(self.editor.terrain()), old, &lineage.original)?;
        CommitJob::new(tail, old, &self.directory, &lineage, bases, content).map(Some)
    }

    /// Takes notice of what became of a commit.
    ///
    /// # Errors
    /// That of the commit; what it was to write is part of the next one. [`LayoutError::Usage`] for a job that is not the one under way.
    pub fn finish_commit(
        &mut self,
        job: CommitJob,
        outcome: Result<(), LayoutError>,
    ) -> Result<Committed, LayoutError> {
        let edits = match &self.phase {
            Phase::Committing { edits, attempt, .. } if Arc::ptr_eq(attempt, &job.next.attempt) => *edits,
            _ => {
                return Err(LayoutError::Usage(format!(
                    "{}: this commit is not the one that is under way",
                    self.path.display()
                )));
            }
        };
        if let Err(error) = outcome {
            drop(job);
            self.notice_lost_job();
            return Err(error);
        }
        let places: Vec<(u64, Entry)> =
            job.entries.iter().map(|(logical, entry)| (*logical as u64, *entry)).collect();
        let committed = Committed { pages: job.pages(), bytes: job.bytes(), places };
        self.directory.update(&job.next.header, &job.entries, &job.leaves, &job.nodes);
        self.slots.flip(job.next.page, job.next.header, job.tail.packed_end().cloned());
        if let Some(section) = job.section {
            self.picture.committed(section);
        }
        self.editor.end_commit(&committed.places);
        self.phase = Phase::Idle { edits };
        Ok(committed)
    }

    /// If the thread that was to write the commit under way is gone, the commit has failed: all that it took must be committed again.
    fn notice_lost_job(&mut self) {
        let Phase::Committing { taken, edits, attempt } = &self.phase else { return };
        if Arc::strong_count(attempt) > 1 {
            return;
        }
        self.attempted.note(attempt);
        self.phase = Phase::Idle { edits: taken + edits };
        self.picture.failed();
        self.editor.fail_commit();
    }

    /// Edits that are to be committed, if no commit is under way.
    fn check_idle(&mut self) -> Result<u64, LayoutError> {
        self.notice_lost_job();
        match self.phase {
            Phase::Idle { edits } => Ok(edits),
            Phase::Committing { .. } => Err(LayoutError::Usage(format!(
                "{}: a commit is under way; wait for it",
                self.path.display()
            ))),
        }
    }

    fn tail(&self) -> Result<Tail, LayoutError> {
        Tail::of(&self.path, &self.lock, self.start, &self.slots, self.attempted)
    }
}

/// The right to edit a file.
fn take_lock(path: &Path) -> Result<WriteLock, LayoutError> {
    WriteLock::take(path).map_err(|error| match error {
        LayoutError::Io { path, source, .. } if source.kind() != std::io::ErrorKind::NotFound => {
            LayoutError::io(
                &path,
                "cannot open the file for writing; edits can be kept apart from it in an overlay",
                source,
            )
            .mended_by(Remedy::Overlay)
        }
        other => other,
    })
}

/// Reads of the very file that is written to.
fn over(path: &Path, lock: &WriteLock) -> Result<PreadSource, LayoutError> {
    let file = lock
        .file()
        .try_clone()
        .map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
    PreadSource::over(path, file)
}

/// The source of another terrain.
struct Borrowed(Arc<Terrain>);

impl Source for Borrowed {
    fn path(&self) -> &Path {
        self.0.path()
    }

    fn byte_count(&self) -> u64 {
        self.0.source().byte_count()
    }

    fn base_has_grown(&self) -> bool {
        self.0.base_has_grown()
    }

    fn own_start(&self) -> u64 {
        self.0.source().own_start()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.0.source().read_at(offset, buffer)
    }
}
