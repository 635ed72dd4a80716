//! The image on a terrain as the renderer is given it: tiles read from the terrain file, and decoded where the device takes no blocks.
//!
//! Pictures that must repeat read all that a view wants before it is drawn. A window has threads read: every frame leaves them the list of what it wants, coarse before fine, and
//! after that what the view some frames ahead will want; what has come is given, so much a frame. A list is forgotten with its frame, so nothing is read for
//! where the eye no longer is. Where a tile cannot be read its ancestor shows; it is told once and tried again later.
//!
//! What is painted in an editing session is in memory and asked before the file. Tiles that changed are wanted anew; those that are painted, and those that an undo or a redo brought
//! back, are given in the very next frame, so many at most. After a commit, an undo or a redo tiles are read from the section that counts by then; reads
//! that were begun before are thrown away when they come.
//!
//! Invariant: a frame with threads never waits for storage, but that after an undo or a redo, which has waited itself. Cost: a lock and a copy of each tile that comes.

use std::collections::{BTreeSet, HashMap, HashSet, VecDeque};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use terrasoar_layout::LayoutError;
use terrasoar_layout::header::ImageryPlace;
use terrasoar_layout::imagery::{Imagery, PaintedTile, Painter, TileFormat, TileId, decode_tile};
use terrasoar_layout::terrain::Terrain;
use terrasoar_render::{FrameView, ImageTileId, ImageryFormat, ImageryShape, RenderError, Renderer};

/// Threads that read and decode.
const THREADS: usize = 2;
/// Tiles of the current view on a frame's list.
const WANTED: usize = 64;
/// Tiles of the view ahead on it.
const WANTED_AHEAD: usize = 32;
/// Tiles in memory that a frame is given beside those that were read: what two scorches change in all levels.
const AT_HAND: usize = 24;
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
    /// Where in the file the reader's imagery lies.
    place: Option<ImageryPlace>,
    /// Whether an editing session has been followed.
    follows: bool,
    /// Tiles that are not the file's.
    painted: HashMap<ImageTileId, PaintedTile>,
    /// Tiles of the file that are others since the last frame.
    turned: HashSet<ImageTileId>,
    /// Whether tiles in memory are left for the next frame.
    is_behind: bool,
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
    arrivals: Receiver<Arrival>,
    under_way: HashSet<ImageTileId>,
    turn: u64,
}

/// A tile that was read, and in which turn.
type Arrival = (u64, ImageTileId, Tile);

#[derive(Debug)]
struct Shared {
    list: Mutex<List>,
    work: Condvar,
}

#[derive(Debug)]
struct List {
    reader: Arc<Reader>,
    /// Number of the reader: which one a tile was read by.
    turn: u64,
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
    /// The image of `terrain` for a device that takes such formats, if it has one. With `threads` frames do not wait for it.
    ///
    /// # Errors
    /// The imagery is damaged or cannot be read, or the system gives no thread.
    pub(crate) fn of(
        terrain: Arc<Terrain>,
        formats: &[ImageryFormat],
        threads: bool,
    ) -> Result<Option<Self>, LayoutError> {
        let Some(imagery) = Imagery::open(&terrain)? else { return Ok(None) };
        let place = terrain.header().imagery;
        Self::over(terrain, imagery, place, formats, threads).map(Some)
    }

