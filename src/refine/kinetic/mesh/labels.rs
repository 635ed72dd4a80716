//! Where a vertex's parents and children lie around it. They are numbered by direction, so that all are reached by index arithmetic.
//!
//! * Children of a white vertex (a cell's centre) lie east, north, west, south: labels 0 to 3; those of a black one (an edge's midpoint) lie
//!   south-east, north-east, north-west, south-west. Opposite labels differ by 2.
//! * A vertex with label j at one parent has label j + 2 at the other. `j >> 1` is the *side* of the vertex that the parent lies on, `j & 1` the
//!   same for both: its orientation.
//! * Around a vertex, from its parent of label j counter-clockwise: parent, child f, edge end p, child f + 1, other parent, child f + 2,
//!   edge end q, child f + 3, with f = [`first_child`]. A child that two vertices share has opposite labels at them.

use terrasoar_layout::grid::GridPoint;

/// Whether a point lies on the border of the square.
#[inline(always)]
pub(crate) fn is_on_border(p: GridPoint, side_steps: u32) -> bool {
    p.x() == 0 || p.y() == 0 || p.x() == side_steps || p.y() == side_steps
}

/// Level of a vertex that is no corner: as [`Grid::level`](terrasoar_layout::grid::Grid::level), from the point alone.
#[inline(always)]
pub(crate) fn level_of(p: GridPoint) -> u32 {
    let shift = (p.x() | p.y()).trailing_zeros();
    2 * shift + ((p.x() & p.y()) >> shift & 1)
}

/// The low bit of a node's labels at its parents.
#[inline(always)]
pub(crate) fn orientation(p: GridPoint) -> usize {
    let shift = (p.x() | p.y()).trailing_zeros();
    let (x, y) = (p.x() >> shift, p.y() >> shift);
    // White: parents lie across the diagonal that its cell is not split along. Black: across its edge.
    let (white, turned) = (x & y & 1, (x ^ y) >> 1 & 1);
    (if white == 1 { turned } else { x & 1 }) as usize
}

/// The label of the child that follows the parent of label `label` counter-clockwise.
#[inline(always)]
pub(crate) const fn first_child(label: usize, level: u32) -> usize {
    // 2 for white ones, whose levels are odd, 3 for black ones.
    (label + 3 - (level as usize & 1)) & 3
}

/// The child with `label` of a node at `p` of `level`, which is above 0; of level 0 it is the node itself or lies beside it. Without branches, because levels come in no order.
#[inline(always)]
pub(crate) fn child_point(p: GridPoint, level: u32, label: usize) -> GridPoint {
    const STEPS: [[i32; 2]; 8] = [[1, -1], [1, 1], [-1, 1], [-1, -1], [1, 0], [0, 1], [-1, 0], [0, -1]];
    let white = level & 1;
    let ([dx, dy], step) = (STEPS[label & 3 | (white as usize) << 2], (1 << (level / 2)) >> (1 - white));
    GridPoint::new(p.x().wrapping_add_signed(dx * step), p.y().wrapping_add_signed(dy * step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrasoar_layout::grid::Grid;

    #[test]
    fn labels_agree_with_the_grid() {
        for k in 1..=5 {
            let grid = Grid::new([(1 << k) + 1; 2], [1.0, 1.0]).unwrap();
            let n = grid.side_steps();
            for p in (0..=n)
                .flat_map(|y| (0..=n).map(move |x| GridPoint::new(x, y)))
                .filter(|p| !grid.is_corner(*p))
            {
                let level = level_of(p);
                assert_eq!(level, grid.level(p));
                if level == 0 {
                    continue;
                }
                let inside = |c: &GridPoint| c.x() <= n && c.y() <= n;
                let mut named: Vec<_> =
                    (0..4).map(|label| child_point(p, level, label)).filter(inside).collect();
                let mut of_grid: Vec<_> = grid.children(p).collect();
                named.sort();
                of_grid.sort();
                assert_eq!(named, of_grid);
                for label in 0..4 {
                    let c = child_point(p, level, label);
                    if !inside(&c) {
                        continue;
                    }
                    assert_eq!(label & 1, orientation(c), "{p:?} {c:?}");
                    assert!(grid.apexes(c).any(|a| a == p));
                    // The next child around the parent shares a child with this one, under opposite labels.
                    let next = child_point(p, level, (label + 1) & 3);
                    if inside(&next) && level > 1 {
                        let last = (first_child(label, level - 1) + 3) & 3;
                        let first = first_child((label + 1) & 3, level - 1);
                        assert_eq!(child_point(c, level - 1, last), child_point(next, level - 1, first));
                        assert_eq!(first, (last + 2) & 3);
                    }
                }
            }
        }
    }
}
