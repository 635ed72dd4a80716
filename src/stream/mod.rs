//! Flying over a terrain of which only some pages are in memory, without waiting for any.
//!
//! In a frame, pages that have come are put into the pool. The engine refines with what is there. Then it asks for the pages that it lacks or will need, each with the frame by which
//! it is needed. Where a page is late, the ground stays coarse, without cracks, and its error is reported; it becomes fine once the page has come. A page that cannot be read is
//! reported once and tried again later.
//!
//! Invariant: nothing here waits for storage but [`Streamed::fill`]. Once all has come the mesh is the one that an engine over the whole file makes. Cost beside the
//! engine's: a copy of 4 KiB for each page that comes, and a look into a table for each page that is asked for.

mod edited;
mod fetch;
mod frustum;
mod lead;
mod model;
mod requests;
mod surface;

pub use edited::GroundPatch;
pub use fetch::{Fetch, ThreadFetch};
pub use frustum::ExtendedView;
pub use model::ModelDisk;
pub use surface::{HeightAt, height_at};

use crate::refine::change::GroundChange;
use crate::refine::kinetic::Kinetic;
use crate::refine::{Culling, Engine, Probe, Work};
use crate::view::View;
use edited::EditedPages;
use lead::Lead;
use requests::Requests;
use std::collections::{HashMap, VecDeque};
use std::time::Duration;
#[cfg(not(all(target_family = "wasm", target_os = "unknown")))]
use std::time::Instant;
use terrasoar_layout::edit::{Changes, Editor};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::bytes::Page;
use terrasoar_layout::file::entries::Entry;
use terrasoar_layout::grid::record::RecordCodec;
use terrasoar_layout::read::loader::Outcome;
use terrasoar_layout::read::pool::PagePool;
use terrasoar_layout::read::store::RecordStore;
#[cfg(all(target_family = "wasm", target_os = "unknown"))]
use web_time::Instant;

/// Pages put into the pool in one frame at most: two megabytes are copied in a fraction of a millisecond.
const INSTALLS_A_FRAME: usize = 512;
/// How many errors are kept.
const ERRORS_KEPT: usize = 64;

/// How pages are asked for before they are needed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Prefetch {
    /// Not at all: a page is asked for when the mesh lacks it.
    None,
    /// What an extension of the view frustum needs, after Qiu et al., section 4. For comparison.
    Frustum,
    /// By deadline: what the live ranges say will be needed, the earliest first.
    #[default]
    Deadline,
}

impl Prefetch {
    /// All ways.
    pub const ALL: [Self; 3] = [Self::None, Self::Frustum, Self::Deadline];

    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Frustum => "frustum",
            Self::Deadline => "deadline",
        }
    }
}

/// What a frame had to do with storage.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StreamFrame {
    /// The engine's account.
    pub work: Work,
    /// Records that entered the mesh's array.
    pub records_read: u64,
    /// Distinct pages of them.
    pub pages_read: u64,
    /// Pages that the mesh lacked for the first time in this frame: those that came too late, or were not foreseen.
    pub late_pages: u64,
    /// Pages asked for.
    pub pages_asked: u64,
    /// Pages that came.
    pub pages_come: u64,
    /// Pages that could not be read.
    pub failures: u64,
    /// Pages asked for that have not come yet.
    pub outstanding: u64,
    /// Frames that pages are asked for ahead of need.
    pub lead_frames: f32,
}

/// The kinetic engine over a pool, and what fills it.
#[derive(Debug)]
pub struct Streamed<C: RecordCodec, F> {
    engine: Kinetic<PagePool<C>>,
    fetch: F,
    prefetch: Prefetch,
    culling: Culling,
    /// How far the frustum is moved back for preloading.
    block_m: f64,
    last_view: Option<View>,
    /// Pages that the frustum's extension lacks.
    extension: Vec<u64>,
    lead: Lead,
    requests: Requests,
    now: u64,
    errors: VecDeque<LayoutError>,
    pages_read: Vec<u64>,
    /// Pages wanted by others than the engine.
    wanted: Vec<(u64, f32)>,
    edited: EditedPages,
}

/// Remembers pages read, and hands on.
struct PagesRead<'p, C, P> {
    pages: &'p mut Vec<u64>,
    reads: u64,
    probe: &'p mut P,
    codec: std::marker::PhantomData<C>,
}

impl<C: RecordCodec, P: Probe> Probe for PagesRead<'_, C, P> {
    fn read(&mut self, slot: u64) {
        self.reads += 1;
        let page = PagePool::<C>::page_of(slot);
        if self.pages.last() != Some(&page) {
            self.pages.push(page);
        }
        self.probe.read(slot);
    }

    fn phase(&mut self, phase: crate::refine::Phase) {
        self.probe.phase(phase);
    }
}

