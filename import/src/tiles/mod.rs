//! Pyramids of web-map tiles: folders of `zoom/column/row.png`, MBTiles and PMTiles, as elevation data ([`TileDem`]) and as pictures ([`TileImage`]).
//!
//! One zoom is read ([`plan`]), as a grid in EPSG:3857 whose texels are areas: the edges of tiles are edges of texels. A missing tile is made of the nearest coarser one up to [`plan::MOST_ABOVE`] zooms above, if there is one; else it is void or transparent.
//! Tiles are looked up one by one and decoded on all threads; no tile is listed in memory. Of elevation data what lies between tiles is passed over ([`met`]). Cost: a look at each tile's entry to count them and
//! another to see where they lie, then each tile decoded once.

mod about;
mod archive;
mod curve;
mod decode;
mod dem;
mod directory;
mod folder;
mod grid;
mod image;
#[cfg(feature = "mbtiles")]
mod mbtiles;
mod met;
mod packing;
mod plan;
mod pmtiles;
mod seam;

use crate::input;
use crate::options::TileOptions;
use crate::reader::{CrsSaid, Said};
use archive::Archive;
use decode::{Texels, decode, most_bytes, most_of_all};
pub(crate) use dem::TileDem;
use folder::Folder;
use grid::Tile;
pub(crate) use image::TileImage;
use plan::Plan;
use std::io::Read;
use std::path::{Path, PathBuf};
use terrasoar_layout::error::LayoutError;

/// How an SQLite database begins.
const SQLITE: &[u8] = b"SQLite format 3\0";

/// Whether the file that begins so may be MBTiles: an SQLite database that does not say it is something else.
pub(crate) fn is_mbtiles(path: &Path, head: &[u8]) -> bool {
    // The number of the application that made it.
    let is_another = head.get(68..72).is_some_and(|id| id.starts_with(b"GP"));
    let is_ours = head.get(68..72) == Some(b"MPBX") || crate::identify::is_called(path, "mbtiles");
    head.starts_with(SQLITE) && is_ours && !is_another
}

/// Whether the file that begins so is PMTiles.
pub(crate) fn is_pmtiles(head: &[u8]) -> bool {
    head.starts_with(pmtiles::MAGIC) && head.len() > pmtiles::MAGIC.len()
}

/// Whether the folder at `path` holds tiles.
pub(crate) fn is_folder(path: &Path) -> bool {
    folder::is_folder(path)
}

/// Whether there is a pyramid at `path`. Reads the head of a file, or looks into a folder.
pub(crate) fn is_pyramid(path: &Path) -> bool {
    if path.is_dir() {
        return folder::is_folder(path);
    }
    let mut head = Vec::new();
    let read = input::open(path, "cannot read the image").map(|file| file.take(100).read_to_end(&mut head));
    matches!(read, Ok(Ok(_))) && (is_mbtiles(path, &head) || is_pmtiles(&head))
}

/// Refuses a request for a part of a pyramid where none of `paths` is one: the whole of something else would be read without a word.
pub(crate) fn check_asked(paths: &[PathBuf], options: &TileOptions) -> Result<(), LayoutError> {
    if *options == TileOptions::default() || paths.iter().any(|path| is_pyramid(path)) {
        return Ok(());
    }
    Err(LayoutError::Usage(
        "zoom, bounds and the order of tiles are for pyramids of map tiles, and none was named; leave them out, or cut the data before: gdal_translate -projwin WEST NORTH EAST SOUTH \
         INPUT output.tif"
            .into(),
    ))
}

/// A pyramid, and what of it is read.
struct Pyramid {
    archive: Box<dyn Archive>,
    plan: Plan,
    /// Where columns and rows lie.
    place: [f64; 6],
}

fn archive_of(path: &Path, options: &TileOptions) -> Result<Box<dyn Archive>, LayoutError> {
    if path.is_dir() {
        return Ok(Box::new(Folder::open(path, options.from_south)?));
    }
    if options.from_south {
        return Err(LayoutError::Usage(format!(
            "{}: only rows of a folder can be counted from the south by choice; MBTiles and PMTiles always say; leave that out",
            path.display()
        )));
    }
    let mut head = Vec::new();
    let action = "cannot read the tiles";
    let read = input::open(path, action)?.take(16).read_to_end(&mut head);
    read.map_err(|source| LayoutError::io(path, action, source))?;
    if is_pmtiles(&head) { Ok(Box::new(pmtiles::Pmtiles::open(path)?)) } else { mbtiles_of(path) }
}

#[cfg(feature = "mbtiles")]
fn mbtiles_of(path: &Path) -> Result<Box<dyn Archive>, LayoutError> {
    Ok(Box::new(mbtiles::Mbtiles::open(path)?))
}

