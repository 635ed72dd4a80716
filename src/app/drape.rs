//! The image on a terrain as the renderer is given it: tiles read from the terrain file, and decoded where the device takes no blocks.
//!
//! Pictures that must repeat read all that a view wants before it is drawn. A window has threads read: every frame leaves them the list of what it wants, coarse before fine, and
//! after that what the view some frames ahead will want; what has come is given, so much a frame. A list is forgotten with its frame, so nothing is read for
//! where the eye no longer is. Where a tile cannot be read its ancestor shows; it is told once and tried again later.
//!
//! Invariant: a frame with threads never waits for storage. Cost: a lock and a copy of each tile that comes.

use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use terrasoar_layout::LayoutError;
use terrasoar_layout::imagery::{Imagery, TileFormat, TileId, decode_tile};
use terrasoar_layout::terrain::Terrain;
use terrasoar_render::{
    Capabilities, FrameView, ImageTileId, ImageryFormat, ImageryShape, RenderError, Renderer,
};

/// Threads that read and decode.
const THREADS: usize = 2;
/// Tiles of the current view on a frame's list.
const WANTED: usize = 64;
/// Tiles of the view ahead on it.
const WANTED_AHEAD: usize = 32;
/// Frames until a tile that could not be read is tried again.
const RETRY_FRAMES: u64 = 120;

/// Image tiles a frame was given.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Served {
    /// Tiles.
    pub tiles: u64,
    /// Bytes of them.
    pub bytes: u64,
}

/// The image of one terrain on its way to one renderer.
#[derive(Debug)]
pub(crate) struct Drape {
    reader: Arc<Reader>,
    threads: Option<Threads>,
    shape: ImageryShape,
    frame: u64,
    /// Tiles that could not be read, and the frame to try them again in.
    trouble: HashMap<ImageTileId, u64>,
    errors: VecDeque<LayoutError>,
}

/// What reads tiles.
#[derive(Debug)]
struct Reader {
    terrain: Arc<Terrain>,
    imagery: Imagery,
    /// Whether tiles are decoded to plain texels.
    decodes: bool,
}

/// A tile that was read; none if there is none.
type Tile = Result<Option<Vec<u8>>, LayoutError>;

#[derive(Debug)]
struct Threads {
    shared: Arc<Shared>,
    arrivals: Receiver<(ImageTileId, Tile)>,
    under_way: HashSet<ImageTileId>,
}

#[derive(Debug, Default)]
struct Shared {
    list: Mutex<List>,
    work: Condvar,
}

#[derive(Debug, Default)]
struct List {
    wanted: VecDeque<ImageTileId>,
    /// Taken from the list since the last frame looked.
    begun: Vec<ImageTileId>,
    stopped: bool,
}

impl Shared {
    /// No code that holds the lock can panic halfway through a change.
    fn lock(&self) -> MutexGuard<'_, List> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drape {
    /// The image of `terrain` for a device of such capabilities, if it has one. With `threads` frames do not wait for it.
    ///
    /// # Errors
    /// The imagery is damaged or cannot be read, or the system gives no thread.
    pub(crate) fn of(
        terrain: Arc<Terrain>,
        capabilities: &Capabilities,
        threads: bool,
    ) -> Result<Option<Self>, LayoutError> {
        let Some(imagery) = Imagery::open(&terrain)? else { return Ok(None) };
        let own = imagery.shape();
        let format = match own.format {
            TileFormat::Bc1 => ImageryFormat::Bc1,
            TileFormat::Bc7 => ImageryFormat::Bc7,
            TileFormat::Rgba8 => ImageryFormat::Rgba8,
        };
        let decodes = !capabilities.imagery_formats().contains(&format);
        let shape = ImageryShape {
            format: if decodes { ImageryFormat::Rgba8 } else { format },
            texels: own.texels,
            levels: own.levels,
            origin_m: own.origin_m,
            texel_m: own.texel_m,
        };
        let reader = Arc::new(Reader { terrain, imagery, decodes });
        let threads = if threads { Some(Threads::start(&reader)?) } else { None };
        Ok(Some(Self { reader, threads, shape, frame: 0, trouble: HashMap::new(), errors: VecDeque::new() }))
    }

    /// What the renderer is told of the image.
    pub(crate) fn shape(&self) -> ImageryShape {
        self.shape
    }

    /// Gives the renderer what a view wants: all of it without threads, else what has come, `most` tiles at most.
    ///
    /// # Errors
    /// What the renderer says.
    pub(crate) fn serve(
        &mut self,
        renderer: &mut Renderer,
        view: &FrameView,
        ahead: &FrameView,
        most: usize,
    ) -> Result<Served, RenderError> {
        self.frame += 1;
        match self.threads.take() {
            None => self.serve_all(renderer, view),
            Some(mut threads) => {
                let served = self.serve_some(&mut threads, renderer, view, ahead, most);
                self.threads = Some(threads);
                served
            }
        }
    }

    /// Whether tiles that the last frame wanted are on their way.
    pub(crate) fn is_waiting(&self) -> bool {
        self.threads.as_ref().is_some_and(|threads| {
            let list = threads.shared.lock();
            !threads.under_way.is_empty() || !list.begun.is_empty() || !list.wanted.is_empty()
        })
    }

