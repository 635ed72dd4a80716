//! How a terrain is cut into groups of tiles (FORMAT.md, section 9.2).
//!
//! A tile holds the heights of a square of at most 65 x 65 samples at a stride, its border included. Tiles at strides 1, 8, 64, ... make a group each; a group gives the records of
//! three octaves, the coarsest group those of all that are left. Invariant: every vertex has one tile that gives its record.

use crate::grid::{Grid, GridPoint};

/// Binary logarithm of the steps a side of a tile, at most.
pub(crate) const TILE_LOG: u32 = 6;
/// Octaves of records that a group gives, unless it is the coarsest.
pub(crate) const OCTAVES: u32 = 3;
/// Segments a tile.
pub(crate) const SEGMENTS: usize = 3;
/// Tiles a side of a directory leaf.
pub(crate) const LEAF_SIDE: u32 = 16;

/// Tiles of one stride.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Group {
    /// Binary logarithm of the stride.
    pub(crate) stride_log: u32,
    /// Binary logarithm of the steps a side of a tile.
    pub(crate) tile_log: u32,
    /// Whether it gives all octaves from its own on, and the corners.
    pub(crate) is_top: bool,
    /// Tiles a side of the square.
    pub(crate) side: u32,
    /// Tiles east and north that may hold anything.
    pub(crate) tiles: [u32; 2],
    /// Number of its first leaf.
    pub(crate) first_leaf: usize,
}

/// One tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct TileId {
    /// Place of its group in [`Groups`].
    pub(crate) group: u8,
    /// Column and row.
    pub(crate) at: [u32; 2],
}

/// What coding has to know of a tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TileShape {
    /// Binary logarithm of the stride.
    pub(crate) stride_log: u32,
    /// Binary logarithm of its steps a side.
    pub(crate) tile_log: u32,
    /// Whether it gives all its octaves, and the corners.
    pub(crate) is_top: bool,
    /// Whether it lies at the square's east and north border, and gives the records there.
    pub(crate) is_last: [bool; 2],
}

impl TileShape {
    /// Octaves whose records it gives, counted from its finest.
    pub(crate) fn delivered(&self) -> u32 {
        if self.is_top { self.tile_log } else { OCTAVES }
    }

    /// The segment that holds an octave, counted from its finest.
    pub(crate) fn segment_of(octave: u32) -> usize {
        (SEGMENTS - 1) - (octave as usize).min(SEGMENTS - 1)
    }
}

/// All groups of a terrain, the finest first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Groups {
    pub(crate) groups: Vec<Group>,
    pub(crate) leaves: usize,
    k: u32,
}

impl Groups {
    pub(crate) fn of(grid: &Grid) -> Self {
        let k = grid.k();
        let mut groups = Vec::new();
        let mut stride_log = 0;
        loop {
            let side_log = k - stride_log;
            let is_top = side_log <= TILE_LOG;
            let tile_log = side_log.min(TILE_LOG);
            let side = 1 << (side_log - tile_log);
            // One more than the tile with the last sample: what is not beyond the data reaches no farther.
            let tiles =
                grid.samples().map(|samples| side.min(((samples - 1) >> (stride_log + tile_log)) + 2));
            groups.push(Group { stride_log, tile_log, is_top, side, tiles, first_leaf: 0 });
            if is_top {
                break;
            }
            stride_log += OCTAVES;
        }
        // The coarsest are read first, and lie first.
        let mut leaves = 0;
        for group in groups.iter_mut().rev() {
            group.first_leaf = leaves;
            let [wide, high] = group.leaves();
            leaves += wide as usize * high as usize;
        }
        Self { groups, leaves, k }
    }

    /// The tile that gives the record of `p`, which has the vertex level `level`, or is a corner; and the place of `p` in it, in its steps.
    #[inline]
    pub(crate) fn tile_of(&self, p: GridPoint, octave: u32) -> (TileId, [u32; 2]) {
        let last = self.groups.len() - 1;
        let at = ((octave / OCTAVES) as usize).min(last);
        let group = &self.groups[at];
        let shift = group.stride_log + group.tile_log;
        let tile = [p.x(), p.y()].map(|v| (v >> shift).min(group.side - 1));
        let within = [p.x() - (tile[0] << shift), p.y() - (tile[1] << shift)];
        (TileId { group: at as u8, at: tile }, within.map(|v| v >> group.stride_log))
    }

    /// The octave of a point; that of the coarsest group for corners.
    #[inline]
    pub(crate) fn octave(&self, p: GridPoint) -> u32 {
        (p.x() | p.y()).trailing_zeros().min(self.k)
    }

    /// What coding has to know of a tile.
    pub(crate) fn shape(&self, id: TileId) -> TileShape {
        let group = &self.groups[id.group as usize];
        TileShape {
            stride_log: group.stride_log,
            tile_log: group.tile_log,
            is_top: group.is_top,
            is_last: [0, 1].map(|axis| id.at[axis] + 1 == group.side),
        }
    }

    /// Leaf of a tile and its place there; `None` for one that does not exist.
    #[inline]
    pub(crate) fn leaf_of(&self, id: TileId) -> Option<(usize, usize)> {
        let group = self.groups.get(id.group as usize)?;
        if id.at[0] >= group.tiles[0] || id.at[1] >= group.tiles[1] {
            return None;
        }
        let leaf = id.at.map(|v| v / LEAF_SIDE);
        let within = id.at.map(|v| v % LEAF_SIDE);
        Some((group.leaf_number(leaf), (within[1] * group.leaf_size(leaf)[0] + within[0]) as usize))
    }

