//! What an editing session changed in the picture, as a value that can go from the session's thread to the thread that draws.
//!
//! Invariant: a drape that takes these values in order shows the picture as the session has it. Cost: a name and a shared pointer for each painted tile; after an undo or a redo also tiles that are read so that
//! they are there for the next picture.

use std::collections::BTreeSet;
use std::sync::Arc;
use terrasoar_layout::LayoutError;
use terrasoar_layout::edit::{EditSession, Repainted};
use terrasoar_layout::file::header::ImageryPlace;
use terrasoar_layout::imagery::{Imagery, PaintedTile, Painter, TileId};
use terrasoar_layout::read::terrain::Terrain;

/// Bytes of tiles that are read beforehand at most: 64 tiles of BC1, what a few strokes change in all levels.
const READ_BYTES: usize = 8 << 20;

/// What became of the picture since the last one of these.
#[derive(Debug)]
pub struct Repaint {
    /// Which picture it is now.
    pub picture: Picture,
    /// Tiles whose bytes are others now.
    pub tiles: BTreeSet<TileId>,
    /// All tiles that are not the file's.
    pub painted: Vec<(TileId, PaintedTile)>,
    /// Tiles among those that changed that are the file's again, as far as they were read: their texels, none where nothing of them is seen.
    pub read: Vec<(TileId, Option<Vec<u8>>)>,
}

/// Which picture a terrain has.
#[derive(Debug)]
pub enum Picture {
    /// The one before.
    Same,
    /// The one before, with tiles that lie elsewhere.
    Moved(PictureFile),
    /// Another, of another shape perhaps.
    Another(PictureFile),
    /// None any more.
    Gone,
}

/// A picture in a file, and how it is read.
#[derive(Debug)]
pub struct PictureFile {
    /// How the file is read.
    pub terrain: Arc<Terrain>,
    /// Where tiles lie in it.
    pub imagery: Imagery,
}

impl PictureFile {
    fn of(painter: &Painter) -> Self {
        Self { terrain: Arc::clone(painter.terrain()), imagery: painter.imagery().clone() }
    }
}

/// Watches the picture of one session for one drape.
#[derive(Debug, Default)]
pub struct PictureWatch {
    /// Where the picture lay when it was told last; none before.
    told: Option<Option<ImageryPlace>>,
}

impl PictureWatch {
    /// What became of the picture since the last call: to be called after paint, a commit, an undo and a redo. Reads tiles that an undo or a redo brought back.
    ///
    /// # Errors
    /// Another picture, which an undo or a redo led to, cannot be read.
    pub fn look(&mut self, session: &mut EditSession) -> Result<Option<Repaint>, LayoutError> {
        let Repainted { tiles, is_another } = session.take_repainted();
        let place = session.header().imagery;
        if is_another {
            let picture =
                session.open_picture()?.map_or(Picture::Gone, |p| Picture::Another(PictureFile::of(p)));
            self.told = Some(place);
            let (tiles, painted, read) = (BTreeSet::new(), Vec::new(), Vec::new());
            return Ok(Some(Repaint { picture, tiles, painted, read }));
        }
        let Some(painter) = session.painter() else { return Ok(None) };
        let is_moved = self.told != Some(place);
        if !is_moved && tiles.is_empty() {
            return Ok(None);
        }
        self.told = Some(place);
        let picture = if is_moved { Picture::Moved(PictureFile::of(painter)) } else { Picture::Same };
        let painted = painter.painted().into_iter().filter_map(|id| Some((id, painter.painted_tile(id)?)));
        Ok(Some(Repaint { picture, painted: painted.collect(), read: read(painter, &tiles), tiles }))
    }
}

/// Reads those of the tiles that are in the file, coarse ones first, up to a bound. One that cannot be read is tried again, and reported, when it is shown.
fn read(painter: &Painter, tiles: &BTreeSet<TileId>) -> Vec<(TileId, Option<Vec<u8>>)> {
    let most = (READ_BYTES / painter.shape().format.tile_bytes()).max(1);
    let files = tiles.iter().rev().filter(|id| painter.painted_tile(**id).is_none());
    let read = |id: &TileId| {
        let mut texels = Vec::new();
        let is_seen = painter.read_tile(*id, &mut texels).ok()?;
        Some((*id, is_seen.then_some(texels)))
    };
    files.take(most).filter_map(read).collect()
}
