//! A commit on its way to the disk: a thread that writes it, and a ticket that tells what became of it.
//!
//! The ticket owns what it reports. It may be kept, sent to another thread or dropped, and it may outlive the ground. **When it says that a commit is saved, the commit is on the disk.**

use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::CommitJob;
use terrasoar_layout::file::disk::Disk;

/// What became of edits that are on the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Saved {
    /// Record pages written.
    pub pages: u64,
    /// Bytes by which the file grew.
    pub bytes: u64,
}

/// Why edits are not on the disk. They are in memory still, and part of the next commit. Where the cause is that an edit was refused which had been taken on for later
/// ([`Edited::Later`](super::Edited::Later)), that edit is not made, and all others are on the disk.
#[derive(Debug, Clone, thiserror::Error)]
#[error(transparent)]
pub struct CommitFailed(Arc<LayoutError>);

impl CommitFailed {
    /// For this cause.
    pub(super) fn of(cause: LayoutError) -> Self {
        Self(Arc::new(cause))
    }

    /// What went wrong.
    pub fn cause(&self) -> &LayoutError {
        &self.0
    }
}

/// A commit under way.
#[derive(Debug, Clone)]
pub struct CommitTicket {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    outcome: Mutex<Option<Result<Saved, CommitFailed>>>,
    told: Condvar,
}

impl CommitTicket {
    /// The ticket of a commit that had nothing to write, and of which that became.
    pub(super) fn of_nothing(outcome: Result<Saved, CommitFailed>) -> Self {
        let shared = Shared::default();
        *shared.lock() = Some(outcome);
        Self { shared: Arc::new(shared) }
    }

    /// The ticket of a commit of the file at `path` that others will begin, and what they tell by it.
    pub(super) fn promised(path: &Path) -> (Self, Promise) {
        let ticket = Self { shared: Arc::default() };
        let shared = Arc::clone(&ticket.shared);
        (ticket, Promise { shared, path: path.to_owned() })
    }

    /// What became of it, if that is known; does not wait.
    pub fn outcome(&self) -> Option<Result<Saved, CommitFailed>> {
        self.shared.lock().clone()
    }

    /// Whether it is over, well or not.
    pub fn is_done(&self) -> bool {
        self.shared.lock().is_some()
    }

    /// Waits until it is over.
    ///
    /// # Errors
    /// What kept it from the disk.
    pub fn wait(&self) -> Result<Saved, CommitFailed> {
        let mut outcome = self.shared.lock();
        loop {
            if let Some(outcome) = &*outcome {
                return outcome.clone();
            }
            outcome = self.shared.told.wait(outcome).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Shared {
    /// No code that holds the lock can panic.
    fn lock(&self) -> MutexGuard<'_, Option<Result<Saved, CommitFailed>>> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, outcome: Result<Saved, CommitFailed>) {
        self.lock().get_or_insert(outcome);
        self.told.notify_all();
    }
}

/// The thread that writes a commit, and its ticket.
#[derive(Debug)]
pub(super) struct Writing {
    thread: Option<JoinHandle<Written>>,
    ticket: CommitTicket,
}

/// What the thread leaves: the job if it is on the disk. Without it, what it was to write is part of the next commit.
type Written = Result<CommitJob, CommitFailed>;

impl Writing {
    /// Begins to write `job` to the file at `path` on a thread of its own. If edits before it were `refused`, the ticket tells that where all else goes well.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn begin(
        job: CommitJob,
        disk: Arc<dyn Disk + Send>,
        path: &Path,
        refused: Option<CommitFailed>,
    ) -> Result<Self, LayoutError> {
        let (ticket, promise) = CommitTicket::promised(path);
        let write = move || {
            let written = job.run_on(&*disk).map_err(CommitFailed::of);
            let saved = Saved { pages: job.pages(), bytes: job.bytes() };
            promise.tell(written.clone().and(refused.map_or(Ok(saved), Err)));
            written.map(|()| job)
        };
        let thread = std::thread::Builder::new()
            .name("commit writer".into())
            .spawn(write)
            .map_err(|e| LayoutError::io(path, "cannot start a thread that writes edits", e))?;
        Ok(Self { thread: Some(thread), ticket })
    }

    /// Its ticket.
    pub(super) fn ticket(&self) -> CommitTicket {
        self.ticket.clone()
    }

    /// Whether it is known what became of the commit: the thread is at its end then.
    pub(super) fn is_over(&self) -> bool {
        self.ticket.is_done()
    }

    /// Waits for the thread, and gives what it leaves.
    pub(super) fn end(mut self) -> Written {
        self.join().unwrap_or_else(|| {
            Err(self.ticket.wait().err().unwrap_or_else(|| unexpected(Path::new("edits"))))
        })
    }

    /// What the thread leaves, unless it ended unexpectedly, which it has told by its ticket.
    fn join(&mut self) -> Option<Written> {
        self.thread.take()?.join().ok()
    }
}

impl Drop for Writing {
    /// What is being written is brought to the disk; what became of it the ticket tells.
    fn drop(&mut self) {
        self.join();
    }
}

/// What became of a commit will be told by it, its unexpected end included.
#[derive(Debug)]
pub(super) struct Promise {
    shared: Arc<Shared>,
    path: PathBuf,
}

impl Promise {
    /// Tells what became of the commit.
    pub(super) fn tell(&self, outcome: Result<Saved, CommitFailed>) {
        self.shared.tell(outcome);
    }
}

impl Drop for Promise {
    fn drop(&mut self) {
        // Does nothing if what became of it was told.
        self.shared.tell(Err(unexpected(&self.path)));
    }
}

fn unexpected(path: &Path) -> CommitFailed {
    let end = std::io::Error::other("writing came to an unexpected end; commit again");
    CommitFailed(Arc::new(LayoutError::io(path, "cannot write the edits", end)))
}
