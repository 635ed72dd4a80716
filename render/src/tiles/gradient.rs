//! Content for shading: the slope of the ground east and north, as two half-precision numbers.
//!
//! They are slopes and not normals, because then exaggeration is a factor and filtering is linear. Each of the
//! `TILE_CELLS + 1` squared grid points of a tile has the central difference of its neighbours, so neighbouring tiles
//! agree on their common edge and bilinear filtering never looks outside.

use super::{Pyramid, TILE_CELLS};
use crate::error::{RenderError, Result};
use crate::view::TerrainShape;
use terrasoar::ground::HeightTile;
use terrasoar_layout::imagery::TileId;

/// Grid points beyond each side of a tile whose heights are needed for the slopes on its edge.
pub(crate) const TILE_BORDER: u32 = 1;

/// Heights a tile is made from: `TILE_CELLS + 1` grid points a side and the border, squared.
pub const HEIGHTS_PER_TILE: usize = (SIDE * SIDE) as usize;

const SIDE: u32 = TILE_CELLS + 1 + 2 * TILE_BORDER;

pub(crate) const GRADIENT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg16Float;

/// The samples that a tile of slopes is made from, its border included.
pub fn height_tile(tile: TileId) -> HeightTile {
    let step = 1 << tile.level.min(31);
    let first = |at: u32| (i64::from(at) * i64::from(TILE_CELLS) - i64::from(TILE_BORDER)) * i64::from(step);
    HeightTile { south_west: [first(tile.x), first(tile.y)], step, side: SIDE }
}

/// Turns heights into the bytes of a tile.
///
/// `heights_m` holds [`HEIGHTS_PER_TILE`] heights in metres before exaggeration, row by row from the south-west, where the tile's columns and rows
/// ([`height_tile`]) cross. Heights that are not finite (voids) count as level with
/// their neighbours. Averages over a cell make calmer pictures than plain samples on coarse levels; either will do.
///
/// # Errors
///
/// [`RenderError::TileSize`], [`RenderError::NoSuchTile`].
pub fn pack_gradients(terrain: &TerrainShape, tile: TileId, heights_m: &[f32]) -> Result<Vec<u8>> {
    if !Pyramid::over(terrain.samples).contains(tile) {
        return Err(RenderError::NoSuchTile { tile: tile.to_string() });
    }
    if heights_m.len() != HEIGHTS_PER_TILE {
        return Err(RenderError::TileSize {
            tile: tile.to_string(),
            expected: HEIGHTS_PER_TILE,
            got: heights_m.len(),
        });
    }
    let lines = [0, 1].map(|axis| height_tile(tile).lines(terrain.samples, axis).collect::<Vec<u32>>());
    // Repeated samples beyond the edge of the data make differences over one cell, not two.
    let run = |axis: usize, i: u32| {
        let [before, after] = [i - 1, i + 1].map(|i| lines[axis][i as usize]);
        f64::from(after - before) * terrain.spacing_m[axis]
    };
    let height = |i: u32, j: u32| heights_m[(j * SIDE + i) as usize];
    let slope = |low: f32, middle: f32, high: f32, run_m: f64| {
        let known = |h: f32| if h.is_finite() { h } else { middle };
        let rise = f64::from(known(high)) - f64::from(known(low));
        if run_m > 0.0 && rise.is_finite() { (rise / run_m) as f32 } else { 0.0 }
    };
    let points = TILE_BORDER..SIDE - TILE_BORDER;
    let run_east: Vec<f64> = points.clone().map(|i| run(0, i)).collect();
    let mut bytes = Vec::with_capacity(4 * (TILE_CELLS + 1).pow(2) as usize);
    for j in points.clone() {
        let run_north_m = run(1, j);
        for (i, run_east_m) in points.clone().zip(&run_east) {
            let here = height(i, j);
            let east = slope(height(i - 1, j), here, height(i + 1, j), *run_east_m);
            let north = slope(height(i, j - 1), here, height(i, j + 1), run_north_m);
            bytes.extend_from_slice(&half_bits(east).to_le_bytes());
            bytes.extend_from_slice(&half_bits(north).to_le_bytes());
        }
    }
    Ok(bytes)
}

