//! A file rewritten with room for an edit that its records cannot hold, on a thread of its own, while the ground goes on as it is.
//!
//! The thread has the right to edit meanwhile. It ends the commit under way, rewrites the file, makes the edits again that were not on the disk, then the one that there was no room for, and then carries out
//! the orders that came meanwhile, commits included. So a ticket may be waited for without another update. At the end it has ground of the new file ready, with the pages that the last view
//! needs, and the next update goes on with that.
//!
//! Invariants: orders are carried out in the order in which they come. **Nothing is told as saved that is not on the disk.** An error leaves the file as it was, or is told with the number of edits
//! that are lost by it. Cost: that of a build from records, and a second pool of pages at the end; frames have no part in it.

mod desk;

pub(super) use desk::Order;

use super::engine::MeshEngine;
use super::hand::{Batches, Failed, Gone, Hand, Places};
use super::options::StreamOptions;
use super::streamed::streamed;
use super::ticket::{CommitFailed, Promise};
use crate::refine::Culling;
use crate::stream::GroundPatch;
use crate::view::View;
use desk::Desk;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{Edit, SampleRect, overlays_beside};
use terrasoar_layout::read::terrain::Terrain;

/// Times that one batch may make the file be rewritten: once for heights, once for slopes, and one to spare.
const MOST_WIDENINGS: u32 = 3;
/// How often the new ground is looked at while pages come.
const PAGES_COME: Duration = Duration::from_millis(2);

/// What became of the ground, in its order.
pub(super) enum Step {
    /// It was edited.
    Edited(GroundPatch),
    /// Pages lie there in the file now.
    Saved(Places),
}

/// What the thread needs besides the right to edit.
pub(super) struct Plan {
    pub(super) options: StreamOptions,
    /// What the new ground is to have pages for.
    pub(super) view: Option<View>,
}

/// Ground of the file as it was rewritten.
pub(super) struct Shown {
    pub(super) engine: Box<dyn MeshEngine>,
    pub(super) culling: Culling,
    pub(super) terrain: Arc<Terrain>,
}

/// What the thread leaves.
pub(super) struct Made {
    pub(super) hand: Hand,
    /// Other ground, if the file was rewritten.
    pub(super) shown: Option<Shown>,
    /// What the ground, this or the one before, has not heard of.
    pub(super) steps: Vec<Step>,
    /// All samples whose heights may have changed.
    pub(super) samples: Vec<SampleRect>,
}

/// The thread, as the ground knows it.
pub(super) struct Room {
    path: PathBuf,
    desk: Arc<Desk>,
    /// What it leaves; without the right to edit if that is lost, which is told.
    thread: Option<JoinHandle<Result<Made, LayoutError>>>,
}

impl Room {
    /// Has room made for `batch`, which asks for these heights.
    ///
    /// # Errors
    /// The system gives no thread; the right to edit comes back.
    pub(super) fn begin(
        hand: Hand,
        batch: Vec<Edit>,
        heights_m: [f64; 2],
        plan: Plan,
    ) -> Result<Self, (Box<Hand>, LayoutError)> {
        let desk = Arc::new(Desk::default());
        // What it is to have is sent after it, and is not lost if there is no thread.
        let (sender, receiver) = channel::<(Hand, Vec<Edit>)>();
        let (its, path) = (Arc::clone(&desk), hand.path.clone());
        let its_path = path.clone();
        let live = move || {
            let Ok((hand, batch)) = receiver.recv() else { return Err(unexpected(&its_path)) };
            Maker::of(hand, plan, its).live(batch, heights_m)
        };
        let thread = match std::thread::Builder::new().name("make room".into()).spawn(live) {
            Ok(thread) => thread,
            Err(e) => {
                let error = LayoutError::io(&hand.path, "cannot start a thread to rewrite the file with", e);
                return Err((Box::new(hand), error));
            }
        };
        match sender.send((hand, batch)) {
            Ok(()) => Ok(Self { path, desk, thread: Some(thread) }),
            Err(back) => {
                let (hand, _) = back.0;
                let error = unexpected(&hand.path);
                Err((Box::new(hand), error))
            }
        }
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Gives an order; it comes back if the thread takes none any more.
    pub(super) fn give(&self, order: Order) -> Result<(), Order> {
        let mut papers = self.desk.papers();
        if papers.is_closed {
            return Err(order);
        }
        papers.is_saved &= matches!(order, Order::Commit(..));
        papers.orders.push_back(order);
        Ok(())
    }

    /// Whether the thread has come to its end.
    pub(super) fn is_over(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Whether everything so far is on the disk.
    pub(super) fn is_saved(&self) -> bool {
        self.desk.papers().is_saved
    }

    /// The oldest error that has not been told.
    pub(super) fn take_error(&self) -> Option<LayoutError> {
        self.desk.papers().errors.pop_front()
    }

    /// Waits for the thread, and gives what it leaves, errors that have not been told apart.
    ///
    /// # Errors
    /// Why the file cannot be edited any more.
    pub(super) fn end(mut self) -> (Result<Made, LayoutError>, VecDeque<LayoutError>) {
        let ended = self.thread.take().map(JoinHandle::join);
        let made = match ended {
            Some(Ok(made)) => made,
            _ => Err(LayoutError::Usage(format!(
                "{}; edits that were not on the disk are lost",
                unexpected(&self.path)
            ))),
        };
        (made, std::mem::take(&mut self.desk.papers().errors))
    }
}

impl Drop for Room {
    /// All orders are carried out while the right to edit is still held.
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take() {
            // What became of commits their tickets tell.
            let _ = thread.join();
        }
    }
}

/// The thread's side: who edits, and all else.
struct Maker {
    hand: Hand,
    bench: Bench,
}

struct Bench {
    plan: Plan,
    desk: Arc<Desk>,
    /// Whether the file was rewritten.
    is_widened: bool,
    shown: Option<Shown>,
    steps: Vec<Step>,
    samples: Vec<SampleRect>,
}

/// The end of the thread, however it comes: whoever ordered something more hears of it.
struct Closing(Arc<Desk>);

impl Drop for Closing {
    fn drop(&mut self) {
        let mut papers = self.0.papers();
        papers.is_closed = true;
        // Promises tell that by themselves.
        papers.orders.clear();
    }
}

impl Maker {
    fn of(hand: Hand, plan: Plan, desk: Arc<Desk>) -> Self {
        let bench =
            Bench { plan, desk, is_widened: false, shown: None, steps: Vec::new(), samples: Vec::new() };
        Self { hand, bench }
    }

