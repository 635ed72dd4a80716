//! Edits of ground that is flown over: in memory first, then on the disk in the background.
//!
//! One ground at a time may edit a file, over all programs. The first edit takes this right; it is kept until [`Ground::end_editing`] or until the ground is dropped. The next
//! update shows an edit. A commit is written by a thread of its own while flying and editing go on. **Nothing that was committed is lost unnoticed.** Dropping the
//! ground waits for the commit under way. A commit that failed is reported, and its edits are part of the next one.
//!
//! What was edited and never committed is lost when the ground is dropped.

use super::ticket::{CommitTicket, Writing};
use super::{Ground, Opened};
use crate::stream::GroundPatch;
use std::collections::BTreeSet;
use std::path::PathBuf;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, Edit, EditSession};
use terrasoar_layout::read::terrain::Terrain;

/// The right to edit, and what is on its way.
pub(super) struct Editing {
    session: EditSession,
    writing: Option<Writing>,
    path: PathBuf,
}

impl Ground<'_> {
    /// Applies edits, all of them or, on an error, none. The next update shows them; [`Ground::commit`] makes them last. The first call takes the right to edit, and reads the
    /// file's directory for that.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for mapped ground, while another program edits the file, if the file was edited since this ground was opened, and for edits out of
    /// bounds; [`LayoutError::OutOfRange`] for heights that the file cannot hold; I/O.
    pub fn edit(&mut self, edits: &[Edit]) -> Result<Changes, LayoutError> {
        let editing = self.editing()?;
        let changes = editing.session.apply(edits)?;
        let patch = GroundPatch::of(&changes, editing.session.editor());
        self.take_edits(patch)?;
        Ok(changes)
    }

    /// Begins to write all edits that are not on the disk, as one batch that `label` describes, and returns at once. Waits for the commit before it, if one is under way.
    ///
    /// # Errors
    /// As [`Ground::edit`]; [`LayoutError::Usage`] for a file that would become too long. Nothing is lost in memory then.
    pub fn commit(&mut self, label: &str) -> Result<CommitTicket, LayoutError> {
        self.wait_for_writing();
        let editing = self.editing()?;
        let Some(job) = editing.session.prepare_commit(label)? else { return Ok(CommitTicket::of_nothing()) };
        let writing = Writing::begin(job, editing.session.disk(), &editing.path)?;
        let ticket = writing.ticket();
        editing.writing = Some(writing);
        Ok(ticket)
    }

    /// Goes back to the state before the last commit, on the disk too, and waits for that. Whether there was one to go back to.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] while edits are not committed; damage and I/O of what the file holds of that state. All is as before then.
    pub fn undo(&mut self) -> Result<bool, LayoutError> {
        self.turn(EditSession::undo)
    }

    /// Goes forward again to the state after the commit that was undone last, as [`Ground::undo`] goes back.
    ///
    /// # Errors
    /// As [`Ground::undo`].
    pub fn redo(&mut self) -> Result<bool, LayoutError> {
        self.turn(EditSession::redo)
    }

    /// Whether all edits so far are on the disk.
    pub fn is_saved(&self) -> bool {
        self.editing.as_ref().is_none_or(|editing| editing.session.is_committed())
    }

    /// Gives the right to edit back, after the commit under way. Refused while edits are not on the disk.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if there are such edits: commit them first. The right is kept then.
    pub fn end_editing(&mut self) -> Result<(), LayoutError> {
        self.wait_for_writing();
        if !self.is_saved() {
            let path = self.terrain().path().display().to_string();
            return Err(LayoutError::Usage(format!(
                "{path}: some edits are not on the disk yet; commit them first"
            )));
        }
        if let Some(editing) = self.editing.take() {
            self.seen_generation = editing.session.header().generation;
        }
        Ok(())
    }

    /// Takes notice of a commit that is over; does not wait.
    pub(super) fn settle(&mut self) {
        if self.editing.as_ref().is_some_and(|editing| editing.writing.as_ref().is_some_and(Writing::is_over))
        {
            self.wait_for_writing();
        }
    }

    /// Waits for the commit under way, and takes notice of what became of it.
    fn wait_for_writing(&mut self) {
        let Some(editing) = &mut self.editing else { return };
        let Some(writing) = editing.writing.take() else { return };
        match writing.end() {
            Ok(job) => match editing.session.finish_commit(job, Ok(())) {
                Ok(committed) => {
                    // What was edited meanwhile is not what the file has.
                    let edited: BTreeSet<u64> = editing.session.editor().uncommitted().into_iter().collect();
                    let mut places = committed.places;
                    places.retain(|(page, _)| !edited.contains(page));
                    self.engine.relocate(&places);
                }
                Err(error) => self.errors.push_back(error),
            },
            // The job is gone, by which the session knows that it is to write all that again.
            Err(failed) => {
                let words = format!("{failed}; the edits are in memory, and part of the next commit");
                self.errors.push_back(LayoutError::Usage(words));
            }
        }
    }

    fn turn(
        &mut self,
        turn: fn(&mut EditSession) -> Result<Option<Changes>, LayoutError>,
    ) -> Result<bool, LayoutError> {
        self.wait_for_writing();
        let editing = self.editing()?;
        let Some(changes) = turn(&mut editing.session)? else { return Ok(false) };
        let session = &editing.session;
        let terrain = session.editor().terrain();
        let mut pages = Vec::with_capacity(changes.pages.len());
        for page in &changes.pages {
            // One that is in the file need not be in memory.
            let bytes = match session.editor().edited_page(*page) {
                Some(bytes) => Box::new(*bytes),
                None => terrain.checked_page_at(*page, session.place_of(*page))?,
            };
            pages.push((*page, bytes));
        }
        let patch = GroundPatch {
            samples: changes.samples,
            pages,
            height_range_m: session.editor().header().height_range_m,
            places: changes.pages.iter().map(|page| (*page, session.place_of(*page))).collect(),
        };
        self.take_edits(patch)?;
        Ok(true)
    }

    /// The right to edit, taken if need be.
    fn editing(&mut self) -> Result<&mut Editing, LayoutError> {
        if self.editing.is_none() {
            self.editing = Some(Box::new(Editing::begin(&self.terrain, self.seen_generation)?));
        }
        self.editing.as_deref_mut().ok_or_else(|| LayoutError::Usage("there is nobody to edit".into()))
    }
}