    /// As [`Drape::of`], of imagery that was found at `place` in the file.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(crate) fn over(
        terrain: Arc<Terrain>,
        imagery: Imagery,
        place: Option<ImageryPlace>,
        formats: &[ImageryFormat],
        threads: bool,
    ) -> Result<Self, LayoutError> {
        let own = imagery.shape();
        let format = match own.format {
            TileFormat::Bc1 => ImageryFormat::Bc1,
            TileFormat::Bc7 => ImageryFormat::Bc7,
            TileFormat::Rgba8 => ImageryFormat::Rgba8,
        };
        let decodes = !formats.contains(&format);
        let shape = ImageryShape {
            format: if decodes { ImageryFormat::Rgba8 } else { format },
            texels: own.texels,
            levels: own.levels,
            origin_m: own.origin_m,
            texel_m: own.texel_m,
        };
        let reader = Arc::new(Reader { terrain, imagery, decodes });
        let threads = if threads { Some(Threads::start(&reader)?) } else { None };
        Ok(Self {
            reader,
            threads,
            shape,
            place,
            follows: false,
            painted: HashMap::new(),
            turned: HashSet::new(),
            is_behind: false,
            frame: 0,
            trouble: HashMap::new(),
            errors: VecDeque::new(),
        })
    }

    /// What the renderer is told of the image.
    pub(crate) fn shape(&self) -> ImageryShape {
        self.shape
    }

    /// Whether the image can be painted by this build.
    pub(crate) fn can_be_painted(&self) -> bool {
        self.reader.imagery.shape().format.can_be_made()
    }

    /// Takes over what was painted, committed, undone or redone: these tiles changed, and the file's header says now that the image lies at `place`.
    pub(crate) fn repainted(
        &mut self,
        renderer: &mut Renderer,
        tiles: &BTreeSet<TileId>,
        painter: &Painter,
        place: Option<ImageryPlace>,
    ) {
        if self.follows && tiles.is_empty() && place == self.place {
            return;
        }
        self.follows = true;
        if place != self.place {
            self.place = place;
            self.turn_to(Reader {
                terrain: Arc::clone(painter.terrain()),
                imagery: painter.imagery().clone(),
                decodes: self.reader.decodes,
            });
        }
        let painted = |id: TileId| Some((of_renderer(id), painter.painted_tile(id)?));
        self.painted = painter.painted().into_iter().filter_map(painted).collect();
        let tiles: Vec<ImageTileId> = tiles.iter().copied().map(of_renderer).collect();
        renderer.change_imagery(&tiles);
        self.turned.extend(tiles.into_iter().filter(|id| !self.painted.contains_key(id)));
    }

    /// Reads by another reader from now on.
    fn turn_to(&mut self, reader: Reader) {
        self.reader = Arc::new(reader);
        if let Some(threads) = &mut self.threads {
            threads.turn += 1;
            let mut list = threads.shared.lock();
            list.reader = Arc::clone(&self.reader);
            list.turn = threads.turn;
            list.wanted.clear();
        }
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
        let is_reading = |threads: &Threads| {
            let list = threads.shared.lock();
            !threads.under_way.is_empty() || !list.begun.is_empty() || !list.wanted.is_empty()
        };
        self.is_behind || self.threads.as_ref().is_some_and(is_reading)
    }

    /// What could not be read and nobody has heard of yet.
    pub(crate) fn take_error(&mut self) -> Option<LayoutError> {
        self.errors.pop_front()
    }

    fn serve_all(&mut self, renderer: &mut Renderer, view: &FrameView) -> Result<Served, RenderError> {
        let mut served = Served::default();
        self.turned.clear();
        loop {
            let wanted: Vec<ImageTileId> = renderer.want_imagery(view, usize::MAX).to_vec();
            let before = served.tiles;
            let mut settled = false;
            for id in wanted.into_iter().filter(|id| !self.is_in_trouble(*id)).collect::<Vec<_>>() {
                let tile = self.tile(id);
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
            && let Ok((turn, id, tile)) = threads.arrivals.try_recv()
        {
            come.push(id);
            // What was read before it changed is not what it is.
            if turn == threads.turn && !self.painted.contains_key(&id) {
                self.give(renderer, id, tile, &mut served)?;
            }
        }
        let mut wanted: Vec<ImageTileId> = renderer.want_imagery(view, WANTED).to_vec();
        wanted.extend_from_slice(renderer.want_imagery_ahead(ahead, WANTED_AHEAD));
        // Decoding a tile takes as long as sending many.
        let at_hand = if self.reader.decodes { most } else { AT_HAND };
        self.serve_at_hand(renderer, &mut wanted, at_hand, &mut served)?;
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

    /// Gives those of the wanted tiles that are in memory or were turned to, `most` at most, and takes what need not be read off the list.
    fn serve_at_hand(
        &mut self,
        renderer: &mut Renderer,
        wanted: &mut Vec<ImageTileId>,
        most: usize,
        served: &mut Served,
    ) -> Result<(), RenderError> {
        let turned = std::mem::take(&mut self.turned);
        let before = served.tiles;
        let (mut given, mut left) = (0, 0);
        let mut to_read = Vec::with_capacity(wanted.len());
        for id in wanted.drain(..) {
            let is_painted = self.painted.contains_key(&id);
            if !is_painted && (given == most || self.is_in_trouble(id) || !turned.contains(&id)) {
                to_read.push(id);
            } else if given == most {
                left += 1;
            } else {
                given += 1;
                let tile = self.tile(id);
                self.give(renderer, id, tile, served)?;
            }
        }
        *wanted = to_read;
        // Tiles for which there is no room are no reason for another frame.
        self.is_behind = left > 0 && served.tiles > before;
        Ok(())
    }

    /// A tile as it is now: painted, or else read.
    fn tile(&self, id: ImageTileId) -> Tile {
        let Some(painted) = self.painted.get(&id) else { return self.reader.read(id) };
        let mut tile = Vec::new();
        Ok(if painted.read(&mut tile) { self.reader.as_taken(tile) } else { None })
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
        let is_there = self.imagery.read_tile(&self.terrain, id, &mut tile)?;
        Ok(if is_there { self.as_taken(tile) } else { None })
    }

    /// A tile as the device takes it. One that was read has the length of one.
    fn as_taken(&self, tile: Vec<u8>) -> Option<Vec<u8>> {
        if self.decodes { decode_tile(self.imagery.shape().format, &tile) } else { Some(tile) }
    }
}

impl Threads {
    fn start(reader: &Arc<Reader>) -> Result<Self, LayoutError> {
        let list = List {
            reader: Arc::clone(reader),
            turn: 0,
            wanted: VecDeque::new(),
            begun: Vec::new(),
            stopped: false,
        };
        let shared = Arc::new(Shared { list: Mutex::new(list), work: Condvar::new() });
        let (sender, arrivals) = channel();
        let threads = Self { shared, arrivals, under_way: HashSet::new(), turn: 0 };
        let path = reader.terrain.path();
        for i in 0..THREADS {
            let (shared, sender) = (Arc::clone(&threads.shared), sender.clone());
            std::thread::Builder::new()
                .name(format!("image reader {i}"))
                .spawn(move || serve(&shared, &sender))
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

fn of_renderer(TileId { level, x, y }: TileId) -> ImageTileId {
    ImageTileId { level, x, y }
}

/// One thread's life.
fn serve(shared: &Shared, arrivals: &Sender<Arrival>) {
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
        let (turn, reader) = (list.turn, Arc::clone(&list.reader));
        drop(list);
        if arrivals.send((turn, id, reader.read(id))).is_err() {
            return;
        }
        list = shared.lock();
    }
}
