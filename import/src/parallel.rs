//! Runs numbered tasks on the current rayon pool, nearly in order.
//!
//! Each worker takes the lowest task not yet taken, so a file is read from front to back whatever
//! the number of workers, and opens its own state (a file, a decoder) once. The first error stops
//! all workers. Of several errors the one of the lowest task is reported.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use terrasoar_layout::error::LayoutError;

/// Runs `work` for every task in `0..tasks` on at most `max_workers` workers, each with a state from `open`.
pub(super) fn each_task<S>(
    tasks: u64,
    max_workers: usize,
    open: impl Fn() -> Result<S, LayoutError> + Sync,
    work: impl Fn(&mut S, u64) -> Result<(), LayoutError> + Sync,
) -> Result<(), LayoutError> {
    let next = AtomicU64::new(0);
    let stopped = AtomicBool::new(false);
    let failure: Mutex<Option<(u64, LayoutError)>> = Mutex::new(None);
    let fail = |task: u64, error: LayoutError| {
        stopped.store(true, Ordering::Relaxed);
        let mut slot = failure.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        if slot.as_ref().is_none_or(|(earlier, _)| task < *earlier) {
            *slot = Some((task, error));
        }
    };
    let worker = || {
        let mut state = None;
        while !stopped.load(Ordering::Relaxed) {
            let task = next.fetch_add(1, Ordering::Relaxed);
            if task >= tasks {
                return;
            }
            let done = match &mut state {
                Some(state) => work(state, task),
                None => open().and_then(|opened| work(state.insert(opened), task)),
            };
            if let Err(error) = done {
                return fail(task, error);
            }
        }
    };
    let workers = rayon::current_num_threads().min(max_workers).max(1);
    let workers = u64::try_from(workers).unwrap_or(u64::MAX).min(tasks);
    rayon::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|_| worker());
        }
    });
    let failure = failure.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
    failure.map_or(Ok(()), |(_, error)| Err(error))
}
