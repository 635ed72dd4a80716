//! What wakes the sleeping window.

/// A thread has something to tell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wake;
