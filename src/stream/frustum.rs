//! Preloading by an extension of the view frustum, for comparison with deadlines.
//!
//! Based on: Qiu et al., section 4: what the eye may need next lies in a larger triangle similar to the frustum's, whose apex lies behind the eye by L, room for
//! turning, and which reaches farther by S = V cos(a) / f, the way of one frame along the line of sight. Here L is the length of 64 samples, their block,
//! and the ground within the extension is refined for the eye where it will be in the next frame.
//!
//! Cost: a walk over the refined ground every frame, twice as much as the view's own.

use crate::metric::{ALL_PLANES, Metric};
use crate::view::View;
use glam::DVec3;
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::order::{CENTRE_SLOT, ROOTS, child_slots, corners};
use terrasoar_layout::store::RecordStore;

/// Samples a side of the paper's blocks.
const BLOCK_SAMPLES: f64 = 64.0;

/// The extension of a moving frustum.
#[derive(Debug, Default)]
pub(super) struct Extension {
    last_eye_m: Option<DVec3>,
    pages: Vec<u64>,
}

struct Walk<'w, S> {
    store: &'w S,
    /// The eye in the next frame, which decides how fine.
    near: Metric,
    /// The extension, which decides where.
    wide: Metric,
    pages: &'w mut Vec<u64>,
}

impl Extension {
    /// Distinct pages that the extension of `view` needs and that are away.
    pub(super) fn pages_away<S: RecordStore>(&mut self, view: &View, store: &S) -> &[u64] {
        let step_m = self.last_eye_m.replace(view.eye_m).map_or(DVec3::ZERO, |last| view.eye_m - last);
        let [_, _, forward] = view.axes();
        let [dx, dy] = store.grid().spacing_m();
        let behind_m = BLOCK_SAMPLES * dx.max(dy) + step_m.dot(forward).abs();
        let near = Metric::new(&View { eye_m: view.eye_m + step_m, ..*view });
        let wide = Metric::new(&View { eye_m: view.eye_m - forward * behind_m, ..*view });
        self.pages.clear();
        let grid = *store.grid();
        let c = corners(grid.k());
        let centre = c[0].midpoint(c[2]);
        let mut walk = Walk { store, near, wide, pages: &mut self.pages };
        for (split, [b, d]) in ROOTS {
            walk.visit(grid.levels() - 1, (CENTRE_SLOT, centre), split, [c[b], c[d]], ALL_PLANES);
        }
        self.pages.sort_unstable();
        self.pages.dedup();
        &self.pages
    }
}

impl<S: RecordStore> Walk<'_, S> {
    fn visit(&mut self, height: u32, apex: (u64, GridPoint), split: u64, [b, d]: [GridPoint; 2], planes: u8) {
        let Some(raw) = self.store.get(split) else {
            return self.pages.push(S::page_of(split));
        };
        let v = b.midpoint(d);
        let vertex = self.store.decode(raw, height - 1);
        let at_m = self.store.grid().position_m(v);
        if !self.near.sight(at_m, &vertex).is_selected() {
            return;
        }
        let planes =
            if planes == 0 { Some(0) } else { self.wide.cull(&self.wide.sight(at_m, &vertex), planes) };
        let Some(planes) = planes.filter(|_| height > 1) else { return };
        let [left, right] = child_slots(apex.0, split);
        self.visit(height - 1, (split, v), left, [b, apex.1], planes);
        self.visit(height - 1, (split, v), right, [apex.1, d], planes);
    }
}