    /// The thread's life.
    fn live(self, batch: Vec<Edit>, heights_m: [f64; 2]) -> Result<Made, LayoutError> {
        let desk = Closing(Arc::clone(&self.bench.desk));
        self.work(batch, heights_m).map_err(|mut gone| {
            let mut papers = desk.0.papers();
            (papers.is_closed, papers.is_saved) = (true, false);
            let orders = std::mem::take(&mut papers.orders);
            drop(papers);
            gone.edits += orders.iter().map(Order::edits).sum::<usize>();
            let error = gone.told();
            for order in orders {
                if let Order::Commit(_, promise) = order {
                    promise.tell(Err(CommitFailed::of(LayoutError::Usage(error.to_string()))));
                }
            }
            error
        })
    }

    fn work(mut self, batch: Vec<Edit>, heights_m: [f64; 2]) -> Result<Made, Gone> {
        match self.hand.end_writing() {
            Ok(places) => self.bench.steps.push(Step::Saved(places)),
            Err(error) => self.tell(error),
        }
        self = self.make(batch, Some(heights_m))?;
        loop {
            let order = self.bench.desk.papers().orders.pop_front();
            match order {
                Some(Order::Edit(batch)) => self = self.make(batch, None)?,
                Some(Order::Commit(label, promise)) => self.commit(&label, &promise),
                None if self.bench.is_widened && self.bench.shown.is_none() => self.show()?,
                None => {
                    let mut papers = self.bench.desk.papers();
                    if papers.orders.is_empty() {
                        papers.is_closed = true;
                        break;
                    }
                }
            }
        }
        let Self { hand, bench: Bench { shown, steps, samples, .. } } = self;
        Ok(Made { hand, shown, steps, samples })
    }

    fn tell(&self, error: LayoutError) {
        self.bench.desk.papers().errors.push_back(error);
    }

    /// Applies a batch; rewrites the file where that is what it takes, at once for heights that are known to have no room.
    fn make(mut self, batch: Vec<Edit>, no_room_m: Option<[f64; 2]>) -> Result<Self, Gone> {
        let mut no_room_m = no_room_m;
        for widenings in 0.. {
            if let Some(heights_m) = no_room_m.take() {
                let made;
                (self, made) =
                    self.widen(heights_m).map_err(|gone| Gone { edits: gone.edits + batch.len(), ..gone })?;
                if let Err(error) = made {
                    self.refuse(error);
                    break;
                }
            }
            match self.hand.apply(&batch) {
                Ok((_, patch)) => {
                    self.edited(patch);
                    break;
                }
                Err(LayoutError::OutOfRange { heights_m, .. }) if widenings < MOST_WIDENINGS => {
                    no_room_m = Some(heights_m);
                }
                Err(error) => {
                    self.refuse(error);
                    break;
                }
            }
        }
        Ok(self)
    }

    fn edited(&mut self, patch: GroundPatch) {
        self.bench.samples.extend(&patch.samples);
        self.bench.steps.push(Step::Edited(patch));
    }

    /// Tells why a batch is not made, by the next commit's ticket as well.
    fn refuse(&mut self, error: LayoutError) {
        self.hand.refused = Some(CommitFailed::of(LayoutError::Usage(error.to_string())));
        self.tell(error);
    }

