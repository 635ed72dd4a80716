//! Which tiles there are: plain arithmetic on levels and positions.

/// Cells a side of a tile, at its own level. A power of two.
pub const TILE_CELLS: u32 = 128;

/// A tile of the pyramid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileId {
    /// 0 the finest; a cell is 2^level samples wide.
    pub level: u32,
    /// Tiles from the west.
    pub x: u32,
    /// Tiles from the south.
    pub y: u32,
}

impl TileId {
    /// Samples along one side of a cell.
    pub fn cell_samples(self) -> u32 {
        1 << self.level
    }

    /// Column and row of the tile's south-west sample.
    pub fn first_sample(self) -> [u32; 2] {
        [self.x, self.y].map(|t| t.saturating_mul(TILE_CELLS << self.level))
    }

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

/// All tiles over a terrain.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pyramid {
    /// Tiles east and north, by level.
    tiles: Vec<[u32; 2]>,
}

impl Pyramid {
    /// The pyramid over so many samples east and north.
    pub fn over(samples: [u32; 2]) -> Self {
        let mut tiles = Vec::new();
        for level in 0..=(32 - TILE_CELLS.ilog2()) {
            let cells = u64::from(TILE_CELLS) << level;
            let across = samples.map(|n| u64::from(n.saturating_sub(1)).div_ceil(cells).max(1) as u32);
            tiles.push(across);
            if across == [1, 1] {
                break;
            }
        }
        Self { tiles }
    }

    /// Number of levels, at least 1.
    pub fn levels(&self) -> u32 {
        self.tiles.len() as u32
    }

    /// The one tile that covers everything.
    pub fn root(&self) -> TileId {
        TileId { level: self.levels() - 1, x: 0, y: 0 }
    }

    /// Tiles east and north of a level; none above the root's.
    pub fn across(&self, level: u32) -> [u32; 2] {
        self.tiles.get(level as usize).copied().unwrap_or([0, 0])
    }

    /// Whether there is such a tile.
    pub fn contains(&self, tile: TileId) -> bool {
        let [east, north] = self.across(tile.level);
        tile.x < east && tile.y < north
    }

    /// The tiles of the next finer level within `tile`.
    pub fn children(&self, tile: TileId) -> impl Iterator<Item = TileId> + '_ {
        let finer = tile.level.checked_sub(1);
        finer
            .into_iter()
            .flat_map(move |level| {
                (0..4).map(move |i| TileId { level, x: 2 * tile.x + i % 2, y: 2 * tile.y + i / 2 })
            })
            .filter(|child| self.contains(*child))
    }

    /// Number of all tiles.
    pub fn len(&self) -> usize {
        self.tiles.iter().map(|[east, north]| *east as usize * *north as usize).sum()
    }

    /// Never: there is always a root.
    pub fn is_empty(&self) -> bool {
        self.tiles.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_halve_until_one_tile_is_left() {
        let pyramid = Pyramid::over([65_537, 65_537]);
        assert_eq!(pyramid.levels(), 10);
        assert_eq!(pyramid.across(0), [512, 512]);
        assert_eq!(pyramid.across(9), [1, 1]);
        let odd = Pyramid::over([300, 1000]);
        assert_eq!(
            (0..odd.levels()).map(|l| odd.across(l)).collect::<Vec<_>>(),
            [[3, 8], [2, 4], [1, 2], [1, 1]]
        );
        assert_eq!(Pyramid::over([2, 2]).levels(), 1);
    }

    #[test]
    fn children_are_distinct_and_have_their_parent() {
        let pyramid = Pyramid::over([700, 1300]);
        let mut seen = std::collections::HashSet::new();
        let mut open = vec![pyramid.root()];
        while let Some(tile) = open.pop() {
            assert!(seen.insert(tile));
            for child in pyramid.children(tile) {
                assert_eq!(child.parent(), tile);
                open.push(child);
            }
        }
        assert_eq!(seen.len(), pyramid.len(), "every tile is below the root");
    }
}