impl<C: RecordCodec, F: Fetch> Streamed<C, F> {
    /// An engine over `pool`, whose pages come through `fetch`.
    pub fn new(pool: PagePool<C>, fetch: F, culling: Culling, prefetch: Prefetch) -> Self {
        let block_m = ExtendedView::block_m(pool.grid());
        let mut engine = Kinetic::new(pool, culling);
        let lead = Lead::default();
        if prefetch == Prefetch::Deadline {
            engine.look_ahead(lead.frames());
        }
        Self {
            engine,
            fetch,
            prefetch,
            culling,
            block_m,
            last_view: None,
            extension: Vec::new(),
            lead,
            requests: Requests::default(),
            now: 0,
            errors: VecDeque::new(),
            pages_read: Vec::new(),
            wanted: Vec::new(),
            edited: EditedPages::default(),
        }
    }

    /// Moves the frustum back by so many metres for [`Prefetch::Frustum`], instead of [`ExtendedView::block_m`].
    pub fn set_block_m(&mut self, block_m: f64) {
        self.block_m = block_m;
    }

    /// The engine: its mesh and patch.
    pub fn engine(&self) -> &Kinetic<PagePool<C>> {
        &self.engine
    }

    /// The engine, to be given a budget.
    pub(crate) fn engine_mut(&mut self) -> &mut Kinetic<PagePool<C>> {
        &mut self.engine
    }

    /// What fetches the pages.
    pub fn fetch(&self) -> &F {
        &self.fetch
    }

    /// Asks for a page besides those that the engine wants: for what else is made of a terrain's records.
    pub fn want(&mut self, page: u64, in_frames: f32) {
        self.wanted.push((page, in_frames));
    }

    /// Asks for what the exact height at a place, in metres east and north, needs.
    pub fn want_height(&mut self, east_m: f64, north_m: f64) {
        let wanted = &mut self.wanted;
        surface::pages_away(self.engine.store(), east_m, north_m, |page| wanted.push((page, 0.0)));
    }

    /// Whether pages were asked for since the last update, which it knows nothing of yet.
    pub(crate) fn has_wants(&self) -> bool {
        !self.wanted.is_empty()
    }

    /// Whether a page could not be read when it was last tried.
    pub fn is_in_trouble(&self, page: u64) -> bool {
        self.requests.is_in_trouble(page)
    }

    /// The oldest error that has not been reported yet. A page that cannot be read is reported once, however often it is tried.
    pub fn take_error(&mut self) -> Option<LayoutError> {
        self.errors.pop_front()
    }

    /// Refines the mesh for `view` with the pages in memory. It never waits.
    pub fn update<P: Probe>(&mut self, view: &View, probe: &mut P) -> StreamFrame {
        self.now += 1;
        let mut frame = StreamFrame::default();
        self.take_pages(&mut frame);
        if self.prefetch == Prefetch::Deadline {
            self.engine.look_ahead(self.lead.frames());
        }
        self.pages_read.clear();
        let mut listener = PagesRead::<C, P> {
            pages: &mut self.pages_read,
            reads: 0,
            probe,
            codec: std::marker::PhantomData,
        };
        self.engine.update(view, &mut listener);
        frame.records_read = listener.reads;
        self.pages_read.sort_unstable();
        self.pages_read.dedup();
        self.ask(view, &mut frame);
        frame.work = self.engine.work();
        frame.pages_read = self.pages_read.len() as u64;
        frame.outstanding = self.requests.outstanding() as u64;
        frame.lead_frames = self.lead.frames();
        frame
    }

    /// Takes over edits of the ground that `editor` has made, as [`Streamed::take_ground`] does, with copies of the pages.
    ///
    /// # Errors
    /// As [`Streamed::take_ground`].
    pub fn ground_changed(&mut self, changes: &Changes, editor: &Editor) -> Result<(), LayoutError> {
        self.take_ground(GroundPatch::of(changes, editor))
    }

    /// Takes over edits of the ground: the next update's mesh is the one over the edited ground, as far as its pages are at hand. Pages that come from the
    /// file later are replaced by what the edits made of them, until they are committed ([`Streamed::relocate`]).
    ///
    /// # Errors
    /// [`LayoutError::Usage`] if the changes are of another terrain.
    pub fn take_ground(&mut self, patch: GroundPatch) -> Result<(), LayoutError> {
        let GroundPatch { samples, pages, height_range_m, places } = patch;
        let pool = self.engine.store_mut();
        pool.set_height_range_m(height_range_m);
        for (page, bytes) in &pages {
            pool.set_present(*page, true);
            if pool.is_resident(*page) {
                pool.install(*page, bytes)?;
            }
        }
        let now: HashMap<u64, &Page> = pages.iter().map(|(page, bytes)| (*page, &**bytes)).collect();
        let page = |logical: u64| now.get(&logical).copied();
        self.engine.ground_changed(&GroundChange { areas: &samples, height_range_m, page: &page });
        pages.into_iter().for_each(|(page, bytes)| self.edited.keep(page, bytes));
        self.relocate(&places);
        Ok(())
    }

