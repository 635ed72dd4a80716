//! Painting the picture over the terrain: scorched, filled, restored. Blocks that change are encoded anew, in all levels and all tiles that hold them.
//!
//! [`Painter::paint`] decodes the blocks of 4 x 4 texels that an operation touches, changes texels, and encodes those blocks of which one changed; then the same for each coarser
//! level, whose texels over changed ones become means of what is decoded from the finer one now (`level` has the rule). All tiles that hold a
//! block, in their border too, get the same bytes, so there is no seam. Painted tiles stay in memory until they are given to a commit
//! ([`Painter::section`]); nothing is written here.
//!
//! Invariants: blocks without a changed texel keep their bytes, those that are restored get their old ones; what a batch makes does not depend on how operations are put into
//! batches; a batch that fails changes nothing. Cost of a scorch of 64 x 64 texels, all levels: some 400 blocks decoded and encoded, and the first time a dozen tiles read.

mod blocks;
mod burn;
mod cache;
mod level;
mod operation;
mod section;
mod tile;

pub use burn::Scorch;
pub use operation::{Fill, Paint, Region};
pub use section::PaintedSection;
pub use tile::PaintedTile;

use super::Imagery;
use super::encode::check_format;
use super::shape::{ImageryShape, TileId};
use crate::error::LayoutError;
use crate::file::header::ImageryPlace;
use crate::read::terrain::Terrain;
use blocks::{Grid, Rect};
use cache::{Cache, Files};
use level::{Level, Originals, Work};
use std::collections::HashMap;
use std::sync::Arc;
use tile::Tile;

/// Bytes of tiles that one batch may touch.
const MOST_BYTES: u64 = 1 << 30;

/// What paint, taking it back, an undo or a redo changed of the picture.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PaintChanges {
    /// Tiles whose bytes are others now, each once, borders counted.
    pub tiles: Vec<TileId>,
    /// Rectangles of whole blocks that hold all texels that changed, level by level for each operation; none for what was taken back.
    pub rects: Vec<TexelRect>,
}

/// Texels of a level, both corners included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TexelRect {
    /// Level: 0 is the finest.
    pub level: u32,
    /// South-west texel, counted from the picture's south-west corner.
    pub from: [u32; 2],
    /// North-east texel.
    pub to: [u32; 2],
}

/// The picture of a terrain with paint in memory.
#[derive(Debug)]
pub struct Painter {
    files: Files,
    cache: Cache,
    work: Work,
    /// Tiles given away to be written that are not known to be in the file, as they were then.
    unwritten: HashMap<TileId, Tile>,
}

/// Another state of the picture in the same file, ready to be turned to.
#[derive(Debug)]
pub struct OtherState(Imagery);

impl Painter {
    /// A painter over the imagery of `terrain`; `None` if it has none.
    ///
    /// # Errors
    /// As [`Imagery::open`].
    pub fn open(terrain: Arc<Terrain>) -> Result<Option<Self>, LayoutError> {
        let Some(current) = Imagery::open(&terrain)? else { return Ok(None) };
        let original = current.clone();
        Ok(Some(Self::of(Files { terrain, current, original })))
    }

    /// A painter over the imagery at `current` in a file of `file_bytes` bytes whose picture before all paint is at `original`. `terrain` is how the file is read; it may
    /// have been opened in another state. If the two pictures have not the same shape, `current` counts as the one before all paint.
    ///
    /// # Errors
    /// As [`Imagery::open`].
    pub fn open_at(
        terrain: Arc<Terrain>,
        current: ImageryPlace,
        original: ImageryPlace,
        file_bytes: u64,
    ) -> Result<Self, LayoutError> {
        let current = Imagery::open_at(&terrain, current, file_bytes)?;
        let original = Imagery::open_at(&terrain, original, file_bytes)?;
        let original = if original.shape() == current.shape() { original } else { current.clone() };
        Ok(Self::of(Files { terrain, current, original }))
    }

    fn of(files: Files) -> Self {
        Self { files, cache: Cache::default(), work: Work::default(), unwritten: HashMap::new() }
    }

    /// What all tiles have in common, and where the picture lies.
    pub fn shape(&self) -> ImageryShape {
        self.files.current.shape()
    }

