//! The image on a terrain as the renderer is given it: tiles read from the terrain file, and decoded where the device takes no blocks.
//!
//! For a picture that must repeat, all tiles of its view are read before it is drawn. A window has threads that read. Every frame gives them a list of the tiles it needs, coarse ones before fine ones, and
//! then of those that the view some frames ahead will need. Tiles that have come are passed on, a bounded number in a frame. Each frame's list replaces the one before, so nothing is read for
//! places that the eye has left. Where a tile cannot be read a coarser one is shown; the error is reported once, and the tile is tried again later.
//!
//! Tiles painted in an editing session are in memory and are taken before those of the file. Tiles that changed are asked for again. Painted ones, and those that an undo or a redo brought
//! back and read, are passed on in the next frame, up to a bound. After a commit, an undo or a redo tiles are read from the section that counts then; reads
//! that were begun before are thrown away. So are reads for a device that is gone, because another device may take other formats.
//!
//! Invariant: a frame with threads never waits for storage. Cost: a lock and a copy of each tile that comes.

use super::repaint::{Picture, PictureFile, Repaint};
use super::tile_reader::{Reader, Threads, Tile};
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use terrasoar::view::View;
use terrasoar_layout::LayoutError;
use terrasoar_layout::imagery::{Imagery, ImageryShape, PaintedTile, TileFormat, TileId};
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_render::{RenderError, Renderer};

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
pub struct Served {
    /// Tiles.
    pub tiles: u64,
    /// Bytes of them.
    pub bytes: u64,
}

/// The image of one terrain on its way to one renderer.
#[derive(Debug)]
pub struct Drape {
    reader: Arc<Reader>,
    threads: Option<Threads>,
    /// What the device is given.
    format: TileFormat,
    /// Tiles that are not the file's.
    painted: HashMap<TileId, PaintedTile>,
    /// Tiles of the file that are others since the last frame, as they were read.
    at_hand: HashMap<TileId, Option<Vec<u8>>>,
    /// Whether tiles in memory are left for the next frame.
    is_behind: bool,
    frame: u64,
    /// Tiles that could not be read, and the frame to try them again in.
    trouble: HashMap<TileId, u64>,
    errors: VecDeque<LayoutError>,
}

impl Drape {
    /// The image of `terrain` for a device that takes such formats, if it has one. With `threads` frames do not wait for it.
    ///
    /// # Errors
    /// The imagery is damaged or cannot be read, or the system gives no thread.
    pub fn of(
        terrain: Arc<Terrain>,
        formats: &[TileFormat],
        threads: bool,
    ) -> Result<Option<Self>, LayoutError> {
        let Some(imagery) = Imagery::open(&terrain)? else { return Ok(None) };
        Self::over(PictureFile { terrain, imagery }, formats, threads).map(Some)
    }

