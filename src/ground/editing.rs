//! Edits of ground that is flown over: in memory first, then on the disk in the background.
//!
//! One ground at a time may edit a file, over all programs. The first edit takes this right; it is kept until [`Ground::end_editing`] or until the ground is dropped. The next
//! update shows an edit. A commit is written by a thread of its own while flying and editing go on. **Nothing that was committed is lost unnoticed.** Dropping the
//! ground waits for the commit under way. A commit that failed is reported, and its edits are part of the next one.
//!
//! An edit that the file's records cannot hold makes the ground rewrite the file in the background; it and all that is given meanwhile follow in their order.
//!
//! What was edited and never committed is lost when the ground is dropped.

use super::hand::{Hand, open_session};
use super::room::{Made, Order, Plan, Room, Step, check_rewritable};
use super::ticket::CommitTicket;
use super::{Ground, MeshStep, Opened};
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, Edit, EditSession};
use terrasoar_layout::read::terrain::Terrain;

/// What becomes of edits that were given.
#[derive(Debug, Clone, PartialEq)]
pub enum Edited {
    /// They are made; the next update shows them.
    Now(Changes),
    /// They follow, in the order in which they were given. The file's records have no room for one of them, or for one before them, and the file is being rewritten.
    Later,
}

/// Who has the right to edit.
pub(super) enum Editing {
    /// The ground itself.
    Here(Box<Hand>),
    /// The thread that rewrites the file.
    Away(Room),
    /// Nobody any more: what is on show is not what is in the file. The text says why.
    Lost(String),
}

