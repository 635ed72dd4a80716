//! The counting run: a flight through one reader, what its reads touch under every layout, and what a page cache of a stated size misses.
//!
//! Records of a terrain that does not lend them are read page by page, into memory of a fixed size; what is counted is the same.
//!
//! One pass is enough for all layouts and all ways of preloading, because the engine's reads are the same. Within a frame a page is needed once, however often it is read.
//! Preloads come from a disk of stated speed: so many pages between two frames, the coarsest first. **Nothing here reads a clock or the state of the machine**: equal
//! input gives equal counts.

use super::layouts::{LINE_BYTES, Layout, LayoutKind, UNIT_BYTES};
use super::{FrameIo, IoBenchError, Prefetch, Reader, Run};
use lru::LruCache;
use std::num::NonZeroUsize;
use terrasoar::flyover::EngineKind;
use terrasoar::refine::kinetic::Kinetic;
use terrasoar::refine::naive::Naive;
use terrasoar::refine::smart::Smart;
use terrasoar::refine::soar::Soar;
use terrasoar::refine::{Culling, Engine, Probe};
use terrasoar::stream::ExtendedView;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::file::bytes::PAGE_BYTES;
use terrasoar_layout::file::source::{PackedNeed, Unpacking};
use terrasoar_layout::read::kinds::CACHE_BYTES;
use terrasoar_layout::read::store::CompleteStore;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

const LINES_PER_PAGE: u64 = PAGE_BYTES as u64 / LINE_BYTES;
const LINES_PER_UNIT: u64 = UNIT_BYTES / LINE_BYTES;

/// What is counted, and with what means.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct CountOptions {
    /// Layouts to count under.
    pub layouts: Vec<LayoutKind>,
    /// Ways of preloading.
    pub preloads: Vec<Prefetch>,
    /// Pages that the cache holds; one at the least.
    pub cache_pages: usize,
    /// Pages that the disk delivers between two frames.
    pub disk_pages: usize,
    /// How far the frustum is moved back for preloading, in metres.
    pub block_m: f64,
    /// Whether to keep the pages of every frame in the order they are first read, for replaying them.
    pub trace: bool,
    /// Memory for pages that are read while it is counted; without it as [`Terrain::cache_bytes`] has it. It changes no count.
    pub cache_bytes: Option<u64>,
}

impl Default for CountOptions {
    /// All layouts, without preloading and by the frustum, a cache of 128 MiB and 128 pages a frame.
    fn default() -> Self {
        Self {
            layouts: LayoutKind::ALL.to_vec(),
            preloads: vec![Prefetch::None, Prefetch::Frustum],
            cache_pages: 1 << 15,
            disk_pages: 128,
            block_m: 1000.0,
            trace: false,
            cache_bytes: None,
        }
    }
}

impl CountOptions {
    /// These options with other layouts to count under.
    pub fn layouts(self, layouts: Vec<LayoutKind>) -> Self {
        Self { layouts, ..self }
    }

    /// These options with other ways of preloading.
    pub fn preloads(self, preloads: Vec<Prefetch>) -> Self {
        Self { preloads, ..self }
    }

    /// These options with so many pages that the cache holds.
    pub fn cache_pages(self, cache_pages: usize) -> Self {
        Self { cache_pages, ..self }
    }

    /// These options with so many pages that the disk delivers between two frames.
    pub fn disk_pages(self, disk_pages: usize) -> Self {
        Self { disk_pages, ..self }
    }

    /// These options with the frustum moved back so many metres for preloading.
    pub fn block_m(self, block_m: f64) -> Self {
        Self { block_m, ..self }
    }

    /// These options with the pages of every frame kept, or not.
    pub fn trace(self, trace: bool) -> Self {
        Self { trace, ..self }
    }

    /// These options with pages that are read into so many bytes of memory meanwhile.
    pub fn cache_bytes(self, cache_bytes: impl Into<Option<u64>>) -> Self {
        Self { cache_bytes: cache_bytes.into(), ..self }
    }
}