    /// As [`Drape::of`], of a picture that was opened.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn over(
        PictureFile { terrain, imagery }: PictureFile,
        formats: &[TileFormat],
        threads: bool,
    ) -> Result<Self, LayoutError> {
        let own = imagery.shape().format;
        let format = taken_as(own, formats);
        let decodes = format != own;
        let reader = Arc::new(Reader { terrain, imagery, decodes });
        let threads = if threads { Some(Threads::start(&reader)?) } else { None };
        Ok(Self {
            reader,
            threads,
            format,
            painted: HashMap::new(),
            at_hand: HashMap::new(),
            is_behind: false,
            frame: 0,
            trouble: HashMap::new(),
            errors: VecDeque::new(),
        })
    }

    /// Suits the tiles to a device that takes such formats, in place of the one before.
    pub fn suit(&mut self, formats: &[TileFormat]) {
        let own = self.shape().format;
        self.format = taken_as(own, formats);
        let decodes = self.format != own;
        if decodes != self.reader.decodes {
            let Reader { terrain, imagery, .. } = &*self.reader;
            self.turn_to(Reader { terrain: Arc::clone(terrain), imagery: imagery.clone(), decodes });
        }
    }

    /// The image's shape, and the format of its tiles in the file.
    pub fn shape(&self) -> ImageryShape {
        self.reader.imagery.shape()
    }

    /// Drapes the image over a renderer's terrain, its tiles in `pool_bytes` of device memory.
    ///
    /// # Errors
    /// What the renderer says.
    pub fn show(&self, renderer: &mut Renderer, pool_bytes: u64) -> Result<(), RenderError> {
        renderer.set_imagery(&self.shape(), self.format, pool_bytes)
    }

    /// Whether the image can be painted by this build.
    pub fn can_be_painted(&self) -> bool {
        self.shape().format.can_be_made()
    }

    /// Takes over what was painted, committed, undone or redone of this picture.
    pub fn repainted(&mut self, renderer: &mut Renderer, repaint: Repaint) {
        if let Picture::Moved(PictureFile { terrain, imagery }) = repaint.picture {
            self.turn_to(Reader { terrain, imagery, decodes: self.reader.decodes });
        }
        self.painted = repaint.painted.into_iter().collect();
        let tiles: Vec<TileId> = repaint.tiles.into_iter().collect();
        renderer.change_imagery(&tiles);
        tiles.iter().for_each(|id| {
            self.at_hand.remove(id);
        });
        self.at_hand.extend(repaint.read);
    }

    /// Reads from `terrain` from now on, whose file is the one before, rewritten with the same image.
    ///
    /// # Errors
    /// The imagery is damaged or cannot be read.
    pub fn follow(&mut self, terrain: &Arc<Terrain>) -> Result<(), LayoutError> {
        if let Some(imagery) = Imagery::open(terrain)? {
            let decodes = self.reader.decodes;
            self.turn_to(Reader { terrain: Arc::clone(terrain), imagery, decodes });
        }
        Ok(())
    }

    /// Reads by another reader from now on.
    fn turn_to(&mut self, reader: Reader) {
        self.reader = Arc::new(reader);
        if let Some(threads) = &mut self.threads {
            threads.turn_to(&self.reader);
        }
    }

    /// Gives the renderer what a view wants: all of it without threads, else what has come, `most` tiles at most.
    ///
    /// # Errors
    /// What the renderer says.
    pub fn serve(
        &mut self,
        renderer: &mut Renderer,
        view: &View,
        ahead: &View,
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
    pub fn is_waiting(&self) -> bool {
        self.is_behind || self.threads.as_ref().is_some_and(Threads::is_reading)
    }

    /// The oldest error of reading that has not been reported yet.
    pub fn take_error(&mut self) -> Option<LayoutError> {
        self.errors.pop_front()
    }

    fn serve_all(&mut self, renderer: &mut Renderer, view: &View) -> Result<Served, RenderError> {
        let mut served = Served::default();
        self.at_hand.clear();
        loop {
            let wanted: Vec<TileId> = renderer.want_imagery(view, usize::MAX).to_vec();
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
        view: &View,
        ahead: &View,
        most: usize,
    ) -> Result<Served, RenderError> {
        let mut served = Served::default();
        let mut come = Vec::new();
        while (served.tiles as usize) < most
            && let Some((is_valid, id, tile)) = threads.take()
        {
            come.push(id);
            // What was read before it changed is not what it is.
            if is_valid && !self.painted.contains_key(&id) {
                self.give(renderer, id, tile, &mut served)?;
            }
        }
        let mut wanted: Vec<TileId> = renderer.want_imagery(view, WANTED).to_vec();
        wanted.extend_from_slice(renderer.want_imagery_ahead(ahead, WANTED_AHEAD));
        // Decoding a tile takes as long as sending many.
        let at_hand = if self.reader.decodes { most } else { AT_HAND };
        self.serve_at_hand(renderer, &mut wanted, at_hand, &mut served)?;
        threads.ask(&come, wanted.into_iter().filter(|id| !self.is_in_trouble(*id)));
        Ok(served)
    }

    /// Gives those of the wanted tiles that are in memory, `most` at most, and takes what need not be read off the list.
    fn serve_at_hand(
        &mut self,
        renderer: &mut Renderer,
        wanted: &mut Vec<TileId>,
        most: usize,
        served: &mut Served,
    ) -> Result<(), RenderError> {
        let mut at_hand = std::mem::take(&mut self.at_hand);
        let before = served.tiles;
        let (mut given, mut left) = (0, 0);
        let mut to_read = Vec::with_capacity(wanted.len());
        for id in wanted.drain(..) {
            let is_painted = self.painted.contains_key(&id);
            if !is_painted && (given == most || !at_hand.contains_key(&id)) {
                to_read.push(id);
            } else if given == most {
                left += 1;
            } else {
                given += 1;
                let tile = match at_hand.remove(&id).filter(|_| !is_painted) {
                    Some(texels) => Ok(texels.and_then(|texels| self.reader.as_taken(texels))),
                    None => self.tile(id),
                };
                self.give(renderer, id, tile, served)?;
            }
        }
        *wanted = to_read;
        // Tiles for which there is no room are no reason for another frame.
        self.is_behind = left > 0 && served.tiles > before;
        Ok(())
    }

    /// A tile as it is now: painted, or else read.
    fn tile(&self, id: TileId) -> Tile {
        let Some(painted) = self.painted.get(&id) else { return self.reader.read(id) };
        let mut tile = Vec::new();
        Ok(if painted.read(&mut tile) { self.reader.as_taken(tile) } else { None })
    }

    fn is_in_trouble(&self, id: TileId) -> bool {
        self.trouble.get(&id).is_some_and(|until| self.frame < *until)
    }

    /// Gives what was read. Tells whether the renderer need not ask for the tile again.
    fn give(
        &mut self,
        renderer: &mut Renderer,
        id: TileId,
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

/// How a device that takes such formats is given tiles of a format: as they are, or decoded.
fn taken_as(own: TileFormat, formats: &[TileFormat]) -> TileFormat {
    if formats.contains(&own) { own } else { TileFormat::Rgba8 }
}
