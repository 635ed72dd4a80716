//! The workshop's thread: the session that edits, and what it does with each order.
//!
//! Invariants: orders are carried out in the order in which they come. Nothing is reported as saved before the second thread has written it. An undo is done after everything
//! before it is on the disk. Cost: the session's own, and a copy of each page that changed.

mod room;

use super::news::{News, Order, Report, Seen, Tally};
use super::writer::Writer;
use super::{Open, Spawn, Wake};
use crate::window::threads;
use rayon::ThreadPool;
use std::collections::{BTreeSet, VecDeque};
use std::sync::mpsc::{Receiver, Sender};
use terrasoar::stream::GroundPatch;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Changes, CommitJob, Edit, EditSession};
use terrasoar_layout::file::header::FileState;
use terrasoar_layout::imagery::Paint;
use terrasoar_scene::repaint::{PictureWatch, Repaint};

/// Threads that encode and check painted tiles of a commit.
const HELPERS: usize = 2;

/// What the thread has.
pub(super) struct Bench {
    /// Dropped before the session, whose lock outlives what is being written.
    writer: Writer,
    session: EditSession,
    /// What parts of the session's work are shared out to. Frames have another.
    helpers: ThreadPool,
    picture: PictureWatch,
    orders: Receiver<Order>,
    /// Orders that came while something was waited for.
    kept: VecDeque<Order>,
    writing: Writing,
    /// What is not on the disk yet.
    batches: VecDeque<Batch>,
    /// The stroke of which something was refused last.
    refused: Option<u64>,
    desk: Desk,
}

/// Edits and paint that are applied together.
struct Batch {
    edits: Vec<Edit>,
    paints: Vec<Paint>,
}

/// What is on its way to the disk.
enum Writing {
    /// Nothing.
    Idle,
    /// The first so many edits, and the first so many batches of those that are not on the disk; what is to follow has this label.
    UnderWay { edits: u64, batches: usize, next: Option<String> },
}

/// Where reports go, and what is in all of them.
pub(super) struct Desk {
    reports: Sender<Report>,
    wake: Wake,
    done: Tally,
    state: FileState,
}

impl Desk {
    /// A desk for a file on show in this state.
    pub(super) fn new(reports: Sender<Report>, wake: Wake, state: FileState) -> Self {
        Self { reports, wake, done: Tally::default(), state }
    }

    fn report(&self, news: News) {
        // A window that has gone hears nothing.
        let _ = self.reports.send(Report { news, done: self.done, state: self.state });
        (self.wake)();
    }
}

impl Drop for Desk {
    /// That there will be no more reports is news.
    fn drop(&mut self) {
        (self.wake)();
    }
}

impl Bench {
    /// The thread's life.
    pub(super) fn live(
        open: &Open,
        desk: Desk,
        orders: Receiver<Order>,
        to_bench: Sender<Order>,
        spawn: Spawn,
    ) {
        match open_session(open, desk.state).and_then(|session| parts(session, to_bench, spawn)) {
            Err(error) => desk.report(News::NotOpened(error)),
            Ok((session, writer, helpers)) => {
                let bench = Self {
                    writer,
                    session,
                    helpers,
                    picture: PictureWatch::default(),
                    orders,
                    kept: VecDeque::new(),
                    writing: Writing::Idle,
                    batches: VecDeque::new(),
                    refused: None,
                    desk,
                };
                bench.run(open);
            }
        }
    }

    fn run(mut self, open: &Open) {
        while let Some(order) = self.kept.pop_front().or_else(|| self.orders.recv().ok()) {
            match order {
                Order::Apply { stroke, edits, paints } => {
                    match self.apply(stroke, Batch { edits, paints }, open) {
                        Some(bench) => self = bench,
                        None => return,
                    }
                }
                Order::Commit { label } => self.commit(label),
                Order::Turn { back } => self.turn(back),
                Order::Written(job, outcome) => {
                    let next = self.next_label();
                    if let Err(error) = self.written(*job, outcome) {
                        self.desk.report(News::NotSaved(error));
                    }
                    if let Some(label) = next {
                        self.commit(label);
                    }
                }
                Order::Close => {
                    let closed = self.settle().err();
                    self.desk.report(News::Closed(closed));
                    return;
                }
            }
        }
    }

    /// Applies a batch; the file is rewritten for it where that is what it takes. `None` if there is no session any more, which is told.
    fn apply(mut self, stroke: u64, batch: Batch, open: &Open) -> Option<Self> {
        let edits = batch.edits.len() as u64;
        let mut news = News::Nothing;
        if self.refused != Some(stroke) {
            let mut done = self.try_to(&batch);
            let mut widenings = 0;
            while let Err(LayoutError::OutOfRange { heights_m, problem, .. }) = &done
                && widenings < room::MOST_WIDENINGS
            {
                widenings += 1;
                let (bench, made) = self.make_room(*heights_m, problem, open)?;
                self = bench;
                done = made.and_then(|()| self.try_to(&batch));
            }
            news = match done {
                Ok(seen) => {
                    self.batches.push_back(batch);
                    News::Edited(seen)
                }
                Err(error) => {
                    self.refused = Some(stroke);
                    News::Refused(error)
                }
            };
        }
        self.desk.done.orders += 1;
        self.desk.done.edits += edits;
        self.desk.report(news);
        Some(self)
    }

    fn try_to(&mut self, batch: &Batch) -> Result<Box<Seen>, LayoutError> {
        let (changes, _) = self.session.apply_and_paint(&batch.edits, &batch.paints)?;
        Ok(Box::new(self.seen(&changes)))
    }

