//! A pyramid as a picture: rows of texels from the north, of which missing ones are transparent or the nearest coarser ones.
//!
//! A row of tiles is decoded on all threads and kept until its rows are read: in memory where it is small, else in a nameless temporary file. Cost: each tile once.

use super::decode::Stored;
use super::grid::{Span, Tile};
use super::{Pyramid, place_above};
use crate::kept::Kept;
use crate::options::TileOptions;
use crate::reader::{CrsSaid, Picture};
use rayon::prelude::*;
use std::path::Path;
use terrasoar_layout::dem::Georeference;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{ImageInfo, ImageSource, MAX_TEXELS, RowReader};
use terrasoar_layout::remedy::Remedy;

/// Bytes of a row of tiles that are kept in memory.
const MOST_HELD: u64 = 64 << 20;

/// A picture in tiles.
pub(crate) struct TileImage {
    pyramid: Pyramid,
    info: ImageInfo,
}

impl TileImage {
    /// Chooses what is read. `around` is where it is needed: west, south, east and north in degrees.
    pub(crate) fn open(
        path: &Path,
        options: &TileOptions,
        around: Option<[f64; 4]>,
    ) -> Result<Self, LayoutError> {
        let pyramid = Pyramid::open(path, options, around)?;
        let plan = &pyramid.plan;
        plan.check_scattered(path)?;
        if plan.size.iter().any(|side| *side > MAX_TEXELS) {
            let [wide, high] = plan.size;
            return Err(LayoutError::Usage(format!(
                "{}: {wide} x {high} texels are more than the {MAX_TEXELS} on a side that a picture may have; state bounds, or a lower zoom",
                path.display()
            ))
            .mended_by(Remedy::Bounds));
        }
        let mut notes = vec![plan.words.clone()];
        notes.extend(plan.missing.clone());
        let mut bytes = Vec::new();
        let first = plan.samples.first().map(|tile| pyramid.tile(*tile, &mut bytes)).transpose()?.flatten();
        if first.is_some_and(|texels| texels.stored == Stored::Exactly { bits: 16 }) {
            notes.push("16 bits a channel are cut to the upper 8".into());
        }
        let band = band_bytes(&pyramid);
        let info = ImageInfo {
            texels: plan.size,
            georeference: Georeference::default(),
            format: pyramid.format(),
            notes,
            memory_bytes: pyramid.memory_bytes() + if band <= MOST_HELD { band } else { 0 },
        };
        Ok(Self { pyramid, info })
    }

    /// Decodes a tile into the band of its row of tiles, whose first row of texels is `top`.
    fn fill(&self, tile: Tile, top: u32, band: &Kept) -> Result<(), LayoutError> {
        let part = self.pyramid.part(tile);
        let mut bytes = Vec::new();
        let width = part.size[0] as usize;
        let pitch = u64::from(self.info.texels[0]) * 4;
        let put = |row: u32, texels: &[[u8; 4]]| {
            let at = u64::from(part.to[1] - top + row) * pitch + u64::from(part.to[0]) * 4;
            band.write(at, texels.as_flattened())
        };
        if let Some(texels) = self.pyramid.tile(tile, &mut bytes)? {
            for row in 0..part.size[1] {
                let at = ((part.from[1] + row) * texels.side + part.from[0]) as usize;
                put(row, &texels.rgba[at..at + width])?;
            }
            return Ok(());
        }
        let above = self.pyramid.plan.above(&*self.pyramid.archive, tile)?;
        let coarser = above.map(|above| self.pyramid.coarser(above, &mut bytes)).transpose()?.flatten();
        let mut line = vec![[0; 4]; width];
        for row in 0..part.size[1] {
            if let (Some(above), Some(texels)) = (above, &coarser) {
                for (col, to) in (0..part.size[0]).zip(&mut line) {
                    let texel = [part.from[0] + col, part.from[1] + row];
                    let at = place_above(tile, self.pyramid.plan.side, above, texels.side, texel);
                    let [col, row] = at.map(|at| (at as usize).min(texels.side as usize - 1));
                    *to = texels.rgba[row * texels.side as usize + col];
                }
            }
            put(row, &line)?;
        }
        Ok(())
    }
}

/// Bytes of the texels of a row of tiles.
fn band_bytes(pyramid: &Pyramid) -> u64 {
    let plan = &pyramid.plan;
    u64::from(plan.size[0]) * 4 * u64::from(plan.side.min(plan.size[1]))
}

impl Picture for TileImage {
    fn said(&self) -> (Option<[f64; 6]>, CrsSaid) {
        (Some(self.pyramid.place), self.pyramid.crs())
    }

    fn has_bytes(&self) -> bool {
        true
    }
}

impl ImageSource for TileImage {
    fn path(&self) -> &Path {
        self.pyramid.path()
    }

    fn info(&self) -> &ImageInfo {
        &self.info
    }

    fn rows(&self) -> Result<Box<dyn RowReader + '_>, LayoutError> {
        let bytes = band_bytes(&self.pyramid);
        let action = "cannot keep a row of tiles in a temporary file in";
        let band = Kept::new(bytes, bytes <= MOST_HELD, &std::env::temp_dir(), action)?;
        Ok(Box::new(Rows { image: self, band, rows: [0; 2], row: 0, buffer: Vec::new() }))
    }
}

struct Rows<'i> {
    image: &'i TileImage,
    /// The texels of a row of tiles.
    band: Kept,
    /// First row in the band, and the one behind its last.
    rows: [u32; 2],
    row: u32,
    buffer: Vec<u8>,
}

impl Rows<'_> {
    /// Decodes the row of tiles with the next row of texels.
    fn next_band(&mut self) -> Result<(), LayoutError> {
        let pyramid = &self.image.pyramid;
        let (span, side) = (pyramid.plan.span, u64::from(pyramid.plan.side));
        let y = ((pyramid.plan.first[1] + u64::from(self.row)) / side) as u32;
        let tiles = Span { x: span.x, y: [y, y] };
        let part = pyramid.part(tiles.tile(pyramid.plan.zoom, 0));
        self.rows = [part.to[1], part.to[1] + part.size[1]];
        let (image, band, top) = (self.image, &self.band, part.to[1]);
        (0..tiles.count())
            .into_par_iter()
            .map(|i| image.fill(tiles.tile(image.pyramid.plan.zoom, i), top, band))
            // The first tile that fails is named, whichever thread had it.
            .collect::<Vec<_>>()
            .into_iter()
            .collect()
    }
}

impl RowReader for Rows<'_> {
    fn read(&mut self, rgba: &mut [u8]) -> Result<(), LayoutError> {
        let pitch = self.image.info.texels[0] as usize * 4;
        for line in rgba.chunks_exact_mut(pitch) {
            if self.row >= self.rows[1] {
                self.next_band()?;
            }
            let at = u64::from(self.row - self.rows[0]) * pitch as u64;
            self.band.read(at, pitch, &mut self.buffer, |kept| line.copy_from_slice(kept))?;
            self.row += 1;
        }
        Ok(())
    }
}
