//! Preloading by an extended view frustum.
//!
//! Based on: H. Qiu, L.-T. Chen, G.-P. Qiu, H. Yang, "An Effective Visualization Method for Large-scale Terrain Dataset", section 4. The frustum is moved back
//! along the line of sight by a block's length L, which lets in what a turn would bring, and its far side is moved on by S = V cos(a) / f, the way of one frame along
//! the line of sight, never back (eq. 8). What lies in the extension and not in the view is loaded before it is needed. For comparison with deadlines.
//!
//! Their frustum ends at a far side and their levels of detail belong to blocks. Here detail depends on distance alone and nothing is cut off far away, so moving
//! the far side on by S means moving on by S the eye that the error test measures from. With L = S = 0 the walk reads what SOAR reads. Cost: a SOAR
//! refinement of the extended view.

use crate::metric::{ALL_PLANES, Metric};
use crate::refine::Culling;
use crate::view::View;
use terrasoar_layout::grid::order::{CENTRE_SLOT, ROOTS, child_slots, corners};
use terrasoar_layout::grid::{Grid, GridPoint};
use terrasoar_layout::read::store::RecordStore;

/// A view, and how much of its surroundings is loaded too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtendedView {
    /// Where errors are measured from: the view, moved on by S.
    pub detail: View,
    /// What is culled: the view, moved back by L.
    pub extent: View,
}

/// Blocks a side of the terrain.
const BLOCKS_A_SIDE: f64 = 16.0;

impl ExtendedView {
    /// The block length L that is taken where none is named: a sixteenth of the square's side, in metres.
    pub fn block_m(grid: &Grid) -> f64 {
        let [dx, dy] = grid.spacing_m();
        f64::from(grid.side_steps()) / BLOCKS_A_SIDE * dx.max(dy)
    }

    /// The view as it is.
    pub fn plain(view: &View) -> Self {
        Self { detail: *view, extent: *view }
    }

    /// The extension of `now` after a frame that showed `before`, blocks being `block_m` metres long.
    pub fn after(before: &View, now: &View, block_m: f64) -> Self {
        let [_, _, forward] = now.axes();
        let ahead_m = (now.eye_m - before.eye_m).dot(forward).max(0.0);
        Self {
            detail: View { eye_m: now.eye_m + forward * ahead_m, ..*now },
            extent: View { eye_m: now.eye_m - forward * block_m, ..*now },
        }
    }

    /// Slots of the records that a refinement of this view reads, sorted: coarse levels first.
    pub fn slots<S: RecordStore>(&self, store: &S, culling: Culling) -> Vec<u64> {
        let mut slots: Vec<u64> = (0..=CENTRE_SLOT).collect();
        self.walk(store, culling, &mut |slot, _| slots.push(slot));
        slots.sort_unstable();
        slots.dedup();
        slots
    }

    /// Pages that a refinement of this view lacks, as far as it can be told from what is at hand; sorted, into `pages`.
    pub(crate) fn pages_away<S: RecordStore>(&self, store: &S, culling: Culling, pages: &mut Vec<u64>) {
        pages.clear();
        self.walk(store, culling, &mut |slot, is_at_hand| {
            let page = S::page_of(slot);
            if !is_at_hand && pages.last() != Some(&page) {
                pages.push(page);
            }
        });
        pages.sort_unstable();
        pages.dedup();
    }

    /// Calls `read` with the slot of every record that a refinement reads below the centre's, and whether it is at hand.
    fn walk<S: RecordStore>(&self, store: &S, culling: Culling, read: &mut dyn FnMut(u64, bool)) {
        let grid = *store.grid();
        let c = corners(grid.k());
        let mut walk =
            Walk { store, detail: Metric::new(&self.detail), extent: Metric::new(&self.extent), read };
        let planes = if culling == Culling::Vertices { ALL_PLANES } else { 0 };
        let centre = (CENTRE_SLOT, c[0].midpoint(c[2]));
        for (split, [b, d]) in ROOTS {
            walk.visit(grid.levels() - 1, centre, split, [c[b], c[d]], planes);
        }
    }
}

struct Walk<'w, S> {
    store: &'w S,
    detail: Metric,
    extent: Metric,
    read: &'w mut dyn FnMut(u64, bool),
}