    fn commit(&mut self, label: String) {
        if let Writing::UnderWay { next, .. } = &mut self.writing {
            *next = Some(label);
            return;
        }
        match self.begin(&label) {
            Ok(true) => {}
            Ok(false) => self.desk.report(News::Nothing),
            Err(error) => self.desk.report(News::NotSaved(error)),
        }
    }

    /// Begins to write everything that is not on the disk. Whether there is anything.
    fn begin(&mut self, label: &str) -> Result<bool, LayoutError> {
        let (helpers, session) = (&self.helpers, &mut self.session);
        let edits = self.desk.done.edits;
        match helpers.install(|| session.prepare_commit(label))? {
            Some(job) => {
                self.writing = Writing::UnderWay { edits, batches: self.batches.len(), next: None };
                self.writer.write(job);
                Ok(true)
            }
            None => {
                self.batches.clear();
                self.desk.done.saved = edits;
                Ok(false)
            }
        }
    }

    /// The label of the commit that is to follow the one under way.
    fn next_label(&mut self) -> Option<String> {
        match &mut self.writing {
            Writing::UnderWay { next, .. } => next.take(),
            Writing::Idle => None,
        }
    }

    /// A commit has been written, or has not.
    fn written(&mut self, job: CommitJob, outcome: Result<(), LayoutError>) -> Result<(), LayoutError> {
        let writing = std::mem::replace(&mut self.writing, Writing::Idle);
        let committed = self.session.finish_commit(job, outcome)?;
        if let Writing::UnderWay { edits, batches, .. } = writing {
            self.batches.drain(..batches);
            self.desk.done.saved = edits;
        }
        self.desk.state = self.session.header().state();
        // What was edited meanwhile is not what the file has.
        let edited: BTreeSet<u64> = self.session.editor().uncommitted().into_iter().collect();
        let mut places = committed.places;
        places.retain(|(page, _)| !edited.contains(page));
        let picture = self.look();
        self.desk.report(News::Saved { places, picture });
        Ok(())
    }

    /// Waits until everything is on the disk.
    fn settle(&mut self) -> Result<(), LayoutError> {
        let mut label = self.next_label();
        loop {
            self.wait_for_writing()?;
            if !self.begin(label.take().as_deref().unwrap_or("edits"))? {
                return Ok(());
            }
        }
    }

    /// Waits until the commit under way is written. Orders that come meanwhile are kept.
    fn wait_for_writing(&mut self) -> Result<(), LayoutError> {
        while let Writing::UnderWay { .. } = self.writing {
            match self.orders.recv() {
                Ok(Order::Written(job, outcome)) => self.written(*job, outcome)?,
                Ok(order) => self.kept.push_back(order),
                // The second thread has a sender, and ends only after this one.
                Err(_) => return Ok(()),
            }
        }
        Ok(())
    }

    fn turn(&mut self, back: bool) {
        let settled = self.settle();
        self.desk.done.orders += 1;
        let turned = settled.and_then(|()| if back { self.session.undo() } else { self.session.redo() });
        self.desk.state = self.session.header().state();
        let news = match turned {
            Ok(None) => News::NothingToTurn { back },
            Err(error) => News::NotTurned(error),
            Ok(Some(changes)) => {
                let mut seen = self.seen(&changes);
                let place = |page: &u64| (*page, self.session.place_of(*page));
                seen.ground.places = changes.pages.iter().map(place).collect();
                News::Turned { back, seen: Box::new(seen) }
            }
        };
        self.desk.report(news);
    }

    /// What became of ground and picture, pages included.
    fn seen(&mut self, changes: &Changes) -> Seen {
        let editor = self.session.editor();
        let mut trouble = None;
        let mut pages = Vec::with_capacity(changes.pages.len());
        for page in &changes.pages {
            // One that is in the file need not be in memory.
            let bytes = editor
                .edited_page(*page)
                .map(|bytes| Box::new(*bytes))
                .map_or_else(|| editor.terrain().checked_page_at(*page, self.session.place_of(*page)), Ok);
            match bytes {
                Ok(bytes) => pages.push((*page, bytes)),
                Err(error) => trouble = Some(error),
            }
        }
        let height_range_m = editor.header().height_range_m;
        let ground =
            GroundPatch { samples: changes.samples.clone(), pages, height_range_m, places: Vec::new() };
        let picture = self.look().unwrap_or_else(|error| {
            trouble.get_or_insert(error);
            None
        });
        Seen { ground, picture, trouble }
    }

    fn look(&mut self) -> Result<Option<Box<Repaint>>, LayoutError> {
        Ok(self.picture.look(&mut self.session)?.map(Box::new))
    }
}

/// Opens the session of a file that is on show in this state.
fn open_session(open: &Open, state: FileState) -> Result<EditSession, LayoutError> {
    let session = open()?;
    if session.header().state() == state {
        return Ok(session);
    }
    Err(LayoutError::Usage(format!(
        "{}: another program has edited it since it was opened; open it again",
        session.editor().terrain().path().display()
    )))
}

/// What a bench needs besides.
fn parts(
    session: EditSession,
    to_bench: Sender<Order>,
    spawn: Spawn,
) -> Result<(EditSession, Writer, ThreadPool), LayoutError> {
    let path = session.editor().terrain().path().to_path_buf();
    let no_thread = |e| LayoutError::io(&path, "cannot start a thread that writes", e);
    let writer = Writer::start(spawn, path.clone(), session.disk(), to_bench).map_err(no_thread)?;
    let helpers = threads::pool("workshop helper", HELPERS).map_err(no_thread)?;
    Ok((session, writer, helpers))
}