#[cfg(not(feature = "mbtiles"))]
fn mbtiles_of(path: &Path) -> Result<Box<dyn Archive>, LayoutError> {
    Err(LayoutError::unsupported(
        path,
        "this is MBTiles, and this program was built without (its feature mbtiles); use one that was built with it, or convert the file: pmtiles convert INPUT output.pmtiles",
    ))
}

impl Pyramid {
    /// Opens it and chooses what is read. `around` is where it is needed: west, south, east and north in degrees.
    fn open(path: &Path, options: &TileOptions, around: Option<[f64; 4]>) -> Result<Self, LayoutError> {
        let archive = archive_of(path, options)?;
        let about = archive.about();
        let format = about.format.as_deref().unwrap_or_default();
        if ["pbf", "mvt", "vector", "avif"].iter().any(|word| format.to_ascii_lowercase().contains(word)) {
            return Err(LayoutError::unsupported(
                path,
                format!("its tiles are {format}, and read are pictures: PNG, WebP and JPEG"),
            ));
        }
        if let Some(system) = &about.other_system {
            return Err(LayoutError::unsupported(
                path,
                format!(
                    "its tiles are in {system}, and read are those of web maps, in EPSG:3857; make them again in that system, for example with gdal2tiles.py and its profile mercator"
                ),
            ));
        }
        let plan = Plan::new(&*archive, options, around)?;
        let place = grid::place(plan.zoom, plan.side, plan.first);
        Ok(Self { archive, plan, place })
    }

    fn path(&self) -> &Path {
        self.archive.path()
    }

    fn format(&self) -> String {
        format!("{} of zoom {}", self.archive.kind(), self.plan.zoom)
    }

    /// The system of web maps.
    fn crs(&self) -> CrsSaid {
        CrsSaid { code: Some(Said::new(3857, "the tiles")), ..CrsSaid::default() }
    }

    /// Memory that reading takes on the threads of now.
    fn memory_bytes(&self) -> u64 {
        let texels = u64::from(self.plan.side) * u64::from(self.plan.side);
        // The bytes, what the decoder makes of them, colours and heights; and the same of a coarser tile.
        let tile = texels * (4 + 8 + 4 + 8);
        let thread = 2 * tile + (1 << 20);
        self.archive.memory_bytes() + rayon::current_num_threads() as u64 * thread
    }

    /// A tile of the zoom that is read; `None` where it is missing.
    fn tile(&self, tile: Tile, bytes: &mut Vec<u8>) -> Result<Option<Texels>, LayoutError> {
        let side = self.plan.side;
        if !self.archive.fetch(tile, most_bytes(side), bytes)? {
            return Ok(None);
        }
        let texels = decode(self.path(), || self.archive.label(tile), bytes)?;
        if texels.side != side {
            return Err(LayoutError::damaged(
                self.path(),
                self.archive.label(tile),
                format!(
                    "it has {other} x {other} texels, and others of zoom {} have {side} x {side}; make all tiles of a zoom of one size",
                    self.plan.zoom,
                    other = texels.side
                ),
            ));
        }
        Ok(Some(texels))
    }

    /// A coarser tile that there is, of whatever size.
    fn coarser(&self, tile: Tile, bytes: &mut Vec<u8>) -> Result<Option<Texels>, LayoutError> {
        if !self.archive.fetch(tile, most_of_all(), bytes)? {
            return Ok(None);
        }
        decode(self.path(), || self.archive.label(tile), bytes).map(Some)
    }

    /// The part of a tile that is read: its first column and row, and how many.
    fn part(&self, tile: Tile) -> Part {
        let plan = &self.plan;
        let side = u64::from(plan.side);
        let along = |tile: u32, i: usize| {
            let (first, end) = (u64::from(tile) * side, (u64::from(tile) + 1) * side);
            let low = first.max(plan.first[i]);
            let high = end.min(plan.first[i] + u64::from(plan.size[i]));
            // Tiles of the plan's span have texels in it.
            [low - plan.first[i], low - first, high.saturating_sub(low)].map(|texel| texel as u32)
        };
        let ([col, left, width], [row, top, height]) = (along(tile.x, 0), along(tile.y, 1));
        Part { to: [col, row], from: [left, top], size: [width, height] }
    }
}

/// A part of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Part {
    /// Its first column and row in what is read.
    to: [u32; 2],
    /// Its first column and row in the tile.
    from: [u32; 2],
    size: [u32; 2],
}

/// Where a texel of a missing tile lies among those of a coarser one, counted from the corner: a texel's centre is at half.
fn place_above(missing: Tile, side: u32, above: Tile, above_side: u32, texel: [u32; 2]) -> [f64; 2] {
    let levels = missing.zoom - above.zoom;
    let off = [missing.x - (above.x << levels), missing.y - (above.y << levels)];
    let scale = f64::from(above_side) / (f64::from(side) * f64::from(1u32 << levels));
    [0, 1].map(|i| (f64::from(off[i]) * f64::from(side) + f64::from(texel[i]) + 0.5) * scale)
}