    /// The group of a leaf, and its column and row there.
    fn leaf_at(&self, leaf: usize) -> Option<(&Group, [u32; 2])> {
        let group = self.groups.iter().find(|group| group.first_leaf <= leaf)?;
        let within = leaf - group.first_leaf;
        let [wide, high] = group.leaves().map(|count| count as usize);
        (within < wide * high).then_some((group, [(within % wide) as u32, (within / wide) as u32]))
    }

    /// Tiles of a leaf; none of one that there is not.
    pub(crate) fn leaf_size(&self, leaf: usize) -> usize {
        self.leaf_at(leaf).map_or(0, |(group, at)| {
            let size = group.leaf_size(at);
            size[0] as usize * size[1] as usize
        })
    }

    /// Tiles of a leaf, in its order.
    #[cfg(feature = "files")]
    pub(crate) fn tiles_in(&self, leaf: usize) -> impl Iterator<Item = TileId> + Clone + '_ {
        let found = self.leaf_at(leaf);
        found.into_iter().flat_map(move |(group, at)| {
            let size = group.leaf_size(at);
            // Groups are few.
            let number = self.groups.iter().position(|other| other == group).unwrap_or_default() as u8;
            (0..size[0] * size[1]).map(move |i| TileId {
                group: number,
                at: [at[0] * LEAF_SIDE + i % size[0], at[1] * LEAF_SIDE + i / size[0]],
            })
        })
    }

    /// Leaves of the next finer group with tiles inside the tile `over`.
    #[cfg(feature = "files")]
    pub(crate) fn leaves_inside(&self, over: TileId) -> impl Iterator<Item = usize> + '_ {
        // A tile of a group is as wide as 2^OCTAVES tiles of the finer one, and leaves are aligned to no less.
        let group = usize::from(over.group).checked_sub(1).map(|finer| &self.groups[finer]);
        group.into_iter().flat_map(move |group| {
            // The coarsest group's tile may be narrower.
            let coarser = &self.groups[usize::from(over.group)];
            let log = coarser.stride_log + coarser.tile_log - group.stride_log - group.tile_log;
            let [x, y] = [0, 1].map(|axis| {
                let first = over.at[axis] << log;
                let end = ((over.at[axis] + 1) << log).min(group.tiles[axis]);
                first / LEAF_SIDE..end.div_ceil(LEAF_SIDE).max(first / LEAF_SIDE)
            });
            y.flat_map(move |y| x.clone().map(move |x| group.leaf_number([x, y])))
        })
    }
}

impl Group {
    fn leaves(&self) -> [u32; 2] {
        self.tiles.map(|tiles| tiles.div_ceil(LEAF_SIDE))
    }

    fn leaf_number(&self, leaf: [u32; 2]) -> usize {
        self.first_leaf + leaf[1] as usize * self.leaves()[0] as usize + leaf[0] as usize
    }

    fn leaf_size(&self, leaf: [u32; 2]) -> [u32; 2] {
        [0, 1].map(|axis| LEAF_SIDE.min(self.tiles[axis] - leaf[axis] * LEAF_SIDE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every vertex that is not beyond the data has a tile, inside of which it lies on the lattice of its octave; and tiles are numbered one after the other.
    #[test]
    fn every_vertex_has_a_tile() {
        for samples in [[2, 2], [3, 5], [65, 65], [100, 33], [129, 129], [513, 300], [1025, 700], [700, 1025]]
        {
            let grid = Grid::new(samples, [1.0, 1.0]).unwrap();
            let groups = Groups::of(&grid);
            let n = grid.side_steps();
            for (x, y) in (0..=n).step_by(3).flat_map(|y| (0..=n).map(move |x| (x, y))) {
                let p = GridPoint::new(x, y);
                let octave = groups.octave(p);
                let (id, at) = groups.tile_of(p, octave);
                let shape = groups.shape(id);
                assert!(at.iter().all(|v| *v <= 1 << shape.tile_log));
                if !grid.is_corner(p) {
                    assert!(shape.is_top || octave < shape.stride_log + OCTAVES);
                    assert!((0..2).all(|i| at[i] < 1 << shape.tile_log || shape.is_last[i]));
                    if !grid.is_beyond(p, grid.level(p)) {
                        assert!(groups.leaf_of(id).is_some(), "{samples:?} {p:?}");
                    }
                }
            }
            let mut tiles = 0;
            for leaf in 0..groups.leaves {
                for (i, id) in groups.tiles_in(leaf).enumerate() {
                    assert_eq!(groups.leaf_of(id), Some((leaf, i)));
                }
                assert_eq!(groups.tiles_in(leaf).count(), groups.leaf_size(leaf));
                tiles += groups.leaf_size(leaf);
            }
            assert_eq!((groups.leaf_size(groups.leaves), groups.tiles_in(groups.leaves).count()), (0, 0));
            let all: u32 = groups.groups.iter().map(|group| group.tiles[0] * group.tiles[1]).sum();
            assert_eq!(tiles, all as usize);
            // Every tile of a group but the coarsest has its leaf among those inside the coarser tile that it lies in.
            for leaf in 0..groups.leaves {
                for id in groups.tiles_in(leaf) {
                    let Some(coarser) = groups.groups.get(usize::from(id.group) + 1) else { continue };
                    let group = &groups.groups[usize::from(id.group)];
                    let log = coarser.stride_log + coarser.tile_log - group.stride_log - group.tile_log;
                    let over = TileId { group: id.group + 1, at: id.at.map(|v| v >> log) };
                    assert!(groups.leaves_inside(over).any(|inside| inside == leaf), "{id:?}");
                }
            }
        }
    }
}
