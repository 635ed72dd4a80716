//! Tiles of an image read from the terrain file, at once or by threads that get a new list every frame.
//!
//! Invariants: each frame's list replaces the one before; tiles read by a reader that is out of date are marked as such. Cost: a lock a frame and two a tile.

use std::collections::{HashSet, VecDeque};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use terrasoar_layout::LayoutError;
use terrasoar_layout::imagery::{Imagery, TileId, decode_tile};
use terrasoar_layout::read::terrain::Terrain;

/// Threads that read and decode.
const THREADS: usize = 2;

/// What reads tiles.
#[derive(Debug)]
pub(super) struct Reader {
    pub(super) terrain: Arc<Terrain>,
    pub(super) imagery: Imagery,
    /// Whether tiles are decoded to plain texels.
    pub(super) decodes: bool,
}

/// A tile that was read; none if there is none.
pub(super) type Tile = Result<Option<Vec<u8>>, LayoutError>;

impl Reader {
    pub(super) fn read(&self, id: TileId) -> Tile {
        let mut tile = Vec::new();
        let is_there = self.imagery.read_tile(&self.terrain, id, &mut tile)?;
        Ok(if is_there { self.as_taken(tile) } else { None })
    }

    /// A tile as the device takes it. One that was read has the length of one.
    pub(super) fn as_taken(&self, tile: Vec<u8>) -> Option<Vec<u8>> {
        if self.decodes { decode_tile(self.imagery.shape().format, &tile) } else { Some(tile) }
    }
}

/// Threads that read.
#[derive(Debug)]
pub(super) struct Threads {
    shared: Arc<Shared>,
    arrivals: Receiver<Arrival>,
    under_way: HashSet<TileId>,
    turn: u64,
}

/// A tile that was read, and in which turn.
type Arrival = (u64, TileId, Tile);

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
    wanted: VecDeque<TileId>,
    /// Taken from the list since the last frame looked.
    begun: Vec<TileId>,
    stopped: bool,
}

impl Shared {
    /// No code that holds the lock can panic halfway through a change.
    fn lock(&self) -> MutexGuard<'_, List> {
        self.list.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Threads {
    /// Starts them.
    ///
    /// # Errors
    /// The system gives no thread.
    pub(super) fn start(reader: &Arc<Reader>) -> Result<Self, LayoutError> {
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

    /// Reads by another reader from now on, and forgets what was asked for.
    pub(super) fn turn_to(&mut self, reader: &Arc<Reader>) {
        self.turn += 1;
        let mut list = self.shared.lock();
        list.reader = Arc::clone(reader);
        list.turn = self.turn;
        list.wanted.clear();
    }

    /// A tile that has come, and whether the reader that counts has read it.
    pub(super) fn take(&mut self) -> Option<(bool, TileId, Tile)> {
        let (turn, id, tile) = self.arrivals.try_recv().ok()?;
        Some((turn == self.turn, id, tile))
    }

    /// Leaves the list of a frame, which has taken those that have `come`; tiles that are being read are not read again.
    pub(super) fn ask(&mut self, come: &[TileId], wanted: impl Iterator<Item = TileId>) {
        let mut list = self.shared.lock();
        // What has come was begun, in this frame perhaps.
        self.under_way.extend(list.begun.drain(..));
        come.iter().for_each(|id| {
            self.under_way.remove(id);
        });
        list.wanted.clear();
        list.wanted.extend(wanted.filter(|id| !self.under_way.contains(id)));
        let any = !list.wanted.is_empty();
        drop(list);
        if any {
            self.shared.work.notify_all();
        }
    }

    /// Whether tiles are on their way.
    pub(super) fn is_reading(&self) -> bool {
        let list = self.shared.lock();
        !self.under_way.is_empty() || !list.begun.is_empty() || !list.wanted.is_empty()
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
