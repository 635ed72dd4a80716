//! Pages read in threads of their own, the one that is due first before all others, so that a frame never waits for storage.
//!
//! A frame asks for pages and takes those that have come; what went wrong comes as an error that names the page, and the page may be asked for
//! again. Pages that wait and lie within the same aligned 64 KiB of the file are read together, for a long read costs little more than a short one. Every page is
//! checked against its checksum before it is handed over.
//!
//! Invariant: whatever was asked for comes back once: read, failed or dropped. A page that nobody has asked for again for [`STALE_FRAMES`] after
//! it was due is dropped unread: the eye has gone elsewhere. Cost: a lock a frame and two a read.

mod queue;

pub use queue::PageRequest;

use crate::bytes::{PAGE_BYTES, Page};
use crate::error::LayoutError;
use crate::terrain::Terrain;
use queue::Waiting;
use std::ops::RangeInclusive;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Pages of the longest read: 64 KiB.
const RUN_PAGES: u64 = 16;
/// A page this many frames past due that nobody has asked for again is not read.
pub const STALE_FRAMES: u64 = 30;

/// A page that was asked for.
#[derive(Debug)]
pub struct Arrival {
    /// Logical page.
    pub page: u64,
    /// What became of it.
    pub outcome: Outcome,
}

/// What became of a page that was asked for.
#[derive(Debug)]
pub enum Outcome {
    /// It is here, and its checksum is right.
    Read(Box<Page>),
    /// It could not be read, or is damaged.
    Failed(LayoutError),
    /// It was not read: nobody seemed to need it any more.
    Dropped,
}

/// What a loader did so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LoaderStats {
    /// Reads, of one or more pages each.
    pub reads: u64,
    /// Bytes of them.
    pub bytes: u64,
    /// Pages handed over.
    pub pages: u64,
    /// Reads or pages that failed.
    pub failures: u64,
    /// Time spent in reads, over all threads.
    pub time: Duration,
    /// Longest read.
    pub longest: Duration,
}

/// Threads that read pages of one terrain.
#[derive(Debug)]
pub struct Loader {
    shared: Arc<Shared>,
    arrivals: Receiver<Arrival>,
}

#[derive(Debug)]
struct Shared {
    terrain: Arc<Terrain>,
    state: Mutex<State>,
    work: Condvar,
}

#[derive(Debug, Default)]
struct State {
    waiting: Waiting,
    now: u64,
    stopped: bool,
    stats: LoaderStats,
}

impl Shared {
    /// No code that holds the lock can panic halfway through a change.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Loader {
    /// Starts `threads` threads, at least one, that read from `terrain`'s source.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if the system gives no thread.
    pub fn start(terrain: Arc<Terrain>, threads: usize) -> Result<Self, LayoutError> {
        let shared = Arc::new(Shared { terrain, state: Mutex::default(), work: Condvar::new() });
        let (sender, arrivals) = channel();
        let loader = Self { shared, arrivals };
        for i in 0..threads.max(1) {
            let (shared, sender) = (Arc::clone(&loader.shared), sender.clone());
            std::thread::Builder::new()
                .name(format!("page loader {i}"))
                .spawn(move || serve(&shared, &sender))
                .map_err(|e| {
                    LayoutError::io(loader.shared.terrain.path(), "cannot start a thread that reads pages", e)
                })?;
        }
        Ok(loader)
    }

    /// Asks for pages; it is frame `now`. A page that waits already is due when the newest request says.
    pub fn ask(&self, now: u64, requests: &[PageRequest]) {
        let mut state = self.shared.lock();
        state.now = now;
        requests.iter().for_each(|request| state.waiting.ask(*request));
        drop(state);
        match requests.len() {
            0 => {}
            1 => self.shared.work.notify_one(),
            _ => self.shared.work.notify_all(),
        }
    }

    /// A page that has come, if any; never waits.
    pub fn take(&self) -> Option<Arrival> {
        self.arrivals.try_recv().ok()
    }

    /// A page that comes within `longest`.
    pub fn take_within(&self, longest: Duration) -> Option<Arrival> {
        self.arrivals.recv_timeout(longest).ok()
    }

    /// Pages that wait to be read.
    pub fn waiting(&self) -> usize {
        self.shared.lock().waiting.len()
    }

    /// What it did so far.
    pub fn stats(&self) -> LoaderStats {
        self.shared.lock().stats
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.shared.lock().stopped = true;
        // Threads end by themselves; one that storage keeps waiting must not keep the program from ending.
        self.shared.work.notify_all();
    }
}

