//! How work in the background gets on, for a window that looks now and then.
//!
//! Cost: a few atomic numbers; whoever reads never waits for who works.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use terrasoar_layout::progress::Progress;

/// What a work is at, and how far.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    stage: Mutex<&'static str>,
    total: AtomicU64,
    done: AtomicU64,
}

impl Meter {
    /// What the work is at, and which part of that is done, from 0 to 1.
    pub(crate) fn read(&self) -> (&'static str, f32) {
        let stage = *self.stage.lock().unwrap_or_else(PoisonError::into_inner);
        let [done, total] = [&self.done, &self.total].map(|n| n.load(Ordering::Relaxed) as f32);
        (stage, if total > 0.0 { (done / total).min(1.0) } else { 0.0 })
    }
}

impl Progress for Meter {
    fn stage(&self, name: &'static str, samples: u64) {
        *self.stage.lock().unwrap_or_else(PoisonError::into_inner) = name;
        self.total.store(samples, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
    }

    fn advance(&self, samples: u64) {
        self.done.fetch_add(samples, Ordering::Relaxed);
    }
}
