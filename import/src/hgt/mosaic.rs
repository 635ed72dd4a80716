//! Merges `.hgt` tiles into one grid.
//!
//! The grid is cut into one cell a degree. A cell pushes the samples of its own tile without the tile's
//! last row and column, which the cells to the south and east push as their first; at the grid's
//! southern and eastern edge a cell pushes its last ones too. So every sample is pushed once.
//!
//! Where tiles share a sample, the first of them that is not void gives it, in this order: the
//! cell's own tile, then its neighbour to the north, to the west, to the north-west. Memory: two bands
//! of rows a worker.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::super::WINDOW_SAMPLES;
use super::super::input;
use super::super::parallel::each_task;
use super::tile::Tile;
use super::unpacked::{Unpacked, WORKERS};
use crate::guard::is_ours;
use terrasoar_layout::dem::{SampleSink, Warning, Window};
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::words::harmless;

const VOID: i16 = -32768;

/// Cells a mosaic may span for each tile it has: scattered tiles are a mistake, or several data sets.
const CELLS_PER_TILE: u64 = 1000;

/// Tiles with their places in the grid.
#[derive(Debug)]
pub(super) struct Mosaic {
    /// Samples along a tile's sides: columns, rows.
    pub(super) sides: [u32; 2],
    pub(super) samples_wide: u32,
    pub(super) samples_high: u32,
    /// Latitude and longitude of the first sample, unless the only tile's name does not say.
    pub(super) north_west: Option<(f64, f64)>,
    cells_wide: u32,
    cells_high: u32,
    tiles: Vec<Tile>,
    /// Numbers of tiles by (cell row from the north, cell column from the west).
    places: BTreeMap<(u32, u32), usize>,
    unpacked: Unpacked,
    /// Whether a tile of several that cannot be read is an error, where it would be void.
    pub(super) strict: bool,
    /// Tiles that could not be read, and why.
    lost: Mutex<BTreeMap<usize, String>>,
}

impl Mosaic {
    /// Works out where the tiles lie and that they fit together.
    pub(super) fn place(tiles: Vec<Tile>) -> Result<Self, LayoutError> {
        let mut corners: Vec<(i32, i32)> = Vec::with_capacity(tiles.len());
        let sides = match tiles.first() {
            Some(first) => first.samples,
            None => return Err(LayoutError::Usage("no .hgt tile was named".into())),
        };
        for tile in &tiles {
            if tile.samples != sides {
                return Err(unlike(&tiles[0], tile));
            }
            match tile.corner() {
                Some(corner) => corners.push(corner),
                None if tiles.len() == 1 => {
                    return Self::with_cells(sides, None, (1, 1), vec![(0, 0)], tiles);
                }
                None => {
                    return Err(LayoutError::Usage(format!(
                        "{}: the name does not say where the tile lies; in a mosaic name every tile by its south-west \
                         corner, like N29E080.hgt",
                        tile.shown()
                    )));
                }
            }
        }
        join_across_antimeridian(&mut corners);
        let south = corners.iter().map(|c| c.0).min().unwrap_or(0);
        let north = corners.iter().map(|c| c.0).max().unwrap_or(0);
        let west = corners.iter().map(|c| c.1).min().unwrap_or(0);
        let east = corners.iter().map(|c| c.1).max().unwrap_or(0);
        let cells = (north.abs_diff(south) + 1, east.abs_diff(west) + 1);
        let placed = corners.iter().map(|c| (north.abs_diff(c.0), c.1.abs_diff(west))).collect();
        Self::with_cells(sides, Some((f64::from(north + 1), f64::from(west))), cells, placed, tiles)
    }