/// One thread's life.
fn serve(shared: &Shared, arrivals: &Sender<Arrival>) {
    let mut buffer = vec![0; RUN_PAGES as usize * PAGE_BYTES];
    let mut wanted = Vec::with_capacity(RUN_PAGES as usize);
    let mut state = shared.lock();
    loop {
        if state.stopped {
            return;
        }
        let Some(first) = state.waiting.pop() else {
            state = shared.work.wait(state).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        if first.due + STALE_FRAMES < state.now {
            if arrivals.send(Arrival { page: first.page, outcome: Outcome::Dropped }).is_err() {
                return;
            }
            continue;
        }
        gather(&shared.terrain, first.page, &mut state.waiting, &mut wanted);
        drop(state);
        let start = Instant::now();
        let (bytes, failures, gone) = read_run(&shared.terrain, &wanted, &mut buffer, arrivals);
        let took = start.elapsed();
        if gone {
            return;
        }
        state = shared.lock();
        let stats = &mut state.stats;
        stats.reads += 1;
        stats.bytes += bytes;
        stats.pages += wanted.len() as u64 - failures;
        stats.failures += failures;
        stats.time += took;
        stats.longest = stats.longest.max(took);
    }
}

/// Puts `page` and what waits besides in its run of the file into `wanted`, in the order of the file.
fn gather(terrain: &Terrain, page: u64, waiting: &mut Waiting, wanted: &mut Vec<u64>) {
    wanted.clear();
    let run_of = |page: u64| {
        terrain.entries().get(page as usize).filter(|e| e.is_present()).map(|e| u64::from(e.page) / RUN_PAGES)
    };
    let run = run_of(page);
    // Files that were edited or have holes keep neighbours elsewhere; then there is less to gather.
    for near in page.saturating_sub(RUN_PAGES - 1)..page + RUN_PAGES {
        if near == page || (run.is_some() && run_of(near) == run && waiting.take(near)) {
            wanted.push(near);
        }
    }
    wanted.sort_unstable_by_key(|page| terrain.entries().get(*page as usize).map(|e| e.page));
}

/// Reads pages of one run and hands them over. Tells bytes read, pages failed, and whether nobody listens any more.
fn read_run(
    terrain: &Terrain,
    wanted: &[u64],
    buffer: &mut [u8],
    arrivals: &Sender<Arrival>,
) -> (u64, u64, bool) {
    let span = file_span(terrain, wanted);
    let bytes = (span.end() - span.start() + 1) * PAGE_BYTES as u64;
    let read = match buffer.get_mut(..bytes as usize) {
        Some(buffer) if wanted.len() > 1 => {
            terrain.source().read_at(span.start() * PAGE_BYTES as u64, buffer).is_ok()
        }
        _ => false,
    };
    let mut failures = 0;
    for page in wanted {
        let outcome =
            if read { cut_out(terrain, *page, *span.start(), buffer) } else { terrain.checked_page(*page) };
        // A long read that fails says nothing of each of its pages: each is tried by itself, so that an error names the page it is about.
        let outcome = match outcome {
            Ok(page) => Outcome::Read(page),
            Err(error) => {
                failures += 1;
                Outcome::Failed(error)
            }
        };
        if arrivals.send(Arrival { page: *page, outcome }).is_err() {
            return (bytes, failures, true);
        }
    }
    (bytes, failures, false)
}

/// First and last file page of `wanted`, which is in the order of the file.
fn file_span(terrain: &Terrain, wanted: &[u64]) -> RangeInclusive<u64> {
    let page = |at: Option<&u64>| {
        at.and_then(|p| terrain.entries().get(*p as usize)).map_or(0, |e| u64::from(e.page))
    };
    page(wanted.first())..=page(wanted.last())
}

/// One page out of a run whose first file page is `first`.
fn cut_out(
    terrain: &Terrain,
    logical_page: u64,
    first: u64,
    buffer: &[u8],
) -> Result<Box<Page>, LayoutError> {
    let entry = terrain.entries().get(logical_page as usize).copied().unwrap_or_default();
    let at = (u64::from(entry.page) - first) as usize * PAGE_BYTES;
    let mut page = Box::new([0; PAGE_BYTES]);
    page.copy_from_slice(&buffer[at..at + PAGE_BYTES]);
    terrain.check_page(logical_page, entry, &page)?;
    Ok(page)
}