    /// Rewrites the file with room for these heights, and makes again what was not on the disk. What became of it comes with the maker: after an error all is as before.
    fn widen(self, heights_m: [f64; 2]) -> Result<(Self, Result<(), LayoutError>), Gone> {
        // A core is left to those who fly on.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let pool = match rayon::ThreadPoolBuilder::new().num_threads((cores - 1).max(1)).build() {
            Ok(pool) => pool,
            Err(e) => {
                let what = "cannot start threads to rewrite the file with";
                let error = LayoutError::io(&self.hand.path, what, std::io::Error::other(e));
                return Ok((self, Err(error)));
            }
        };
        let Self { hand, mut bench } = self;
        let memory_mib = bench.plan.options.room_mib;
        match pool.install(|| hand.widened(heights_m, memory_mib)) {
            Ok((hand, batches)) => {
                // What was to be shown of the file before is in the new one.
                (bench.is_widened, bench.shown) = (true, None);
                bench.steps.clear();
                Ok((Self { hand, bench }.make_again(batches), Ok(())))
            }
            Err(Failed::Back(hand, error)) => Ok((Self { hand: *hand, bench }, Err(error))),
            Err(Failed::Gone(gone)) => Err(gone),
        }
    }

    fn make_again(mut self, batches: Batches) -> Self {
        for batch in batches {
            match self.hand.apply(&batch) {
                Ok((_, patch)) => self.edited(patch),
                Err(error) => self.refuse(error),
            }
        }
        self
    }

    fn commit(&mut self, label: &str, promise: &Promise) {
        match self.hand.commit_now(label) {
            Ok((saved, places)) => {
                self.bench.steps.push(Step::Saved(places));
                let mut papers = self.bench.desk.papers();
                papers.is_saved = !papers.orders.iter().any(|order| matches!(order, Order::Edit(_)));
                drop(papers);
                promise.tell(self.hand.refused.take().map_or(Ok(saved), Err));
            }
            Err(error) => {
                let failed = CommitFailed::of(error);
                self.tell(LayoutError::Usage(format!(
                    "{failed}; the edits are in memory, and part of the next commit"
                )));
                promise.tell(Err(failed));
            }
        }
    }

    /// Gets ground of the file ready as it is now.
    ///
    /// # Errors
    /// Damage and I/O. All edits are on the disk then, if that can be.
    fn show(&mut self) -> Result<(), Gone> {
        match self.new_ground() {
            Ok(shown) => {
                self.bench.shown = Some(shown);
                self.bench.steps.clear();
                Ok(())
            }
            Err(error) => Err(self.save_all(&error)),
        }
    }

    /// Takes no more orders, carries out those that came meanwhile, without rewriting the file again, and brings everything to the disk. What `error` is told with.
    fn save_all(&mut self, error: &LayoutError) -> Gone {
        let orders = {
            let mut papers = self.bench.desk.papers();
            papers.is_closed = true;
            std::mem::take(&mut papers.orders)
        };
        for order in orders {
            match order {
                Order::Edit(batch) => match self.hand.apply(&batch) {
                    Ok((_, patch)) => self.edited(patch),
                    Err(error) => self.refuse(error),
                },
                Order::Commit(label, promise) => self.commit(&label, &promise),
            }
        }
        let (words, edits) = match self.hand.commit_now("edits") {
            Ok(_) => (format!("{error}; all edits that were made are on the disk"), 0),
            Err(other) => (format!("{error}; {other}"), self.hand.unsaved_edits()),
        };
        Gone { error: LayoutError::Usage(words), edits }
    }

    fn new_ground(&self) -> Result<Shown, LayoutError> {
        let terrain = Arc::new(Terrain::open_unmapped(&self.hand.path)?);
        let options = self.bench.plan.options;
        let mut engine = streamed(&terrain, &options)?;
        engine.take_edits(self.hand.uncommitted())?;
        if let Some(view) = &self.bench.plan.view {
            let begun = Instant::now();
            engine.update(view);
            while engine.is_waiting() && begun.elapsed() < options.first_wait {
                std::thread::sleep(PAGES_COME);
                engine.update(view);
            }
        }
        Ok(Shown { engine, culling: options.culling, terrain })
    }
}

/// Refuses to rewrite a file where something would be lost by that, for the reason `problem`.
///
/// # Errors
/// [`LayoutError::OutOfRange`] for an overlay, whose records are of its terrain's scale, and for a terrain with overlays beside it, which could not be seen over it any more.
pub(super) fn check_rewritable(
    terrain: &Terrain,
    heights_m: [f64; 2],
    problem: &str,
) -> Result<(), LayoutError> {
    let path = terrain.path();
    let refusal = |what: String| {
        Err(LayoutError::OutOfRange {
            path: path.to_owned(),
            heights_m,
            problem: format!("{problem}; {what}"),
        })
    };
    if let Some(base) = terrain.base_path() {
        return refusal(format!(
            "an overlay cannot change that: make one file of it and {} (compact), and edit that",
            base.display()
        ));
    }
    match overlays_beside(path).first() {
        None => Ok(()),
        Some(overlay) => refusal(format!(
            "here that is not done, because the edits kept apart from the file would be lost: {}; put them into a file of their own first (compact)",
            overlay.display()
        )),
    }
}

fn unexpected(path: &Path) -> LayoutError {
    let end = std::io::Error::other("rewriting it came to an unexpected end; open it again");
    LayoutError::io(path, "cannot edit the file any more", end)
}

#[cfg(test)]
mod tests;
