//! Edits of a file, in memory first and on the disk batch by batch, with undo and redo.
//!
//! [`EditSession::apply`] changes the ground at once, in memory; [`EditSession::commit`] makes all since the last one durable, as one batch. Undoing and redoing are commits of
//! their own: a header that leads to a state that is in the file already. One session at a time has a file; readers need not stop.

mod checked_state;
mod past;

pub use past::{HistoryEntry, history};

use super::commit::{Attempted, CommitJob, Content, Directory, Place};
use super::overlay::{empty_overlay, overlay_slots};
use super::picture::Picture;
use super::{Changes, Edit, Editor, HeightWindow};
use crate::bytes::PAGE_BYTES;
use crate::directory::copy_of;
use crate::disk::{Disk, SystemDisk};
use crate::error::LayoutError;
use crate::header::{Header, History, ImageryPlace};
use crate::journal::{Commit, State};
use crate::lock::WriteLock;
use crate::opening::{read_directory, read_root, read_structure};
use crate::slots::Slots;
use crate::source::{LayeredSource, PreadSource, Source};
use crate::terrain::Terrain;
use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What became of a commit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Committed {
    /// Record pages written.
    pub pages: u64,
    /// Bytes by which the file grew.
    pub bytes: u64,
}

/// The right to edit a terrain file, or an overlay of one, and its edits so far.
#[derive(Debug)]
pub struct EditSession {
    editor: Editor,
    picture: Picture,
    path: PathBuf,
    file: File,
    /// Offset of the file's first byte.
    start: u64,
    slots: Slots,
    directory: Directory,
    original: State,
    /// Pages whose edits a commit took that has not succeeded.
    unwritten: BTreeSet<u64>,
    attempted: Attempted,
    edits: u64,
    has_original: bool,
    is_committing: bool,
    disk: Arc<dyn Disk + Send>,
    _lock: WriteLock,
}

