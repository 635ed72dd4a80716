//! Pages are read in threads of their own, those that are due first before all others. So a frame never waits for storage.
//!
//! A frame asks for pages and takes those that have come. A read that failed comes as an error that names the page, and the page may be asked for
//! again. Waiting pages that lie within the same aligned 64 KiB of the file are read together, because a long read costs little more than a short one. Every page is
//! checked against its checksum before it is handed over.
//!
//! Where a page lies is known from its directory leaf, which is read before the first of its pages. A leaf that cannot be read fails each page of it that was asked for.
//!
//! Edits move pages: a commit writes them elsewhere in the file, and an undo leads back to where they were. After a commit [`Loader::relocate`] must be called; from then on pages are read from their
//! new places. A read that was under way at that moment may bring the page's old content. Such a read is made again before its page is given out.
//!
//! Invariants: every page that was asked for comes back once: read, failed or dropped. Its content is that of the place that the newest relocation names. A page that was not asked
//! for again for [`STALE_FRAMES`] after it was due is dropped unread, because the eye has gone elsewhere. Cost: a lock a frame, one a page that comes and two a read; some 24 bytes for each page that has moved.

mod places;
mod queue;

pub use queue::PageRequest;

use super::terrain::Terrain;
use crate::error::LayoutError;
use crate::file::bytes::{PAGE_BYTES, Page};
use crate::file::entries::Entry;
use crate::file::source::ReadJob;
use crate::file::structure::inert_page;
use places::Places;
use queue::Waiting;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Pages of the longest read: 64 KiB.
const RUN_PAGES: u64 = 16;
/// A page this many frames past due that was not asked for again is not read.
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
    /// It was not read, because it was not asked for again.
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
    /// Time spent in reads, or batches of them, over all threads.
    pub time: Duration,
    /// Longest read or batch.
    pub longest: Duration,
}

/// Threads that read pages of one terrain.
#[derive(Debug)]
pub struct Loader {
    shared: Arc<Shared>,
    arrivals: Receiver<Sent>,
}

/// An arrival on its way, and where its page was read from. None for what was not read.
type Sent = (Arrival, Option<Entry>);

#[derive(Debug)]
struct Shared {
    terrain: Arc<Terrain>,
    state: Mutex<State>,
    work: Condvar,
}

