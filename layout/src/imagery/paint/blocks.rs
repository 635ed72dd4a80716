//! Blocks of 4 x 4 texels of a level, numbered over the whole picture, and the tiles that hold them.
//!
//! Tiles begin 504 texels apart and their border is 4 wide, so the blocks of all tiles of a level fall on one grid: block (x, y) begins at texel (4 x, 4 y), and a tile holds
//! 126 a side and one more on each side. So up to four tiles hold a block, and all hold the same texels. Around the picture lies one ring of blocks (number -1,
//! and the first that begins beyond the last texel) that repeat its outermost texels.

use super::super::shape::{INNER_TEXELS, ImageryShape, TileId};

/// Blocks that a tile covers, border left out.
const INNER_BLOCKS: i32 = (INNER_TEXELS / 4) as i32;

/// A rectangle of texels or blocks, both corners included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rect {
    /// South-west corner.
    pub(super) from: [i32; 2],
    /// North-east corner.
    pub(super) to: [i32; 2],
}

impl Rect {
    /// The blocks that hold these texels, or the blocks over these of the level below.
    pub(super) fn shrunk(&self, by: i32) -> Self {
        Self { from: self.from.map(|v| v.div_euclid(by)), to: self.to.map(|v| v.div_euclid(by)) }
    }

    pub(super) fn wide(&self) -> usize {
        (self.to[0] - self.from[0] + 1) as usize
    }

    pub(super) fn count(&self) -> usize {
        self.wide() * (self.to[1] - self.from[1] + 1) as usize
    }

    pub(super) fn contains(&self, at: [i32; 2]) -> bool {
        [0, 1].iter().all(|&axis| (self.from[axis]..=self.to[axis]).contains(&at[axis]))
    }

    pub(super) fn index(&self, [x, y]: [i32; 2]) -> usize {
        (y - self.from[1]) as usize * self.wide() + (x - self.from[0]) as usize
    }

    /// All places, row by row from the south.
    pub(super) fn places(self) -> impl Iterator<Item = [i32; 2]> {
        (self.from[1]..=self.to[1]).flat_map(move |y| (self.from[0]..=self.to[0]).map(move |x| [x, y]))
    }
}

/// The texels of a rectangle of blocks that are marked, 16 bits a block.
#[derive(Debug, Default)]
pub(super) struct Marks {
    rect: Option<Rect>,
    bits: Vec<u16>,
}

impl Marks {
    /// Begins anew over `rect`, nothing marked.
    pub(super) fn clear(&mut self, rect: Rect) {
        self.rect = Some(rect);
        self.bits.clear();
        self.bits.resize(rect.count(), 0);
    }

    pub(super) fn get(&self, block: [i32; 2]) -> u16 {
        self.rect.filter(|rect| rect.contains(block)).map_or(0, |rect| self.bits[rect.index(block)])
    }

    pub(super) fn set(&mut self, block: [i32; 2], bits: u16) {
        if let Some(rect) = self.rect.filter(|rect| rect.contains(block)) {
            self.bits[rect.index(block)] = bits;
        }
    }
}

/// One level as blocks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    pub(super) level: u32,
    /// Texels east and north.
    pub(super) texels: [i32; 2],
    /// Blocks east and north that begin in the picture.
    pub(super) blocks: [i32; 2],
    tiles: [i32; 2],
}

impl Grid {
    pub(super) fn of(shape: &ImageryShape, level: u32) -> Self {
        let texels = shape.level_texels(level).map(|side| side as i32);
        Self {
            level,
            texels,
            blocks: texels.map(|side| (side + 3) / 4),
            tiles: shape.tile_count(level).map(|count| count as i32),
        }
    }

    /// The tile that covers a block of the picture, and the block's place in it.
    pub(super) fn home(&self, block: [i32; 2]) -> (TileId, [i32; 2]) {
        let tile = block.map(|b| b / INNER_BLOCKS);
        (self.tile(tile), [0, 1].map(|axis| block[axis] - INNER_BLOCKS * tile[axis] + 1))
    }

    fn tile(&self, [x, y]: [i32; 2]) -> TileId {
        TileId { level: self.level, x: x as u32, y: y as u32 }
    }