impl<S: RecordStore> Walk<'_, S> {
    /// Visits the triangle (apex; b, d) whose split vertex has slot `split` and level `height - 1`.
    fn visit(&mut self, height: u32, apex: (u64, GridPoint), split: u64, [b, d]: [GridPoint; 2], planes: u8) {
        let v = b.midpoint(d);
        let raw = self.store.get(split);
        (self.read)(split, raw.is_some());
        let Some(raw) = raw else { return };
        let vertex = self.store.decode(raw, height - 1);
        let at_m = self.store.grid().position_m(v);
        if height == 1 || !self.detail.sight(at_m, &vertex).is_selected() {
            return;
        }
        let Some(planes) = self.extent.cull(&self.extent.sight(at_m, &vertex), planes) else { return };
        let [left, right] = child_slots(apex.0, split);
        self.visit(height - 1, (split, v), left, [b, apex.1], planes);
        self.visit(height - 1, (split, v), right, [apex.1, d], planes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::soar::Soar;
    use crate::refine::{Engine, Probe};
    use crate::testing::{square_terrain, view_at};
    use glam::DVec3;
    use terrasoar_layout::with_records;

    struct Read(Vec<u64>);

    impl Probe for Read {
        fn read(&mut self, slot: u64) {
            self.0.push(slot);
        }
    }

    #[test]
    fn without_an_extension_it_reads_what_soar_reads() {
        let terrain = square_terrain(7);
        with_records!(terrain.records().unwrap(), records => {
            for culling in Culling::ALL {
                for (at, yaw_rad) in [([0.5, 0.5], 0.3), ([0.1, 0.9], 2.5), ([-0.2, 0.4], 1.5)] {
                    let view = view_at(&terrain, at, yaw_rad);
                    let mut read = Read(Vec::new());
                    Soar::new(records.clone(), culling).update(&view, &mut read);
                    read.0.sort_unstable();
                    read.0.dedup();
                    assert!(ExtendedView::plain(&view).slots(&records, culling) == read.0);
                    let still = ExtendedView::after(&view, &view, 0.0);
                    assert_eq!(still, ExtendedView::plain(&view));
                }
            }
        });
    }

    #[test]
    fn the_extension_holds_the_view_and_what_a_step_ahead_or_a_turn_needs() {
        let terrain = square_terrain(7);
        let grid = *terrain.grid();
        let block_m = grid.extent_m()[0] / 4.0;
        let before = view_at(&terrain, [0.4, 0.4], 0.6);
        let step = before.axes()[2] * 15.0;
        let now = View { eye_m: before.eye_m + step, ..before };
        let next = View { eye_m: now.eye_m + step, ..now };
        let turned = View { yaw_rad: now.yaw_rad + 0.1, ..now };
        with_records!(terrain.records().unwrap(), records => {
            let slots = |view: &ExtendedView| view.slots(&records, Culling::Vertices);
            let extended = slots(&ExtendedView::after(&before, &now, block_m));
            let missing = |view: &View| {
                let needed = slots(&ExtendedView::plain(view));
                (needed.iter().filter(|s| extended.binary_search(s).is_err()).count(), needed.len())
            };
            assert_eq!(missing(&next).0, 0, "a straight step is foreseen");
            let (missing, needed) = missing(&turned);
            let plain = slots(&ExtendedView::plain(&now));
            let new = slots(&ExtendedView::plain(&turned)).iter().filter(|s| plain.binary_search(s).is_err()).count();
            assert!(missing * 3 < new, "{missing} of {new} new records of {needed} are missing after a turn");
        });
    }

    #[test]
    fn only_motion_along_the_line_of_sight_counts() {
        let terrain = square_terrain(4);
        let before = view_at(&terrain, [0.5, 0.5], 0.0);
        let [right, up, forward] = before.axes();
        let moved = |by: DVec3| {
            let now = View { eye_m: before.eye_m + by, ..before };
            (ExtendedView::after(&before, &now, 0.0).detail.eye_m - now.eye_m).dot(forward)
        };
        assert!((moved(forward * 7.0) - 7.0).abs() < 1e-9);
        assert!((moved(forward * 3.0 + right * 4.0) - 3.0).abs() < 1e-9);
        assert_eq!(moved(forward * -7.0), 0.0);
        assert!(moved(right * 5.0 + up).abs() < 1e-9);
        let extent = ExtendedView::after(&before, &before, 40.0).extent;
        assert!((extent.eye_m - (before.eye_m - forward * 40.0)).length() < 1e-9);
    }
}