#[derive(Debug, Default)]
struct State {
    waiting: Waiting,
    places: Places,
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
    /// Starts `threads` threads, at least one, that read from `terrain`'s source. Where its pages are unpacked there are fewer of them than the machine has processors: unpacking keeps a processor busy, and the thread that
    /// flies needs one.
    ///
    /// # Errors
    /// [`LayoutError::Io`] if the system gives no thread.
    pub fn start(terrain: Arc<Terrain>, threads: usize) -> Result<Self, LayoutError> {
        let shared = Arc::new(Shared { terrain, state: Mutex::default(), work: Condvar::new() });
        let (sender, arrivals) = channel();
        let loader = Self { shared, arrivals };
        let unpacks = loader.shared.terrain.source().unpacking().is_some();
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        for i in 0..thread_count(threads, unpacks, processors) {
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

    /// Says where pages lie from now on: (logical page, entry) of pages that were committed elsewhere, or that an undo or a redo led back to. Absent entries read as inert pages.
    /// Pages that the terrain has not are passed over.
    pub fn relocate(&self, places: &[(u64, Entry)]) {
        let mut state = self.shared.lock();
        places.iter().for_each(|(page, entry)| state.places.set(&self.shared.terrain, *page, *entry));
    }

    /// Reads a page again that was taken and not used: it comes once more, whatever it is.
    pub fn read_again(&self, page: u64) {
        let mut state = self.shared.lock();
        let due = state.now;
        state.waiting.ask(PageRequest { page, due });
        drop(state);
        self.shared.work.notify_one();
    }

    /// A page that has come, if any; never waits.
    pub fn take(&self) -> Option<Arrival> {
        loop {
            let sent = self.arrivals.try_recv().ok()?;
            if let Some(arrival) = self.if_valid(sent) {
                return Some(arrival);
            }
        }
    }

    /// A page that comes within `longest`.
    pub fn take_within(&self, longest: Duration) -> Option<Arrival> {
        let begun = Instant::now();
        loop {
            let sent = self.arrivals.recv_timeout(longest.saturating_sub(begun.elapsed())).ok()?;
            if let Some(arrival) = self.if_valid(sent) {
                return Some(arrival);
            }
        }
    }

    /// What was read, unless its page lies elsewhere by now: then it is read again.
    fn if_valid(&self, (arrival, read_from): Sent) -> Option<Arrival> {
        let Some(read_from) = read_from else { return Some(arrival) };
        if self.shared.lock().places.of(&self.shared.terrain, arrival.page) == Some(read_from) {
            return Some(arrival);
        }
        self.read_again(arrival.page);
        None
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

/// How many threads read where so many were asked for.
fn thread_count(asked: usize, unpacks: bool, processors: usize) -> usize {
    let most = if unpacks { processors.saturating_sub(1) } else { asked };
    asked.min(most).max(1)
}

/// Pages that are read together and where they lie, in the order of the file, and what they are read into.
#[derive(Debug)]
struct Run {
    pages: Vec<(u64, Entry)>,
    buffer: Vec<u8>,
}

/// One thread's life.
fn serve(shared: &Shared, arrivals: &Sender<Sent>) {
    let terrain = &*shared.terrain;
    let depth = terrain.source().depth().max(1);
    let new_run = || Run {
        pages: Vec::with_capacity(RUN_PAGES as usize),
        buffer: vec![0; RUN_PAGES as usize * PAGE_BYTES],
    };
    let mut runs: Vec<Run> = (0..depth).map(|_| new_run()).collect();
    let mut state = shared.lock();
    loop {
        if state.stopped {
            return;
        }
        let mut begun = 0;
        while begun < depth
            && let Some(first) = state.waiting.pop()
        {
            if first.due + STALE_FRAMES < state.now {
                let dropped = Arrival { page: first.page, outcome: Outcome::Dropped };
                if arrivals.send((dropped, None)).is_err() {
                    return;
                }
                continue;
            }
            match state.places.of(terrain, first.page) {
                Some(entry) if entry.is_present() => {
                    gather(terrain, first.page, &mut state, &mut runs[begun].pages);
                    begun += 1;
                }
                Some(absent) => {
                    let outcome = Outcome::Read(inert_page(terrain.header().record_kind));
                    state.stats.pages += 1;
                    if arrivals.send((Arrival { page: first.page, outcome }, Some(absent))).is_err() {
                        return;
                    }
                }
                None => {
                    drop(state);
                    let read = terrain.entry(first.page);
                    state = shared.lock();
                    match read {
                        Ok(_) => state.waiting.ask(first),
                        Err(error) => {
                            state.stats.failures += 1;
                            let failed = Arrival { page: first.page, outcome: Outcome::Failed(error) };
                            if arrivals.send((failed, None)).is_err() {
                                return;
                            }
                        }
                    }
                }
            }
        }
        if begun == 0 {
            state = shared.work.wait(state).unwrap_or_else(PoisonError::into_inner);
            continue;
        }
        drop(state);
        let start = Instant::now();
        let Some(done) = read_runs(terrain, &mut runs[..begun], arrivals) else { return };
        let took = start.elapsed();
        state = shared.lock();
        let stats = &mut state.stats;
        stats.reads += done.reads;
        stats.bytes += done.bytes;
        stats.pages += done.pages;
        stats.failures += done.failures;
        stats.time += took;
        stats.longest = stats.longest.max(took);
    }
}

/// Puts `page` and what waits besides in its run of the file into `wanted`, in the order of the file.
fn gather(terrain: &Terrain, page: u64, state: &mut State, wanted: &mut Vec<(u64, Entry)>) {
    wanted.clear();
    let State { waiting, places, .. } = state;
    let run_of = |entry: Entry| entry.is_present().then(|| u64::from(entry.page) / RUN_PAGES);
    let run = places.of(terrain, page).and_then(run_of);
    // Files that were edited or have holes keep neighbours elsewhere; then there is less to gather.
    for near in page.saturating_sub(RUN_PAGES - 1)..page + RUN_PAGES {
        let Some(entry) = places.of(terrain, near) else { continue };
        if near == page || (run.is_some() && run_of(entry) == run && waiting.take(near)) {
            wanted.push((near, entry));
        }
    }
    wanted.sort_unstable_by_key(|(_, entry)| entry.page);
}

/// Reads runs and hands their pages over. `None` if there is no receiver any more.
fn read_runs(terrain: &Terrain, runs: &mut [Run], arrivals: &Sender<Sent>) -> Option<LoaderStats> {
    let mut done = LoaderStats { reads: runs.len() as u64, ..LoaderStats::default() };
    let mut jobs: Vec<ReadJob<'_>> = Vec::with_capacity(runs.len());
    for Run { pages, buffer } in runs.iter_mut() {
        let page = |at: Option<&(u64, Entry)>| at.map_or(0, |(_, entry)| u64::from(entry.page));
        let (first, last) = (page(pages.first()), page(pages.last()));
        // All lie in one aligned run, which the buffer holds.
        let bytes = ((last - first + 1) as usize * PAGE_BYTES).min(buffer.len());
        jobs.push(ReadJob::new(first * PAGE_BYTES as u64, &mut buffer[..bytes]));
    }
    terrain.source().read_many(&mut jobs);
    let outcomes: Vec<bool> = jobs.iter().map(|job| job.outcome.is_ok()).collect();
    done.bytes = jobs.iter().map(|job| job.buffer.len() as u64).sum();
    for (Run { pages, buffer }, is_read) in runs.iter().zip(outcomes) {
        let first = pages.first().map(|(_, entry)| *entry).filter(|entry| is_read && entry.is_present());
        for (page, entry) in pages {
            // A read that fails says nothing of each of its pages: each is tried by itself, so that an error names the page it is about.
            let read = first.map(|first| cut_out(terrain, *page, *entry, first.page, buffer));
            let outcome = match read.unwrap_or_else(|| terrain.checked_page_at(*page, *entry)) {
                Ok(page) => Outcome::Read(page),
                Err(error) => Outcome::Failed(error),
            };
            if matches!(outcome, Outcome::Read(_)) {
                done.pages += 1;
            } else {
                done.failures += 1;
            }
            arrivals.send((Arrival { page: *page, outcome }, Some(*entry))).ok()?;
        }
    }
    Some(done)
}

/// One page out of a run whose first file page is `first`.
fn cut_out(
    terrain: &Terrain,
    logical_page: u64,
    entry: Entry,
    first: u32,
    buffer: &[u8],
) -> Result<Box<Page>, LayoutError> {
    let at = (entry.page - first) as usize * PAGE_BYTES;
    let mut page = Box::new([0; PAGE_BYTES]);
    page.copy_from_slice(&buffer[at..at + PAGE_BYTES]);
    terrain.check_page(logical_page, entry, &page)?;
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::thread_count;

    #[test]
    fn threads_that_unpack_leave_a_processor() {
        let with =
            |unpacks| [(0, 8), (4, 1), (4, 2), (4, 4), (4, 16)].map(|(n, p)| thread_count(n, unpacks, p));
        assert_eq!(with(true), [1, 1, 1, 3, 4]);
        assert_eq!(with(false), [1, 4, 4, 4, 4]);
    }
}
