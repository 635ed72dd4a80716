//! Sizes of a pyramid: texels, tiles and levels, all from the size of the image.
//!
//! Level 0 is the image itself; each level halves both sides, rounding up, until one tile holds it. A tile covers [`INNER_TEXELS`] a side and
//! repeats [`BORDER_TEXELS`] of its neighbours on each side, so that a filter near its rim finds what lies beyond. Tiles at the east and north
//! rim are stored only as far as the image reaches, in whole blocks of 4 x 4, and handed out whole.

/// Texels a side of a tile as a GPU holds it.
pub const TILE_TEXELS: u32 = 512;
/// Texels on each side of a tile that repeat its neighbours', or the image's rim.
pub const BORDER_TEXELS: u32 = 4;
/// Texels a side that a tile covers.
pub const INNER_TEXELS: u32 = TILE_TEXELS - 2 * BORDER_TEXELS;

/// Longest side of an image in texels.
pub const MAX_TEXELS: u32 = 1 << 22;

/// How the texels of a tile are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum TileFormat {
    /// BC1 (DXT1): blocks of 4 x 4 texels in 8 bytes, alpha 0 or 1. 131,072 bytes a tile.
    Bc1,
    /// BC7: blocks of 4 x 4 texels in 16 bytes, alpha in steps. 262,144 bytes a tile.
    Bc7,
    /// Red, green, blue, alpha, a byte each. 1,048,576 bytes a tile.
    Rgba8,
}

impl TileFormat {
    /// The word the command line uses.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bc1 => "bc1",
            Self::Bc7 => "bc7",
            Self::Rgba8 => "raw",
        }
    }

    /// Bytes of a block of 4 x 4 texels; of Rgba8, which has no blocks, as many texels.
    pub(crate) const fn block_bytes(self) -> usize {
        match self {
            Self::Bc1 => 8,
            Self::Bc7 => 16,
            Self::Rgba8 => 64,
        }
    }

    /// Bytes of a whole tile as [`Imagery::read_tile`](super::Imagery::read_tile) hands it out.
    pub const fn tile_bytes(self) -> usize {
        (TILE_TEXELS as usize / 4).pow(2) * self.block_bytes()
    }

    /// Bytes of a stored tile of so many texels, both multiples of 4.
    pub(super) fn stored_bytes(self, texels: [u32; 2]) -> usize {
        (texels[0] / 4) as usize * (texels[1] / 4) as usize * self.block_bytes()
    }
}

/// A tile of a pyramid: of an image, or of what else covers a terrain in squares, each level twice as coarse as the one below.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TileId {
    /// Level: 0 is the finest.
    pub level: u32,
    /// Tiles east of the south-west corner.
    pub x: u32,
    /// Tiles north of it.
    pub y: u32,
}

impl TileId {
    /// The tile of the next coarser level that covers this one.
    pub fn parent(self) -> Self {
        Self { level: self.level + 1, x: self.x / 2, y: self.y / 2 }
    }
}

impl std::fmt::Display for TileId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}/{}", self.level, self.x, self.y)
    }
}

/// What all tiles have in common, and where the image lies.
///
/// The point `m` metres east and north of the terrain's south-west sample is `t = (m - origin_m) / texel_m / 2^level` texels from the south-west corner of
/// the image at a level, in the tile `floor(t / 504)`, at `t - 504 floor(t / 504) + 4` texels from that tile's own corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageryShape {
    /// How texels are stored.
    pub format: TileFormat,
    /// Texels east and north at level 0, 1 to 4,194,304.
    pub texels: [u32; 2],
    /// Levels; the coarsest is one tile.
    pub levels: u32,
    /// South-west corner of the image, the outer corner of its first texel, in metres east and north of the terrain's south-west sample.
    pub origin_m: [f64; 2],
    /// Metres east and north a texel of level 0, positive.
    pub texel_m: [f64; 2],
}

impl ImageryShape {
    /// The shape of an image of `texels` (1 to 4,194,304 a side), with all levels up to the first that is one tile.
    pub fn new(format: TileFormat, texels: [u32; 2], origin_m: [f64; 2], texel_m: [f64; 2]) -> Self {
        let mut shape = Self { format, texels, levels: 1, origin_m, texel_m };
        while shape.tile_count(shape.levels - 1).iter().any(|tiles| *tiles > 1) {
            shape.levels += 1;
        }
        shape
    }