    /// Pages are in the file now, at these places, as they were told last: copies of them are dropped, and they are read from there.
    pub fn relocate(&mut self, places: &[(u64, Entry)]) {
        self.fetch.relocate(places);
        for (page, entry) in places {
            self.edited.forget(*page);
            self.requests.moved(*page);
            self.engine.store_mut().set_present(*page, entry.is_present());
        }
    }

    /// Edited pages kept in memory beside the pool, for they are not in the file yet.
    pub fn held_pages(&self) -> usize {
        self.edited.len()
    }

    /// Culls in another way from now on. The mesh is made anew by the next update, of the pages at hand, as in a first frame; the engine has no budget then.
    pub fn set_culling(&mut self, culling: Culling) {
        let pool = self.engine.store_mut().take();
        self.engine = Kinetic::new(pool, culling);
        self.culling = culling;
        if self.prefetch == Prefetch::Deadline {
            self.engine.look_ahead(self.lead.frames());
        }
    }

    /// Updates until the mesh of `view` lacks no page that can be read, waiting for those that come, `longest` at most. For the first frame of a flight: patches
    /// of the updates on the way are lost, the whole mesh is to be asked for. Returns the number of updates.
    pub fn fill<P: Probe>(&mut self, view: &View, longest: Duration, probe: &mut P) -> u64 {
        let (start, begun) = (self.now, Instant::now());
        let mut least_late = u64::MAX;
        loop {
            let frame = self.update(view, probe);
            if frame.work.late == 0 || begun.elapsed() >= longest {
                return self.now - start;
            }
            let got_on = frame.work.late < least_late || frame.work.slots_written > 0;
            least_late = least_late.min(frame.work.late);
            if frame.work.unread == 0 && !got_on {
                // No page is lacking, and what is left stays as it is: records that are not nested want vertices whose parents are not wanted. Pages on their way are for
                // later views, and a pool that is too small for them has always one to come.
                return self.now - start;
            }
            if frame.outstanding > 0 {
                self.fetch.wait();
            } else if frame.pages_come == 0 && frame.work.unread > 0 && !self.fetch.has_arrivals() {
                // The pages that are left cannot be read.
                return self.now - start;
            }
        }
    }

    /// Puts into the pool what has come.
    fn take_pages(&mut self, frame: &mut StreamFrame) {
        for _ in 0..INSTALLS_A_FRAME {
            let Some(arrival) = self.fetch.take(self.now) else { break };
            match arrival.outcome {
                Outcome::Read(page) => {
                    if let Some(frames) = self.requests.came(arrival.page, self.now) {
                        self.lead.came_after(frames);
                    }
                    frame.pages_come += 1;
                    // What the file holds may be what was there before an edit.
                    let page = self.edited.get(arrival.page).unwrap_or(&page);
                    // Only pages that exist are asked for.
                    if let Err(error) = self.engine.store_mut().install(arrival.page, page) {
                        self.keep(error);
                    }
                }
                Outcome::Failed(error) => {
                    frame.failures += 1;
                    if self.requests.failed(arrival.page, self.now) {
                        self.keep(error);
                    }
                }
                Outcome::Dropped => self.requests.dropped(arrival.page),
            }
        }
    }

    fn keep(&mut self, error: LayoutError) {
        if self.errors.len() < ERRORS_KEPT {
            self.errors.push_back(error);
        }
    }

    /// Asks for what the engine wants, and for what the frustum's extension needs.
    fn ask(&mut self, view: &View, frame: &mut StreamFrame) {
        let mut asked = std::mem::take(&mut self.requests.asked);
        asked.clear();
        let pool = self.engine.store();
        for want in self.engine.wants() {
            // A page may have been given up, or put in, since.
            if pool.is_resident(want.page) || self.edited.bring(want.page) {
                continue;
            }
            asked.extend(self.requests.ask(want.page, self.now, want.in_frames));
            frame.late_pages += u64::from(want.is_lacking && self.requests.is_newly_late(want.page));
        }
        for (page, in_frames) in self.wanted.drain(..) {
            if !pool.is_resident(page) && !self.edited.bring(page) {
                asked.extend(self.requests.ask(page, self.now, in_frames));
            }
        }
        if self.prefetch == Prefetch::Frustum {
            let before = self.last_view.replace(*view).unwrap_or(*view);
            let extended = ExtendedView::after(&before, view, self.block_m);
            extended.pages_away(pool, self.culling, &mut self.extension);
            asked.extend(self.extension.iter().filter_map(|page| self.requests.ask(*page, self.now, 1.0)));
        }
        frame.pages_asked = asked.len() as u64;
        self.fetch.ask(self.now, &asked);
        self.requests.asked = asked;
        frame.pages_come += self.edited.install(self.engine.store_mut());
    }
}
