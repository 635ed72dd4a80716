//! What the window and the workshop's thread send each other: plain values that share nothing, so that neither waits for the other.

use crate::window::meter::Meter;
use std::sync::Arc;
use terrasoar::stream::GroundPatch;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{CommitJob, Edit};
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::file::header::FileState;
use terrasoar_layout::imagery::Paint;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_scene::repaint::Repaint;

/// What the thread is to do, one after the other.
pub(super) enum Order {
    /// To edit and paint, in memory.
    Apply {
        /// Number of the stroke.
        stroke: u64,
        edits: Vec<Edit>,
        paints: Vec<Paint>,
    },
    /// To have everything so far written.
    Commit { label: String },
    /// To take the last commit back, or to bring it back.
    Turn { back: bool },
    /// The second thread has written a commit, or has not.
    Written(Box<CommitJob>, Result<(), LayoutError>),
    /// To have everything written and give the right back.
    Close,
}

/// How far somebody has come.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Tally {
    /// Batches, undos and redos.
    pub orders: u64,
    /// Edits in the batches.
    pub edits: u64,
    /// How many of these edits, the first ones, leave nothing to be written.
    pub saved: u64,
}

/// Something that the thread tells.
pub(super) struct Report {
    pub news: News,
    /// What it has done so far.
    pub done: Tally,
    /// The file's state.
    pub state: FileState,
}

/// What has become of an order.
#[derive(Debug)]
pub(crate) enum News {
    /// Nothing that is to be shown.
    Nothing,
    /// Edits were applied.
    Edited(Box<Seen>),
    /// Edits could not be applied; nothing of the batch was.
    Refused(LayoutError),
    /// The file has no room for an edit, and is being rewritten with room for it. Orders wait for that.
    Widening {
        /// Why, and what it means, as a message.
        words: String,
        /// How it gets on.
        meter: Arc<Meter>,
    },
    /// The file was rewritten. This is what it has now, and all that follows is of it: the edits that were not on the disk yet come again.
    Widened(Box<Terrain>),
    /// The last commit was taken back, or brought back, on the disk too.
    Turned {
        /// Whether it was taken back.
        back: bool,
        /// What that made of the ground.
        seen: Box<Seen>,
    },
    /// There is no commit to be taken back, or brought back.
    NothingToTurn {
        /// Whether one was to be taken back.
        back: bool,
    },
    /// It could be neither.
    NotTurned(LayoutError),
    /// A commit is on the disk.
    Saved {
        /// Where pages lie now that have not been edited since.
        places: Vec<(u64, Entry)>,
        /// What that made of the picture.
        picture: Result<Option<Box<Repaint>>, LayoutError>,
    },
    /// A commit is not on the disk; it is part of the next.
    NotSaved(LayoutError),
    /// The terrain could not be opened for editing, and the right was given back. What was ordered is not done; all edits that were made are on the disk.
    NotOpened(LayoutError),
    /// The right was given back, everything being on the disk but for what the error says.
    Closed(Option<LayoutError>),
    /// The thread ended, and edits with it that were made; what that means, as a message.
    Broken(String),
}

/// What became of ground and picture.
#[derive(Debug)]
pub(crate) struct Seen {
    /// The ground.
    pub ground: GroundPatch,
    /// The picture, if it is another.
    pub picture: Option<Box<Repaint>>,
    /// What of it cannot be shown.
    pub trouble: Option<LayoutError>,
}