    /// The picture as the file has it, before what is painted in memory.
    pub fn imagery(&self) -> &Imagery {
        &self.files.current
    }

    /// How the file is read: tiles of [`Painter::imagery`] through this one, whatever state it was opened in.
    pub fn terrain(&self) -> &Arc<Terrain> {
        &self.files.terrain
    }

    /// Paints a batch in order, all of it or, on an error, nothing.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for numbers that cannot be used, for more at once than fits memory, and for a format this build has no encoder for; damage, naming the
    /// tile, and I/O of tiles that it needs.
    pub fn paint(&mut self, paints: &[Paint]) -> Result<PaintChanges, LayoutError> {
        self.work.batch = self.cache.begin();
        let mut originals = Originals::new();
        if let Err(error) = self.gather(paints, &mut originals) {
            self.cache.trim();
            return Err(error);
        }
        let mut rects = Vec::new();
        for paint in paints {
            self.apply(paint, &originals, &mut rects);
        }
        drop(originals);
        self.cache.trim();
        Ok(PaintChanges { tiles: std::mem::take(&mut self.work.tiles), rects })
    }

    /// Checks a batch and has all in memory that it needs, so that [`Painter::paint`] of it, called next, cannot fail.
    ///
    /// # Errors
    /// As [`Painter::paint`].
    pub fn prepare(&mut self, paints: &[Paint]) -> Result<(), LayoutError> {
        self.cache.begin();
        self.gather(paints, &mut Originals::new())
    }

    fn gather(&mut self, paints: &[Paint], originals: &mut Originals) -> Result<(), LayoutError> {
        let shape = self.shape();
        paints.iter().try_for_each(Paint::check)?;
        check_format(shape.format)?;
        let tile_bytes = shape.format.tile_bytes() as u64;
        let mut bytes = 0;
        for paint in paints {
            let Some(texels) = paint.texels(&shape) else { continue };
            let mut blocks = texels.shrunk(4);
            for level in 0..shape.levels {
                for id in Grid::of(&shape, level).tiles_of(blocks) {
                    if !self.cache.holds(id) {
                        bytes += tile_bytes;
                    }
                    if bytes > MOST_BYTES {
                        return Err(too_much(&shape));
                    }
                    self.cache.need(&self.files, id)?;
                    if paint.restored().is_some()
                        && !originals.contains_key(&id)
                        && let Some(tile) = self.cache.get(id)
                    {
                        let original = match tile.differing_count {
                            0 => tile.bytes().cloned(),
                            _ => self.files.original(id)?.map(Arc::new),
                        };
                        originals.insert(id, original);
                    }
                }
                blocks = blocks.shrunk(2);
            }
        }
        Ok(())
    }

    fn apply(&mut self, paint: &Paint, originals: &Originals, rects: &mut Vec<TexelRect>) {
        let shape = self.shape();
        let Some(texels) = paint.texels(&shape) else { return };
        let mut grid = Grid::of(&shape, 0);
        let (cache, work) = (&mut self.cache, &mut self.work);
        let mut level = Level { shape: &shape, grid, cache, work, originals };
        let mut changed = match (paint.brush(), paint.restored()) {
            (Some(brush), _) => level.paint(&brush, texels),
            (None, Some(region)) => level.restore(region, texels),
            (None, None) => None,
        };
        while let Some(blocks) = changed {
            rects.push(texel_rect(grid, blocks));
            let finer = grid;
            if finer.level + 1 == shape.levels {
                return;
            }
            grid = Grid::of(&shape, finer.level + 1);
            level.grid = grid;
            changed = level.coarsen(finer, blocks, paint.restored().is_some());
        }
    }

    /// Fills `texels` with a whole tile as it is now, as [`Imagery::read_tile`] does.
    ///
    /// # Errors
    /// As [`Imagery::read_tile`].
    pub fn read_tile(&self, id: TileId, texels: &mut Vec<u8>) -> Result<bool, LayoutError> {
        match self.cache.get(id) {
            Some(tile) => Ok(tile.shared().read(texels)),
            None => self.files.current.read_tile(&self.files.terrain, id, texels),
        }
    }

