//! The thread that edits the terrain on show. It takes the right to edit at the first edit. It reads pages, edits, paints and undoes, so that no frame waits for the disk.
//!
//! The window sends orders and takes their results, frame by frame, in the order in which they were given. Edits are in memory before they are seen. A stroke is committed when it
//! ends, by a second thread, while the next stroke may be under way already. **What is reported as saved is on the disk.** Closing the workshop waits for this.
//!
//! An edit that the file's records cannot hold makes the thread rewrite the file (`bench::room`); the orders after it wait for that, and the window does not.
//!
//! A thread that cannot start is an error message, and the next edit tries again. If the thread ends unexpectedly, a message says how much was not on the disk, and edits are refused until the
//! terrain is opened again. Before that, what was being written is written, and the right to edit is given back. Cost: a message an order and one back, with the pages that changed.

mod bench;
mod news;
#[cfg(test)]
mod tests;
mod writer;

pub(crate) use news::{News, Seen};

use bench::{Bench, Desk};
use news::{Order, Report, Tally};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::JoinHandle;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Edit, EditSession};
use terrasoar_layout::file::header::FileState;
use terrasoar_layout::imagery::Paint;
use terrasoar_layout::read::terrain::Terrain;

/// Opens the session, on the workshop's thread.
type Open = Arc<dyn Fn() -> Result<EditSession, LayoutError> + Send + Sync>;
/// Tells the window that there are news, from any thread.
type Wake = Arc<dyn Fn() + Send + Sync>;
/// Starts a thread of a name.
type Spawn = fn(&str, Box<dyn FnOnce() + Send>) -> io::Result<JoinHandle<()>>;

/// Edits of the terrain on show.
pub(crate) struct Workshop {
    state: State,
    path: PathBuf,
    /// State of the file that is on show, edits included.
    on_show: FileState,
    open: Open,
    wake: Wake,
    spawn: Spawn,
}

/// Who has the right to edit.
enum State {
    /// No thread has it; the next order takes it.
    Closed,
    /// A thread.
    Open(Worker),
    /// No thread can have it until the terrain is opened again, because what is on show is not what is in the file. The text says why.
    Broken(String),
}

/// The thread, as the window knows it.
struct Worker {
    orders: Sender<Order>,
    reports: Receiver<Report>,
    thread: Option<JoinHandle<()>>,
    /// What was ordered.
    sent: Tally,
    /// What of that is done.
    done: Tally,
}

impl Workshop {
    /// A workshop for `terrain`, an overlay of it if it has one. `wake` is called whenever there are news.
    pub(crate) fn new(terrain: &Terrain, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (base, path) = (terrain.base_path().map(Path::to_path_buf), terrain.path().to_path_buf());
        let open = move || match &base {
            Some(base) => EditSession::open_overlay(base, &path),
            None => EditSession::open(&path),
        };
        Self::with(terrain, Arc::new(open), Arc::new(wake), spawn)
    }

    /// A workshop for `terrain` that edits nothing, and says `why`.
    pub(crate) fn closed(
        terrain: &Terrain,
        why: &'static str,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let open = move || Err(LayoutError::Usage(why.into()));
        Self::with(terrain, Arc::new(open), Arc::new(wake), spawn)
    }

    fn with(terrain: &Terrain, open: Open, wake: Wake, spawn: Spawn) -> Self {
        let (path, on_show) = (terrain.path().to_path_buf(), terrain.header().state());
        Self { state: State::Closed, path, on_show, open, wake, spawn }
    }

    /// Has edits applied, and paint on the picture. Of a stroke of which something was refused nothing more is applied.
    ///
    /// # Errors
    /// Why there can be no edits now, as a message.
    pub(crate) fn apply(&mut self, stroke: u64, edits: Vec<Edit>, paints: Vec<Paint>) -> Result<(), String> {
        let worker = self.worker()?;
        worker.sent.orders += 1;
        worker.sent.edits += edits.len() as u64;
        worker.send(Order::Apply { stroke, edits, paints });
        Ok(())
    }

    /// Has everything so far written to the disk, as one batch that `label` describes; nothing if there are no edits.
    pub(crate) fn commit(&mut self, label: &str) {
        if let State::Open(worker) = &self.state {
            worker.send(Order::Commit { label: label.to_owned() });
        }
    }

    /// Has the last commit taken `back`, or brought back again.
    ///
    /// # Errors
    /// As [`Workshop::apply`].
    pub(crate) fn turn(&mut self, back: bool) -> Result<(), String> {
        let worker = self.worker()?;
        worker.sent.orders += 1;
        worker.send(Order::Turn { back });
        Ok(())
    }

    /// What has become of orders, the oldest news first; never waits.
    pub(crate) fn take(&mut self) -> Option<News> {
        let State::Open(worker) = &self.state else { return None };
        match worker.reports.try_recv() {
            Ok(report) => Some(self.note(report)),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(News::Broken(self.come_to_an_end())),
        }
    }

