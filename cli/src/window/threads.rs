//! Threads for work in the background of the window. They are apart from those that frames use, so a frame never waits for a build or a commit.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::io;
use std::thread::available_parallelism;

/// A pool of its own, with a thread less than there are cores, `most` and at least one. Threads are named after it.
///
/// # Errors
/// The system gives no thread.
pub(crate) fn pool(name: &'static str, most: usize) -> io::Result<ThreadPool> {
    let cores = available_parallelism().map_or(1, usize::from);
    ThreadPoolBuilder::new()
        .num_threads((cores - 1).clamp(1, most.max(1)))
        .thread_name(move |i| format!("{name} {i}"))
        .build()
        .map_err(io::Error::other)
}

/// Does `work` while every thread that frames share their work out to is kept busy.
#[cfg(test)]
pub(crate) fn while_frames_have_all_threads(work: impl FnOnce()) {
    use std::sync::{Arc, Barrier};
    let threads = rayon::current_num_threads();
    let [begun, over] = [(); 2].map(|()| Arc::new(Barrier::new(threads + 1)));
    for _ in 0..threads {
        let (begun, over) = (Arc::clone(&begun), Arc::clone(&over));
        rayon::spawn(move || {
            begun.wait();
            over.wait();
        });
    }
    begun.wait();
    let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    over.wait();
    if let Err(panic) = done {
        std::panic::resume_unwind(panic);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pool_has_threads_of_its_own_and_leaves_a_core_to_frames() {
        let cores = available_parallelism().unwrap().get();
        let own = pool("test", usize::MAX).unwrap();
        assert_eq!(own.current_num_threads(), (cores - 1).max(1));
        assert_eq!(pool("test", 1).unwrap().current_num_threads(), 1);
        let name = || std::thread::current().name().map(str::to_owned);
        assert!(own.install(name).unwrap().starts_with("test "));
        let named = own.install(|| rayon::join(name, || rayon::join(name, name)));
        for name in [named.0, named.1.0, named.1.1] {
            assert!(name.unwrap().starts_with("test "), "work is shared out within the pool");
        }
    }
}
