//! Where the mesh ends: the edges from which walls go down.

use std::collections::HashMap;
use terrasoar::refine::kinetic::Patch;

/// Edges of drawn triangles that lie on the border of the data, as vertex slots.
pub(super) fn border(whole: &Patch, samples: [u32; 2]) -> Vec<[u32; 2]> {
    let sides: HashMap<u32, [bool; 4]> = whole
        .vertices
        .iter()
        .map(|(slot, v)| (*slot, [v.x == 0, v.y == 0, v.x + 1 == samples[0], v.y + 1 == samples[1]]))
        .filter(|(_, sides)| sides.contains(&true))
        .collect();
    let on_one_side = |[a, b]: &[u32; 2]| match (sides.get(a), sides.get(b)) {
        (Some(a), Some(b)) => a.iter().zip(b).any(|(a, b)| *a && *b),
        _ => false,
    };
    let drawn = whole.triangles.iter().map(|(_, corners)| *corners).filter(|[a, b, _]| a != b);
    drawn.flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]).filter(on_one_side).collect()
}