/// IEEE half of a number, rounded to nearest (ties away), saturating; subnormals become 0.
fn half_bits(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = ((bits >> 16) & 0x8000) as u16;
    let magnitude = (bits & 0x7fff_ffff) + 0x1000;
    if magnitude < 0x3880_0000 {
        sign
    } else if magnitude >= 0x4780_0000 {
        sign | 0x7bff
    } else {
        sign | ((magnitude - 0x3800_0000) >> 13) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERRAIN: TerrainShape =
        TerrainShape { spacing_m: [10.0, 20.0], samples: [300, 300], height_range_m: [-1e4, 1e4] };

    fn from_half(bits: u16) -> f32 {
        let magnitude = u32::from(bits & 0x7fff);
        let value = if magnitude == 0 { 0.0 } else { f32::from_bits((magnitude << 13) + 0x3800_0000) };
        if bits & 0x8000 == 0 { value } else { -value }
    }

    #[test]
    fn halves_are_close() {
        for value in [0.0, 1.0, -1.0, 0.333_25, -2.7, 65_504.0, 0.001, 6.2e-5] {
            assert!((from_half(half_bits(value)) - value).abs() <= value.abs() / 2048.0, "{value}");
        }
        assert_eq!(half_bits(1e9), 0x7bff);
        assert_eq!(half_bits(1e-9), 0);
    }

    #[test]
    fn a_plane_has_one_slope_also_at_the_edge_of_the_data() {
        for tile in [
            TileId { level: 0, x: 2, y: 2 },
            TileId { level: 1, x: 0, y: 1 },
            TileId { level: 2, x: 0, y: 0 },
        ] {
            let [x0, y0] = [tile.x, tile.y].map(|t| (t * TILE_CELLS) << tile.level);
            let cell = 1 << tile.level;
            let heights: Vec<f32> = (0..SIDE * SIDE)
                .map(|n| {
                    let at = |first: u32, i: u32| {
                        (i64::from(first) + (i64::from(i) - 1) * i64::from(cell)).clamp(0, 299) as f32
                    };
                    at(x0, n % SIDE) * 10.0 * 0.5 - at(y0, n / SIDE) * 20.0 * 0.25
                })
                .collect();
            let bytes = pack_gradients(&TERRAIN, tile, &heights).unwrap();
            for (n, texel) in bytes.chunks_exact(4).enumerate() {
                let [i, j] = [n as u32 % 129, n as u32 / 129];
                // Points whose neighbours are all one sample have no slope, and are never looked at.
                let beyond = |first: u32, i: u32| first + i * cell > 299 + cell;
                if beyond(x0, i + 1) || beyond(y0, j + 1) {
                    continue;
                }
                let east = from_half(u16::from_le_bytes([texel[0], texel[1]]));
                let north = from_half(u16::from_le_bytes([texel[2], texel[3]]));
                assert!(
                    (east - 0.5).abs() < 1e-3 && (north + 0.25).abs() < 1e-3,
                    "{tile} {i} {j}: {east} {north}"
                );
            }
        }
    }

    #[test]
    fn voids_count_as_level() {
        let mut heights = vec![5.0; HEIGHTS_PER_TILE];
        heights[500] = f32::NAN;
        let bytes = pack_gradients(&TERRAIN, TileId { level: 0, x: 0, y: 0 }, &heights).unwrap();
        assert!(bytes.iter().all(|b| *b & 0x7f == 0));
        assert!(pack_gradients(&TERRAIN, TileId { level: 0, x: 0, y: 0 }, &[1.0]).is_err());
        assert!(pack_gradients(&TERRAIN, TileId { level: 7, x: 0, y: 0 }, &heights).is_err());
    }
}
