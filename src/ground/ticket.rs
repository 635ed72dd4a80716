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

/// Why edits are not on the disk. They are in memory still, and part of the next commit.
#[derive(Debug, Clone, thiserror::Error)]
#[error(transparent)]
pub struct CommitFailed(Arc<LayoutError>);

impl CommitFailed {
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
    /// The ticket of a commit that had nothing to write.
    pub(super) fn of_nothing() -> Self {
        let shared = Shared::default();
        *shared.lock() = Some(Ok(Saved::default()));
        Self { shared: Arc::new(shared) }
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
    thread: JoinHandle<Written>,
    ticket: CommitTicket,
}

/// What the thread leaves: the job if it is on the disk. Without it, what it was to write is part of the next commit.
type Written = Result<CommitJob, CommitFailed>;

impl Writing {
    /// Begins to write `job` to the file at `path` on a thread of its own.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn begin(
        job: CommitJob,
        disk: Arc<dyn Disk + Send>,
        path: &Path,
    ) -> Result<Self, LayoutError> {
        let ticket = CommitTicket { shared: Arc::default() };
        let shared = Arc::clone(&ticket.shared);
        let teller = Teller { shared, path: path.to_owned() };
        let write = move || {
            let written = job.run_on(&*disk).map_err(|error| CommitFailed(Arc::new(error)));
            let saved = Saved { pages: job.pages(), bytes: job.bytes() };
            teller.shared.tell(written.clone().map(|()| saved));
            written.map(|()| job)
        };
        let thread = std::thread::Builder::new()
            .name("commit writer".into())
            .spawn(write)
            .map_err(|e| LayoutError::io(path, "cannot start a thread that writes edits", e))?;
        Ok(Self { thread, ticket })
    }

    /// Its ticket.
    pub(super) fn ticket(&self) -> CommitTicket {
        self.ticket.clone()
    }

    /// Whether the thread has come to its end.
    pub(super) fn is_over(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the thread, and gives what it leaves.
    pub(super) fn end(self) -> Written {
        match self.thread.join() {
            Ok(written) => written,
            // It has told by its ticket.
            Err(_) => Err(self.ticket.wait().err().unwrap_or_else(|| unexpected(Path::new("edits")))),
        }
    }
}

/// Reports an unexpected end.
struct Teller {
    shared: Arc<Shared>,
    path: PathBuf,
}

impl Drop for Teller {
    fn drop(&mut self) {
        // Does nothing if what became of it was told.
        self.shared.tell(Err(unexpected(&self.path)));
    }
}

fn unexpected(path: &Path) -> CommitFailed {
    let end = std::io::Error::other("writing came to an unexpected end; commit again");
    CommitFailed(Arc::new(LayoutError::io(path, "cannot write the edits", end)))
}
