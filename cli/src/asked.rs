//! Whoever finishes something first when the program is asked to end by a signal: a window saves its edits.

use std::sync::{Mutex, PoisonError};

/// What is told of it.
type Told = Box<dyn Fn() + Send>;

static TOLD: Mutex<Option<Told>> = Mutex::new(None);

/// Has `told` called where a signal would end the program. It is called once; a second signal ends the program.
pub(crate) fn first(told: impl Fn() + Send + 'static) {
    *TOLD.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(told));
}

/// Whether somebody finishes something first, who is told of it.
pub(crate) fn anybody() -> bool {
    let told = TOLD.lock().unwrap_or_else(PoisonError::into_inner).take();
    told.is_some_and(|told| {
        told();
        true
    })
}