    /// Waits until all orders are carried out and all edits are on the disk, and gives the right back. What has become of the orders comes with it.
    ///
    /// # Errors
    /// What could not be saved, as a message.
    pub(crate) fn close(&mut self) -> (Vec<News>, Result<(), String>) {
        let mut news = Vec::new();
        if let State::Open(worker) = &self.state {
            worker.send(Order::Close);
        }
        while let State::Open(worker) = &self.state {
            let Ok(report) = worker.reports.recv() else {
                return (news, Err(self.come_to_an_end()));
            };
            let unsaved = worker.sent.edits - report.done.saved;
            match self.note(report) {
                News::Closed(None) => {}
                News::Closed(Some(error)) => {
                    return (news, Err(format!("{error}; {}", lost(unsaved))));
                }
                News::NotOpened(error) => return (news, Err(error.to_string())),
                News::Broken(words) => return (news, Err(words)),
                other => news.push(other),
            }
        }
        (news, Ok(()))
    }

    /// Whether edits are not on the disk yet.
    pub(crate) fn is_unsaved(&self) -> bool {
        matches!(&self.state, State::Open(worker) if worker.unsaved() > 0)
    }

    /// Batches, undos and redos that nothing is known of yet.
    pub(crate) fn in_flight(&self) -> u64 {
        match &self.state {
            State::Open(worker) => worker.sent.orders - worker.done.orders,
            State::Closed | State::Broken(_) => 0,
        }
    }

    /// The thread, started if need be.
    fn worker(&mut self) -> Result<&mut Worker, String> {
        let opened = match std::mem::replace(&mut self.state, State::Closed) {
            State::Open(worker) => worker,
            State::Closed => self.start()?,
            State::Broken(why) => {
                self.state = State::Broken(why.clone());
                return Err(format!("{why}; open the terrain again to edit it"));
            }
        };
        self.state = State::Open(opened);
        match &mut self.state {
            State::Open(worker) => Ok(worker),
            State::Closed | State::Broken(_) => Err("there is nobody to edit".into()),
        }
    }

    fn start(&self) -> Result<Worker, String> {
        let (orders, received) = channel();
        let (sender, reports) = channel();
        let desk = Desk::new(sender, Arc::clone(&self.wake), self.on_show);
        let (open, spawn, to_bench) = (Arc::clone(&self.open), self.spawn, orders.clone());
        let life = move || Bench::live(&open, desk, received, to_bench, spawn);
        let thread = spawn("workshop", Box::new(life))
            .map_err(|e| format!("{}: no thread to edit with: {e}", self.path.display()))?;
        let (sent, done) = (Tally::default(), Tally::default());
        Ok(Worker { orders, reports, thread: Some(thread), sent, done })
    }

    /// Takes notice of a report.
    fn note(&mut self, report: Report) -> News {
        let Report { news, done, state } = report;
        self.on_show = state;
        if let State::Open(worker) = &mut self.state {
            worker.done = done;
        }
        match news {
            // Edits that were made and seen are gone with the session.
            News::NotOpened(error) if done.edits > done.saved => {
                News::Broken(self.break_down(&error.to_string()))
            }
            News::Closed(_) | News::NotOpened(_) => {
                // Waits for its last moments: the right to edit is given back then.
                self.state = State::Closed;
                news
            }
            news => news,
        }
    }

    /// The thread has ended unexpectedly; what that means, as a message.
    fn come_to_an_end(&mut self) -> String {
        self.break_down(&format!("{}: editing came to an unexpected end", self.path.display()))
    }

    /// Nobody can edit any more, for this reason; what that means, as a message.
    fn break_down(&mut self, why: &str) -> String {
        let unsaved = match &self.state {
            State::Open(worker) => worker.unsaved(),
            State::Closed | State::Broken(_) => 0,
        };
        let words = format!("{why}; {}", lost(unsaved));
        self.state = State::Broken(words.clone());
        words
    }
}

impl Worker {
    fn send(&self, order: Order) {
        // One that has ended is heard of when its reports are taken.
        let _ = self.orders.send(order);
    }

    /// Edits that are not known to be on the disk.
    fn unsaved(&self) -> u64 {
        self.sent.edits - self.done.saved
    }
}

impl Drop for Worker {
    /// Has all that is under way brought to the disk.
    fn drop(&mut self) {
        self.send(Order::Close);
        if let Some(thread) = self.thread.take() {
            // How it ended was told, or nobody asks.
            let _ = thread.join();
        }
    }
}

/// What it means that so many edits are not known to be on the disk.
fn lost(edits: u64) -> String {
    match edits {
        0 => "all edits before are on the disk".into(),
        1 => "one edit was not told as saved and may be gone".into(),
        _ => format!("{edits} edits were not told as saved and may be gone"),
    }
}

/// A thread of the system's.
fn spawn(name: &str, work: Box<dyn FnOnce() + Send>) -> io::Result<JoinHandle<()>> {
    std::thread::Builder::new().name(name.into()).spawn(work)
}