    fn with_cells(
        sides: [u32; 2],
        north_west: Option<(f64, f64)>,
        (cells_high, cells_wide): (u32, u32),
        placed: Vec<(u32, u32)>,
        tiles: Vec<Tile>,
    ) -> Result<Self, LayoutError> {
        let samples = |cells: u32, side: u32| {
            u32::try_from(u64::from(cells) * u64::from(side - 1) + 1).map_err(|_| {
                LayoutError::Usage(format!(
                    "a mosaic of {cells} tiles in a line has too many samples; name fewer"
                ))
            })
        };
        let (samples_high, samples_wide) = (samples(cells_high, sides[1])?, samples(cells_wide, sides[0])?);
        if u64::from(cells_high) * u64::from(cells_wide) > CELLS_PER_TILE * placed.len() as u64 {
            return Err(LayoutError::Usage(format!(
                "the {} tiles lie scattered over {cells_wide} x {cells_high} degrees, nearly all of it void; name tiles \
                 that belong together",
                placed.len()
            )));
        }
        let mut places = BTreeMap::new();
        for (number, cell) in placed.into_iter().enumerate() {
            if let Some(earlier) = places.insert(cell, number) {
                return Err(LayoutError::Usage(format!(
                    "{} and {} are the same tile; name each tile once",
                    tiles[earlier].shown(),
                    tiles[number].shown()
                )));
            }
        }
        let unpacked = Unpacked::default();
        Ok(Self {
            sides,
            samples_wide,
            samples_high,
            north_west,
            cells_wide,
            cells_high,
            tiles,
            places,
            unpacked,
            strict: false,
            lost: Mutex::default(),
        })
    }

    /// Memory that packed tiles take.
    pub(super) fn memory_bytes(&self) -> u64 {
        let packed = self.tiles.iter().filter(|tile| tile.is_packed());
        packed.take(Unpacked::MOST).map(Tile::bytes).sum()
    }

    /// Pushes every sample of the grid once.
    pub(super) fn stream(&self, sink: &dyn SampleSink) -> Result<(), LayoutError> {
        let [across_side, down_side] = self.sides;
        let band_rows =
            u32::try_from(WINDOW_SAMPLES / u64::from(across_side)).unwrap_or(u32::MAX).clamp(1, down_side);
        let bands = u64::from(down_side.div_ceil(band_rows));
        let workers = if self.tiles.iter().any(Tile::is_packed) { WORKERS } else { usize::MAX };
        let tasks = u64::from(self.cells_wide) * u64::from(self.cells_high) * bands;
        let streamed = each_task(
            tasks,
            workers,
            || Ok(()),
            |(), task| {
                let cell = task / bands;
                // Both are below the number of cells along a side, and bands below the side.
                let (down, across) =
                    ((cell / u64::from(self.cells_wide)) as u32, (cell % u64::from(self.cells_wide)) as u32);
                let first = (task % bands) as u32 * band_rows;
                let height = if down + 1 == self.cells_high { down_side } else { down_side - 1 };
                let width = if across + 1 == self.cells_wide { across_side } else { across_side - 1 };
                if first >= height {
                    return Ok(());
                }
                let rows = band_rows.min(height - first);
                let window = Window {
                    col: across * (across_side - 1),
                    row: down * (down_side - 1) + first,
                    width,
                    height: rows,
                };
                match self.band((down, across), first, rows, width)? {
                    Some(samples) => sink.put(window, &samples),
                    None => sink.put_void(window),
                }
            },
        );
        self.unpacked.clear();
        streamed
    }

    /// The samples of a cell's rows `first..first + rows` and its first `width` columns; `None` if all are void.
    fn band(
        &self,
        cell: (u32, u32),
        first: u32,
        rows: u32,
        width: u32,
    ) -> Result<Option<Vec<f64>>, LayoutError> {
        let (down, across) = cell;
        let side = self.sides[0] as usize;
        let width = width as usize;
        let mut heights = vec![VOID; width * rows as usize];
        if let Some(own) = self.rows_of(Some(down), Some(across), first, rows)? {
            for (to, from) in heights.chunks_exact_mut(width).zip(own.chunks_exact(side)) {
                to.copy_from_slice(&from[..width]);
            }
        }
        let last = self.sides[1] - 1;
        if first == 0
            && heights[..width].contains(&VOID)
            && let Some(north) = self.rows_of(down.checked_sub(1), Some(across), last, 1)?
        {
            heights[..width].iter_mut().zip(&north).for_each(|(to, from)| fill(to, *from));
        }
        if heights.iter().step_by(width).any(|height| *height == VOID)
            && let Some(west) = self.rows_of(Some(down), across.checked_sub(1), first, rows)?
        {
            let borders = west.chunks_exact(side).map(|row| row[side - 1]);
            heights.iter_mut().step_by(width).zip(borders).for_each(|(to, from)| fill(to, from));
        }
        if first == 0
            && heights[0] == VOID
            && let Some(corner) = self.rows_of(down.checked_sub(1), across.checked_sub(1), last, 1)?
        {
            heights[0] = corner[side - 1];
        }
        if heights.iter().all(|height| *height == VOID) {
            return Ok(None);
        }
        let to_sample = |height: i16| if height == VOID { f64::NAN } else { f64::from(height) };
        Ok(Some(heights.into_iter().map(to_sample).collect()))
    }

