//! What the ground and the thread that rewrites its file look at together: orders, errors, and whether all is on the disk.

use crate::ground::ticket::Promise;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::Edit;

/// What is to be done, one after the other.
pub(in crate::ground) enum Order {
    /// To edit, in memory.
    Edit(Vec<Edit>),
    /// To write everything so far.
    Commit(String, Promise),
}

impl Order {
    /// Edits that are lost with it.
    pub(super) fn edits(&self) -> usize {
        match self {
            Self::Edit(batch) => batch.len(),
            Self::Commit(..) => 0,
        }
    }
}

/// What both sides look at.
#[derive(Default)]
pub(super) struct Desk(Mutex<Papers>);

#[derive(Default)]
pub(super) struct Papers {
    pub(super) orders: VecDeque<Order>,
    pub(super) errors: VecDeque<LayoutError>,
    /// Whether everything so far is on the disk.
    pub(super) is_saved: bool,
    /// Whether no more orders are taken.
    pub(super) is_closed: bool,
}

impl Desk {
    /// No code that holds the lock can panic.
    pub(super) fn papers(&self) -> MutexGuard<'_, Papers> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