impl EditSession {
    /// Opens the terrain file at `path` for editing.
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
        let lock = WriteLock::take(path)?;
        let file = open_for_writing(path)?;
        let source = Box::new(over(path, &file)?);
        let (header, entries) = read_structure(&*source)?;
        let slots = Slots::read(&*source, 0)?;
        let terrain = Terrain::of(source, header, entries);
        Self::new(disk, terrain, path, file, 0, slots, lock)
    }

    /// Opens the terrain file `base`, which is not written to, with edits in the file `overlay`, which is made if it does not exist.
    ///
    /// # Errors
    /// As [`EditSession::open`]; [`LayoutError::Usage`] if the overlay belongs to another terrain, or to another state of this one.
    pub fn open_overlay(base: &Path, overlay: &Path) -> Result<Self, LayoutError> {
        Self::open_overlay_on(Arc::new(SystemDisk), base, overlay)
    }

    /// As [`EditSession::open_overlay`], with all writing but the overlay's beginning done by `disk`.
    ///
    /// # Errors
    /// As [`EditSession::open_overlay`].
    pub fn open_overlay_on(
        disk: Arc<dyn Disk + Send>,
        base: &Path,
        overlay: &Path,
    ) -> Result<Self, LayoutError> {
        let lock = WriteLock::take(overlay)?;
        let base_file = PreadSource::open(base)?;
        let (base_header, _) = read_structure(&base_file)?;
        if !overlay.exists() {
            let name = base.file_name().unwrap_or_default().to_string_lossy();
            let new = crate::atomic_file::AtomicFile::create(overlay)?;
            let bytes = empty_overlay(&Slots::read(&base_file, 0)?, &name);
            SystemDisk
                .write_at(new.file(), &bytes, 0)
                .map_err(|e| LayoutError::io(overlay, "cannot write the overlay", e))?;
            new.publish()?;
        }
        let file = open_for_writing(overlay)?;
        let (slots, start) = overlay_slots(&base_file, &over(overlay, &file)?)?;
        let source = Box::new(LayeredSource::new(
            Box::new(base_file),
            base_header.file_bytes,
            Box::new(over(overlay, &file)?),
        ));
        let entries = read_directory(&*source, &slots.header)?;
        let terrain = Terrain::of(source, slots.header.clone(), entries);
        Self::new(disk, terrain, overlay, file, start, slots, lock)
    }

    fn new(
        disk: Arc<dyn Disk + Send>,
        terrain: Terrain,
        path: &Path,
        file: File,
        start: u64,
        slots: Slots,
        lock: WriteLock,
    ) -> Result<Self, LayoutError> {
        let header = terrain.header().clone();
        let directory =
            Directory { entries: copy_of(terrain.entries()), root: read_root(terrain.source(), &header)? };
        let original = match header.history {
            Some(history) => Commit::read(terrain.source(), &header, history.tip_page)?.original,
            None => State::of(&header),
        };
        Ok(Self {
            editor: Editor::new(Arc::new(terrain)),
            picture: Picture::default(),
            path: path.to_owned(),
            file,
            start,
            slots,
            directory,
            original,
            unwritten: BTreeSet::new(),
            attempted: Attempted::default(),
            edits: 0,
            has_original: false,
            is_committing: false,
            disk,
            _lock: lock,
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
        self.edits += edits as u64;
    }

    fn source(&self) -> &dyn Source {
        self.editor.terrain().source()
    }

    /// Applies edits in memory, all of them or, on an error, none.
    ///
    /// # Errors
    /// As [`Editor::apply`]; a damaged journal, if an edit restores what was there before.
    pub fn apply(&mut self, edits: &[Edit]) -> Result<Changes, LayoutError> {
        if !self.has_original && self.slots.header.history.is_some() && edits.iter().any(Edit::needs_original)
        {
            let header = Header { history: None, ..self.original.put_into(&self.slots.header) };
            let entries = read_directory(self.source(), &header)?;
            let original =
                Terrain::of(Box::new(Borrowed(Arc::clone(self.editor.terrain()))), header, entries);
            self.editor.set_original(Arc::new(original));
            self.has_original = true;
        }
        let changes = self.editor.apply(edits)?;
        self.edits += edits.len() as u64;
        Ok(changes)
    }

    /// Sets heights in memory, as [`Editor::set_heights`] does.
    ///
    /// # Errors
    /// As [`Editor::set_heights`].
    pub fn set_heights(&mut self, window: &HeightWindow) -> Result<Changes, LayoutError> {
        let changes = self.editor.set_heights(window)?;
        self.edits += 1;
        Ok(changes)
    }

    /// Takes back what was applied and painted since the last commit.
    pub fn discard(&mut self) -> Changes {
        self.edits = 0;
        self.picture.roll_back();
        self.editor.roll_back()
    }

    /// Whether everything applied so far is in the file.
    pub fn is_committed(&self) -> bool {
        self.unwritten.is_empty() && self.editor.uncommitted().is_empty() && self.picture.is_committed()
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
    /// [`EditSession::finish_commit`] is to be called with the outcome before the next commit.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] while another commit is under way, and for a file that would become too long.
    pub fn prepare_commit(&mut self, label: &str) -> Result<Option<CommitJob>, LayoutError> {
        self.check_idle()?;
        let mut pages = self.unwritten.clone();
        pages.extend(self.editor.uncommitted());
        let place = self.place()?;
        let section = self.picture.section(place.end(&self.slots.header) / PAGE_BYTES as u64)?;
        if pages.is_empty() && section.is_none() {
            // What failed may be in force on the disk all the same; a header then says again where we are.
            let old = &self.slots.header;
            if !self.attempted.is_after(old) {
                return Ok(None);
            }
            let header = Header { generation: place.next_generation(old)?, ..old.clone() };
            self.is_committing = true;
            return Ok(Some(CommitJob::turn(place, &self.slots, header)));
        }
        let sequence = match self.slots.header.history {
            Some(History { commit_page, .. }) if commit_page > 0 => {
                Commit::read(self.source(), &self.slots.header, commit_page)?.sequence.saturating_add(1)
            }
            _ => 1,
        };
        let content = Content {
            pages: pages.iter().filter_map(|page| Some((*page, self.editor.edited_page(*page)?))).collect(),
            header: self.editor.header(),
            section,
            edits: self.edits,
            label,
        };
        let job = CommitJob::new(place, &self.slots, &self.directory, self.original, sequence, content)?;
        self.editor.mark_committed();
        self.unwritten = pages;
        self.is_committing = true;
        Ok(Some(job))
    }

    /// Takes notice of what became of a commit.
    ///
    /// # Errors
    /// That of the commit; what it was to write is part of the next one.
    pub fn finish_commit(
        &mut self,
        job: CommitJob,
        outcome: Result<(), LayoutError>,
    ) -> Result<Committed, LayoutError> {
        self.is_committing = false;
        self.attempted.note(&job);
        outcome?;
        let committed = Committed { pages: job.pages(), bytes: job.bytes() };
        job.entries.iter().for_each(|(logical, entry)| self.directory.entries[*logical] = *entry);
        job.leaves.iter().for_each(|(leaf, entry)| self.directory.root[*leaf] = *entry);
        self.slots.flip(job.header_page, job.header);
        if let Some(section) = job.section {
            self.picture.committed(section);
        }
        self.unwritten.clear();
        self.edits = 0;
        Ok(committed)
    }

    fn check_idle(&self) -> Result<(), LayoutError> {
        if self.is_committing {
            return Err(LayoutError::Usage(format!(
                "{}: a commit is under way; wait for it",
                self.path.display()
            )));
        }
        Ok(())
    }

    fn place(&self) -> Result<Place, LayoutError> {
        let file = self
            .file
            .try_clone()
            .map_err(|e| LayoutError::io(&self.path, "cannot open the file a second time", e))?;
        Ok(Place { path: self.path.clone(), file, start: self.start, attempted: self.attempted })
    }
}

fn open_for_writing(path: &Path) -> Result<File, LayoutError> {
    File::options().read(true).write(true).open(path).map_err(|e| {
        LayoutError::io(path, "cannot open the file for writing; --overlay keeps edits apart from it", e)
    })
}

/// Reads of the very file that is written to.
fn over(path: &Path, file: &File) -> Result<PreadSource, LayoutError> {
    let file =
        file.try_clone().map_err(|e| LayoutError::io(path, "cannot open the file a second time", e))?;
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

    fn own_start(&self) -> u64 {
        self.0.source().own_start()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> Result<(), LayoutError> {
        self.0.source().read_at(offset, buffer)
    }
}