    /// Tiles along an axis that hold a block of that number, each with its place in the tile.
    fn holders_along(&self, axis: usize, block: i32) -> impl Iterator<Item = (i32, i32)> + Clone + use<> {
        let tiles = self.tiles[axis];
        let at = block.div_euclid(INNER_BLOCKS);
        (at - 1..=at + 1).filter_map(move |tile| {
            let place = block - INNER_BLOCKS * tile + 1;
            ((0..tiles).contains(&tile) && (0..INNER_BLOCKS + 2).contains(&place)).then_some((tile, place))
        })
    }

    /// All tiles that hold a block, of the ring around the picture too, each with the block's place in it.
    pub(super) fn holders(&self, [x, y]: [i32; 2]) -> impl Iterator<Item = (TileId, [i32; 2])> + use<> {
        let grid = *self;
        let across = grid.holders_along(0, x);
        grid.holders_along(1, y).flat_map(move |(v, row)| {
            across.clone().map(move |(u, column)| (grid.tile([u, v]), [column, row]))
        })
    }

    /// The tiles that hold any block of a rectangle of the picture.
    pub(super) fn tiles_of(&self, rect: Rect) -> impl Iterator<Item = TileId> + use<> {
        let grid = *self;
        let ends = |axis: usize| {
            let first = grid.holders_along(axis, rect.from[axis]).map(|(tile, _)| tile).min();
            let last = grid.holders_along(axis, rect.to[axis]).map(|(tile, _)| tile).max();
            first.zip(last).unwrap_or((0, -1))
        };
        let [(west, east), (south, north)] = [ends(0), ends(1)];
        (south..=north).flat_map(move |y| (west..=east).map(move |x| grid.tile([x, y])))
    }

    /// Texels of a block, per axis, that lie in the picture: 1 to 4.
    pub(super) fn inside(&self, block: [i32; 2]) -> [usize; 2] {
        [0, 1].map(|axis| (self.texels[axis] - 4 * block[axis]).clamp(0, 4) as usize)
    }

    /// The blocks of the ring that repeat texels of a block of the picture, as steps from it.
    pub(super) fn ring(&self, block: [i32; 2]) -> impl Iterator<Item = [i32; 2]> + use<> {
        let steps = [0, 1].map(|axis| {
            let low = if block[axis] == 0 { -1 } else { 0 };
            let high = if block[axis] == self.blocks[axis] - 1 { 1 } else { 0 };
            low..=high
        });
        let [across, up] = steps;
        up.flat_map(move |dy| across.clone().map(move |dx| [dx, dy])).filter(|step| *step != [0, 0])
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::shape::TileFormat;
    use super::*;

    /// Every stored block of every tile, and who holds it, by the definition.
    #[test]
    fn holders_are_all_tiles_that_store_a_block() {
        for texels in [[1, 1], [504, 505], [1009, 2], [1513, 1200], [506, 1008]] {
            let shape = ImageryShape::new(TileFormat::Bc1, texels, [0.0; 2], [1.0; 2]);
            for level in 0..shape.levels {
                let grid = Grid::of(&shape, level);
                let mut stored = Vec::new();
                for id in shape.ids().filter(|id| id.level == level) {
                    let [across, up] = shape.stored_texels(id).map(|side| side as i32 / 4);
                    for place in (Rect { from: [0; 2], to: [across - 1, up - 1] }).places() {
                        let block = [(id.x, place[0]), (id.y, place[1])];
                        stored.push((block.map(|(tile, p)| tile as i32 * 126 + p - 1), id, place));
                    }
                }
                let ring = Rect { from: [-1; 2], to: grid.blocks };
                let mut held: Vec<_> = ring
                    .places()
                    .flat_map(|block| grid.holders(block).map(move |(id, place)| (block, id, place)))
                    .collect();
                stored.sort_unstable();
                held.sort_unstable();
                assert!(stored == held, "{texels:?} {level}");
                for block in (Rect { from: [0; 2], to: grid.blocks.map(|b| b - 1) }).places() {
                    assert!(grid.holders(block).any(|held| held == grid.home(block)));
                }
            }
        }
    }
}