    /// Texels east and north at a level: each halving rounds up.
    pub fn level_texels(&self, level: u32) -> [u32; 2] {
        self.texels.map(|side| side.div_ceil(1 << level.min(31)))
    }

    /// Tiles east and north at a level; none past the coarsest.
    pub fn tile_count(&self, level: u32) -> [u32; 2] {
        if level >= self.levels {
            return [0, 0];
        }
        self.level_texels(level).map(|side| side.div_ceil(INNER_TEXELS))
    }

    /// Tiles of all levels, absent ones included.
    pub fn tiles(&self) -> u64 {
        (0..self.levels).map(|level| self.level_tiles(level)).sum()
    }

    /// Texels east and north of a tile that the image reaches, border left out; at most [`INNER_TEXELS`].
    pub fn covered_texels(&self, id: TileId) -> [u32; 2] {
        let [wide, high] = self.level_texels(id.level);
        [(wide, id.x), (high, id.y)]
            .map(|(side, tile)| side.saturating_sub(tile.saturating_mul(INNER_TEXELS)).min(INNER_TEXELS))
    }

    /// Texels east and north that are stored of a tile: covered ones and border, in whole blocks.
    pub(super) fn stored_texels(&self, id: TileId) -> [u32; 2] {
        self.covered_texels(id).map(|side| (side + 2 * BORDER_TEXELS).next_multiple_of(4))
    }

    /// Place of a tile in the directory: level by level from the finest, rows from the south. `None` for what is no tile.
    pub(super) fn index(&self, id: TileId) -> Option<u64> {
        let [across, up] = self.tile_count(id.level);
        if id.x >= across || id.y >= up {
            return None;
        }
        let below: u64 = (0..id.level).map(|level| self.level_tiles(level)).sum();
        Some(below + u64::from(id.y) * u64::from(across) + u64::from(id.x))
    }

    /// The tile at a place in the directory; `None` past the last.
    pub(super) fn id_at(&self, index: u64) -> Option<TileId> {
        let mut rest = index;
        for level in 0..self.levels {
            let tiles = self.level_tiles(level);
            if rest < tiles {
                let across = u64::from(self.tile_count(level)[0]);
                return Some(TileId { level, x: (rest % across) as u32, y: (rest / across) as u32 });
            }
            rest -= tiles;
        }
        None
    }

    /// Every tile, in the order of the directory.
    pub fn ids(&self) -> impl Iterator<Item = TileId> + '_ {
        (0..self.levels).flat_map(move |level| {
            let [across, up] = self.tile_count(level);
            (0..up).flat_map(move |y| (0..across).map(move |x| TileId { level, x, y }))
        })
    }

    fn level_tiles(&self, level: u32) -> u64 {
        let [across, up] = self.tile_count(level).map(u64::from);
        across * up
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_agree_with_each_other() {
        for texels in [[1, 1], [504, 504], [505, 3], [16_384, 16_384], [1009, 70_000], [MAX_TEXELS, 5]] {
            let shape = ImageryShape::new(TileFormat::Bc1, texels, [0.0; 2], [1.0; 2]);
            assert_eq!(shape.tile_count(shape.levels - 1), [1, 1]);
            assert_eq!(shape.tile_count(shape.levels), [0, 0]);
            assert!(shape.levels == 1 || shape.tile_count(shape.levels - 2) != [1, 1]);
            for (i, id) in (0u64..).zip(shape.ids()) {
                assert_eq!((shape.index(id), shape.id_at(i)), (Some(i), Some(id)));
                let covered = shape.covered_texels(id);
                assert!(covered.iter().all(|c| (1..=INNER_TEXELS).contains(c)));
                assert!(shape.stored_texels(id).iter().all(|s| s % 4 == 0 && *s <= TILE_TEXELS));
            }
            assert_eq!(shape.ids().count() as u64, shape.tiles());
            assert_eq!(shape.id_at(shape.tiles()), None);
            let [across, up] = shape.tile_count(0);
            let last = shape.covered_texels(TileId { level: 0, x: across - 1, y: up - 1 });
            let whole = [across - 1, up - 1].map(|tiles| tiles * INNER_TEXELS);
            assert_eq!([whole[0] + last[0], whole[1] + last[1]], texels);
        }
    }
}
