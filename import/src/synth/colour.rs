//! A made-up photograph: colour from height, slope and noise, over any terrain file, of any size.
//!
//! Water, shore, fields and woods, bare rock where it is steep, scree and snow above; patches of some hundred metres and grain down to the
//! texel. Every texel depends only on the seed, its place and the heights around it, so the number of threads makes no difference. The picture covers the terrain from its first sample to its last
//! and lies in the terrain's reference system: an uncompressed tiled GeoTIFF, BigTIFF above 4 GiB. A row of tiles is made in parallel while
//! the one before is written. Memory: two rows of tiles, 3 KiB a texel of width.

use super::noise::{fractal, hash, signed_unit, smoothstep};
use super::tiff_header;
use rayon::prelude::*;
use std::path::Path;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::file::atomic::AtomicFile;
use terrasoar_layout::file::disk::write_at;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::portable::hypot;
use terrasoar_layout::read::terrain::Terrain;
use terrasoar_layout::with_records;

/// Texels a side of the tiles written.
pub(super) const TILE: u32 = 512;
/// Most texels a side.
const MAX_TEXELS: u64 = 1 << 22;

/// How to colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct ColourOptions {
    /// Which of the pictures.
    pub seed: u64,
    /// Texels along the distance of two samples, 1 to 64; default 1.
    pub texels_a_sample: u32,
}

impl Default for ColourOptions {
    fn default() -> Self {
        Self { seed: 0, texels_a_sample: 1 }
    }
}

impl ColourOptions {
    /// These options with another picture.
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// These options with so many texels along the distance of two samples.
    pub fn texels_a_sample(self, texels_a_sample: u32) -> Self {
        Self { texels_a_sample, ..self }
    }
}

/// Writes a picture of `terrain` to `out`, a GeoTIFF; returns its texels east and north. `progress` is told the rows written, of as many as the picture is high.
///
/// # Errors
/// [`LayoutError::Usage`] for texels a sample out of range or a terrain too large for them; [`LayoutError::Io`] when the file cannot be written.
pub fn write_colour(
    terrain: &Terrain,
    options: &ColourOptions,
    out: &Path,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<[u32; 2], LayoutError> {
    let fine = options.texels_a_sample;
    let sides = terrain.grid().samples().map(|samples| u64::from(samples - 1) * u64::from(fine));
    if !(1..=64).contains(&fine) || sides.iter().any(|side| *side > MAX_TEXELS) {
        return Err(LayoutError::Usage(format!(
            "{fine} texels a sample make {} x {} texels; 1 to 64 a sample and {MAX_TEXELS} a side are made",
            sides[0], sides[1]
        )));
    }
    let texels = sides.map(|side| side as u32);
    let painter = Painter::new(terrain, options, texels)?;
    let file = AtomicFile::create(out)?;
    let failed = |e| LayoutError::io(out, "cannot write the picture", e);
    let header = tiff_header::colour_header(texels, TILE, terrain.header(), fine);
    write_at(file.file(), &header, 0).map_err(failed)?;
    let mut offset = header.len() as u64;
    let rows = texels[1].div_ceil(TILE);
    let (mut made, mut written): (Vec<Vec<u8>>, Vec<Vec<u8>>) = (Vec::new(), Vec::new());
    // One turn more than there are rows of tiles: each makes one and writes the one before.
    for row in 0..=rows {
        made.resize(if row < rows { texels[0].div_ceil(TILE) as usize } else { 0 }, Vec::new());
        let make = || {
            made.par_iter_mut()
                .zip(0..texels[0].div_ceil(TILE))
                .for_each(|(tile, column)| painter.tile([column * TILE, row * TILE], tile));
        };
        let write = || {
            written.iter().try_for_each(|tile| {
                write_at(file.file(), tile, offset).map_err(failed)?;
                offset += tile.len() as u64;
                Ok(())
            })
        };
        let ((), done) = rayon::join(make, write);
        done?;
        progress(u64::from((row * TILE).min(texels[1])));
        std::mem::swap(&mut made, &mut written);
    }
    file.publish()?;
    Ok(texels)
}

struct Painter<'t> {
    terrain: &'t Terrain,
    texels: [u32; 2],
    fine: u32,
    spacing_m: [f64; 2],
    /// Heights of the sea, or of the lowest land, and of the summit.
    range_m: [f64; 2],
    /// Wavelengths of patches and of fields; no finer than texels can show.
    forms_m: [f64; 2],
    seed: u32,
}

impl<'t> Painter<'t> {
    fn new(terrain: &'t Terrain, options: &ColourOptions, texels: [u32; 2]) -> Result<Self, LayoutError> {
        if !terrain.lends_records() {
            return Err(LayoutError::Usage("the terrain must be opened as a map to be coloured".into()));
        }
        terrain.check_directory()?;
        let [low, high] = terrain.header().height_range_m;
        let spacing_m = terrain.grid().spacing_m();
        let texel_m = spacing_m[0].max(spacing_m[1]) / f64::from(options.texels_a_sample);
        Ok(Self {
            terrain,
            texels,
            fine: options.texels_a_sample,
            spacing_m,
            forms_m: [(48.0 * texel_m).max(700.0), (10.0 * texel_m).max(90.0)],
            range_m: [low.max(0.0).min(high), high.max(low + 1.0)],
            seed: hash(options.seed as u32, (options.seed >> 32) as u32, 41),
        })
    }

