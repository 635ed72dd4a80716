//! The thread that writes commits to the disk, one by one, while edits go on.
//!
//! Invariants: a result comes back for every commit it is given. Dropping it waits until it has written all of them. So the right to edit, which is dropped after it,
//! outlives every write. Cost: a thread that sleeps.

use super::Spawn;
use super::news::Order;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::CommitJob;
use terrasoar_layout::file::disk::Disk;

/// A thread that writes.
pub(super) struct Writer {
    jobs: Option<Sender<Box<CommitJob>>>,
    thread: Option<JoinHandle<()>>,
    done: Sender<Order>,
    path: PathBuf,
}

impl Writer {
    /// Starts it, to write to the file at `path`. What it has written it tells by `done`.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn start(
        spawn: Spawn,
        path: PathBuf,
        disk: Arc<dyn Disk + Send>,
        done: Sender<Order>,
    ) -> io::Result<Self> {
        let (jobs, given) = channel::<Box<CommitJob>>();
        let (tell, name) = (done.clone(), path.clone());
        let write = move || {
            for job in given {
                // A job is as after any failed write then, and may be made again.
                let ended = catch_unwind(AssertUnwindSafe(|| job.run_on(&*disk)));
                let outcome = ended.unwrap_or_else(|_| Err(unexpected(&name)));
                // Who gave it waits for it before it ends.
                let _ = tell.send(Order::Written(job, outcome));
            }
        };
        let thread = spawn("commit", Box::new(write))?;
        Ok(Self { jobs: Some(jobs), thread: Some(thread), done, path })
    }

    /// Has a commit written.
    pub(super) fn write(&self, job: CommitJob) {
        let Some(jobs) = &self.jobs else { return };
        if let Err(unsent) = jobs.send(Box::new(job)) {
            let _ = self.done.send(Order::Written(unsent.0, Err(unexpected(&self.path))));
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // It cannot end otherwise than it should.
            let _ = thread.join();
        }
    }
}

fn unexpected(path: &std::path::Path) -> LayoutError {
    let why = io::Error::other("writing came to an unexpected end");
    LayoutError::io(path, "cannot append the edits to the file", why)
}
