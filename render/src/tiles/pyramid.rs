//! Which tiles there are: plain arithmetic on levels and positions.

use terrasoar_layout::imagery::{INNER_TEXELS, ImageryShape, TileId};

/// Cells a side of a tile of slopes, at its own level. A power of two.
pub const TILE_CELLS: u32 = 128;

/// All tiles over a terrain, or over an image on it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pyramid {
    tile_cells: u32,
    /// Tiles east and north, by level.
    tiles: Vec<[u32; 2]>,
}

impl Pyramid {
    /// The pyramid of slopes over so many samples east and north, up to one tile over everything.
    pub fn over(samples: [u32; 2]) -> Self {
        Self::of_cells(samples.map(|n| n.saturating_sub(1)), TILE_CELLS, u32::MAX)
    }

    /// The pyramid of an image: as many levels as it has, or fewer where one tile covers everything before.
    pub fn of_image(shape: &ImageryShape) -> Self {
        Self::of_cells(shape.texels, INNER_TEXELS, shape.levels)
    }

    /// A pyramid over so many cells east and north at level 0, in tiles of `tile_cells` a side: `most_levels` levels, or fewer
    /// where one tile covers everything before.
    pub(crate) fn of_cells(cells: [u32; 2], tile_cells: u32, most_levels: u32) -> Self {
        let tile_cells = tile_cells.max(1);
        let mut tiles = Vec::new();
        for level in 0..most_levels.clamp(1, 32) {
            let side = u64::from(tile_cells) << level;
            let across = cells.map(|n| u64::from(n).div_ceil(side).max(1) as u32);
            tiles.push(across);
            if across == [1, 1] {
                break;
            }
        }
        Self { tile_cells, tiles }
    }

    /// The tiles of all levels that show a sample between two, both included, or have it in their border of so many cells.
    pub(crate) fn around(
        &self,
        south_west: [u32; 2],
        north_east: [u32; 2],
        border_cells: u32,
    ) -> impl Iterator<Item = TileId> + use<> {
        let cells = self.tile_cells;
        self.tiles.clone().into_iter().zip(0u32..).flat_map(move |(across, level)| {
            let side = u64::from(cells) << level;
            // Slopes look one cell further than the samples that are shown.
            let reach = u64::from(border_cells + 1) << level;
            let span = |axis: usize| {
                let first = u64::from(south_west[axis]).saturating_sub(reach) / side;
                let last = (u64::from(north_east[axis]) + reach) / side;
                first as u32..(last as u32 + 1).min(across[axis])
            };
            let columns = span(0);
            span(1).flat_map(move |y| columns.clone().map(move |x| TileId { level, x, y }))
        })
    }

    /// Cells of level 0 from the south-west corner to a tile's south-west and north-east corners; the latter may lie beyond the data.
    pub fn corners(&self, tile: TileId) -> [[u64; 2]; 2] {
        let side = u64::from(self.tile_cells) << tile.level;
        [[tile.x, tile.y].map(|t| u64::from(t) * side), [tile.x, tile.y].map(|t| (u64::from(t) + 1) * side)]
    }

    /// Number of levels, at least 1.
    pub fn levels(&self) -> u32 {
        self.tiles.len() as u32
    }

    /// The coarsest tile, the south-westernmost if there are several.
    pub fn root(&self) -> TileId {
        TileId { level: self.levels() - 1, x: 0, y: 0 }
    }

    /// All tiles of the coarsest level. Together they cover everything.
    pub fn roots(&self) -> impl Iterator<Item = TileId> + use<> {
        let level = self.levels() - 1;
        let [east, north] = self.across(level);
        (0..north).flat_map(move |y| (0..east).map(move |x| TileId { level, x, y }))
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
        let image = Pyramid::of_cells([16_384, 8_000], 504, 3);
        assert_eq!((image.levels(), image.across(2), image.roots().count()), (3, [9, 4], 36));
        assert_eq!(image.corners(TileId { level: 2, x: 8, y: 0 })[0], [16_128, 0]);
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
