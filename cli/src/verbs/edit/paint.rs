//! What edits do to the picture over the ground: craters scorch it, and restored ground gets its old picture back.

use terrasoar_layout::edit::{Area, Edit, SampleRect};
use terrasoar_layout::grid::Grid;
use terrasoar_layout::imagery::{Paint, Region};

/// The paint that goes with edits.
pub(super) fn paints_of(edits: &[Edit], grid: &Grid) -> Vec<Paint> {
    let [dx, dy] = grid.spacing_m();
    // As far as the ground that its outermost samples share with others.
    let restored = |rect: SampleRect| {
        Paint::Restore(Region::Rect {
            from_m: [(f64::from(rect.west) - 0.5) * dx, (f64::from(rect.south) - 0.5) * dy],
            to_m: [(f64::from(rect.east) + 0.5) * dx, (f64::from(rect.north) + 0.5) * dy],
        })
    };
    let paint = |edit: &Edit| match edit {
        Edit::Crater(crater) => Some(Paint::scorch_of(crater)),
        Edit::Restore(Area::Disc { centre_m, radius_m }) => {
            Some(Paint::Restore(Region::Disc { centre_m: *centre_m, radius_m: *radius_m }))
        }
        Edit::Restore(Area::Rect(rect)) => Some(restored(*rect)),
        Edit::Restore(area @ Area::Extent { .. }) => area.samples(grid).map(restored),
        _ => None,
    };
    edits.iter().filter_map(paint).collect()
}