/// Flies `views` with one reader and counts. `done` hears the number of frames finished.
///
/// # Errors
/// [`IoBenchError::NoDeadlines`] if preloading by deadline is asked for; damage and I/O.
pub fn count(
    terrain: &Terrain,
    views: &[View],
    culling: Culling,
    reader: Reader,
    options: &CountOptions,
    done: &mut dyn FnMut(u64),
) -> Result<Vec<Run>, IoBenchError> {
    if options.preloads.contains(&Prefetch::Deadline) {
        return Err(IoBenchError::NoDeadlines { reader });
    }
    let mut counts: Vec<LayoutCount<'_>> =
        options.layouts.iter().map(|kind| LayoutCount::new(terrain, *kind, options)).collect();
    let mut sink = Sink { views, culling, options, counts: &mut counts, done };
    // Packed terrain is read as its own readers read it: by pages, with what is known of records before they are read.
    let asked = options.cache_bytes.or(terrain.source().unpacking().map(|_| CACHE_BYTES));
    match terrain.cache_bytes(asked) {
        None => with_records!(terrain.records()?, records => sink.fly(&records, reader))?,
        Some(bytes) => with_records!(terrain.paged(bytes), records => sink.fly(&records, reader))?,
    }
    Ok(counts.into_iter().flat_map(|count| count.into_runs(reader)).collect())
}

/// Remembers the slots read.
#[derive(Default)]
struct Reads {
    /// All that the mesh is made from, read or foreseen.
    all: Vec<u64>,
    read: Vec<u64>,
    foreseen: Vec<u64>,
}

impl Reads {
    fn clear(&mut self) {
        [&mut self.all, &mut self.read, &mut self.foreseen].into_iter().for_each(Vec::clear);
    }
}

impl Probe for Reads {
    const HEARS_FORESEEN: bool = true;

    fn read(&mut self, slot: u64) {
        self.all.push(slot);
        self.read.push(slot);
    }

    fn foreseen(&mut self, slot: u64) {
        self.all.push(slot);
        self.foreseen.push(slot);
    }
}

/// Where the reads of a flight go.
struct Sink<'s, 't> {
    views: &'s [View],
    culling: Culling,
    options: &'s CountOptions,
    counts: &'s mut [LayoutCount<'t>],
    done: &'s mut dyn FnMut(u64),
}

impl Sink<'_, '_> {
    fn fly<S: CompleteStore + Clone>(&mut self, records: &S, reader: Reader) -> Result<(), LayoutError> {
        match reader.engine() {
            EngineKind::Naive => self.fly_with(records, Naive::new(records.clone(), self.culling)),
            EngineKind::Soar => self.fly_with(records, Soar::new(records.clone(), self.culling)),
            EngineKind::Smart => self.fly_with(records, Smart::new(records.clone(), self.culling)),
            EngineKind::Kinetic => self.fly_with(records, Kinetic::new(records.clone(), self.culling)),
        }
    }

    fn fly_with(&mut self, records: &impl CompleteStore, mut engine: impl Engine) -> Result<(), LayoutError> {
        let mut reads = Reads::default();
        let extends = self.options.preloads.contains(&Prefetch::Frustum);
        let mut before: Option<&View> = None;
        for (i, view) in self.views.iter().enumerate() {
            reads.clear();
            engine.update(view, &mut reads);
            for count in self.counts.iter_mut() {
                count.frame(i as u64, &reads)?;
            }
            if extends {
                let plain = ExtendedView::plain(view).slots(records, self.culling);
                let extended = ExtendedView::after(before.unwrap_or(view), view, self.options.block_m)
                    .slots(records, self.culling);
                let extension: Vec<u64> =
                    extended.into_iter().filter(|slot| plain.binary_search(slot).is_err()).collect();
                for count in self.counts.iter_mut() {
                    count.preload(&plain, &extension, self.options.disk_pages);
                }
            }
            records.take_error().map_or(Ok(()), Err)?;
            before = Some(view);
            (self.done)(i as u64 + 1);
        }
        Ok(())
    }
}

/// The counts of one layout.
struct LayoutCount<'t> {
    layout: Layout<'t>,
    /// Of the terrain file itself, if it is packed.
    unpacking: Option<&'t dyn Unpacking>,
    lines: Vec<u64>,
    pages: Vec<u64>,
    modes: Vec<Mode>,
    /// Pages of each frame as first read, if wanted.
    trace: Option<Vec<Vec<u64>>>,
}

/// One way of preloading under one layout.
struct Mode {
    kind: Prefetch,
    /// The page cache as it is imagined: the page not touched for longest goes first.
    cache: LruCache<u64, ()>,
    frames: Vec<FrameIo>,
    /// Pages loaded since the last frame.
    preloaded: u64,
}