impl Editing {
    fn begin(terrain: &Opened<'_>, generation: u32) -> Result<Self, LayoutError> {
        let terrain: &Terrain = match terrain {
            Opened::Streamed(terrain) => terrain,
            Opened::Mapped(terrain) => {
                return Err(LayoutError::Usage(format!(
                    "{}: mapped ground cannot be edited; stream it instead",
                    terrain.path().display()
                )));
            }
        };
        let session = match terrain.base_path() {
            Some(base) => EditSession::open_overlay(base, terrain.path())?,
            None => EditSession::open(terrain.path())?,
        };
        if session.header().generation != generation {
            return Err(LayoutError::Usage(format!(
                "{}: the file was edited since it was opened here; open it again to edit it",
                terrain.path().display()
            )));
        }
        Ok(Self { session, writing: None, path: terrain.path().to_owned() })
    }
}

impl Drop for Editing {
    /// The commit under way is brought to the disk while the right to edit is still held.
    fn drop(&mut self) {
        if let Some(writing) = self.writing.take() {
            // What became of it the ticket tells.
            let _ = writing.end();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::StreamOptions;
    use crate::view::View;
    use std::path::Path;
    use std::sync::Arc;
    use terrasoar_layout::build::{BuildOptions, build};
    use terrasoar_layout::dem::{MemoryDem, SampleType};
    use terrasoar_layout::edit::Crater;
    use terrasoar_layout::file::disk::{FailingDisk, Failure};
    use terrasoar_layout::progress::Silent;

    fn ground_on(path: &Path, disk: FailingDisk) -> Ground<'static> {
        let terrain = Arc::new(Terrain::open_unmapped(path).unwrap());
        let mut ground = Ground::streamed(terrain, &StreamOptions::default()).unwrap();
        let session = EditSession::open_on(Arc::new(disk), path).unwrap();
        ground.editing = Some(Box::new(Editing { session, writing: None, path: path.to_owned() }));
        ground
    }

    /// Whatever call fails: the ticket says so, the ground says so once, nothing is lost in memory, and the next commit has it all.
    #[test]
    fn a_commit_that_fails_is_told_and_part_of_the_next() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("land.iqt");
        let dem = MemoryDem::from_fn([129; 2], SampleType::I16, |x, y| match (x, y) {
            // Room for craters: records hold heights of the data's range.
            (0, 0) => 300.0,
            (128, 128) => 900.0,
            _ => f64::from(500 + (x * 7 + y * 3) % 90),
        });
        build(&dem, &path, &BuildOptions::default().spacing_m([10.0; 2]), &Silent).unwrap();
        let crater = |x: f64| {
            Edit::Crater(Crater { centre_m: [x, 640.0], direction_deg: 0.0, radius_m: 50.0, depth_m: 15.0 })
        };
        let whole = std::fs::read(&path).unwrap();
        let view = View::new([600.0, 100.0, 1500.0], 0.0, -40.0);
        let mut failed = 0;
        for call in 0..40 {
            std::fs::write(&path, &whole).unwrap();
            let mut ground = ground_on(&path, FailingDisk::new(call, Failure::Once));
            ground.update(&view);
            ground.edit(&[crater(400.0)]).unwrap();
            let ticket = ground.commit("one").unwrap();
            let outcome = ticket.wait();
            ground.edit(&[crater(800.0)]).unwrap();
            let again = ground.commit("two").unwrap();
            let told = ground.take_error();
            if let Err(error) = outcome {
                failed += 1;
                assert!(error.to_string().contains("land.iqt"), "{error}");
                let told = told.unwrap().to_string();
                assert!(told.contains("land.iqt") && told.contains("in memory"), "{told}");
            } else {
                assert!(told.is_none());
            }
            let is_saved = again.wait().is_ok();
            ground.update(&view);
            if !is_saved {
                ground.commit("three").unwrap().wait().unwrap();
            }
            drop(ground);
            let height_m =
                |x: f64| Terrain::open_unmapped(&path).unwrap().height_m(x, 640.0).unwrap().unwrap();
            let before = Terrain::open_original(&path).unwrap();
            for x in [400.0, 800.0] {
                assert!(height_m(x) < before.height_m(x, 640.0).unwrap().unwrap() - 10.0, "call {call}: {x}");
            }
        }
        assert!(failed > 3, "{failed} commits failed");
    }
}
