//! A file rewritten with room for an edit that its records cannot hold, on the workshop's thread, while the window goes on with what it has open.
//!
//! What was ordered to be written is written first. Edits that are not on the disk by then are made again in the new file, in their order, so that a stroke stays one step of undo.
//! Orders that come meanwhile wait in theirs. The right to edit is given back for the time of the rewriting, which takes it itself; if another program uses a moment in between, that is
//! told and nothing of its work is lost. Cost: that of a build from records; the frames' threads have no part in it.

use super::{Bench, News, Open, open_session};
use crate::beside::named_beside;
use crate::window::meter::Meter;
use crate::window::threads;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{EditSession, room_for, widen};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_scene::repaint::PictureWatch;

/// Times that one batch may make the file be rewritten: once for heights, once for slopes, and one to spare.
pub(super) const MOST_WIDENINGS: u32 = 3;
/// Memory for rewriting a file in MiB.
const MEMORY_MIB: u64 = 512;

impl Bench {
    /// Rewrites the file with room for these heights, which it cannot hold for the reason that `problem` tells. What became of that comes with the bench: after an error the file is as
    /// before. `None` if the file cannot be edited any more, which is told.
    pub(super) fn make_room(
        mut self,
        heights_m: [f64; 2],
        problem: &str,
        open: &Open,
    ) -> Option<(Self, Result<(), LayoutError>)> {
        if let Err(error) =
            self.write_what_was_ordered().and_then(|()| check_rewritable(&self.session, problem))
        {
            return Some((self, Err(error)));
        }
        let path = self.session.editor().terrain().path().to_path_buf();
        let pool = match threads::pool("make room", usize::MAX) {
            Ok(pool) => pool,
            Err(e) => {
                let error = LayoutError::io(&path, "cannot start threads to rewrite the file with", e);
                return Some((self, Err(error)));
            }
        };
        let header = self.session.header().clone();
        let meter = Arc::new(Meter::default());
        let mut words = format!("{}: {problem}: this is done now, and the edit follows", path.display());
        if header.history.is_some() {
            words += "; what was saved before can no longer be undone then";
        }
        self.desk.report(News::Widening { words, meter: Arc::clone(&meter) });
        let Self { writer, session, helpers, orders, kept, writing, batches, refused, mut desk, .. } = self;
        let disk = session.disk();
        // The rewriting takes the lock for itself, and some systems do not replace what is open.
        drop(session);
        let room = room_for(&header, heights_m);
        let widened = pool.install(|| widen(&*disk, &path, room, MEMORY_MIB, &*meter));
        drop(pool);
        let made = match widened {
            Ok(header) => {
                desk.state = header.state();
                match Terrain::open_unmapped(&path) {
                    Ok(terrain) => desk.report(News::Widened(Box::new(terrain))),
                    Err(error) => {
                        desk.report(News::NotOpened(error));
                        return None;
                    }
                }
                Ok(())
            }
            Err(error) => Err(error),
        };
        let session = match open_session(open, desk.state) {
            Ok(session) => session,
            Err(error) => {
                desk.report(News::NotOpened(error));
                return None;
            }
        };
        let picture = PictureWatch::default();
        let mut bench =
            Self { writer, session, helpers, picture, orders, kept, writing, batches, refused, desk };
        bench.do_again();
        Some((bench, made))
    }

    /// Has everything written that was ordered to be.
    fn write_what_was_ordered(&mut self) -> Result<(), LayoutError> {
        loop {
            let label = self.next_label();
            self.wait_for_writing()?;
            match label {
                Some(label) => {
                    self.begin(&label)?;
                }
                None => return Ok(()),
            }
        }
    }

    /// Makes the edits again that are not on the disk.
    fn do_again(&mut self) {
        for batch in std::mem::take(&mut self.batches) {
            match self.try_to(&batch) {
                Ok(seen) => {
                    self.batches.push_back(batch);
                    self.desk.report(News::Edited(seen));
                }
                Err(error) => self.desk.report(News::Refused(error)),
            }
        }
    }
}

/// Refuses to rewrite a file where something would be lost by that.
fn check_rewritable(session: &EditSession, problem: &str) -> Result<(), LayoutError> {
    let terrain = session.editor().terrain();
    let path = terrain.path();
    let refusal = |what: String| Err(LayoutError::Usage(format!("{}: {problem}; {what}", path.display())));
    if let Some(base) = terrain.base_path() {
        let (base, overlay) = (base.display(), path.display());
        return refusal(format!(
            "an overlay cannot change that: make a file of its own with `terrasoar compact {base} --overlay {overlay} -o NEW.iqt` and edit that"
        ));
    }
    match named_beside(path) {
        None => Ok(()),
        Some(names) => refusal(format!(
            "here that is not done, because the edits kept apart from the file would be lost: {names}; put them into a file of their own first, `terrasoar compact {} --overlay O.iqo -o NEW.iqt`",
            path.display()
        )),
    }
}