impl<'t> LayoutCount<'t> {
    fn new(terrain: &'t Terrain, kind: LayoutKind, options: &CountOptions) -> Self {
        let mode = |kind: &Prefetch| Mode {
            kind: *kind,
            cache: page_cache(options.cache_pages),
            frames: Vec::new(),
            preloaded: 0,
        };
        Self {
            layout: Layout::new(kind, terrain),
            unpacking: terrain.source().unpacking().filter(|_| kind == LayoutKind::Ours),
            lines: Vec::new(),
            pages: Vec::new(),
            modes: options.preloads.iter().map(mode).collect(),
            trace: options.trace.then(Vec::new),
        }
    }

    /// Distinct pages of the records at `slots`, sorted, into `pages`.
    fn gather(&mut self, slots: &[u64]) {
        self.lines.clear();
        for [first, last] in slots.iter().filter_map(|slot| self.layout.lines(*slot)) {
            self.lines.push(first);
            if last != first {
                self.lines.push(last);
            }
        }
        if let Some(trace) = &mut self.trace {
            trace.push(in_order_of_first_touch(self.lines.iter().map(|line| line / LINES_PER_PAGE)));
        }
        self.lines.sort_unstable();
        self.lines.dedup();
        self.pages.clear();
        self.pages.extend(self.lines.iter().map(|line| line / LINES_PER_PAGE));
        self.pages.dedup();
    }

    fn frame(&mut self, frame: u64, reads: &Reads) -> Result<(), LayoutError> {
        let slots = &reads.all[..];
        self.gather(slots);
        let PackedNeed { tiles, bytes, bound_bytes } = match self.unpacking {
            Some(unpacking) => unpacking.need_of(&reads.read, &reads.foreseen)?,
            None => PackedNeed::default(),
        };
        let mut units: Vec<u64> = self.lines.iter().map(|line| line / LINES_PER_UNIT).collect();
        units.dedup();
        for mode in &mut self.modes {
            let missing = self.pages.iter().filter(|page| !mode.cache.contains(*page)).count();
            self.pages.iter().for_each(|page| {
                mode.cache.put(*page, ());
            });
            mode.frames.push(FrameIo {
                frame,
                reads: slots.len() as u64,
                record_bytes: slots.len() as u64 * self.layout.record_bytes(),
                pages: self.pages.len() as u64,
                lines: self.lines.len() as u64,
                units: units.len() as u64,
                realtime_pages: missing as u64,
                preloaded_pages: std::mem::take(&mut mode.preloaded),
                tiles,
                tile_bytes: bytes + bound_bytes,
            });
        }
        Ok(())
    }

    /// Loads pages of `extension` that are not of the view, whose records are at `plain`.
    fn preload(&mut self, plain: &[u64], extension: &[u64], disk_pages: usize) {
        let page_of = |line: u64| line / LINES_PER_PAGE;
        let lines = |slots: &[u64]| -> Vec<u64> {
            slots.iter().filter_map(|slot| self.layout.lines(*slot)).flatten().map(page_of).collect()
        };
        let mut view = lines(plain);
        view.sort_unstable();
        let wanted = in_order_of_first_touch(lines(extension).into_iter());
        for mode in self.modes.iter_mut().filter(|mode| mode.kind == Prefetch::Frustum) {
            let missing =
                wanted.iter().filter(|p| view.binary_search(p).is_err() && !mode.cache.contains(*p));
            let loads: Vec<u64> = missing.take(disk_pages).copied().collect();
            mode.preloaded = loads.len() as u64;
            for page in loads {
                mode.cache.put(page, ());
            }
        }
    }

    fn into_runs(self, reader: Reader) -> impl Iterator<Item = Run> {
        let (layout, trace, counts_tiles) = (self.layout, self.trace, self.unpacking.is_some());
        self.modes.into_iter().map(move |mode| Run {
            reader,
            layout: layout.kind(),
            preload: mode.kind,
            record_bytes: layout.record_bytes(),
            file_bytes: layout.file_bytes(),
            counts_tiles,
            frames: mode.frames,
            trace: if mode.kind == Prefetch::None { trace.clone() } else { None },
        })
    }
}

/// An empty cache, which takes memory as it fills.
fn page_cache(pages: usize) -> LruCache<u64, ()> {
    let mut cache = LruCache::unbounded();
    cache.resize(NonZeroUsize::new(pages).unwrap_or(NonZeroUsize::MIN));
    cache
}

/// `pages` without repetition.
fn in_order_of_first_touch(pages: impl Iterator<Item = u64>) -> Vec<u64> {
    let mut seen = std::collections::HashSet::new();
    pages.filter(|page| seen.insert(*page)).collect()
}
