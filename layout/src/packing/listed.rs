//! Which leaves of the tile directory a packed file lists: those with tiles that may hold anything, found from the coarsest tiles down, so that oceans cost nothing.

use crate::packed::shape::{Groups, TileId};
use rayon::prelude::*;

/// A leaf of the tile directory that is written.
pub(super) struct ListedLeaf {
    pub(super) leaf: usize,
    /// Its place among those that are written.
    pub(super) place: usize,
    /// Numbers of its first tile, and of the one behind its last, among the tiles of all that are written.
    pub(super) first: usize,
    pub(super) end: usize,
}

/// The leaves with tiles that may hold anything, in order. What lies in a tile that holds nothing is not looked at.
pub(super) fn listed(groups: &Groups, may_hold: impl Fn(TileId) -> bool + Sync) -> Vec<ListedLeaf> {
    let mut leaves = Vec::new();
    // The coarsest group has one tile.
    let mut candidates = vec![0];
    while !candidates.is_empty() {
        let holding: Vec<(usize, Vec<TileId>)> = candidates
            .into_par_iter()
            .map(|leaf| (leaf, groups.tiles_in(leaf).filter(|id| may_hold(*id)).collect()))
            .filter(|(_, tiles): &(usize, Vec<TileId>)| !tiles.is_empty())
            .collect();
        leaves.extend(holding.iter().map(|(leaf, _)| *leaf));
        let tiles = holding.iter().flat_map(|(_, tiles)| tiles);
        candidates = tiles.flat_map(|id| groups.leaves_inside(*id)).collect();
        candidates.sort_unstable();
        candidates.dedup();
    }
    let mut end = 0;
    let number = |(place, leaf)| {
        let first = end;
        end += groups.leaf_size(leaf);
        ListedLeaf { leaf, place, first, end }
    };
    leaves.into_iter().enumerate().map(number).collect()
}

/// All tiles of leaves, with their numbers among those of all leaves that are listed.
pub(super) fn tiles_of<'t>(
    groups: &'t Groups,
    leaves: &'t [ListedLeaf],
) -> impl Iterator<Item = (usize, TileId)> + 't {
    leaves.iter().flat_map(|listed| (listed.first..).zip(groups.tiles_in(listed.leaf)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Grid;

    /// Where every tile may hold something all leaves are listed; around one tile those that it lies in.
    #[test]
    fn leaves_are_those_of_tiles_that_hold_something() {
        let grid = Grid::new([70_000, 3000], [1.0; 2]).unwrap();
        let groups = Groups::of(&grid);
        let all = listed(&groups, |_| true);
        assert!(all.iter().map(|listed| listed.leaf).eq(0..groups.leaves));
        let (numbers, tiles): (Vec<usize>, Vec<TileId>) = tiles_of(&groups, &all).unzip();
        assert!(numbers.into_iter().eq(0..tiles.len()));
        // The tile of a place, of each group.
        let at = [66_000u32, 2500];
        let is_over = |id: TileId| {
            let group = &groups.groups[usize::from(id.group)];
            id.at == at.map(|v| v >> (group.stride_log + group.tile_log))
        };
        let few = listed(&groups, is_over);
        assert_eq!(few.len(), groups.groups.len());
        for (listed, group) in few.iter().zip((0..groups.groups.len()).rev()) {
            let over = groups.tiles_in(listed.leaf).filter(|id| is_over(*id)).collect::<Vec<_>>();
            assert_eq!(over.iter().map(|id| usize::from(id.group)).collect::<Vec<_>>(), [group]);
        }
        assert!(listed(&groups, |id| id.group > 0 && is_over(id)).len() < few.len());
        assert!(listed(&groups, |_| false).is_empty());
    }
}