    /// The tile whose north-west texel is `corner`, columns east and rows south: red, green, blue; what lies beyond the picture repeats its rim.
    fn tile(&self, corner: [u32; 2], rgb: &mut Vec<u8>) {
        let heights = Heights::around(self, corner);
        rgb.clear();
        rgb.reserve((TILE * TILE * 3) as usize);
        for row in 0..TILE {
            let south = (corner[1] + row).min(self.texels[1] - 1);
            for column in 0..TILE {
                let east = (corner[0] + column).min(self.texels[0] - 1);
                rgb.extend(self.texel(&heights, [east, self.texels[1] - 1 - south]));
            }
        }
    }

    /// The colour of a texel, counted from the south-west.
    fn texel(&self, heights: &Heights, place: [u32; 2]) -> [u8; 3] {
        let at = place.map(|p| (f64::from(p) + 0.5) / f64::from(self.fine));
        let (height_m, slope) = heights.at(at, self.spacing_m);
        let [x, y] = [at[0] * self.spacing_m[0], at[1] * self.spacing_m[1]];
        let [patch_m, field_m] = self.forms_m;
        let patches = fractal(self.seed, x / patch_m, y / patch_m, 3, 0.55);
        let fields = fractal(self.seed ^ 0x5bd1, x / field_m, y / field_m, 2, 0.5);
        let grain = f64::from(signed_unit(hash(self.seed, place[0], place[1])));
        let deep = 0.5 + 0.5 * patches;
        let water = [24.0 + 10.0 * deep, 58.0 + 16.0 * deep, 84.0 + 14.0 * deep];
        if height_m <= 0.0 {
            return shade(water, 1.0 + 0.006 * grain);
        }
        let [low, high] = self.range_m;
        let relative = (height_m - low) / (high - low) + 0.05 * patches;
        let meadow = mix([100.0, 112.0, 62.0], [134.0, 128.0, 80.0], 0.5 + 0.6 * fields);
        let woods = mix([46.0, 66.0, 40.0], [58.0, 78.0, 46.0], 0.5 + 0.5 * fields);
        let mut colour = mix(meadow, woods, smoothstep(-0.35, 0.45, patches + 1.5 * (relative - 0.15)));
        let scree = mix([118.0, 110.0, 98.0], [136.0, 128.0, 114.0], 0.5 + 0.6 * fields);
        colour = mix(colour, scree, smoothstep(0.36, 0.64, relative));
        let rock = mix([94.0, 88.0, 82.0], [114.0, 107.0, 99.0], 0.5 + 0.6 * fields);
        colour = mix(colour, rock, smoothstep(0.4, 1.6, slope));
        let snow = smoothstep(0.56, 0.78, relative) * smoothstep(1.8, 0.6, slope);
        colour = mix(colour, [222.0, 226.0, 232.0], snow);
        colour = mix(water, colour, smoothstep(-1.0, 6.0, height_m));
        shade(colour, 1.0 + 0.015 * grain + 0.04 * fields)
    }
}

fn mix(a: [f64; 3], b: [f64; 3], share: f64) -> [f64; 3] {
    let share = share.clamp(0.0, 1.0);
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

fn shade(colour: [f64; 3], factor: f64) -> [u8; 3] {
    colour.map(|value| (value * factor).round().clamp(0.0, 255.0) as u8)
}

/// The samples around one tile.
struct Heights {
    from: [u32; 2],
    wide: usize,
    high: usize,
    metres: Vec<f32>,
}

impl Heights {
    fn around(painter: &Painter<'_>, corner: [u32; 2]) -> Self {
        let samples = painter.terrain.grid().samples();
        let south = painter.texels[1].saturating_sub(corner[1] + TILE);
        let first = [corner[0] / painter.fine, south / painter.fine];
        let from = first.map(|sample| sample.saturating_sub(1));
        let to = [0, 1].map(|i| (first[i] + TILE / painter.fine + 3).min(samples[i] - 1));
        let [wide, high] = [0, 1].map(|i| (to[i] - from[i] + 1) as usize);
        let mut metres = Vec::with_capacity(wide * high);
        // The directory was checked before.
        if let Ok(records) = painter.terrain.records() {
            with_records!(records, records => {
                for y in from[1]..=to[1] {
                    metres.extend((from[0]..=to[0]).map(|x| records.vertex_at(GridPoint::new(x, y)).height_m as f32));
                }
            });
        }
        Self { from, wide, high, metres }
    }

    /// The sample at a column and row of this window; beyond it, the nearest.
    fn sample(&self, x: usize, y: usize) -> f64 {
        f64::from(self.metres[y.min(self.high - 1) * self.wide + x.min(self.wide - 1)])
    }

    /// Height and steepness (rise over run) at a place in samples, both interpolated bilinearly; slopes are those of central differences.
    fn at(&self, place: [f64; 2], spacing_m: [f64; 2]) -> (f64, f64) {
        let [x, y] = [0, 1].map(|i| place[i] - f64::from(self.from[i]));
        let (cell_x, cell_y) = ((x as usize).min(self.wide - 2), (y as usize).min(self.high - 2));
        let (fx, fy) = (x - cell_x as f64, y - cell_y as f64);
        let (mut height, mut east, mut north) = (0.0, 0.0, 0.0);
        for (x, wx) in [(cell_x, 1.0 - fx), (cell_x + 1, fx)] {
            for (y, wy) in [(cell_y, 1.0 - fy), (cell_y + 1, fy)] {
                let weight = wx * wy;
                height += weight * self.sample(x, y);
                let (west, south) = (x.saturating_sub(1), y.saturating_sub(1));
                east += weight * (self.sample(x + 1, y) - self.sample(west, y));
                north += weight * (self.sample(x, y + 1) - self.sample(x, south));
            }
        }
        (height, hypot(east / (2.0 * spacing_m[0]), north / (2.0 * spacing_m[1])))
    }
}