    /// Whole rows of the tile in a cell, or `None` where there is no tile.
    fn rows_of(
        &self,
        down: Option<u32>,
        across: Option<u32>,
        first: u32,
        rows: u32,
    ) -> Result<Option<Vec<i16>>, LayoutError> {
        let (Some(down), Some(across)) = (down, across) else {
            return Ok(None);
        };
        let Some(number) = self.places.get(&(down, across)) else {
            return Ok(None);
        };
        if self.lost().contains_key(number) {
            return Ok(None);
        }
        match self.rows_in(*number, first, rows) {
            Ok(rows) => Ok(Some(rows)),
            Err(error) if self.strict || self.tiles.len() == 1 || is_ours(&error) => Err(error),
            Err(error) => {
                self.lost().insert(*number, error.to_string());
                Ok(None)
            }
        }
    }

    fn lost(&self) -> MutexGuard<'_, BTreeMap<usize, String>> {
        self.lost.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What to say of tiles that could not be read.
    pub(super) fn warnings(&self) -> Vec<Warning> {
        let left_out = |why: &String| {
            Warning::new(format!("{}; where it could not be read the ground is void", harmless(why, 360)))
        };
        self.lost().values().map(left_out).collect()
    }

    /// Whole rows of a tile.
    fn rows_in(&self, number: usize, first: u32, rows: u32) -> Result<Vec<i16>, LayoutError> {
        let tile = &self.tiles[number];
        let row_bytes = self.sides[0] as usize * 2;
        let (begin, length) = (first as usize * row_bytes, rows as usize * row_bytes);
        let heights =
            |bytes: &[u8]| bytes.chunks_exact(2).map(|pair| i16::from_be_bytes([pair[0], pair[1]])).collect();
        if tile.is_packed() {
            // A tile is unpacked to its whole length, or refused.
            return Ok(heights(&self.unpacked.bytes(number, tile)?[begin..begin + length]));
        }
        let path = tile.path();
        let mut bytes = vec![0; length];
        let mut file = input::open(path, "cannot open the .hgt tile")?;
        let read = file.seek(SeekFrom::Start(begin as u64)).and_then(|_| file.read_exact(&mut bytes));
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => LayoutError::damaged(
                path,
                format!("row {first}"),
                "the tile was cut short while it was read; start again",
            ),
            _ => LayoutError::io(path, "cannot read the .hgt tile", source),
        })?;
        Ok(heights(&bytes))
    }
}

/// Tiles of unlike size, in words. It is [`LayoutError::Unsupported`] here, for files of any grids can be joined elsewhere.
fn unlike(first: &Tile, other: &Tile) -> LayoutError {
    let [[a, b], [c, d]] = [other.samples, first.samples];
    let why = if b == d {
        "towards the poles tiles have fewer columns (half as many from 50 degrees north on), and a mosaic needs tiles of one width"
    } else {
        "a mosaic needs tiles of one resolution"
    };
    LayoutError::unsupported(
        other.path(),
        format!(
            "this tile has {a} x {b} heights and {} has {c} x {d}; {why}: build them apart, or join them first: gdalwarp -r bilinear FILES all.tif",
            first.shown()
        ),
    )
}

/// Takes a neighbour's height where there is none.
fn fill(height: &mut i16, neighbour: i16) {
    if *height == VOID {
        *height = neighbour;
    }
}

/// Tiles on both sides of 180 degrees are close together if the western hemisphere is counted on past 180.
fn join_across_antimeridian(corners: &mut [(i32, i32)]) {
    let span = |longitudes: &mut dyn Iterator<Item = i32>| {
        longitudes
            .fold(None, |span: Option<(i32, i32)>, x| {
                Some(span.map_or((x, x), |(a, b)| (a.min(x), b.max(x))))
            })
            .map_or(0, |(a, b)| b - a)
    };
    let past = |longitude: i32| if longitude < 0 { longitude + 360 } else { longitude };
    let plain = span(&mut corners.iter().map(|c| c.1));
    let shifted = span(&mut corners.iter().map(|c| past(c.1)));
    if plain > 180 && shifted < plain {
        corners.iter_mut().for_each(|corner| corner.1 = past(corner.1));
    }
}