impl Ground<'_> {
    /// Applies edits, all of them or, on an error, none. The next update shows them; [`Ground::commit`] makes them last. The first call takes the right to edit, and reads the
    /// file's directory for that.
    ///
    /// Where the file's records cannot hold the heights, the file is rewritten in the background ([`StreamOptions::room_mib`](super::StreamOptions::room_mib)), the edits follow, and so do all that are given
    /// meanwhile ([`Edited::Later`]). Flying goes on; the update that shows them begins its mesh anew. An edit that cannot be made even then is told by [`Ground::take_error`] and by the ticket of the next commit. What was committed
    /// before can no longer be undone then.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for mapped ground, while another program edits the file, if the file was edited since this ground was opened, and for edits out of
    /// bounds; [`LayoutError::OutOfRange`] for heights that the file cannot hold and is not rewritten for: in an overlay, with overlays beside it, or where the options say so; I/O.
    pub fn edit(&mut self, edits: &[Edit]) -> Result<Edited, LayoutError> {
        let room_mib = self.options.room_mib;
        loop {
            let grid = *self.terrain().grid();
            match self.editing()? {
                Editing::Away(room) => {
                    edits.iter().try_for_each(|edit| edit.check(&grid))?;
                    if room.give(Order::Edit(edits.to_vec())).is_ok() {
                        return Ok(Edited::Later);
                    }
                    self.end_room(true);
                }
                Editing::Here(hand) => match hand.apply(edits) {
                    Ok((changes, patch)) => {
                        self.take_edits(patch)?;
                        return Ok(Edited::Now(changes));
                    }
                    Err(LayoutError::OutOfRange { heights_m, problem, .. }) if room_mib > 0 => {
                        check_rewritable(hand.session.editor().terrain(), heights_m, &problem)?;
                        self.make_room(edits.to_vec(), heights_m)?;
                        return Ok(Edited::Later);
                    }
                    Err(error) => return Err(error),
                },
                Editing::Lost(_) => return Err(nobody()),
            }
        }
    }

    /// Begins to write all edits that are not on the disk, as one batch that `label` describes, and returns at once. Waits for the commit before it, if one is under way.
    ///
    /// # Errors
    /// As [`Ground::edit`]; [`LayoutError::Usage`] for a file that would become too long. Nothing is lost in memory then.
    pub fn commit(&mut self, label: &str) -> Result<CommitTicket, LayoutError> {
        loop {
            self.wait_for_writing();
            match self.editing()? {
                Editing::Away(room) => {
                    let (ticket, promise) = CommitTicket::promised(room.path());
                    if room.give(Order::Commit(label.to_owned(), promise)).is_ok() {
                        return Ok(ticket);
                    }
                    self.end_room(true);
                }
                Editing::Here(hand) => return hand.begin_commit(label),
                Editing::Lost(_) => return Err(nobody()),
            }
        }
    }

    /// Goes back to the state before the last commit, on the disk too, and waits for that, and for a file that is being rewritten. Whether there was one to go back to.
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
        match &self.editing {
            None => true,
            Some(Editing::Here(hand)) => hand.session.is_committed(),
            Some(Editing::Away(room)) => room.is_saved(),
            Some(Editing::Lost(_)) => false,
        }
    }

    /// Whether the file is being rewritten with room for an edit, so that edits are made later.
    pub fn is_making_room(&self) -> bool {
        matches!(self.editing, Some(Editing::Away(_)))
    }

    /// Waits until all edits that were given are made or refused: while the file is rewritten, as long as that takes; otherwise not at all.
    pub fn finish_edits(&mut self) {
        self.end_room(true);
    }

    /// Gives the right to edit back, after the commit under way. Refused while edits are not on the disk.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if there are such edits: commit them first. The right is kept then.
    pub fn end_editing(&mut self) -> Result<(), LayoutError> {
        self.end_room(true);
        self.wait_for_writing();
        if let Some(Editing::Lost(_)) = self.editing {
            return Ok(());
        }
        if !self.is_saved() {
            let path = self.terrain().path().display().to_string();
            return Err(LayoutError::Usage(format!(
                "{path}: some edits are not on the disk yet; commit them first"
            )));
        }
        if let Some(Editing::Here(hand)) = self.editing.take() {
            self.seen = hand.session.header().state();
        }
        Ok(())
    }

    /// Takes notice of a commit that is over, and of a file that was rewritten; does not wait.
    pub(super) fn settle(&mut self) {
        match &self.editing {
            Some(Editing::Here(hand)) if hand.has_written() => self.wait_for_writing(),
            Some(Editing::Away(room)) if room.is_over() => self.end_room(false),
            _ => {}
        }
    }

    /// The oldest error of editing that has not been told.
    pub(super) fn editing_error(&mut self) -> Option<LayoutError> {
        let own = self.errors.pop_front();
        own.or_else(|| match &self.editing {
            Some(Editing::Away(room)) => room.take_error(),
            _ => None,
        })
    }

    /// Waits for the commit under way, and takes notice of what became of it.
    fn wait_for_writing(&mut self) {
        let Some(Editing::Here(hand)) = &mut self.editing else { return };
        match hand.end_writing() {
            Ok(places) => self.engine.relocate(&places),
            Err(error) => self.errors.push_back(error),
        }
    }

    /// Has the file rewritten with room for these heights, and the edits made then.
    fn make_room(&mut self, edits: Vec<Edit>, heights_m: [f64; 2]) -> Result<(), LayoutError> {
        let plan = Plan { options: self.options, view: self.views[1] };
        let Some(Editing::Here(hand)) = self.editing.take() else { return Err(nobody()) };
        let (editing, outcome) = match Room::begin(*hand, edits, heights_m, plan) {
            Ok(room) => (Editing::Away(room), Ok(())),
            Err((hand, error)) => (Editing::Here(hand), Err(error)),
        };
        self.editing = Some(editing);
        outcome
    }

    /// Waits for the thread that rewrites the file, and goes on with what it leaves. With `refines` the mesh is made for the last view, otherwise an update follows.
    fn end_room(&mut self, refines: bool) {
        let Some(Editing::Away(_)) = &self.editing else { return };
        let Some(Editing::Away(room)) = self.editing.take() else { return };
        let (made, errors) = room.end();
        self.errors.extend(errors);
        match made {
            Ok(made) => self.take_over(made, refines),
            Err(error) => {
                let words = error.to_string();
                self.errors.push_back(error);
                self.editing = Some(Editing::Lost(words));
            }
        }
    }

    fn take_over(&mut self, made: Made, refines: bool) {
        let Made { hand, shown, steps, samples } = made;
        self.editing = Some(Editing::Here(Box::new(hand)));
        let is_new = shown.is_some();
        if let Some(shown) = shown {
            (self.engine, self.terrain) = (shown.engine, Opened::Streamed(shown.terrain));
            self.step = MeshStep::first();
            self.engine.set_budget(self.options.budget);
            if shown.culling != self.options.culling {
                self.engine.set_culling(self.options.culling);
            }
        }
        for step in steps {
            match step {
                Step::Saved(places) => self.engine.relocate(&places),
                Step::Edited(patch) => {
                    if let Err(error) = self.engine.take_edits(patch) {
                        self.errors.push_back(error);
                    }
                }
            }
        }
        self.note_edited(&samples);
        if let (true, true, Some(view)) = (is_new, refines, self.views[1]) {
            self.engine.update(&view);
        }
    }

    fn turn(
        &mut self,
        turn: fn(&mut EditSession) -> Result<Option<Changes>, LayoutError>,
    ) -> Result<bool, LayoutError> {
        self.end_room(true);
        self.wait_for_writing();
        let Editing::Here(hand) = self.editing()? else { return Err(nobody()) };
        let Some(changes) = turn(&mut hand.session)? else { return Ok(false) };
        let patch = hand.turned(changes)?;
        self.take_edits(patch)?;
        Ok(true)
    }

    /// The right to edit, taken if need be.
    fn editing(&mut self) -> Result<&mut Editing, LayoutError> {
        if self.editing.is_none() {
            let terrain: &Terrain = match &self.terrain {
                Opened::Streamed(terrain) => terrain,
                Opened::Mapped(terrain) => {
                    return Err(LayoutError::Usage(format!(
                        "{}: mapped ground cannot be edited; stream it instead",
                        terrain.path().display()
                    )));
                }
            };
            let session = open_session(terrain, self.seen)?;
            self.editing = Some(Editing::Here(Box::new(Hand::of(session, terrain.path()))));
        }
        match &mut self.editing {
            Some(Editing::Lost(why)) => {
                Err(LayoutError::Usage(format!("{why}; open the terrain again to edit it")))
            }
            Some(editing) => Ok(editing),
            None => Err(nobody()),
        }
    }
}

fn nobody() -> LayoutError {
    LayoutError::Usage("there is nobody to edit".into())
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
        ground.editing = Some(Editing::Here(Box::new(Hand::of(session, path))));
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
