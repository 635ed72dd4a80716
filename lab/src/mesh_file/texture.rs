//! The picture over a part of a terrain, from the level of its pyramid that is as fine as allowed.
//!
//! Its texels are the pyramid's own, nothing is resampled; what the picture does not cover is grey, and so is the rim where the part reaches beyond the picture. Cost: the tiles are read and unpacked, one by
//! one; 7 bytes a texel.

use crate::picture;
use terrasoar_layout::error::LayoutError;
use terrasoar_layout::imagery::{
    BORDER_TEXELS, INNER_TEXELS, Imagery, ImageryShape, TILE_TEXELS, TileId, decode_tile,
};
use terrasoar_layout::read::terrain::Terrain;

/// Where there is no picture.
const GREY: [u8; 3] = [158, 156, 148];

/// A picture, and where it lies.
#[derive(Debug, Clone, PartialEq)]
pub struct Texture {
    /// The file.
    pub png: Vec<u8>,
    /// Texels across and down.
    pub size: [u32; 2],
    /// Its sides in metres from the terrain's south-west sample: west, south, east, north.
    pub sides_m: [f64; 4],
}

impl Texture {
    /// The picture of `terrain` over a part (west, south, east, north in metres), at most `most` texels a side. `None` where there is none.
    ///
    /// # Errors
    /// Damage in the imagery; I/O.
    pub fn of(terrain: &Terrain, part_m: [f64; 4], most: u32) -> Result<Option<Self>, LayoutError> {
        let Some(imagery) = Imagery::open(terrain)? else { return Ok(None) };
        let shape = imagery.shape();
        let fits = |level: &u32| {
            texels_of(&shape, part_m, *level).is_some_and(|[from, to]| {
                (0..2).all(|axis| to[axis] - from[axis] <= i64::from(most.max(TILE_TEXELS)))
            })
        };
        let Some(level) = (0..shape.levels).find(fits) else { return Ok(None) };
        let Some([from, to]) = texels_of(&shape, part_m, level) else { return Ok(None) };
        let size = [0, 1].map(|axis| (to[axis] - from[axis]) as u32);
        let rgb = read(terrain, &imagery, level, from, size)?;
        let png = picture::encode(&rgb, size).map_err(|source| {
            LayoutError::io(terrain.path(), "cannot make a texture of its picture", source)
        })?;
        let metre = |axis: usize, texel: i64| {
            shape.origin_m[axis] + texel as f64 * shape.texel_m[axis] * f64::from(1u32 << level)
        };
        let sides_m = [metre(0, from[0]), metre(1, from[1]), metre(0, to[0]), metre(1, to[1])];
        Ok(Some(Self { png, size, sides_m }))
    }

    /// Where in the picture a place in metres is: from its west and from its north side, 1 being the other one.
    pub(super) fn at(&self, [east, north]: [f64; 2]) -> [f32; 2] {
        let [x0, y0, x1, y1] = self.sides_m;
        [((east - x0) / (x1 - x0)) as f32, ((y1 - north) / (y1 - y0)) as f32]
    }
}

/// First texels and those after the last, from the south-west, that a part needs of a level: one beyond the picture where the part goes on. `None` if they share nothing.
fn texels_of(shape: &ImageryShape, part_m: [f64; 4], level: u32) -> Option<[[i64; 2]; 2]> {
    let counts = shape.level_texels(level).map(i64::from);
    let mut sides = [[0; 2]; 2];
    for axis in 0..2 {
        let texel_m = shape.texel_m[axis] * f64::from(1u32 << level);
        let [low, high] = [part_m[axis], part_m[axis + 2]].map(|m| (m - shape.origin_m[axis]) / texel_m);
        // Numbers far outside saturate.
        sides[0][axis] = (low.floor() as i64).max(-1);
        sides[1][axis] = (high.ceil() as i64).min(counts[axis] + 1);
        if sides[0][axis] >= counts[axis] || sides[1][axis] <= 0 || sides[0][axis] >= sides[1][axis] {
            return None;
        }
    }
    Some(sides)
}

/// Red, green and blue of `size` texels from `from` on, rows from the north.
fn read(
    terrain: &Terrain,
    imagery: &Imagery,
    level: u32,
    from: [i64; 2],
    size: [u32; 2],
) -> Result<Vec<u8>, LayoutError> {
    let [wide, high] = size.map(|side| side as usize);
    let counts = imagery.shape().level_texels(level).map(i64::from);
    let mut rgb = GREY.repeat(wide * high);
    let inner = i64::from(INNER_TEXELS);
    let first = from.map(|texel| texel.max(0) / inner);
    let last = [0, 1].map(|axis| ((from[axis] + i64::from(size[axis])).min(counts[axis]) - 1) / inner);
    let mut stored = Vec::new();
    for y in first[1]..=last[1] {
        for x in first[0]..=last[0] {
            let id = TileId { level, x: x as u32, y: y as u32 };
            if !imagery.read_tile(terrain, id, &mut stored)? {
                continue;
            }
            let Some(texels) = decode_tile(imagery.shape().format, &stored) else { continue };
            let begin = [x * inner, y * inner];
            let range = |axis: usize| {
                let low = begin[axis].max(from[axis]);
                low..(begin[axis] + inner).min(counts[axis]).min(from[axis] + i64::from(size[axis]))
            };
            for north in range(1) {
                let row = high - 1 - (north - from[1]) as usize;
                for east in range(0) {
                    let [i, j] =
                        [east - begin[0], north - begin[1]].map(|at| at as usize + BORDER_TEXELS as usize);
                    let texel = &texels[(j * TILE_TEXELS as usize + i) * 4..][..4];
                    let at = (row * wide + (east - from[0]) as usize) * 3;
                    let alpha = u32::from(texel[3]);
                    for (channel, grey) in GREY.into_iter().enumerate() {
                        let mixed = u32::from(texel[channel]) * alpha + u32::from(grey) * (255 - alpha);
                        rgb[at + channel] = ((mixed + 127) / 255) as u8;
                    }
                }
            }
        }
    }
    Ok(rgb)
}