    /// What could not be read and nobody has heard of yet.
    pub(crate) fn take_error(&mut self) -> Option<LayoutError> {
        self.errors.pop_front()
    }

    fn serve_all(&mut self, renderer: &mut Renderer, view: &FrameView) -> Result<Served, RenderError> {
        let mut served = Served::default();
        loop {
            let wanted: Vec<ImageTileId> = renderer.want_imagery(view, usize::MAX).to_vec();
            let before = served.tiles;
            let mut settled = false;
            for id in wanted.into_iter().filter(|id| !self.is_in_trouble(*id)).collect::<Vec<_>>() {
                let tile = self.reader.read(id);
                settled |= self.give(renderer, id, tile, &mut served)?;
            }
            // Where no room is left for a wanted tile a coarser one stands in for good.
            if served.tiles == before && !settled {
                return Ok(served);
            }
        }
    }

    fn serve_some(
        &mut self,
        threads: &mut Threads,
        renderer: &mut Renderer,
        view: &FrameView,
        ahead: &FrameView,
        most: usize,
    ) -> Result<Served, RenderError> {
        let mut served = Served::default();
        let mut come = Vec::new();
        while (served.tiles as usize) < most
            && let Ok((id, tile)) = threads.arrivals.try_recv()
        {
            come.push(id);
            self.give(renderer, id, tile, &mut served)?;
        }
        let mut wanted: Vec<ImageTileId> = renderer.want_imagery(view, WANTED).to_vec();
        wanted.extend_from_slice(renderer.want_imagery_ahead(ahead, WANTED_AHEAD));
        let mut list = threads.shared.lock();
        // What has come was begun, in this frame perhaps.
        threads.under_way.extend(list.begun.drain(..));
        come.iter().for_each(|id| {
            threads.under_way.remove(id);
        });
        list.wanted.clear();
        list.wanted.extend(
            wanted.into_iter().filter(|id| !threads.under_way.contains(id) && !self.is_in_trouble(*id)),
        );
        let any = !list.wanted.is_empty();
        drop(list);
        if any {
            threads.shared.work.notify_all();
        }
        Ok(served)
    }

    fn is_in_trouble(&self, id: ImageTileId) -> bool {
        self.trouble.get(&id).is_some_and(|until| self.frame < *until)
    }

    /// Gives what was read. Tells whether the renderer need not ask for the tile again.
    fn give(
        &mut self,
        renderer: &mut Renderer,
        id: ImageTileId,
        tile: Tile,
        served: &mut Served,
    ) -> Result<bool, RenderError> {
        match tile {
            Ok(Some(bytes)) => {
                let sent = renderer.give_imagery(id, &bytes)?;
                served.tiles += u64::from(sent > 0);
                served.bytes += sent;
                Ok(sent > 0)
            }
            Ok(None) => {
                renderer.set_imagery_absent(id)?;
                Ok(true)
            }
            Err(error) => {
                if self.trouble.insert(id, self.frame + RETRY_FRAMES).is_none() {
                    self.errors.push_back(error);
                }
                Ok(false)
            }
        }
    }
}

impl Reader {
    fn read(&self, id: ImageTileId) -> Tile {
        let id = TileId { level: id.level, x: id.x, y: id.y };
        let mut tile = Vec::new();
        if !self.imagery.read_tile(&self.terrain, id, &mut tile)? {
            return Ok(None);
        }
        // A tile that was read has the length of one.
        Ok(if self.decodes { decode_tile(self.imagery.shape().format, &tile) } else { Some(tile) })
    }
}

impl Threads {
    fn start(reader: &Arc<Reader>) -> Result<Self, LayoutError> {
        let shared = Arc::new(Shared::default());
        let (sender, arrivals) = channel();
        let threads = Self { shared, arrivals, under_way: HashSet::new() };
        let path = reader.terrain.path();
        for i in 0..THREADS {
            let (shared, reader, sender) = (Arc::clone(&threads.shared), Arc::clone(reader), sender.clone());
            std::thread::Builder::new()
                .name(format!("image reader {i}"))
                .spawn(move || serve(&shared, &reader, &sender))
                .map_err(|e| LayoutError::io(path, "cannot start a thread that reads the image", e))?;
        }
        Ok(threads)
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.shared.lock().stopped = true;
        // Threads end by themselves; one that storage keeps waiting must not keep the program from ending.
        self.shared.work.notify_all();
    }
}

/// One thread's life.
fn serve(shared: &Shared, reader: &Reader, arrivals: &Sender<(ImageTileId, Tile)>) {
    let mut list = shared.lock();
    loop {
        if list.stopped {
            return;
        }
        let Some(id) = list.wanted.pop_front() else {
            list = shared.work.wait(list).unwrap_or_else(PoisonError::into_inner);
            continue;
        };
        list.begun.push(id);
        drop(list);
        if arrivals.send((id, reader.read(id))).is_err() {
            return;
        }
        list = shared.lock();
    }
}