    /// A tile that is not the file's, for a thread that shows it; `None` if the file has it as it is.
    pub fn painted_tile(&self, id: TileId) -> Option<PaintedTile> {
        let is_ours = |tile: &&Tile| tile.is_painted || tile.is_unwritten;
        self.cache.get(id).filter(is_ours).map(Tile::shared)
    }

    /// Tiles that are not the file's.
    pub fn painted(&self) -> Vec<TileId> {
        self.cache.those(|tile| tile.is_painted || tile.is_unwritten)
    }

    /// Whether all paint is in the file.
    pub fn is_committed(&self) -> bool {
        self.painted().is_empty()
    }

    /// What is to be written to the file from page `first_page` on, and what its header is to say, so that it holds all paint so far; `None` if the file does so already.
    /// [`Painter::committed`] is to be called once it is there. If that fails, the next section has it too. Paint may go on meanwhile.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] for a file that would become too long.
    pub fn section(&mut self, first_page: u32) -> Result<Option<PaintedSection>, LayoutError> {
        let ids = self.painted();
        let section = PaintedSection::of(self, &ids, first_page)?;
        for id in ids {
            let Some(tile) = self.cache.get_mut(id) else { continue };
            tile.is_painted = false;
            tile.is_unwritten = section.is_some();
            if section.is_some() {
                self.unwritten.insert(id, tile.clone());
            }
        }
        if section.is_none() {
            self.unwritten.clear();
        }
        Ok(section)
    }

    /// Takes notice that a section is the file's imagery now. The terrain's source must reach what was written, as plain reads do.
    pub fn committed(&mut self, section: PaintedSection) {
        self.files.current = section.imagery;
        self.unwritten.clear();
        self.cache.mark_written();
    }

    /// Takes notice that a section was not written: what it held counts as painted since the one before.
    pub fn failed(&mut self) {
        for id in std::mem::take(&mut self.unwritten).into_keys() {
            if let Some(tile) = self.cache.get_mut(id) {
                tile.is_unwritten = false;
                tile.is_painted = true;
            }
        }
    }

    /// Takes back all paint since the last [`Painter::section`] that has not failed, or since the painter was opened.
    pub fn roll_back(&mut self) -> PaintChanges {
        let tiles = self.cache.those(|tile| tile.is_painted);
        for id in &tiles {
            match self.unwritten.get(id) {
                Some(tile) => self.cache.put(*id, tile.clone()),
                None => self.cache.forget(&[*id]),
            }
        }
        PaintChanges { tiles, rects: Vec::new() }
    }

    /// Another state of the picture in a file of `file_bytes` bytes, for an undo or a redo; `None` if it is a picture of another shape, which takes a new painter.
    ///
    /// # Errors
    /// [`LayoutError::Usage`] while paint is not committed; as [`Imagery::open`].
    pub fn state_at(&self, place: ImageryPlace, file_bytes: u64) -> Result<Option<OtherState>, LayoutError> {
        if !self.is_committed() {
            return Err(LayoutError::Usage(format!(
                "{}: there is paint that is not committed; commit it or take it back first",
                self.files.terrain.path().display()
            )));
        }
        let imagery = Imagery::open_at(&self.files.terrain, place, file_bytes)?;
        Ok((imagery.shape() == self.shape()).then_some(OtherState(imagery)))
    }

    /// Goes over to another state of the picture. Which tiles change is found by comparing directories.
    pub fn turn_to(&mut self, state: OtherState) -> PaintChanges {
        let tiles = self.files.current.differing(&state.0);
        self.cache.forget(&tiles);
        self.files.current = state.0;
        PaintChanges { tiles, rects: Vec::new() }
    }
}

fn texel_rect(grid: Grid, blocks: Rect) -> TexelRect {
    TexelRect {
        level: grid.level,
        from: blocks.from.map(|block| 4 * block as u32),
        to: [0, 1].map(|axis| (4 * blocks.to[axis] + 3).min(grid.texels[axis] - 1) as u32),
    }
}

fn too_much(shape: &ImageryShape) -> LayoutError {
    let side = (MOST_BYTES / shape.format.tile_bytes() as u64 * 3 / 4).isqrt() * 504;
    LayoutError::Usage(format!(
        "this much paint takes more than {} MiB of tiles at once; paint regions of at most {side} x {side} texels, and commit in between",
        MOST_BYTES >> 20
    ))
}
